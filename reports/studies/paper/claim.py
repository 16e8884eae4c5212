"""What a claim of the paper is: its sentence, its place, the rule that judges it, and texts of evidence."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from touchstone.reports.studies.paper.series import Series

Scenes = Mapping[str, Series]


class Finding(NamedTuple):
    """Deciding value and its bound, evidence, why the claim does not hold if so, and a second condition."""

    value: float
    bound: float
    unit: str
    evidence: str
    reason: str
    also: bool = True


@dataclass(frozen=True, slots=True)
class Claim:
    """A statement of the paper and its place there; `basis`: counts, times or poses; `scenes` it needs;
    `relation` of the value to its bound."""

    name: str
    place: str
    text: str
    basis: str
    scenes: tuple[str, ...]
    relation: str
    rule: Callable[[Scenes], Finding]

    def holds(self, found: Finding) -> bool:
        """Whether the value meets its bound, and the second condition holds."""
        return RELATIONS[self.relation](found.value, found.bound) and found.also


RELATIONS: Mapping[str, Callable[[float, float], bool]] = {
    ">=": operator.ge,
    "<=": operator.le,
    ">": operator.gt,
    "=": operator.eq,
}
CLAIMS: list[Claim] = []
Rule = Callable[[Scenes], Finding]


def claim(
    name: str, place: str, text: str, basis: str, scenes: tuple[str, ...], relation: str
) -> Callable[[Rule], Rule]:
    """Add a claim to CLAIMS with the decorated rule."""

    def add(rule: Rule) -> Rule:
        CLAIMS.append(Claim(name, place, text, basis, scenes, relation, rule))
        return rule

    return add


def micro(seconds: Iterable[float]) -> str:
    """Times as text [µs]."""
    return ", ".join(f"{1e6 * one:.3g}" for one in seconds) + " µs"


def percent(*shares: float) -> str:
    """Shares as text [%]."""
    return ", ".join(f"{100 * one:.0f}" for one in shares) + " %"


def numbers(values: Iterable[float]) -> str:
    """Counts as text."""
    return ", ".join(f"{one:.0f}" for one in values)

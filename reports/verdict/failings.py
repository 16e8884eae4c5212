"""Known failings: the documented failings of engines, each a line of `failings.csv` with a cause of
`causes.toml`.

A failing is strict: its row fails once it meets its limit, exceeds `largest`, or is no longer measured. A
line whose subject is `*` covers the subjects that have no line of their own. `largest` is MARGIN times the
measured size; `touchstone failings measure RUNS` writes it, and a row whose line has none fails until then.
Failings of events, of runs that end early (metric `run`) and with noisy trackers have no size.

In a `chaotic` scene rounding, and with it the processor, decides which pairs fail and by how much: one line
covers all of them at CHAOTIC_MARGIN times the largest, and any of them may meet its limit.
"""

from __future__ import annotations

import csv
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping
from functools import cache
from math import ceil, floor, log10
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, BeforeValidator, Field, PlainSerializer, TypeAdapter, ValidationError

from touchstone.reports.results import Row, write_beside

FILE = Path(__file__).with_suffix(".csv")
CAUSES = Path(__file__).with_name("causes.toml")
HARNESS_CAUSES = "harness."
"""Start of the names of causes in our drive, such as the gains of our servo."""
NOISY = ", tracker=noisy"
"""End of the label of columns with noisy trackers."""
EVERY_SUBJECT = "*"
MARGIN = 1.25
"""Ratio of `largest` to the measured size [1]: other processors and versions round differently."""
CHAOTIC_MARGIN = 10.0
"""The same in a chaotic scene [1]."""
STUDIED = ("friction.bias.max", "restitution.bias.max")
"""Metrics of the study `calibration`."""
Name = Annotated[str, Field(min_length=1)]
Key = tuple[str, str, str, str, str]
"""Engine, profile, scene, metric and subject."""


@cache
def causes() -> Mapping[str, str]:
    """Reason of each cause, by its name: "mujoco.soft"."""
    with open(CAUSES, "rb") as file:
        found = TypeAdapter(dict[Name, dict[Name, Name]]).validate_python(tomllib.load(file))
    return {f"{group}.{name}": reason for group, one in found.items() for name, reason in one.items()}


def _of_causes(name: str) -> str:
    if name not in causes():
        raise ValueError(f"no cause of {CAUSES.name}")
    return name


class Failing(BaseModel, frozen=True, extra="forbid"):
    """A line of `failings.csv`: where an engine fails, by how much at most [SI], and why."""

    engine: Name
    profile: Name
    scenario: Name
    metric: Name
    subject: str = ""
    largest: Annotated[
        float | None,
        BeforeValidator(lambda text: text or None),
        PlainSerializer(lambda size: "" if size is None else f"{size:g}"),
    ] = None
    chaotic: Annotated[
        bool,
        BeforeValidator(lambda text: text or False),
        PlainSerializer(lambda chaotic: "yes" if chaotic else ""),
    ] = False
    cause: Annotated[str, BeforeValidator(_of_causes)]

    @property
    def key(self) -> Key:
        """Engine, profile, scene, metric and subject."""
        return (self.engine, self.profile, self.scenario, self.metric, self.subject)

    @property
    def reason(self) -> str:
        """The mechanism."""
        return causes()[self.cause]

    @property
    def is_harness(self) -> bool:
        """Whether our drive causes it, not the engine."""
        return self.cause.startswith(HARNESS_CAUSES)

    @property
    def has_size(self) -> bool:
        """Whether `largest` bounds it."""
        return not (self.metric.startswith("events.") or self.metric == "run" or NOISY in self.profile)

    @property
    def reproduce(self) -> str:
        """The command that shows it."""
        if self.metric in STUDIED:
            return f"touchstone study calibration --engine {self.engine}"
        plain = self.profile.replace(NOISY, "")
        tracker = " --tracker noisy" if NOISY in self.profile else ""
        metric = "" if self.metric == "run" else f" --metric {self.metric}"
        return f"touchstone run {self.scenario} --engine {self.engine} --profile {plain}{tracker}{metric}"


@cache
def known() -> Mapping[Key, Failing]:
    """All known failings."""
    return read(FILE)


def failing_of(row: Row) -> Failing | None:
    """The known failing of a row, if there is one."""
    place = (row.engine, row.profile, row.scenario, row.metric)
    return known().get((*place, row.subject)) or known().get((*place, EVERY_SUBJECT))


def failings_in(engine: str, profile: str, scenario: str) -> list[Failing]:
    """The known failings of a column in a scene."""
    place = (engine, profile, scenario)
    return [failing for key, failing in known().items() if key[:3] == place]


class FailingsError(ValueError):
    """A table of known failings is faulty; the message has a line per fault."""


def read(path: Path) -> dict[Key, Failing]:
    """Known failings of a file; raises FailingsError."""
    with open(path, newline="", encoding="utf-8") as file:
        lines = list(csv.DictReader(file))
    try:
        found = TypeAdapter(list[Failing]).validate_python(lines)
    except ValidationError as error:
        places = ((fault["loc"], fault["msg"]) for fault in error.errors())
        faults = (f"{path}:{int(place[0]) + 2}: {place[-1]}: {text}" for place, text in places)
        raise FailingsError("\n".join(faults)) from error
    counts = Counter(one.key for one in found)
    if twice := [" ".join(key) for key, count in counts.items() if count > 1]:
        raise FailingsError(f"{path}: several lines of {', '.join(twice)}")
    return {one.key: one for one in found}


def write(failings: Iterable[Failing], path: Path) -> None:
    """Write known failings, sorted."""

    def fill(part: Path) -> None:
        with open(part, "w", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(Failing.model_fields), lineterminator="\n")
            table.writeheader()
            table.writerows(one.model_dump() for one in sorted(failings, key=lambda one: one.key))

    write_beside(path, fill)


def bounded(value: float, margin: float = MARGIN) -> float:
    """`margin` times the size of a value, rounded up to two digits."""
    size = abs(value) * margin
    step = 10.0 ** (floor(log10(size)) - 1)
    return float(f"{ceil(size / step) * step:.1e}")

"""Names of pairs of bodies in results: "A-B", and "A-B #k" for the k-th event of a pair."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from touchstone.scenarios.scenario import Scenario

NUMBERED = re.compile(r" #\d+$")


def pair_of(scenario: Scenario, subject: str) -> tuple[int, int]:
    """Indices of the bodies of a subject. Hyphens, spaces and the like in names are no separators."""
    indices = {body.name: k for k, body in enumerate(scenario.bodies)}
    texts = (subject, NUMBERED.sub("", subject))
    ends = ((text[:k], text[k + 1 :]) for text in texts for k in _hyphens(text))
    return next((indices[a], indices[b]) for a, b in ends if a in indices and b in indices)


def ambiguities(names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Places of names that give two pairs one name, and the reason."""
    known = set(names)
    cuts = [(i, name[:k], name[k + 1 :]) for i, name in enumerate(names) for k in _hyphens(name)]
    middles = {tail: (head, names[i]) for i, head, tail in cuts if head in known}
    for i, head, tail in cuts:
        if tail in known and head in middles:
            other, longer = middles[head]
            yield i, f"{other!r} and {names[i]!r} make the same pair as {longer!r} and {tail!r}; rename one"
    for i, name in enumerate(names):
        if (plain := NUMBERED.sub("", name)) != name and plain in known:
            yield i, f"{name!r} reads as a numbered event of {plain!r}; rename one"


def _hyphens(text: str) -> list[int]:
    return [k for k, character in enumerate(text) if character == "-"]

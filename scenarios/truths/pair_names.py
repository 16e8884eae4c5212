"""Names of pairs of bodies in results: "A-B", and "A-B #k" for the k-th event of a pair.

They are for readers; results carry the names of both bodies beside them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

NUMBERED = re.compile(r" #\d+$")


class PairName(str):
    """Name of a pair of bodies, which knows the names of both."""

    body_a: str
    body_b: str

    def __new__(cls, body_a: str, body_b: str, event: int = 0) -> PairName:
        """Name of a pair, or of its event number `event`."""
        name = super().__new__(cls, f"{body_a}-{body_b}" + (f" #{event}" if event else ""))
        name.body_a, name.body_b = body_a, body_b
        return name

    def __reduce__(self) -> tuple[type[PairName], tuple[str, str, int]]:
        number = self[len(f"{self.body_a}-{self.body_b} #") :]
        return PairName, (self.body_a, self.body_b, int(number or 0))


def ambiguities(names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Places of names that give two pairs one name, and the reason."""
    known = set(names)
    cuts = [
        (i, name[:k], name[k + 1 :])
        for i, name in enumerate(names)
        for k, character in enumerate(name)
        if character == "-"
    ]
    middles = {tail: (head, names[i]) for i, head, tail in cuts if head in known}
    for i, head, tail in cuts:
        if tail in known and head in middles:
            other, longer = middles[head]
            yield i, f"{other!r} and {names[i]!r} make the same pair as {longer!r} and {tail!r}; rename one"
    for i, name in enumerate(names):
        if (plain := NUMBERED.sub("", name)) != name and plain in known:
            yield i, f"{name!r} reads as a numbered event of {plain!r}; rename one"

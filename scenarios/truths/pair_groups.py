"""Pairs of bodies with equal facts as few groups: 1,000 equal bodies have 499,500 pairs, and one group."""

from collections.abc import Hashable, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np

NO_PAIR = -1
Facts = TypeVar("Facts", bound=Hashable)


def grouped(
    pairs: Mapping[tuple[str, str], Facts],
) -> Iterator[tuple[Facts, Sequence[str], Sequence[str]]]:
    """Facts, and two lists of names: each of the one with each of the other has these facts. A list with
    itself stands for all pairs of different names in it."""
    names = list(dict.fromkeys(name for pair in pairs for name in pair))
    index = {name: k for k, name in enumerate(names)}
    codes: dict[Facts, int] = {}
    code = np.full((len(names), len(names)), NO_PAIR)
    for (a, b), facts in pairs.items():
        value = codes.setdefault(facts, len(codes))
        code[index[a], index[b]] = code[index[b], index[a]] = value
    facts_of = list(codes)
    classes = _classes(code)
    for i, one in enumerate(classes):
        for other in classes[i:]:
            block = code[np.ix_(one, other)]
            if other is one:
                block = block[~np.eye(len(one), dtype=bool)]
            if block.size and (block == block.flat[0]).all():
                if block.flat[0] != NO_PAIR:
                    yield facts_of[block.flat[0]], [names[k] for k in one], [names[k] for k in other]
                continue
            for row in one:
                for k in other:
                    if code[row, k] != NO_PAIR and (other is not one or row < k):
                        yield facts_of[code[row, k]], [names[row]], [names[k]]


def _classes(code: np.ndarray) -> list[list[int]]:
    """Rows that have the same facts with every row outside, and one fact among themselves, by sums of random
    numbers of 64 bits; a collision makes a block uneven, which is then listed pair by pair."""
    draw = np.random.default_rng(0)
    weight = draw.integers(2**63, size=len(code), dtype=np.uint64)
    value = draw.integers(2**63, size=int(code.max(initial=0)) + 2, dtype=np.uint64)
    outside = np.where(np.eye(len(code), dtype=bool), np.uint64(0), value[code])
    sums = (outside * weight).sum(axis=1, dtype=np.uint64)
    left, found = np.ones(len(code), bool), []
    for own in value:
        _, which, counts = np.unique(sums + weight * own, return_inverse=True, return_counts=True)
        for k in np.flatnonzero(counts > 1):
            if len(rows := np.flatnonzero((which == k) & left)) > 1:
                found.append(rows.tolist())
                left[rows] = False
    return [*found, *([k] for k in np.flatnonzero(left).tolist())]

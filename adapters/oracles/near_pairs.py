"""Pairs of pieces whose bounding boxes overlap, for many frames at a time."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array

POSES_MAX = 200_000
"""Poses of pieces that are kept at a time [1]: little memory in long runs."""
TESTS_MAX = 2_000_000
"""Tests of a pair in a frame that are made at a time [1]."""
ROUNDING = 1e-9
"""Gap of bounding boxes that counts as none [m]."""


def blocks(frames: int, pieces: int) -> Iterator[slice]:
    """The frames of a recording in blocks of at most POSES_MAX poses."""
    length = max(1, POSES_MAX // max(1, pieces))
    for start in range(0, frames, length):
        yield slice(start, min(frames, start + length))


def near_pairs(
    origin: Array, reach: Array, may_meet: NDArray[np.bool_]
) -> Iterator[tuple[int, int, NDArray[np.int64]]]:
    """Pairs p < q of pieces and the frames in which their axis-aligned boxes overlap.

    A pair comes once for each part of the frames. Boxes that hold a piece in all frames of a part leave out
    most pairs; parts are halved until few enough tests remain.

    Args:
        origin: (f, p, 3) [m], world.
        reach: half sides of the boxes along the world's axes (f, p, 3) [m].
        may_meet: pairs to consider (p, p).
    """
    parts = [(0, len(origin))]
    while parts:
        start, end = parts.pop()
        place, size = origin[start:end], reach[start:end]
        p, q = _swept(place, size, may_meet)
        if end - start > 1 and len(p) * (end - start) > TESTS_MAX:
            middle = (start + end) // 2
            parts += [(middle, end), (start, middle)]
            continue
        near = np.ones((end - start, len(p)), dtype=bool)
        for axis in range(3):
            x, half = place[:, :, axis], size[:, :, axis]
            near &= np.abs(x[:, p] - x[:, q]) <= half[:, p] + half[:, q] + ROUNDING
        for k in np.flatnonzero(near.any(axis=0)).tolist():
            yield int(p[k]), int(q[k]), start + np.flatnonzero(near[:, k])


def _swept(
    origin: Array, reach: Array, may_meet: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs p < q whose boxes about all frames overlap."""
    low, high = (origin - reach).min(axis=0), (origin + reach).max(axis=0)
    apart = np.zeros(may_meet.shape, dtype=bool)
    for axis in range(3):
        apart |= low[:, None, axis] > high[None, :, axis] + ROUNDING
    p, q = np.nonzero(np.triu(may_meet & ~apart & ~apart.T, 1))
    return p, q

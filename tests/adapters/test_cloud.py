"""The cloud of the scaling bench: it moves, stays in its cube, and its pairs are all pairs."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.adapters.engines.reference.box_cloud import DENSITY, SPEED, Cloud


@pytest.mark.parametrize("count", [20, 150])
def test_pairs_are_all_pairs(count: int) -> None:
    """Find in every frame what brute force finds."""
    cloud = Cloud(count, np.random.default_rng(count))
    for _ in range(5):
        assert cloud.frame() > 0
        low, high = cloud.pieces["low"], cloud.pieces["high"]
        meet = (low[:, None] <= high).all(axis=2) & (low <= high[:, None]).all(axis=2)
        rows = cloud.pairs[: cloud.found]
        found = set(zip(rows["piece_a"].tolist(), rows["piece_b"].tolist()))
        assert len(found) == cloud.found > 0
        assert found == set(zip(*(k.tolist() for k in np.nonzero(np.triu(meet, 1)))))


def test_boxes_move_and_stay() -> None:
    """Move by SPEED a frame, coherently, and turn back at the walls of a cube of the given density."""
    count = 300
    cloud = Cloud(count, np.random.default_rng(0))
    cloud.frame()
    before = cloud.pieces["low"].copy()
    cloud.frame()
    moved = cloud.pieces["low"] - before
    # 900 numbers: their deviation is good to 2.4 %, four times that
    assert moved.std() == pytest.approx(SPEED, rel=0.1)
    for _ in range(2000):
        cloud.frame()
    side = np.cbrt(count / DENSITY)
    center = cloud.pieces["low"] + 0.5
    # a box turns back one step behind the wall; none is faster than five deviations
    assert np.abs(center).max() < side / 2 + 5 * SPEED
    assert np.ptp(center, axis=0).min() > 0.9 * side

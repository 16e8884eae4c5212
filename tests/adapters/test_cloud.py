"""The cloud of the scaling bench: it moves, stays in its cube, and its pairs are all pairs."""

import numpy as np
import pytest

from touchstone.adapters.engines.reference.box_cloud import Cloud


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

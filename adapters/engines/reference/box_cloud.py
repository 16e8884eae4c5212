"""Benchmark of the reference's broad phase: a cloud of moving boxes, timed within one compiled call per
frame."""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.engines.reference.reference_world import PAIRS_PER_PIECE
from touchstone.reference_impl.broad_phase.spatial_hash import list_pieces
from touchstone.reference_impl.broad_phase.sweep_and_prune import find_pairs
from touchstone.reference_impl.core.conventions import SIMULATED
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import BODY, PAIR, PIECE

DENSITY = 0.6
"""Boxes per unit volume; their sides are 1. Each box overlaps 8 x 0.6 others on average, fewer at the
walls."""
SPEED = 0.01
"""Standard deviation of a box's motion per frame along each axis, relative to its side [1]."""


@kernel
def cloud_frame(pieces, center, velocity, side, pairs, state):  # type: ignore[no-untyped-def]
    """Move unit boxes by one frame, reflect them at the walls of a cube and find their pairs.

    Returns:
        (seconds, found, lost): time of the broad phase [s], pairs found, and pairs dropped at overflow.
    """
    for k in range(len(pieces)):
        for i in range(3):
            if center[k, i] * velocity[k, i] > 0 and abs(center[k, i]) > side / 2:
                velocity[k, i] = -velocity[k, i]
            center[k, i] += velocity[k, i]
            pieces[k]["low"][i], pieces[k]["high"][i] = center[k, i] - 0.5, center[k, i] + 0.5
    start = clock(state[0]["clock"])
    found, lost = find_pairs(pieces, SIMULATED, 0, pairs, state[0])
    return clock(state[0]["clock"]) - start, found, lost


class Cloud:
    """Boxes, one per body, that move in straight lines through a cube; the density does not depend on the
    count."""

    def __init__(self, count: int, rng: np.random.Generator) -> None:
        bodies = np.zeros(count, BODY)
        bodies["kind"], bodies["driver"] = SIMULATED, -1
        self.pieces, self._state = np.zeros(count, PIECE), np.zeros(1, STATE)
        self.pieces["body"] = np.arange(count)
        self.pairs = np.zeros(PAIRS_PER_PIECE * count, PAIR)
        self._side = float(np.cbrt(count / DENSITY))
        self._center = rng.uniform(-self._side / 2, self._side / 2, (count, 3))
        self._velocity = SPEED * rng.normal(size=(count, 3))
        list_pieces(bodies, self.pieces, self._state[0])
        self.found = 0

    def frame(self) -> float:
        """Advance one frame and return the time of its broad phase [s]; `pairs[:found]` holds its pairs."""
        seconds, self.found, lost = cloud_frame(
            self.pieces, self._center, self._velocity, self._side, self.pairs, self._state
        )
        if lost:
            raise AdapterError(f"reference: {lost} pairs found no room")
        return float(seconds)

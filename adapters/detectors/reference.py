"""The reference's `convex_depth` as a detector: a batch of pairs in one compiled call, timed inside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version

import numpy as np

from adapters.detectors import UNCONVERGED, Answers, Failure, Pair
from adapters.engine import Array, Scalar
from adapters.translation import piece_arrays
from reference_impl import conventions
from reference_impl.convex_depth import convex_depth
from reference_impl.kernel import clock, kernel
from reference_impl.shapes import place_piece
from reference_impl.world import BODY, PAIR, STATE


@kernel
def depth_batch(pieces, vertices, state, out_pairs, out_converged, out_seconds):  # type: ignore[no-untyped-def]
    """Signed distance of pieces 2k and 2k + 1 to `out_pairs[k]`, and the seconds each took."""
    for k in range(len(out_pairs)):
        start = clock(state[0]["clock"])
        _, converged = convex_depth(pieces[2 * k], pieces[2 * k + 1], vertices, state[0], out_pairs[k])
        out_seconds[k] = clock(state[0]["clock"]) - start
        out_converged[k] = converged


class ReferenceDetector:
    """GJK outside and EPA inside, to rounding."""

    crossings = None

    def prepare(self, pairs: Sequence[Pair]) -> ReferenceBatch:
        """Lay pairs out as the kernel's arrays."""
        return ReferenceBatch(pairs)

    def describe(self) -> Mapping[str, Scalar]:
        """The project's version and the tolerances of `conventions.py`."""
        return {
            "version": version("touchstone"),
            "depth_tolerance": conventions.DEPTH_TOLERANCE,
            "distance_tolerance": conventions.DISTANCE_TOLERANCE,
        }


class ReferenceBatch:
    """Pieces in the kernel's arrays; `ask` is one compiled call."""

    def __init__(self, pairs: Sequence[Pair]) -> None:
        self._pieces, self._vertices = piece_arrays([(0, piece) for pair in pairs for piece in pair])
        still = np.zeros(1, BODY)
        still["rotation"] = np.eye(3)
        for row in self._pieces:
            place_piece(row, still[0], self._vertices, 0.0)
        self._state, self._pairs = np.zeros(1, STATE), np.zeros(len(pairs), PAIR)
        self._converged = np.zeros(len(pairs), dtype=bool)

    def ask(self) -> Array:
        """Seconds of each query, clocked inside the one compiled call."""
        seconds = np.zeros(len(self._pairs))
        depth_batch(self._pieces, self._vertices, self._state, self._pairs, self._converged, seconds)
        return seconds

    def answers(self) -> Answers:
        """Distances and normals; queries that did not converge are named."""
        failures = {
            int(k): Failure(UNCONVERGED, "reference: room for EPA's vertices ran out, or rounding stopped it")
            for k in np.flatnonzero(~self._converged)
        }
        return Answers(self._pairs["distance"].copy(), self._pairs["normal"].copy(), failures)

    def close(self) -> None:
        """Nothing to free."""

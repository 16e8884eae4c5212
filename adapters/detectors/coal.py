"""coal's signed distance, with default tolerances or those of the overlap oracle.

Conventions: `result.normal` points from the first shape to the second; distance is negative in overlap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import coal
import numpy as np

from touchstone.adapters.contract import Array, Scalar
from touchstone.adapters.detectors import APART, TOUCHING, Pair, PythonBatch, Query
from touchstone.adapters.engines.reference.reference_world import matrix
from touchstone.adapters.oracles.overlap import ITERATIONS, TOLERANCE, coal_shape
from touchstone.scenarios.scenario import Piece


class CoalDetector:
    """`coal.distance`; `tight` uses the oracle's tolerance and iterations."""

    crossings = (APART, TOUCHING)

    def __init__(self, tight: bool = False) -> None:
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True
        if tight:
            self._request.gjk_tolerance = self._request.epa_tolerance = TOLERANCE
            self._request.gjk_max_iterations = self._request.epa_max_iterations = ITERATIONS

    def prepare(self, pairs: Sequence[Pair]) -> PythonBatch:
        """Build shapes and poses."""
        return PythonBatch(self._query, pairs, lambda: None)

    def describe(self) -> Mapping[str, Scalar]:
        """Version, tolerances [m] and caps."""
        request = self._request
        return {
            "version": coal.__version__,
            "call": "distance",
            "gjk_tolerance": request.gjk_tolerance,
            "epa_tolerance": request.epa_tolerance,
            "gjk_max_iterations": request.gjk_max_iterations,
            "epa_max_iterations": request.epa_max_iterations,
        }

    def _query(self, pair: Pair) -> Query:
        (a, b), (pose_a, pose_b) = [_shape(piece.shape) for piece in pair], map(_pose, pair)
        request, result = self._request, coal.DistanceResult()

        def ask() -> float:
            result.clear()
            distance: float = coal.distance(a, pose_a, b, pose_b, request, result)
            return distance

        def read(distance: float) -> tuple[float, Array]:
            return distance, np.array(result.normal)

        return Query(ask, read)


_shape = cache(coal_shape)


def _pose(piece: Piece) -> Any:
    return coal.Transform3s(matrix(piece.orientation), np.array(piece.position))

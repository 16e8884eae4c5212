"""coal's signed distance, with default tolerances or those of the overlap oracle; cold, or warm-started by
its cached guess.

Conventions: `result.normal` points from the first shape to the second; distance is negative in overlap.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from time import perf_counter
from typing import Any

import coal
import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Scalar
from touchstone.adapters.detectors import FRAME_STEP, Answers, Pair, PythonDetector, Query
from touchstone.adapters.engines.reference.reference_world import matrix
from touchstone.adapters.oracles.overlap import ITERATIONS, TOLERANCE, coal_shape
from touchstone.scenarios.scenario import Piece


class CoalDetector(PythonDetector):
    """`coal.distance`; `tight` uses the oracle's tolerance and iterations."""

    def __init__(self, tight: bool = False) -> None:
        self._request = coal.DistanceRequest()
        self._request.enable_signed_distance = True
        if tight:
            self._request.gjk_tolerance = self._request.epa_tolerance = TOLERANCE
            self._request.gjk_max_iterations = self._request.epa_max_iterations = ITERATIONS

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


class WarmCoal(CoalDetector):
    """`coal.distance` from the guess that the previous frame's query of the pair left (CachedGuess).

    The guess is handed over between the timed calls: coal's own ComputeDistance does that inside C++.
    """

    def prepare(self, pairs: Sequence[Pair]) -> WarmBatch:  # type: ignore[override]
        """Build shapes, poses and those of the previous frame."""
        return WarmBatch(pairs, [_before(pair) for pair in pairs], len(pairs))

    def follow(self, pairs: Sequence[Pair], frame: int) -> WarmBatch:
        """Build the shapes and poses of a motion."""
        return WarmBatch(pairs, [None] * len(pairs), frame)

    def describe(self) -> Mapping[str, Scalar]:
        """As of the cold detector, and the motion since the previous frame."""
        return {**super().describe(), "gjk_initial_guess": "CachedGuess", "frame_step": FRAME_STEP}


class WarmBatch:
    """Queries in order; those of one pair, `frame` queries apart, share a request that holds the guess.

    A query that has a pair of earlier poses is preceded by an untimed query at these.
    """

    def __init__(self, pairs: Sequence[Pair], earlier: Sequence[Pair | None], frame: int) -> None:
        self._queries = [_arguments(pair) for pair in pairs]
        self._earlier = [None if pair is None else _arguments(pair) for pair in earlier]
        self._requests = [_warm_request() for _ in range(frame)]
        self._result = coal.DistanceResult()
        self._distance, self._normal = np.zeros(len(pairs)), np.zeros((len(pairs), 3))

    def ask(self) -> Array:
        seconds = np.zeros(len(self._queries))
        for k, (query, before) in enumerate(zip(self._queries, self._earlier)):
            request = self._requests[k % len(self._requests)]
            if before is not None:
                self._run(before, request)
            seconds[k], self._distance[k] = self._run(query, request)
            self._normal[k] = self._result.normal
        return seconds

    def _run(self, query: tuple[Any, ...], request: Any) -> tuple[float, float]:
        result = self._result
        start = perf_counter()
        result.clear()
        distance = coal.distance(*query, request, result)
        seconds = perf_counter() - start
        request.updateGuess(result)
        return seconds, distance

    def answers(self) -> Answers:
        return Answers(self._distance.copy(), self._normal.copy(), {})

    def close(self) -> None:
        self._queries, self._earlier = [], []


def _warm_request() -> Any:
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_initial_guess = coal.GJKInitialGuess.CachedGuess
    return request


def _arguments(pair: Pair) -> tuple[Any, ...]:
    (a, b), (pose_a, pose_b) = [_shape(piece.shape) for piece in pair], map(_pose, pair)
    return a, pose_a, b, pose_b


def _before(pair: Pair) -> Pair:
    """The pair with B as it was in the previous frame: moved and turned by FRAME_STEP."""
    sizes = []
    for piece in pair:
        shape: Any = _shape(piece.shape)
        shape.computeLocalAABB()
        sizes.append(float(max(shape.aabb_local.max_ - shape.aabb_local.min_)))
    a, b = pair
    moved = np.array(b.position) + FRAME_STEP * min(sizes) / np.sqrt(3)
    turn = Rotation.from_rotvec(FRAME_STEP / np.sqrt(3) * np.ones(3))
    turned = (turn * Rotation.from_quat(b.orientation, scalar_first=True)).as_quat(scalar_first=True)
    return a, replace(b, position=tuple(moved.tolist()), orientation=tuple(turned.tolist()))


_shape = cache(coal_shape)


def _pose(piece: Piece) -> Any:
    return coal.Transform3s(matrix(piece.orientation), np.array(piece.position))

"""The reference's narrow phase as detectors: exact depth, and warm-started depth.

A batch of pairs is one compiled call, which times each query itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Scalar
from touchstone.adapters.detectors import FRAME_STEP, UNCONVERGED, Answers, Failure, Pair
from touchstone.adapters.engines.reference import ENTRY
from touchstone.adapters.engines.reference.reference_world import piece_arrays
from touchstone.reference_impl.core import conventions
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import BODY, PAIR
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.geometry.depth_cache import find_entry
from touchstone.reference_impl.geometry.depth_warm_start import warm_started_depth
from touchstone.reference_impl.geometry.shapes import place_piece

EMPTY_CALLS = 100
"""Number of empty queries timed per batch."""


@kernel
def depth_batch(pieces, vertices, state, out_pairs, out_converged, out_seconds):  # type: ignore[no-untyped-def]
    """Signed distance of pieces 2k and 2k + 1, written to `out_pairs[k]`, and the time of each query [s]."""
    for k in range(len(out_pairs)):
        start = clock(state[0]["clock"])
        _, converged = convex_depth(pieces[2 * k], pieces[2 * k + 1], vertices, state[0], out_pairs[k])
        out_seconds[k] = clock(state[0]["clock"]) - start
        out_converged[k] = converged


@kernel
def walk_batch(  # type: ignore[no-untyped-def]
    pieces, before, vertices, state, out_pairs, out_converged, out_seconds
):
    """As `depth_batch`, warm-started from the untimed answer for the poses in `before`."""
    for k in range(len(out_pairs)):
        a, b = 2 * k, 2 * k + 1
        warm_started_depth(before[a], before[b], vertices, state[0], find_entry(state[0], a, b), out_pairs[k])
        start = clock(state[0]["clock"])
        _, converged, certified = warm_started_depth(
            pieces[a], pieces[b], vertices, state[0], find_entry(state[0], a, b), out_pairs[k]
        )
        out_seconds[k] = clock(state[0]["clock"]) - start
        out_converged[k] = converged and certified


@kernel
def walk_motion(  # type: ignore[no-untyped-def]
    pieces, vertices, frame, state, out_pairs, out_converged, out_held, out_seconds
):
    """As `depth_batch`, with each run of `frame` pairs warm-started from the previous frame.

    `out_held`: whether the first iteration certified the previous answer.
    """
    for k in range(len(out_pairs)):
        start = clock(state[0]["clock"])
        memory = find_entry(state[0], k % frame, frame)
        steps, converged, certified = warm_started_depth(
            pieces[2 * k], pieces[2 * k + 1], vertices, state[0], memory, out_pairs[k]
        )
        out_seconds[k] = clock(state[0]["clock"]) - start
        out_converged[k] = converged and certified
        out_held[k] = certified and steps == 1


@kernel
def empty_batch(state, out_seconds):  # type: ignore[no-untyped-def]
    """Time of reading the clock [s]."""
    for k in range(len(out_seconds)):
        start = clock(state[0]["clock"])
        out_seconds[k] = clock(state[0]["clock"]) - start


class ReferenceDetector:
    """GJK if separated, EPA if overlapping, to rounding."""

    crossings = None

    def prepare(self, pairs: Sequence[Pair]) -> ReferenceBatch:
        """Convert pairs to the kernel's arrays."""
        return ReferenceBatch(pairs)

    def describe(self) -> Mapping[str, Scalar]:
        """Version of the project and tolerances of `conventions.py`."""
        return {
            "version": version(ENTRY.distribution),
            "depth_tolerance": conventions.DEPTH_TOLERANCE,
            "distance_tolerance": conventions.DISTANCE_TOLERANCE,
        }


class WalkDetector(ReferenceDetector):
    """The same answers by `warm_started_depth`, from those of a previous frame."""

    def prepare(self, pairs: Sequence[Pair]) -> ReferenceBatch:
        """Convert pairs and their previous poses to the kernel's arrays."""
        return WalkBatch(pairs)

    def follow(self, pairs: Sequence[Pair], frame: int) -> ReferenceBatch:
        """Convert a motion to the kernel's arrays."""
        return MotionBatch(pairs, frame)

    def describe(self) -> Mapping[str, Scalar]:
        """Version and tolerances, and the motion since the previous frame."""
        return {**super().describe(), "walk_gap": conventions.WARM_START_GAP, "frame_step": FRAME_STEP}


class ReferenceBatch:
    """Pieces in the kernel's arrays; `ask` is one compiled call."""

    def __init__(self, pairs: Sequence[Pair]) -> None:
        self._pieces, self._vertices = piece_arrays([(0, piece) for pair in pairs for piece in pair])
        self._place(self._pieces)
        self._state, self._pairs = np.zeros(1, STATE), np.zeros(len(pairs), PAIR)
        self._converged = np.zeros(len(pairs), dtype=bool)

    def _place(self, pieces: Array) -> None:
        still = np.zeros(1, BODY)
        still["rotation"] = np.eye(3)
        for row in pieces:
            place_piece(row, still[0], self._vertices, 0.0)

    def ask(self) -> Array:
        """Time of each query inside the compiled call, minus that of an empty query [s]."""
        seconds = np.zeros(len(self._pairs))
        depth_batch(self._pieces, self._vertices, self._state, self._pairs, self._converged, seconds)
        return self._less_empty(seconds)

    def _less_empty(self, seconds: Array) -> Array:
        empty = np.zeros(EMPTY_CALLS)
        empty_batch(self._state, empty)
        return np.asarray(seconds - np.median(empty))

    def answers(self) -> Answers:
        """Distances and normals; lists queries that did not converge."""
        failures = {
            int(k): Failure(UNCONVERGED, "reference: room for EPA's vertices ran out, or rounding stopped it")
            for k in np.flatnonzero(~self._converged)
        }
        return Answers(self._pairs["distance"].copy(), self._pairs["normal"].copy(), failures)

    def close(self) -> None:
        """Release nothing: the batch holds no external resources."""


class WalkBatch(ReferenceBatch):
    """Pieces at their poses and at those of the previous frame."""

    def __init__(self, pairs: Sequence[Pair]) -> None:
        super().__init__(pairs)
        self._state["depth"] = conventions.DEPTH_CERTIFIED
        self._before = self._pieces.copy()
        sizes = (self._pieces["high"] - self._pieces["low"]).max(axis=1).reshape(-1, 2).min(axis=1)
        moved = self._before[1::2]
        moved["position"] += FRAME_STEP * sizes[:, None] / np.sqrt(3)
        moved["rotation"] = (
            Rotation.from_rotvec(FRAME_STEP / np.sqrt(3) * np.ones(3)).as_matrix() @ moved["rotation"]
        )
        self._place(self._before)

    def ask(self) -> Array:
        """Time of each query, run right after the query at the previous poses [s]."""
        seconds = np.zeros(len(self._pairs))
        walk_batch(
            self._pieces, self._before, self._vertices, self._state, self._pairs, self._converged, seconds
        )
        return self._less_empty(seconds)


class MotionBatch(ReferenceBatch):
    """Pieces frame by frame; each pair's depth cache persists from one `ask` to the next."""

    def __init__(self, pairs: Sequence[Pair], frame: int) -> None:
        super().__init__(pairs)
        self._state["depth"] = conventions.DEPTH_CERTIFIED
        self._frame, self._held = frame, np.zeros(len(pairs), dtype=bool)

    def ask(self) -> Array:
        """Time of each query, in order [s]."""
        seconds = np.zeros(len(self._pairs))
        walk_motion(
            self._pieces,
            self._vertices,
            self._frame,
            self._state,
            self._pairs,
            self._converged,
            self._held,
            seconds,
        )
        return self._less_empty(seconds)

    def answers(self) -> Answers:
        """Answers with `held`: whether the previous frame's answer was certified."""
        return replace(super().answers(), held=self._held.copy())

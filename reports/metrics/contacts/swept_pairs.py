"""Culls pairs of pieces that cannot overlap deeply between two frames, by boxes and balls, without the
oracle.

A pair remains where the bounding balls of both pieces overlap by a required depth on their chords, and where
the extents of each cut as deep into the other's box.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts.swept_boxes import Motions, Pair, extent
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Piece, Shape, Sphere

LARGE_TURN = 1.0
"""Turn within a frame from which a ball bounds a piece [rad]: extents at the turn's ends are not enough."""


class SweptPairs:
    """The pieces of a scene over a recording, with the bounds of their motions."""

    def __init__(self, context: Context, motions: Motions) -> None:
        self._motions = motions
        bodies = context.scenario.bodies
        self.pieces: list[tuple[int, Piece]] = []
        self.pieces += [(k, piece) for k, body in enumerate(bodies) for piece in body.pieces]
        self._body = np.array([k for k, _ in self.pieces], dtype=int)
        extents = [extent(motions, k, piece) for k, piece in self.pieces]
        self._outer = np.array([e.outer for e in extents])
        self._inner = np.array([e.inner for e in extents])
        offset = np.array([e.reach - e.outer for e in extents])
        local = np.array([e.center for e in extents]).reshape(-1, 3)
        mass_center = np.array([bodies[k].center_of_mass for k in self._body]).reshape(-1, 3)
        turned = motions.rotation[:, self._body]
        self._center = motions.center[:, self._body] + np.einsum("fmij,mj->fmi", turned, local - mass_center)
        self._angle = np.linalg.norm(motions.turn, axis=2)[:, self._body]
        # A centre off the mass centre moves on an arc; this is the arc's distance from the chord.
        self._bulge = offset * _bulge(self._angle)
        self._may_touch = np.zeros((len(bodies), len(bodies)), dtype=bool)
        for a, b in context.scenario.touching_pairs():
            self._may_touch[a, b] = self._may_touch[b, a] = True
        self._moving = np.array([body.kind != "fixed" for body in bodies])[self._body]
        self._extents: dict[tuple[int, int], tuple[Array, Array]] = {}

    def pairs(self, depth_share: float) -> Iterator[tuple[Pair, NDArray[np.int64]]]:
        """Pairs, the first body first, and the steps from frame to frame in which they can overlap by
        `depth_share` of the sum of their inner radii."""
        order = np.arange(len(self.pieces))
        for p in np.flatnonzero(self._moving).tolist():
            partner = self._may_touch[self._body[p], self._body] & (~self._moving | (order > p))
            others = np.flatnonzero(partner)
            if not len(others):
                continue
            near = self._nearest(p, others) <= 0
            for q in others[near.any(axis=0)].tolist():
                steps = np.flatnonzero(self._deep(p, q, depth_share))
                if len(steps):
                    low, high = sorted((p, q), key=lambda k: (self._body[k], k))
                    (a, one), (b, two) = self.pieces[low], self.pieces[high]
                    yield Pair(self._motions, a, one, b, two), steps

    def _nearest(self, p: int, others: NDArray[np.int64]) -> Array:
        """Distance between the bounding balls of pieces on chords, per step and other piece (f - 1, o)
        [m]."""
        apart = self._center[:, others] - self._center[:, [p]]
        start, way = apart[:-1], np.diff(apart, axis=0)
        square = np.einsum("foi,foi->fo", way, way)
        share = -np.einsum("foi,foi->fo", start, way) / np.where(square > 0, square, 1.0)
        nearest = np.linalg.norm(start + np.clip(share, 0.0, 1.0)[..., None] * way, axis=2)
        reach = self._outer[p] + self._outer[others] + self._bulge[:, [p]] + self._bulge[:, others]
        return np.asarray(nearest - reach)

    def _deep(self, p: int, q: int, depth_share: float) -> NDArray[np.bool_]:
        """Mask of the steps in which neither piece's box bounds the depth below the required one (f - 1,)."""
        depth = depth_share * (self._inner[p] + self._inner[q])
        found = self._nearest(p, np.array([q]))[:, 0] <= -depth
        for one, two in ((p, q), (q, p)):
            if found.any() and isinstance(self.pieces[one][1].shape, Box | Hull):
                found &= self._crosses_box(one, two, depth)
        return found

    def _crosses_box(self, one: int, two: int, depth: float) -> NDArray[np.bool_]:
        """Whether the chord of `two` cuts to `depth` [m] into the box of `one`, in `one`'s axes (f - 1,)."""
        low, high = self._box_of(one)
        lows, highs = self._extent_in(one, two)
        middle, half = (lows + highs) / 2, (highs - lows) / 2
        turn = self._angle[:, one] + self._angle[:, two]
        far = np.linalg.norm(middle - (low + high) / 2, axis=1)
        far = np.maximum(far[:-1], far[1:])
        grown = np.maximum(half[:-1], half[1:])
        grown = np.where((turn > LARGE_TURN)[:, None], np.maximum(grown, self._outer[two]), grown)
        grown += (self._outer[two] * np.minimum(turn, LARGE_TURN))[:, None]
        # In the axes of a turning piece the chord is an arc; its middle is that far from the mass centre's
        # chord.
        slack = far * _bulge(self._angle[:, one]) + self._bulge[:, one] + self._bulge[:, two]
        reach = (high - low) / 2 + grown + slack[:, None] - depth
        start, end = middle[:-1] - (low + high) / 2, middle[1:] - (low + high) / 2
        return _segment_meets_box(start, end - start, reach)

    def _box_of(self, k: int) -> tuple[Array, Array]:
        shape = self.pieces[k][1].shape
        lows, highs = _extents(shape, np.eye(3)[None])
        return lows[0], highs[0]

    def _extent_in(self, one: int, two: int) -> tuple[Array, Array]:
        """Lowest and highest coordinates of piece `two` at every frame in the axes of piece `one` (f, 3)."""
        turn_one, origin_one = self._placed(one)
        turn_two, origin_two = self._placed(two)
        lows, highs = _extents(self.pieces[two][1].shape, turn_one.swapaxes(1, 2) @ turn_two)
        origin = np.einsum("fji,fj->fi", turn_one, origin_two - origin_one)
        return origin + lows, origin + highs

    @cached_property
    def _places(self) -> dict[int, tuple[Array, Array]]:
        return {}

    def _placed(self, k: int) -> tuple[Array, Array]:
        """Rotation matrix and origin of a piece in every frame."""
        if k not in self._places:
            body, piece = self.pieces[k]
            turned = self._motions.rotation[:, body]
            own = Rotation.from_quat(piece.orientation, scalar_first=True).as_matrix()
            arm = np.array(piece.position) - np.array(self._motions.bodies[body].center_of_mass)
            self._places[k] = (turned @ own, self._motions.center[:, body] + turned @ arm)
        return self._places[k]


def _bulge(angle: Array) -> Array:
    """Largest distance of an arc of radius 1 from its chord, by the arc's angle [rad]."""
    return np.where(angle < np.pi, 1 - np.cos(np.minimum(angle, np.pi) / 2), 2.0)


def _extents(shape: Shape, turned: Array) -> tuple[Array, Array]:
    """Lowest and highest coordinates (n, 3) of a shape after rotations (n, 3, 3)."""
    match shape:
        case Sphere(radius):
            half = np.full((len(turned), 3), radius)
        case Box(extents):
            half = np.abs(turned) @ np.array(extents)
        case Capsule(radius, half_length):
            half = np.abs(turned[:, :, 2]) * half_length + radius
        case Ellipsoid(axes):
            half = np.linalg.norm(turned * np.array(axes), axis=2)
        case Hull(vertices):
            points = np.einsum("nij,vj->nvi", turned, np.array(vertices))
            return points.min(axis=1), points.max(axis=1)
    return -half, half


def _segment_meets_box(start: Array, way: Array, half: Array) -> NDArray[np.bool_]:
    """Whether segments from `start` along `way` (n, 3) meet boxes of half sides (n, 3) at the origin."""
    with np.errstate(divide="ignore", invalid="ignore"):
        one, two = (-half - start) / way, (half - start) / way
    inside = np.abs(start) <= half
    enter = np.where(way == 0, np.where(inside, -np.inf, np.inf), np.minimum(one, two))
    leave = np.where(way == 0, np.where(inside, np.inf, -np.inf), np.maximum(one, two))
    fits = (half > 0).all(axis=1)
    met = np.maximum(enter.max(axis=1), 0.0) <= np.minimum(leave.min(axis=1), 1.0)
    return np.asarray(fits & met)

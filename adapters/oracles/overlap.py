"""Signed distances of body pairs, equal for all engines: python-fcl's broad phase and coal's narrow phase.

Conventions as in `contract.py`: distances are negative in overlap, normals point from A to B. Pieces farther
apart than `MARGIN` are not candidates, unless their bodies are requested by name.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import Any

import coal
import fcl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Array
from touchstone.adapters.recording import Recording
from touchstone.scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Scenario, Shape, Sphere

Pose = tuple[Array, Array]
"""Rotation matrix (3, 3) and position (3,)."""
Places = dict[bytes, list[int]]
"""Pieces by the position of their boxes: the bytes of that position."""
MARGIN = 0.02
"""Distance within which pieces are candidates [m]: wider than the collision margin of any engine."""
TOLERANCE = 1e-8
"""coal's GJK and EPA tolerance [m]: a hundredth of the 1e-6 m that is required of a depth."""
DOUBTFUL = 1e-4
"""Depth above which a pair is queried in both orders [m]: exact engines rarely overlap by as much."""
BLOCK = 256
"""Frames whose poses are computed at a time [1]: few calls, and little memory in long runs."""
PAIRS_MAX = 500
"""Pairs of pieces up to which frames without any near pair are found at once [1]: beyond, the tree is
faster."""
ROUNDING = 1e-9
"""Gap of bounding boxes that counts as none [m]."""
ITERATIONS = 1000
"""coal's iteration caps: high enough that queries end by tolerance only."""


@dataclass(frozen=True, slots=True)
class Distances:
    """Signed distance of body pairs over the frames of a recording.

    `distance[(a, b)]` is (f,) [m], +inf if no pieces of the pair are within MARGIN; normal and midpoint of
    the nearest pieces (f, 3) are then NaN.
    """

    distance: dict[tuple[int, int], Array]
    normal: dict[tuple[int, int], Array]
    point: dict[tuple[int, int], Array]

    def overlap(self) -> Array:
        """Depth of the deepest body pair per frame (f,) [m]."""
        deepest = np.min(np.array(list(self.distance.values())), axis=0)
        return np.maximum(0.0, -deepest)


def measure(recording: Recording, scenario: Scenario, asked: Iterable[tuple[int, int]] = ()) -> Distances:
    """Distances of all body pairs that may touch, in every frame; `asked` pairs are always computed."""
    return _Oracle(scenario, set(asked)).run(recording)


class _Oracle:
    """Distance computation over a recording.

    Fixed bodies that do not move are placed once and never tested against each other; all other bodies are
    `moving`.
    """

    def __init__(self, scenario: Scenario, asked: set[tuple[int, int]]) -> None:
        self.asked = asked
        self.pairs = list(scenario.touching_pairs())
        wanted = set(self.pairs)
        pieces = [(i, piece) for i, body in enumerate(scenario.bodies) for piece in body.pieces]
        self.body = [i for i, _ in pieces]
        self.shapes = [coal_shape(piece.shape) for _, piece in pieces]
        self.own_position = np.array([piece.position for _, piece in pieces])
        own = np.array([piece.orientation for _, piece in pieces])
        self.own_rotation = Rotation.from_quat(own, scalar_first=True).as_matrix()
        self.half = np.array([_inflated(piece.shape) / 2 for _, piece in pieces]).reshape(-1, 3)
        self.boxes = [fcl.CollisionObject(fcl.Box(*_inflated(piece.shape))) for _, piece in pieces]
        self.fixed = [body.kind == "fixed" for body in scenario.bodies]
        count = len(pieces)
        self.always = {
            (p, q)
            for p in range(count)
            for q in range(p + 1, count)
            if (self.body[p], self.body[q]) in self.asked
        }
        self.may_meet = [[(i, j) in wanted for j in self.body] for i in self.body]

    def run(self, recording: Recording) -> Distances:
        frames = len(recording.time)
        distance = {pair: np.full(frames, np.inf) for pair in self.pairs}
        normal = {pair: np.full((frames, 3), np.nan) for pair in self.pairs}
        point = {pair: np.full((frames, 3), np.nan) for pair in self.pairs}
        poses = _posed(*self._poses(recording, slice(0, 1)), 0)
        stays = (np.ptp(recording.position, axis=0) == 0).all(axis=1) & self.fixed
        stays &= (np.ptp(recording.orientation, axis=0) == 0).all(axis=1)
        still = np.flatnonzero(stays[self.body]).tolist()
        self.moving = np.flatnonzero(~stays[self.body]).tolist()
        moves = set(self.moving)
        self.meeting = [
            (p, q)
            for p in range(len(self.body))
            for q in range(p + 1, len(self.body))
            if (p in moves or q in moves) and self.may_meet[p][q]
        ]
        self.still_places, self.still_manager = self._managed(still, poses)
        self.moving_places, self.moving_manager = self._managed(self.moving, poses)
        for f in range(frames):
            if f % BLOCK == 0:
                block = self._poses(recording, slice(f, f + BLOCK))
                near = self._near(*block)
            if not (near[f % BLOCK] or self.always):
                continue
            moved = _posed(*block, f % BLOCK)
            for k in self.moving:
                poses[k] = moved[k]
            for p, q in self._candidates(poses):
                pair = (self.body[p], self.body[q])
                value, along, middle = signed_distance(self.shapes[p], poses[p], self.shapes[q], poses[q])
                # Farther pieces are candidates by chance: the nearest pieces may not be among them.
                if value < distance[pair][f] and (value <= MARGIN or pair in self.asked):
                    distance[pair][f], normal[pair][f], point[pair][f] = value, along, middle
        return Distances(distance, normal, point)

    def _poses(self, recording: Recording, frames: slice) -> tuple[Array, Array]:
        """Rotations (f, p, 3, 3) and origins (f, p, 3) [m] of all pieces."""
        count = recording.position.shape[1]
        flat = recording.orientation[frames].reshape(-1, 4)
        bodies = Rotation.from_quat(flat, scalar_first=True).as_matrix().reshape(-1, count, 3, 3)
        turned = bodies[:, self.body]
        origin = recording.position[frames][:, self.body] + (turned @ self.own_position[..., None])[..., 0]
        return turned @ self.own_rotation, origin

    def _near(self, turned: Array, origin: Array) -> NDArray[np.bool_]:
        """Frames (f,) in which the bounding boxes of any pair may overlap; all frames in scenes of many
        pairs."""
        p, q = np.array(self.meeting, dtype=int).reshape(-1, 2).T
        if len(p) > PAIRS_MAX:
            return np.ones(len(origin), dtype=bool)
        reach = (np.abs(turned) @ self.half[..., None])[..., 0]
        apart = np.abs(origin[:, p] - origin[:, q]) - (reach[:, p] + reach[:, q])
        near: NDArray[np.bool_] = (apart <= ROUNDING).all(axis=2).any(axis=1)
        return near

    def _managed(self, pieces: list[int], poses: list[Pose]) -> tuple[Places, Any]:
        places: Places = {}
        self._place(pieces, poses, places)
        manager = fcl.DynamicAABBTreeCollisionManager()
        manager.registerObjects([self.boxes[k] for k in pieces])
        manager.setup()
        return places, manager

    def _place(self, pieces: list[int], poses: list[Pose], places: Places) -> None:
        """Place the boxes of pieces. Callbacks receive copies of the boxes: `places` identifies them by
        position."""
        places.clear()
        for k in pieces:
            box = self.boxes[k]
            box.setTransform(fcl.Transform(*poses[k]))
            places.setdefault(box.getTranslation().tobytes(), []).append(k)

    def _candidates(self, poses: list[Pose]) -> set[tuple[int, int]]:
        self._place(self.moving, poses, self.moving_places)
        self.moving_manager.update()
        found = set(self.always)

        def keep(one: fcl.CollisionObject, two: fcl.CollisionObject, _: object) -> bool:
            first, second = one.getTranslation().tobytes(), two.getTranslation().tobytes()
            for p in self._at(first):
                for q in self._at(second):
                    low, high = (p, q) if p < q else (q, p)
                    if self.may_meet[low][high]:
                        found.add((low, high))
            return False

        self.moving_manager.collide(None, keep)
        self.moving_manager.collide(self.still_manager, None, keep)
        return found

    def _at(self, place: bytes) -> list[int]:
        """Fixed and moving pieces whose boxes are at a position."""
        return self.moving_places.get(place, []) + self.still_places.get(place, [])


def _posed(turned: Array, origin: Array, frame: int) -> list[Pose]:
    """Poses of all pieces in a frame."""
    return list(zip(turned[frame], origin[frame]))


def signed_distance(
    shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose
) -> tuple[float, Array, Array]:
    """Signed distance [m], normal A to B and midpoint of the witnesses of two posed coal shapes.

    coal's EPA may end at a face of the difference that is not the nearest. Each face bounds the depth from
    above, so deep overlaps are queried in both orders and the shallower result is returned.
    """
    value, normal, middle = _asked(shape_a, pose_a, shape_b, pose_b)
    if value < -DOUBTFUL:
        other, reverse, place = _asked(shape_b, pose_b, shape_a, pose_a)
        if other > value:
            return other, -reverse, place
    return value, normal, middle


def _asked(shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose) -> tuple[float, Array, Array]:
    """Signed distance, normal and midpoint from one query."""
    result = coal.DistanceResult()
    value = coal.distance(
        shape_a, coal.Transform3s(*pose_a), shape_b, coal.Transform3s(*pose_b), _request(), result
    )
    middle = (np.array(result.getNearestPoint1()) + np.array(result.getNearestPoint2())) / 2
    return float(value), np.array(result.normal), middle


@cache
def _request() -> coal.DistanceRequest:
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = TOLERANCE
    request.gjk_max_iterations = request.epa_max_iterations = ITERATIONS
    return request


def coal_shape(shape: Shape) -> object:
    """coal's shape for a shape; hulls keep their vertices."""
    match shape:
        case Sphere(radius):
            return coal.Sphere(radius)
        case Box(half_extents):
            return coal.Box(*(2 * extent for extent in half_extents))
        case Capsule(radius, half_length):
            return coal.Capsule(radius, 2 * half_length)
        case Ellipsoid(half_axes):
            return coal.Ellipsoid(*half_axes)
        case Hull(vertices):
            points = coal.StdVec_Vec3s()
            points.extend([np.array(vertex) for vertex in vertices])
            return coal.Convex.convexHull(points, True, None)
    raise AdapterError(f"the overlap oracle knows no shape {type(shape).__name__}")


def _inflated(shape: Shape) -> Array:
    """Full sides of a box about the shape's origin that contains it with a margin of MARGIN / 2."""
    match shape:
        case Sphere(radius):
            half = np.full(3, radius)
        case Box(half):
            half = np.array(half)
        case Capsule(radius, half_length):
            half = np.array((radius, radius, half_length + radius))
        case Ellipsoid(half):
            half = np.array(half)
        case Hull(vertices):
            half = np.abs(np.array(vertices)).max(axis=0)
        case _:
            raise AdapterError(f"the overlap oracle knows no shape {type(shape).__name__}")
    return np.asarray(2 * (half + MARGIN / 2))

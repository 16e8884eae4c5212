"""One judge of overlap for all engines: python-fcl's broad phase for candidates, coal for signed distance.

Conventions as in `engine.py`: distances negative in overlap, normals from A to B. Pieces farther apart than
`MARGIN` are no candidates, unless their bodies are asked for by name.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

import coal
import fcl
import numpy as np
from scipy.spatial.transform import Rotation

from adapters.engine import AdapterError, Array
from adapters.recording import Recording
from scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Scenario, Shape, Sphere

Pose = tuple[Array, Array]
"""Rotation matrix (3, 3) and position (3,)."""
MARGIN = 0.02
"""Distance within which pieces are looked at [m]: wider than any margin an engine keeps."""
TOLERANCE = 1e-8
"""coal's GJK and EPA tolerance [m]: a hundredth of the 1e-6 m that is asked of a depth."""
ITERATIONS = 1000
"""coal's iteration caps: high enough that tolerance alone ends a query."""


@dataclass(frozen=True, slots=True)
class Distances:
    """Signed distance of body pairs over the frames of a recording.

    `distance[(a, b)]` is (f,) [m], +inf where nothing of both is within MARGIN; normal and midpoint of the
    nearest pieces (f, 3) are NaN there.
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
    def __init__(self, scenario: Scenario, asked: set[tuple[int, int]]) -> None:
        self.scenario, self.asked = scenario, asked
        self.pairs = list(scenario.touching_pairs())
        wanted = set(self.pairs)
        self.pieces = [(i, piece) for i, body in enumerate(scenario.bodies) for piece in body.pieces]
        self.shapes = [coal_shape(piece.shape) for _, piece in self.pieces]
        self.boxes = [fcl.CollisionObject(fcl.Box(*_inflated(piece.shape))) for _, piece in self.pieces]
        self.manager = fcl.DynamicAABBTreeCollisionManager()
        self.manager.registerObjects(self.boxes)
        self.manager.setup()
        count = len(self.pieces)
        bodies = [body for body, _ in self.pieces]
        self.always = [
            (p, q) for p in range(count) for q in range(p + 1, count) if (bodies[p], bodies[q]) in self.asked
        ]
        self.may_meet = np.array([[(i, j) in wanted for j in bodies] for i in bodies])

    def run(self, recording: Recording) -> Distances:
        frames = len(recording.time)
        distance = {pair: np.full(frames, np.inf) for pair in self.pairs}
        normal = {pair: np.full((frames, 3), np.nan) for pair in self.pairs}
        point = {pair: np.full((frames, 3), np.nan) for pair in self.pairs}
        for f in range(frames):
            poses = self._poses(recording, f)
            for p, q in self._candidates(poses):
                pair = (self.pieces[p][0], self.pieces[q][0])
                value, along, middle = signed_distance(self.shapes[p], poses[p], self.shapes[q], poses[q])
                # farther ones are candidates by chance: their nearest pieces may not be among them
                if value < distance[pair][f] and (value <= MARGIN or pair in self.asked):
                    distance[pair][f], normal[pair][f], point[pair][f] = value, along, middle
        return Distances(distance, normal, point)

    def _poses(self, recording: Recording, f: int) -> list[Pose]:
        bodies = Rotation.from_quat(recording.orientation[f], scalar_first=True).as_matrix()
        poses = []
        for body, piece in self.pieces:
            turned = bodies[body]
            own = Rotation.from_quat(np.array(piece.orientation), scalar_first=True).as_matrix()
            poses.append((turned @ own, recording.position[f, body] + turned @ np.array(piece.position)))
        return poses

    def _candidates(self, poses: list[Pose]) -> set[tuple[int, int]]:
        # the callback receives copies of the boxes: they are told by where they are
        places: dict[bytes, list[int]] = {}
        for k, (box, (rotation, position)) in enumerate(zip(self.boxes, poses)):
            box.setTransform(fcl.Transform(rotation, position))
            places.setdefault(box.getTranslation().tobytes(), []).append(k)
        self.manager.update()
        found = set(self.always)

        def keep(one: fcl.CollisionObject, two: fcl.CollisionObject, _: object) -> bool:
            for p in places[one.getTranslation().tobytes()]:
                for q in places[two.getTranslation().tobytes()]:
                    if self.may_meet[min(p, q), max(p, q)]:
                        found.add((min(p, q), max(p, q)))
            return False

        self.manager.collide(None, keep)
        return found


def signed_distance(
    shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose
) -> tuple[float, Array, Array]:
    """Signed distance [m], normal A to B and midpoint of the witnesses of two posed coal shapes."""
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
    """A shape as coal knows it; hulls keep their vertices."""
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
    """Full sides of a box round the shape's origin that holds it with half the margin to spare."""
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

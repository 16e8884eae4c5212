"""Signed distances of body pairs, equal for all engines: in closed form, and by coal where there is none.

Conventions as in `contract.py`: distances are negative in overlap, normals point from A to B. Pieces farther
apart than `MARGIN` are not candidates, unless their bodies are requested by name.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any

import coal
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Array
from touchstone.adapters.oracles.closed_distance import Answers, Placed, at, closed_distance
from touchstone.adapters.oracles.near_pairs import blocks, near_pairs
from touchstone.adapters.recording import Recording
from touchstone.scenarios.extents import extents
from touchstone.scenarios.scenario import (
    TRACKED,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    RoundedBox,
    RoundedHull,
    Scenario,
    Shape,
    Sphere,
)

Pose = tuple[Array, Array]
"""Rotation matrix (3, 3) and position (3,)."""
DEEP = 1e-4
"""Overlap at the start that is said [m]: wider than the gaps that an exporter's digits leave."""
MARGIN = 0.02
"""Distance within which pieces are candidates [m]: wider than the collision margin of any engine."""
TOLERANCE = 1e-8
"""coal's GJK and EPA tolerance [m]: a hundredth of the 1e-6 m that is required of a depth."""
FINER_TOLERANCE = 1e-9
"""coal's tolerance in a further query of a doubtful pair [m]."""
COARSER_TOLERANCE = 1e-7
"""coal's tolerance in a further query of a pair of which it failed [m]."""
FAILED = -1e300
"""Signed distance below which coal's EPA failed [m]: it returns the most negative number."""
DOUBTFUL = 1e-4
"""Depth above which a pair is queried in both orders [m]: exact engines rarely overlap by as much."""
UNPROVEN = 1e-7
"""Excess of a distance over the gap along its normal above which it is wrong [m]: a tenth of a micrometre."""
WAYS = np.array([np.array(w) / np.linalg.norm(w) for w in product((-1.0, 0.0, 1.0), repeat=3) if any(w)])
"""Directions in which a depth is tested (26, 3): the gap along any of them bounds it [1]."""
RIMMED = (coal.Cylinder, coal.Cone)
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
        return np.asarray(np.maximum(0.0, -np.min(self.near, axis=0)))

    @property
    def near(self) -> list[Array]:
        """Distances (f,) [m] of all pairs; pairs that are never near share one array."""
        return list({id(one): one for one in self.distance.values()}.values())


def measure(recording: Recording, scenario: Scenario, asked: Iterable[tuple[int, int]] = ()) -> Distances:
    """Distances of all body pairs that may touch, in every frame; `asked` pairs are always computed."""
    return _Oracle(scenario, set(asked)).run(recording.position, recording.orientation)


def overlaps_at_start(scenario: Scenario) -> list[tuple[int, int, float]]:
    """Pairs of fixed and simulated bodies that may touch and overlap by more than DEEP at the start, and how
    deep [m], the deepest first."""
    position = np.array([[body.position for body in scenario.bodies]], dtype=float)
    orientation = np.array([[body.orientation for body in scenario.bodies]], dtype=float)
    found = _Oracle(scenario, set()).run(position, orientation).distance
    placed = [body.kind not in TRACKED for body in scenario.bodies]
    deep = [(a, b, -float(d[0])) for (a, b), d in found.items() if d[0] < -DEEP and placed[a] and placed[b]]
    return sorted(deep, key=lambda pair: -pair[2])


class _Oracle:
    """Distance computation over a recording."""

    def __init__(self, scenario: Scenario, asked: set[tuple[int, int]]) -> None:
        self.asked = asked
        self.pairs = list(scenario.touching_pairs())
        pieces = [(i, piece) for i, body in enumerate(scenario.bodies) for piece in body.pieces]
        self.body = np.array([i for i, _ in pieces], dtype=int)
        self.shapes = [piece.shape for _, piece in pieces]
        self.coal_shapes = [coal_shape(shape) for shape in self.shapes]
        self.own_position = np.array([piece.position for _, piece in pieces]).reshape(-1, 3)
        own = np.array([piece.orientation for _, piece in pieces]).reshape(-1, 4)
        self.own_rotation = Rotation.from_quat(own, scalar_first=True).as_matrix()
        self.half = np.array([_half_sides(shape) for shape in self.shapes]).reshape(-1, 3) + MARGIN / 2
        self.round = np.array([isinstance(shape, Sphere) for shape in self.shapes], dtype=bool)
        touch = np.zeros((len(scenario.bodies),) * 2, dtype=bool)
        always = touch.copy()
        for a, b in self.pairs:
            touch[a, b] = touch[b, a] = True
        for a, b in asked:
            always[a, b] = always[b, a] = True
        self.may_meet = touch[self.body[:, None], self.body] & ~always[self.body[:, None], self.body]
        self.always = np.argwhere(np.triu(always[self.body[:, None], self.body], 1)).tolist()

    def run(self, position: Array, orientation: Array) -> Distances:
        """Distances over frames of the bodies' positions (f, b, 3) [m] and orientations (f, b, 4)."""
        frames = len(position)
        # Pairs that are never near share arrays that nothing writes to.
        far, nowhere = np.full(frames, np.inf), np.full((frames, 3), np.nan)
        far.flags.writeable = nowhere.flags.writeable = False
        distance = dict.fromkeys(self.pairs, far)
        normal, point = dict.fromkeys(self.pairs, nowhere), dict.fromkeys(self.pairs, nowhere)
        for block in blocks(frames, len(self.body)):
            turned, origin = self._poses(position[block], orientation[block])
            for p, q, near in self._candidates(turned, origin):
                pair = (int(self.body[p]), int(self.body[q]))
                if distance[pair] is far:
                    distance[pair] = far.copy()
                    normal[pair], point[pair] = nowhere.copy(), nowhere.copy()
                found = self._answers(p, q, turned, origin, near)
                rows = block.start + near
                # Farther pieces are candidates by chance: the nearest pieces may not be among them.
                better = found.distance < distance[pair][rows]
                if pair not in self.asked:
                    better &= found.distance <= MARGIN
                if not better.all():
                    rows = rows[better]
                distance[pair][rows] = found.distance[better]
                normal[pair][rows], point[pair][rows] = found.normal[better], found.point[better]
        return Distances(distance, normal, point)

    def _poses(self, position: Array, orientation: Array) -> tuple[Array, Array]:
        """Rotations (f, p, 3, 3) and origins (f, p, 3) [m] of all pieces."""
        count = position.shape[1]
        flat = orientation.reshape(-1, 4)
        bodies = Rotation.from_quat(flat, scalar_first=True).as_matrix().reshape(-1, count, 3, 3)
        turned = bodies[:, self.body]
        origin = position[:, self.body]
        moved = np.flatnonzero(self.own_position.any(axis=1))
        origin[:, moved] += np.einsum("fpij,pj->fpi", turned[:, moved], self.own_position[moved])
        rotated = np.flatnonzero((self.own_rotation != np.eye(3)).any(axis=(1, 2)))
        turned[:, rotated] = turned[:, rotated] @ self.own_rotation[rotated]
        return turned, origin

    def _candidates(self, turned: Array, origin: Array) -> Iterator[tuple[int, int, NDArray[np.int64]]]:
        """Pairs of pieces, and the frames in which they may be within MARGIN or are asked for."""
        reach = (np.abs(turned) * self.half[:, None]).sum(axis=3)
        reach[:, self.round] = self.half[self.round]
        yield from near_pairs(origin, reach, self.may_meet)
        for p, q in self.always:
            yield p, q, np.arange(len(origin))

    def _answers(self, p: int, q: int, turned: Array, origin: Array, near: NDArray[np.int64]) -> Answers:
        """Answers of two pieces in the given frames: in closed form, and by coal where there is none."""
        one, two = (Placed(self.shapes[k], turned[near, k], origin[near, k]) for k in (p, q))

        def by_coal(frames: NDArray[np.int64]) -> Answers:
            first, second = at(one, frames), at(two, frames)
            shapes = self.coal_shapes[p], self.coal_shapes[q]
            rows = [
                signed_distance(shapes[0], pose, shapes[1], other)
                for pose, other in zip(
                    zip(first.turned, first.origin), zip(second.turned, second.origin), strict=True
                )
            ]
            distance, normal, point = (np.array(column) for column in zip(*rows))
            return Answers(distance, normal, point)

        found = closed_distance(one, two)
        return by_coal(np.arange(len(near))) if found is None else found.or_else(by_coal)


def signed_distance(
    shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose
) -> tuple[float, Array, Array]:
    """Signed distance [m], normal A to B and midpoint of the witnesses of two posed coal shapes.

    coal's EPA may end at a face of the difference that is not the nearest. Each face bounds the depth from
    above, so deep overlaps are queried in both orders and the shallower result is returned; one that a gap
    along a direction contradicts is replaced by the largest gap found. Of nearly
    touching pieces EPA may end at the opposite face, which a query with a finer tolerance corrects, or fail,
    which one with a coarser tolerance corrects. Of cylinders and cones that nearly touch it may return a
    distance that the pieces do not have along its normal: the largest gap along a normal of all queries is
    then returned or, if no query has a normal that proves its distance, the largest gap found.
    """
    value, normal, middle = _asked(shape_a, pose_a, shape_b, pose_b, TOLERANCE)
    for least, tolerance in (
        (-DOUBTFUL, TOLERANCE),
        (-DOUBTFUL, FINER_TOLERANCE),
        (FAILED, COARSER_TOLERANCE),
    ):
        if value > least:
            continue
        other, reverse, place = _asked(shape_b, pose_b, shape_a, pose_a, tolerance)
        if other > value:
            value, normal, middle = other, -reverse, place
    if value < -DOUBTFUL and not (isinstance(shape_a, coal.Halfspace) or isinstance(shape_b, coal.Halfspace)):
        found = _largest_gap(shape_a, pose_a, shape_b, pose_b, value + UNPROVEN)
        value, normal, middle = found or (value, normal, middle)
    if not (isinstance(shape_a, RIMMED) or isinstance(shape_b, RIMMED)):
        return value, normal, middle
    gap = gaps_along(shape_a, pose_a, shape_b, pose_b, normal[None])[0][0]
    if value - gap <= UNPROVEN:
        return value, normal, middle
    for tolerance in (TOLERANCE, FINER_TOLERANCE, COARSER_TOLERANCE):
        for turned in (False, True):
            first, second = (shape_a, pose_a), (shape_b, pose_b)
            one, two = (second, first) if turned else (first, second)
            _, way, place = _asked(*one, *two, tolerance)
            way = -way if turned else way
            own = gaps_along(shape_a, pose_a, shape_b, pose_b, way[None])[0][0]
            if own > gap:
                gap, normal, middle = own, way, place
    if value - gap > UNPROVEN and (found := _largest_gap(shape_a, pose_a, shape_b, pose_b, gap)):
        return found
    return float(gap), normal, middle


def _largest_gap(
    shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose, enough: float
) -> tuple[float, Array, Array] | None:
    """Largest gap of two posed coal shapes [m] that is found from the best of WAYS in the axes of both, its
    normal, and the midpoint of the points that it lies between; None if the best is at most `enough`."""
    ways = np.vstack((WAYS @ pose_a[0].T, WAYS @ pose_b[0].T))
    gaps, _ = gaps_along(shape_a, pose_a, shape_b, pose_b, ways)
    best = ways[np.argmax(gaps)]
    if gaps.max() <= enough:
        return None
    across = np.linalg.svd(best[None])[2][1:]

    def depth(x: Array) -> float:
        way = best + x @ across
        return -float(gaps_along(shape_a, pose_a, shape_b, pose_b, way[None] / np.linalg.norm(way))[0][0])

    found = minimize(depth, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-10})
    normal = best + found.x @ across
    normal /= np.linalg.norm(normal)
    gaps, middles = gaps_along(shape_a, pose_a, shape_b, pose_b, normal[None])
    return float(gaps[0]), normal, middles[0]


def gaps_along(
    shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose, ways: Array
) -> tuple[Array, Array]:
    """Gaps (n,) [m] of two posed coal shapes along unit vectors (n, 3) from A to B, each at most their signed
    distance, and the midpoints (n, 3) of the points that they lie between."""
    points_a = _supports(shape_a, ways @ pose_a[0]) @ pose_a[0].T + pose_a[1]
    points_b = _supports(shape_b, -ways @ pose_b[0]) @ pose_b[0].T + pose_b[1]
    return np.einsum("ni,ni->n", ways, points_b - points_a), (points_a + points_b) / 2


def _supports(shape: Any, ways: Array) -> Array:
    """Support points (n, 3) of a coal shape along unit vectors (n, 3), in its frame [m]."""
    if isinstance(shape, coal.Sphere):
        return np.asarray(shape.radius * ways)
    if isinstance(shape, coal.Ellipsoid):
        return np.asarray(shape.radii**2 * ways / np.linalg.norm(shape.radii * ways, axis=1, keepdims=True))
    if isinstance(shape, coal.Capsule):
        core, radius = np.copysign((0.0, 0.0, shape.halfLength), ways), shape.radius
    elif isinstance(shape, coal.Box):
        core, radius = np.copysign(shape.halfSide, ways), shape.getSweptSphereRadius()
    elif isinstance(shape, RIMMED):
        across = np.hypot(ways[:, 0], ways[:, 1])[:, None]
        rim = shape.radius * ways / np.where(across > 0, across, 1.0)
        rim[:, 2] = np.copysign(shape.halfLength, ways[:, 2])
        if isinstance(shape, coal.Cone):
            rim[:, 2] = -shape.halfLength
            apex = np.array((0.0, 0.0, shape.halfLength))
            rim = np.where((ways @ apex > np.einsum("ni,ni->n", rim, ways))[:, None], apex, rim)
        return rim
    else:
        corners = shape.points()
        core, radius = corners[np.argmax(ways @ corners.T, axis=1)], shape.getSweptSphereRadius()
    return np.asarray(core + radius * ways)


def _asked(
    shape_a: object, pose_a: Pose, shape_b: object, pose_b: Pose, tolerance: float
) -> tuple[float, Array, Array]:
    """Signed distance, normal and midpoint from one query."""
    result = coal.DistanceResult()
    request = _request(tolerance)
    value = coal.distance(
        shape_a, coal.Transform3s(*pose_a), shape_b, coal.Transform3s(*pose_b), request, result
    )
    middle = (np.array(result.getNearestPoint1()) + np.array(result.getNearestPoint2())) / 2
    return float(value), np.array(result.normal), middle


@cache
def _request(tolerance: float) -> coal.DistanceRequest:
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    request.gjk_tolerance = request.epa_tolerance = tolerance
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
        case Cylinder(radius, half_length):
            return coal.Cylinder(radius, 2 * half_length)
        case Cone(radius, half_length):
            return coal.Cone(radius, 2 * half_length)
        case HalfSpace():
            return coal.Halfspace(np.array((0.0, 0.0, 1.0)), 0.0)
        case Ellipsoid(half_axes):
            return coal.Ellipsoid(*half_axes)
        case Hull(vertices):
            points = coal.StdVec_Vec3s()
            points.extend([np.array(vertex) for vertex in vertices])
            return coal.Convex.convexHull(points, True, None)
        case RoundedBox() | RoundedHull():
            core = Box(shape.half_extents) if isinstance(shape, RoundedBox) else Hull(shape.vertices)
            found: Any = coal_shape(core)
            found.setSweptSphereRadius(shape.radius)
            return found
    raise AdapterError(f"the overlap oracle knows no shape {type(shape).__name__}")


def _half_sides(shape: Shape) -> Array:
    """Half sides of a box about the shape's origin that contains it (3,) [m]."""
    low, high = extents(shape, np.eye(3)[None])
    return np.asarray(np.maximum(-low, high)[0])

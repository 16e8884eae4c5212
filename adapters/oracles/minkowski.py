"""Exact signed distance of two convex pieces by their explicit Minkowski difference: slow ground truth for
convex depth. A ball is its centre, a capsule its segment, a rounded shape its core, each less its radius. The
difference of shapes without corners is the hull of ever more of its points; over a half-space, a piece's
lowest point tells."""

from functools import lru_cache
from itertools import product
from math import inf

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Unsupported
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Piece,
    Quaternion,
    RoundedBox,
    RoundedHull,
    Sphere,
    shape_name,
)

ON_SURFACE = 1e-14
"""Distance, relative to size, at which the origin counts as inside [1]: rounding."""
MERGED = 1e-9
"""Range, relative to size, of offsets that may be the minimum [1]: qhull's merged planes are exact to
1e-10."""
SLIVER = 1e-3
"""Height over length of a triangle below which qhull's plane gives the better normal [1]."""

ALONG = 1e-9
"""Distance of a unit vector from the normal of a plane up to which it counts as the normal [1]: rounding."""
STARTS, MOST_POINTS, CONVERGED = 100, 600, 1e-12
"""Points of a difference without corners at the start and at most, and the gap of the bounds of its distance
over its size at which it is found [1]."""
SMOOTH = (Cylinder, Cone, Ellipsoid)
CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def core(piece: Piece) -> tuple[Array, float]:
    """World points (n, 3) [m] whose hull, grown by a radius [m], is the piece, and that radius; raises
    Unsupported for shapes without corners."""
    match piece.shape:
        case Box(half_extents):
            local, radius = CORNERS * half_extents, 0.0
        case Hull(vertices):
            local, radius = np.array(vertices), 0.0
        case RoundedBox(half_extents, radius):
            local = CORNERS * half_extents
        case RoundedHull(vertices, radius):
            local = np.array(vertices)
        case Sphere(radius):
            local = np.zeros((1, 3))
        case Capsule(radius, half_length):
            local = np.array([[0.0, 0.0, -half_length], [0.0, 0.0, half_length]])
        case _:
            raise Unsupported(f"no Minkowski difference of {shape_name(type(piece.shape))}s")
    turned = Rotation.from_quat(np.array(piece.orientation), scalar_first=True).apply(local)
    return np.asarray(turned + piece.position), radius


def piece_distance(a: Piece, b: Piece) -> tuple[float, Array]:
    """Signed distance [m] of two pieces, of which one is no half-space, and the normal from A to B."""
    if isinstance(a.shape, HalfSpace) and isinstance(b.shape, HalfSpace):
        raise Unsupported("no distance of two half-spaces")
    for plane, other, sign in ((a, b, 1.0), (b, a, -1.0)):
        if isinstance(plane.shape, HalfSpace):
            up = axes_of(plane.orientation)[:, 2]
            return float(-reach(other, -up) - up @ plane.position), sign * up
    if isinstance(a.shape, SMOOTH) or isinstance(b.shape, SMOOTH):
        return _smooth_distance(a, b)
    (points_a, radius_a), (points_b, radius_b) = core(a), core(b)
    if len(points_a) > 2 or len(points_b) > 2:
        distance, normal = signed_distance(points_a, points_b)
    else:
        distance, normal = _thin((points_a[:, None, :] - points_b[None, :, :]).reshape(-1, 3))
    return distance - radius_a - radius_b, normal


@lru_cache(maxsize=4096)
def axes_of(orientation: Quaternion) -> Array:
    """Axes of a piece as the columns of a matrix."""
    return np.asarray(Rotation.from_quat(np.array(orientation), scalar_first=True).as_matrix())


def reach(piece: Piece, way: Array) -> float:
    """Extent of a piece from the world's origin along a unit vector [m]; that of a half-space is infinite but
    along its normal."""
    if isinstance(piece.shape, HalfSpace):
        up = axes_of(piece.orientation)[:, 2]
        return float(up @ piece.position) if np.linalg.norm(way - up) <= ALONG else inf
    return float(farthest(piece, way) @ way)


def farthest(piece: Piece, way: Array) -> Array:
    """The point of a piece farthest along a unit vector [m, world]."""
    axes = axes_of(piece.orientation)
    u, v, w = way @ axes
    across = float(np.hypot(u, v))
    rim = np.array((u, v)) / across if across > 0 else np.zeros(2)
    match piece.shape:
        case Cylinder(radius, half_length):
            own = np.array((*(radius * rim), half_length if w >= 0 else -half_length))
        case Cone(radius, half_length):
            is_apex = half_length * w > radius * across - half_length * w
            own = np.array((0.0, 0.0, half_length) if is_apex else (*(radius * rim), -half_length))
        case Ellipsoid(half_axes):
            own = np.square(half_axes) * (u, v, w) / np.linalg.norm(np.multiply(half_axes, (u, v, w)))
        case _:
            points, radius = core(piece)
            return np.asarray(points[int((points @ way).argmax())] + radius * way)
    return np.asarray(axes @ own + piece.position)


def _smooth_distance(a: Piece, b: Piece) -> tuple[float, Array]:
    """Signed distance and normal by the hull of points of the difference: the point along the normal of its
    nearest face, or from its nearest point to the origin, is added until it is no farther out."""

    def point(way: Array) -> Array:
        return farthest(a, way) - farthest(b, -way)

    heights = np.linspace(-1.0, 1.0, STARTS)
    turns = np.pi * (1 + 5**0.5) * np.arange(STARTS)
    level = np.sqrt(1 - heights**2)
    points = [point(way) for way in np.column_stack((level * np.cos(turns), level * np.sin(turns), heights))]
    while True:
        hull = ConvexHull(points)
        size = float(np.abs(points).max())
        nearest = int(hull.equations[:, 3].argmax())
        found, normal = float(hull.equations[nearest, 3]), hull.equations[nearest, :3]
        new = point(normal)
        if found > ON_SURFACE * size:
            found, way = _outside(np.array(points)[hull.vertices])
            # at a distance near rounding, the face has the better normal
            if (out := point(way)) @ way < new @ normal:
                new, normal = out, way
        # bounds of the distance: that along the normal, and that of the hull; a point that is there changes
        # neither
        is_there = (np.array(points) == new).all(axis=1).any()
        if abs(found + new @ normal) <= CONVERGED * size or is_there or len(points) == MOST_POINTS:
            return -float(new @ normal), normal
        points.append(new)


def _thin(difference: Array) -> tuple[float, Array]:
    """Distance of the origin from points and segments; where it lies on them, a normal across them."""
    nearest = _nearest(difference)
    distance = float(np.linalg.norm(nearest))
    if distance > ON_SURFACE * float(np.abs(difference).max()):
        return distance, -nearest / distance
    return 0.0, np.asarray(np.linalg.svd(difference - difference.mean(axis=0))[2][-1])


def signed_distance(vertices_a: Array, vertices_b: Array) -> tuple[float, Array]:
    """Signed distance [m] of the hulls of two point sets, and the normal from A to B.

    Args:
        vertices_a, vertices_b: world coordinates (n, 3) and (m, 3) [m].
    Returns:
        Minus the minimum offset of the difference's faces if it contains the origin; otherwise the distance
        of the origin from it, by a non-negative least-squares problem.
    """
    difference = (vertices_a[:, None, :] - vertices_b[None, :, :]).reshape(-1, 3)
    hull = ConvexHull(difference)
    offsets = hull.equations[:, 3]  # negative inside
    size = float(np.abs(difference).max())
    if offsets.max() > ON_SURFACE * size:
        return _outside(difference[hull.vertices])
    nearest = np.flatnonzero(offsets >= offsets.max() - MERGED * size)
    return max((_refined(difference, hull, facet) for facet in nearest.tolist()), key=lambda found: found[0])


def _refined(difference: Array, hull: ConvexHull, facet: int) -> tuple[float, Array]:
    """Depth from the facet's own vertices; from qhull's plane if they form a sliver."""
    p, q, r = difference[hull.simplices[facet]]
    normal, plane = np.cross(q - p, r - p), hull.equations[facet, :3]
    length = np.linalg.norm(normal)
    longest = max(float((edge**2).sum()) for edge in (q - p, r - p, r - q))
    normal = plane if length < SLIVER * longest else normal / (length * np.sign(normal @ plane))
    return -float((difference @ normal).max()), normal


def _outside(corners: Array) -> tuple[float, Array]:
    """Distance of the origin from the hull of `corners`, which does not contain it, and the normal."""
    nearest = _nearest(corners)
    distance = float(np.linalg.norm(nearest))
    return distance, -nearest / distance


def _nearest(corners: Array) -> Array:
    """Point of the hull of `corners` nearest to the origin: least |sum l_i c_i| with l >= 0, sum l = 1."""
    if len(corners) == 1:
        return np.asarray(corners[0])
    heavy = 1e3 * np.abs(corners).max()
    system = np.vstack([corners.T, np.full(len(corners), heavy)])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, heavy]), maxiter=100 * len(corners))
    # The active corners span the nearest face: solve it exactly.
    active = corners[weights > 1e-12]
    base, spread = active[0], (active[1:] - active[0]).T
    return base - spread @ np.linalg.lstsq(spread, base, rcond=None)[0] if len(active) > 1 else base

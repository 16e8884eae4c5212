"""Exact signed distance of two convex pieces by their explicit Minkowski difference: slow ground truth for
convex depth. A ball is its centre, a capsule its segment, a rounded shape its core, each less its radius."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Unsupported
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Hull,
    Piece,
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

CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


def core(piece: Piece) -> tuple[Array, float]:
    """World points (n, 3) [m] whose hull, grown by a radius [m], is the piece, and that radius; raises
    Unsupported for an ellipsoid."""
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
    """Signed distance [m] of two pieces, and the normal from A to B."""
    (points_a, radius_a), (points_b, radius_b) = core(a), core(b)
    if len(points_a) > 2 or len(points_b) > 2:
        distance, normal = signed_distance(points_a, points_b)
    else:
        distance, normal = _thin((points_a[:, None, :] - points_b[None, :, :]).reshape(-1, 3))
    return distance - radius_a - radius_b, normal


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

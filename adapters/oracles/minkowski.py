"""Exact signed distance of two hulls by their explicit Minkowski difference: slow ground truth for convex
depth."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from touchstone.adapters.contract import Array

ON_SURFACE = 1e-14
"""Distance, relative to size, at which the origin counts as inside [1]: rounding."""
MERGED = 1e-9
"""Range, relative to size, of offsets that may be the minimum [1]: qhull's merged planes are exact to
1e-10."""
SLIVER = 1e-3
"""Height over length of a triangle below which qhull's plane gives the better normal [1]."""


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
    """Distance of the origin from the hull of `corners`: minimum of |sum l_i c_i| with l >= 0, sum l = 1."""
    heavy = 1e3 * np.abs(corners).max()
    system = np.vstack([corners.T, np.full(len(corners), heavy)])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, heavy]), maxiter=100 * len(corners))
    # The active corners span the nearest face: solve it exactly.
    active = corners[weights > 1e-12]
    base, spread = active[0], (active[1:] - active[0]).T
    nearest = base - spread @ np.linalg.lstsq(spread, base, rcond=None)[0] if len(active) > 1 else base
    distance = float(np.linalg.norm(nearest))
    return distance, -nearest / distance

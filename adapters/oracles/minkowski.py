"""The explicit Minkowski difference of two hulls: slow, obvious, exact. The truth for convex depth."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from adapters.engine import Array


def signed_distance(vertices_a: Array, vertices_b: Array) -> tuple[float, Array]:
    """Signed distance [m] of the hulls of two point sets, and the normal from A to B.

    Args:
        vertices_a, vertices_b: world coordinates (n, 3) and (m, 3) [m].
    Returns:
        Minus the least offset of the difference's faces when it holds the origin; else the distance of the
        origin from it, by a non-negative least-squares problem.
    """
    difference = (vertices_a[:, None, :] - vertices_b[None, :, :]).reshape(-1, 3)
    hull = ConvexHull(difference)
    offsets = hull.equations[:, 3]  # negative inside
    nearest = int(np.argmax(offsets))
    if offsets[nearest] <= 0:
        return _refined(difference, hull, nearest)
    corners = difference[hull.vertices]
    return _outside(corners)


def _refined(difference: Array, hull: ConvexHull, facet: int) -> tuple[float, Array]:
    """Depth from the facet's own vertices: qhull's merged planes are good to 1e-10 only."""
    p, q, r = difference[hull.simplices[facet]]
    normal = np.cross(q - p, r - p)
    normal /= np.linalg.norm(normal) * np.sign(normal @ hull.equations[facet, :3])
    return -float((difference @ normal).max()), normal


def _outside(corners: Array) -> tuple[float, Array]:
    """Distance of the origin from the hull of `corners`: least |sum l_i c_i| with l >= 0, sum l = 1."""
    heavy = 1e3 * np.abs(corners).max()
    system = np.vstack([corners.T, np.full(len(corners), heavy)])
    weights, _ = nnls(system, np.array([0.0, 0.0, 0.0, heavy]), maxiter=100 * len(corners))
    # the active corners span the nearest face: solve it exactly
    active = corners[weights > 1e-12]
    base, spread = active[0], (active[1:] - active[0]).T
    nearest = base - spread @ np.linalg.lstsq(spread, base, rcond=None)[0] if len(active) > 1 else base
    distance = float(np.linalg.norm(nearest))
    return distance, -nearest / distance

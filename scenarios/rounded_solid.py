"""Mass properties of rounded hulls, exact by parts: the core, a prism on each face, a wedge of a cylinder on
each edge, and a sector of a ball at each corner (Steiner's decomposition of a parallel body)."""

from collections.abc import Sequence
from math import pi, sin

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Matrix, Vector, vector

Moments = tuple[float, Array, Array]
"""Volume [m^3], and the integrals of x (3,) [m^4] and of x x^T (3, 3) [m^5] over it."""


def rounded_mass_properties(
    vertices: Sequence[Vector], radius: float, *, mass: float | None = None, density: float = 1.0
) -> tuple[float, Vector, Matrix]:
    """Mass, centre of mass and inertia of a uniform solid: all points within `radius` [m] of a convex hull.

    Args:
        vertices: corners of the hull [m].
        mass: mass of the solid [kg]; None: by `density` [kg/m^3].
    Returns:
        Mass [kg], centre of mass [m, frame of the vertices], inertia about it [kg m^2].
    Raises:
        ValueError: the vertices span no volume.
    """
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError) as error:
        raise ValueError(f"{plural(len(points), 'vertex')} span no volume") from error
    inside = points.mean(axis=0)
    parts = [*_faces(points - inside, hull, radius), *_edges_and_corners(points - inside, hull, radius)]
    volume = sum(part[0] for part in parts)
    center = sum((part[1] for part in parts), np.zeros(3)) / volume
    second = sum((part[2] for part in parts), np.zeros((3, 3))) - volume * np.outer(center, center)
    total = density * volume if mass is None else mass
    inertia = total / volume * (np.trace(second) * np.eye(3) - second)
    rows = [vector(row) for row in (inertia + inertia.T) / 2]
    return float(total), vector(inside + center), (rows[0], rows[1], rows[2])


def _faces(points: Array, hull: ConvexHull, r: float) -> list[Moments]:
    """Moments of the tetrahedra from the origin to the triangles, and of the prisms on these."""
    found: list[Moments] = []
    for simplex, n in zip(hull.simplices, hull.equations[:, :3]):
        corners = points[simplex]
        a, b, c = corners
        area, total = float(np.linalg.norm(np.cross(b - a, c - a))) / 2, corners.sum(axis=0)
        volume = abs(float(np.linalg.det(corners))) / 6
        square = corners.T @ corners + np.outer(total, total)
        found.append((volume, volume * total / 4, volume * square / 20))
        first = area * total / 3
        across = np.outer(first, n)
        second = r * area * square / 12 + r * r / 2 * (across + across.T) + r**3 / 3 * area * np.outer(n, n)
        found.append((area * r, r * first + r * r / 2 * area * n, second))
    return found


def _edges_and_corners(points: Array, hull: ConvexHull, r: float) -> list[Moments]:
    """Moments of the wedges on the edges, and of the sectors at the corners.

    The solid angle of a corner's normals is what its faces' angles lack of 2 pi, and the integral of these
    normals is minus half the sum of its edges' directions times their exterior angles.
    """
    found: list[Moments] = []
    lack, mean = np.full(len(points), 2 * pi), np.zeros((len(points), 3))
    for f, simplex in enumerate(hull.simplices):
        for k, v in enumerate(simplex):
            one, two = points[simplex[k - 1]] - points[v], points[simplex[k - 2]] - points[v]
            lack[v] -= np.arctan2(np.linalg.norm(np.cross(one, two)), one @ two)
        for g in hull.neighbors[f]:
            if g < f:
                continue
            p, q = sorted(set(simplex.tolist()) & set(hull.simplices[g].tolist()))
            n, m = hull.equations[f, :3], hull.equations[g, :3]
            theta = float(2 * np.arctan2(np.linalg.norm(n - m), np.linalg.norm(n + m)))
            way = points[q] - points[p]
            length = float(np.linalg.norm(way))
            mean[p] -= theta / 2 * way / length
            mean[q] += theta / 2 * way / length
            found.append(_wedge(points[p], points[q], n + m, theta, r))
    for corner, angle, normal in zip(points[hull.vertices], lack[hull.vertices], mean[hull.vertices]):
        across = np.outer(corner, normal)
        second = angle * r**3 / 3 * np.outer(corner, corner) + r**4 / 4 * (across + across.T)
        found.append((angle * r**3 / 3, angle * r**3 / 3 * corner + r**4 / 4 * normal, second))
    # the directions of all corners' normals are those of the whole sphere
    return [*found, (0.0, np.zeros(3), 4 * pi / 15 * r**5 * np.eye(3))]


def _wedge(p: Array, q: Array, middle: Array, theta: float, r: float) -> Moments:
    """Moments of the sector of a cylinder about the edge from p to q, of an angle about a direction."""
    length, both = float(np.linalg.norm(q - p)), p + q
    b = middle / np.linalg.norm(middle)
    c = np.cross(q - p, b) / length
    volume, out = length * theta * r * r / 2, length * r**3 / 3 * 2 * sin(theta / 2) * b
    along = (np.outer(p, p) + np.outer(q, q) + np.outer(both, both)) / 6
    bb, cc = np.outer(b, b), np.outer(c, c)
    round_ = theta / 2 * (bb + cc) + sin(theta) / 2 * (bb - cc)
    across = np.outer(both / 2, out)
    second = volume * along + across + across.T + length * r**4 / 4 * round_
    return volume, volume * both / 2 + out, second


def surface_points(vertices: Sequence[Vector], radius: float) -> tuple[Vector, ...]:
    """Corners of a hull [m] inside a rounded one that is close to it, for pictures and formats without
    rounding."""
    turns, rises = np.meshgrid(np.linspace(0, 2 * pi, 16, endpoint=False), np.linspace(-pi / 2, pi / 2, 9))
    ball = np.stack([np.cos(turns) * np.cos(rises), np.sin(turns) * np.cos(rises), np.sin(rises)], axis=-1)
    points = (np.array(vertices)[:, None] + radius * ball.reshape(-1, 3)).reshape(-1, 3)
    return tuple(vector(point) for point in points[ConvexHull(points).vertices])

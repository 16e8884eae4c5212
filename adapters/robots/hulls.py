"""Convex hulls of meshes, with few corners, and how far they are from the shape."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, KDTree, QhullError

from touchstone.adapters.contract import Array
from touchstone.scenarios.scenario import Hull, vector

MOST_CORNERS = 64
"""Corners of a hull: what engines and the reference test at little more than a box's cost."""
CLOSE = 1e-3
"""Distance of left out corners, relative to the size, below which a hull needs no more [1]."""
SPACING = 0.02
"""Spacing of samples on surfaces, relative to the size [1]: the error's own accuracy."""
MOST_SAMPLES = 40
"""Samples along the edge of a triangle."""
HOLLOW = 0.05
"""Depth of a hollow, relative to the mesh's size, that a hull may fill [1]: above the error of sampling."""


@dataclass(frozen=True, slots=True)
class Approximation:
    """A convex hull in place of a shape.

    Attributes:
        hull: corners in the shape's frame [m].
        cut: largest distance by which the shape's own hull sticks out of this one [m].
        filled: largest distance of this hull's surface from the shape [m], to SPACING of the size: how deep
            the hollows are that it fills.
        size: largest extent of the shape [m].
    """

    hull: Hull
    cut: float
    filled: float
    size: float

    @property
    def fills_hollows(self) -> bool:
        """Whether the shape is not convex, beyond HOLLOW."""
        return self.filled > HOLLOW * self.size


def mesh_hull(vertices: Array, faces: NDArray[np.int32]) -> Approximation:
    """Hull of a triangle mesh: vertices (n, 3) [m], faces (m, 3); raises ValueError if it spans no volume."""
    try:
        whole = ConvexHull(vertices)
    except QhullError as error:
        raise ValueError("its vertices lie in a plane") from error
    outer = vertices[whole.vertices]
    size = float(np.ptp(outer, axis=0).max())
    chosen, cut = _fewer(outer, CLOSE * size)
    surface = _samples(vertices, faces, SPACING * size)
    hull = ConvexHull(chosen)
    on_hull = _samples(chosen, hull.simplices, SPACING * size)
    filled = float(np.max(KDTree(surface).query(on_hull)[0]))
    return Approximation(Hull(tuple(map(vector, chosen[hull.vertices]))), cut, filled, size)


def _fewer(points: Array, close: float) -> tuple[Array, float]:
    """Corners of a hull, chosen one after the other where the hull so far is farthest inside; and the
    distance of the farthest that is left out."""
    if len(points) <= MOST_CORNERS:
        return points, 0.0
    axes = np.vstack([np.eye(3), -np.eye(3), [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]])
    chosen = sorted({int(np.argmax(points @ axis)) for axis in axes})
    while True:
        hull = ConvexHull(points[chosen])
        outside = (points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1)
        farthest = int(np.argmax(outside))
        cut = max(0.0, float(outside[farthest]))
        if cut <= close or len(chosen) >= MOST_CORNERS or farthest in chosen:
            return points[[chosen[k] for k in hull.vertices]], cut
        chosen.append(farthest)


def _samples(vertices: Array, faces: NDArray[np.int32], spacing: float) -> Array:
    """Points on all triangles, at most about `spacing` apart."""
    corners = vertices[faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    steps = np.clip(np.ceil(longest / spacing), 1, MOST_SAMPLES).astype(int)
    found = [vertices]
    for count in np.unique(steps[steps > 1]):  # small triangles have their corners
        grid = (
            np.array([(i, j, count - i - j) for i in range(count + 1) for j in range(count + 1 - i)]) / count
        )
        found.append((grid @ corners[steps == count]).reshape(-1, 3))
    return np.concatenate(found)

"""Closed triangle meshes as convex pieces: a tetrahedron behind each triangle, within the solid.

The surface of the pieces is that of the mesh: neighbours share their edges, and no tetrahedron reaches
through another triangle. What is deeper than the tetrahedra is hollow.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.number_checks import LONGEST
from touchstone.scenarios.scenario import Hull, Piece, ShortRepr, Vector, vector

MOST_TRIANGLES = 8192
"""Most triangles of a mesh [1]: each is a piece."""
SLIVER = 1e-3
"""Least height of a triangle over its longest side [1]: pieces of flatter ones have no depth."""
TOUCHING = 1e-10
"""Depth, relative to the size of a mesh, up to which a tetrahedron and a triangle touch only [1]."""
PARALLEL = 1e-12
"""Product of two edges, relative to the square of the size, up to which they are parallel [1]."""
AT_A_TIME = 64
"""Tetrahedra whose neighbours are looked for at a time [1]: it bounds the memory."""
HALVINGS = 12
"""Times that the depth of a tetrahedron is halved before the triangle counts as crossed by another [1]."""


@dataclass(frozen=True)
class TriangleMesh(ShortRepr):
    """Closed surface about its body's origin: `triangles` of indices of `vertices` [m], anticlockwise as seen
    from outside. Vertices at one place are one."""

    vertices: tuple[Vector, ...]
    triangles: tuple[tuple[int, int, int], ...]

    def faults(self) -> Iterator[tuple[str, str]]:
        found = list(self._wrong_numbers()) or list(self._open_edges()) or list(self._wrong_sides())
        yield from found or (
            (f"triangles[{k}]", "crosses or touches another triangle: nothing is solid behind it")
            for k in np.flatnonzero(np.isnan(self._depths)).tolist()
        )

    def pieces(self) -> tuple[Piece, ...]:
        """A tetrahedron per triangle, in the frame of their body; raises ValueError if a field is wrong."""
        for field, text in self.faults():
            raise ValueError(f"{field}: {text}")
        return tuple(
            Piece(f"triangle_{k}", Hull(tuple(map(vector, corners))))
            for k, corners in enumerate(_tetrahedra(self._corners, self._depths))
        )

    @cached_property
    def _corners(self) -> Array:
        """Corners of the triangles (n, 3, 3) [m]."""
        return np.array(self.vertices)[np.array(self.triangles)]

    def _wrong_numbers(self) -> Iterator[tuple[str, str]]:
        for i, place in enumerate(self.vertices):
            if not np.abs(place).max() <= LONGEST:
                yield f"vertices[{i}]", f"found {place}, expected numbers of up to {LONGEST:g}"
        if not 4 <= len(self.triangles) <= MOST_TRIANGLES:
            yield "triangles", f"found {len(self.triangles)}, expected 4 to {MOST_TRIANGLES}"
        for k, corners in enumerate(self.triangles):
            if len(set(corners)) < 3 or not 0 <= min(corners) <= max(corners) < len(self.vertices):
                valid = f"0 to {len(self.vertices) - 1}"
                yield f"triangles[{k}]", f"found {corners}, expected three different vertices, {valid}"

    def _open_edges(self) -> Iterator[tuple[str, str]]:
        """Slivers, and edges that are not between two triangles which run along it in opposite directions."""
        longest, height = _extents(self._corners)
        for k in np.flatnonzero(height <= SLIVER * longest).tolist():
            text = f"a sliver: its height is {height[k]:.3g} m over a side of {longest[k]:.3g} m"
            yield f"triangles[{k}]", f"{text}, expected more than {SLIVER:g} of it"
        first = {place: i for i, place in reversed(list(enumerate(self.vertices)))}
        merged = [first[place] for place in self.vertices]
        edges = [(merged[t[i]], merged[t[i - 2]], k) for k, t in enumerate(self.triangles) for i in range(3)]
        counts = Counter((a, b) for a, b, _ in edges)
        for a, b, k in edges:
            along, against = counts[a, b], counts[b, a]
            if (along, against) == (1, 0):
                yield f"triangles[{k}]", f"no other at its edge {a}-{b}, expected a closed mesh"
            elif along > 1 and against == 0:
                text = "expected opposite ones, anticlockwise as seen from outside"
                yield f"triangles[{k}]", f"{along} run along the edge {a}-{b} in one direction, {text}"
            elif (along, against) != (1, 1):
                yield f"triangles[{k}]", f"{along + against} at the edge {a}-{b}, expected two"

    def _wrong_sides(self) -> Iterator[tuple[str, str]]:
        a, b, c = np.moveaxis(self._corners - self._corners.mean(axis=(0, 1)), 1, 0)
        volume = float((np.cross(a, b) * c).sum()) / 6
        if volume <= 0:
            text = "expected corners anticlockwise as seen from outside"
            yield "triangles", f"enclose {volume:.3g} m^3, {text}"

    @cached_property
    def _depths(self) -> Array:
        """Depth of each tetrahedron (n,) [m]: its triangle's longest side, halved until no triangle is within
        it; NaN where none is left."""
        corners = self._corners
        low, high = corners.min(axis=1), corners.max(axis=1)
        touching = TOUCHING * float((high.max(axis=0) - low.min(axis=0)).max())
        depths, _ = _extents(corners)
        crossed = np.arange(len(corners))
        for _ in range(HALVINGS):
            own = _tetrahedra(corners[crossed], depths[crossed])
            within = np.zeros(len(crossed), dtype=bool)
            for k in range(0, len(crossed), AT_A_TIME):
                below, above = (end(own[k : k + AT_A_TIME], axis=1)[:, None] for end in (np.max, np.min))
                i, j = np.nonzero(((low <= below) & (high >= above)).all(axis=2))
                other = crossed[i + k] != j
                i, j = i[other] + k, j[other]
                np.logical_or.at(within, i, _cross(own[i], corners[j], touching))
            crossed = crossed[within]
            depths[crossed] /= 2
        depths[crossed] = np.nan
        return depths


def solid_below(surface: Array, bottom: float) -> TriangleMesh:
    """What is between a surface of quadrangles, whose corners (n, m, 3) [m] run anticlockwise as seen from
    above, and the height `bottom` [m]; cells are split from (i, j) to (i + 1, j + 1)."""
    n, m = surface.shape[:2]
    index, below = np.arange(n * m).reshape(n, m), n * m
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
    one, middle = np.arange(len(rim)), np.full(len(rim), below + len(rim))
    two = np.roll(one, -1)
    triangles = [(a, b, c), (a, c, d)]  # above; then at the sides, and a fan below
    triangles += [
        (rim, one + below, two + below),
        (rim, two + below, rim[two]),
        (two + below, one + below, middle),
    ]
    foot = surface.reshape(-1, 3)[rim] * (1.0, 1.0, 0.0) + (0.0, 0.0, bottom)
    vertices = np.concatenate([surface.reshape(-1, 3), foot, foot.mean(axis=0)[None]])
    corners = np.concatenate([np.stack(part, axis=1) for part in triangles])
    return TriangleMesh(tuple(map(tuple, vertices.tolist())), tuple(map(tuple, corners.tolist())))


def _extents(corners: Array) -> tuple[Array, Array]:
    """Longest side of triangles (n, 3, 3), and the height over it (n,) [m]."""
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    area = np.linalg.norm(_normals(corners), axis=1)
    return longest, area / np.where(longest > 0, longest, 1.0)


def _normals(corners: Array) -> Array:
    """Outward normals of triangles, as long as twice their area."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return np.cross(b - a, c - a)


def _tetrahedra(corners: Array, depths: Array) -> Array:
    """Corners (n, 4, 3) of the triangles, and the points that are at these depths behind the centres of their
    inscribed circles [m]."""
    opposite = np.linalg.norm(np.roll(corners, 1, axis=1) - np.roll(corners, 2, axis=1), axis=2)
    centre = (opposite[:, :, None] * corners).sum(axis=1) / opposite.sum(axis=1)[:, None]
    inward = -_normals(corners)
    inward /= np.linalg.norm(inward, axis=1)[:, None]
    return np.concatenate([corners, (centre + depths[:, None] * inward)[:, None]], axis=1)


def _cross(tetrahedra: Array, triangles: Array, touching: float) -> NDArray[np.bool_]:
    """Which triangles (n, 3, 3) are within their tetrahedra (n, 4, 3) by more than `touching` [m]: no axis
    separates them, neither a normal nor one across two edges."""
    a, b, c = np.array(list(combinations(range(4), 3))).T
    faces = np.cross(tetrahedra[:, b] - tetrahedra[:, a], tetrahedra[:, c] - tetrahedra[:, a])
    axes = np.concatenate([faces, _normals(triangles)[:, None]], axis=1)
    crossed = ~_apart(axes, tetrahedra, triangles, touching)
    tetrahedra, triangles = tetrahedra[crossed], triangles[crossed]
    one, two = np.array(list(combinations(range(4), 2))).T
    edges, sides = tetrahedra[:, two] - tetrahedra[:, one], triangles - np.roll(triangles, 1, axis=1)
    axes = np.cross(edges[:, :, None], sides[:, None]).reshape(len(triangles), 18, 3)
    crossed[crossed] = ~_apart(axes, tetrahedra, triangles, touching)
    return crossed


def _apart(axes: Array, tetrahedra: Array, triangles: Array, touching: float) -> NDArray[np.bool_]:
    """Whether any of the axes (n, k, 3) [m^2] separates a triangle from its tetrahedron."""
    size = np.ptp(tetrahedra, axis=1).max(axis=1, initial=0.0)
    length = np.linalg.norm(axes, axis=2)
    own, other = (np.einsum("nai,nki->nak", axes, points) for points in (tetrahedra, triangles))
    gap = np.maximum(own.min(axis=2) - other.max(axis=2), other.min(axis=2) - own.max(axis=2))
    separate = (gap >= -touching * length) & (length > PARALLEL * size[:, None] ** 2)
    return np.asarray(separate.any(axis=1))

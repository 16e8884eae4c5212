"""Vertices of a convex hull for the kernels, with a lookup table for support queries in constant time.

The table sorts directions by octant (the signs of the components) and then by a regular grid over
(|u|, |v|) / (|u| + |v| + |w|). Each axis is first scaled by the hull's half extent, so a needle's table is as
good as a ball's. A grid cell stores its candidates: the vertices that can be the support point for one of its
directions. A vertex is dropped if another is farther at all corners of the cell: heights are linear in the
direction, so that vertex is farther in the whole cell. A list holds four entries; longer lists are chained.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, cKDTree

from touchstone.adapters.contract import Array
from touchstone.reference_impl.core.world import VERTEX
from touchstone.scenarios.scenario import Vector

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
Lists = NDArray[np.uint16]

BRUTE_FORCE_VERTEX_COUNT = 16
"""Vertex count up to which brute force is as fast as the table."""
LARGEST_CELL_COUNT = 64
"""Maximum number of cells along a side. Entries have 16 bits; 8 * 64^2 cells leave half of the numbers for
chained lists and vertices."""
CROWDED = 1 / 16
"""Share of cells with more than four candidates at which refinement stops [1]."""
MERGED = 1e-7
"""Distance over a hull's extent up to which corners are one [1]: rounding of single precision."""
MARGIN = 1e-12
"""Height, relative to the largest coordinate, by which another vertex must be farther [1]: thousands of
rounding errors. The table therefore returns bitwise the result of brute force, including the lowest index of
equally far vertices."""
PAIRWISE_COUNT = 16
"""Candidate count of a cell up to which all are compared pairwise; longer lists are compared with the
farthest vertices only."""
NUMBERS = 2**16
SIGNS = np.array([[1 - 2 * (k >> axis & 1) for axis in range(3)] for k in range(8)])


@cache
def distinct(corners: tuple[Vector, ...]) -> tuple[Vector, ...]:
    """Corners of a hull without those within MERGED of an earlier one, as files in single precision have
    them: faces between two such corners have no direction."""
    points = np.array(corners)
    close = cKDTree(points).query_pairs(MERGED * float(np.ptp(points, axis=0).max()))
    dropped = {max(pair) for pair in close}
    return tuple(corner for k, corner in enumerate(corners) if k not in dropped)


@cache
def hull_rows(corners: tuple[Vector, ...]) -> tuple[np.ndarray, int, Array]:
    """Rows of VERTEX, number of grid cells along a side (0: no table) and half extents (3,) [m]."""
    points = np.array(corners)
    extent, count, cells = np.ptp(points, axis=0) / 2, len(points), 0
    lists: Lists = np.zeros((0, 4), np.uint16)
    if count > BRUTE_FORCE_VERTEX_COUNT:
        side, counts, vertices = _candidates(points / extent)
        chained = int(np.maximum(0, -(-(counts - 4) // 3)).sum())
        if count + len(counts) + chained <= NUMBERS:
            lists, cells = _lists(count, counts, vertices, chained), side
    rows = np.zeros(count + -(-len(lists) // 4), VERTEX)
    rows["position"][:count] = points
    rows["lists"][count:].reshape(-1, 4)[: len(lists)] = lists
    rows.flags.writeable = False
    return rows, cells, extent


@cache
def hull_width(corners: tuple[Vector, ...]) -> float:
    """Diameter of the largest ball about the mean of the corners inside a hull [m], a lower bound of its
    width."""
    planes = ConvexHull(corners).equations
    return float(-2 * (planes[:, :3] @ np.mean(corners, axis=0) + planes[:, 3]).max())


def _lists(count: int, counts: Indices, vertices: Indices, chained: int) -> Lists:
    """Candidates of each cell as lists of four (n, 4).

    Entries are vertex indices; the last entry of a longer list is `count` plus the index of its continuation.
    """
    first, free = np.cumsum(counts) - counts, len(counts)
    lists: Lists = np.zeros((free + chained, 4), np.uint16)
    # Pad short lists with their last entry.
    lists[:free] = vertices[first[:, None] + np.minimum(np.arange(4), counts[:, None] - 1)]
    for cell in np.flatnonzero(counts > 4).tolist():
        rest, row = vertices[first[cell] : first[cell] + counts[cell]], cell
        while len(rest) > 4:
            lists[row, :3], lists[row, 3] = rest[:3], count + free
            rest, row, free = rest[3:], free, free + 1
        lists[row] = rest[np.minimum(np.arange(4), len(rest) - 1)]
    return lists


def _candidates(points: Array) -> tuple[int, Indices, Indices]:
    """(cells along a side, candidate count of each cell, their vertices concatenated), by repeated
    refinement."""
    cells, counts = 1, np.full(8, len(points))
    vertices = np.tile(np.arange(len(points)), 8)
    while True:
        counts, vertices = _thinned(points, cells, counts, vertices)
        if np.mean(counts > 4) <= CROWDED or cells == LARGEST_CELL_COUNT:
            return cells, counts, vertices
        # The four quarters of a cell inherit its candidates.
        octant, i, j = np.indices((8, 2 * cells, 2 * cells)).reshape(3, -1)
        parent = (octant * cells + i // 2) * cells + j // 2
        first, cells = (np.cumsum(counts) - counts)[parent], 2 * cells
        counts = counts[parent]
        vertices = vertices[np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())]


def _thinned(points: Array, cells: int, counts: Indices, vertices: Indices) -> tuple[Indices, Indices]:
    """Remove candidates that another one exceeds at all corners of their cell."""
    corners, margin = _corners(cells), MARGIN * float(np.abs(points).max())
    for compare in (_beaten_by_champions, _beaten_by_any):
        cell = np.repeat(np.arange(len(counts)), counts)
        heights = np.einsum("pi,pci->pc", points[vertices], corners[cell])
        kept = ~compare(heights + margin, heights, cell, counts)
        vertices, counts = vertices[kept], np.bincount(cell[kept], minlength=len(counts))
    return counts, vertices


def _corners(cells: int) -> Array:
    """Directions (c, 4, 3) at the corners of all cells; the grid ends where |w| is 0."""
    octant, i, j = np.indices((8, cells, cells)).reshape(3, -1)
    p = (i[:, None] + np.array([0, 1, 0, 1])) / cells
    q = (j[:, None] + np.array([0, 0, 1, 1])) / cells
    # The diagonal halves its cells; cells beyond it collapse to one point.
    p[:, 3], q[:, 3] = np.where(i + j < cells - 1, [p[:, 3], q[:, 3]], [p[:, 0], q[:, 0]])
    beyond = i + j >= cells
    p[beyond] = p[beyond][:, :1]
    q[beyond] = 1 - p[beyond]
    return np.stack([p, q, 1 - p - q], axis=-1) * SIGNS[octant][:, None]


def _beaten_by_champions(least: Array, heights: Array, cell: Indices, counts: Indices) -> Mask:
    """Whether the support vertex of a corner or of the cell's middle exceeds `least` at all corners."""
    first = np.cumsum(counts) - counts
    beaten = np.zeros(len(heights), dtype=bool)
    for height in (*heights.T, heights.sum(axis=1)):
        champion = np.zeros(len(counts), dtype=int)
        best = np.flatnonzero(height == np.maximum.reduceat(height, first)[cell])
        champion[cell[best]] = best
        beaten |= np.all(heights[champion][cell] > least, axis=1)
    return beaten


def _beaten_by_any(least: Array, heights: Array, cell: Indices, counts: Indices) -> Mask:
    """Whether any candidate exceeds `least` at all corners, for cells of at most PAIRWISE_COUNT."""
    first = np.cumsum(counts) - counts
    few = np.flatnonzero(counts <= PAIRWISE_COUNT)
    listed = np.arange(PAIRWISE_COUNT) < counts[few][:, None]
    rows = np.where(listed, first[few][:, None] + np.arange(PAIRWISE_COUNT), first[few][:, None])
    beaten = np.zeros(len(heights), dtype=bool)
    farther = heights[rows][:, None] > least[rows][:, :, None]
    # Padding repeats the first entry of a list, so it adds no new rival.
    beaten[rows[listed]] = np.any(np.all(farther, axis=-1), axis=-1)[listed]
    return beaten

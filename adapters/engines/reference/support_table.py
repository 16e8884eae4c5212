"""A hull's rows for the kernels: its vertices, and a table of directions that finds the farthest in constant
time.

Directions are sorted by the signs of their components (octant) and by a regular grid over their shares
(|u|, |v|) / (|u| + |v| + |w|), after each axis is stretched by the hull's half extent: a needle's table is
that of a ball. A cell of the grid keeps its candidates, the vertices that can be farthest for one of its
directions. A vertex is left out where another is farther at all corners of the cell: heights are linear in
the direction, so it is farther in the whole cell. A list has four entries; longer ones are chained.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from touchstone.adapters.contract import Array
from touchstone.reference_impl.core.world import VERTEX
from touchstone.scenarios.scenario import Vector

Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]
Lists = NDArray[np.uint16]

BRUTE = 16
"""Vertices up to which trying all is as fast as the table."""
FINEST = 64
"""Cells along a side at most: entries have 16 bits, and 8 * 64^2 cells leave half of the numbers for chains
and for vertices."""
CROWDED = 1 / 16
"""Share of cells with more than four candidates that is fine enough [1]."""
MARGIN = 1e-12
"""Height over the largest coordinate by which another vertex must be farther [1]: thousands of roundings. The
table's answer is thus that of trying all to the bit, the lowest of equally far vertices included."""
FEW = 16
"""Candidates up to which a cell's are compared all with all; champions alone thin out longer lists."""
NUMBERS = 2**16
SIGNS = np.array([[1 - 2 * (k >> axis & 1) for axis in range(3)] for k in range(8)])


@cache
def hull_rows(corners: tuple[Vector, ...]) -> tuple[np.ndarray, int, Array]:
    """Rows of VERTEX, the grid's cells along a side (0: no table) and the half extents (3,) [m]."""
    points = np.array(corners)
    extent, count, cells = np.ptp(points, axis=0) / 2, len(points), 0
    lists: Lists = np.zeros((0, 4), np.uint16)
    if count > BRUTE:
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
    """Diameter of the ball about the corners' mean that fits into a hull: no more than its width [m]."""
    planes = ConvexHull(corners).equations
    return float(-2 * (planes[:, :3] @ np.mean(corners, axis=0) + planes[:, 3]).max())


def _lists(count: int, counts: Indices, vertices: Indices, chained: int) -> Lists:
    """Each cell's candidates as a list of four (n, 4): vertices, and last of a longer one `count` plus the
    number of the list that goes on."""
    first, free = np.cumsum(counts) - counts, len(counts)
    lists: Lists = np.zeros((free + chained, 4), np.uint16)
    # short lists end by repeating their last
    lists[:free] = vertices[first[:, None] + np.minimum(np.arange(4), counts[:, None] - 1)]
    for cell in np.flatnonzero(counts > 4).tolist():
        rest, row = vertices[first[cell] : first[cell] + counts[cell]], cell
        while len(rest) > 4:
            lists[row, :3], lists[row, 3] = rest[:3], count + free
            rest, row, free = rest[3:], free, free + 1
        lists[row] = rest[np.minimum(np.arange(4), len(rest) - 1)]
    return lists


def _candidates(points: Array) -> tuple[int, Indices, Indices]:
    """(cells along a side, candidates of each cell, their vertices in a row): by halving cells."""
    cells, counts = 1, np.full(8, len(points))
    vertices = np.tile(np.arange(len(points)), 8)
    while True:
        counts, vertices = _thinned(points, cells, counts, vertices)
        if np.mean(counts > 4) <= CROWDED or cells == FINEST:
            return cells, counts, vertices
        # a cell's four quarters inherit its candidates
        octant, i, j = np.indices((8, 2 * cells, 2 * cells)).reshape(3, -1)
        parent = (octant * cells + i // 2) * cells + j // 2
        first, cells = (np.cumsum(counts) - counts)[parent], 2 * cells
        counts = counts[parent]
        vertices = vertices[np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())]


def _thinned(points: Array, cells: int, counts: Indices, vertices: Indices) -> tuple[Indices, Indices]:
    """Candidates without those that another beats at all corners of their cell."""
    corners, margin = _corners(cells), MARGIN * float(np.abs(points).max())
    for compare in (_beaten_by_champions, _beaten_by_any):
        cell = np.repeat(np.arange(len(counts)), counts)
        heights = np.einsum("pi,pci->pc", points[vertices], corners[cell])
        kept = ~compare(heights + margin, heights, cell, counts)
        vertices, counts = vertices[kept], np.bincount(cell[kept], minlength=len(counts))
    return counts, vertices


def _corners(cells: int) -> Array:
    """Directions (c, 4, 3) at the corners of all cells, which end where |w| is 0."""
    octant, i, j = np.indices((8, cells, cells)).reshape(3, -1)
    p = (i[:, None] + np.array([0, 1, 0, 1])) / cells
    q = (j[:, None] + np.array([0, 0, 1, 1])) / cells
    # half of a cell on the diagonal, one point of those beyond
    p[:, 3], q[:, 3] = np.where(i + j < cells - 1, [p[:, 3], q[:, 3]], [p[:, 0], q[:, 0]])
    beyond = i + j >= cells
    p[beyond] = p[beyond][:, :1]
    q[beyond] = 1 - p[beyond]
    return np.stack([p, q, 1 - p - q], axis=-1) * SIGNS[octant][:, None]


def _beaten_by_champions(least: Array, heights: Array, cell: Indices, counts: Indices) -> Mask:
    """Whether the farthest vertex at a corner or in the cell's middle is above `least` at all corners."""
    first = np.cumsum(counts) - counts
    beaten = np.zeros(len(heights), dtype=bool)
    for height in (*heights.T, heights.sum(axis=1)):
        champion = np.zeros(len(counts), dtype=int)
        best = np.flatnonzero(height == np.maximum.reduceat(height, first)[cell])
        champion[cell[best]] = best
        beaten |= np.all(heights[champion][cell] > least, axis=1)
    return beaten


def _beaten_by_any(least: Array, heights: Array, cell: Indices, counts: Indices) -> Mask:
    """The same, by any candidate of a cell with few."""
    first = np.cumsum(counts) - counts
    few = np.flatnonzero(counts <= FEW)
    listed = np.arange(FEW) < counts[few][:, None]
    rows = np.where(listed, first[few][:, None] + np.arange(FEW), first[few][:, None])
    beaten = np.zeros(len(heights), dtype=bool)
    farther = heights[rows][:, None] > least[rows][:, :, None]
    # a list's padding repeats its first: that is no rival it has not already
    beaten[rows[listed]] = np.any(np.all(farther, axis=-1), axis=-1)[listed]
    return beaten

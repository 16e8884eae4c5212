"""Convex pieces: world pose, bounding box, and support function of the core.

A piece is a core enlarged by `radius` (Minkowski sum with a ball). A sphere's core is a point, a capsule's a
segment along z of half length `size[2]`; boxes and hulls may be rounded. The other kinds have radius 0. A
cone has its base of radius `size[0]` at z = -`size[2]` and its apex at `size[2]`. A half-space, below its x-y
plane, has no support function: `plane_distance.py` measures the others over it.
"""

from math import inf, sqrt

import numpy as np

from touchstone.reference_impl.core.conventions import (
    BOX,
    CAPSULE,
    CONE,
    CYLINDER,
    ELLIPSOID,
    HALF_SPACE,
    HALF_SPACE_REACH,
    HULL,
)
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import multiply, rotate

FAINT, HUGE = 1e-290, 1e290
"""Range of a direction's component sum within which the components' shares are finite and nonzero [1]."""


@kernel
def place_piece(piece, body, vertices, margin):
    """Compute world pose and AABB of a piece from its body's pose; `margin` [m] enlarges the box."""
    multiply(body["rotation"], piece["rotation"], piece["world_rotation"])
    rotate(body["rotation"], piece["position"], piece["world_position"])
    position, rotation = piece["world_position"], piece["world_rotation"]
    low, high, size = piece["low"], piece["high"], piece["size"]
    for i in range(3):
        position[i] += body["position"][i]
    for i in range(3):
        x, y, z = rotation[i, 0], rotation[i, 1], rotation[i, 2]
        if piece["kind"] == HULL:
            top = vertices[corner_of_hull(piece, vertices, x, y, z)]["position"]
            bottom = vertices[corner_of_hull(piece, vertices, -x, -y, -z)]["position"]
            greatest = x * top[0] + y * top[1] + z * top[2]
            least = x * bottom[0] + y * bottom[1] + z * bottom[2]
            low[i] = position[i] + least - margin - piece["radius"]
            high[i] = position[i] + greatest + margin + piece["radius"]
        elif piece["kind"] == CONE:
            across, apex = size[0] * sqrt(x * x + y * y), size[2] * z
            low[i] = position[i] + min(apex, -apex - across) - margin
            high[i] = position[i] + max(apex, across - apex) + margin
        elif piece["kind"] == HALF_SPACE:
            across = sqrt(x * x + y * y)
            low[i] = position[i] - HALF_SPACE_REACH * (across + max(0.0, z)) - margin
            high[i] = position[i] + HALF_SPACE_REACH * (across + max(0.0, -z)) + margin
        else:
            x, y, z = x * size[0], y * size[1], z * size[2]
            if piece["kind"] == BOX:
                reach = abs(x) + abs(y) + abs(z)
            elif piece["kind"] == CYLINDER:
                reach = sqrt(x * x + y * y) + abs(z)
            else:
                reach = sqrt(x * x + y * y + z * z)
            reach += piece["radius"] + margin
            low[i], high[i] = position[i] - reach, position[i] + reach


@inlined_kernel
def corner_of_hull(piece, vertices, u, v, w):
    """Row of the hull's support vertex along (u, v, w), piece frame; ties go to the lowest row.

    Scans all vertices, or the candidates in the direction's cell of the support table (`support_table.py`).
    """
    # unsigned fields are never negative, which spares Numba's check for negative indices
    first, count = np.int64(piece["first_vertex"]), np.int64(piece["vertex_count"])
    cells, size = np.int64(piece["cells"]), piece["size"]
    p, q = abs(u) * size[0], abs(v) * size[1]
    total = p + q + abs(w) * size[2]
    best = first
    if cells == 0 or not FAINT < total < HUGE:
        most = _along(vertices, first, u, v, w)
        for k in range(first + 1, first + count):
            along = _along(vertices, k, u, v, w)
            if along > most:
                most, best = along, k
        return best
    scale = cells / total
    octant = (1 if u < 0 else 0) + (2 if v < 0 else 0) + (4 if w < 0 else 0)
    place = (octant * cells + min(int(p * scale), cells - 1)) * cells + min(int(q * scale), cells - 1)
    most = -inf
    while True:
        listed = vertices[first + count + (place >> 2)]["lists"][place & 3]
        # a fourth entry beyond the vertices is the index of the list's continuation
        place = np.int64(listed[3]) - count
        more = place >= 0
        i, j, k = first + listed[0], first + listed[1], first + listed[2]
        m = k if more else first + listed[3]
        along, other = _along(vertices, i, u, v, w), _along(vertices, j, u, v, w)
        third, fourth = _along(vertices, k, u, v, w), _along(vertices, m, u, v, w)
        # compare in pairs: the processor can overlap independent comparisons
        i, along = (j, other) if other > along else (i, along)
        k, third = (m, fourth) if fourth > third else (k, third)
        i, along = (k, third) if third > along else (i, along)
        if along > most:
            most, best = along, i
        if not more:
            return best


@inlined_kernel
def _along(vertices, row, u, v, w):
    """Dot product of a vertex with (u, v, w) [m]."""
    position = vertices[row]["position"]
    return u * position[0] + v * position[1] + w * position[2]


@inlined_kernel
def local_support(piece, vertices, u, v, w):
    """Support point of the core along (u, v, w), piece frame [m].

    Returns:
        (corner, x, y, z): the index of the corner, and the point. The index is the hull's vertex, the octant
        of a box or of a capsule's end (bits: x, y, z not negative), 0 for a point, -1 for a smooth core.
    """
    kind, size = piece["kind"], piece["size"]
    if kind == HULL:
        row = corner_of_hull(piece, vertices, u, v, w)
        position = vertices[row]["position"]
        return row - piece["first_vertex"], position[0], position[1], position[2]
    if kind == BOX:
        corner = (1 if u >= 0 else 0) + (2 if v >= 0 else 0) + (4 if w >= 0 else 0)
        x = size[0] if u >= 0 else -size[0]
        y = size[1] if v >= 0 else -size[1]
        return corner, x, y, size[2] if w >= 0 else -size[2]
    if kind == CAPSULE:
        return (4, 0.0, 0.0, size[2]) if w >= 0 else (0, 0.0, 0.0, -size[2])
    if kind == ELLIPSOID:
        x, y, z = u * size[0], v * size[1], w * size[2]
        length = sqrt(x * x + y * y + z * z)
        scale = 1 / length if length > 0 else 0.0
        return -1, x * size[0] * scale, y * size[1] * scale, z * size[2] * scale
    if kind == CYLINDER:
        length = sqrt(u * u + v * v)
        scale = size[0] / length if length > 0 else 0.0
        return -1, u * scale, v * scale, size[2] if w >= 0 else -size[2]
    if kind == CONE:
        length = sqrt(u * u + v * v)
        if 2 * size[2] * w > size[0] * length:
            return -1, 0.0, 0.0, size[2]
        scale = size[0] / length if length > 0 else 0.0
        return -1, u * scale, v * scale, -size[2]
    return 0, 0.0, 0.0, 0.0


@kernel
def local_corner(piece, vertices, corner):
    """Position (x, y, z) of the corner with an index from `local_support`, piece frame [m]."""
    size = piece["size"]
    if piece["kind"] == HULL:
        position = vertices[piece["first_vertex"] + corner]["position"]
        return position[0], position[1], position[2]
    if piece["kind"] == BOX or piece["kind"] == CAPSULE:
        u = size[0] if corner & 1 else -size[0]
        v = size[1] if corner & 2 else -size[1]
        return u, v, size[2] if corner & 4 else -size[2]
    return 0.0, 0.0, 0.0


@kernel
def has_rim(piece):
    """Whether a piece has a rim about its z axis, as cylinders and cones do."""
    return piece["kind"] == CYLINDER or piece["kind"] == CONE


@kernel
def axis_of(piece):
    """Unit vector along a piece's z axis, world."""
    m = piece["world_rotation"]
    return m[0, 2], m[1, 2], m[2, 2]


@kernel
def turned(rotation, u, v, w):
    """Rotate the vector (u, v, w) by a rotation matrix: (x, y, z)."""
    return (
        rotation[0, 0] * u + rotation[0, 1] * v + rotation[0, 2] * w,
        rotation[1, 0] * u + rotation[1, 1] * v + rotation[1, 2] * w,
        rotation[2, 0] * u + rotation[2, 1] * v + rotation[2, 2] * w,
    )

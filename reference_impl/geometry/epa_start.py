"""The initial tetrahedron of EPA in the Minkowski difference."""

from math import sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.geometry.gjk import add_support, inward, triangle_normal

SIMPLEX_GROWTH = 1e-9
"""Distance of a new vertex over the pair's size from which it adds a dimension to a simplex [1]."""

RING = ((1.0, 0.0), (-0.5, sqrt(0.75)), (-0.5, -sqrt(0.75)))
"""Three directions in a plane, 120 degrees apart."""


@kernel
def first_tetrahedron(piece_a, piece_b, vertices, known, scale, state):
    """Build a tetrahedron of nonzero volume, given its first vertex or all four (`known`: 1 or 4).

    Returns:
        (count, height): vertices found, fewer than 4 if the difference has no volume, and the fourth's
        height over the plane of the others, times twice the area of their triangle.
    """
    w = state["w"]
    # three directions perpendicular to the first, 120 degrees apart; the queries are independent
    x, y, z = inward(state)
    px, py, pz = _across(x, y, z)
    qx, qy, qz = y * pz - z * py, z * px - x * pz, x * py - y * px
    for k in range(3 if known == 1 else 0):
        p, q = RING[k]
        dx, dy, dz = p * px + q * qx, p * py + q * qy, p * pz + q * qz
        add_support(piece_a, piece_b, vertices, dx, dy, dz, k + 1, state)
    height, square = _height(w)
    if height * height <= SIMPLEX_GROWTH * scale * SIMPLEX_GROWTH * scale * square:
        count = _grow_point(piece_a, piece_b, vertices, scale, state)
        if count == 2:
            count = _grow_segment(piece_a, piece_b, vertices, scale, state)
        if count == 3:
            count = _grow_triangle(piece_a, piece_b, vertices, scale, state)
        if count < 4:
            return count, 0.0
        height, _ = _height(w)
    return 4, height


@kernel
def _across(x, y, z):
    """Unit vector perpendicular to (x, y, z) and to the axis of its smallest component."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax <= ay and ax <= az:
        p, q, r = 0.0, z, -y
    elif ay <= az:
        p, q, r = -z, 0.0, x
    else:
        p, q, r = y, -x, 0.0
    inverse = 1 / sqrt(p * p + q * q + r * r)
    return p * inverse, q * inverse, r * inverse


@kernel
def _height(w):
    """Height of the fourth vertex over the first three, times the length of their normal, and that length
    squared."""
    x, y, z, square, _ = triangle_normal(w, 0, 1, 2)
    return x * (w[3, 0] - w[0, 0]) + y * (w[3, 1] - w[0, 1]) + z * (w[3, 2] - w[0, 2]), square


@kernel
def _grow_point(piece_a, piece_b, vertices, scale, state):
    w = state["w"]
    for n in range(6):
        sign = 1.0 if n % 2 == 0 else -1.0
        axis = n // 2
        x, y, z = (sign if axis == 0 else 0.0), (sign if axis == 1 else 0.0), (sign if axis == 2 else 0.0)
        add_support(piece_a, piece_b, vertices, x, y, z, 1, state)
        dx, dy, dz = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
        if dx * dx + dy * dy + dz * dz > (SIMPLEX_GROWTH * scale) ** 2:
            return 2
    return 1


@kernel
def _grow_segment(piece_a, piece_b, vertices, scale, state):
    w = state["w"]
    dx, dy, dz = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
    length = sqrt(dx * dx + dy * dy + dz * dz)
    x, y, z = _across(dx, dy, dz)
    for n in range(4):
        sign = 1.0 if n % 2 == 0 else -1.0
        if n == 2:
            x, y, z = (dy * z - dz * y) / length, (dz * x - dx * z) / length, (dx * y - dy * x) / length
        add_support(piece_a, piece_b, vertices, sign * x, sign * y, sign * z, 2, state)
        px, py, pz = w[2, 0] - w[0, 0], w[2, 1] - w[0, 1], w[2, 2] - w[0, 2]
        cx, cy, cz = dy * pz - dz * py, dz * px - dx * pz, dx * py - dy * px
        if cx * cx + cy * cy + cz * cz > (SIMPLEX_GROWTH * scale * length) ** 2:
            return 3
    return 2


@kernel
def _grow_triangle(piece_a, piece_b, vertices, scale, state):
    w = state["w"]
    x, y, z, square, _ = triangle_normal(w, 0, 1, 2)
    area = sqrt(square)
    x, y, z = x / area, y / area, z / area
    base = x * w[0, 0] + y * w[0, 1] + z * w[0, 2]
    # put the fourth vertex on the side where the difference extends farther
    down = add_support(piece_a, piece_b, vertices, -x, -y, -z, 3, state) + base
    up = add_support(piece_a, piece_b, vertices, x, y, z, 3, state) - base
    if up < down:
        add_support(piece_a, piece_b, vertices, -x, -y, -z, 3, state)
    return 4 if max(up, down) > SIMPLEX_GROWTH * scale else 3


@kernel
def flat_normal(w, count, out_normal):
    """Unit normal of a difference of zero volume from its first `count` vertices; z for a point."""
    n = out_normal
    if count == 1:
        n[0], n[1], n[2] = 0.0, 0.0, 1.0
    elif count == 2:
        n[0], n[1], n[2] = _across(w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2])
    else:
        x, y, z, square, _ = triangle_normal(w, 0, 1, 2)
        length = sqrt(square)
        n[0], n[1], n[2] = x / length, y / length, z / length

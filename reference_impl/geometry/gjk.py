"""GJK: the point of a Minkowski difference nearest to the origin, or a simplex that contains the origin.

The Minkowski difference of A and B is {a - b}, in B's frame. `state["w"]` holds the simplex of up to four
vertices, `state["a"]` the support points of A, and `state["corner"]` the corners of A and B.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import DISTANCE_TOLERANCE
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.geometry.shapes import local_support

SLIVER_SINE = 1e-2
"""Squared sine between two edges of a face below which its normal comes from its two shorter edges [1]."""
FLAT_HEIGHT = 1e-12
"""Height of a tetrahedron over its edge below which rounding decides the sides of its faces [1]."""
GJK_CAP = 64
"""Iterations of GJK; about 6 are usual."""

INSIDE = 15
"""Mask of all four vertices: the tetrahedron contains the origin."""


@kernel
def enter_frame(piece_a, piece_b, state):
    """Compute A's pose in B's frame; all queries run in that frame, which saves one rotation per support."""
    m, n, turn, gap = piece_a["world_rotation"], piece_b["world_rotation"], state["turn"], state["gap"]
    p, q = piece_a["world_position"], piece_b["world_position"]
    x, y, z = p[0] - q[0], p[1] - q[1], p[2] - q[2]
    for i in range(3):
        for j in range(3):
            turn[i, j] = n[0, i] * m[0, j] + n[1, i] * m[1, j] + n[2, i] * m[2, j]
        gap[i] = n[0, i] * x + n[1, i] * y + n[2, i] * z


@kernel
def inward(state):
    """Unit direction from A's origin to B's, or x if they coincide."""
    gap = state["gap"]
    x, y, z = gap[0], gap[1], gap[2]
    length = sqrt(x * x + y * y + z * z)
    if not length > 0:
        return 1.0, 0.0, 0.0
    return -x / length, -y / length, -z / length


@kernel
def add_support(piece_a, piece_b, vertices, x, y, z, k, state):
    """Write the difference's support point along (x, y, z) to vertex k; returns the support value [m]."""
    return inline_support(piece_a, piece_b, vertices, x, y, z, k, state)


@inlined_kernel
def inline_support(piece_a, piece_b, vertices, x, y, z, k, state):
    """`add_support` inlined: the hottest loop gains 10 %."""
    turn, gap = state["turn"], state["gap"]
    w, a, corner = state["w"][k], state["a"][k], state["corner"][k]
    u = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
    v = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
    t = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
    corner[0], u, v, t = local_support(piece_a, vertices, u, v, t)
    corner[1], p, q, r = local_support(piece_b, vertices, -x, -y, -z)
    a[0] = turn[0, 0] * u + turn[0, 1] * v + turn[0, 2] * t + gap[0]
    a[1] = turn[1, 0] * u + turn[1, 1] * v + turn[1, 2] * t + gap[1]
    a[2] = turn[2, 0] * u + turn[2, 1] * v + turn[2, 2] * t + gap[2]
    p, q, r = a[0] - p, a[1] - q, a[2] - r
    w[0], w[1], w[2] = p, q, r
    return x * p + y * q + z * r


@kernel
def shift_simplex(state, count, x, y, z):
    """Translate B by (x, y, z) relative to A, and update the first `count` vertices."""
    w, a, gap = state["w"], state["a"], state["gap"]
    gap[0], gap[1], gap[2] = gap[0] - x, gap[1] - y, gap[2] - z
    for k in range(count):
        w[k, 0], w[k, 1], w[k, 2] = w[k, 0] - x, w[k, 1] - y, w[k, 2] - z
        a[k, 0], a[k, 1], a[k, 2] = a[k, 0] - x, a[k, 1] - y, a[k, 2] - z


@kernel
def nearest_on_simplex(piece_a, piece_b, vertices, count, state):
    """Run GJK to rounding from the first `count` vertices of `state`, at most 3.

    Returns:
        (count, distance, bound, x, y, z, iterations): vertices left in the simplex; distance of the
        difference from the origin [m], a lower bound on it, and its nearest point. Count 4 and distance 0
        if it contains the origin. `state["weights"]` holds the nearest point's barycentric coordinates.
    """
    w, largest = state["w"], 0.0
    for k in range(count):
        largest = max(largest, w[k, 0] ** 2 + w[k, 1] ** 2 + w[k, 2] ** 2)
    count, x, y, z = _keep(state, _nearest(w, count))
    square, bound, iterations = x * x + y * y + z * z, 0.0, 0
    while iterations < GJK_CAP:
        iterations += 1
        # the origin is inside the simplex, or on it to rounding
        if count == 4 or square <= DISTANCE_TOLERANCE * DISTANCE_TOLERANCE * largest:
            return count, 0.0, 0.0, x, y, z, iterations
        reach = add_support(piece_a, piece_b, vertices, -x, -y, -z, count, state)
        # the plane through the new vertex bounds the distance of the difference from below
        bound = -reach / sqrt(square)
        if square + reach <= DISTANCE_TOLERANCE * sqrt(square * largest) or repeats(w, count):
            break
        largest = max(largest, w[count, 0] ** 2 + w[count, 1] ** 2 + w[count, 2] ** 2)
        choice = _nearest(w, count + 1)
        nearer = _square(w, choice)
        # rounding prevents further progress: keep the last simplex
        if nearer >= square + DISTANCE_TOLERANCE * sqrt(square * largest) and choice[0] != INSIDE:
            break
        count, x, y, z = _keep(state, choice)
        square = x * x + y * y + z * z
    return count, sqrt(square), bound, x, y, z, iterations


@inlined_kernel
def _nearest(w, count):
    """Nearest point of the first `count` vertices' simplex to the origin: (mask, four weights)."""
    if count == 4:
        return _tetrahedron(w)
    if count == 3:
        return _triangle(w, 0, 1, 2)
    return _segment(w, 0, 1) if count == 2 else _place(0, -1, -1, 1.0, 0.0, 0.0)


@inlined_kernel
def repeats(w, count):
    """Whether vertex `count` is already among the `count` before it."""
    for k in range(count):
        if w[k, 0] == w[count, 0] and w[k, 1] == w[count, 1] and w[k, 2] == w[count, 2]:
            return True
    return False


@kernel
def _keep(state, choice):
    """Reduce the simplex to the vertices that support the nearest point; returns (count, x, y, z)."""
    w, a, corner, weights = state["w"], state["a"], state["corner"], state["weights"]
    mask, p, q, r, s = choice
    kept = 0
    x = y = z = 0.0
    for k in range(4):
        if mask & (1 << k):
            share = p if k == 0 else (q if k == 1 else (r if k == 2 else s))
            weights[kept] = share
            corner[kept, 0], corner[kept, 1] = corner[k, 0], corner[k, 1]
            for i in range(3):
                w[kept, i], a[kept, i] = w[k, i], a[k, i]
            x += share * w[kept, 0]
            y += share * w[kept, 1]
            z += share * w[kept, 2]
            kept += 1
    # for a triangle, project onto the normal: near its plane, rounding would turn the weighted sum
    if kept == 3:
        nx, ny, nz, square, _ = triangle_normal(w, 0, 1, 2)
        share = (nx * w[0, 0] + ny * w[0, 1] + nz * w[0, 2]) / square
        x, y, z = share * nx, share * ny, share * nz
    return kept, x, y, z


@kernel
def _dot(p, q):
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


@kernel
def _between(p, q, r):
    """(q - p) . (r - p)"""
    return (q[0] - p[0]) * (r[0] - p[0]) + (q[1] - p[1]) * (r[1] - p[1]) + (q[2] - p[2]) * (r[2] - p[2])


@kernel
def _place(i, j, k, u, v, t):
    """Pack weights u, v, t of vertices i, j, k (-1: none) as (mask, four weights)."""
    mask = 0
    p = q = r = s = 0.0
    for n in range(3):
        index = i if n == 0 else (j if n == 1 else k)
        share = u if n == 0 else (v if n == 1 else t)
        if index < 0:
            continue
        mask |= 1 << index
        if index == 0:
            p = share
        elif index == 1:
            q = share
        elif index == 2:
            r = share
        else:
            s = share
    return mask, p, q, r, s


@kernel
def _segment(w, i, j):
    """Nearest point of segment ij to the origin: (mask, four weights)."""
    length = _between(w[i], w[j], w[j])
    along = -(_dot(w[i], w[j]) - _dot(w[i], w[i]))
    if along <= 0 or length <= 0:
        return _place(i, -1, -1, 1.0, 0.0, 0.0)
    if along >= length:
        return _place(j, -1, -1, 1.0, 0.0, 0.0)
    return _place(i, j, -1, 1 - along / length, along / length, 0.0)


@inlined_kernel
def triangle_normal(w, i, j, k):
    """Normal (w_j - w_i) x (w_k - w_i), its squared length and that of the longer of these edges.

    A sliver's normal comes from its two shorter edges: rounding grows with the product of edge lengths.
    """
    px, py, pz = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
    qx, qy, qz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
    x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    square = x * x + y * y + z * z
    one, two = px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz
    if square < SLIVER_SINE * one * two:
        rx, ry, rz = w[k, 0] - w[j, 0], w[k, 1] - w[j, 1], w[k, 2] - w[j, 2]
        three = rx * rx + ry * ry + rz * rz
        if one > two and one > three:
            px, py, pz = qx, qy, qz
        if three < one or three < two:
            qx, qy, qz = rx, ry, rz
        x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        square = x * x + y * y + z * z
    return x, y, z, square, max(one, two)


@inlined_kernel
def _square(w, choice):
    """Squared distance from the origin to the point with mask and weights `choice`."""
    _, p, q, r, s = choice
    total = 0.0
    for i in range(3):
        c = (p * w[0, i] if p != 0 else 0.0) + (q * w[1, i] if q != 0 else 0.0)
        c += (r * w[2, i] if r != 0 else 0.0) + (s * w[3, i] if s != 0 else 0.0)
        total += c * c
    return total


@inlined_kernel
def _triangle(w, i, j, k):
    """Nearest point of triangle ijk to the origin: (mask, four weights)."""
    nx, ny, nz, square, _ = triangle_normal(w, i, j, k)
    # signed areas of the sub-triangles at the origin's projection
    a, b, c = w[i], w[j], w[k]
    u = nx * (b[1] * c[2] - b[2] * c[1]) + ny * (b[2] * c[0] - b[0] * c[2]) + nz * (b[0] * c[1] - b[1] * c[0])
    v = nx * (c[1] * a[2] - c[2] * a[1]) + ny * (c[2] * a[0] - c[0] * a[2]) + nz * (c[0] * a[1] - c[1] * a[0])
    t = square - u - v
    if square > 0 and u > 0 and v > 0 and t > 0:
        return _place(i, j, k, u / square, v / square, t / square)
    best = _segment(w, i, j)
    least = _square(w, best)
    for n in range(2):
        other = _segment(w, j, k) if n == 0 else _segment(w, k, i)
        square = _square(w, other)
        if square < least:
            best, least = other, square
    return best


@inlined_kernel
def _tetrahedron(w):
    """Nearest point of the tetrahedron to the origin: (mask, four weights); INSIDE if it contains it."""
    best = (0, 0.0, 0.0, 0.0, 0.0)
    least = -1.0
    for n in range(4):
        i, j, k = (n + 1) % 4, (n + 2) % 4, (n + 3) % 4
        nx, ny, nz, square, _ = triangle_normal(w, i, j, k)
        origin = -(nx * w[i, 0] + ny * w[i, 1] + nz * w[i, 2])
        inner = origin + nx * w[n, 0] + ny * w[n, 1] + nz * w[n, 2]
        height = inner * inner
        flat = height <= FLAT_HEIGHT * FLAT_HEIGHT * square * _between(w[n], w[i], w[i])
        # the face separates the origin from the fourth vertex, or the tetrahedron has no volume
        if origin * inner < 0 or flat:
            choice = _triangle(w, i, j, k)
            square = _square(w, choice)
            if least < 0 or square < least:
                best, least = choice, square
    if least < 0:
        return INSIDE, 0.25, 0.25, 0.25, 0.25
    return best

"""GJK: the point of a Minkowski difference nearest to the origin, or the simplex that holds it.

The Minkowski difference of A and B is {a - b}; w are its points relative to the pieces' offset. A simplex
of up to four vertices lies in `state["w"]`, with the points of A they come from in `state["a"]` and the
corners of A and B in `state["corner"]`.
"""

from math import sqrt

from reference_impl.conventions import DISTANCE_TOLERANCE, FLAT, GJK_CAP, STAGNATION
from reference_impl.kernel import kernel
from reference_impl.shapes import support

INSIDE = 15
"""Mask of all four vertices: the tetrahedron holds the origin."""


@kernel
def add_vertex(piece_a, piece_b, vertices, x, y, z, k, state):
    """Write the difference's support along (x, y, z) into vertex k; returns its reach along it."""
    w, a, corner = state["w"][k], state["a"][k], state["corner"][k]
    corner[0] = support(piece_a, vertices, x, y, z, a)
    corner[1] = support(piece_b, vertices, -x, -y, -z, w)
    for i in range(3):
        a[i] += piece_a["world_position"][i] - piece_b["world_position"][i]
        w[i] = a[i] - w[i]
    return x * w[0] + y * w[1] + z * w[2]


@kernel
def nearest_on_simplex(piece_a, piece_b, vertices, state):
    """GJK to convergence.

    Returns:
        (count, distance, x, y, z, iterations, converged): vertices left in the simplex, distance of the
        difference from the origin [m] and its nearest point; count 4 and distance 0 when it holds the
        origin. `state["offset"][:4]` are the nearest point's barycentric weights.
    """
    w, weights = state["w"], state["offset"]
    x, y, z = 1.0, 0.0, 0.0
    add_vertex(piece_a, piece_b, vertices, x, y, z, 0, state)
    weights[0], count = 1.0, 1
    x, y, z = w[0, 0], w[0, 1], w[0, 2]
    square = x * x + y * y + z * z
    iterations, converged, largest = 0, False, 0.0
    while iterations < GJK_CAP:
        iterations += 1
        newest = w[count - 1]
        largest = max(largest, sqrt(newest[0] ** 2 + newest[1] ** 2 + newest[2] ** 2))
        distance = sqrt(square)
        # the origin is inside the simplex, or on it to rounding
        if count == 4 or distance <= DISTANCE_TOLERANCE * largest:
            return count, 0.0, x, y, z, iterations, True
        reach = add_vertex(piece_a, piece_b, vertices, -x, -y, -z, count, state)
        # no point of the difference is nearer than the plane through the new vertex
        if square + reach <= DISTANCE_TOLERANCE * distance * largest or repeats(w, count):
            converged = True
            break
        choice = (
            _segment(w, 0, 1) if count == 1 else (_triangle(w, 0, 1, 2) if count == 2 else _tetrahedron(w))
        )
        nearer = _square(w, choice)
        # rounding ends progress: the last simplex stands
        if nearer >= square and choice[0] != INSIDE:
            converged = square + reach <= STAGNATION * distance * largest
            break
        count, x, y, z = _keep(state, choice)
        square = nearer
    return count, sqrt(square), x, y, z, iterations, converged


@kernel
def repeats(w, count):
    """Whether vertex `count` is already among the `count` before it."""
    for k in range(count):
        if w[k, 0] == w[count, 0] and w[k, 1] == w[count, 1] and w[k, 2] == w[count, 2]:
            return True
    return False


@kernel
def _keep(state, choice):
    """Keep the vertices that carry the nearest point; returns (count, x, y, z)."""
    w, a, corner, weights = state["w"], state["a"], state["corner"], state["offset"]
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
    """Weights u, v, t at vertices i, j, k (-1: none) as (mask, four weights)."""
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


@kernel
def _normal(w, i, j, k):
    """(w_j - w_i) x (w_k - w_i)"""
    ux, uy, uz = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
    vx, vy, vz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def _square(w, choice):
    """Squared distance from the origin of the point with mask and weights `choice`."""
    _, p, q, r, s = choice
    total = 0.0
    for i in range(3):
        c = (p * w[0, i] if p != 0 else 0.0) + (q * w[1, i] if q != 0 else 0.0)
        c += (r * w[2, i] if r != 0 else 0.0) + (s * w[3, i] if s != 0 else 0.0)
        total += c * c
    return total


@kernel
def _triangle(w, i, j, k):
    """Nearest point of triangle ijk to the origin: (mask, four weights)."""
    nx, ny, nz = _normal(w, i, j, k)
    square = nx * nx + ny * ny + nz * nz
    # signed areas of the sub-triangles that the origin's projection spans
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


@kernel
def _tetrahedron(w):
    """Nearest point of the tetrahedron to the origin: (mask, four weights); INSIDE when it holds it."""
    best = (0, 0.0, 0.0, 0.0, 0.0)
    least = -1.0
    for n in range(4):
        i, j, k = (n + 1) % 4, (n + 2) % 4, (n + 3) % 4
        nx, ny, nz = _normal(w, i, j, k)
        origin = -(nx * w[i, 0] + ny * w[i, 1] + nz * w[i, 2])
        inner = origin + nx * w[n, 0] + ny * w[n, 1] + nz * w[n, 2]
        height = inner * inner
        square = nx * nx + ny * ny + nz * nz
        flat = height <= FLAT * FLAT * square * _between(w[n], w[i], w[i])
        # the origin is on the far side of this face from the fourth vertex, or the tetrahedron has no volume
        if origin * inner < 0 or flat:
            choice = _triangle(w, i, j, k)
            square = _square(w, choice)
            if least < 0 or square < least:
                best, least = choice, square
    if least < 0:
        return INSIDE, 0.25, 0.25, 0.25, 0.25
    return best

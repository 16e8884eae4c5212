"""EPA: from a simplex round the origin to the nearest face of the Minkowski difference.

The polytope always lies inside the difference, so its nearest face bounds the depth from below; the
difference's support along that face's normal bounds it from above. Both meet at the exact depth.
"""

from math import sqrt

from reference_impl.conventions import (
    DEGENERATE,
    DEPTH_TOLERANCE,
    EPA_FACES,
    EPA_VERTICES,
    GROWTH,
    STAGNATION,
)
from reference_impl.kernel import kernel
from reference_impl.simplex import add_vertex, repeats

NEVER = 1e300
"""Offset of a face without area: it closes the surface but is never the nearest."""
DEAD = -NEVER
"""Offset that marks a free slot of the face list."""


@kernel
def deepest_face(piece_a, piece_b, vertices, count, scale, state, out_normal):
    """Expand the simplex in `state` (its first `count` vertices) to the nearest face.

    Args:
        scale: size of the pair [m], for tolerances.
        out_normal: direction of least reach.
    Returns:
        (face, depth, iterations, converged): slot of the face of least reach (EPA_FACES where it was replaced
        since), and that reach [m]. Without a volume face is -1 and the reach 0 in any direction: converged
        where the difference is a point.
    """
    count = _tetrahedron(piece_a, piece_b, vertices, count, scale, state)
    if count < 4:
        out_normal[0], out_normal[1], out_normal[2] = 0.0, 0.0, 1.0
        return -1, 0.0, 0, count == 1
    faces, vertex, depth, best = 4, 4, NEVER, 0
    while True:
        nearest = _nearest_face(state, faces)
        n = state["normal"][nearest]
        reach = add_vertex(piece_a, piece_b, vertices, n[0], n[1], n[2], vertex, state)
        # every reach bounds the depth from above
        if reach < depth:
            depth, best = reach, nearest
            out_normal[0], out_normal[1], out_normal[2] = n[0], n[1], n[2]
        gap = reach - state["offset"][nearest]
        converged = gap <= DEPTH_TOLERANCE * scale
        # a vertex that is there already adds nothing: what is left of the gap is rounding
        if repeats(state["w"], vertex):
            converged = gap <= STAGNATION * scale
            break
        vertex += 1
        if converged or vertex == EPA_VERTICES:
            break
        faces = _expand(state, nearest, vertex - 1, faces, scale)
        if faces < 0:
            break
    return (nearest if best == nearest else EPA_FACES), depth, vertex - 4, converged


@kernel
def _nearest_face(state, faces):
    offset = state["offset"]
    nearest, least = 0, NEVER * 10
    for f in range(faces):
        if DEAD < offset[f] < least:
            nearest, least = f, offset[f]
    return nearest


@kernel
def _expand(state, first, vertex, faces, scale):
    """Replace the faces that see `vertex`, found from face `first` on, by a cone from their horizon.

    Returns:
        The new face count, or -1 where the horizon is no simple loop or the room is used up.
    """
    w, face, normal, offset = state["w"], state["face"], state["normal"], state["offset"]
    beyond, edge, stack, free = state["beyond"], state["edge"], state["stack"], state["free"]
    x, y, z = w[vertex, 0], w[vertex, 1], w[vertex, 2]
    # flood from the nearest face; edges to faces that do not see the vertex are the horizon
    edges, waiting, released = 0, 1, 1
    stack[0] = free[0] = first
    offset[first] = DEAD
    while waiting > 0:
        waiting -= 1
        f = stack[waiting]
        for k in range(3):
            g = beyond[f, k]
            if offset[g] == DEAD:
                continue
            n = normal[g]
            if offset[g] != NEVER and n[0] * x + n[1] * y + n[2] * z - offset[g] > DEGENERATE * scale:
                offset[g] = DEAD
                stack[waiting] = free[released] = g
                waiting += 1
                released += 1
            else:
                edge[edges, 0], edge[edges, 1], edge[edges, 2] = face[f, k], face[f, (k + 1) % 3], g
                edges += 1
    if faces + edges - released > EPA_FACES:
        return -1
    # new faces fill the released slots first
    for e in range(edges):
        if e >= released:
            free[e] = faces
            faces += 1
        state["starts"][edge[e, 0]] = free[e]
        _set_face(state, free[e], edge[e, 0], edge[e, 1], vertex, scale)
    for e in range(edges):
        i, j, g, new = edge[e, 0], edge[e, 1], edge[e, 2], free[e]
        after = state["starts"][j]
        if face[after, 0] != j or face[after, 2] != vertex:
            return -1
        beyond[new, 0], beyond[new, 1], beyond[after, 2] = g, after, new
        for k in range(3):
            if face[g, k] == j and face[g, (k + 1) % 3] == i:
                beyond[g, k] = new
    return faces


@kernel
def _set_face(state, f, i, j, k, scale):
    """Face ijk, counter-clockwise from outside: its unit normal and its offset from the origin."""
    w, n = state["w"], state["normal"][f]
    state["face"][f, 0], state["face"][f, 1], state["face"][f, 2] = i, j, k
    ux, uy, uz = w[j, 0] - w[i, 0], w[j, 1] - w[i, 1], w[j, 2] - w[i, 2]
    vx, vy, vz = w[k, 0] - w[i, 0], w[k, 1] - w[i, 1], w[k, 2] - w[i, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = x * x + y * y + z * z
    longest = max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz)
    if square <= (DEGENERATE * scale) ** 2 * longest:
        state["offset"][f] = NEVER
        return
    inverse = 1 / sqrt(square)
    n[0], n[1], n[2] = x * inverse, y * inverse, z * inverse
    state["offset"][f] = n[0] * w[i, 0] + n[1] * w[i, 1] + n[2] * w[i, 2]


@kernel
def _tetrahedron(piece_a, piece_b, vertices, count, scale, state):
    """Grow the simplex to a tetrahedron with volume, faces turned outward; returns its vertex count."""
    w = state["w"]
    if count == 1:
        count = _grow_point(piece_a, piece_b, vertices, scale, state)
    if count == 2:
        count = _grow_segment(piece_a, piece_b, vertices, scale, state)
    if count == 3:
        count = _grow_triangle(piece_a, piece_b, vertices, scale, state)
    if count < 4:
        return count
    # orient: the fourth vertex lies behind the face of the first three
    ux, uy, uz = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
    vx, vy, vz = w[2, 0] - w[0, 0], w[2, 1] - w[0, 1], w[2, 2] - w[0, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    height = x * (w[3, 0] - w[0, 0]) + y * (w[3, 1] - w[0, 1]) + z * (w[3, 2] - w[0, 2])
    i, j = (0, 1) if height < 0 else (1, 0)
    _set_face(state, 0, i, j, 2, scale)
    _set_face(state, 1, i, 3, j, scale)
    _set_face(state, 2, j, 3, 2, scale)
    _set_face(state, 3, 2, 3, i, scale)
    for f in range(4):
        for k in range(3):
            for g in range(4):
                for m in range(3):
                    if (
                        state["face"][f, k] == state["face"][g, (m + 1) % 3]
                        and state["face"][g, m] == state["face"][f, (k + 1) % 3]
                    ):
                        state["beyond"][f, k] = g
    return count


@kernel
def _grow_point(piece_a, piece_b, vertices, scale, state):
    w = state["w"]
    for n in range(6):
        sign = 1.0 if n % 2 == 0 else -1.0
        axis = n // 2
        x, y, z = (sign if axis == 0 else 0.0), (sign if axis == 1 else 0.0), (sign if axis == 2 else 0.0)
        add_vertex(piece_a, piece_b, vertices, x, y, z, 1, state)
        dx, dy, dz = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
        if dx * dx + dy * dy + dz * dz > (GROWTH * scale) ** 2:
            return 2
    return 1


@kernel
def _grow_segment(piece_a, piece_b, vertices, scale, state):
    w = state["w"]
    dx, dy, dz = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
    length = sqrt(dx * dx + dy * dy + dz * dz)
    # the axis least along the segment gives two directions across it
    ax, ay, az = abs(dx), abs(dy), abs(dz)
    ex = 1.0 if ax <= ay and ax <= az else 0.0
    ey = 1.0 if ex == 0.0 and ay <= az else 0.0
    ez = 1.0 - ex - ey
    x, y, z = dy * ez - dz * ey, dz * ex - dx * ez, dx * ey - dy * ex
    for n in range(4):
        sign = 1.0 if n % 2 == 0 else -1.0
        if n == 2:
            x, y, z = (dy * z - dz * y) / length, (dz * x - dx * z) / length, (dx * y - dy * x) / length
        add_vertex(piece_a, piece_b, vertices, sign * x, sign * y, sign * z, 2, state)
        px, py, pz = w[2, 0] - w[0, 0], w[2, 1] - w[0, 1], w[2, 2] - w[0, 2]
        cx, cy, cz = dy * pz - dz * py, dz * px - dx * pz, dx * py - dy * px
        if cx * cx + cy * cy + cz * cz > (GROWTH * scale * length) ** 2:
            return 3
    return 2


@kernel
def _grow_triangle(piece_a, piece_b, vertices, scale, state):
    w = state["w"]
    ux, uy, uz = w[1, 0] - w[0, 0], w[1, 1] - w[0, 1], w[1, 2] - w[0, 2]
    vx, vy, vz = w[2, 0] - w[0, 0], w[2, 1] - w[0, 1], w[2, 2] - w[0, 2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area = sqrt(x * x + y * y + z * z)
    x, y, z = x / area, y / area, z / area
    base = x * w[0, 0] + y * w[0, 1] + z * w[0, 2]
    # the side that reaches farther holds the origin's volume
    up = add_vertex(piece_a, piece_b, vertices, x, y, z, 3, state) - base
    down = add_vertex(piece_a, piece_b, vertices, -x, -y, -z, 4, state) + base
    if up >= down:
        add_vertex(piece_a, piece_b, vertices, x, y, z, 3, state)
    else:
        for i in range(3):
            state["w"][3, i], state["a"][3, i] = state["w"][4, i], state["a"][4, i]
        for i in range(2):
            state["corner"][3, i] = state["corner"][4, i]
    return 4 if max(up, down) > GROWTH * scale else 3

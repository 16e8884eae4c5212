"""Signed distance of two convex pieces, with its normal and witness points: GJK outside, EPA inside."""

from reference_impl.conventions import APART, NEAR
from reference_impl.kernel import kernel
from reference_impl.polytope import deepest_face
from reference_impl.rotation import rotate
from reference_impl.segments import have_segments, segment_distance
from reference_impl.simplex import add_support, enter_frame, inward, nearest_on_simplex


@kernel
def convex_depth(piece_a, piece_b, vertices, state, out_pair):
    """Signed distance [m], normal A to B, and a witness on each piece, written to `out_pair` (PAIR).

    The distance is exact to rounding: outside it is that of the cores less their radii, in overlap minus
    the length of the shortest translation that parts the pieces (van den Bergen 2001).

    Returns:
        (iterations, converged)
    """
    if have_segments(piece_a, piece_b):
        segment_distance(piece_a, piece_b, out_pair)
        return 1, True
    enter_frame(piece_a, piece_b, state)
    scale, iterations = _size(piece_a) + _size(piece_b), 0
    distance, normal = 0.0, out_pair["normal"]
    x, y, z = inward(state)
    overlap = add_support(piece_a, piece_b, vertices, x, y, z, 0, state) >= 0
    # along the line of centres nothing parts the pieces: perhaps they overlap
    if overlap:
        face, depth, iterations, converged = deepest_face(piece_a, piece_b, vertices, scale, state, normal)
        overlap = depth > 0 and converged
    if not overlap:
        add_support(piece_a, piece_b, vertices, x, y, z, 0, state)
        count, distance, x, y, z, steps, converged = nearest_on_simplex(piece_a, piece_b, vertices, 1, state)
        iterations += steps
        if distance > NEAR * scale:
            normal[0], normal[1], normal[2] = -x / distance, -y / distance, -z / distance
            _witnesses(state, count, out_pair)
        else:
            x, y, z = inward(state)
            add_support(piece_a, piece_b, vertices, x, y, z, 0, state)
            face, depth, steps, converged = deepest_face(piece_a, piece_b, vertices, scale, state, normal)
            iterations += steps
            overlap = True
    if overlap:
        _witnesses_in_overlap(piece_a, piece_b, vertices, face, depth, APART * scale, state, out_pair)
        # GJK may end a rounding away from an origin that lies inside
        if distance == 0.0 or depth > 0.0:
            distance = -depth
    _leave_frame(piece_b, normal, out_pair)
    # from the cores to the surfaces
    distance -= piece_a["radius"] + piece_b["radius"]
    for i in range(3):
        out_pair["point_a"][i] += piece_a["radius"] * normal[i]
        out_pair["point_b"][i] -= piece_b["radius"] * normal[i]
    out_pair["distance"] = distance
    return iterations, converged


@kernel
def _leave_frame(piece_b, normal, out_pair):
    """Turn the normal and the witnesses from B's frame to the world."""
    m, origin = piece_b["world_rotation"], piece_b["world_position"]
    n, a, b = normal, out_pair["point_a"], out_pair["point_b"]
    rotate(m, n, n)
    rotate(m, a, a)
    rotate(m, b, b)
    for i in range(3):
        a[i] += origin[i]
        b[i] += origin[i]


@kernel
def _size(piece):
    size = 0.0
    for i in range(3):
        size = max(size, piece["high"][i] - piece["low"][i])
    return size


@kernel
def _witnesses(state, count, out_pair):
    """Points of A and B from the barycentric weights of a simplex, B's frame."""
    w, a, weights = state["w"], state["a"], state["weights"]
    for i in range(3):
        on_a = on_difference = 0.0
        for k in range(count):
            on_a += weights[k] * a[k, i]
            on_difference += weights[k] * w[k, i]
        out_pair["point_a"][i] = on_a
        out_pair["point_b"][i] = on_a - on_difference


@kernel
def _witnesses_in_overlap(piece_a, piece_b, vertices, face, depth, parted, state, out_pair):
    """Witnesses on the deepest face: from the weights of the origin's projection on it.

    That need not lie on the face's triangle, for faces of a Minkowski difference are polygons. Then: the nearest
    points once B is parted from A along the normal, up to a gap.
    """
    n, w, a, gap = out_pair["normal"], state["w"], state["a"], state["gap"]
    x, y, z = (depth + parted) * n[0], (depth + parted) * n[1], (depth + parted) * n[2]
    count = 1
    if face >= 0:
        _bring_to_front(state, face)
        if _on_triangle(w, n, depth, state["weights"]):
            _witnesses(state, 3, out_pair)
            return
        count = 3
    gap[0], gap[1], gap[2] = gap[0] - x, gap[1] - y, gap[2] - z
    if face >= 0:
        for k in range(3):
            a[k, 0], a[k, 1], a[k, 2] = a[k, 0] - x, a[k, 1] - y, a[k, 2] - z
            w[k, 0], w[k, 1], w[k, 2] = w[k, 0] - x, w[k, 1] - y, w[k, 2] - z
    else:
        add_support(piece_a, piece_b, vertices, n[0], n[1], n[2], 0, state)
    count, _, _, _, _, _, _ = nearest_on_simplex(piece_a, piece_b, vertices, count, state)
    _witnesses(state, count, out_pair)
    point = out_pair["point_a"]
    point[0], point[1], point[2] = point[0] + x, point[1] + y, point[2] + z


@kernel
def _bring_to_front(state, face):
    """Copy a face's corners to vertices 0 to 2, the lowest first: none is written over before it is read."""
    start, w, a = state["start"], state["w"], state["a"]
    i, j, k = start[4 * face], start[4 * face + 1], start[4 * face + 2]
    lowest, highest = min(i, j, k), max(i, j, k)
    middle = j if (i < j) != (k < j) else (i if (j < i) != (k < i) else k)
    for c in range(3):
        w[0, c], a[0, c] = w[lowest, c], a[lowest, c]
        w[1, c], a[1, c] = w[middle, c], a[middle, c]
        w[2, c], a[2, c] = w[highest, c], a[highest, c]


@kernel
def _on_triangle(w, n, depth, out_weights):
    """Weights of the origin's projection on the triangle of the first three vertices; whether it lies on it."""
    x, y, z = depth * n[0], depth * n[1], depth * n[2]
    whole = _area(n, w[0], w[1], w[2, 0], w[2, 1], w[2, 2])
    u = _area(n, w[1], w[2], x, y, z) / whole
    v = _area(n, w[2], w[0], x, y, z) / whole
    t = 1 - u - v
    out_weights[0], out_weights[1], out_weights[2] = u, v, t
    return u >= 0 and v >= 0 and t >= 0


@kernel
def _area(n, p, q, x, y, z):
    """Twice the signed area, along n, of the triangle p, q, (x, y, z)."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = x - p[0], y - p[1], z - p[2]
    return n[0] * (uy * vz - uz * vy) + n[1] * (uz * vx - ux * vz) + n[2] * (ux * vy - uy * vx)

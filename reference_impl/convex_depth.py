"""Signed distance of two convex pieces, with its normal and witness points: GJK outside, EPA inside."""

from reference_impl.conventions import APART, EPA_FACES, NEAR
from reference_impl.kernel import kernel
from reference_impl.polytope import deepest_face
from reference_impl.segments import have_segments, segment_distance
from reference_impl.simplex import nearest_on_simplex


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
    count, distance, x, y, z, iterations, converged = nearest_on_simplex(piece_a, piece_b, vertices, state)
    scale = _size(piece_a) + _size(piece_b)
    normal = out_pair["normal"]
    if distance > NEAR * scale:
        normal[0], normal[1], normal[2] = -x / distance, -y / distance, -z / distance
        _witnesses(state, count, out_pair)
    else:
        face, depth, expansions, converged = deepest_face(
            piece_a, piece_b, vertices, count, scale, state, normal
        )
        iterations += expansions
        if face < 0:
            # the pieces are flat or points: any normal parts them
            _witnesses(state, 1, out_pair)
        else:
            if face == EPA_FACES or not _witnesses_on_face(state, face, depth, out_pair):
                _witnesses_apart(piece_a, piece_b, vertices, depth + APART * scale, state, out_pair)
            # GJK may end a rounding away from an origin that lies inside
            if distance == 0.0 or depth > 0.0:
                distance = -depth
    # from the cores to the surfaces
    distance -= piece_a["radius"] + piece_b["radius"]
    for i in range(3):
        out_pair["point_a"][i] += piece_a["radius"] * normal[i] + piece_b["world_position"][i]
        out_pair["point_b"][i] += -piece_b["radius"] * normal[i] + piece_b["world_position"][i]
    out_pair["distance"] = distance
    return iterations, converged


@kernel
def _size(piece):
    size = 0.0
    for i in range(3):
        size = max(size, piece["high"][i] - piece["low"][i])
    return size


@kernel
def _witnesses(state, count, out_pair):
    """Points of A and B from the barycentric weights of GJK's simplex, relative to B's origin."""
    w, a, weights = state["w"], state["a"], state["offset"]
    for i in range(3):
        on_a = on_difference = 0.0
        for k in range(count):
            on_a += weights[k] * a[k, i]
            on_difference += weights[k] * w[k, i]
        out_pair["point_a"][i] = on_a
        out_pair["point_b"][i] = on_a - on_difference


@kernel
def _witnesses_on_face(state, f, depth, out_pair):
    """Witnesses from the weights of the origin's projection on a face, relative to B's origin.

    Returns:
        Whether the projection lies on the face's triangle. It need not: faces of a Minkowski difference are
        polygons.
    """
    w, a, n, corner = state["w"], state["a"], state["normal"][f], state["face"][f]
    whole = _area(n, w[corner[0]], w[corner[1]], w[corner[2]][0], w[corner[2]][1], w[corner[2]][2])
    x, y, z = depth * n[0], depth * n[1], depth * n[2]
    u = _area(n, w[corner[1]], w[corner[2]], x, y, z) / whole
    v = _area(n, w[corner[2]], w[corner[0]], x, y, z) / whole
    t = 1 - u - v
    if not (u >= 0 and v >= 0 and t >= 0):
        return False
    for i in range(3):
        on_a = u * a[corner[0], i] + v * a[corner[1], i] + t * a[corner[2], i]
        out_pair["point_a"][i] = on_a
        out_pair["point_b"][i] = on_a - depth * n[i]
    return True


@kernel
def _area(n, p, q, x, y, z):
    """Twice the signed area, along n, of the triangle p, q, (x, y, z)."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = x - p[0], y - p[1], z - p[2]
    return n[0] * (uy * vz - uz * vy) + n[1] * (uz * vx - ux * vz) + n[2] * (ux * vy - uy * vx)


@kernel
def _witnesses_apart(piece_a, piece_b, vertices, shift, state, out_pair):
    """Witnesses in overlap: the nearest points once B is parted from A along the normal."""
    normal, position = out_pair["normal"], piece_b["world_position"]
    x, y, z = position[0], position[1], position[2]
    for i in range(3):
        position[i] += shift * normal[i]
    count, _, _, _, _, _, _ = nearest_on_simplex(piece_a, piece_b, vertices, state)
    _witnesses(state, count, out_pair)
    for i in range(3):
        out_pair["point_a"][i] += shift * normal[i]
    position[0], position[1], position[2] = x, y, z

"""Signed distance of two convex pieces, with normal and witness points: EPA in overlap, GJK otherwise.

Converged means that proven bounds meet within STAGNATION_GAP of the pair's size. In overlap, EPA's polytope
bounds the depth from below and the support value along the normal bounds it from above. For separated pieces,
the gap along the normal bounds the distance from below and the witnesses bound it from above.
"""

from math import isfinite, sqrt

from touchstone.reference_impl.core.conventions import (
    BOX,
    SHARPENING_SHIFT,
    STAGNATION_GAP,
    TOUCHING_DISTANCE_SHARE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, rotate
from touchstone.reference_impl.geometry.capsule_distance import have_segments, segment_distance
from touchstone.reference_impl.geometry.epa import deepest_face
from touchstone.reference_impl.geometry.gjk import (
    add_support,
    enter_frame,
    inward,
    nearest_on_simplex,
    shift_simplex,
)
from touchstone.reference_impl.geometry.plane_distance import has_plane, plane_distance


@kernel
def convex_depth(piece_a, piece_b, vertices, state, out_pair):
    """Compute signed distance [m], normal A to B, and a witness on each piece; writes `out_pair` (PAIR).

    The distance is exact to rounding. For separated pieces it is the cores' distance minus the radii; in
    overlap it is minus the length of the shortest separating translation (van den Bergen 2001).

    Returns:
        (iterations, converged)
    """
    if have_segments(piece_a, piece_b):
        segment_distance(piece_a, piece_b, out_pair)
        return 1, True
    if has_plane(piece_a, piece_b):
        plane_distance(piece_a, piece_b, vertices, out_pair)
        return 1, True
    enter_frame(piece_a, piece_b, state)
    scale, small = scale_of(piece_a, piece_b)
    x, y, z = inward(state)
    # if the line of centres is not a separating axis, the pieces probably overlap: try EPA first
    tried = add_support(piece_a, piece_b, vertices, x, y, z, 0, state) >= 0
    face, depth, iterations, converged, distance = -1, 0.0, 0, False, 0.0
    if tried:
        face, depth, iterations, converged = deepest_face(piece_a, piece_b, vertices, 1, scale, state)
    overlap = converged and depth > 0
    if not overlap:
        distance, steps, met = _outside(
            piece_a, piece_b, vertices, SHARPENING_SHIFT * small, scale, state, out_pair
        )
        iterations += steps
        # the gap is too small for a normal from the nearest points: take EPA's
        overlap = not met and distance <= TOUCHING_DISTANCE_SHARE * scale
        if overlap and not tried:
            add_support(piece_a, piece_b, vertices, x, y, z, 0, state)
            face, depth, steps, converged = deepest_face(piece_a, piece_b, vertices, 1, scale, state)
            iterations += steps
        elif overlap:
            face = -1
        else:
            converged = met
    if overlap:
        copy_vector(state["deepest"], out_pair["normal"])
        witnesses_in_overlap(
            piece_a, piece_b, vertices, face, depth, SHARPENING_SHIFT * scale, state, out_pair
        )
        # GJK may report a distance of rounding size for an origin inside the difference
        if distance > 0 and depth <= 0:
            converged = converged and distance + depth <= STAGNATION_GAP * scale
        else:
            distance = -depth
    return iterations, leave_frame(piece_a, piece_b, distance, out_pair) and converged


@kernel
def _outside(piece_a, piece_b, vertices, shift, scale, state, out_pair):
    """Distance [m] of two cores by GJK, with normal and witnesses; 0 if they overlap.

    For a tiny gap at a round surface, rounding tilts the normal and the bounds do not meet. B is then shifted
    away along the normal (a step of the proximal point method). A shift t leaves t / (R + t) of the tilt,
    where R is the radius of curvature.

    Returns:
        (distance, iterations, whether the bounds met)
    """
    n, point = out_pair["normal"], out_pair["point_a"]
    x, y, z = inward(state)
    add_support(piece_a, piece_b, vertices, x, y, z, 0, state)
    count, distance, bound, x, y, z, iterations = nearest_on_simplex(piece_a, piece_b, vertices, 1, state)
    if distance == 0:
        return 0.0, iterations, False
    n[0], n[1], n[2] = -x / distance, -y / distance, -z / distance
    witnesses(state, count, out_pair)
    if distance - bound <= STAGNATION_GAP * scale:
        return distance, iterations, True
    dx, dy, dz = shift * n[0], shift * n[1], shift * n[2]
    shift_simplex(state, count, dx, dy, dz)
    count, far, _, x, y, z, steps = nearest_on_simplex(piece_a, piece_b, vertices, count, state)
    sharper = sqrt((x + dx) * (x + dx) + (y + dy) * (y + dy) + (z + dz) * (z + dz))
    # from a simplex of rounding size, the second search may end farther away
    if far > 0 and sharper <= distance + STAGNATION_GAP * scale:
        n[0], n[1], n[2] = -x / far, -y / far, -z / far
        witnesses(state, count, out_pair)
        point[0], point[1], point[2] = point[0] + dx, point[1] + dy, point[2] + dz
        distance = sharper
    shift_simplex(state, 0, -dx, -dy, -dz)
    bound = -add_support(piece_a, piece_b, vertices, n[0], n[1], n[2], 0, state)
    return distance, iterations + steps, distance - bound <= STAGNATION_GAP * scale


@kernel
def leave_frame(piece_a, piece_b, distance, out_pair):
    """Transform the cores' distance, normal and witnesses to the surfaces in the world frame; returns whether
    all are finite."""
    m, origin = piece_b["world_rotation"], piece_b["world_position"]
    n, a, b = out_pair["normal"], out_pair["point_a"], out_pair["point_b"]
    rotate(m, n, n)
    rotate(m, a, a)
    rotate(m, b, b)
    distance -= piece_a["radius"] + piece_b["radius"]
    total = distance
    for i in range(3):
        a[i] += origin[i] + piece_a["radius"] * n[i]
        b[i] += origin[i] - piece_b["radius"] * n[i]
        total += n[i] + a[i] + b[i]
    out_pair["distance"] = distance
    if isfinite(total):
        return True
    out_pair["distance"] = 0.0
    for i in range(3):
        n[i], a[i], b[i] = 1.0 if i == 2 else 0.0, 0.0, 0.0
    return False


@kernel
def scale_of(piece_a, piece_b):
    """Sum of the two pieces' sizes, and the smaller size [m]; a size is the largest extent of the AABB."""
    a = b = 0.0
    for i in range(3):
        a = max(a, piece_a["high"][i] - piece_a["low"][i])
        b = max(b, piece_b["high"][i] - piece_b["low"][i])
    return a + b, min(a, b)


@kernel
def witnesses(state, count, out_pair):
    """Witnesses on A and B from the barycentric weights of a simplex, in B's frame.

    `state["feature"]` receives the corners of that simplex; none of a tetrahedron, which contains the origin.
    """
    w, a, weights = state["w"], state["a"], state["weights"]
    state["feature_count"] = count if count <= 3 else 0
    for k in range(state["feature_count"]):
        state["feature"][k, 0], state["feature"][k, 1] = state["corner"][k, 0], state["corner"][k, 1]
    for i in range(3):
        on_a = on_difference = 0.0
        for k in range(count):
            on_a += weights[k] * a[k, i]
            on_difference += weights[k] * w[k, i]
        out_pair["point_a"][i] = on_a
        out_pair["point_b"][i] = on_a - on_difference


@kernel
def witnesses_in_overlap(piece_a, piece_b, vertices, face, depth, parted, state, out_pair):
    """Witnesses of an overlapping pair from the origin's projection on the deepest face.

    The projection may miss the face's triangle, because faces of a Minkowski difference are polygons. On a
    face spanned by two edges, or of a box, it may lie on the other half of a parallelogram. Otherwise the
    witnesses are the nearest points after B is moved along the normal until the gap is `parted` [m].
    """
    n, point = out_pair["normal"], out_pair["point_a"]
    if face >= 0:
        _bring_to_front(state, face)
        if _on_triangle(state["w"], n, depth, state["weights"]) or _on_other_half(piece_a, piece_b, state):
            witnesses(state, 3, out_pair)
            return
    x, y, z = (depth + parted) * n[0], (depth + parted) * n[1], (depth + parted) * n[2]
    shift_simplex(state, 3, x, y, z)
    if face < 0:
        add_support(piece_a, piece_b, vertices, n[0], n[1], n[2], 0, state)
    count = 3 if face >= 0 else 1
    count, _, _, _, _, _, _ = nearest_on_simplex(piece_a, piece_b, vertices, count, state)
    witnesses(state, count, out_pair)
    point[0], point[1], point[2] = point[0] + x, point[1] + y, point[2] + z


@kernel
def _bring_to_front(state, face):
    """Copy a face's vertices to vertices 0 to 2 in ascending order, so that none is overwritten before it is
    read."""
    start, w, a, corner = state["start"], state["w"], state["a"], state["corner"]
    i, j, k = start[4 * face], start[4 * face + 1], start[4 * face + 2]
    lowest, highest = min(i, j, k), max(i, j, k)
    middle = j if (i < j) != (k < j) else (i if (j < i) != (k < i) else k)
    for c in range(3):
        w[0, c], a[0, c] = w[lowest, c], a[lowest, c]
        w[1, c], a[1, c] = w[middle, c], a[middle, c]
        w[2, c], a[2, c] = w[highest, c], a[highest, c]
    for c in range(2):
        corner[0, c], corner[1, c], corner[2, c] = corner[lowest, c], corner[middle, c], corner[highest, c]


@kernel
def _on_triangle(w, n, depth, out_weights):
    """Whether the origin's projection lies on the triangle of the first three vertices; writes weights."""
    x, y, z = depth * n[0], depth * n[1], depth * n[2]
    whole = _area(n, w[0], w[1], w[2, 0], w[2, 1], w[2, 2])
    u = _area(n, w[1], w[2], x, y, z) / whole
    v = _area(n, w[2], w[0], x, y, z) / whole
    t = 1 - u - v
    out_weights[0], out_weights[1], out_weights[2] = u, v, t
    return u >= 0 and v >= 0 and t >= 0


@kernel
def _on_other_half(piece_a, piece_b, state):
    """Whether the origin's projection lies on the other half of the first three vertices' parallelogram.

    If so, replaces these vertices and their weights by those of the other half.
    """
    w, a, corner, weights = state["w"], state["a"], state["corner"], state["weights"]
    k = 0 if weights[0] < 0 else (1 if weights[1] < 0 else 2)
    i, j = (k + 1) % 3, (k + 2) % 3
    if not (weights[i] <= 1 and weights[j] <= 1):
        return False
    for side in range(2):
        piece = piece_b if side else piece_a
        p, q, r = corner[i, side], corner[j, side], corner[k, side]
        # box corners are bit masks; other pieces may contribute an edge at most
        if p < 0 or (((p ^ r) & (q ^ r)) != 0 if piece["kind"] == BOX else p != r and q != r):
            return False
    for side in range(2):
        corner[k, side] ^= corner[i, side] ^ corner[j, side]
    for c in range(3):
        w[k, c] = w[i, c] + w[j, c] - w[k, c]
        a[k, c] = a[i, c] + a[j, c] - a[k, c]
    weights[i], weights[j], weights[k] = 1 - weights[j], 1 - weights[i], -weights[k]
    return True


@kernel
def _area(n, p, q, x, y, z):
    """Twice the signed area, along n, of the triangle p, q, (x, y, z)."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = x - p[0], y - p[1], z - p[2]
    return n[0] * (uy * vz - uz * vy) + n[1] * (uz * vx - ux * vz) + n[2] * (ux * vy - uy * vx)

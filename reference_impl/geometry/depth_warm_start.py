"""Warm-started convex depth: checks the last frame's feature before it runs GJK and EPA.

A pair's cache entry holds up to three vertices of the Minkowski difference, as corners of A and B: the
vertex, edge or face of the last witnesses. They are posed again. If the face still contains the origin's
projection, its offset is a lower bound, and the difference's support value along its normal an upper bound.
If both meet, the face is locally the nearest (the paper's walk ends there). Its offset is the distance of
separated pieces. In overlap, it is the depth if no other face is nearer. A certificate proves this: the
tetrahedron of the face and a point deep inside the difference, which is part of the difference, contains a
ball around the origin with the depth as radius.

In all other cases GJK and EPA start from the cached corners, and the result is exact. With coherent motion
the check costs almost nothing.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    DEGENERATE_HEIGHT,
    DEPTH_EXACT,
    DEPTH_WALK,
    SHARPENING_SHIFT,
    STAGNATION_GAP,
    TOUCHING_DISTANCE_SHARE,
    WARM_START_GAP,
)
from touchstone.reference_impl.core.counters import COUNT_CERTIFIED, COUNT_EXACT, COUNT_WALKED
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.geometry.capsule_distance import have_segments, segment_distance
from touchstone.reference_impl.geometry.convex_depth import (
    convex_depth,
    leave_frame,
    scale_of,
    witnesses,
    witnesses_in_overlap,
)
from touchstone.reference_impl.geometry.depth_cache import (
    NO_FACE,
    find_entry,
    pose_vertex,
    steady_support,
    store_entry_of_pair,
    triple,
)
from touchstone.reference_impl.geometry.epa import deepest_face
from touchstone.reference_impl.geometry.gjk import enter_frame, nearest_on_simplex, triangle_normal
from touchstone.reference_impl.geometry.plane_distance import has_plane, plane_distance
from touchstone.reference_impl.geometry.shapes import turned

WARM_START_SLACK = 1e-8
"""Slack of a certificate, and least height of its triangles, over the pair's size [1]: 1e8 roundings."""


@kernel
def pair_depth(pieces, vertices, state, pair):
    """`convex_depth` of a pair's pieces by the method `state["depth"]`; updates the counters.

    Returns:
        Whether it converged.
    """
    a, b = pair["piece_a"], pair["piece_b"]
    if state["depth"] == DEPTH_EXACT:
        state["counters"][COUNT_EXACT] += 1
        _, converged = convex_depth(pieces[a], pieces[b], vertices, state, pair)
        return converged
    memory = find_entry(state, a, b)
    cold = is_empty(memory)
    _, converged, certified = warm_started_depth(pieces[a], pieces[b], vertices, state, memory, pair)
    state["counters"][COUNT_EXACT if cold else (COUNT_CERTIFIED if certified else COUNT_WALKED)] += 1
    return converged


@kernel
def is_empty(memory):
    """Whether a cache entry cannot warm-start: the pair is new, or its cores are smooth or segments."""
    return memory["count"] == 0 and memory["face"] == NO_FACE


@kernel
def warm_started_depth(piece_a, piece_b, vertices, state, memory, out_pair):
    """Signed distance, normal and witnesses as in `convex_depth`, warm-started from the pair's cache entry.

    Returns:
        (iterations, converged, certified): without a certificate a depth is only locally minimal and may be
        too large. Only DEPTH_WALK (`state["depth"]`) accepts such a depth.
    """
    if memory["face"] != NO_FACE and _on_box_face(piece_a, piece_b, vertices, memory, out_pair):
        return 1, True, True
    if have_segments(piece_a, piece_b):
        segment_distance(piece_a, piece_b, out_pair)
        return 1, True, True
    if has_plane(piece_a, piece_b):
        plane_distance(piece_a, piece_b, vertices, out_pair)
        return 1, True, True
    known, corner, iterations, converged = memory["count"], memory["corner"], 0, False
    if known > 0:
        enter_frame(piece_a, piece_b, state)
        for k in range(known):
            pose_vertex(piece_a, piece_b, vertices, corner[k, 0], corner[k, 1], k, state)
        scale, _ = scale_of(piece_a, piece_b)
        if known == 3:
            nearest, depth = _nearest_face(piece_a, piece_b, vertices, scale, state, memory, out_pair)
            if depth > 0:
                _pose_inside(piece_a, piece_b, state)
                known = 4
            if nearest:
                certified = depth <= 0 or _holds_ball(state["w"], depth, scale)
                if certified or state["depth"] == DEPTH_WALK:
                    return 1, leave_frame(piece_a, piece_b, -depth, out_pair), certified
        iterations, converged = _go_on(piece_a, piece_b, vertices, known, scale, state, out_pair)
    if not converged:
        iterations, converged = convex_depth(piece_a, piece_b, vertices, state, out_pair)
    store_entry_of_pair(piece_a, piece_b, vertices, state, memory, out_pair["normal"])
    return iterations, converged, converged


@kernel
def _go_on(piece_a, piece_b, vertices, count, scale, state, out_pair):
    """Exact depth, started from the first `count` vertices of `state`: GJK from up to 3, EPA from 4.

    Returns:
        (iterations, converged)
    """
    normal, iterations = out_pair["normal"], 0
    if count < 4:
        count, distance, bound, x, y, z, iterations = nearest_on_simplex(
            piece_a, piece_b, vertices, count, state
        )
        if count < 4:
            if distance <= TOUCHING_DISTANCE_SHARE * scale or distance - bound > STAGNATION_GAP * scale:
                return iterations, False
            normal[0], normal[1], normal[2] = -x / distance, -y / distance, -z / distance
            witnesses(state, count, out_pair)
            return iterations, leave_frame(piece_a, piece_b, distance, out_pair)
    face, depth, steps, converged = deepest_face(piece_a, piece_b, vertices, 4, scale, state)
    if not converged or depth <= 0:
        return iterations + steps, False
    copy_vector(state["deepest"], normal)
    witnesses_in_overlap(piece_a, piece_b, vertices, face, depth, SHARPENING_SHIFT * scale, state, out_pair)
    return iterations + steps, leave_frame(piece_a, piece_b, -depth, out_pair)


@kernel
def _on_box_face(piece_a, piece_b, vertices, memory, out_pair):
    """Whether the other piece's support point towards the cached box face gives the depth; fills `out_pair`.

    The point's depth is the depth of the pair along the face's normal. It is the least over all directions if
    no other face of the box is nearer to the point, because the difference contains the box around it. For
    separated pieces, the point must lie above the face.
    """
    face = memory["face"] - 1
    a_is_box, axis, sign = face >= 6, face % 6 // 2, 1.0 - 2.0 * (face % 2)
    box, other, side = (piece_a, piece_b, 1) if a_is_box else (piece_b, piece_a, 0)
    m, half, r, p = box["world_rotation"], box["size"], other["world_rotation"], other["world_position"]
    # the face's normal in the world frame, and its opposite in the other piece's frame
    x, y, z = sign * m[0, axis], sign * m[1, axis], sign * m[2, axis]
    u = -(r[0, 0] * x + r[1, 0] * y + r[2, 0] * z)
    v = -(r[0, 1] * x + r[1, 1] * y + r[2, 1] * z)
    w = -(r[0, 2] * x + r[1, 2] * y + r[2, 2] * z)
    u, v, w = steady_support(other, vertices, memory, side, u, v, w)
    u, v, w = turned(r, u, v, w)
    px, py, pz = u + p[0], v + p[1], w + p[2]
    q = box["world_position"]
    u, v, w = u + (p[0] - q[0]), v + (p[1] - q[1]), w + (p[2] - q[2])
    depth = half[axis] - (x * u + y * v + z * w)
    # smallest distance from the other five faces
    least = 2 * half[axis] - depth
    for i in range(3):
        if i != axis:
            least = min(least, half[i] - abs(m[0, i] * u + m[1, i] * v + m[2, i] * w))
    if not (least >= depth and least >= 0.0):
        return False
    n, radius = out_pair["normal"], other["radius"]
    on_box, on_other = out_pair["point_b"], out_pair["point_a"]
    if a_is_box:
        on_box, on_other = on_other, on_box
    turn = 1.0 if a_is_box else -1.0
    n[0], n[1], n[2] = turn * x, turn * y, turn * z
    on_box[0], on_box[1], on_box[2] = px + depth * x, py + depth * y, pz + depth * z
    on_other[0], on_other[1], on_other[2] = px - radius * x, py - radius * y, pz - radius * z
    out_pair["distance"] = -depth - radius
    return True


@kernel
def _pose_inside(piece_a, piece_b, state):
    """Write the difference of the pieces' centres to vertex 3: an interior point, so it has no corners."""
    w, a, corner, gap = state["w"][3], state["a"][3], state["corner"][3], state["gap"]
    c, d = piece_a["center"], piece_b["center"]
    x, y, z = turned(state["turn"], c[0], c[1], c[2])
    a[0], a[1], a[2] = x + gap[0], y + gap[1], z + gap[2]
    w[0], w[1], w[2] = a[0] - d[0], a[1] - d[1], a[2] - d[2]
    corner[0] = corner[1] = -1


@kernel
def _nearest_face(piece_a, piece_b, vertices, scale, state, memory, out_pair):
    """Whether the face of vertices 0, 1, 2 contains the origin's projection and is a supporting face.

    If so, writes normal and witnesses (B's frame) to `out_pair`.

    Returns:
        (nearest, depth): the support value along the normal [m], or the face's offset if it is not nearest.
    """
    w, a, m, gap = state["w"], state["a"], state["turn"], state["gap"]
    x, y, z, square, longest = triangle_normal(w, 0, 1, 2)
    if square <= (DEGENERATE_HEIGHT * scale) ** 2 * longest:
        return False, 0.0
    inverse = 1 / sqrt(square)
    x, y, z = x * inverse, y * inverse, z * inverse
    # the lowest vertex along n bounds the face's offset from below, independent of n's rounding
    low = min(_along(x, y, z, w[0]), _along(x, y, z, w[1]), _along(x, y, z, w[2]))
    # barycentric weights of the projection
    s, t = triple(x, y, z, w[1], w[2]) * inverse, triple(x, y, z, w[2], w[0]) * inverse
    if not (s >= 0 and t >= 0 and s + t <= 1):
        return False, low
    u = m[0, 0] * x + m[1, 0] * y + m[2, 0] * z
    v = m[0, 1] * x + m[1, 1] * y + m[2, 1] * z
    r = m[0, 2] * x + m[1, 2] * y + m[2, 2] * z
    u, v, r = steady_support(piece_a, vertices, memory, 0, u, v, r)
    u, v, r = turned(m, u, v, r)
    i, j, k = steady_support(piece_b, vertices, memory, 1, -x, -y, -z)
    reach = x * (u + gap[0] - i) + y * (v + gap[1] - j) + z * (r + gap[2] - k)
    if reach - low > WARM_START_GAP * scale:
        return False, low
    n, on_a, on_b = out_pair["normal"], out_pair["point_a"], out_pair["point_b"]
    n[0], n[1], n[2] = x, y, z
    for c in range(3):
        on_a[c] = s * a[0, c] + t * a[1, c] + (1 - s - t) * a[2, c]
        on_b[c] = on_a[c] - reach * n[c]
    return True, reach


@kernel
def _along(x, y, z, p):
    return x * p[0] + y * p[1] + z * p[2]


@kernel
def _holds_ball(w, depth, scale):
    """Whether the side faces of the tetrahedron 0123 (base 012) are farther from the origin than `depth`."""
    far = depth + WARM_START_SLACK * scale
    return _farther(w[1], w[0], w[3], far, scale) and (
        _farther(w[2], w[1], w[3], far, scale) and _farther(w[0], w[2], w[3], far, scale)
    )


@kernel
def _farther(p, q, r, far, scale):
    """Whether the plane pqr, counter-clockwise from outside, is farther than `far` [m] from the origin."""
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = x * x + y * y + z * z
    longest = ux * ux + uy * uy + uz * uz + vx * vx + vy * vy + vz * vz
    height = x * p[0] + y * p[1] + z * p[2]
    flat = square <= (WARM_START_SLACK * scale) ** 2 * longest
    return height > 0 and height * height > far * far * square and not flat

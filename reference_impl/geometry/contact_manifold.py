"""Contact manifold of two polyhedra: up to four points where a face touches a face, an edge or a corner.

The side of a capsule, a cylinder or a cone counts as an edge, a capsule's end, a point of a rim and a cone's
apex as a corner, and a cap as a face: a disc, which is clipped exactly. The side of a capsule or a cylinder
along another one, or along an edge, touches in two points. A half-space is a face larger than any other.

The manifold of polyhedra is computed in the contact frame `state["mobility"]` (rows are its axes in the
world): origin at A's witness, z along the normal of `convex_depth`, so A lies below and B above. The plane of
the reference face is z = p[0] x + p[1] y + p[2].
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    BOX,
    CAPSULE,
    CONE,
    FACE_CORNERS,
    HALF_SPACE,
    HALF_SPACE_REACH,
    HULL,
    MANIFOLD_HEIGHT,
    MERGED_A,
    MERGED_NOT,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    column,
    copy_vector,
    cross,
    dot,
    plus,
    row,
    times,
    vector_of,
)
from touchstone.reference_impl.geometry.capsule_distance import (
    are_alongside,
    contact_at_end,
    core_of,
    has_side,
)
from touchstone.reference_impl.geometry.contact_patch import (
    group_patches,
    has_faces,
    take_deepest,
    without_merged,
)
from touchstone.reference_impl.geometry.shapes import axis_of, has_rim

DENSE_HEIGHT = 2e-5
"""The same height in a dense substep and where separation moves bodies together, and the largest gap of
manifold points there [m]: what may land."""
NEVER = 1e300
"""Larger than any height [m]."""
LEAST_SLOPE = 1e-7
"""Cosine of the angle between a normal and a capsule's axis below which they are perpendicular [1]."""
RIM_SLACK = 1e-9
"""Distance outside a rim up to which a point lies on it, and height of a rim over its lowest point beyond
which the cap is tilted [m]: rounding of poses, and less than any gap that matters."""
WITNESS_ERROR = TOUCH_DISTANCE / 10
"""Depth of a pair beyond that of its manifold from which it keeps its witnesses as the deepest point [m]."""
EQUAL_AREA = 1e-9
"""Relative difference of two areas, and component of a normal, that count as zero [1]."""


@kernel
def expand_manifolds(bodies, pieces, vertices, pairs, touching, wide, state):
    """Write one row per manifold point of each touching pair of polyhedra or of sides along each other; other
    pairs keep their witnesses.

    Args:
        wide: whether points with a gap of up to DENSE_HEIGHT are kept too.
        pairs: `pairs[:touching]` touch. The own row of a pair of polyhedra receives the deepest point. The
            other points are appended until `pairs` is full. Rows of one pair share `manifold`, the index of
            the first row, or -1 for other pairs. `next_point` links these rows and ends with -1.
    Returns:
        Index after the last row.
    """
    rows, grouped = touching, state["compound"] == 1 and group_patches(bodies, pieces, pairs, touching)
    for k in range(touching):
        pair = pairs[k]
        if grouped and pair["patch"] != k:
            continue
        shared = grouped and pair["merged"] != MERGED_NOT
        if shared:
            take_deepest(pairs, k, touching)
        a, b = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
        pair["next_point"] = -1
        pair["level"] = 0.5
        if not is_polyhedral(a, b):
            pair["manifold"] = -1
            _frame(pair["normal"], state["mobility"])
            pair["flat_a"] = _flatness(a, vertices, 1.0, pair, state, pair["edge_a"])
            pair["flat_b"] = _flatness(b, vertices, -1.0, pair, state, pair["edge_b"])
            if has_side(a) and has_side(b):
                rows += _write_sides(core_of(a), core_of(b), pairs, k, rows)
            continue
        pair["manifold"] = k
        count, face_on_a = _clipped_feature(
            a, b, vertices, pair, pair["merged"] if shared else MERGED_NOT, wide, state
        )
        if shared:
            count = _add_patch(pieces, vertices, pairs, k, touching, count, wide, state)
        pair["reduced"] = 1 if not shared and (count > 4 or has_rim(a) or has_rim(b)) else 0
        count = _keep_four(state["lower"], count, max(0.0, pair["distance"]) + TOUCH_DISTANCE)
        if count < 2 and (has_rim(a) or has_rim(b)):
            # a contact in one point moves along the curved surface
            pair["manifold"] = -1
        alongside = pair["flat_a"] == 1 and pair["flat_b"] == 1 and not shared
        if alongside and (has_side(a) or has_side(b)):
            one, two = _core(a, state["lower"], pair, state), _core(b, state["upper"], pair, state)
            rows += _write_sides(one, two, pairs, k, rows)
        # in reverse: the appended rows start as copies of the pair's row, which the deepest point overwrites
        for c in range(count - 1, -1, -1):
            target = k
            if c > 0:
                if rows == len(pairs):
                    continue
                pairs[rows] = pair
                target = pair["next_point"] = rows
                rows += 1
            elif state["lower"][0, 2] > pair["distance"] + WITNESS_ERROR:
                # a cylinder may be deepest beside the line of its side that was clipped
                continue
            _write_point(state["lower"][c], face_on_a, pair["point_a"], state, pairs[target])
    return without_merged(pairs, touching, rows) if grouped else rows


@kernel
def lowest_point(piece_a, piece_b, vertices, rate, speed, h, state, out_pair):
    """Write to a copy of a row the touching point of its faces that is lowest after a time h [s].

    Args:
        rate: gradient (3,) of the speed at which B leaves A, along the contact plane [1/s].
        speed: that speed at the row's witness on A [m/s].
    Returns:
        Gap of the point then [m].
    """
    for i in range(3):
        state["toward"][i] = -rate[i]
    count, face_on_a = _clipped_feature(piece_a, piece_b, vertices, out_pair, MERGED_NOT, False, state)
    state["toward"][:] = 0.0
    points, frame, best, least = state["lower"], state["mobility"], -1, NEVER
    u, v, _ = _in_frame(frame, vector_of(rate))
    for k in range(count):
        gap = points[k, 2] + h * (speed + u * points[k, 0] + v * points[k, 1])
        if points[k, 2] <= TOUCH_DISTANCE and gap < least:
            best, least = k, gap
    if best >= 0:
        _write_point(points[best], face_on_a, out_pair["point_a"], state, out_pair)
    return least


@kernel
def _core(piece, points, pair, state):
    """`core_of` a side or, from its ends in the contact frame, of an edge."""
    if has_side(piece):
        return core_of(piece)
    frame, p, q = state["mobility"], vector_of(points[0]), vector_of(points[1])
    middle, half = times(0.5, plus(p, 1.0, q)), times(0.5, plus(q, -1.0, p))
    return plus(vector_of(pair["point_a"]), 1.0, _in_world(frame, middle)), _in_world(frame, half), 0.0


@kernel
def _write_sides(one, two, pairs, k, rows):
    """Write the two points in which cores of sides or edges along each other touch to pair `k` and to row
    `rows`; returns the number of rows added, 0 if the pair keeps its witnesses."""
    pair = pairs[k]
    least, most = pair["distance"] - TOUCH_DISTANCE, max(0.0, pair["distance"]) + TOUCH_DISTANCE
    if rows == len(pairs) or not are_alongside(one, two, least, most):
        return 0
    pair["manifold"] = k
    pairs[rows] = pair
    contact_at_end(one, two, 1.0, pair)
    contact_at_end(one, two, -1.0, pairs[rows])
    pair["next_point"] = rows
    return 1


@kernel
def is_polyhedral(piece_a, piece_b):
    """Whether a face of one of two pieces can touch the other in more than one point: a face, or a side."""
    faces_a, faces_b = has_faces(piece_a), has_faces(piece_b)
    return (faces_a and (faces_b or has_side(piece_b))) or (faces_b and has_side(piece_a))


@kernel
def _add_patch(pieces, vertices, pairs, k, touching, count, wide, state):
    """Add to the manifold of row k in `state["lower"]` the points of the other pairs of its patch.

    Where every corner of the feature of the piece that they share is among the points, those corners are the
    manifold. Keeps the plane of row k in `state["tangent"]`; returns the number of points.
    """
    pair, patch, own, plane = pairs[k], state["patch"], state["lower"], state["tangent"]
    p, q, r = plane[0], plane[1], plane[2]
    total = _append(own, count, patch, 0)
    for j in range(k + 1, touching):
        if pairs[j]["patch"] == k:
            # in the frame of row k
            copy_vector(pair["normal"], pairs[j]["normal"])
            copy_vector(pair["point_a"], pairs[j]["point_a"])
            a, b = pieces[pairs[j]["piece_a"]], pieces[pairs[j]["piece_b"]]
            count, _ = _clipped_feature(a, b, vertices, pairs[j], pair["merged"], wide, state)
            total = _append(own, count, patch, total)
    plane[0], plane[1], plane[2] = p, q, r
    height = DENSE_HEIGHT if wide else MANIFOLD_HEIGHT
    on_b = pair["merged"] == MERGED_A
    piece = pieces[pair["piece_b"] if on_b else pair["piece_a"]]
    corners = state["upper"]
    count = _feature_of(piece, vertices, -1.0 if on_b else 1.0, pair["point_a"], state, height, corners)
    count = _order(corners, count)
    for c in range(count):
        x, y, found = corners[c, 0], corners[c, 1], -1
        for j in range(total):
            if (patch[j, 0] - x) ** 2 + (patch[j, 1] - y) ** 2 <= RIM_SLACK * RIM_SLACK:
                found = j
        if found < 0:
            return _append(patch, min(total, len(own)), own, 0)
        _add(own, c, patch[found, 0], patch[found, 1], patch[found, 2])
    return count


@kernel
def _append(points, count, out_points, total):
    """Copy points behind the first `total` of others, as far as there is room; returns their number."""
    for c in range(min(count, len(out_points) - total)):
        total = _add(out_points, total, points[c, 0], points[c, 1], points[c, 2])
    return total


@kernel
def _clipped_feature(piece_a, piece_b, vertices, pair, merged, wide, state):
    """Clip the incident feature (face, edge or corner) of one piece by the reference face of the other.

    Args:
        merged: body whose face is the reference face, if it touches with one (MERGED_*).
    Returns:
        (count, face_on_a): number of points (x, y, gap) in `state["lower"]`, 0 if neither feature is a face,
        and whether the reference face is A's; its plane is in `state["tangent"]`.
    """
    lower, upper, plane = state["lower"], state["upper"], state["tangent"]
    height, reach = (DENSE_HEIGHT, DENSE_HEIGHT) if wide else (MANIFOLD_HEIGHT, TOUCH_DISTANCE)
    _frame(pair["normal"], state["mobility"])
    count_a = _feature_of(piece_a, vertices, 1.0, pair["point_a"], state, height, lower)
    count_b = _feature_of(piece_b, vertices, -1.0, pair["point_a"], state, height, upper)
    count_a, count_b = _order(lower, count_a), _order(upper, count_b)
    area_a, area_b = _plane(lower, count_a, plane), _plane(upper, count_b, plane)
    pair["flat_a"] = pair["flat_b"] = 0
    if area_a == 0 and area_b == 0:
        if count_a == 2:
            pair["flat_a"] = 1
            _write_edge(lower, state["mobility"], pair["edge_a"])
        if count_b == 2:
            pair["flat_b"] = 1
            _write_edge(upper, state["mobility"], pair["edge_b"])
        return 0, False
    face_on_a = _is_reference(area_a, area_b, pair["normal"])
    if merged != MERGED_NOT and area_a > 0 and area_b > 0:
        face_on_a = merged == MERGED_A
    pair["flat_a"], pair["flat_b"] = (2, 0) if face_on_a else (0, 2)
    cap_a = _cap_of(piece_a, 1.0, pair["point_a"], state["mobility"], height)
    cap_b = _cap_of(piece_b, -1.0, pair["point_a"], state["mobility"], height)
    if cap_a[0] > 0 or cap_b[0] > 0:
        if face_on_a:
            count = _clip_round(upper, count_b, cap_b, lower, count_a, cap_a, state)
            _plane(lower, count_a, plane)
        else:
            count = _clip_round(lower, count_a, cap_a, upper, count_b, cap_b, state)
            _plane(upper, count_b, plane)
    elif face_on_a:
        _plane(lower, count_a, plane)
        count = _clip(upper, count_b, lower, count_a, state["normal"])
    else:
        count = _clip(lower, count_a, upper, count_b, state["normal"])
    # keep the touching points, and those near
    points, kept = upper if face_on_a else lower, 0
    for k in range(count):
        x, y = points[k, 0], points[k, 1]
        gap = points[k, 2] - (plane[0] * x + plane[1] * y + plane[2])
        gap = gap if face_on_a else -gap
        if gap <= max(0.0, pair["distance"]) + reach:
            lower[kept, 0], lower[kept, 1], lower[kept, 2] = x, y, gap
            kept += 1
    return kept, face_on_a


@kernel
def _flatness(piece, vertices, sign, pair, state, out_edge):
    """Dimensions in which the touching feature of a piece extends, along sign * n: 2 of a face, 1 of an edge
    or a side, whose direction it writes, 0 of a corner or a curved surface."""
    m, n = piece["world_rotation"], pair["normal"]
    if piece["kind"] == HALF_SPACE or _cap_of(piece, sign, pair["point_a"], state["mobility"], 0.0)[0] > 0:
        return 2
    if piece["kind"] == CONE:
        return _generator(piece, sign, vector_of(n), out_edge)
    if has_side(piece):
        if abs(m[0, 2] * n[0] + m[1, 2] * n[1] + m[2, 2] * n[2]) > LEAST_SLOPE:
            return 0
        for i in range(3):
            out_edge[i] = m[i, 2]
        return 1
    if piece["kind"] != BOX and piece["kind"] != HULL:
        return 0
    points = state["lower"]
    count = _feature(piece, vertices, sign, pair["point_a"], state["mobility"], MANIFOLD_HEIGHT, points)
    count = _order(points, count)
    if _plane(points, count, state["tangent"]) > 0:
        return 2
    if count < 2:
        return 0
    _write_edge(points, state["mobility"], out_edge)
    return 1


@kernel
def _generator(piece, sign, n, out_edge):
    """Write the direction of the straight line of a cone's side along sign * n; returns 1, or 0 if that
    normal belongs to no such line."""
    size, axis = piece["size"], axis_of(piece)
    along = sign * dot(axis, n)
    out = plus(times(sign, n), -along, axis)
    across = sqrt(dot(out, out))
    slant = sqrt(size[0] * size[0] + 4 * size[2] * size[2])
    if across == 0 or abs(size[0] * across - 2 * size[2] * along) > LEAST_SLOPE * slant:
        return 0
    line = plus(times(2 * size[2] / slant, axis), -size[0] / (slant * across), out)
    out_edge[0], out_edge[1], out_edge[2] = line
    return 1


@kernel
def _write_edge(points, frame, out_edge):
    """Write the world direction between two points of the contact frame."""
    edge = _in_world(frame, plus(vector_of(points[1]), -1.0, vector_of(points[0])))
    size = sqrt(dot(edge, edge))
    out_edge[0], out_edge[1], out_edge[2] = times(1 / size, edge)


@kernel
def _is_reference(area_a, area_b, n):
    """Whether A's face is the reference face: the larger one, or for equal areas the lower one in the world,
    independent of the pair's order."""
    if abs(area_a - area_b) > EQUAL_AREA * (area_a + area_b):
        return area_a > area_b
    for axis in (2, 1, 0):
        if abs(n[axis]) > EQUAL_AREA:
            return n[axis] > 0
    return True


@kernel
def _frame(n, out_frame):
    """Write the rows of a right-handed frame with z along n."""
    ax, ay, az = abs(n[0]), abs(n[1]), abs(n[2])
    least = 0 if ax <= ay and ax <= az else (1 if ay <= az else 2)
    size = sqrt(1 - n[least] * n[least])
    x, y, z = out_frame[0], out_frame[1], out_frame[2]
    for i in range(3):
        z[i] = n[i]
        x[i] = ((1.0 if i == least else 0.0) - n[least] * n[i]) / size
    y[0], y[1], y[2] = z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]


@kernel
def _feature_of(piece, vertices, sign, origin, state, depth, out_points):
    """`_round_feature` of a cylinder or a cone, `_square` of a half-space, `_feature` of others; returns
    the number of points."""
    if has_rim(piece):
        return _round_feature(piece, sign, origin, state, depth, out_points)
    if piece["kind"] == HALF_SPACE:
        return _square(piece, origin, state["mobility"], out_points)
    return _feature(piece, vertices, sign, origin, state["mobility"], depth, out_points)


@kernel
def _square(piece, origin, frame, out_points):
    """Write the corners of a square about the origin of the contact frame in the plane of a half-space."""
    x, y, z = _in_frame(frame, axis_of(piece))
    p, q, r = _in_frame(frame, plus(vector_of(piece["world_position"]), -1.0, vector_of(origin)))
    for k in range(4):
        out_points[k, 0] = HALF_SPACE_REACH if k & 1 else -HALF_SPACE_REACH
        out_points[k, 1] = HALF_SPACE_REACH if k & 2 else -HALF_SPACE_REACH
        out_points[k, 2] = r + (x * (p - out_points[k, 0]) + y * (q - out_points[k, 1])) / z
    return 4


@kernel
def _cap_of(piece, sign, origin, frame, depth):
    """Cap of a cylinder or a cone whose rim lies within `depth` of its support plane along sign * z.

    Returns:
        (radius, x, y, z): that of the cap and its centre in the contact frame [m]; radius 0 if there is none.
    """
    if not has_rim(piece):
        return 0.0, 0.0, 0.0, 0.0
    x, y, z = _in_frame(frame, axis_of(piece))
    if piece["kind"] == CONE and sign * z >= 0:
        return 0.0, 0.0, 0.0, 0.0
    radius, end = piece["size"][0], piece["size"][2] if sign * z >= 0 else -piece["size"][2]
    if 2 * radius * sqrt(x * x + y * y) > max(depth, RIM_SLACK):
        return 0.0, 0.0, 0.0, 0.0
    p, q, r = _in_frame(frame, plus(vector_of(piece["world_position"]), -1.0, vector_of(origin)))
    return radius, p + end * x, q + end * y, r + end * z


@kernel
def _round_feature(piece, sign, origin, state, depth, out_points):
    """Write the touching feature of a cylinder or a cone along sign * z: four points of a cap's rim, the two
    ends of its side's lowest line, the lowest point of a rim, or a cone's apex; returns their number.

    One of the four points is that towards `state["toward"]` or, if this is 0, the lowest, on a level cap that
    towards which gravity pulls.
    """
    frame, m, size = state["mobility"], piece["world_rotation"], piece["size"]
    x, y, z = _in_frame(frame, axis_of(piece))
    p, q, r = _in_frame(frame, plus(vector_of(piece["world_position"]), -1.0, vector_of(origin)))
    radius, cx, cy, cz = _cap_of(piece, sign, origin, frame, depth)
    if radius > 0:
        u, v, _ = _in_frame(frame, vector_of(state["toward"]))
        if u == 0 and v == 0:
            u, v = x, y
            if 2 * radius * sqrt(x * x + y * y) <= RIM_SLACK:
                u, v, w = _in_frame(frame, vector_of(state["gravity"]))
                if u * u + v * v <= LEAST_SLOPE * LEAST_SLOPE * (u * u + v * v + w * w):
                    u, v, _ = _in_frame(frame, (m[0, 0], m[1, 0], m[2, 0]))
        # two directions in the plane of the cap
        along = u * x + v * y
        e = plus((u, v, 0.0), -along, (x, y, z))
        e = times(radius / sqrt(dot(e, e)), e)
        f = cross((x, y, z), e)
        for k in range(4):
            s, t = (1.0 - k, 0.0) if k % 2 == 0 else (0.0, 2.0 - k)
            out_points[k, 0] = cx + s * e[0] + t * f[0]
            out_points[k, 1] = cy + s * e[1] + t * f[1]
            out_points[k, 2] = cz + s * e[2] + t * f[2]
        return 4
    # the lowest line of the side, or its lower end
    across = sqrt(x * x + y * y)
    rise = 2 * size[2] * sign * z - size[0] * across
    if piece["kind"] == CONE and rise > depth:
        out_points[0, 0], out_points[0, 1], out_points[0, 2] = (
            p + size[2] * x,
            q + size[2] * y,
            r + size[2] * z,
        )
        return 1
    scale = sign * size[0] / across
    if piece["kind"] == CONE:
        out_points[0, 0] = p - size[2] * x - scale * z * x
        out_points[0, 1] = q - size[2] * y - scale * z * y
        out_points[0, 2] = r - size[2] * z + scale * (1 - z * z)
        out_points[1, 0], out_points[1, 1], out_points[1, 2] = (
            p + size[2] * x,
            q + size[2] * y,
            r + size[2] * z,
        )
        return 2 if rise >= -depth else 1
    p, q, r = p - scale * z * x, q - scale * z * y, r + scale * (1 - z * z)
    count = 2 if 2 * size[2] * abs(z) <= depth else 1
    end = size[2] if sign * z >= 0 else -size[2]
    for k in range(count):
        out_points[k, 0], out_points[k, 1], out_points[k, 2] = p + end * x, q + end * y, r + end * z
        end = -end
    return count


@kernel
def _in_frame(frame, v):
    """A world vector in the contact frame."""
    return row(frame, 0, v), row(frame, 1, v), row(frame, 2, v)


@kernel
def _in_world(frame, v):
    """A vector of the contact frame in the world."""
    return column(frame, 0, v), column(frame, 1, v), column(frame, 2, v)


@kernel
def _feature(piece, vertices, sign, origin, frame, depth, out_points):
    """Gather the vertices of a polyhedron within `depth` of its support plane along sign * z; returns
    their count."""
    rotation, position, size = piece["world_rotation"], piece["world_position"], piece["size"]
    is_hull, first, radius = piece["kind"] == HULL, piece["first_vertex"], piece["radius"]
    # four box corners coincide at each end of a capsule's core: take one of them
    count, stride = (
        (piece["vertex_count"], 1) if is_hull else ((2, 4) if piece["kind"] == CAPSULE else (8, 1))
    )
    kept, top = 0, -NEVER
    for gather in range(2):
        for c in range(count):
            k = c * stride
            if is_hull:
                corner = vertices[first + k]["position"]
                u, v, w = corner[0], corner[1], corner[2]
            else:
                u = size[0] if k & 1 else -size[0]
                v = size[1] if k & 2 else -size[1]
                w = size[2] if k & 4 else -size[2]
            # transform from the piece frame to the contact frame
            point = out_points[kept]
            point[:] = 0.0
            for i in range(3):
                world = rotation[i, 0] * u + rotation[i, 1] * v + rotation[i, 2] * w + position[i] - origin[i]
                for j in range(3):
                    point[j] += frame[j, i] * world
            # offset from the core to the surface
            point[2] += sign * radius
            height = sign * point[2]
            if gather == 0:
                top = max(top, height)
            elif height >= top - depth and kept < FACE_CORNERS:
                kept += 1
    return kept


@kernel
def _order(points, count):
    """Convex hull of points in the x-y plane, counter-clockwise, in place (Jarvis 1973); returns its size."""
    for k in range(1, count):
        if points[k, 0] < points[0, 0]:
            _swap(points, 0, k)
    for end in range(1, count):
        x, y = points[end - 1, 0], points[end - 1, 1]
        best = end
        # the last candidate is the first point, which closes the polygon
        for k in range(end + 1, count + 1):
            c = k % count
            ux, uy = points[best, 0] - x, points[best, 1] - y
            vx, vy = points[c, 0] - x, points[c, 1] - y
            side = ux * vy - uy * vx
            if side < 0 or (side == 0 and vx * vx + vy * vy > ux * ux + uy * uy):
                best = c
        if best == 0:
            return end
        _swap(points, end, best)
    return count


@kernel
def _swap(points, i, j):
    for c in range(3):
        points[i, c], points[j, c] = points[j, c], points[i, c]


@kernel
def _plane(points, count, out_plane):
    """Plane through the mean of a polygon's vertices with Newell's normal; returns twice the polygon's area
    projected along z, or 0 if that is negligible."""
    x = y = z = 0.0
    out_plane[:] = 0.0
    if count < 3:
        return 0.0
    for k in range(count):
        p, q = points[k], points[(k + 1) % count]
        ux, uy, uz = p[0] - points[0, 0], p[1] - points[0, 1], p[2] - points[0, 2]
        vx, vy, vz = q[0] - points[0, 0], q[1] - points[0, 1], q[2] - points[0, 2]
        x, y, z = x + uy * vz - uz * vy, y + uz * vx - ux * vz, z + ux * vy - uy * vx
        for i in range(3):
            out_plane[i] += p[i] / count
    if z <= MANIFOLD_HEIGHT * MANIFOLD_HEIGHT:
        return 0.0
    out_plane[2] += (x * out_plane[0] + y * out_plane[1]) / z
    out_plane[0], out_plane[1] = -x / z, -y / z
    return z


@kernel
def _clip(points, count, face, face_count, scratch):
    """Clip a convex polygon, edge or corner by the sides of a face in the x-y plane, in place (Sutherland &
    Hodgman 1974); returns the number of points, in which those of an edge may occur twice."""
    for i in range(face_count):
        j = (i + 1) % face_count
        x, y = face[i, 0], face[i, 1]
        ex, ey = face[j, 0] - x, face[j, 1] - y
        kept = 0
        for k in range(count):
            p, q = points[k], points[(k + 1) % count]
            # positive inside
            here = ex * (p[1] - y) - ey * (p[0] - x)
            there = ex * (q[1] - y) - ey * (q[0] - x)
            if here >= 0:
                scratch[kept, 0], scratch[kept, 1], scratch[kept, 2] = p[0], p[1], p[2]
                kept += 1
            if here * there < 0:
                f = here / (here - there)
                for c in range(3):
                    scratch[kept, c] = p[c] + f * (q[c] - p[c])
                kept += 1
        count = kept
        for k in range(count):
            points[k, 0], points[k, 1], points[k, 2] = scratch[k, 0], scratch[k, 1], scratch[k, 2]
    return count


@kernel
def _clip_round(points, count, cap, face, face_count, face_cap, state):
    """Clip a feature by a face in the x-y plane where one or both are caps, in place: corners of either in
    the other, crossings of their outlines and, of two caps, points of the rims on the line of centres.

    Args:
        cap, face_cap: (radius, x, y, z) of `_cap_of`; the points of a cap lie on its rim.
    Returns:
        The number of points, at heights of the clipped feature.
    """
    out, plane, kept = state["normal"], state["tangent"], 0
    flat = _plane(points, count, plane) > 0
    for k in range(count):
        if _is_within(face, face_count, face_cap, points[k, 0], points[k, 1]):
            kept = _add(out, kept, points[k, 0], points[k, 1], points[k, 2])
    if flat:
        for k in range(face_count):
            x, y = face[k, 0], face[k, 1]
            if _is_within(points, count, cap, x, y):
                kept = _add(out, kept, x, y, plane[0] * x + plane[1] * y + plane[2])
    r, s = cap[0], face_cap[0]
    if r > 0 and s > 0:
        dx, dy = face_cap[1] - cap[1], face_cap[2] - cap[2]
        apart = sqrt(dx * dx + dy * dy)
        if apart > MANIFOLD_HEIGHT:
            dx, dy = dx / apart, dy / apart
            along = (apart * apart + r * r - s * s) / (2 * apart)
            across = sqrt(max(0.0, r * r - along * along))
            for k in range(4):
                u, v = along, across if k == 0 else -across
                if k == 2:
                    u, v = r, 0.0
                elif k == 3:
                    u, v = apart - s, 0.0
                x, y = cap[1] + u * dx - v * dy, cap[2] + u * dy + v * dx
                if _is_within(points, count, cap, x, y) and _is_within(face, face_count, face_cap, x, y):
                    kept = _add(out, kept, x, y, plane[0] * x + plane[1] * y + plane[2])
    else:
        polygon, corners, circle = (points, count, face_cap) if s > 0 else (face, face_count, cap)
        for k in range(corners if corners > 2 else corners - 1):
            p, q = polygon[k], polygon[(k + 1) % corners]
            x, y, dx, dy = p[0] - circle[1], p[1] - circle[2], q[0] - p[0], q[1] - p[1]
            square, half = dx * dx + dy * dy, x * dx + y * dy
            root = half * half - square * (x * x + y * y - circle[0] * circle[0])
            if root <= 0:
                continue
            for side in range(2):
                f = (-half + (sqrt(root) if side else -sqrt(root))) / square
                if 0 < f < 1:
                    x, y, z = p[0] + f * dx, p[1] + f * dy, p[2] + f * (q[2] - p[2])
                    if s == 0:
                        z = plane[0] * x + plane[1] * y + plane[2]
                    kept = _add(out, kept, x, y, z)
    for k in range(kept):
        points[k, 0], points[k, 1], points[k, 2] = out[k, 0], out[k, 1], out[k, 2]
    return kept


@kernel
def _add(out_points, kept, x, y, z):
    """Append a point; returns the number of points."""
    out_points[kept, 0], out_points[kept, 1], out_points[kept, 2] = x, y, z
    return kept + 1


@kernel
def _is_within(points, count, cap, x, y):
    """Whether a point of the x-y plane lies in a cap or, if its radius is 0, in a convex polygon."""
    if cap[0] > 0:
        return (x - cap[1]) ** 2 + (y - cap[2]) ** 2 <= (cap[0] + RIM_SLACK) ** 2
    for i in range(count):
        j = (i + 1) % count
        ex, ey = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1]
        if ex * (y - points[i, 1]) - ey * (x - points[i, 0]) < 0:
            return False
    return count > 2


@kernel
def _keep_four(points, count, touching):
    """Reduce a manifold to four points: the deepest, the one farthest from it, the outermost on either side
    of the line through both, and those farthest from all of these; points with a gap of up to `touching` come
    before others. Moves them to the front and returns their count."""
    for k in range(1, count):
        if points[k, 2] < points[0, 2]:
            _swap(points, 0, k)
    kept = 1
    for others in range(2):
        for side in (0, 1, -1, 0):
            # of what touches, points between the ends of an edge carry nothing that these do not
            if kept == 4 or (side != 0 and kept == 1) or (side == 0 and others == 0 and kept > 1):
                continue
            best, out = 0, MANIFOLD_HEIGHT
            for k in range(kept, count):
                if (points[k, 2] <= touching) == (others == 0):
                    way = _spread(points, kept, k, side)
                    if way > out:
                        best, out = k, way
            if best > 0:
                _swap(points, kept, best)
                kept += 1
    # the sides depend on the frame's handedness; the solver's result, on the order of rows
    if kept == 4 and points[3, 2] < points[2, 2]:
        _swap(points, 2, 3)
    return min(count, kept)


@kernel
def _spread(points, kept, k, side):
    """Distance of point k from the nearest of the first `kept`, or from the line through the first two on its
    side 1 or -1, in the x-y plane [m]."""
    if side != 0:
        x, y = points[1, 0] - points[0, 0], points[1, 1] - points[0, 1]
        u, v = points[k, 0] - points[0, 0], points[k, 1] - points[0, 1]
        return side * (x * v - y * u) / sqrt(x * x + y * y)
    least = NEVER
    for j in range(kept):
        u, v = points[k, 0] - points[j, 0], points[k, 1] - points[j, 1]
        least = min(least, sqrt(u * u + v * v))
    return least


@kernel
def _write_point(point, face_on_a, origin, state, out_pair):
    """Write witnesses, distance and normal of one manifold point (x, y, gap), given in the contact frame."""
    frame, plane = state["mobility"], state["tangent"]
    x, y, gap = point[0], point[1], point[2]
    z_face = plane[0] * x + plane[1] * y + plane[2]
    z_a, z_b = (z_face, z_face + gap) if face_on_a else (z_face - gap, z_face)
    size = sqrt(1 + plane[0] * plane[0] + plane[1] * plane[1])
    out_pair["distance"] = gap
    out_pair["level"] = 0.0 if face_on_a else 1.0
    for i in range(3):
        level = origin[i] + frame[0, i] * x + frame[1, i] * y
        out_pair["normal"][i] = (frame[2, i] - plane[0] * frame[0, i] - plane[1] * frame[1, i]) / size
        out_pair["point_b"][i] = level + frame[2, i] * z_b
        # written last, because `origin` may alias `point_a`
        out_pair["point_a"][i] = level + frame[2, i] * z_a

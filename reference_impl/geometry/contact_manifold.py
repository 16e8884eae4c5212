"""Contact manifold of two polyhedra: up to four points where a face touches a face, an edge or a corner.

A capsule's side counts as an edge, its end as a corner. Two capsules side by side touch in two points.

The manifold of polyhedra is computed in the contact frame `state["mobility"]` (rows are its axes in the
world): origin at A's witness, z along the normal of `convex_depth`, so A lies below and B above. The plane of
the reference face is z = p[0] x + p[1] y + p[2].
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    BOX,
    CAPSULE,
    FACE_CORNERS,
    HULL,
    MANIFOLD_HEIGHT,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.geometry.capsule_distance import are_alongside, contact_at_end

DENSE_HEIGHT = 2e-5
"""The same height in a dense substep and where separation moves bodies together, and the largest gap of
manifold points there [m]: what may land."""
NEVER = 1e300
"""Larger than any height [m]."""
LEAST_SLOPE = 1e-7
"""Cosine of the angle between a normal and a capsule's axis below which they are perpendicular [1]."""
EQUAL_AREA = 1e-9
"""Relative difference of two areas, and component of a normal, that count as zero [1]."""


@kernel
def expand_manifolds(pieces, vertices, pairs, touching, wide, state):
    """Write one row per manifold point of each touching pair of polyhedra, or of capsules side by side; other
    pairs keep their witnesses.

    Args:
        wide: whether points with a gap of up to DENSE_HEIGHT are kept too.
        pairs: `pairs[:touching]` touch. The own row of a pair of polyhedra receives the deepest point. The
            other points are appended until `pairs` is full. Rows of one pair share `manifold`, the index of
            the first row, or -1 for other pairs. `next_point` links these rows and ends with -1.
    Returns:
        Index after the last row.
    """
    rows = touching
    for k in range(touching):
        pair = pairs[k]
        a, b = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
        pair["next_point"] = -1
        pair["level"] = 0.5
        if not is_polyhedral(a, b):
            pair["manifold"] = -1
            _frame(pair["normal"], state["mobility"])
            pair["flat_a"] = _flatness(a, vertices, 1.0, pair, state, pair["edge_a"])
            pair["flat_b"] = _flatness(b, vertices, -1.0, pair, state, pair["edge_b"])
            if rows < len(pairs) and are_alongside(a, b, max(0.0, pair["distance"]) + TOUCH_DISTANCE):
                pair["manifold"] = k
                pairs[rows] = pair
                contact_at_end(a, b, 1.0, pair)
                contact_at_end(a, b, -1.0, pairs[rows])
                pair["next_point"] = rows
                rows += 1
            continue
        pair["manifold"] = k
        count, face_on_a = _clipped_feature(a, b, vertices, pair, wide, state)
        count = _keep_four(state["lower"], count)
        # in reverse: the appended rows start as copies of the pair's row, which the deepest point overwrites
        for c in range(count - 1, -1, -1):
            row = k
            if c > 0:
                if rows == len(pairs):
                    continue
                pairs[rows] = pair
                row = pair["next_point"] = rows
                rows += 1
            _write_point(state["lower"][c], face_on_a, pair["point_a"], state, pairs[row])
    return rows


@kernel
def is_polyhedral(piece_a, piece_b):
    """Whether two pieces can touch in more than one point: a face with a face, or with a capsule's side."""
    a, b = piece_a["kind"], piece_b["kind"]
    faces_a, faces_b = a == BOX or a == HULL, b == BOX or b == HULL
    return (faces_a and (faces_b or b == CAPSULE)) or (faces_b and a == CAPSULE)


@kernel
def _clipped_feature(piece_a, piece_b, vertices, pair, wide, state):
    """Clip the incident feature (face, edge or corner) of one piece by the reference face of the other.

    Returns:
        (count, face_on_a): number of points (x, y, gap) in `state["lower"]`, 0 if neither feature is a face,
        and whether the reference face is A's; its plane is in `state["tangent"]`.
    """
    lower, upper, plane = state["lower"], state["upper"], state["tangent"]
    height, reach = (DENSE_HEIGHT, DENSE_HEIGHT) if wide else (MANIFOLD_HEIGHT, TOUCH_DISTANCE)
    _frame(pair["normal"], state["mobility"])
    count_a = _feature(piece_a, vertices, 1.0, pair["point_a"], state["mobility"], height, lower)
    count_b = _feature(piece_b, vertices, -1.0, pair["point_a"], state["mobility"], height, upper)
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
    pair["flat_a"], pair["flat_b"] = (2, 0) if face_on_a else (0, 2)
    if face_on_a:
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
    or a capsule's side, whose direction it writes, 0 of a corner or a curved surface."""
    m, n = piece["world_rotation"], pair["normal"]
    if piece["kind"] == CAPSULE:
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
def _write_edge(points, frame, out_edge):
    """Write the world direction between two points of the contact frame."""
    x, y, z = points[1, 0] - points[0, 0], points[1, 1] - points[0, 1], points[1, 2] - points[0, 2]
    size = sqrt(x * x + y * y + z * z)
    for i in range(3):
        out_edge[i] = (frame[0, i] * x + frame[1, i] * y + frame[2, i] * z) / size


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
def _keep_four(points, count):
    """Reduce a manifold to four points: the deepest, the one farthest from it, and the outermost on either
    side of the line through both. Moves them to the front and returns their count."""
    for k in range(1, count):
        if points[k, 2] < points[0, 2]:
            _swap(points, 0, k)
    far, second = MANIFOLD_HEIGHT, 0
    for k in range(1, count):
        distance = sqrt((points[k, 0] - points[0, 0]) ** 2 + (points[k, 1] - points[0, 1]) ** 2)
        if distance > far:
            far, second = distance, k
    if second == 0:
        return min(count, 1)
    _swap(points, 1, second)
    x, y = (points[1, 0] - points[0, 0]) / far, (points[1, 1] - points[0, 1]) / far
    kept = 2
    for sign in (1.0, -1.0):
        best, out = 0, MANIFOLD_HEIGHT
        for k in range(kept, count):
            side = sign * (x * (points[k, 1] - points[0, 1]) - y * (points[k, 0] - points[0, 0]))
            if side > out:
                best, out = k, side
        if best > 0:
            _swap(points, kept, best)
            kept += 1
    # the sides depend on the frame's handedness; the solver's result, on the order of rows
    if kept == 4 and points[3, 2] < points[2, 2]:
        _swap(points, 2, 3)
    return kept


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

"""Motion of a body over a substep as a function of the fraction s in [0, 1], and bounds on it.

The centre of mass is at old_center + s travel + s^2 travel_bend. The body rotates about it by the world
rotation vector r(s) = s turn + s^2 turn_bend, or freely (`free_rotation`) if `spin_steps` is positive. A body
with `moves` 0 is static.
"""

from math import sqrt

from touchstone.reference_impl.continuous.free_rotation import free_omega, rotation_at
from touchstone.reference_impl.core.conventions import (
    BOX,
    CAPSULE,
    ELLIPSOID,
    HULL,
    KEEPS_NOTHING,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import matrix_of, rotate, rotation_between, turn
from touchstone.reference_impl.geometry.shapes import has_rim, place_piece


@kernel
def flight_motion(body, h):
    """Set the motion of a simulated body over a substep of length h [s]: constant acceleration from its old
    velocities to its new ones, and `curve_turn`; free rotation overrides the rotation."""
    body["moves"] = 1
    flight_way(body, h)
    w0, w1 = body["old_omega"], body["path_omega"] if body["led"] == 1 else body["omega"]
    for i in range(3):
        body["turn"][i] = h * w0[i]
        body["turn_bend"][i] = h / 2 * (w1[i] - w0[i])
        if body["led"] == 1:
            body["turn_bend"][i] += body["curve_turn"][i]


@kernel
def flight_way(body, h):
    """Set the motion of the centre of mass at constant acceleration."""
    v0, v1 = body["old_velocity"], body["path_velocity"] if body["led"] == 1 else body["velocity"]
    for i in range(3):
        body["travel"][i] = h * v0[i]
        body["travel_bend"][i] = h / 2 * (v1[i] - v0[i])


@kernel
def shown_motion(body):
    """Set the motion of a driven body from `old_*` to its current pose: linear, by the shortest rotation."""
    body["moves"], body["spin_steps"], body["spin_keeps"] = 1, 0, KEEPS_NOTHING
    turned = body["scratch"][0]
    rotation_between(body["old_orientation"], body["orientation"], turned)
    for i in range(3):
        body["turn"][i] = turned[i]
        body["travel"][i] = body["center"][i] - body["old_center"][i]
        body["travel_bend"][i] = body["turn_bend"][i] = 0.0


@kernel
def set_path(body, angle):
    """Bound the path length of the points of a body's cores, given a bound `angle` [rad] on its rotation."""
    square = 0.0
    for i in range(3):
        square += (abs(body["travel"][i]) + abs(body["travel_bend"][i])) ** 2
    body["path"] = sqrt(square) + angle * body["reach"]


@kernel
def largest_angle(body):
    """Bound on the angle by which a body rotates over its motion [rad]."""
    if body["spin_steps"] > 0:
        return body["spin_most"]
    v, p = body["turn"], body["turn_bend"]
    return sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2) + sqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2)


@kernel
def is_fast_pair(bodies, pieces, pair, share):
    """Whether the sum of a pair's paths exceeds a share of the sum of its widths. Beyond a share of 1, a test
    at the end may miss that the pieces tunnelled."""
    path = bodies[pair["body_a"]]["path"] + bodies[pair["body_b"]]["path"]
    return path > share * (pieces[pair["piece_a"]]["width"] + pieces[pair["piece_b"]]["width"])


@kernel
def pose_along(body, s):
    """Pose a body at fraction s of its motion."""
    if body["moves"] == 0:
        return
    if body["spin_steps"] > 0:
        rotation_at(body, s)
    else:
        v, p = body["turn"], body["turn_bend"]
        x, y, z = s * (v[0] + s * p[0]), s * (v[1] + s * p[1]), s * (v[2] + s * p[2])
        turn(body["old_orientation"], x, y, z, body["orientation"])
    matrix_of(body["orientation"], body["rotation"])
    rotate(body["rotation"], body["center_of_mass"], body["position"])
    for i in range(3):
        way = s * (body["travel"][i] + s * body["travel_bend"][i])
        body["center"][i] = body["old_center"][i] + way
        body["position"][i] = body["center"][i] - body["position"][i]


@kernel
def swept_box(piece, body, vertices, margin):
    """Bounding box of a piece over its body's motion, widened by `margin` [m]; poses the body at s = 0."""
    pose_along(body, 0.0)
    place_piece(piece, body, vertices, margin)
    if body["moves"] == 0:
        return
    _, lever = lever_of(body, piece, vertices)
    reach = min(largest_angle(body), 2.0) * lever
    for i in range(3):
        way, bend = body["travel"][i], body["travel_bend"][i]
        least, most = min(0.0, way + bend), max(0.0, way + bend)
        # the displacement has an extremum within the substep
        if 0 < -way * bend < 2 * bend * bend:
            least, most = min(least, -way * way / (4 * bend)), max(most, -way * way / (4 * bend))
        piece["low"][i] += least - reach
        piece["high"][i] += most + reach


@kernel
def center_speed(n, body, s):
    """Speed of the centre of mass along n at fraction s, and quadratic term of its displacement [m]."""
    speed = bend = 0.0
    if body["moves"] == 0:
        return speed, bend
    for i in range(3):
        speed += n[i] * (body["travel"][i] + 2 * s * body["travel_bend"][i])
        bend += n[i] * body["travel_bend"][i]
    return speed, bend


@kernel
def point_speed(n, body, point, s):
    """Speed along n [m] of a point of a body posed at fraction s; approximate if the rotation axis moves."""
    if body["moves"] == 0:
        return 0.0
    speed, _ = center_speed(n, body, s)
    v, p, c = body["turn"], body["turn_bend"], body["center"]
    x, y, z = v[0] + 2 * s * p[0], v[1] + 2 * s * p[1], v[2] + 2 * s * p[2]
    if body["spin_steps"] > 0:
        h, w = body["spin_span"] * body["spin_steps"], body["spin_rate"]
        free_omega(body, w)
        x, y, z = h * w[0], h * w[1], h * w[2]
    rx, ry, rz = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    return speed + n[0] * (y * rz - z * ry) + n[1] * (z * rx - x * rz) + n[2] * (x * ry - y * rx)


@kernel
def most_spin(n, body, axial, s, until):
    """Bound on |omega| between two fractions, or on |n x omega| if the axis is fixed (`axial`) [rad].

    The norm of a linear function of the fraction is largest at an end.
    """
    if body["moves"] == 0:
        return 0.0
    if body["spin_steps"] > 0:
        return body["spin_most"]
    v, p = body["turn"], body["turn_bend"]
    most = 0.0
    for end in range(2):
        f = until if end else s
        x, y, z = v[0] + 2 * f * p[0], v[1] + 2 * f * p[1], v[2] + 2 * f * p[2]
        if axial:
            x, y, z = n[1] * z - n[2] * y, n[2] * x - n[0] * z, n[0] * y - n[1] * x
        most = max(most, x * x + y * y + z * z)
    return sqrt(most)


@kernel
def most_curl(body, lever, s, until):
    """Bound on a point's acceleration relative to the centre of mass between two fractions [m].

    |omega x (omega x p)| <= |omega|^2 lever. For a rotation vector r, omega = J r' and
    |omega'| <= |r''| + |r'|^2 / 2, because |J'| <= |r'| / 2.
    """
    if lever == 0:
        return 0.0
    p = body["turn_bend"]
    spin = most_spin(p, body, False, s, until)
    if body["spin_steps"] > 0:
        return lever * (spin * spin + body["spin_bend"])
    return lever * (1.5 * spin * spin + 2 * sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]))


@kernel
def carried_curl(carrier, other, s, until):
    """Bound on the second derivative of the heights of `other`'s points along a normal n that turns with
    `carrier`, between two fractions [m].

    With d from the carrier's centre of mass to the point, |(n.d)''| <= |n''| |d| + 2 |n'| |d'| + |d''|.
    """
    apart = early = late = bend = 0.0
    for i in range(3):
        way = turn = 0.0
        if other["moves"] == 1:
            way, turn = other["travel"][i], other["travel_bend"][i]
        if carrier["moves"] == 1:
            way, turn = way - carrier["travel"][i], turn - carrier["travel_bend"][i]
        apart += (other["center"][i] - carrier["center"][i]) ** 2
        early += (way + 2 * s * turn) ** 2
        late += (way + 2 * until * turn) ** 2
        bend += turn * turn
    axis, reach = carrier["turn_bend"], other["reach"]
    speed = sqrt(max(early, late))
    apart = sqrt(apart) + (until - s) * speed + reach
    speed += reach * most_spin(axis, other, False, s, until)
    turned = most_curl(carrier, carrier["moves"] * 1.0, s, until) * apart
    turned += 2 * most_spin(axis, carrier, False, s, until) * speed
    return turned + 2 * sqrt(bend) + most_curl(other, other["moves"] * reach, s, until)


@kernel
def lever_of(body, piece, vertices):
    """Whether the rotation axis is fixed, and the largest distance [m] of the piece's core from that axis, or
    from the centre of mass if the axis moves; 0 without rotation."""
    if body["moves"] == 0:
        return False, 0.0
    if body["spin_steps"] > 0:
        return False, _farthest(body, piece, vertices, 0.0, 0.0, 0.0)
    v, p = body["turn"], body["turn_bend"]
    x, y, z = v[0] + p[0], v[1] + p[1], v[2] + p[2]
    size = sqrt(x * x + y * y + z * z)
    twist = abs(v[1] * p[2] - v[2] * p[1]) + abs(v[2] * p[0] - v[0] * p[2]) + abs(v[0] * p[1] - v[1] * p[0])
    axial = twist == 0.0 and size > 0
    if twist == 0.0 and size == 0.0 and v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
        return False, 0.0
    if not axial:
        return False, _farthest(body, piece, vertices, 0.0, 0.0, 0.0)
    # the axis in body coordinates, which the rotation leaves constant
    pose_along(body, 0.0)
    m = body["rotation"]
    x, y, z = x / size, y / size, z / size
    u = m[0, 0] * x + m[1, 0] * y + m[2, 0] * z
    v = m[0, 1] * x + m[1, 1] * y + m[2, 1] * z
    w = m[0, 2] * x + m[1, 2] * y + m[2, 2] * z
    return True, _farthest(body, piece, vertices, u, v, w)


@kernel
def _farthest(body, piece, vertices, u, v, w):
    """Largest distance [m] of a piece's core from the unit axis (u, v, w) through its body's centre of mass,
    body frame, or from the centre if the axis is zero. Bounds an ellipsoid by a sphere, a cylinder and a cone
    by balls around a cylinder's caps."""
    kind, size, rotation = piece["kind"], piece["size"], piece["rotation"]
    cx = piece["position"][0] - body["center_of_mass"][0]
    cy = piece["position"][1] - body["center_of_mass"][1]
    cz = piece["position"][2] - body["center_of_mass"][2]
    if kind != HULL and kind != BOX and kind != CAPSULE and not has_rim(piece):
        along = u * cx + v * cy + w * cz
        off = sqrt((cx - along * u) ** 2 + (cy - along * v) ** 2 + (cz - along * w) ** 2)
        return off + max(size[0], size[1], size[2]) if kind == ELLIPSOID else off
    # the caps of a cylinder are those of a segment, enlarged
    cap = size[0] if has_rim(piece) else 0.0
    most = 0.0
    for k in range(piece["vertex_count"] if kind == HULL else 8):
        if kind != HULL:
            px = (size[0] if k & 1 else -size[0]) if kind == BOX else 0.0
            py = (size[1] if k & 2 else -size[1]) if kind == BOX else 0.0
            pz = size[2] if k & 4 else -size[2]
        else:
            corner = vertices[piece["first_vertex"] + k]["position"]
            px, py, pz = corner[0], corner[1], corner[2]
        x = cx + rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz
        y = cy + rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz
        z = cz + rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * pz
        along = u * x + v * y + w * z
        most = max(most, (x - along * u) ** 2 + (y - along * v) ** 2 + (z - along * w) ** 2)
    return sqrt(most) + cap

"""Contact kinematics (Montana 1988): how a contact point and its normal n move with the two surfaces.

The point of a surface whose outward normal is n is x(n), and H = dx/dn has the radii of curvature: 0 at a
corner, r I on a sphere, r / sin(a) around the rim and the side of a cylinder or a cone, where a is the angle
between n and its axis and r the distance from it. On B the outward normal is -n. With u the velocity of B
relative to A, both points stay at a distance s along n if

    (H_A + H_B + s) n' = u + H_A (w_A x n) + H_B (w_B x n)          (tangential parts)

A face or an edge along e has infinite radii along it, and n turns with it there: n'.e = (w x n).e.

All vectors are in the world frame, as tuples; rates are in 1/s.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    CONE,
    CYLINDER,
    ELLIPSOID,
    MANIFOLD_HEIGHT,
    SIMULATED,
    SPHERE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import column, cross, dot, plus, times, vector_of
from touchstone.reference_impl.geometry.shapes import axis_of, has_rim

LEAST_CROSSING = 1e-3
"""Squared sine of the angle between two edges below which they count as parallel: where they cross moves too
fast [1]."""
LEAST_RADIUS = 1e-12
"""Relative radius below which two surfaces are corners, whose normal is undefined [m]."""


@kernel
def is_moving(body):
    """Whether a body moves within a substep: links of drivers outside the loop do not."""
    return body["kind"] == SIMULATED or body["moves"] == 1


@kernel
def velocity_at(body, point):
    """Velocity (3 floats) [m/s] of a body at a point (3,) [m]; 0 if it does not move within a substep."""
    if not is_moving(body):
        return 0.0, 0.0, 0.0
    c, w, v = body["center"], body["omega"], body["velocity"]
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    return v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x


@kernel
def contact_rates(bodies, pieces, pair):
    """Rates of a pair's normal and contact point.

    Returns:
        (found, n', x'): whether they are defined, as they are not where corners touch; the rates [1/s, m/s].
    """
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    n = vector_of(pair["start_normal"])
    turn_a, turn_b = cross(omega_of(a), n), cross(omega_of(b), n)
    v_a, v_b = velocity_at(a, pair["point_a"]), velocity_at(b, pair["point_b"])
    flat_a, flat_b = pair["flat_a"], pair["flat_b"]
    to_a, to_b = _height(pair["point_a"], pair["point"], n), _height(pair["point_b"], pair["point"], n)
    if flat_a == 2:
        x = plus(v_b, -1.0, _bend(two, pair["point_b"], n, plus(turn_a, -1.0, turn_b)))
        return True, turn_a, plus(x, -to_b, turn_a)
    if flat_b == 2:
        x = plus(v_a, 1.0, _bend(one, pair["point_a"], n, plus(turn_b, -1.0, turn_a)))
        return True, turn_b, plus(x, -to_a, turn_b)
    e, f = vector_of(pair["edge_a"]), vector_of(pair["edge_b"])
    apart = max(0.0, to_b - to_a)
    cos = dot(e, f)
    sin2 = dot(e, e) - cos * cos
    crossing = flat_a + flat_b == 2 and sin2 > LEAST_CROSSING
    if crossing:
        along_a, along_b = dot(turn_a, e), dot(turn_b, f)
        rate = plus(times((along_a - cos * along_b) / sin2, e), (along_b - cos * along_a) / sin2, f)
    else:
        u = plus(v_b, -1.0, v_a)
        pull = plus(
            plus(u, 1.0, _bend(one, pair["point_a"], n, turn_a)), 1.0, _bend(two, pair["point_b"], n, turn_b)
        )
        t = e if flat_a == 1 else (f if flat_b == 1 else _tangent(n))
        s = cross(n, t)
        across = plus(
            plus(times(apart, s), 1.0, _bend(one, pair["point_a"], n, s)),
            1.0,
            _bend(two, pair["point_b"], n, s),
        )
        st, ss, pull_s = dot(across, t), dot(across, s), dot(pull, s)
        if flat_a + flat_b > 0:
            if ss <= LEAST_RADIUS:
                return False, n, n
            along = dot(turn_a if flat_a == 1 else turn_b, t)
        else:
            own = plus(
                plus(times(apart, t), 1.0, _bend(one, pair["point_a"], n, t)),
                1.0,
                _bend(two, pair["point_b"], n, t),
            )
            tt = dot(own, t)
            least = tt * ss - st * st
            if least <= LEAST_RADIUS * (tt + ss):
                return False, n, n
            along = (dot(pull, t) * ss - pull_s * st) / least
        rate = plus(times(along, t), (pull_s - along * st) / ss, s)
    x_a = plus(v_a, 1.0, _bend(one, pair["point_a"], n, plus(rate, -1.0, turn_a)))
    x_b = plus(v_b, -1.0, _bend(two, pair["point_b"], n, plus(rate, -1.0, turn_b)))
    if crossing:
        # the points move along their edges too, so that they stay opposite to each other
        way = plus(plus(x_b, -1.0, x_a), -apart, rate)
        over_a, over_b = dot(way, e), dot(way, f)
        x_a = plus(x_a, (over_a - cos * over_b) / sin2, e)
        x_b = plus(x_b, -(over_b - cos * over_a) / sin2, f)
    x_a, x_b = plus(x_a, -to_a, rate), plus(x_b, -to_b, rate)
    # a point on an edge may be anywhere along it: the other surface tells
    share = 0.5 * (1 + flat_a - flat_b)
    x = plus(times(1 - share, x_a), share, x_b)
    return True, rate, plus(x, (dot(v_a, n) + dot(v_b, n)) / 2 - dot(x, n), n)


@kernel
def fastest_turn(bodies, pieces, pair, rate):
    """Speed at which a pair's normal turns at the rate n', or a body turns its round surface, if that is
    faster [rad/s]. A ball turns only where its centre does, about the centre of mass; a contact runs around a
    rim."""
    most, n = dot(rate, rate), vector_of(pair["start_normal"])
    for side in range(2):
        body = bodies[pair["body_b"] if side else pair["body_a"]]
        piece = pieces[pair["piece_b"] if side else pair["piece_a"]]
        w = omega_of(body)
        if piece["kind"] == SPHERE:
            arm = plus(vector_of(piece["world_position"]), -1.0, vector_of(body["center"]))
            size = dot(arm, arm)
            w = times(1 / sqrt(size) if size > 0 else 0.0, cross(w, arm))
        elif has_rim(piece) and not _shows_cap(piece, n):
            t = _around(piece, n)
            runs = dot(t, plus(rate, -1.0, cross(w, n))) / dot(t, t)
            most = max(most, runs * runs)
        most = max(most, dot(w, w))
    return sqrt(most)


@kernel
def is_round(piece):
    """Whether a piece has a curved surface."""
    return piece["radius"] > 0 or piece["kind"] == ELLIPSOID or has_rim(piece)


@kernel
def core_radius(piece, point, n):
    """Distance along the normal n between a point on the surface of a piece that touches in several points
    and a line or point that the normal leads to: the axis of a cylinder or a cone on its side; 0 of its cap
    [m]."""
    if piece["kind"] == CYLINDER:
        return 0.0 if _shows_cap(piece, n) else piece["size"][0]
    if piece["kind"] == CONE:
        t = _around(piece, n)
        return 0.0 if _shows_cap(piece, n) else _rim_radius(piece, point) / sqrt(dot(t, t))
    return piece["radius"]


@kernel
def _rim_radius(piece, point):
    """Radius of the circle about the axis of a cylinder or a cone on which its surface touches at a point
    [m]."""
    if piece["kind"] == CYLINDER:
        return piece["size"][0]
    arm = plus(vector_of(point), -1.0, vector_of(piece["world_position"]))
    across = cross(axis_of(piece), arm)
    return sqrt(dot(across, across))


@kernel
def _around(piece, n):
    """Tangent of a rim at its point with the normal n, as long as the sine of the angle between n and the
    axis."""
    return cross(axis_of(piece), n)


@kernel
def _shows_cap(piece, n):
    """Whether the normal n is that of a cap: its rim lies in a plane across n."""
    t = _around(piece, n)
    return 2 * piece["size"][0] * sqrt(dot(t, t)) <= MANIFOLD_HEIGHT


@kernel
def is_central(body, piece):
    """Whether a piece's centre is its body's centre of mass."""
    p, c = piece["position"], body["center_of_mass"]
    return p[0] == c[0] and p[1] == c[1] and p[2] == c[2]


@kernel
def _bend(piece, point, n, v):
    """H v of a piece's surface at a point: velocity of its point as the normal n turns at the tangential rate
    v."""
    if has_rim(piece):
        if _shows_cap(piece, n):
            return 0.0, 0.0, 0.0
        t = _around(piece, n)
        square = dot(t, t)
        return times(_rim_radius(piece, point) * dot(t, v) / (square * sqrt(square)), t)
    if piece["kind"] != ELLIPSOID:
        return times(piece["radius"], v)
    # x(n) = S^2 n / |S n|, with S the half axes
    m, s = piece["world_rotation"], piece["size"]
    x, y, z = s[0] ** 2 * column(m, 0, n), s[1] ** 2 * column(m, 1, n), s[2] ** 2 * column(m, 2, n)
    u, v, w = column(m, 0, v), column(m, 1, v), column(m, 2, v)
    size = sqrt(x * column(m, 0, n) + y * column(m, 1, n) + z * column(m, 2, n))
    along = (x * u + y * v + z * w) / size**2
    x, y, z = (
        (s[0] ** 2 * u - along * x) / size,
        (s[1] ** 2 * v - along * y) / size,
        (s[2] ** 2 * w - along * z) / size,
    )
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
    )


@kernel
def _height(q, p, n):
    """Height of a witness q above the contact point p along n [m]."""
    return n[0] * (q[0] - p[0]) + n[1] * (q[1] - p[1]) + n[2] * (q[2] - p[2])


@kernel
def omega_of(body):
    """Angular velocity of a body; 0 if it does not move within a substep."""
    if not is_moving(body):
        return 0.0, 0.0, 0.0
    return vector_of(body["omega"])


@kernel
def _tangent(n):
    """A unit vector perpendicular to n."""
    if abs(n[0]) < 0.6:
        size = sqrt(n[1] * n[1] + n[2] * n[2])
        return 0.0, -n[2] / size, n[1] / size
    size = sqrt(n[0] * n[0] + n[1] * n[1])
    return -n[1] / size, n[0] / size, 0.0

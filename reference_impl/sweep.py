"""Time of impact of two moving, turning convex pieces by conservative advancement: never late.

Over a step the fraction s runs from 0 to 1. A body's centre of mass goes along
c(s) = old_center + s travel + s^2 travel_bend, and it turns about it by the world rotation vector
r(s) = s turn + s^2 turn_bend, as `integrate.pose_at` poses it.

Why an impact is never late. The signed distance of two convex pieces is the largest gap along any
direction, so at a later s' it is at least the gap along the normal n found at s:

    distance(s') >= distance(s) - integral from s to s' of (n . (c_a' - c_b') + reach_a + reach_b),

where reach bounds n . (omega x p) over the points p of a piece, seen from the centre of mass. About a fixed
axis it is |n x omega| times the largest distance from that axis. Else omega = J r', where J, the mean of the
rotations exp(t r) for t in [0, 1], lengthens nothing: |r'| times the largest distance from the centre. A
round rim does not count, for turning moves only the core. An advance ends where the right-hand side comes
down to the target (Mirtich 1996; Zhang, Lee & Kim 2006).

A fast spin makes these advances short. A leap goes farther: along the fixed n every point's height lies
above its chord less curl t^2 / 8, where curl bounds its second derivative, so the gap along n stays above the
lesser of its two ends less that. The end is measured, not bounded: near the impact leaps converge like
Newton's method.
"""

from math import sqrt

import numpy as np

from reference_impl.conventions import APART, BOX, CAPSULE, ELLIPSOID, FIXED, FLIGHT_EULER, HULL
from reference_impl.convex_depth import convex_depth
from reference_impl.kernel import kernel
from reference_impl.rotation import copy_quaternion, copy_vector, matrix_of, rotate, rotation_between, turn
from reference_impl.shapes import place_piece
from reference_impl.simplex import add_support, enter_frame

SWEEP_CAP = 500
"""Advances of one sweep; 3 are usual for a bullet, 6 to 50 for a spin of several radians."""

LEAP_CUT = 0.5
"""Factor between the leaps tried [1]; a trial takes one support of each piece, not a whole distance."""

MOTION = np.dtype(
    [
        ("old_center", "f8", (3,)),  # of mass, at fraction 0, world [m]
        ("old_orientation", "f8", (4,)),
        ("travel", "f8", (3,)),  # of the centre of mass [m]
        ("travel_bend", "f8", (3,)),
        ("turn", "f8", (3,)),  # world rotation vector [rad]
        ("turn_bend", "f8", (3,)),
    ]
)
"""How a body moves over a step; a row for each body, zeros for a fixed one."""


@kernel
def sweep(bodies, pieces, vertices, motions, pair, state, start, until, target, slack):
    """Fraction of the step at which the pair's distance first falls to the target gap.

    Args:
        motions: one MOTION per body.
        pair: PAIR; names the pieces and bodies, takes the distance, normal and witnesses last measured.
        start, until: fractions to search between [1].
        target: gap to find [m]; negative: a depth.
        slack: accepted excess over the target [m], positive.
    Returns:
        (fraction, iterations, converged): `until` where the distance stays above the target. Else the
        distance there is in [target, target + slack], or below it at `start`. Unconverged: no impact up to
        this fraction, more is not known. Both bodies are left posed somewhere on their way.
    """
    motion_a, motion_b = motions[pair["body_a"]], motions[pair["body_b"]]
    axial_a, lever_a = _lever(bodies[pair["body_a"]], pieces[pair["piece_a"]], vertices, motion_a)
    axial_b, lever_b = _lever(bodies[pair["body_b"]], pieces[pair["piece_b"]], vertices, motion_b)
    n, s, iterations = pair["normal"], start, 0
    while iterations < SWEEP_CAP:
        iterations += 1
        gap = distance_at(bodies, pieces, vertices, motions, pair, state, s) - target
        # the witnesses bound the distance from above: it equals the gap where it converged
        if pair["distance"] - target <= slack:
            return s, iterations, True
        if gap <= 0:
            break
        # the approach along n: that of the centres is exact, the turns are at their fastest
        speed_a, bend_a = _along(n, motion_a, s)
        speed_b, bend_b = _along(n, motion_b, s)
        turns = lever_a * _spin(n, motion_a, axial_a, s, until)
        turns += lever_b * _spin(n, motion_b, axial_b, s, until)
        bend = bend_a - bend_b
        advance = _time_to_close(gap, speed_a - speed_b + turns, bend)
        if turns > 0 and s + advance < until:
            curl = 2 * abs(bend) + _curl(motion_a, lever_a, s, until) + _curl(motion_b, lever_b, s, until)
            advance = _leap(
                bodies, pieces, vertices, motions, pair, state, s, until, gap, target, curl, advance
            )
        s += advance
        if s >= until:
            return until, iterations, True
    return s, iterations, False


@kernel
def distance_at(bodies, pieces, vertices, motions, pair, state, s):
    """Signed distance [m] of a pair at fraction s; where it did not converge, a lower bound, and
    `pair["distance"]` an upper one."""
    _place_pair(bodies, pieces, vertices, motions, pair, s)
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    _, converged = convex_depth(one, two, vertices, state, pair)
    if not converged:
        _sharpen(one, two, vertices, state, pair)
        return min(pair["distance"], _gap_along(pieces, vertices, pair, state))
    return pair["distance"]


@kernel
def _sharpen(piece_a, piece_b, vertices, state, pair):
    """Measure the normal anew with B moved off along it.

    Next to a round surface rounding tilts the normal of a tiny gap. A shift t along it leaves t / (R + t) of
    the tilt, R being the radius of curvature: a step of the proximal point method.
    """
    size_a = size_b = 0.0
    for i in range(3):
        size_a = max(size_a, piece_a["high"][i] - piece_a["low"][i])
        size_b = max(size_b, piece_b["high"][i] - piece_b["low"][i])
    shift = APART * min(size_a, size_b)
    n, position, distance = pair["normal"], piece_b["world_position"], pair["distance"]
    x, y, z = shift * n[0], shift * n[1], shift * n[2]
    px, py, pz = position[0], position[1], position[2]
    position[0], position[1], position[2] = px + x, py + y, pz + z
    convex_depth(piece_a, piece_b, vertices, state, pair)
    position[0], position[1], position[2] = px, py, pz
    point = pair["point_b"]
    point[0], point[1], point[2] = point[0] - x, point[1] - y, point[2] - z
    pair["distance"] = distance


@kernel
def _place_pair(bodies, pieces, vertices, motions, pair, s):
    a, b = pair["body_a"], pair["body_b"]
    pose_along(bodies[a], motions[a], s)
    pose_along(bodies[b], motions[b], s)
    place_piece(pieces[pair["piece_a"]], bodies[a], vertices, 0.0)
    place_piece(pieces[pair["piece_b"]], bodies[b], vertices, 0.0)


@kernel
def _gap_along(pieces, vertices, pair, state):
    """Gap [m] of the placed pieces along the pair's normal: no more than their distance."""
    one, two, n = pieces[pair["piece_a"]], pieces[pair["piece_b"]], pair["normal"]
    enter_frame(one, two, state)
    m = two["world_rotation"]
    x = m[0, 0] * n[0] + m[1, 0] * n[1] + m[2, 0] * n[2]
    y = m[0, 1] * n[0] + m[1, 1] * n[1] + m[2, 1] * n[2]
    z = m[0, 2] * n[0] + m[1, 2] * n[1] + m[2, 2] * n[2]
    return -add_support(one, two, vertices, x, y, z, 0, state) - one["radius"] - two["radius"]


@kernel
def _leap(bodies, pieces, vertices, motions, pair, state, s, until, gap, target, curl, advance):
    """An advance that is proved safe at its end; `advance` where that goes farther.

    Args:
        gap: distance at s less the target [m], positive.
        curl: bound on the second derivative of the points' heights along the normal [m].
    """
    n = pair["normal"]
    a, b = pair["body_a"], pair["body_b"]
    # Newton's step of the witnesses, held back by twice the worst bend: enough is left for the proof
    closing = _point_speed(n, motions[a], bodies[a], pair["point_a"], s)
    closing -= _point_speed(n, motions[b], bodies[b], pair["point_b"], s)
    leap = min(_time_to_close(gap, closing, curl), until - s)
    # where another point comes nearer, a shorter leap
    while leap > advance:
        dip = curl * leap * leap / 8
        if dip <= gap:
            _place_pair(bodies, pieces, vertices, motions, pair, s + leap)
            if _gap_along(pieces, vertices, pair, state) - target >= dip:
                return leap
        leap *= LEAP_CUT
    return advance


@kernel
def _point_speed(n, motion, body, point, s):
    """Speed along n [m] of a point of a body posed at fraction s (about, if the turn's axis moves)."""
    v, p = motion["turn"], motion["turn_bend"]
    x, y, z = v[0] + 2 * s * p[0], v[1] + 2 * s * p[1], v[2] + 2 * s * p[2]
    c = body["center"]
    rx, ry, rz = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    speed, _ = _along(n, motion, s)
    return speed + n[0] * (y * rz - z * ry) + n[1] * (z * rx - x * rz) + n[2] * (x * ry - y * rx)


@kernel
def _curl(motion, lever, s, until):
    """Bound on a point's acceleration about the centre of mass between two fractions [m].

    |omega x (omega x p)| <= |r'|^2 lever, and |omega'| <= |r''| + |r'|^2 / 2: J changes by at most |r'| / 2.
    """
    if lever == 0:
        return 0.0
    p = motion["turn_bend"]
    spin = _spin(p, motion, False, s, until)
    return lever * (1.5 * spin * spin + 2 * sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]))


@kernel
def pose_along(body, motion, s):
    """Pose a body at fraction s of its motion; a fixed body stays as it is."""
    if body["kind"] == FIXED:
        return
    v, p = motion["turn"], motion["turn_bend"]
    x, y, z = s * (v[0] + s * p[0]), s * (v[1] + s * p[1]), s * (v[2] + s * p[2])
    turn(motion["old_orientation"], x, y, z, body["orientation"])
    matrix_of(body["orientation"], body["rotation"])
    rotate(body["rotation"], body["center_of_mass"], body["position"])
    for i in range(3):
        way = s * (motion["travel"][i] + s * motion["travel_bend"][i])
        body["center"][i] = motion["old_center"][i] + way
        body["position"][i] = body["center"][i] - body["position"][i]


@kernel
def _along(n, motion, s):
    """Speed of the centre of mass along n at fraction s, and the square term of its way from there [m]."""
    speed = bend = 0.0
    for i in range(3):
        speed += n[i] * (motion["travel"][i] + 2 * s * motion["travel_bend"][i])
        bend += n[i] * motion["travel_bend"][i]
    return speed, bend


@kernel
def _spin(n, motion, axial, s, until):
    """Largest angle per step at which a turn between two fractions moves points along n [rad].

    A norm of what is linear in the fraction is largest at an end.
    """
    v, p = motion["turn"], motion["turn_bend"]
    most = 0.0
    for end in range(2):
        f = until if end else s
        x, y, z = v[0] + 2 * f * p[0], v[1] + 2 * f * p[1], v[2] + 2 * f * p[2]
        if axial:
            x, y, z = n[1] * z - n[2] * y, n[2] * x - n[0] * z, n[0] * y - n[1] * x
        most = max(most, x * x + y * y + z * z)
    return sqrt(most)


@kernel
def _time_to_close(gap, speed, bend):
    """Least positive t with speed t + bend t^2 = gap > 0; infinite where there is none."""
    square = speed * speed + 4 * bend * gap
    if square < 0:
        return np.inf
    # the root's other form: no cancellation, and a negative sum means that both roots are past
    total = speed + sqrt(square)
    return 2 * gap / total if total > 0 else np.inf


@kernel
def _lever(body, piece, vertices, motion):
    """Whether a turn keeps its axis, and the largest distance [m] of the piece's core from that axis, else
    from the centre of mass; 0 without a turn."""
    v, p = motion["turn"], motion["turn_bend"]
    x, y, z = v[0] + p[0], v[1] + p[1], v[2] + p[2]
    size = sqrt(x * x + y * y + z * z)
    twist = abs(v[1] * p[2] - v[2] * p[1]) + abs(v[2] * p[0] - v[0] * p[2]) + abs(v[0] * p[1] - v[1] * p[0])
    axial = twist == 0.0 and size > 0
    if twist == 0.0 and size == 0.0 and v[0] == 0.0 and v[1] == 0.0 and v[2] == 0.0:
        return False, 0.0
    if not axial:
        return False, _farthest(body, piece, vertices, 0.0, 0.0, 0.0)
    # the axis in body axes, where the turn leaves it
    pose_along(body, motion, 0.0)
    m = body["rotation"]
    x, y, z = x / size, y / size, z / size
    u = m[0, 0] * x + m[1, 0] * y + m[2, 0] * z
    v = m[0, 1] * x + m[1, 1] * y + m[2, 1] * z
    w = m[0, 2] * x + m[1, 2] * y + m[2, 2] * z
    return True, _farthest(body, piece, vertices, u, v, w)


@kernel
def _farthest(body, piece, vertices, u, v, w):
    """Largest distance [m] of a piece's core across the unit axis (u, v, w) through its body's centre of
    mass, body axes; from the centre itself where the axis is zero. An ellipsoid counts as a ball."""
    kind, size, rotation = piece["kind"], piece["size"], piece["rotation"]
    cx = piece["position"][0] - body["center_of_mass"][0]
    cy = piece["position"][1] - body["center_of_mass"][1]
    cz = piece["position"][2] - body["center_of_mass"][2]
    if kind != HULL and kind != BOX and kind != CAPSULE:
        along = u * cx + v * cy + w * cz
        off = sqrt((cx - along * u) ** 2 + (cy - along * v) ** 2 + (cz - along * w) ** 2)
        return off + max(size[0], size[1], size[2]) if kind == ELLIPSOID else off
    most = 0.0
    for k in range(piece["vertex_count"] if kind == HULL else 8):
        if kind != HULL:
            px = size[0] if k & 1 else -size[0]
            py = size[1] if k & 2 else -size[1]
            pz = size[2] if k & 4 else -size[2]
        else:
            corner = vertices[piece["first_vertex"] + k]["position"]
            px, py, pz = corner[0], corner[1], corner[2]
        x = cx + rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * pz
        y = cy + rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * pz
        z = cz + rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * pz
        along = u * x + v * y + w * z
        most = max(most, (x - along * u) ** 2 + (y - along * v) ** 2 + (z - along * w) ** 2)
    return sqrt(most)


@kernel
def flight_motion(body, h, flight, out_motion):
    """Motion of a simulated body over a substep of length h, the one that `pose_at` poses."""
    copy_vector(body["old_center"], out_motion["old_center"])
    copy_quaternion(body["old_orientation"], out_motion["old_orientation"])
    early = 0.0 if flight == FLIGHT_EULER else h
    late, bend = h - early, early / 2
    v0, v1, w0, w1 = body["old_velocity"], body["velocity"], body["old_omega"], body["omega"]
    for i in range(3):
        out_motion["travel"][i] = early * v0[i] + late * v1[i]
        out_motion["travel_bend"][i] = bend * (v1[i] - v0[i])
        out_motion["turn"][i] = early * w0[i] + late * w1[i]
        out_motion["turn_bend"][i] = bend * (w1[i] - w0[i])


@kernel
def shown_motion(body, out_motion):
    """Motion of a driven body to its present pose from that in `old_*`: straight, and the short way round."""
    copy_vector(body["old_center"], out_motion["old_center"])
    copy_quaternion(body["old_orientation"], out_motion["old_orientation"])
    rotation_between(body["old_orientation"], body["orientation"], out_motion["turn"])
    for i in range(3):
        out_motion["travel"][i] = body["center"][i] - body["old_center"][i]
        out_motion["travel_bend"][i] = out_motion["turn_bend"][i] = 0.0


@kernel
def swept_box(piece, body, vertices, motion, margin):
    """Bounding box of a piece over its whole motion, widened by `margin` [m]; leaves it at the start."""
    pose_along(body, motion, 0.0)
    place_piece(piece, body, vertices, margin)
    _, lever = _lever(body, piece, vertices, motion)
    v, p = motion["turn"], motion["turn_bend"]
    angle = sqrt(v[0] ** 2 + v[1] ** 2 + v[2] ** 2) + sqrt(p[0] ** 2 + p[1] ** 2 + p[2] ** 2)
    reach = min(angle, 2.0) * lever
    for i in range(3):
        way, bend = motion["travel"][i], motion["travel_bend"][i]
        least, most = min(0.0, way + bend), max(0.0, way + bend)
        # where the way turns back within the step
        if 0 < -way * bend < 2 * bend * bend:
            least, most = min(least, -way * way / (4 * bend)), max(most, -way * way / (4 * bend))
        piece["low"][i] += least - reach
        piece["high"][i] += most + reach

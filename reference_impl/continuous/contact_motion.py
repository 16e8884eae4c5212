"""Motion of contacts within a substep.

Over a substep bodies rotate, and contact points and normals move with them. Impulses at the points of its
start do work on a body that pivots, and let a touching pair sink or part by h^2 / 2 times J' v. Rows
therefore act at the geometry that the velocities of the start predict for the middle of the substep (midpoint
rule), and add `bias`, the change of the relative velocity from there to the end. The pair then stays in
contact to third order in h, and both bodies receive the impulse at one place, so their total angular momentum
is kept.

`contact_kinematics.py` computes how contact point and normal move with the surfaces that touch;
`contact/end_correction.py` corrects both where these curve.
"""

from math import sqrt

from touchstone.reference_impl.continuous.contact_kinematics import (
    contact_rates,
    core_radius,
    fastest_turn,
    is_central,
    is_moving,
    omega_of,
    velocity_at,
)
from touchstone.reference_impl.core.conventions import (
    ELLIPSOID,
    GAP_LEFT,
    NEVER,
    NO_FLOOR,
    OVERLAP_TOLERANCE,
    SIMULATED,
    SPHERE,
)
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector, cross, dot, plus, times, vector_of

BIAS_DEPTH, BIAS_SHARE = OVERLAP_TOLERANCE, 0.8
"""Motion along a normal by which the rotation of bodies may part a resting pair within a substep [m], and
share of it that a shortened substep allows [1]."""

END_RATE, END_ROUNDING = 1.3e-3, 1e-15
"""Error at the end of a substep, over its length and the third power of that of the frame, that is not
corrected [m/s4]: such is that of the corrected law. And an error which is rounding [m]."""
CURVED_PARTS = 64
"""Most substeps of a frame for the accuracy of curved contacts."""
STUCK_SHARE = 0.1
"""Slip below which a contact on a prescribed body sticks, over the velocity by which that turns [1]."""
TURN_TERMS = 10
"""Terms of the series of a rotation by at most LARGEST_TURN in half a substep: the rest is rounding [1]."""
LARGEST_TURN = 0.5
"""Turn of a normal within half a substep beyond which its geometry is not predicted [rad]."""


@inlined_kernel
def bias_share(bodies, pieces, pairs, count, h, state):
    """Share of h for which the bias of all pressing pairs is exact enough, given the velocities after a
    solve; NEVER if that is longer than h.

    If J' v h changes linearly by d over the substep, a pair sinks or parts by d h / 6; `bias` is half of it.
    Curved rows are corrected (`end_correction`), unless they turn farther than `contact_turn`. Notes the
    `late_bias` of those that hardly turn at the velocities before.
    """
    error, most = 0.0, 0.0
    for k in range(count):
        pair = pairs[k]
        n, p, early, late = pair["normal"], pair["resting_impulse"], pair["predicted_bias"], state["velocity"]
        if p[0] == 0 and p[1] == 0 and p[2] == 0:
            continue
        a, b, turned = state["velocity_a"], state["velocity_b"], state["impulse"]
        angle = _predict(bodies, pieces, pair, h / 2, a, b, turned, late)
        if pair["curved"] == 1:
            most = max(most, angle)
            continue
        if pair["curved"] == -1:
            pair["late_bias"] = max(pair["late_bias"], change_of_velocity(pair, late))
        d = n[0] * (late[0] - early[0]) + n[1] * (late[1] - early[1]) + n[2] * (late[2] - early[2])
        error = max(error, abs(d) * h / 3)
    share = (BIAS_SHARE * BIAS_DEPTH / error) ** (1 / 3) if error > BIAS_DEPTH else NEVER
    limit = state["contact_turn"]
    return min(share, curved_share(BIAS_SHARE * limit / most, h, state)) if most > limit else share


@kernel
def correct_faces(bodies, pieces, pairs, count, h, state):
    """Move the rows of `pairs[:count]` that are not curved, in islands that obey the law of positions, to the
    middle of the way over a substep of length h [s], with the `bias` of the velocities after it."""
    for on_paths in range(2):
        for k in range(count):
            pair = pairs[k]
            led = bodies[pair["body_a"]]["led"] == 1 or bodies[pair["body_b"]]["led"] == 1
            if pair["curved"] != 1 and pair["crowded"] == 0 and led and pair["floor"] != NO_FLOOR:
                a, b, n, bias = state["velocity_a"], state["velocity_b"], state["impulse"], state["velocity"]
                _predict(bodies, pieces, pair, h / 2, a, b, n, bias)
                if on_paths == 0:
                    for i in range(3):
                        pair["bias"][i] += bias[i] - pair["predicted_bias"][i]
                    copy_vector(bias, pair["predicted_bias"])
                    continue
                size = 0.0
                for i in range(3):
                    pair["lever_a"][i] = (pair["lever_a"][i] + a[i]) / 2
                    pair["lever_b"][i] = (pair["lever_b"][i] + b[i]) / 2
                    n[i] = (pair["normal"][i] + n[i]) / 2
                    size += n[i] * n[i]
                for i in range(3):
                    pair["normal"][i] = n[i] / sqrt(size)
        exchange_paths(bodies)


@kernel
def exchange_paths(bodies):
    """Exchange the velocities of bodies with those whose mean with the ones before covers their way."""
    for b in range(len(bodies)):
        for i in range(3):
            v, w = bodies[b]["path_velocity"], bodies[b]["path_omega"]
            bodies[b]["velocity"][i], v[i] = v[i], bodies[b]["velocity"][i]
            bodies[b]["omega"][i], w[i] = w[i], bodies[b]["omega"][i]


@inlined_kernel
def curved_share(share, h, state):
    """A share of a substep of length h [s] for the accuracy of curved contacts, not below 1 / CURVED_PARTS
    of a frame; NEVER if that is longer than h."""
    share = max(share, state["dt"] / (CURVED_PARTS * h))
    return share if share < 1 else NEVER


@inlined_kernel
def move_to_middle(bodies, pieces, pair, h):
    """Move a row's levers and normal to the middle of a substep of length h [s], and compute its `bias`;
    returns the turn of the normal [rad]."""
    a, b, bias = pair["lever_a"], pair["lever_b"], pair["predicted_bias"]
    turn = _predict(bodies, pieces, pair, h / 2, a, b, pair["normal"], bias)
    copy_vector(bias, pair["bias"])
    return turn


@kernel
def end_error(h, state):
    """Error at the end of a substep of length h [s] that is not corrected [m]; under a coupling that of the
    gap that its law leaves."""
    return GAP_LEFT / 10 if state["coupled_loop"] == 1 else max(END_RATE * state["dt"] ** 3 * h, END_ROUNDING)


@kernel
def is_curved(pair, h, state):
    """Whether a row's velocity changes by rotation within a substep of length h [s], at the velocities before
    it or those that an attempt led to."""
    return h * max(change_of_velocity(pair, pair["bias"]), pair["late_bias"]) > end_error(h, state)


@kernel
def starts_to_curve(pairs, count, h, state):
    """Whether rows that hardly turn at the velocities before a substep of length h [s] do at those after."""
    for k in range(count):
        if pairs[k]["curved"] == -1 and h * pairs[k]["late_bias"] > end_error(h, state):
            return True
    return False


@kernel
def change_of_velocity(pair, v):
    """Size of a row's `bias` v: along its normal or, with friction, in any direction [m/s]."""
    return sqrt(dot(v, v)) if pair["friction"] > 0 else abs(dot(pair["normal"], v))


@kernel
def move_surfaces(bodies, pieces, pair):
    """Move the surface motion of a row to its levers; add its change along the contact plane to `bias`."""
    a, b, n, bias = pair["surface_a"], pair["surface_b"], pair["normal"], pair["bias"]
    x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    set_surface_motion(bodies, pieces, pair)
    x, y, z = b[0] - a[0] - x, b[1] - a[1] - y, b[2] - a[2] - z
    along = n[0] * x + n[1] * y + n[2] * z
    bias[0], bias[1], bias[2] = (
        bias[0] + x - along * n[0],
        bias[1] + y - along * n[1],
        bias[2] + z - along * n[2],
    )


@kernel
def set_surface_motion(bodies, pieces, pair):
    """Compute the velocities of the material of both surfaces relative to their bodies, at a pair's levers.

    Only the part along the contact plane acts: a belt that runs around a body does not push along its normal.
    """
    _surface_motion(bodies, pieces[pair["piece_a"]], pair["lever_a"], pair["normal"], pair["surface_a"])
    _surface_motion(bodies, pieces[pair["piece_b"]], pair["lever_b"], pair["normal"], pair["surface_b"])


@kernel
def _surface_motion(bodies, piece, point, n, out_velocity):
    body = bodies[piece["body"]]
    v, w, m, c = piece["surface_velocity"], piece["surface_omega"], body["rotation"], body["center"]
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    # the arm in body axes
    x, y, z = (
        m[0, 0] * x + m[1, 0] * y + m[2, 0] * z,
        m[0, 1] * x + m[1, 1] * y + m[2, 1] * z,
        m[0, 2] * x + m[1, 2] * y + m[2, 2] * z,
    )
    x, y, z = v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x
    along = 0.0
    for i in range(3):
        out_velocity[i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z
        along += n[i] * out_velocity[i]
    for i in range(3):
        out_velocity[i] -= along * n[i]


@kernel
def restore_normals(pairs, count):
    """Move normals back from the middle of a substep to its start."""
    for k in range(count):
        copy_vector(pairs[k]["start_normal"], pairs[k]["normal"])


@kernel
def _predict(bodies, pieces, pair, half, out_lever_a, out_lever_b, out_normal, out_bias):
    """Predict a row's levers and normal after `half` [s] of the present velocities, and the change of its
    relative velocity until then; returns the turn of the normal, `fastest_turn` [rad].

    Corners on corners, and what turns farther than LARGEST_TURN, keep the geometry of the start.
    """
    a, b, p, n = bodies[pair["body_a"]], bodies[pair["body_b"]], pair["point"], pair["start_normal"]
    copy_vector(p, out_lever_a)
    copy_vector(p, out_lever_b)
    copy_vector(n, out_normal)
    out_bias[:] = 0.0
    if _stays(a, b, pieces[pair["piece_a"]], pieces[pair["piece_b"]], pair):
        return 0.0
    found, rate, way = contact_rates(bodies, pieces, pair)
    if not found:
        return 0.0
    turned = half * fastest_turn(bodies, pieces, pair, rate)
    if half * sqrt(rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]) > LARGEST_TURN:
        return turned
    u, v, w = velocity_at(b, p)
    x, y, z = velocity_at(a, p)
    out_bias[0], out_bias[1], out_bias[2] = x - u, y - v, z - w
    x, y, z = n[0] + half * rate[0], n[1] + half * rate[1], n[2] + half * rate[2]
    size = sqrt(x * x + y * y + z * z)
    x, y, z = x / size, y / size, z / size
    out_normal[0], out_normal[1], out_normal[2] = x, y, z
    # n - n_mid
    x, y, z = n[0] - x, n[1] - y, n[2] - z
    change = out_bias[0] * x + out_bias[1] * y + out_bias[2] * z
    if _sticks_to_path(a, b, pieces, pair, dot(out_bias, out_bias)):
        support = a if a["prescribed"] == 1 else b
        out_bias[:] = 0.0
        rise = times(0.5, plus(vector_of(support["path_omega"]), -1.0, vector_of(support["omega"])))
        _turn_lever(a, p, rise, 2 * half, -1.0, out_lever_a, out_bias)
        _turn_lever(b, p, rise, 2 * half, 1.0, out_lever_b, out_bias)
        return turned
    _set_lever(a, p, half, way, out_lever_a)
    _set_lever(b, p, half, way, out_lever_b)
    x, y, z = velocity_at(a, out_lever_a)
    u, v, w = velocity_at(b, out_lever_b)
    # the normal velocity at the start is that along the start's normal
    out_bias[0] += u - x + change * out_normal[0]
    out_bias[1] += v - y + change * out_normal[1]
    out_bias[2] += w - z + change * out_normal[2]
    return turned


@kernel
def _sticks_to_path(a, b, pieces, pair, slip2):
    """Whether a contact with a body on a prescribed path, whose slip has the square `slip2` [m2/s2], stays
    where it is on both bodies: its levers then turn with them. On curved surfaces it rolls."""
    if a["prescribed"] + b["prescribed"] != 1 or pair["friction"] == 0:
        return False
    support = a if a["prescribed"] == 1 else b
    n = vector_of(pair["start_normal"])
    for side in range(2):
        piece = pieces[pair["piece_b"] if side else pair["piece_a"]]
        rolls = piece["kind"] == ELLIPSOID or core_radius(piece, pair["point"], n) > 0
        if rolls and (pair["flat_b"] if side else pair["flat_a"]) != 2:
            return False
    arm = plus(vector_of(pair["point"]), -1.0, vector_of(support["center"]))
    way = cross(omega_of(support), arm)
    return slip2 < STUCK_SHARE * STUCK_SHARE * dot(way, way)


@kernel
def _turn_lever(body, p, rise, h, sign, out_lever, out_bias):
    """Move a lever that turns with its body to its mean over a substep of length h [s]: times the mean
    angular velocity, larger by `rise` than that of the start, it gives the way of its point. Adds `sign`
    times the change of velocity from there to the end."""
    w, c = omega_of(body), vector_of(body["center"])
    w, last = plus(w, 1.0, rise), plus(w, 2.0, rise)
    term = mean = end = plus(vector_of(p), -1.0, c)
    # the series of the rotation by w h, and of its mean
    for n in range(1, TURN_TERMS):
        term = times(h / n, cross(w, term))
        mean, end = plus(mean, 1 / (n + 1), term), plus(end, 1.0, term)
    late = cross(last, plus(end, -1.0, mean))
    for i in range(3):
        out_lever[i] = c[i] + mean[i]
        out_bias[i] += sign * late[i]


@kernel
def _stays(a, b, one, two, pair):
    """Whether neither the normal nor the place of a contact on its bodies changes the relative velocity: a
    ball about its centre of mass on a face that does not move."""
    if pair["flat_a"] == 2 and two["kind"] == SPHERE:
        return not is_moving(a) and is_central(b, two) and has_still_surface(one)
    if pair["flat_b"] == 2 and one["kind"] == SPHERE:
        return not is_moving(b) and is_central(a, one) and has_still_surface(two)
    return False


@kernel
def is_coupled(body, drivers):
    """Whether a body moves within a substep by the coupling of its driver."""
    return body["kind"] != SIMULATED and is_moving(body) and drivers[body["driver"]]["prescribed"] == 0


@kernel
def has_still_surface(piece):
    """Whether the velocity of a piece's surface does not vary along it."""
    w = piece["surface_omega"]
    return w[0] == 0 and w[1] == 0 and w[2] == 0


@kernel
def _set_lever(body, p, half, way, out_lever):
    """Set the point on which impulses act: p after `half` [s] at the velocity `way`, less the way of the
    body's centre of mass."""
    for i in range(3):
        out_lever[i] = p[i] + half * (way[i] - (body["velocity"][i] if is_moving(body) else 0.0))

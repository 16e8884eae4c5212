"""Correction of curved contacts by the geometry at the end of a substep.

A resting contact is solved with the geometry that the velocities of the start predict for the middle of
the substep (`contact_motion`). Where surfaces curve, a speed of second order and a gap of third order are
left at its end. Here, bodies are posed at the end that the solution leads to, and distance and normal are
measured there. The contact is solved again along the mean of the normal over the substep, at the mean of the
contact point, for the measured speed and gap: a corrector whose fixed point touches, and does not approach,
at the end.

Force, normal and lever change together. The integrals of their products are those of their means and, to
third order, a twelfth of the products of their changes (`add_changes`, `_mean_slip`).
"""

from math import sqrt

from touchstone.reference_impl.contact.contact_events import SLIDE_MIN, is_led
from touchstone.reference_impl.continuous.contact_kinematics import (
    LEAST_CROSSING,
    LEAST_RADIUS,
    core_radius,
    is_moving,
    is_round,
)
from touchstone.reference_impl.continuous.contact_motion import end_error
from touchstone.reference_impl.continuous.forced_rotation import mean_omega_curve
from touchstone.reference_impl.continuous.free_rotation import is_isotropic
from touchstone.reference_impl.continuous.swept_motion import pose_along
from touchstone.reference_impl.core.conventions import GAP_LEFT, NEVER, NO_FLOOR, SIMULATED, SINKING_DEPTH
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    column,
    cross,
    dot,
    invert_symmetric,
    plus,
    rotate,
    row,
    times,
    vector_of,
)
from touchstone.reference_impl.geometry.depth_warm_start import pair_depth
from touchstone.reference_impl.geometry.shapes import has_rim, place_piece
from touchstone.reference_impl.solver.islands import has_moment
from touchstone.reference_impl.solver.mobility import final_velocity, point_velocity

RETURN_SHARE = 1e-3
"""Share of a frame over which an overlap is taken back [1]: 1e-6 m at 0.06 m/s."""


@kernel
def correct_ends(world, count, h, last):
    """Correct the curved rows of `pairs[:count]` by their geometry at the end of a substep of length h [s],
    to which the motions of their bodies lead; poses these at its start.

    Args:
        last: measure the errors alone.
    Returns:
        Largest error of a gap, or of its change by the speeds at the end [m].
    """
    bodies, pairs = world.bodies, world.pairs
    if count == len(pairs):
        return 0.0
    error, found = 0.0, pairs[count]
    for b in range(len(bodies)):
        if bodies[b]["led"] == 1 or bodies[b]["kind"] != SIMULATED:
            pose_along(bodies[b], 0.0)
    for k in range(count):
        pair = pairs[k]
        if pair["curved"] == 1 and pair["floor"] != NO_FLOOR:
            a, b, pair["leaves"] = bodies[pair["body_a"]], bodies[pair["body_b"]], NEVER
            if _end_geometry(world, a, b, pair, found):
                error = max(error, _correct(a, b, pair, found, h, world.state, last))
            pose_along(a, 0.0)
            pose_along(b, 0.0)
    return error


@kernel
def _end_geometry(world, a, b, pair, out_found):
    """Pose bodies at the end of the substep and find normal, points and distance of a row there; returns
    whether they are known. Features of a manifold stay what they are."""
    pieces = world.pieces
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    out_found["piece_a"], out_found["piece_b"] = pair["piece_a"], pair["piece_b"]
    if is_round(one) or is_round(two):
        if pair["manifold"] < 0:
            n = vector_of(pair["start_normal"])
            n_a, n_b = _in_body(a, n, 0.0), _in_body(b, n, 0.0)
            for side in range(2):
                body = b if side else a
                if is_moving(body):
                    pose_along(body, 1.0)
                    place_piece(two if side else one, body, world.vertices, 0.0)
            found, m = _nearest_pieces(world, a, b, pair, out_found), vector_of(out_found["normal"])
            return found and not (_crosses_cap(a, one, n_a, m) or _crosses_cap(b, two, n_b, m))
    n, flat_a, flat_b = vector_of(pair["start_normal"]), pair["flat_a"], pair["flat_b"]
    r_a, r_b = core_radius(one, pair["point_a"], n), core_radius(two, pair["point_b"], n)
    p = _in_body(a, plus(vector_of(pair["point_a"]), -r_a, n), 1.0)
    q = _in_body(b, plus(vector_of(pair["point_b"]), r_b, n), 1.0)
    n_a, n_b = _in_body(a, n, 0.0), _in_body(b, n, 0.0)
    e, f = _in_body(a, vector_of(pair["edge_a"]), 0.0), _in_body(b, vector_of(pair["edge_b"]), 0.0)
    for side in range(2):
        if is_moving(b if side else a):
            pose_along(b if side else a, 1.0)
    p, q = _in_world(a, p, 1.0), _in_world(b, q, 1.0)
    if flat_a == 2:
        n = _in_world(a, n_a, 0.0)
        gap = dot(n, q) - dot(n, p)
        p = plus(q, -gap, n)
    elif flat_b == 2:
        n = _in_world(b, n_b, 0.0)
        gap = dot(n, q) - dot(n, p)
        q = plus(p, gap, n)
    elif flat_a == 1 and flat_b == 1:
        e, f = _in_world(a, e, 0.0), _in_world(b, f, 0.0)
        m, u = cross(e, f), plus(q, -1.0, p)
        sin2, cos, over_a, over_b = dot(m, m), dot(e, f), dot(u, e), dot(u, f)
        along = over_a
        if sin2 > LEAST_CROSSING:
            along = (over_a - cos * over_b) / sin2
        else:
            # alongside each other: across A's axis, to the point of B
            m = plus(u, -over_a, e)
        size = sqrt(dot(m, m))
        if size <= LEAST_RADIUS:
            return False
        n = times((1.0 if dot(m, n) > 0 else -1.0) / size, m)
        gap = dot(n, u)
        p = plus(p, along, e)
        q = plus(p, gap, n)
    else:
        return False
    p, q = plus(p, r_a, n), plus(q, -r_b, n)
    out_found["distance"] = gap - r_a - r_b
    for i in range(3):
        out_found["normal"][i], out_found["point_a"][i], out_found["point_b"][i] = n[i], p[i], q[i]
    return True


@kernel
def _crosses_cap(body, piece, n, m):
    """Whether a contact passes over a cap to the other side of its rim: the cap lands within the substep.

    Args:
        n: normal at the start, in the axes of the body.
        m: normal at the end, where the body is.
    """
    r = piece["rotation"]
    axis = (r[0, 2], r[1, 2], r[2, 2])
    return has_rim(piece) and dot(cross(axis, n), cross(axis, _in_body(body, m, 0.0))) < 0


@kernel
def _nearest_pieces(world, a, b, pair, out_found):
    """Find distance, normal and points of two pieces; or, on a body that does not move, of its nearest piece
    to which the contact may have moved: its normal is at least as near to that of the start, otherwise it is
    an obstacle. Returns whether they are known."""
    pieces, one, two, n = world.pieces, pair["piece_a"], pair["piece_b"], pair["start_normal"]
    on_a = not is_moving(a)
    many = a if on_a else b
    if not is_moving(many) and many["piece_count"] > 1:
        pair_depth(pieces, world.vertices, world.state, out_found)
        least, along = out_found["distance"], dot(n, out_found["normal"])
        for k in range(many["first_piece"], many["first_piece"] + many["piece_count"]):
            p, q = (k, pair["piece_b"]) if on_a else (pair["piece_a"], k)
            if _may_touch(pieces[p], pieces[q]):
                out_found["piece_a"], out_found["piece_b"] = p, q
                pair_depth(pieces, world.vertices, world.state, out_found)
                if out_found["distance"] < least and dot(n, out_found["normal"]) >= along:
                    least, one, two = out_found["distance"], p, q
    out_found["piece_a"], out_found["piece_b"] = one, two
    return pair_depth(pieces, world.vertices, world.state, out_found)


@kernel
def _may_touch(piece_a, piece_b):
    """Whether the boxes of two pieces overlap."""
    for i in range(3):
        if piece_a["high"][i] < piece_b["low"][i] or piece_b["high"][i] < piece_a["low"][i]:
            return False
    return True


@kernel
def _in_body(body, v, place):
    """A world vector in the axes of a body; with `place` 1, the place of a world point on it."""
    x, m = plus(v, -place, body["center"]), body["rotation"]
    return column(m, 0, x), column(m, 1, x), column(m, 2, x)


@kernel
def _in_world(body, v, place):
    """Inverse of `_in_body`."""
    m = body["rotation"]
    return plus((row(m, 0, v), row(m, 1, v), row(m, 2, v)), place, body["center"])


@kernel
def _correct(a, b, pair, found, h, state, last):
    """Correct a row by the pair `found` at the end of the substep; returns its error [m]."""
    n, m, middle = pair["start_normal"], found["normal"], pair["normal"]
    cos = n[0] * m[0] + n[1] * m[1] + n[2] * m[2]
    if cos <= 0:
        return 0.0
    ux, uy, uz = _end_velocity(b, found)
    vx, vy, vz = _end_velocity(a, found)
    ux, uy, uz = ux - vx, uy - vy, uz - vz
    closing = m[0] * ux + m[1] * uy + m[2] * uz
    p, gap = pair["resting_impulse"], found["distance"] - gap_aimed(pair, h, state)
    error = max(abs(gap), abs(closing) * h)
    if p[0] == 0 and p[1] == 0 and p[2] == 0:
        error = max(0.0, -gap)
        stays = found["piece_a"] == pair["piece_a"] and found["piece_b"] == pair["piece_b"]
        if stays and pair["manifold"] < 0:
            pair["leaves"] = _end_of_load(a, b, pair, found["distance"] - pair["distance"], closing, h)
    elif pair["slides"] == 0 and _keeps_sliding(pair, ux, uy, uz) and not last:
        pair["slides"], error = 1, max(error, 2 * end_error(h, state))
    loaded = pair["friction"] > 0 and (p[0] != 0 or p[1] != 0 or p[2] != 0)
    if last or (error <= end_error(h, state) and not loaded):
        return error
    bias, followed = pair["bias"], pair["followed"]
    held, on_a, on_b = vector_of(middle), vector_of(pair["lever_a"]), vector_of(pair["lever_b"])
    # under a coupling both laws differ by more than the change of a force
    if state["led_loop"] == 0 and _is_free(a) and _is_free(b):
        _follow_parabolas(a, b, pair, found)
    else:
        size = sqrt(2 + 2 * cos)
        for i in range(3):
            middle[i] = (n[i] + m[i]) / size
            end = (found["point_a"][i] + found["point_b"][i]) / 2
            pair["lever_a"][i] = (pair["point"][i] + end + a["old_center"][i] - a["center"][i]) / 2
            pair["lever_b"][i] = (pair["point"][i] + end + b["old_center"][i] - b["center"][i]) / 2
    x, y, z = _velocity_on(b, b["velocity"], b["omega"], pair["lever_b"])
    vx, vy, vz = _velocity_on(a, a["velocity"], a["omega"], pair["lever_a"])
    along = closing - (middle[0] * ux + middle[1] * uy + middle[2] * uz)
    ux, uy, uz = plus((ux - x + vx, uy - y + vy, uz - z + vz), along, vector_of(middle))
    if loaded:
        x, y, z = plus((ux, uy, uz), -1.0, vector_of(bias))
        error = max(error, h * sqrt(x * x + y * y + z * z))
        if error <= end_error(h, state):
            # the impulses are those of the row as it was
            pair["followed"] = followed
            for i in range(3):
                middle[i], pair["lever_a"][i], pair["lever_b"][i] = held[i], on_a[i], on_b[i]
            return error
    bias[0], bias[1], bias[2] = ux, uy, uz
    x, y, z = _mean_slip(a, b, pair, h)
    n = pair["path_normal"] if pair["followed"] == 1 else middle
    # the part of the gap's change that the mean velocity does not give
    way = n[0] * x + n[1] * y + n[2] * z
    pair["gap_error"] = found["distance"] - pair["distance"] - h * way
    if pair["followed"] == 1:
        ux, uy, uz = mean_velocity(b, pair["path_lever_b"])
        vx, vy, vz = mean_velocity(a, pair["path_lever_a"])
        bias = pair["path_bias"]
        bias[0], bias[1], bias[2] = 2 * (x - ux + vx), 2 * (y - uy + vy), 2 * (z - uz + vz)
    return error


@kernel
def note_ends_of_load(bodies, pairs, count, h, state):
    """Set `leaves` of the rows of `pairs[:count]` that are not curved, by the law of positions over a substep
    of length h [s]: where their force ends if they bear nothing."""
    for k in range(count):
        pair = pairs[k]
        if pair["curved"] != 1:
            a, b, pair["leaves"] = bodies[pair["body_a"]], bodies[pair["body_b"]], NEVER
            p, n = pair["resting_impulse"], pair["normal"]
            if is_led(bodies, pair) and p[0] == 0 and p[1] == 0 and p[2] == 0:
                opening = times(h, mean_velocity(b, pair["lever_b"]))
                opening = plus(opening, -h, mean_velocity(a, pair["lever_a"]))
                speed = final_velocity(bodies, pair, state)
                pair["leaves"] = _end_of_load(a, b, pair, dot(n, opening), speed, h)


@kernel
def _end_of_load(a, b, pair, opening, speed, h):
    """Fraction of a substep of length h [s] at which the force of a contact falls to 0, if neither law finds
    one; NEVER if it is 0 from the start. Without a force the gap opens by `opening` [m], and at the end with
    `speed` [m/s]. Both tell its acceleration, linear in time: a force acts as long as that closes the gap."""
    n, q = pair["start_normal"], pair["spare"]
    x, y, z = _velocity_on(b, b["old_velocity"], b["old_omega"], pair["point"])
    u, v, w = _velocity_on(a, a["old_velocity"], a["old_omega"], pair["point"])
    start = n[0] * (x - u) + n[1] * (y - v) + n[2] * (z - w)
    first = 6 * opening / h - 2 * speed - 4 * start
    change = 2 * (speed - start - first)
    if q[0] != 0 or q[1] != 0 or q[2] != 0 or not first < 0 < change:
        return NEVER
    return -first / change


@kernel
def _is_free(body):
    """Whether neither a driver nor a joint moves a body."""
    return body["kind"] != SIMULATED or body["driver"] < 0


@kernel
def _follow_parabolas(a, b, pair, found):
    """Set normal and levers of a row to their means over the substep, and `path_*` to those by which a force
    moves its body: weighted by the time left. They follow parabolas through start and end along the
    prediction at the start, or straight lines without one."""
    n, m, p = pair["start_normal"], found["normal"], pair["predicted_normal"]
    predicted, size, far = False, 0.0, 0.0
    for i in range(3):
        if pair["followed"] == 0:
            p[i] = pair["normal"][i]
            pair["predicted_a"][i], pair["predicted_b"][i] = pair["lever_a"][i], pair["lever_b"][i]
        start, on_a, on_b = pair["point"][i], pair["predicted_a"][i], pair["predicted_b"][i]
        predicted = predicted or on_a != start or on_b != start or p[i] != n[i]
    pair["followed"] = 1
    for i in range(3):
        start, end = pair["point"][i], (found["point_a"][i] + found["point_b"][i]) / 2
        to_a, to_b = end + a["old_center"][i] - a["center"][i], end + b["old_center"][i] - b["center"][i]
        on_a, on_b, between = pair["predicted_a"][i], pair["predicted_b"][i], p[i]
        if not predicted:
            on_a, on_b, between = (start + to_a) / 2, (start + to_b) / 2, (n[i] + m[i]) / 2
        pair["lever_a"][i], pair["lever_b"][i] = (start + on_a + to_a) / 3, (start + on_b + to_b) / 3
        pair["path_lever_a"][i] = start / 2 + on_a / 3 + to_a / 6
        pair["path_lever_b"][i] = start / 2 + on_b / 3 + to_b / 6
        pair["normal"][i], pair["path_normal"][i] = n[i] + between + m[i], 3 * n[i] + 2 * between + m[i]
        size, far = size + pair["normal"][i] ** 2, far + pair["path_normal"][i] ** 2
    for i in range(3):
        # over the length of the mean, whose direction is `normal`
        pair["normal_way"][i] = 3 * (2 * pair["normal"][i] - pair["path_normal"][i]) / sqrt(size)
        pair["normal"][i] /= sqrt(size)
        pair["path_normal"][i] /= sqrt(far)


@kernel
def exchange_geometry(pair):
    """Exchange the normal and levers of a row that follows parabolas with those for the way of its bodies."""
    if pair["followed"] == 0:
        return
    for i in range(3):
        pair["normal"][i], pair["path_normal"][i] = pair["path_normal"][i], pair["normal"][i]
        pair["lever_a"][i], pair["path_lever_a"][i] = pair["path_lever_a"][i], pair["lever_a"][i]
        pair["lever_b"][i], pair["path_lever_b"][i] = pair["path_lever_b"][i], pair["lever_b"][i]


@kernel
def gap_aimed(pair, h, state):
    """Gap of a contact at the end of a substep of length h [m]: its own up to GAP_LEFT, or what is left of
    its overlap. With drivers in the loop it is taken back over a frame: their forces do work along it, and
    at once would shake a load. It stays where no motion paid for the lift."""
    gap = min(GAP_LEFT, max(pair["distance"], -SINKING_DEPTH))
    if gap >= 0 or state["unpaid_energy"] > 0:
        return gap
    share = 1.0 if state["led_loop"] == 1 else RETURN_SHARE
    return gap * max(0.0, 1 - h / (share * state["dt"]))


@kernel
def _keeps_sliding(pair, x, y, z):
    """Whether a row slides at the start of the substep and, at the velocity (x, y, z) of B relative to A,
    along that direction at its end."""
    n, a, b = pair["start_normal"], pair["before_a"], pair["before_b"]
    u, v, w = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    start, end, both = n[0] * u + n[1] * v + n[2] * w, n[0] * x + n[1] * y + n[2] * z, u * x + v * y + w * z
    both -= start * end
    before = u * u + v * v + w * w - start * start
    return before > SLIDE_MIN * SLIDE_MIN and both > SLIDE_MIN * sqrt(before)


@kernel
def friction_work(bodies, pair, h):
    """Work of a row's friction on its bodies over a substep of length h [J], less that of the moving surface
    of a body that is not simulated, which the guard subtracts (`energy_guard`)."""
    n, p, a, b = pair["normal"], pair["resting_impulse"], bodies[pair["body_a"]], bodies[pair["body_b"]]
    x, y, z = _mean_slip(a, b, pair, h)
    if a["kind"] != SIMULATED:
        x, y, z = plus((x, y, z), -1.0, vector_of(pair["surface_a"]))
    elif b["kind"] != SIMULATED:
        x, y, z = plus((x, y, z), 1.0, vector_of(pair["surface_b"]))
    along = (n[0] * x + n[1] * y + n[2] * z) * (n[0] * p[0] + n[1] * p[1] + n[2] * p[2])
    return p[0] * x + p[1] * y + p[2] * z - along + moment_work(bodies, pair)


@kernel
def moment_work(bodies, pair):
    """Work of a row's rolling and torsional friction on its bodies over a substep [J]."""
    work, m = 0.0, pair["moment"]
    for side in range(2):
        body, sign = (bodies[pair["body_b"]], 0.5) if side else (bodies[pair["body_a"]], -0.5)
        if has_moment(pair) and is_moving(body):
            end = body["path_omega"] if body["led"] == 1 else body["omega"]
            work += sign * (dot(m, body["old_omega"]) + dot(m, end))
    return work


@kernel
def _velocity_on(body, v, w, lever):
    """Velocity of a body in its place at the start of the substep, at a lever; 0 if it does not move."""
    if not is_moving(body):
        return 0.0, 0.0, 0.0
    return point_velocity(v, w, body["old_center"], lever)


@kernel
def mean_velocity(body, lever):
    """Mean of the velocities before and after the substep that set the path of a body."""
    if not is_moving(body):
        return 0.0, 0.0, 0.0
    x, y, z = point_velocity(body["old_velocity"], body["old_omega"], body["old_center"], lever)
    v, w = body["velocity"], body["omega"]
    if body["led"] == 1:
        v, w = body["path_velocity"], body["path_omega"]
    p, q, r = point_velocity(v, w, body["old_center"], lever)
    return (x + p) / 2, (y + q) / 2, (z + r) / 2


@kernel
def add_changes(bodies, pairs, count, on_path):
    """Add to free bodies the impulse and the angular impulse that rows exert because force, normal and lever
    change together over a substep: integrals of products of their deviations from their means.

    The force changes by six times the difference of the impulses of both laws, which weigh it by time.

    Args:
        on_path: in the law of positions, which weighs by the time left.
    """
    share = 1 / 3 if on_path else 1 / 2
    for k in range(count):
        pair = pairs[k]
        if pair["followed"] == 0:
            continue
        n, far = vector_of(pair["normal"]), vector_of(pair["path_normal"])
        p, q = vector_of(pair["resting_impulse"]), vector_of(pair["spare"])
        along, far_along, bend = dot(n, p), dot(far, q), vector_of(pair["normal_way"])
        change, scale = plus(p, -1.0, q), 1.0
        # a force that never pulls changes by twice its mean at most
        if 9 * dot(change, change) > dot(p, p):
            scale = sqrt(dot(p, p) / dot(change, change)) / 3
        push = times(scale * share * (along - far_along), bend)
        rise = times(scale, plus(plus(change, far_along, far), -far_along, n))
        rise = plus(rise, (far_along if on_path else along) / 6, bend)
        for side in range(2):
            body, sign = bodies[pair["body_b"] if side else pair["body_a"]], 1.0 if side else -1.0
            if body["kind"] != SIMULATED or body["driver"] >= 0:
                continue
            near = vector_of(pair["lever_b"] if side else pair["lever_a"])
            path = vector_of(pair["path_lever_b"] if side else pair["path_lever_a"])
            way, arm = times(6.0, plus(near, -1.0, path)), path if on_path else near
            torque = cross(plus(arm, -1.0, vector_of(body["center"])), push)
            torque, turn = plus(torque, share, cross(way, rise)), body["scratch"][0]
            rotate(body["inverse_inertia"], torque, turn)
            for i in range(3):
                body["velocity"][i] += sign * body["inverse_mass"] * push[i]
                body["omega"][i] += sign * turn[i]


@kernel
def _mean_slip(a, b, pair, h):
    """Mean over the substep of length h of the velocity of B's material relative to A's at a contact."""
    x, y, z = _mean_at_contact(b, pair["lever_b"], pair["path_lever_b"], pair["followed"], h)
    u, v, w = _mean_at_contact(a, pair["lever_a"], pair["path_lever_a"], pair["followed"], h)
    return x - u, y - v, z - w


@kernel
def _mean_at_contact(body, lever, path_lever, followed, h):
    """Part of a body in `_mean_slip`: lever and angular velocity change together."""
    mean = mean_velocity(body, lever)
    if followed == 0 or not is_moving(body):
        return mean
    w = body["path_omega"] if body["led"] == 1 else body["omega"]
    turn = plus(vector_of(w), -1.0, vector_of(body["old_omega"]))
    way = plus(vector_of(lever), -1.0, vector_of(path_lever))  # a sixth of the lever's change
    if body["led"] == 1:
        arm = plus(vector_of(lever), -1.0, body["old_center"])
        mean = plus(mean, 1.0, cross(mean_omega_curve(body, h), arm))
    return plus(mean, 0.5, cross(turn, way))


@kernel
def _end_velocity(body, found):
    """Velocity of a body at the end of the substep, at a contact found there; its angular momentum is that of
    the solution."""
    if not is_moving(body):
        return 0.0, 0.0, 0.0
    c, v, w = body["center"], body["velocity"], body["omega"]
    if body["kind"] == SIMULATED and body["driver"] >= 0:
        v, w = body["end_velocity"], body["end_omega"]
    x, y, z = w[0], w[1], w[2]
    if body["kind"] == SIMULATED and body["driver"] < 0 and not is_isotropic(body["inertia"]):
        own, r, m = body["scratch"], body["rotation"], body["end_omega"]
        invert_symmetric(body["inverse_inertia"], own)
        rotate(own, w, m)
        x = r[0, 0] * m[0] + r[1, 0] * m[1] + r[2, 0] * m[2]
        y = r[0, 1] * m[0] + r[1, 1] * m[1] + r[2, 1] * m[2]
        z = r[0, 2] * m[0] + r[1, 2] * m[1] + r[2, 2] * m[2]
        invert_symmetric(body["inertia"], own)
        x, y, z = (
            own[0, 0] * x + own[0, 1] * y + own[0, 2] * z,
            own[1, 0] * x + own[1, 1] * y + own[1, 2] * z,
            own[2, 0] * x + own[2, 1] * y + own[2, 2] * z,
        )
        x, y, z = (
            r[0, 0] * x + r[0, 1] * y + r[0, 2] * z,
            r[1, 0] * x + r[1, 1] * y + r[1, 2] * z,
            r[2, 0] * x + r[2, 1] * y + r[2, 2] * z,
        )
    px = (found["point_a"][0] + found["point_b"][0]) / 2 - c[0]
    py = (found["point_a"][1] + found["point_b"][1]) / 2 - c[1]
    pz = (found["point_a"][2] + found["point_b"][2]) / 2 - c[2]
    return v[0] + y * pz - z * py, v[1] + z * px - x * pz, v[2] + x * py - y * px

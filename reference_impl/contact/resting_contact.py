"""Resting contacts: impulses over a substep that keep touching pairs from approaching."""

from math import sqrt

from touchstone.reference_impl.contact.contact_events import (
    AT_ONCE,
    ONSET_SOUGHT,
    SLIP_STRAIGHT,
    first_change,
    first_onset,
    first_stop,
    is_carried,
    note_free_slip,
    slip_turn,
    slip_turn_share,
)
from touchstone.reference_impl.contact.contact_log import log_held
from touchstone.reference_impl.contact.end_correction import (
    add_changes,
    correct_ends,
    exchange_geometry,
    friction_work,
    gap_aimed,
    note_ends_of_load,
)
from touchstone.reference_impl.contact.grip import (
    find_grip,
    forget_grips,
    note_grips,
    regain_grips,
    release_grips,
)
from touchstone.reference_impl.contact.impact import rest_speed
from touchstone.reference_impl.contact.integrate import apply_forces, begin_again, set_ways
from touchstone.reference_impl.contact.outline_exit import first_exit
from touchstone.reference_impl.contact.support_points import move_supports
from touchstone.reference_impl.continuous.contact_kinematics import is_moving, is_round
from touchstone.reference_impl.continuous.contact_motion import (
    bias_share,
    correct_faces,
    curved_share,
    end_error,
    exchange_paths,
    is_coupled,
    is_curved,
    move_surfaces,
    move_to_middle,
    restore_normals,
    starts_to_curve,
)
from touchstone.reference_impl.continuous.driver_motion import (
    accept_pushes,
    exchange_pushes,
    keep_in_limits,
    note_curves,
    note_paths,
    predict_turn,
    repeat_pushes,
    weigh_for_impacts,
)
from touchstone.reference_impl.continuous.forced_rotation import curve_rotation
from touchstone.reference_impl.continuous.hinge_motion import has_limits
from touchstone.reference_impl.continuous.mechanism_dynamics import first_rest, set_drifts
from touchstone.reference_impl.continuous.mechanism_motion import follow_forces, note_forces
from touchstone.reference_impl.core.conventions import (
    APPROACH_MIN,
    EVENT_CAP,
    GAP_LEFT,
    NEVER,
    NO_FLOOR,
    SIMULATED,
    SINKING_DEPTH,
)
from touchstone.reference_impl.core.counters import CAP_HOLD_ROUNDS, COUNT_UNCONVERGED
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector, cross
from touchstone.reference_impl.geometry.shapes import place_piece
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.hinge_response import weigh_hinges
from touchstone.reference_impl.solver.islands import is_joined, island_of, join_islands, leads, mover_of
from touchstone.reference_impl.solver.mobility import approach_speed, place_surfaces
from touchstone.reference_impl.solver.warm_start import load_impulse, store_impulses

VELOCITY_LEAD = 1 / 16
"""Least lead of the law of velocities in rows with a driver [1]: enough for a mobility where its spring has
little velocity left at the end of a substep. Relative speed falls to that share in a substep."""
SEPARATION_MIN = 1e-8
"""Speed of a touching pair that is no separation [m/s]: a weight of 10 N does 1e-9 J of work per frame."""
STOP_SHARE, STOP_SHORT = 1 - 1e-9, 1 - 1e-6
"""Fraction of a substep from which the end of sliding counts as its end, and fraction of the time to an
earlier one that the substep takes [1]: exactly there, on the cone without sliding, sweeps converge slowly."""
STOP_LATER = 1.0001
"""Ratio of the time to a stop and a shortened substep from which the substep is solved again, longer [1]."""
ONSET_ROUNDS, ONSET_SHARE = 5, 0.01
"""Most attempts at a substep for the onset of sliding in it, and its share to which that is found [1]: the
error of a speed is its square."""
GRIP_SHARE = 1e-9
"""The same where static friction ends in a jump of the force [1]: the error of a speed is proportional."""
SWING = 0.1
"""Most angle by which a weakly damped driver swings with its load in a substep [rad]: the impulses that set
their velocities and those that set their paths differ by its square, and so does the driver's work."""
DRIVEN_ROUNDS = 3
"""Attempts at a substep with drivers after which the next ones halve it where a contact stops within."""
GAP_ERROR = GAP_LEFT / 100
"""Error of a mechanism's gap that the law of positions leaves [m]: one that sticks in several places, or at
its limits, may not mend it."""
LAWS_RATIO = 2.0
"""Sum of the normal impulses of the law of positions, over that of the law of velocities, from which the
latter is solved again, starting from the former [1]."""
CORRECTIONS, LARGEST_ERROR = 4, 1e-8
"""Most corrections of curved contacts in a substep, and error after them above which it is halved [m]."""
FOLLOWED = 1e-6
"""Change of the motion of mechanisms in the last correction above which the substep is halved [m]."""
FIRST_SLACK, SLACK = 1e-6, 1e-8
"""Gap that contacts on mechanisms may leave at the end of a substep where no load changes it, before its
corrections and in them [m]."""
JAM_SHARE = 1e-6
"""Share of a frame over which a jam is solved [1]: other forces do nothing in it."""
CURVED_ROWS = 64
"""Most rows beside faces of an island whose curved contacts are corrected: a heap is too chaotic for the time
that this takes."""
HALVINGS = 16
"""Most halvings of such substeps in a frame; then their contacts stay as predicted."""
SUPPORT_ROUNDS = 8
"""Most exchanges of the points on which a face rests, in an attempt at a substep: each halves the arc of a
rim between two of them."""
RESTING_CONTACT_ROUNDS = 10
"""Attempts at a substep in which sliding contacts stop or bodies rotate; 1 or 2 are usual."""


@inlined_kernel
def solve_resting_contacts(world, count, time, h):
    """Apply forces over a substep, and impulses in the friction cone that let no touching pair approach.

    Args:
        count: `pairs[:count]` touch.
        time, h: start of the substep in the frame, and its length [s].
    Returns:
        The length for which the impulses are valid [s], shorter if a sliding contact stops earlier, or if
        bodies rotate more than their contacts allow for.
    """
    bodies, drivers, pairs, state = world.bodies, world.drivers, world.pairs, world.state
    last_time, changes = state["last_time"], ONSET_ROUNDS
    for k in range(count):
        pairs[k]["late_bias"] = 0.0
    _mark_crowds(bodies, drivers, pairs, count)
    while True:
        unconverged = state["counters"][COUNT_UNCONVERGED]
        state["last_time"] = last_time
        h = whole = _solve_velocities(world, count, h)
        carried = _follows_slip(state)
        if carried or (state["statics"] == 1 and state["dense_substep"] == 0):
            h = _end_at_onset(world, count, h)
        if state["dense_substep"] == 0:
            _turn_friction(world, count, h)
        _solve_positions(world, count, h, False)
        if state["jams"] == 1:
            _end_jam(world, count, h)
            break
        if state["led_loop"] == 1 and _laws_differ(bodies, pairs, count):
            for k in range(count):
                copy_vector(pairs[k]["spare"], pairs[k]["resting_impulse"])
            _correct_velocities(world, count, h, state["led"])
            _solve_positions(world, count, h, True)
        if len(drivers) > 0:
            # each joint at most at one limit after the other
            for _ in range(2 * len(world.joints)):
                if not _find_limits(world, h):
                    break
                start_again(world, count)
                h = _solve_velocities(world, count, h)
                _solve_positions(world, count, h, False)
        if _correct_ends(world, count, h):
            share = NEVER
            if state["dense_substep"] == 0 and changes > 0:
                if state["led"] == 1 and state["coupled_loop"] == 0:
                    note_ends_of_load(bodies, pairs, count, h, state)
                    share = first_change(bodies, world.pieces, pairs, count, last_time < 0)
                    share = share if ONSET_SHARE < share < 1 - ONSET_SHARE else NEVER
                share = min(share, first_exit(world, count, h))
            if share >= 1:
                break
            changes -= 1
            h *= share
        else:
            # a wedge may have no solution in which contacts close exactly: leave them as predicted
            failed = state["counters"][COUNT_UNCONVERGED] > unconverged
            state["halvings"] = HALVINGS if failed else state["halvings"] + 1
            h = h if failed else h / 2
        start_again(world, count)
        forget_grips(pairs, count)
    # a repeated solve must not start from the one before it: where a slide stops within the substep, friction
    # may have any direction, and it keeps that one if the slip at the end is small
    if state["statics"] == 1:
        note_grips(bodies, pairs, count, state)
    if state["jams"] == 0:
        store_impulses(bodies, pairs, count, state, h)
    # what has just begun to slide does so from the start of the next substep
    state["last_time"] = -h if h == whole and changes == ONSET_ROUNDS else 0.0
    log_held(bodies, pairs, count, world.contacts, state, time)
    return h


@kernel
def _mark_crowds(bodies, drivers, pairs, count):
    """Mark the rows of islands with more than CURVED_ROWS beside faces as `crowded`."""
    for k in range(count):
        pairs[k]["crowded"] = 0
    if count <= CURVED_ROWS:
        return
    join_islands(bodies, drivers, pairs, count, True)
    for b in range(len(bodies)):
        bodies[b]["row_count"] = 0
    for k in range(count):
        if pairs[k]["island"] >= 0 and not _is_face(pairs, k):
            bodies[pairs[k]["island"]]["row_count"] += 1
    for k in range(count):
        if pairs[k]["island"] >= 0 and bodies[pairs[k]["island"]]["row_count"] > CURVED_ROWS:
            pairs[k]["crowded"] = 1


@kernel
def _is_face(pairs, k):
    """Whether a row is of a patch of three points or more."""
    row, points = pairs[k]["manifold"], 0
    while row >= 0:
        row, points = pairs[row]["next_point"], points + 1
    return points > 2


@kernel
def _correct_ends(world, count, h):
    """Solve again with the motion of mechanisms under the forces found, and the geometry of curved contacts
    at the end of the substep, until both stay what they are; returns whether they do, nearly, and every solve
    converged."""
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    if state["curved"] + state["mechanisms"] == 0:
        return True
    error = moved = 0.0
    unconverged, follows = state["counters"][COUNT_UNCONVERGED], state["halvings"] < HALVINGS
    for k in range(CORRECTIONS + 1):
        last = k == CORRECTIONS
        if follows and not last:
            before, moved = NEVER if k == 0 else max(moved, LARGEST_ERROR), 0.0
            for d in range(state["driven_count"], len(drivers)):
                moved = max(moved, follow_forces(bodies, joints, drivers[d], h))
            if moved == NEVER or not moved <= before:
                return False
        if state["curved"] == 1:
            # under a coupling both laws differ by more than the change of a force
            if state["led_loop"] == 0:
                for b in range(len(bodies)):
                    curve_rotation(bodies[b], h)
            set_ways(bodies, joints, drivers, pairs, count, h, state["dt"])
            error = correct_ends(world, count, h, last)
        followed = moved <= (LARGEST_ERROR if state["curved"] == 1 else 0.0)
        if (error <= end_error(h, world.state) and followed) or last:
            break
        if k == 0 and state["led_loop"] == 1:
            correct_faces(bodies, world.pieces, pairs, count, h, state)
        _correct_velocities(world, count, h, state["led"])
        _solve_positions(world, count, h, True)
        if state["counters"][COUNT_UNCONVERGED] > unconverged:
            return False
        if state["curved"] == 0 and moved <= LARGEST_ERROR:
            break
    if state["curved"] == 1:
        for k in range(count):
            pairs[k]["work"] = friction_work(bodies, pairs[k], h)
    return error <= LARGEST_ERROR and moved <= FOLLOWED


@kernel
def _laws_differ(bodies, pairs, count):
    """Whether the law of positions found far larger impulses than that of velocities: where a driver squeezes
    a body, Coulomb's law may have a solution without force beside the one that holds it."""
    velocities = positions = 0.0
    for k in range(count):
        pair = pairs[k]
        if bodies[pair["body_a"]]["led"] == 1 or bodies[pair["body_b"]]["led"] == 1:
            n, p, q = pair["normal"], pair["resting_impulse"], pair["spare"]
            velocities += p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
            positions += q[0] * n[0] + q[1] * n[1] + q[2] * n[2]
    return positions > LAWS_RATIO * velocities


@kernel
def _correct_velocities(world, count, h, only_led):
    """Solve the law of velocities again from the present impulses, with the rows as they are; with `only_led`
    1 in islands that obey the law of positions too: nothing has changed in the others."""
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    begin_again(bodies, joints, drivers, only_led)
    apply_forces(bodies, joints, drivers, VELOCITY_LEAD, h, state, only_led)
    add_changes(bodies, world.pairs, count, False)
    _forget_residual(state, only_led)
    state["lead"] = VELOCITY_LEAD
    state["slack"] = SLACK
    state["only_led"] = only_led
    solve_contacts(bodies, joints, drivers, world.pairs, count, h, state)
    state["lead"], state["only_led"] = 0.0, 0
    _note_forces(world, h)
    _accept_pushes(world, h)


@kernel
def _turn_friction(world, count, h):
    """Solve again with friction against the mean sliding of the substep, where that turns."""
    bodies, pairs, state, found = world.bodies, world.pairs, world.state, False
    for k in range(count):
        if slip_turn(bodies, pairs[k], state) > SLIP_STRAIGHT:
            pairs[k]["slides"], found = 1, True
    if found:
        _correct_velocities(world, count, h, 0)


@kernel
def _find_limits(world, h):
    """Make rows of the limits that hinges leave in the substep; returns whether any is new."""
    joints, drivers, found = world.joints, world.drivers, False
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1 and drivers[d]["hinge_count"] > 0:
            if keep_in_limits(joints, drivers[d], h, world.state["dt"]):
                # without contacts the hinges have no weight yet
                weigh_hinges(world.bodies, joints, drivers[d])
                found = True
    return found


@kernel
def _solve_velocities(world, count, h):
    """Apply forces over a substep and solve the law of velocities; returns the length of
    `solve_resting_contacts`."""
    bodies, pairs, state = world.bodies, world.pairs, world.state
    most, extended, unloaded, sought = h, False, False, True
    state["jams"] = 0
    for k in range(RESTING_CONTACT_ROUNDS):
        turn_share = _prepare_resting_contacts(world, count, h)
        if turn_share < 1:
            restore_normals(pairs, count)
            h *= turn_share
            _prepare_resting_contacts(world, count, h)
        apply_forces(bodies, world.joints, world.drivers, VELOCITY_LEAD, h, state, 0)
        converged = _solve_together(world, count, h)
        for _ in range(SUPPORT_ROUNDS if state["dense_substep"] == 0 else 0):
            if not (converged and move_supports(world, count, h)):
                break
            converged = _solve_with_grips(world, count, h)
        if state["statics"] == 1:
            while converged and release_grips(bodies, pairs, count, state):
                converged = _solve_with_grips(world, count, h)
        # a stop time is meaningful only if the impulses converged
        jams = sought and k < RESTING_CONTACT_ROUNDS - 1
        share = first_stop(bodies, pairs, count, h, jams, state) if converged else NEVER
        if share == AT_ONCE:
            sought = False
            if _solve_jam(world, count):
                return JAM_SHARE * state["dt"]
            start_again(world, count)
            forget_grips(pairs, count)
            continue
        if state["dense_substep"] == 0:
            exact = bias_share(bodies, world.pieces, pairs, count, h, state)
            if _follows_slip(state):
                turned = slip_turn_share(bodies, pairs, count, state)
                exact = min(exact, curved_share(turned, h, state))
            if state["led_loop"] == 1 and state["led"] == 1:
                exact = min(exact, _swing_share(world, count, h))
            if state["mechanisms"] == 1:
                exact = min(exact, _rest_share(world, h))
            # what carries no load until it was to stop does not stop then
            share, most = min(NEVER if unloaded else share, exact), min(most, exact * h)
            if converged and starts_to_curve(pairs, count, h, state):
                start_again(world, count)
                forget_grips(pairs, count)
                continue
        # a driver's pull is no part of the prediction of a stop, which may come nearer by a few percent only
        if k >= DRIVEN_ROUNDS and share < 1 and state["led_loop"] == 1 and state["led"] == 1:
            share = min(share, 0.5)
        later = min(most, STOP_SHORT * share * h)
        if share >= STOP_SHARE:
            # other contacts brake as well: the stop was predicted too early, so solve up to it once more
            if extended or later < STOP_LATER * h:
                if state["statics"] == 1 and converged and regain_grips(bodies, pairs, count, state):
                    while _solve_with_grips(world, count, h) and release_grips(bodies, pairs, count, state):
                        pass
                break
            extended, unloaded = True, share == NEVER and h < most
        if k == RESTING_CONTACT_ROUNDS - 1:
            state["counters"][CAP_HOLD_ROUNDS] += 1
            break
        start_again(world, count)
        forget_grips(pairs, count)
        h = later
    return h


@kernel
def _solve_jam(world, count):
    """Solve the law of velocities over JAM_SHARE of a frame; returns whether a contact jams there too."""
    state = world.state
    h = JAM_SHARE * state["dt"]
    forget_grips(world.pairs, count)
    if _solve_with_grips(world, count, h):
        if first_stop(world.bodies, world.pairs, count, h, True, state) == AT_ONCE:
            state["jams"] = 1
    return state["jams"] == 1


@kernel
def _end_jam(world, count, h):
    """Let the bodies move by their velocities after a jam, whose force acts at the start of its substep."""
    bodies, pairs = world.bodies, world.pairs
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED and bodies[b]["driver"] < 0:
            copy_vector(bodies[b]["velocity"], bodies[b]["path_velocity"])
            copy_vector(bodies[b]["omega"], bodies[b]["path_omega"])
    for k in range(count):
        pairs[k]["work"] = friction_work(bodies, pairs[k], h)


@kernel
def _swing_share(world, count, h):
    """Share of a substep of length h in which drivers swing with the bodies of their islands by SWING at
    most; NEVER if it is longer than h."""
    bodies, drivers, pairs, fastest = world.bodies, world.drivers, world.pairs, 0.0
    for k in range(count):
        pair = pairs[k]
        p = pair["resting_impulse"]
        if pair["island"] < 0 or (p[0] == 0 and p[1] == 0 and p[2] == 0):
            continue
        for side in range(2):
            b = pair["body_b"] if side else pair["body_a"]
            if not leads(bodies, drivers, b):
                continue
            driver = drivers[bodies[b]["driver"]]
            if driver["prescribed"] + driver["mechanism"] > 0:
                continue
            mass, island = driver["mass"], pair["island"]
            for c in range(len(bodies)):
                load = bodies[c]
                if load["kind"] == SIMULATED and load["driver"] < 0 and island_of(bodies, c) == island:
                    mass += load["mass"]
            swing = sqrt(driver["stiffness"] / mass)
            if driver["damping"] < swing * mass:
                fastest = max(fastest, swing)
    return curved_share(SWING / (fastest * h), h, world.state) if fastest * h > SWING else NEVER


@kernel
def _rest_share(world, h):
    """Share of a substep of length h after which a brake first stops its joint, or a motor has its rate; of
    what is so near that the solve handles it, none."""
    drivers, state, first = world.drivers, world.state, NEVER
    for d in range(state["driven_count"], len(drivers)):
        if drivers[d]["held"] == 1:
            first = min(first, first_rest(world.joints, drivers[d], h))
    return first if first > 1 / EVENT_CAP else NEVER


@kernel
def _solve_with_grips(world, count, h):
    """Solve the law of velocities once more, after grips have changed; returns whether it converged."""
    start_again(world, count)
    _prepare_resting_contacts(world, count, h)
    apply_forces(world.bodies, world.joints, world.drivers, VELOCITY_LEAD, h, world.state, 0)
    return _solve_together(world, count, h)


@inlined_kernel
def _follows_slip(state):
    """Whether sliding on prescribed bodies is followed within the substep: its turn, and its onset."""
    return is_carried(state) and state["dense_substep"] == 0


@kernel
def _end_at_onset(world, count, h):
    """Solve again up to the first onset of sliding within the substep; returns its length.

    A contact that slides in all shorter substeps does so from the start.
    """
    pairs, state = world.pairs, world.state
    sought = state["last_time"] < 0
    whole = h
    for _ in range(ONSET_ROUNDS if sought else 0):
        share = first_onset(pairs, count, h, state)
        later = min(share * h, whole)
        if abs(later - h) <= (GRIP_SHARE if state["statics"] == 1 else ONSET_SHARE) * whole:
            break
        if share != ONSET_SOUGHT:
            for k in range(count):
                copy_vector(pairs[k]["normal"], pairs[k]["last_normal"])
                for i in range(3):
                    pairs[k]["last_force"][i] = pairs[k]["resting_impulse"][i] / h
            state["last_time"] = h
        h = _solve_again(world, count, later)
    if sought and first_onset(pairs, count, h, state) == ONSET_SOUGHT:
        h = _solve_again(world, count, whole)
    return h


@kernel
def start_again(world, count):
    """Return bodies, their round pieces and the rows `pairs[:count]` to the start of the substep, for another
    attempt: how contacts move depends on where such pieces are."""
    bodies, pieces, pairs = world.bodies, world.pieces, world.pairs
    begin_again(bodies, world.joints, world.drivers, 0)
    restore_normals(pairs, count)
    for k in range(count):
        for side in range(2):
            body = bodies[pairs[k]["body_b"] if side else pairs[k]["body_a"]]
            piece = pieces[pairs[k]["piece_b"] if side else pairs[k]["piece_a"]]
            if is_moving(body) and is_round(piece):
                place_piece(piece, body, world.vertices, 0.0)


@kernel
def _solve_again(world, count, h):
    """`_solve_velocities` after another attempt at the substep."""
    start_again(world, count)
    forget_grips(world.pairs, count)
    return _solve_velocities(world, count, h)


@inlined_kernel
def _prepare_resting_contacts(world, count, h):
    """Initialise the rows before forces act: contact points, surface velocities, floors and zero impulses.

    Returns:
        Share of h in which no curved contact turns too far; NEVER if it is longer than h.
    """
    bodies, pairs, state = world.bodies, world.pairs, world.state
    if state["moving_surfaces"] == 1:
        place_surfaces(bodies, world.pieces, pairs, count)
    for d in range(len(world.drivers)):
        if d >= state["driven_count"]:
            set_drifts(bodies, world.joints, world.drivers[d])
        elif world.drivers[d]["loops"] == 1 and world.drivers[d]["prescribed"] == 1:
            predict_turn(bodies, world.drivers[d], h, state["dt"])
    smooth = state["dense_substep"] == 0 and state["halvings"] < HALVINGS
    for k in range(count):
        pair = pairs[k]
        approach_speed(bodies, pair, state)
        begin_row(bodies, pair, 0.0)
        pair["gap_error"], pair["followed"] = 0.0, 0
        # on paths that a coupling bends both laws differ by more
        one, two = bodies[pair["body_a"]], bodies[pair["body_b"]]
        bent = is_coupled(one, world.drivers) or is_coupled(two, world.drivers)
        pair["bent"] = 1 if bent else 0
        pair["curved"] = 1 if smooth and pair["crowded"] == 0 and not bent else 0
    patch_flight = max(APPROACH_MIN, rest_speed(state))
    if smooth:
        _except_faces(pairs, count, patch_flight)
    curved, turned = False, 0.0
    for k in range(count):
        pair = pairs[k]
        turn = move_to_middle(bodies, world.pieces, pair, h)
        if pair["curved"] == 1 and not is_curved(pair, h, state):
            pair["curved"] = -1
        if pair["curved"] == 1:
            curved, turned = True, max(turned, turn)
        if state["moving_surfaces"] == 1:
            move_surfaces(bodies, world.pieces, pair)
        if state["mechanisms"] == 1:
            _add_drifts(bodies, world.joints, world.drivers, pair, h)
    state["curved"] = 1 if curved else 0
    # an attempt before this one may have marked bodies
    marked, state["led"] = state["led"], 1 if curved or state["led_loop"] + state["mechanisms"] > 0 else 0
    if state["led"] == 1 or marked == 1:
        state["led"] = 1 if _mark_led(bodies, world.drivers, pairs, count) else 0
    for k in range(count):
        pair = pairs[k]
        led = bodies[pair["body_a"]]["led"] == 1 or bodies[pair["body_b"]]["led"] == 1
        flight = APPROACH_MIN if pair["manifold"] < 0 else patch_flight
        pair["floor"] = _floor(pair, state, flight, led)
    limit = state["contact_turn"]
    return curved_share(limit / turned, h, state) if turned > limit else NEVER


@kernel
def _add_drifts(bodies, joints, drivers, pair, h):
    """Add to `bias` how the velocities of bodies change at constant rates of their joints."""
    for side in range(2):
        b = pair["body_b"] if side else pair["body_a"]
        if not is_joined(bodies, drivers, b):
            continue
        joint, p, c = (
            joints[bodies[b]["hinge"]],
            pair["lever_b"] if side else pair["lever_a"],
            bodies[b]["center"],
        )
        x, y, z = cross(joint["spin_drift"], (p[0] - c[0], p[1] - c[1], p[2] - c[2]))
        share = h / 2 if side else -h / 2
        pair["bias"][0] += share * (joint["drift"][0] + x)
        pair["bias"][1] += share * (joint["drift"][1] + y)
        pair["bias"][2] += share * (joint["drift"][2] + z)


@kernel
def _except_faces(pairs, count, flight):
    """Mark patches in which three points or more stay as not curved: sliding and turning on a face, they stay
    in its plane, and gaps that differ by rounding would load any three of four corners."""
    for k in range(count):
        if pairs[k]["manifold"] == k:
            stay, row = 0, k
            while row >= 0:
                stay += 1 if pairs[row]["key"] >= -flight else 0
                row = pairs[row]["next_point"]
            row = k if stay > 2 else -1
            while row >= 0:
                pairs[row]["curved"] = 0
                row = pairs[row]["next_point"]


@kernel
def _floor(pair, state, flight, led):
    """Lower bound of a row's normal velocity after the contact solve [m/s].

    A pair that separates faster than `flight` gets NO_FLOOR (`first_return` finds its return). A slower pair,
    and any in a dense substep, may return as fast as it left: its mean velocity over the substep is then 0,
    and so is the work of its impulse; of a slow pair in an island with a driver, the law of positions sees to
    that. A near pair may close its gap at most.
    """
    if pair["speculative_speed"] > 0:
        return pair["key"] - pair["speculative_speed"]
    separation = -pair["key"]
    if separation <= SEPARATION_MIN:
        return 0.0
    if separation > flight and state["dense_substep"] == 0:
        return NO_FLOOR
    return 0.0 if led and separation <= flight else -separation


@inlined_kernel
def _solve_together(world, count, h):
    """Solve all rows together with a warm start; returns whether the impulses converged."""
    bodies, pairs, state = world.bodies, world.pairs, world.state
    note_free_slip(bodies, pairs, count, state)
    for k in range(count):
        load_impulse(bodies, pairs[k], state, h)
        if state["statics"] == 1:
            find_grip(pairs[k])
    _forget_residual(state, 0)
    state["lead"] = VELOCITY_LEAD
    state["slack"] = FIRST_SLACK
    converged = solve_contacts(bodies, world.joints, world.drivers, pairs, count, h, state)
    state["lead"] = 0.0
    _note_forces(world, h)
    _accept_pushes(world, h)
    return converged


@kernel
def note_residual(state):
    """Store the residual at the start of a substep."""
    state["past_residual"] = state["residual"]
    state["past_body_a"], state["past_body_b"] = state["residual_body_a"], state["residual_body_b"]


@kernel
def _forget_residual(state, only_led):
    """Return to the residual at the start of the substep, or with `only_led` 1 to that which other islands
    have left since: a solve that another one replaces has none."""
    if only_led == 0:
        state["other_residual"] = state["past_residual"]
        state["other_body_a"], state["other_body_b"] = state["past_body_a"], state["past_body_b"]
    state["residual"] = state["other_residual"]
    state["residual_body_a"], state["residual_body_b"] = state["other_body_a"], state["other_body_b"]


@kernel
def _note_forces(world, h):
    """Store the forces that the law of velocities exerts on mechanisms."""
    for d in range(world.state["driven_count"], len(world.drivers)):
        note_forces(world.drivers[d], h)


@kernel
def _accept_pushes(world, h):
    """Set the velocities of the drivers in the loop at the end of a substep of length h from their pushes."""
    for d in range(len(world.drivers)):
        if world.drivers[d]["loops"] == 1:
            accept_pushes(world.bodies, world.joints, world.drivers[d], h, world.state["dt"])


@kernel
def _solve_positions(world, count, h, again):
    """Solve the law of positions for the islands of drivers in the loop: what touches stays in touch until
    the end of the substep, and closes its gap to GAP_LEFT, and hinges end within their limits. The result
    sets the paths of their bodies, not their velocities.

    In a dense substep it sets velocities too if a driver on its coupling is in the loop: where a contact
    opens and closes, only under the force that closes the gap does one body gain what the other loses.

    It starts from the impulses of the law of velocities or, if `again`, from those that it found before.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    asked = state["led"] == 1
    for d in range(len(drivers)):
        asked = asked or (drivers[d]["loops"] == 1 and has_limits(joints, drivers[d]))
    if asked:
        for d in range(len(drivers)):
            if drivers[d]["loops"] == 1:
                note_curves(bodies, joints, drivers[d], h, state["dt"])
                exchange_pushes(joints, drivers[d])
        for b in range(len(bodies)):
            copy_vector(bodies[b]["velocity"], bodies[b]["path_velocity"])
            copy_vector(bodies[b]["omega"], bodies[b]["path_omega"])
        begin_again(bodies, joints, drivers, state["led"])
        apply_forces(bodies, joints, drivers, 1.0, h, state, state["led"])
        add_changes(bodies, pairs, count, True)
        for k in range(count):
            if again:
                _exchange_impulses(pairs[k])
            else:
                copy_vector(pairs[k]["resting_impulse"], pairs[k]["spare"])
                copy_vector(pairs[k]["moment"], pairs[k]["spare_moment"])
            _ask_positions(bodies, drivers, pairs[k], h, state)
            exchange_geometry(pairs[k])
        state["lead"], state["slack"] = 1.0, SLACK if again else FIRST_SLACK
        solve_contacts(bodies, joints, drivers, pairs, count, h, state)
        state["lead"] = 0.0
        if state["dense_substep"] == 1 and _is_coupled(drivers):
            _move_by_positions(world, count)
        for k in range(count):
            _exchange_impulses(pairs[k])
            exchange_geometry(pairs[k])
            pairs[k]["floor"] = pairs[k]["held_floor"]
        # of all rows again: the islands of the law of positions are without the others
        join_islands(bodies, drivers, pairs, count, False)
        exchange_paths(bodies)
        for d in range(len(drivers)):
            if drivers[d]["loops"] == 1:
                exchange_pushes(joints, drivers[d])
                note_paths(bodies, joints, drivers[d], h, state["dt"])
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1:
            weigh_for_impacts(drivers[d])
    _accept_pushes(world, h)


@kernel
def _is_coupled(drivers):
    """Whether a driver on its coupling is in the loop."""
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1 and drivers[d]["prescribed"] + drivers[d]["mechanism"] == 0:
            return True
    return False


@kernel
def _move_by_positions(world, count):
    """Replace the impulses and velocities of the law of velocities of `led` bodies by those of the law of
    positions."""
    bodies, pairs = world.bodies, world.pairs
    for k in range(count):
        if bodies[pairs[k]["body_a"]]["led"] == 1 or bodies[pairs[k]["body_b"]]["led"] == 1:
            copy_vector(pairs[k]["resting_impulse"], pairs[k]["spare"])
            copy_vector(pairs[k]["moment"], pairs[k]["spare_moment"])
    for b in range(len(bodies)):
        if bodies[b]["led"] == 1:
            copy_vector(bodies[b]["velocity"], bodies[b]["path_velocity"])
            copy_vector(bodies[b]["omega"], bodies[b]["path_omega"])
    for d in range(len(world.drivers)):
        if world.drivers[d]["loops"] == 1:
            repeat_pushes(world.joints, world.drivers[d])


@kernel
def _mark_led(bodies, drivers, pairs, count):
    """Mark the movers of the islands of drivers in the loop, and of curved contacts, and the links of such
    drivers as `led`; returns whether there are any."""
    found = False
    join_islands(bodies, drivers, pairs, count, True)
    for b in range(len(bodies)):
        bodies[b]["led"] = 0
        bodies[b]["curve_turn"][:] = 0.0
    for k in range(count):
        a, b = pairs[k]["body_a"], pairs[k]["body_b"]
        led = pairs[k]["curved"] == 1 or leads(bodies, drivers, a) or leads(bodies, drivers, b)
        led = led or is_joined(bodies, drivers, a) or is_joined(bodies, drivers, b)
        if pairs[k]["island"] >= 0 and led:
            bodies[pairs[k]["island"]]["led"], found = 1, True
    for k in range(count):
        if pairs[k]["island"] >= 0 and bodies[pairs[k]["island"]]["led"] == 1:
            for side in range(2):
                m = mover_of(bodies, drivers, pairs[k]["body_a"] if side == 0 else pairs[k]["body_b"])
                if m >= 0:
                    bodies[m]["led"] = 1
    # links move as their root does
    for b in range(len(bodies)):
        if bodies[b]["driver"] >= 0:
            bodies[b]["led"] = bodies[drivers[bodies[b]["driver"]]["root"]]["led"]
    return found


@kernel
def _exchange_impulses(pair):
    """Exchange the impulses of a row in the law of velocities with those in the law of positions."""
    p, q, m, n = pair["resting_impulse"], pair["spare"], pair["moment"], pair["spare_moment"]
    for i in range(3):
        p[i], q[i] = q[i], p[i]
        m[i], n[i] = n[i], m[i]


@kernel
def _ask_positions(bodies, drivers, pair, h, state):
    """Set the floor of a row in the law of positions: twice the speed at which its gap may close to
    `gap_aimed`."""
    pair["held_floor"] = pair["floor"]
    if bodies[pair["body_a"]]["led"] == 0 and bodies[pair["body_b"]]["led"] == 0:
        pair["floor"] = NO_FLOOR
    if pair["floor"] != NO_FLOOR:
        gap = max(pair["distance"], -SINKING_DEPTH) + pair["gap_error"]
        gap -= gap_aimed(pair, h, state)
        if is_joined(bodies, drivers, pair["body_a"]) or is_joined(bodies, drivers, pair["body_b"]):
            gap -= min(max(gap, -GAP_ERROR), GAP_ERROR)
        pair["floor"] = -2 * gap / h

"""One frame: the driven loop, then the simulated loop (paper, figure 3)."""

from math import sqrt

from touchstone.reference_impl.broad_phase.detection import (
    detect,
    detect_for,
    is_free,
    mark_pairs,
    place_listed,
    place_pieces,
)
from touchstone.reference_impl.broad_phase.fat_bounds import is_isolated, reset_fat_bounds, update_fat_bounds
from touchstone.reference_impl.broad_phase.spatial_hash import list_pieces
from touchstone.reference_impl.contact.contact_events import first_return
from touchstone.reference_impl.contact.contact_log import note_moment_work, shorten_resting_contacts
from touchstone.reference_impl.contact.energy_guard import guard_energy, note_energy
from touchstone.reference_impl.contact.impact import resolve_impacts
from touchstone.reference_impl.contact.integrate import (
    apply_forces,
    begin_substep,
    end_substep,
    fly_straight,
    none_turns,
    pose_at,
    set_paths,
    set_ways,
)
from touchstone.reference_impl.contact.resting_contact import (
    note_residual,
    solve_resting_contacts,
    start_again,
)
from touchstone.reference_impl.contact.separation import separate_simulated
from touchstone.reference_impl.contact.speculative_contacts import gather_contacts
from touchstone.reference_impl.continuous.contact_motion import restore_normals
from touchstone.reference_impl.continuous.driver_frame import enter_loop, leave_loop
from touchstone.reference_impl.continuous.driver_motion import begin_driver, set_link_ways, way_error
from touchstone.reference_impl.continuous.first_impact import earliest_impact
from touchstone.reference_impl.continuous.free_rotation import refresh_inertia
from touchstone.reference_impl.continuous.hinge_motion import has_limits
from touchstone.reference_impl.continuous.mechanism_motion import (
    note_touched,
    start_mechanism,
    weigh_for_impact,
)
from touchstone.reference_impl.continuous.swept_pairs import find_swept_pairs, may_touch
from touchstone.reference_impl.core.conventions import (
    DETECTION_DISCRETE,
    DETECTION_FAST,
    DETECTION_SWEEP,
    DRIVEN,
    EVENT_CAP,
    FIXED,
    SIMULATED,
)
from touchstone.reference_impl.core.counters import (
    COUNT_DENSE,
    COUNT_EVENTS,
    COUNT_GAVE_UP,
    STAGE_COLLISION,
    STAGE_DRIVE,
    STAGE_IMPULSES,
    STAGE_INTEGRATION,
    STAGE_REMOVAL,
)
from touchstone.reference_impl.core.kernel import clock, inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.kinematics.driver_poses import store_free_pose
from touchstone.reference_impl.kinematics.skeleton import (
    move_from_shown,
    move_links,
    place,
    pose_links,
    store_shown,
)
from touchstone.reference_impl.posture.attraction import approach, set_goals
from touchstone.reference_impl.posture.driven_time_of_impact import sweep_drivers
from touchstone.reference_impl.posture.global_depth import largest_depth
from touchstone.reference_impl.posture.overlap_removal import remove_overlap
from touchstone.reference_impl.posture.virtual_coupling import follow_tracker
from touchstone.reference_impl.solver.hinge_response import weigh_hinges
from touchstone.reference_impl.solver.tolerances import RESIDUAL_OPEN

DENSE_CALM = 4
"""Events of a crowded frame from which the next one is crowded from its start."""
UNPAID_ATTEMPTS, UNPAID_SHARE = 8, 0.25
"""Most repetitions of a substep, and the share of its length that each takes whose separation adds energy
that no motion pays [1]."""
ELAPSED_SHARE = 0.99
"""Share of a repeated substep that has to elapse before an event for its forces to count as those of its
end."""
OPEN_HALVINGS = 8
"""Most halvings in a frame of substeps whose contacts found no solution."""
SINKING_HALVINGS = 2
"""Most halvings of a substep for a contact that agrees at its end alone, and sinks there."""
WAY_ERROR = 1e-7
"""Distance of a driver's links at an impact from the parabolas along which it was searched [m]: a tenth of
TOUCH_DISTANCE."""
WAY_ATTEMPTS = 32
"""Most searches for an impact of a substep."""
WAY_SHARE = 0.1
"""Distance of a driver from its parabola, over its width, within which no impact is overlooked [1]."""
TIME_MIN = 1e-12
"""Remainder of a frame that is not simulated [s]."""


@kernel
def prepare(bodies, pieces, joints, drivers, vertices, pairs, contacts, state):
    """Initialise a newly filled world for its first step."""
    for b in range(len(bodies)):
        place(bodies[b])
        if bodies[b]["kind"] == SIMULATED:
            refresh_inertia(bodies[b])
    driven = drivers[: state[0]["driven_count"]]
    for d in range(len(driven)):
        pose_links(bodies, joints, drivers[d])
        weigh_hinges(bodies, joints, drivers[d])
        move_links(bodies, joints, drivers[d])
    for d in range(len(driven), len(drivers)):
        copy_vector(state[0]["gravity"], drivers[d]["gravity"])
        drivers[d]["step_error"] = state[0]["joint_error"]
        start_mechanism(bodies, joints, drivers[d])
    place_pieces(bodies, pieces, vertices, FIXED)
    place_pieces(bodies, pieces, vertices, SIMULATED)
    list_pieces(bodies, pieces, state[0])
    world = World(bodies, pieces, joints, driven, vertices, pairs, contacts, state[0])
    for d in range(len(driven)):
        end = detect_for(world, d, 1.0)
        store_free_pose(bodies, joints, drivers[d])
        drivers[d]["has_free"] = 1 if is_free(largest_depth(bodies, pairs, end, d)) else 0
    reset_fat_bounds(state[0])
    state[0]["counters"][:] = 0


@kernel
def step(bodies, pieces, joints, drivers, vertices, pairs, contacts, state):
    """Advance a world by one frame of `state["dt"]`.

    `target_*` of a driver is its tracker at the frame's end, `old_target_*` that at its start.
    `contacts`, the stage clocks and the counters cover this frame only. A frame that is nothing but a flight
    has no stages: reading the clock would take a quarter of it.
    """
    s = state[0]
    world = World(bodies, pieces, joints, drivers, vertices, pairs, contacts, s)
    s["counters"][:] = 0
    s["stage_seconds"][:] = 0.0
    s["contact_count"] = 0
    s["residual"] = s["dropped_time"] = s["parted_energy"] = s["guarded_energy"] = s["moment_work"] = 0.0
    s["work_left"] = s["frame_work"]
    s["missed_before"], s["missed"] = s["missed"], 0
    s["residual_body_a"] = s["residual_body_b"] = -1
    if s["skip_drive"] == 0:
        driven = drivers[: s["driven_count"]]
        _drive(World(bodies, pieces, joints, driven, vertices, pairs, contacts, s))
    if s["skip_contact"] == 1:
        _fly(world)
    elif is_isolated(bodies, pieces, drivers, s):
        _fly(world)
        # the driven loop needs the placed pieces of simulated bodies
        if len(drivers) > 0:
            place_listed(bodies, pieces, vertices, SIMULATED, s)
    else:
        _simulate(world)
    if s["update_fat_bounds"] == 1:
        update_fat_bounds(bodies, pieces, vertices, drivers, pairs, s)


@inlined_kernel
def _drive(world):
    """Driven loop: coupling, overlap removal, and velocities of driven bodies for this frame's contacts."""
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    start = clock(state["clock"])
    _keep_free_poses(world)
    for d in range(len(drivers)):
        if drivers[d]["chain_count"] > 0:
            store_shown(bodies, joints, drivers[d])
        begin_driver(joints, drivers[d])
        for k in range(drivers[d]["first_joint"], drivers[d]["first_joint"] + drivers[d]["joint_count"]):
            joints[k]["shown_angle"] = joints[k]["angle"]
        follow_tracker(drivers[d], state["dt"])
        copy_vector(drivers[d]["position"], drivers[d]["coupled_position"])
        copy_quaternion(drivers[d]["orientation"], drivers[d]["coupled_orientation"])
        set_goals(joints, drivers[d], state["dt"])
    coupled = clock(state["clock"])
    collision = state["stage_seconds"][STAGE_COLLISION]
    # attract chains in parts, so that no limb passes through another between overlap tests
    for part in range(state["attraction_parts"]):
        more = False
        for d in range(len(drivers)):
            if approach(bodies, joints, drivers[d], state, part):
                more = True
        if state["skip_removal"] == 0:
            if state["detection"] != DETECTION_DISCRETE:
                sweep_drivers(world)
            remove_overlap(world)
        if not more:
            break
    if state["skip_removal"] == 1:
        for d in range(len(drivers)):
            drivers[d]["is_free"] = 1
            pose_links(bodies, joints, drivers[d])
    removed = clock(state["clock"])
    collision = state["stage_seconds"][STAGE_COLLISION] - collision
    for d in range(len(drivers)):
        if drivers[d]["chain_count"] > 0:
            move_from_shown(bodies, joints, drivers[d], state["dt"])
        else:
            move_links(bodies, joints, drivers[d])
    state["stage_seconds"][STAGE_REMOVAL] += removed - coupled - collision
    state["stage_seconds"][STAGE_DRIVE] += coupled - start + clock(state["clock"]) - removed


@inlined_kernel
def _fly(world):
    """Simulated loop of a frame without contacts: one substep of free flight."""
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state, h = world.pairs, world.state, world.state["dt"]
    start = clock(state["clock"]) if len(drivers) > 0 else 0.0
    if state["skip_rotation"] == 1 or none_turns(bodies):
        fly_straight(bodies, state["gravity"], h)
    else:
        begin_substep(bodies, joints, drivers)
        apply_forces(bodies, joints, drivers, 0.0, h, state, 0)
        set_ways(bodies, joints, drivers, pairs, 0, h, h)
        pose_at(bodies, 1.0)
        end_substep(bodies, joints, drivers, 1.0, h, h)
    if len(drivers) > 0:
        state["stage_seconds"][STAGE_INTEGRATION] += clock(state["clock"]) - start


@inlined_kernel
def _simulate(world):
    """Simulated loop: advance to the earliest impact, resolve it, and repeat for the rest of the frame."""
    bodies, pieces, joints, drivers = world.bodies, world.pieces, world.joints, world.drivers
    vertices, pairs, state = world.vertices, world.pairs, world.state
    left, halved = state["dt"], 0
    if state["skip_drive"] == 0 and state["driven_isolated"] == 0:
        for d in range(state["driven_count"]):
            if drivers[d]["chain_count"] == 0 or may_touch(bodies, joints, drivers[d], state["dt"]):
                enter_loop(bodies, joints, drivers[d], state["dt"])
                state["driven_loop"] = 1
                state["led_loop"] = max(state["led_loop"], drivers[d]["leads"])
                coupled = drivers[d]["leads"] - drivers[d]["prescribed"]
                state["coupled_loop"] = max(state["coupled_loop"], coupled)
    # a crowded frame mostly follows another: do not try event by event again
    state["calm_events"] = state["curved"] = state["halvings"] = 0
    state["rows"] = state["event_rows"] if state["dense_frame"] == 1 else 0
    for _ in range(EVENT_CAP):
        time, halvings = state["dt"] - left, state["halvings"]
        touching, h = gather_contacts(world, left)
        if len(drivers) > 0:
            note_touched(bodies, joints, drivers, pairs, touching)
        # the inertia of a driver affects only its contacts
        for d in range(len(drivers)):
            if drivers[d]["loops"] == 1 and (touching > 0 or has_limits(joints, drivers[d])):
                weigh_hinges(bodies, joints, drivers[d])
                if drivers[d]["mechanism"] == 1:
                    weigh_for_impact(bodies, joints, drivers[d], h)
        # impacts change velocities instantly; forces and resting contacts act over the substep
        start = clock(state["clock"])
        if not resolve_impacts(world, touching, time, h):
            state["counters"][COUNT_GAVE_UP] += 1
        state["stage_seconds"][STAGE_IMPULSES] += clock(state["clock"]) - start
        begin_substep(bodies, joints, drivers)
        if touching > 0 or state["mechanisms"] == 1:
            note_energy(bodies, joints, drivers, state)
        first_held, state["unpaid_energy"] = state["contact_count"], 0.0
        note_residual(state)
        state["may_halve"] = 1
        h, fraction = _substep(world, touching, time, h)
        # a contact may open and close again by the end: an earlier event leaves energy, so solve up to it;
        # bodies sink less in a shorter substep, and separation lifts them less
        wanted, sunk, lifted = 1.0, 0, False
        for _ in range(UNPAID_ATTEMPTS):
            # an event at the start: no force has acted
            if fraction * h <= TIME_MIN:
                break
            if halved < OPEN_HALVINGS and state["residual"] > max(RESIDUAL_OPEN, state["past_residual"]):
                # contacts without a solution over a substep may have one over another
                halved += 1
                h *= 0.5
            elif state["halves"] == 1:
                # what is jammed sinks however short the substep
                sunk += 1
                state["may_halve"] = 1 if sunk < SINKING_HALVINGS else 0
                h *= fraction
            elif fraction < wanted and (leads_to_end(drivers, state) or state["unpaid_energy"] > 0):
                # such forces are exact at the end of a substep, not within
                wanted = ELAPSED_SHARE
                h *= fraction
            elif state["unpaid_energy"] > 0:
                # first without the lift that no motion paid for, then over a shorter time
                h *= UNPAID_SHARE * fraction if lifted else 1.0
                lifted = True
            else:
                break
            start_again(world, touching)
            state["contact_count"] = first_held
            h, fraction = _substep(world, touching, time, h)
        state["parted_energy"] += state["unpaid_energy"]
        if state["moments"] == 1:
            note_moment_work(bodies, pairs, touching, fraction, state)
        left -= fraction * h
        if left <= TIME_MIN:
            break
        state["counters"][COUNT_EVENTS] += 1
        if fraction == 1 and state["curved"] == 1 and state["halvings"] == halvings:
            state["calm_events"] += 1
    busy = state["counters"][COUNT_DENSE] > 0 and state["counters"][COUNT_EVENTS] >= DENSE_CALM
    state["dense_frame"] = 1 if busy else 0
    if left > TIME_MIN:
        state["dropped_time"] = left
        state["counters"][COUNT_GAVE_UP] += 1
    place_listed(bodies, pieces, vertices, SIMULATED, state)
    state["driven_loop"] = state["led_loop"] = state["coupled_loop"] = 0
    for d in range(state["driven_count"]):
        if drivers[d]["loops"] == 1:
            leave_loop(bodies, joints, drivers[d], state["dt"])
    if left > TIME_MIN and len(drivers) > 0:
        # bodies are where the time was dropped, prescribed ones at the end of the frame
        place_listed(bodies, pieces, vertices, DRIVEN, state)
        state["unpaid_energy"] = 0.0
        separate_simulated(world, 0)


@kernel
def leads_to_end(drivers, state):
    """Whether forces of the substep are those of its end: of curved contacts, drivers, or held joints."""
    found = state["led"] == 1
    for d in range(state["driven_count"], len(drivers)):
        found = found or drivers[d]["held"] == 1
    return found


@kernel
def _keep_free_poses(world):
    """Store where the simulated loop of the frame before left drivers that it pressed, if all are free there:
    sweeps and ways back begin there."""
    bodies, drivers = world.bodies, world.drivers
    pressed = False
    for d in range(len(drivers)):
        pressed = pressed or drivers[d]["pressed"] > 0
    if pressed:
        free, end = True, detect_for(world, 0, 1.0)
        for d in range(len(drivers)):
            free = free and is_free(largest_depth(bodies, world.pairs, end, d))
        for d in range(len(drivers)):
            if free and drivers[d]["pressed"] > 0:
                store_free_pose(bodies, world.joints, drivers[d])
            drivers[d]["pressed"] = 0


@kernel
def _substep(world, touching, time, h):
    """Solve the resting contacts `pairs[:touching]` for at most h [s], and advance to the next event.

    Returns:
        (h, fraction): the length solved for [s], and the fraction of it that elapsed.
    """
    bodies, drivers, pairs, state = world.bodies, world.drivers, world.pairs, world.state
    start, first_held = clock(state["clock"]), state["contact_count"]
    h = solve_resting_contacts(world, touching, time, h)
    returned = first_return(bodies, pairs, touching, state)
    restore_normals(pairs, touching)
    state["stage_seconds"][STAGE_IMPULSES] += clock(state["clock"]) - start
    set_ways(bodies, world.joints, drivers, pairs, touching, h, state["dt"])
    fraction, drifted = _advance(world, touching, returned, h)
    end_substep(bodies, world.joints, drivers, fraction, h, state["dt"])
    shorten_resting_contacts(world.contacts, first_held, state["contact_count"], fraction)
    # detection for separation writes to `pairs` behind the contact rows
    moved = touching
    if drifted:
        moved = separate_simulated(world, touching)
    state["unpaid_energy"] = 0.0
    guard_energy(world, moved, drifted, first_held, fraction == 1, fraction * h)
    return h, fraction


@inlined_kernel
def _until_swing(bodies, joints, drivers, h, dt):
    """Fraction of a substep of length h that is searched for impacts: a radian of a coupling that takes its
    driver far from its parabola, or 1. Sets the ways of the links up to there."""
    until = 1.0
    for d in range(len(drivers)):
        driver = drivers[d]
        swing = (
            0.0
            if driver["prescribed"] + driver["mechanism"] > 0
            else h * sqrt(driver["stiffness"] / driver["mass"])
        )
        if driver["loops"] == 1 and swing > 1:
            root, error = bodies[driver["root"]], 0.0
            for part in range(1, 4):
                error = max(error, way_error(bodies, joints, driver, root, part / 4, h, dt))
            if error > WAY_SHARE * root["width"]:
                until = min(until, 1 / swing)
    if until < 1:
        for d in range(len(drivers)):
            if drivers[d]["loops"] == 1:
                set_link_ways(bodies, joints, drivers[d], until, h, dt)
    return until


@inlined_kernel
def _advance(world, touching, returned, h):
    """Pose simulated bodies at the earliest impact of the substep of length h, but at most at its fraction
    `returned`. Where a driver is elsewhere than its parabola at the impact, search again along a closer one.

    Returns:
        (fraction, drifted) of `earliest_impact`.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    start, collision = clock(state["clock"]), state["stage_seconds"][STAGE_COLLISION]
    mark_pairs(bodies, world.pieces, pairs, touching)
    until, sought = _until_swing(bodies, joints, drivers, h, state["dt"]), (-1, -1)
    for _ in range(WAY_ATTEMPTS):
        fast = state["detection"] != DETECTION_DISCRETE and set_paths(bodies)
        fast = fast and state["detection"] == DETECTION_FAST
        if fast or state["detection"] == DETECTION_SWEEP:
            end = find_swept_pairs(world, SIMULATED, touching)
        else:
            pose_at(bodies, until)
            end, _ = detect(world, SIMULATED, touching)
        fraction, drifted, met = earliest_impact(world, touching, end, until, fast, sought)
        if fraction >= returned or met < 0:
            break
        error = 0.0
        for side in range(2):
            link = bodies[pairs[met]["body_a"] if side == 0 else pairs[met]["body_b"]]
            if link["driver"] >= 0 and drivers[link["driver"]]["loops"] == 1:
                driver = drivers[link["driver"]]
                error = max(error, way_error(bodies, joints, driver, link, fraction, h, state["dt"]))
        if error <= WAY_ERROR:
            break
        until, sought = fraction, (pairs[met]["piece_a"], pairs[met]["piece_b"])
        for d in range(len(drivers)):
            if drivers[d]["loops"] == 1:
                set_link_ways(bodies, joints, drivers[d], until, h, state["dt"])
    fraction = min(fraction, returned)
    pose_at(bodies, fraction)
    collision -= state["stage_seconds"][STAGE_COLLISION]
    state["stage_seconds"][STAGE_INTEGRATION] += clock(state["clock"]) - start + collision
    return fraction, drifted

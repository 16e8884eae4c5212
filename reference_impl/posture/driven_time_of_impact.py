"""Time of impact of driven bodies between their last free pose and the new one.

Contact does not stop a driven body: overlap removal resolves shallow overlap, so the body slides along
surfaces. From deep overlap, the shortest way out may lead to the far side of the obstacle. The motion of a
driven body therefore ends where the depth of a link reaches a share DRIVEN_DEPTH_SHARE of the least widths of
both pieces. (Along the normal at the impact a piece may be wider, and a link deep at an edge could cross to
the far side.) DETECTION_FAST sweeps only links that moved farther than half the width of both.
"""

from touchstone.reference_impl.continuous.swept_motion import is_fast_pair, set_path, shown_motion
from touchstone.reference_impl.continuous.swept_pairs import find_swept_pairs
from touchstone.reference_impl.continuous.time_of_impact import MovingPair, time_of_impact
from touchstone.reference_impl.core.conventions import (
    DETECTION_FAST,
    DETECTION_SWEEP,
    DRIVEN,
    IMPACT_SLACK,
    IMPACT_TARGET,
    PART_WHOLE,
    SIMULATED,
)
from touchstone.reference_impl.core.counters import COUNT_UNCONVERGED, STAGE_COLLISION
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector, rotation_between
from touchstone.reference_impl.kinematics.driver_poses import interpolate, restore_entry, store_entry
from touchstone.reference_impl.kinematics.skeleton import link_of, pose_links, pose_moved

PAST_MIDDLE = 0.5
"""Fraction of the widths of link and obstacle beyond which the way out may lead to the far side [1]."""
DRIVEN_DEPTH_SHARE = 0.2
"""Depth that a driven link may reach in an obstacle, over both least widths [1]; half is past the middle."""
DRIVEN_DEPTH_SLACK = 0.025
"""Accepted deviation from DRIVEN_DEPTH_SHARE [1]."""
SEGMENT_TURN = 0.5
"""Rotation of a link per straight segment of its swept arc [rad]: the error is 1/32 of the link's length."""


@kernel
def sweep_drivers(world):
    """Stop each driver's motion from its last free pose where a link first goes deep into a fixed body or
    another of its links, then two drivers where they go deep into each other; their couplings keep their
    velocities."""
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    every = state["detection"] != DETECTION_FAST
    for d in range(len(drivers)):
        if drivers[d]["has_free"] == 1 and (
            every or spans(bodies, joints, drivers[d], state["least_width"]) > 1
        ):
            stop_deep(world, d)
    for _ in range(len(drivers) - 1):
        far = every
        for d in range(len(drivers)):
            far = spans(bodies, joints, drivers[d], 0.0) > 1 or far
        if not far or not stop_deep(world, -1):
            break


@kernel
def stop_deep(world, d):
    """Move driver d back towards its last free pose, to where a link first goes deep into a fixed body or
    another of its links. The current pose is stored as the pose at entry; poses the links.

    With d = -1, move back the two drivers that first go deep into each other if all move together.
    Prescribed ones go on. DETECTION_FAST needs the paths that `spans` bounds.

    Returns:
        Whether any moved back.
    """
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    since, turn = clock(state["clock"]), 0.0
    for b in range(len(bodies)):
        if not _is_swept(drivers, d, bodies[b]["driver"]):
            bodies[b]["moves"], bodies[b]["path"] = 0, 0.0
    for k in range(len(drivers)):
        if _is_swept(drivers, d, k):
            store_entry(joints, drivers[k])
            turn = max(turn, _largest_turn(bodies, joints, drivers[k]))
    segments, reached, one, two = 1 + int(turn / SEGMENT_TURN), 1.0, -1, -1
    for part in range(segments):
        for k in range(len(drivers)):
            if _is_swept(drivers, d, k):
                _begin_segment(bodies, joints, drivers[k], part / segments, (part + 1) / segments)
        fraction, met = _free_fraction(world, d)
        if met >= 0:
            one, two = (
                bodies[world.pairs[met]["body_a"]]["driver"],
                bodies[world.pairs[met]["body_b"]]["driver"],
            )
            reached = (part + fraction) / segments
            break
    for k in range(len(drivers)):
        if _is_swept(drivers, d, k):
            if (k == one or k == two) and drivers[k]["prescribed"] == 0:
                interpolate(bodies, joints, drivers[k], PART_WHOLE, reached)
            else:
                restore_entry(joints, drivers[k])
            _set_moving(bodies, joints, drivers[k], 0)
            # sweeps leave links at intermediate poses
            pose_links(bodies, joints, drivers[k])
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return reached < 1


@kernel
def _is_swept(drivers, d, k):
    """Whether `stop_deep` for d moves driver k, if k is a driver."""
    return k >= 0 and drivers[k]["has_free"] == 1 and (d < 0 or k == d)


@kernel
def spans(bodies, joints, driver, least_width):
    """Longest path of a link since the last free pose, over half the sum of its width and that of others [1]:
    beyond 1, it may lead through one of them. Poses the links and bounds their paths."""
    _largest_turn(bodies, joints, driver)
    pose_moved(bodies, joints, driver)
    most = 0.0
    for k in range(driver["joint_count"] + 1):
        most = max(most, _set_path(bodies[link_of(joints, driver, k)], least_width))
    return most


@kernel
def _largest_turn(bodies, joints, driver):
    """Bound on the rotation angle of any link since the last free pose [rad]."""
    root, turned = bodies[driver["root"]], driver["scratch"][0]
    rotation_between(driver["free_orientation"], driver["orientation"], turned)
    most = root["spin_most"] = abs(turned[0]) + abs(turned[1]) + abs(turned[2])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        angle = abs(joints[k]["angle"] - joints[k]["free_angle"])
        angle += bodies[joints[k]["parent"]]["spin_most"]
        bodies[joints[k]["child"]]["spin_most"] = angle
        most = max(most, angle)
    return most


@kernel
def _set_path(body, least_width):
    for i in range(3):
        body["travel"][i], body["travel_bend"][i] = body["center"][i] - body["free_center"][i], 0.0
    set_path(body, body["spin_most"])
    return body["path"] / (PAST_MIDDLE * (body["width"] + least_width))


@kernel
def _set_moving(bodies, joints, driver, moves):
    bodies[driver["root"]]["moves"] = moves
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        bodies[joints[k]["child"]]["moves"] = moves


@kernel
def _begin_segment(bodies, joints, driver, start, end):
    """Set the motions of a driver's links between two fractions of the driver's motion."""
    interpolate(bodies, joints, driver, PART_WHOLE, start)
    _set_moving(bodies, joints, driver, 1)
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        copy_vector(link["center"], link["old_center"])
        copy_quaternion(link["orientation"], link["old_orientation"])
    interpolate(bodies, joints, driver, PART_WHOLE, end)
    for k in range(driver["joint_count"] + 1):
        shown_motion(bodies[link_of(joints, driver, k)])


@kernel
def _free_fraction(world, d):
    """Fraction of a segment up to which no link of driver d has gone deep into a fixed body or another of its
    links or, if d is -1, no driver into another; and the row of that pair, or -1."""
    bodies, pieces, pairs, state = world.bodies, world.pieces, world.pairs, world.state
    first, met = 1.0, -1
    for k in range(find_swept_pairs(world, DRIVEN, 0)):
        pair = pairs[k]
        a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
        one, two = a["driver"], b["driver"]
        # simulated bodies meet a driver in the simulated loop
        if a["kind"] == SIMULATED or b["kind"] == SIMULATED:
            continue
        least = min(one, two)
        if (least < 0 or one == two) if d < 0 else (max(one, two) != d or (least >= 0 and least != d)):
            continue
        if state["detection"] == DETECTION_SWEEP or is_fast_pair(bodies, pieces, pair, PAST_MIDDLE):
            fraction = _deep(world, pair, first)
            met = k if fraction < first else met
            first = fraction
    return first, met


@kernel
def _deep(world, pair, until):
    """Fraction, at most `until`, at which a pair reaches the depth limit; an earlier one, counted, if a time
    of impact did not converge."""
    bodies, pieces, vertices, state = world.bodies, world.pieces, world.vertices, world.state
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    moving = MovingPair(a, b, one, two, vertices, pair, state)
    met, _, converged = time_of_impact(moving, 0.0, until, IMPACT_TARGET, IMPACT_SLACK)
    if met == until:
        return until
    if converged:
        width = one["width"] + two["width"]
        target, slack = -DRIVEN_DEPTH_SHARE * width, DRIVEN_DEPTH_SLACK * width
        met, _, converged = time_of_impact(moving, met, until, target, slack)
    if not converged:
        state["counters"][COUNT_UNCONVERGED] += 1
    return met

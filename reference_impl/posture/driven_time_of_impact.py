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
    MOVER_DRIVER,
    PART_WHOLE,
    SIMULATED,
)
from touchstone.reference_impl.core.counters import COUNT_UNCONVERGED, STAGE_COLLISION
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector, rotation_between
from touchstone.reference_impl.kinematics.driver_poses import interpolate, restore_entry, store_entry
from touchstone.reference_impl.kinematics.skeleton import pose_links, pose_moved
from touchstone.reference_impl.posture.global_depth import Mover, side_of

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
    """Stop each driver's motion from its last free pose where a link first goes deep into a fixed or
    simulated body; its coupling keeps its velocity."""
    joints, drivers, state = world.joints, world.drivers, world.state
    for d in range(len(drivers)):
        if drivers[d]["has_free"] == 0:
            continue
        if state["detection"] != DETECTION_FAST or is_far(world.bodies, joints, drivers[d], state):
            stop_deep(world, d)


@kernel
def stop_deep(world, d):
    """Move driver d back towards its last free pose, to where a link first goes deep into a fixed or
    simulated body on its way to the current pose, which is stored as the pose at entry; poses the links.
    DETECTION_FAST needs the paths that `is_far` bounds.

    Returns:
        Whether it moved back.
    """
    bodies, joints, driver, state = world.bodies, world.joints, world.drivers[d], world.state
    since = clock(state["clock"])
    for b in range(len(bodies)):
        if bodies[b]["driver"] != d:
            bodies[b]["moves"], bodies[b]["path"] = 0, 0.0
    store_entry(joints, driver)
    segments = 1 + int(_largest_turn(bodies, joints, driver) / SEGMENT_TURN)
    reached = 1.0
    for k in range(segments):
        _begin_segment(bodies, joints, driver, k / segments, (k + 1) / segments)
        fraction = _free_fraction(world, Mover(MOVER_DRIVER, d))
        if fraction < 1:
            reached = (k + fraction) / segments
            break
    if reached < 1:
        interpolate(bodies, joints, driver, PART_WHOLE, reached)
    else:
        restore_entry(joints, driver)
    _set_moving(bodies, joints, driver, 0)
    # sweeps leave links at intermediate poses
    pose_links(bodies, joints, driver)
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return reached < 1


@kernel
def is_far(bodies, joints, driver, state):
    """Whether a link may have moved since the last free pose by more than half the sum of its width and the
    least width; poses the links and bounds their paths."""
    _largest_turn(bodies, joints, driver)
    pose_moved(bodies, joints, driver)
    far = _set_path(bodies[driver["root"]], state)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        far = _set_path(bodies[joints[k]["child"]], state) or far
    return far


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
def _set_path(body, state):
    for i in range(3):
        body["travel"][i], body["travel_bend"][i] = body["center"][i] - body["free_center"][i], 0.0
    set_path(body, body["spin_most"])
    return body["path"] > PAST_MIDDLE * (body["width"] + state["least_width"])


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
    for b in range(len(bodies)):
        if bodies[b]["moves"] == 1:
            copy_vector(bodies[b]["center"], bodies[b]["old_center"])
            copy_quaternion(bodies[b]["orientation"], bodies[b]["old_orientation"])
    interpolate(bodies, joints, driver, PART_WHOLE, end)
    for b in range(len(bodies)):
        if bodies[b]["moves"] == 1:
            shown_motion(bodies[b])


@kernel
def _free_fraction(world, mover):
    """Fraction of a segment up to which no link of the driver has gone deep into an obstacle."""
    bodies, pieces, pairs, state = world.bodies, world.pieces, world.pairs, world.state
    first = 1.0
    end = find_swept_pairs(world, DRIVEN, 0)
    for k in range(end):
        pair = pairs[k]
        both = bodies[pair["body_a"]]["kind"] == DRIVEN and bodies[pair["body_b"]]["kind"] == DRIVEN
        if side_of(bodies, pair, mover) == 0.0 or both or _meets_in_loop(bodies, pair):
            continue
        if state["detection"] == DETECTION_SWEEP or is_fast_pair(bodies, pieces, pair, PAST_MIDDLE):
            first = _deep(world, pair, first)
    return first


@kernel
def _meets_in_loop(bodies, pair):
    """Whether a pair has a simulated body: a driver meets it in the simulated loop."""
    return bodies[pair["body_a"]]["kind"] == SIMULATED or bodies[pair["body_b"]]["kind"] == SIMULATED


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

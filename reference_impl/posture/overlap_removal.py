"""Overlap removal for driven bodies: by translation, for chains by the posture QP; if both fail, the body
returns towards its last free pose."""

from math import sqrt

from touchstone.reference_impl.broad_phase.detection import detect, detect_for, is_free
from touchstone.reference_impl.core.conventions import (
    DETECTION_DISCRETE,
    DRIVEN,
    MOVER_DRIVER,
    MOVER_TRUNK,
    PART_ROOT,
    PART_WHOLE,
    REMOVAL_LEAST_MOTION,
    REMOVAL_ROUNDS,
)
from touchstone.reference_impl.core.counters import (
    CAP_TRANSLATION_ROUNDS,
    COUNT_GAVE_UP,
    COUNT_ROUNDS,
    COUNT_WAY_BACK,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.chain_order import shuffle_chains
from touchstone.reference_impl.kinematics.driver_poses import (
    interpolate,
    store_entry,
    store_free_pose,
)
from touchstone.reference_impl.kinematics.skeleton import pose_links, pose_moved
from touchstone.reference_impl.posture.chain_overlap_removal import free_chains
from touchstone.reference_impl.posture.driven_time_of_impact import spans, stop_deep
from touchstone.reference_impl.posture.global_depth import Mover, global_depth, largest_depth, side_of
from touchstone.reference_impl.posture.min_norm_translation import min_norm_translation

VANISHING_SHIFT = 1e-3
"""|PD| over the largest depth below which opposing normals cancel [1]."""
DETOUR = 2.0
"""Translation of a driver beyond its way back, over the largest depth at entry, from which it may lead
through other bodies [1]."""
LONGEST_SHIFT = 100.0
"""|x| over the largest depth above which normals count as opposing [1]: within 1.1 degrees of opposition."""
STALL_ROUNDS = 8
STALL_FALL = 0.9
"""The largest depth must fall below 0.9 of itself in 8 rounds."""
WAY_BACK_STEPS, WAY_BACK_PARTS = 24, 1000
"""Bisections between the last free pose and the pose at entry: 6e-8 of their distance; and most parts of that
way that are tested in turn."""


@kernel
def remove_overlap(world):
    """Remove all overlap of drivers with fixed and driven bodies; simulated ones meet them in their own loop.

    Two overlapping drivers move by half of the depth each; the later one resolves the rest. If one is stuck
    then (pushed into a wall by the other), all drivers return to their last free poses. Each in turn then
    takes its pose at entry and resolves all overlap with the others; its way back stays free. A driver that
    stays in overlap is counted in `gave_up`.
    """
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    for d in range(len(drivers)):
        store_entry(joints, drivers[d])
    if len(drivers) > 1:
        _part_drivers(world)
    all_free = True
    for d in range(len(drivers)):
        free = _free_driver(world, d, 0.0)
        drivers[d]["is_free"] = free
        all_free = all_free and free
    if not all_free and len(drivers) > 1:
        for d in range(len(drivers)):
            interpolate(bodies, joints, drivers[d], PART_WHOLE, 0.0)
        for d in range(len(drivers)):
            interpolate(bodies, joints, drivers[d], PART_WHOLE, 1.0)
            drivers[d]["is_free"] = _free_driver(world, d, 1.0)
    for d in range(len(drivers)):
        if drivers[d]["is_free"] == 1:
            store_free_pose(bodies, joints, drivers[d])
        else:
            state["counters"][COUNT_GAVE_UP] += 1


@kernel
def _part_drivers(world):
    """One simultaneous round of Eq. 1 for overlap between drivers: each resolves half of the depths;
    prescribed ones stay on their paths."""
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    shift = state["shift"]
    for d in range(len(drivers)):
        pose_links(bodies, joints, drivers[d])
    end, _ = detect(world, DRIVEN, 0)
    for k in range(end):
        both = bodies[pairs[k]["body_a"]]["driver"] >= 0 and bodies[pairs[k]["body_b"]]["driver"] >= 0
        pairs[k]["depth"] *= 0.5 if both else 0.0
    for d in range(len(drivers)):
        deepest, _ = global_depth(bodies, pairs, 0, end, Mover(MOVER_TRUNK, d), shift)
        if not is_free(deepest) and drivers[d]["prescribed"] == 0:
            state["counters"][COUNT_ROUNDS] += 1
            for i in range(3):
                drivers[d]["position"][i] += shift[i]
            pose_links(bodies, joints, drivers[d])


@kernel
def _free_driver(world, d, later):
    """Remove the overlap of driver d, or else take the way back, which is counted; poses its links.

    Translation frees the links outside chains, then the posture QP frees the chains. The whole driver
    translates to resolve what the chains cannot. A motion that leads through an obstacle is cut short, and
    becomes the pose at entry of the way back.

    Args:
        later: share of its overlap with drivers processed later that this driver resolves, 0 or 1 [1].
    Returns:
        Whether it is free; if not, it is at its last free pose, or at its pose at entry if it has none.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    if drivers[d]["prescribed"] == 1:
        pose_moved(bodies, joints, drivers[d])
        return True
    mover = Mover(MOVER_TRUNK, d)
    end, free = _translate(world, d, mover, later)
    if free and drivers[d]["chain_count"] > 0:
        shuffle_chains(drivers[d], state)
        end = free_chains(world, d, later, end)
        if not is_free(largest_depth(bodies, pairs, end, d)):
            mover = Mover(MOVER_DRIVER, d)
            end, _ = _translate(world, d, mover, later)
            free = is_free(largest_depth(bodies, pairs, end, d))
    if free and state["detection"] != DETECTION_DISCRETE and _is_moved_far(bodies, joints, drivers[d], state):
        free = not stop_deep(world, d)
        store_entry(joints, drivers[d])
        end = detect_for(world, d, later)
    if not free:
        if not _way_back(world, d, later):
            return False
        state["counters"][COUNT_WAY_BACK] += 1
        mover = Mover(MOVER_DRIVER, d)
        end = detect_for(world, d, later)
    _stop_at_obstacles(bodies, drivers, pairs, end, d, mover)
    return True


@kernel
def _translate(world, d, mover, later):
    """Translate driver d until `mover`, all its links or those outside chains, is free; poses the links.

    Returns:
        (end, free): index after the last pair, and whether `mover` is free.
    """
    bodies, joints, pairs, state = world.bodies, world.joints, world.pairs, world.state
    driver, shift = world.drivers[d], state["shift"]
    previous, marked, first = 0.0, 0, 0.0
    for rounds in range(REMOVAL_ROUNDS + 1):
        pose_moved(bodies, joints, driver)
        end = detect_for(world, d, later)
        if state["removal"] == REMOVAL_LEAST_MOTION:
            deepest, size = min_norm_translation(bodies, pairs, 0, end, mover, state["planes"], shift)
        else:
            deepest, size = global_depth(bodies, pairs, 0, end, mover, shift)
        if is_free(deepest):
            return end, True
        # stop if opposing normals cancel or give a huge translation, or if the depth falls too slowly
        stalled = rounds - marked == STALL_ROUNDS and deepest > STALL_FALL * previous
        opposing = size < VANISHING_SHIFT * deepest or size > LONGEST_SHIFT * deepest
        if rounds == REMOVAL_ROUNDS:
            state["counters"][CAP_TRANSLATION_ROUNDS] += 1
        if opposing or stalled or rounds == REMOVAL_ROUNDS:
            break
        if rounds == 0 or rounds - marked == STALL_ROUNDS:
            previous, marked = deepest, rounds
        state["counters"][COUNT_ROUNDS] += 1
        for i in range(3):
            driver["position"][i] += shift[i]
        if rounds == 0:
            first = deepest
        if state["detection"] != DETECTION_DISCRETE and _is_detour(driver, first):
            break
    return end, False


@kernel
def _is_moved_far(bodies, joints, driver, state):
    """Whether the removal moved a driver that is then far from its last free pose: only its motion before the
    removal was swept."""
    if driver["has_free"] == 0:
        return False
    moved = False
    for i in range(3):
        moved = moved or driver["position"][i] != driver["entry_position"][i]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        moved = moved or joints[k]["angle"] != joints[k]["entry_angle"]
    return moved and spans(bodies, joints, driver, state["least_width"]) > 1


@kernel
def _is_detour(driver, deepest):
    """Whether a driver's translation since entry is longer than its way back and DETOUR times the depth.

    It may then lead through other bodies: only the motion before the removal was swept.
    """
    back = away = 0.0
    for i in range(3):
        back += (driver["entry_position"][i] - driver["free_position"][i]) ** 2
        away += (driver["entry_position"][i] - driver["position"][i]) ** 2
    return driver["has_free"] == 1 and sqrt(away) > sqrt(back) + DETOUR * deepest


@kernel
def _way_back(world, d, later):
    """Return to the last free pose, then move towards the pose at entry as far as is free: first the links
    outside chains, then each chain.

    Returns:
        Whether the driver is free; if not, it is at its last free pose, where nothing fixed is, or at its
        pose at entry if it has none.
    """
    driver = world.drivers[d]
    if driver["has_free"] == 0:
        interpolate(world.bodies, world.joints, driver, PART_WHOLE, 1.0)
    elif _free_at(world, d, later, PART_WHOLE, 0.0):
        _bisect(world, d, later, PART_ROOT)
        for i in range(driver["chain_count"]):
            _bisect(world, d, later, driver["order"][i])
        return True
    detect(world, DRIVEN, 0)
    return False


@kernel
def _bisect(world, d, later, part):
    """Move one part of driver d from its last free pose (t = 0) towards its pose at entry (t = 1) as far as
    is free, with the other parts fixed: in steps that lead through nothing, the last of them bisected."""
    driver, free, blocked = world.drivers[d], 0.0, 0.0
    interpolate(world.bodies, world.joints, driver, part, 1.0)
    way = spans(world.bodies, world.joints, driver, world.state["least_width"])
    steps = 1 + int(min(way, WAY_BACK_PARTS - 1))
    while free == blocked:
        if free == 1:
            return
        blocked = min(free + 1 / steps, 1.0)
        if _free_at(world, d, later, part, blocked):
            free = blocked
    for _ in range(WAY_BACK_STEPS):
        middle = (free + blocked) / 2
        if _free_at(world, d, later, part, middle):
            free = middle
        else:
            blocked = middle
    interpolate(world.bodies, world.joints, driver, part, free)


@kernel
def _free_at(world, d, later, part, t):
    """Whether driver d is free if one of its parts is at t of the way to its pose at entry."""
    interpolate(world.bodies, world.joints, world.drivers[d], part, t)
    end = detect_for(world, d, later)
    return is_free(largest_depth(world.bodies, world.pairs, end, d))


@kernel
def _stop_at_obstacles(bodies, drivers, pairs, end, d, mover):
    """Remove the component of driver d's coupling velocity that points into an obstacle touched by `mover`;
    two drivers share it. Pairs with later drivers wait for the later driver."""
    v = drivers[d]["velocity"]
    for k in range(end):
        pair = pairs[k]
        sign = side_of(bodies, pair, mover)
        other = bodies[pair["body_a"] if sign > 0 else pair["body_b"]]
        if sign == 0.0 or other["driver"] > d:
            continue
        n = pair["normal"]
        outward = sign * (v[0] * n[0] + v[1] * n[1] + v[2] * n[2])
        w = drivers[max(other["driver"], 0)]["velocity"]
        share = 1.0
        if other["driver"] >= 0:
            share = 0.5
            outward -= sign * (w[0] * n[0] + w[1] * n[1] + w[2] * n[2])
        if outward < 0:
            for i in range(3):
                v[i] -= share * sign * outward * n[i]
                if other["driver"] >= 0:
                    w[i] += share * sign * outward * n[i]

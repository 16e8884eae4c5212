"""The driven loop: a driven body is freed of overlap by translation, or goes back to its last free pose."""

from reference_impl.conventions import (
    COUNT_GAVE_UP,
    COUNT_ROUNDS,
    COUNT_WAY_BACK,
    DRIVEN,
    FIXED,
    REMOVAL_ROUNDS,
    SIMULATED,
    STALL_FALL,
    STALL_ROUNDS,
    VANISHING_SHIFT,
    WAY_BACK_STEPS,
)
from reference_impl.detection import detect, is_free, place_pieces
from reference_impl.global_depth import global_depth, is_mover
from reference_impl.kernel import kernel
from reference_impl.rotation import rotation_between, turn
from reference_impl.skeleton import place, pose_links


@kernel
def remove_overlap(bodies, pieces, joints, drivers, vertices, pairs, state, d):
    """Free driver d of overlap with fixed and simulated bodies (method, section 3); its links are posed.

    Returns:
        Whether it is free. Way back and giving up are counted.
    """
    driver, mover = drivers[d], -1 - d
    _store_entry(joints, driver)
    shift = state["shift"]
    previous, marked = 0.0, 0
    for rounds in range(REMOVAL_ROUNDS + 1):
        pose_links(bodies, joints, driver)
        end, _ = detect(bodies, pieces, vertices, pairs, state, DRIVEN, 0)
        deepest, size = global_depth(bodies, pairs, 0, end, mover, shift)
        if is_free(deepest):
            _stop_at_obstacles(bodies, pairs, end, driver, mover)
            return True
        # opposing normals cancel, or the depth falls too slowly
        stalled = rounds - marked == STALL_ROUNDS and deepest > STALL_FALL * previous
        if size < VANISHING_SHIFT * deepest or stalled or rounds == REMOVAL_ROUNDS:
            break
        if rounds == 0 or rounds - marked == STALL_ROUNDS:
            previous, marked = deepest, rounds
        state["counters"][COUNT_ROUNDS] += 1
        for i in range(3):
            driver["position"][i] += shift[i]
    if _way_back(bodies, pieces, joints, drivers, vertices, pairs, state, d):
        state["counters"][COUNT_WAY_BACK] += 1
        end, _ = detect(bodies, pieces, vertices, pairs, state, DRIVEN, 0)
        _stop_at_obstacles(bodies, pairs, end, driver, mover)
        return True
    state["counters"][COUNT_GAVE_UP] += 1
    _yield_simulated(bodies, pieces, vertices, pairs, state, mover)
    return False


@kernel
def _store_entry(joints, driver):
    driver["entry_position"][:] = driver["position"]
    driver["entry_orientation"][:] = driver["orientation"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["entry_angle"] = joints[k]["angle"]


@kernel
def store_free_pose(joints, driver):
    """Remember the shown pose as the last free one."""
    driver["free_position"][:] = driver["position"]
    driver["free_orientation"][:] = driver["orientation"]
    driver["has_free"] = 1
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["free_angle"] = joints[k]["angle"]


@kernel
def _way_back(bodies, pieces, joints, drivers, vertices, pairs, state, d):
    """Bisect between the last free pose (t = 0) and the pose at entry (t = 1); keeps the free end.

    Returns:
        Whether the driver is free; if not, it stands at its pose at entry.
    """
    driver = drivers[d]
    if driver["has_free"] == 0 or not _free_at(
        bodies, pieces, joints, drivers, vertices, pairs, state, d, 0.0
    ):
        _interpolate(joints, driver, 1.0)
        pose_links(bodies, joints, driver)
        detect(bodies, pieces, vertices, pairs, state, DRIVEN, 0)
        return False
    free, blocked = 0.0, 1.0
    for _ in range(WAY_BACK_STEPS):
        middle = (free + blocked) / 2
        if _free_at(bodies, pieces, joints, drivers, vertices, pairs, state, d, middle):
            free = middle
        else:
            blocked = middle
    _free_at(bodies, pieces, joints, drivers, vertices, pairs, state, d, free)
    return True


@kernel
def _free_at(bodies, pieces, joints, drivers, vertices, pairs, state, d, t):
    driver = drivers[d]
    _interpolate(joints, driver, t)
    pose_links(bodies, joints, driver)
    end, _ = detect(bodies, pieces, vertices, pairs, state, DRIVEN, 0)
    deepest, _ = global_depth(bodies, pairs, 0, end, -1 - d, state["shift"])
    return is_free(deepest)


@kernel
def _interpolate(joints, driver, t):
    """Pose at t between the last free one (0) and that at entry (1): linear, orientation by slerp."""
    turned = driver["scratch"][0]
    for i in range(3):
        driver["position"][i] = (1 - t) * driver["free_position"][i] + t * driver["entry_position"][i]
    rotation_between(driver["free_orientation"], driver["entry_orientation"], turned)
    turn(driver["free_orientation"], t * turned[0], t * turned[1], t * turned[2], driver["orientation"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["angle"] = (1 - t) * joints[k]["free_angle"] + t * joints[k]["entry_angle"]


@kernel
def _stop_at_obstacles(bodies, pairs, end, driver, mover):
    """Take out the coupling velocity that points into a fixed obstacle. (A simulated one is met by an
    impulse, which needs that velocity.)"""
    for k in range(end):
        pair = pairs[k]
        sign = 0.0
        if is_mover(bodies, pair["body_b"], mover) and bodies[pair["body_a"]]["kind"] == FIXED:
            sign = 1.0
        elif is_mover(bodies, pair["body_a"], mover) and bodies[pair["body_b"]]["kind"] == FIXED:
            sign = -1.0
        n = pair["normal"]
        v = driver["velocity"]
        outward = sign * (v[0] * n[0] + v[1] * n[1] + v[2] * n[2])
        if outward < 0:
            for i in range(3):
                v[i] -= sign * outward * n[i]


@kernel
def _yield_simulated(bodies, pieces, vertices, pairs, state, mover):
    """Move simulated bodies out of a driver that gave up, unless they would then overlap a fixed one."""
    shift = state["shift"]
    for b in range(len(bodies)):
        if bodies[b]["kind"] != SIMULATED:
            continue
        end, _ = detect(bodies, pieces, vertices, pairs, state, DRIVEN, 0)
        for k in range(end):
            if not (
                is_mover(bodies, pairs[k]["body_a"], mover) or is_mover(bodies, pairs[k]["body_b"], mover)
            ):
                pairs[k]["distance"] = 0.0
        deepest, _ = global_depth(bodies, pairs, 0, end, b, shift)
        if is_free(deepest):
            continue
        move(bodies[b], shift, 1.0)
        end, _ = detect(bodies, pieces, vertices, pairs, state, SIMULATED, 0)
        for k in range(end):
            pair = pairs[k]
            one, two = bodies[pair["body_a"]]["kind"], bodies[pair["body_b"]]["kind"]
            meets = pair["body_a"] == b or pair["body_b"] == b
            if meets and (one == FIXED or two == FIXED) and not is_free(-pair["distance"]):
                move(bodies[b], shift, -1.0)
                place_pieces(bodies, pieces, vertices, SIMULATED)
                break


@kernel
def move(body, shift, share):
    """Translate a body by a share of `shift`."""
    for i in range(3):
        body["position"][i] += share * shift[i]
    place(body)


@kernel
def part_simulated(bodies, pieces, vertices, pairs, state):
    """Eq. 1 for simulated bodies that sank into each other or into fixed ones while their contact held.

    A simulated body moves in full against fixed and driven ones, by half against its like.
    """
    shift = state["shift"]
    for _ in range(REMOVAL_ROUNDS):
        end, deepest = detect(bodies, pieces, vertices, pairs, state, SIMULATED, 0)
        if is_free(deepest):
            return True
        state["counters"][COUNT_ROUNDS] += 1
        for b in range(len(bodies)):
            if bodies[b]["kind"] != SIMULATED:
                continue
            _, size = global_depth(bodies, pairs, 0, end, b, shift)
            if size > 0:
                move(bodies[b], shift, _share(bodies, pairs, end, b))
    place_pieces(bodies, pieces, vertices, SIMULATED)
    state["counters"][COUNT_GAVE_UP] += 1
    return False


@kernel
def _share(bodies, pairs, end, b):
    """Half when every body that b overlaps is simulated too, else all."""
    for k in range(end):
        pair = pairs[k]
        if pair["distance"] < 0 and (pair["body_a"] == b or pair["body_b"] == b):
            other = pair["body_b"] if pair["body_a"] == b else pair["body_a"]
            if bodies[other]["kind"] != SIMULATED:
                return 1.0
    return 0.5

"""The links of chains are freed of overlap by inverse kinematics (method, section 4)."""

from reference_impl.accurate_ik import next_random
from reference_impl.ccd_ik import ccd_ik, distance, pose_angles
from reference_impl.conventions import (
    BEND,
    CHAIN_PASSES,
    CHAIN_ROUNDS,
    CHAIN_TOLERANCE,
    COUNT_IK_ITERATIONS,
    COUNT_IK_JOINTS,
    COUNT_IK_ROUNDS,
    STRETCHED,
)
from reference_impl.detection import detect_for, is_free
from reference_impl.kernel import kernel
from reference_impl.skeleton import pose_links


@kernel
def shuffle_chains(driver, state):
    """Draw the order in which this frame frees a driver's chains (Fisher and Yates)."""
    order, count = driver["order"], driver["chain_count"]
    for i in range(count):
        order[i] = i
    for i in range(count - 1, 0, -1):
        j = int(next_random(state) * (i + 1))
        order[i], order[j] = order[j], order[i]
    for i in range(count):
        driver["rank"][order[i]] = i


@kernel
def free_chains(bodies, pieces, joints, drivers, vertices, pairs, state, d, later, end):
    """Bring the chains of driver d out of overlap, one after the other; links are posed.

    Args:
        later: as in `detect_for`.
        end: `pairs[:end]` were detected as the links are posed now.
    Returns:
        Index after the last pair of the last detection; whether all chains came free is for its pairs to say.
    """
    driver = drivers[d]
    for i in range(driver["chain_count"]):
        chain = driver["order"][i]
        for rounds in range(CHAIN_ROUNDS):
            link = _innermost(bodies, pairs, end, driver, d, chain, rounds)
            if link < 0:
                break
            state["counters"][COUNT_IK_ROUNDS] += 1
            first = _aim(bodies, pairs, end, driver, d, chain, rounds, link, state)
            _reach(bodies, joints, first, link, state)
            pose_links(bodies, joints, driver)
            end = detect_for(bodies, pieces, vertices, pairs, state, d, later)
    return end


@kernel
def _innermost(bodies, pairs, end, driver, d, chain, rounds):
    """Hinge of the chain's overlapping link that is closest to the root, or -1."""
    link = -1
    for k in range(end):
        side, depth = chain_depth(bodies, pairs[k], driver, d, chain, rounds)
        if side == 0.0 or is_free(depth):
            continue
        hinge = bodies[pairs[k]["body_b"] if side > 0 else pairs[k]["body_a"]]["hinge"]
        if link < 0 or hinge < link:
            link = hinge
    return link


@kernel
def chain_depth(bodies, pair, driver, d, chain, rounds):
    """Which side of a pair a chain moves, and by how much.

    Of two links of the chain the outer one moves. Of overlap with a chain whose turn comes later half counts,
    in the first round alone: the other half is the later one's.

    Returns:
        (side, depth): 1.0 for B, -1.0 for A or 0.0 for none, and the depth that counts [m].
    """
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    at_a, at_b = a["driver"] == d and a["chain"] == chain, b["driver"] == d and b["chain"] == chain
    if not at_a and not at_b:
        return 0.0, 0.0
    if at_a and at_b:
        return 1.0 if b["hinge"] > a["hinge"] else -1.0, -pair["distance"]
    side, other = (1.0, a) if at_b else (-1.0, b)
    share = 1.0
    if other["driver"] == d and other["chain"] >= 0:
        if driver["rank"][other["chain"]] > driver["rank"][chain]:
            share = 0.5 if rounds == 0 else 0.0
    return side, -share * pair["distance"]


@kernel
def _aim(bodies, pairs, end, driver, d, chain, rounds, link, state):
    """End effector (Eq. 2: mean of the contact points on the link's own surface) and goal (Eq. 3) of the link
    beyond hinge `link`, to `state`.

    Returns:
        The first hinge to turn: the chain's, or the one beyond the outermost of its links that is in the way.
    """
    point, goal, first = state["point"], state["goal"], driver["chains"][chain, 0]
    for i in range(3):
        point[i] = goal[i] = 0.0
    count, total = 0, 0.0
    for k in range(end):
        pair = pairs[k]
        side, depth = chain_depth(bodies, pair, driver, d, chain, rounds)
        mine = bodies[pair["body_b"] if side > 0 else pair["body_a"]]
        if side == 0.0 or depth <= 0 or mine["hinge"] != link:
            continue
        other = bodies[pair["body_a"] if side > 0 else pair["body_b"]]
        if other["driver"] == d and other["chain"] == chain:
            first = max(first, other["hinge"] + 1)
        count += 1
        total += depth
        witness = pair["point_b"] if side > 0 else pair["point_a"]
        for i in range(3):
            point[i] += witness[i]
            goal[i] += side * depth * depth * pair["normal"][i]
    for i in range(3):
        point[i] /= count
        goal[i] = point[i] + goal[i] / total
    return first


@kernel
def _reach(bodies, joints, first, last, state):
    """Bring the end effector to its goal; where a stretched chain cannot, it is bent and tries once more."""
    point, goal, counters = state["point"], state["goal"], state["counters"]
    wanted = distance(point, goal)
    for attempt in range(2):
        passes, left, _ = ccd_ik(
            *(bodies, joints, first, last, point, goal, state["angle"], state["passes"]),
            *(CHAIN_TOLERANCE, CHAIN_PASSES),
        )
        counters[COUNT_IK_ITERATIONS] += passes
        counters[COUNT_IK_JOINTS] += last + 1 - first
        if attempt == 1 or left <= STRETCHED * wanted or not _bend(joints, first, last):
            break
        pose_angles(bodies, joints, first, last, point)


@kernel
def _bend(joints, first, last):
    """Turn hinges that belong to no ball joint a little towards the middle of their range; returns whether
    there were any."""
    k, bent = first, False
    while k <= last:
        if joints[k]["cone_count"] > 0:
            k += 3
            continue
        middle = (joints[k]["lower"] + joints[k]["upper"]) / 2
        joints[k]["angle"] += BEND * (middle - joints[k]["angle"])
        k, bent = k + 1, True
    return bent

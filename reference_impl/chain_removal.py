"""Links of chains are freed of overlap, by inverse kinematics or by the least turn (method, section 4)."""

from reference_impl.accurate_ik import next_random
from reference_impl.chain_depth import chain_depth
from reference_impl.chain_reach import aim, bend, bring_out
from reference_impl.conventions import (
    BEND_ROUNDS,
    CHAIN_ROUNDS,
    COUNT_IK_ITERATIONS,
    COUNT_IK_JOINTS,
    COUNT_IK_ROUNDS,
    OVERLAP_TOLERANCE,
    POSTURE_LEAST_TURN,
    STRETCHED,
    TURN_TOLERANCE,
)
from reference_impl.detection import detect_for
from reference_impl.kernel import kernel
from reference_impl.least_turn import least_turn
from reference_impl.skeleton import pose_chain_links


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
    # the least turn converges fast; passes of inverse kinematics do not
    enough = TURN_TOLERANCE if state["posture"] == POSTURE_LEAST_TURN else OVERLAP_TOLERANCE
    for i in range(driver["chain_count"]):
        chain = driver["order"][i]
        for rounds in range(CHAIN_ROUNDS):
            link = _innermost(bodies, pairs, end, driver, d, chain, rounds, enough)
            if link < 0:
                break
            state["counters"][COUNT_IK_ROUNDS] += 1
            if state["posture"] == POSTURE_LEAST_TURN:
                _turn_all(bodies, joints, pairs, end, driver, d, chain, rounds, state)
            else:
                first = aim(bodies, pairs, end, driver, d, chain, rounds, link, state)
                bring_out(bodies, joints, first, link, rounds, state)
            pose_chain_links(bodies, joints, driver, chain)
            end = detect_for(bodies, pieces, vertices, pairs, state, d, later)
    return end


@kernel
def _turn_all(bodies, joints, pairs, end, driver, d, chain, rounds, state):
    """Turn a chain by the least that frees all its links; a stretched one is bent."""
    first, last = driver["chains"][chain, 0], driver["chains"][chain, 1]
    state["counters"][COUNT_IK_ITERATIONS] += 1
    state["counters"][COUNT_IK_JOINTS] += last + 1 - first
    missed = least_turn(bodies, joints, pairs, end, driver, d, chain, rounds, state)
    if missed > STRETCHED and rounds < BEND_ROUNDS:
        bend(joints, first, last)


@kernel
def _innermost(bodies, pairs, end, driver, d, chain, rounds, enough):
    """Hinge of the chain's link deeper than `enough` [m] that is closest to the root, or -1."""
    link = -1
    for k in range(end):
        side, depth = chain_depth(bodies, pairs[k], driver, d, chain, rounds)
        if side == 0.0 or depth <= enough:
            continue
        hinge = bodies[pairs[k]["body_b"] if side > 0 else pairs[k]["body_a"]]["hinge"]
        if link < 0 or hinge < link:
            link = hinge
    return link

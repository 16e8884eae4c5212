"""Overlap removal for chains, by inverse kinematics or by the posture QP (method, section 4)."""

from touchstone.reference_impl.broad_phase.detection import detect_for
from touchstone.reference_impl.core.conventions import (
    BEND_ROUNDS,
    CHAIN_ROUNDS,
    OVERLAP_TOLERANCE,
    POSTURE_LEAST_TURN,
    QP_TOLERANCE,
    QP_TURN_MAX,
    RANDOM_PRIME,
    STRETCHED_SHARE,
)
from touchstone.reference_impl.core.counters import CAP_CHAIN_ROUNDS, COUNT_IK_ROUNDS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.skeleton import pose_chain_links, pose_moved
from touchstone.reference_impl.posture.chain_overlap_depth import chain_depth
from touchstone.reference_impl.posture.chain_overlap_ik import aim, bend, bring_out
from touchstone.reference_impl.posture.posture_constraints import chains_depth, gather_constraints
from touchstone.reference_impl.posture.posture_qp import apply_turns, missed_share, solve_posture_qp


@kernel
def next_random(state):
    """Random number in (0, 1) by the generator of Park and Miller (1988), which fits 64-bit integers."""
    state["random"] = 16807 * state["random"] % RANDOM_PRIME
    return state["random"] / RANDOM_PRIME


@kernel
def shuffle_chains(driver, state):
    """Draw the random order in which this frame processes a driver's chains (Fisher and Yates)."""
    order, count = driver["order"], driver["chain_count"]
    for i in range(count):
        order[i] = i
    for i in range(count - 1, 0, -1):
        j = int(next_random(state) * (i + 1))
        order[i], order[j] = order[j], order[i]
    for i in range(count):
        driver["rank"][order[i]] = i


@kernel
def free_chains(world, d, later, end):
    """Remove overlap of driver d's chains, one after the other by inverse kinematics or all at once by the
    posture QP; poses the links.

    Args:
        later: as in `detect_for`.
        end: `pairs[:end]` are the pairs at the links' current poses.
    Returns:
        Index after the last pair of the last detection. The chains are free if these pairs have no depth.
    """
    bodies, joints, state, driver = world.bodies, world.joints, world.state, world.drivers[d]
    if state["posture"] == POSTURE_LEAST_TURN:
        return _turn_out(world, d, later, end)
    for i in range(driver["chain_count"]):
        chain = driver["order"][i]
        for rounds in range(CHAIN_ROUNDS + 1):
            link = _innermost(bodies, world.pairs, end, driver, d, chain, rounds)
            if link < 0:
                break
            if rounds == CHAIN_ROUNDS:
                state["counters"][CAP_CHAIN_ROUNDS] += 1
                break
            state["counters"][COUNT_IK_ROUNDS] += 1
            first = aim(world, end, d, chain, rounds, link)
            bring_out(bodies, joints, first, link, rounds, state)
            pose_chain_links(bodies, joints, driver, chain)
            end = detect_for(world, d, later)
    return end


@kernel
def _turn_out(world, d, later, end):
    """Remove overlap of all chains by successive posture QPs; bend stretched chains."""
    bodies, joints, pairs, state = world.bodies, world.joints, world.pairs, world.state
    driver = world.drivers[d]
    for rounds in range(CHAIN_ROUNDS):
        gather_constraints(bodies, pairs, end, driver, d, state)
        # a tighter tolerance than OVERLAP_TOLERANCE: the QP converges fast, unlike passes of IK
        if chains_depth(bodies, pairs, end, d) <= QP_TOLERANCE:
            break
        for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
            joints[k]["pass_turn"] = 0.0
        solve_posture_qp(bodies, joints, driver, False, True, state)
        state["counters"][COUNT_IK_ROUNDS] += 1
        for i in range(driver["chain_count"]):
            first, last = driver["chains"][i, 0], driver["chains"][i, 1]
            if rounds < BEND_ROUNDS and missed_share(joints, first, last, driver) > STRETCHED_SHARE:
                bend(joints, first, last)
        apply_turns(joints, driver, 1.0, QP_TURN_MAX)
        pose_moved(bodies, joints, driver)
        end = detect_for(world, d, later)
        if rounds == CHAIN_ROUNDS - 1 and chains_depth(bodies, pairs, end, d) > QP_TOLERANCE:
            state["counters"][CAP_CHAIN_ROUNDS] += 1
    return end


@kernel
def _innermost(bodies, pairs, end, driver, d, chain, rounds):
    """Hinge of the overlapping link of a chain that is closest to the root, or -1."""
    link = -1
    for k in range(end):
        side, depth = chain_depth(bodies, pairs[k], driver, d, chain, rounds)
        if side == 0.0 or depth <= OVERLAP_TOLERANCE:
            continue
        hinge = bodies[pairs[k]["body_b"] if side > 0 else pairs[k]["body_a"]]["hinge"]
        if link < 0 or hinge < link:
            link = hinge
    return link

"""Overlap removal for chains by the posture QP."""

from touchstone.reference_impl.broad_phase.detection import detect_for
from touchstone.reference_impl.core.conventions import QP_TOLERANCE
from touchstone.reference_impl.core.counters import CAP_CHAIN_ROUNDS, COUNT_IK_ROUNDS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.skeleton import pose_moved
from touchstone.reference_impl.posture.posture_constraints import chains_depth, gather_constraints
from touchstone.reference_impl.posture.posture_qp import apply_turns, missed_share, solve_posture_qp

CHAIN_ROUNDS = 16
"""Most posture QPs, each at the poses that the last one reached."""
STRETCHED_SHARE = 0.5
"""Share of its largest depth that a QP may leave before a chain is bent [1]."""
BEND_SHARE = 0.05
"""Fraction of the angle to the middle of its range by which a hinge is bent [1]: 4 degrees for an elbow."""
BEND_ROUNDS = 4
"""Rounds in which a chain is bent: a straight leg is 3 mm too long after one, 20 mm after four."""
QP_TURN_MAX = 0.2
"""Largest rotation of a hinge in one round [rad]: the linearisation error is 2 % of it."""


@kernel
def free_chains(world, d, later, end):
    """Remove overlap of driver d's chains by successive posture QPs; bend stretched chains; pose the links.

    Args:
        later: as in `detect_for`.
        end: `pairs[:end]` are the pairs at the links' current poses.
    Returns:
        Index after the last pair of the last detection. The chains are free if these pairs have no depth.
    """
    bodies, joints, pairs, state = world.bodies, world.joints, world.pairs, world.state
    driver = world.drivers[d]
    for rounds in range(CHAIN_ROUNDS):
        gather_constraints(bodies, pairs, end, driver, d, state)
        # a tighter tolerance than OVERLAP_TOLERANCE: the QP converges fast
        if chains_depth(bodies, pairs, end, d) <= QP_TOLERANCE:
            break
        for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
            joints[k]["pass_turn"] = 0.0
        solve_posture_qp(bodies, joints, driver, False, True, state)
        state["counters"][COUNT_IK_ROUNDS] += 1
        for i in range(driver["chain_count"]):
            first, last = driver["chains"][i, 0], driver["chains"][i, 1]
            if rounds < BEND_ROUNDS and missed_share(joints, first, last, driver) > STRETCHED_SHARE:
                _bend(joints, first, last)
        apply_turns(joints, driver, 1.0, QP_TURN_MAX)
        pose_moved(bodies, joints, driver)
        end = detect_for(world, d, later)
        if rounds == CHAIN_ROUNDS - 1 and chains_depth(bodies, pairs, end, d) > QP_TOLERANCE:
            state["counters"][CAP_CHAIN_ROUNDS] += 1
    return end


@kernel
def _bend(joints, first, last):
    """Turn each hinge outside ball joints by BEND_SHARE towards the middle of its range."""
    k = first
    while k <= last:
        if joints[k]["cone_count"] > 0:
            k += 3
            continue
        middle = (joints[k]["lower"] + joints[k]["upper"]) / 2
        joints[k]["angle"] += BEND_SHARE * (middle - joints[k]["angle"])
        k += 1

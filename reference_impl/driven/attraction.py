"""Attraction of a driven body's hinges to its tracker's (coach and trainee; method, section 4).

In every frame chains go from the posture shown towards a goal, the tracker's posture or, with a lag tau, that
share of the way which 1 - exp(-h / tau) is. By `POSTURE_CCD` they go there and are brought out of overlap
afterwards. By `POSTURE_LEAST_TURN` the way is projected on what the chains touch already, part by part: a
limb that is held off its tracker slides along its obstacle and is never sent deep into it.

Of a convex set the nearest point moves no farther than what it is nearest to. Free postures are not convex,
and the nearest jumps where a hand's edge passes another's: no hinge turns by more than the tracker's posture
as a whole, or by what a lag of ATTRACTION_TIME would turn it.
"""

from math import exp, inf, sqrt

from touchstone.reference_impl.chains.posture_constraints import drop_constraints
from touchstone.reference_impl.chains.posture_qp import apply_turns, solve_posture_qp
from touchstone.reference_impl.core.conventions import (
    ATTRACTION_MOST,
    ATTRACTION_SETTLED,
    ATTRACTION_TIME,
    ATTRACTION_TURN,
    POSTURE_LEAST_TURN,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.driven.skeleton import pose_moved


@kernel
def set_goals(joints, driver, h, lag):
    """Pose a hand's hinges as the glove shows them, with their rates; set where those of chains are to be
    after a frame of length h, and how far one may turn in it."""
    share = 1 - exp(-h / lag) if lag > 0 else 1.0
    slow = 1 - exp(-h / ATTRACTION_TIME)
    apart = moved = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["chain"] < 0:
            joint["angle"] = joint["target_angle"]
            joint["rate"] = joint["target_rate"]
        else:
            goal = joint["angle"] + share * (joint["target_angle"] - joint["angle"])
            joint["goal_angle"] = min(max(goal, joint["lower"]), joint["upper"])
            apart += (joint["target_angle"] - joint["angle"]) ** 2
            moved += (joint["target_angle"] - joint["last_target_angle"]) ** 2
            joint["last_target_angle"] = joint["target_angle"]
    driver["stride"] = max(slow * sqrt(apart), sqrt(moved))


@kernel
def approach(bodies, joints, driver, state, part):
    """Turn chains towards the frame's goals, in part `part` of the frame; links wait for `pose_links`.

    Returns:
        Whether a way is left to go.
    """
    if driver["chain_count"] == 0:
        return False
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["pass_turn"] = joints[k]["goal_angle"] - joints[k]["angle"]
    projected = state["posture"] == POSTURE_LEAST_TURN
    if projected and part == 0:
        drop_constraints(driver, 1)
    if driver["constraint_count"] > 0:
        # the root has moved
        if part == 0:
            pose_moved(bodies, joints, driver)
        solve_posture_qp(bodies, joints, driver, True, state)
        drop_constraints(driver, 0)
    way = _longest_way(joints, driver)
    left = state["attraction_parts"] - part
    needed = 1 + int(min(way / ATTRACTION_TURN, 1e3))
    share = 1 / min(needed, left)
    if projected:
        _shorten(joints, driver, min(share, ATTRACTION_MOST / max(way, ATTRACTION_MOST)))
        share = 1.0
    apply_turns(joints, driver, share, inf)
    if left == 1 or (needed == 1 and driver["constraint_count"] == 0):
        return False
    turned = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        turned += abs(joints[k]["angle"] - joints[k]["last_angle"])
    return turned > ATTRACTION_SETTLED


@kernel
def _longest_way(joints, driver):
    """Largest turn of all hinges of a chain, within their limits [rad]."""
    most = 0.0
    for i in range(driver["chain_count"]):
        way = 0.0
        for k in range(driver["chains"][i, 0], driver["chains"][i, 1] + 1):
            joint = joints[k]
            wanted = joint["angle"] + joint["pass_turn"]
            way += abs(min(max(wanted, joint["lower"]), joint["upper"]) - joint["angle"])
        most = max(most, way)
    return most


@kernel
def _shorten(joints, driver, share):
    """Cut turns to a share of them, and to what is left of the frame's stride."""
    stride = driver["stride"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        so_far = joint["angle"] - joint["shown_angle"]
        least, most = min(-stride - so_far, 0.0), max(stride - so_far, 0.0)
        joint["pass_turn"] = min(max(share * joint["pass_turn"], least), most)

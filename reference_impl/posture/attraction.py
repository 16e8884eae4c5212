"""Attraction of a driven body's posture to its tracker's (coach and trainee).

Each frame moves the chains from the posture shown towards the tracker's posture. The posture QP projects each
part of the motion on the constraints of existing contacts: a limb that cannot reach its tracker slides along
the obstacle, without deep overlap.

Projection on a convex set moves no farther than the projected point. The set of free postures is not convex:
the nearest posture jumps, for example where the edge of one hand passes that of the other. The stride
therefore limits each hinge's turn in a frame to the norm of the turns of the tracker's posture or, if larger,
of a lag of ATTRACTION_TIME.
"""

from math import exp, inf, sqrt

from touchstone.reference_impl.continuous.hinge_motion import follow_servos
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.skeleton import pose_moved
from touchstone.reference_impl.posture.posture_constraints import drop_constraints
from touchstone.reference_impl.posture.posture_qp import apply_turns, solve_posture_qp

ATTRACTION_TIME = 0.1
"""Lag of an attraction whose turns are the least stride for a slow tracker [s]."""
ATTRACTION_TURN = 0.02
"""Rotation of all hinges of a chain in one part of the attraction [rad]: 14 mm at the end of an arm, half the
thickness of two hands."""
ATTRACTION_MOST = 0.04
"""Upper limit of that rotation, however few parts are left [rad]: the thickness of a hand."""
ATTRACTION_SETTLED = 1e-3
"""Rotation of all hinges in a part at which attraction ends [rad]: linearisation error 0.5e-6 m."""


@kernel
def set_goals(joints, driver, h):
    """Set the angles and rates of hinges outside chains to the tracker's (a hand's to the glove's), the goal
    angles of chains for a frame of length h [s], and the stride, the largest turn of a hinge in it."""
    slow = 1 - exp(-h / ATTRACTION_TIME)
    follow_servos(joints, driver, h)
    apart = moved = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["chain"] < 0:
            joint["angle"] = joint["target_angle"]
            joint["rate"] = joint["target_rate"]
        else:
            wanted = joint["target_angle"] + joint["offset"]
            joint["goal_angle"] = min(
                max(joint["angle"] + (wanted - joint["angle"]), joint["lower"]), joint["upper"]
            )
            apart += (wanted - joint["angle"]) ** 2
            bent = joint["offset"] - joint["old_offset"]
            moved += (joint["target_angle"] - joint["last_target_angle"] + bent) ** 2
            joint["last_target_angle"] = joint["target_angle"]
    driver["stride"] = max(slow * sqrt(apart), sqrt(moved))


@kernel
def approach(bodies, joints, driver, state, part):
    """Turn chains towards their goals, in part `part` of the frame; does not pose the links.

    Returns:
        Whether a further part is needed.
    """
    if driver["chain_count"] == 0:
        return False
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["pass_turn"] = joints[k]["goal_angle"] - joints[k]["angle"]
    if part == 0:
        drop_constraints(driver, True)
    if driver["constraint_count"] > 0:
        # the coupling has moved the root
        if part == 0:
            pose_moved(bodies, joints, driver)
        solve_posture_qp(bodies, joints, driver, True, True, state)
        drop_constraints(driver, False)
    way = _longest_way(joints, driver)
    left = state["attraction_parts"] - part
    needed = 1 + int(min(way / ATTRACTION_TURN, 1e3))
    share = 1 / min(needed, left)
    _shorten(joints, driver, min(share, ATTRACTION_MOST / max(way, ATTRACTION_MOST)))
    apply_turns(joints, driver, 1.0, inf)
    if left == 1 or (needed == 1 and driver["constraint_count"] == 0):
        return False
    turned = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        turned += abs(joints[k]["angle"] - joints[k]["last_angle"])
    return turned > ATTRACTION_SETTLED


@kernel
def _longest_way(joints, driver):
    """Largest sum of turns over the hinges of a chain, within their limits [rad]."""
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
    """Scale the turns by `share`, then clamp each to the remainder of the frame's stride."""
    stride = driver["stride"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        so_far = joint["angle"] - joint["shown_angle"]
        least, most = min(-stride - so_far, 0.0), max(stride - so_far, 0.0)
        joint["pass_turn"] = min(max(share * joint["pass_turn"], least), most)

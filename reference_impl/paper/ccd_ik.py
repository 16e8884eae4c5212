"""Inverse kinematics by cyclic coordinate descent (section "Geometric and Kinematic Overlap Avoidance").

Joint k has the unit axis a_k and the origin o_k. `ee` is the chain's end effector, `goal` where it should be.
"""

from math import acos

from touchstone.reference_impl.core.counters import CAP_CCD, COUNT_CCD_PASSES, COUNT_IK_JOINTS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import rotate
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cone
from touchstone.reference_impl.kinematics.skeleton import hang, measure_angle
from touchstone.reference_impl.paper.vectors import (
    add,
    cross,
    dot,
    length,
    scaled,
    sub,
    times,
    transposed_times,
    vector,
)

CCD_TOLERANCE = 2e-7
"""Distance of end effector and goal at which a chain has converged [m]: a fifth of the overlap tolerance."""
CCD_PASSES = 64
"""Most passes over the joints of a chain; about 10 are usual."""
CCD_PROGRESS = 1e-3
"""Share of the distance by which a pass must shorten it [1]: "or it was decided the minimum cannot be
reached"."""
LEVER_LEAST = 1e-9
"""Distance from a joint's axis below which a point has no direction about it [m]."""


@kernel
def ccd_ik(bodies, joints, first, last, state):
    """Turn joints `last` to `first`, "from the end effector inwards to the root", again and again until
    `state["point"]`, the end effector in the child of joint `last`, is at `state["goal"]` (both world [m]).

    On entry the links are posed. On return rotation and origin of the chain's links match the new angles, but
    not their centres and pieces: see `pose_links`.

    Returns:
        (passes, left): passes over the joints, and the distance from the goal that is left [m].
    """
    tip = bodies[joints[last]["child"]]
    goal = vector(state["goal"])
    # the end effector in the frame of its link
    local = transposed_times(tip["rotation"], sub(vector(state["point"]), vector(tip["position"])))
    state["counters"][COUNT_IK_JOINTS] += last + 1 - first
    ee = pose_chain(bodies, joints, first, last, local)
    left = length(sub(goal, ee))
    for passes in range(CCD_PASSES):
        if left <= CCD_TOLERANCE:
            return passes, left
        state["counters"][COUNT_CCD_PASSES] += 1
        before = left
        for k in range(last, first - 1, -1):
            # the axes and origins of joints further inwards do not move
            ee = turn_joint(joints[k], vector(bodies[joints[k]["child"]]["position"]), ee, goal)
            # the three hinges of a ball joint have turned, each within its limits
            if joints[k]["cone_count"] > 0 and keep_in_cone(joints, k):
                ee = pose_chain(bodies, joints, k, last, local)
        ee = pose_chain(bodies, joints, first, last, local)
        left = length(sub(goal, ee))
        if before - left < CCD_PROGRESS * before:
            return passes + 1, left
    state["counters"][CAP_CCD] += 1
    return CCD_PASSES, left


@kernel
def turn_joint(joint, o, ee, goal):
    """Turn one joint within its limits so that the end effector comes nearest to the goal.

    Returns:
        The end effector after that; the links are not posed.
    """
    a = vector(joint["world_axis"])
    joint["last_angle"] = joint["angle"]
    to_ee, to_goal = sub(project(ee, a, o), o), sub(project(goal, a, o), o)
    if length(to_ee) < LEVER_LEAST or length(to_goal) < LEVER_LEAST:
        return ee
    wanted = joint["angle"] + joint_rotation(to_ee, to_goal, a)
    joint["angle"] = min(max(wanted, joint["lower"]), joint["upper"])
    c_old, s_old = joint["cosine"], joint["sine"]
    measure_angle(joint)
    # cosine and sine of the rotation that the limits allow
    c = joint["cosine"] * c_old + joint["sine"] * s_old
    s = joint["sine"] * c_old - joint["cosine"] * s_old
    return add(sub(ee, to_ee), add(scaled(c, to_ee), scaled(s, cross(a, to_ee))))


@kernel
def project(p, a, o):
    """Eq. 4: p' = p - (a . (p - o)) a, the projection of a point on a joint's plane."""
    return sub(p, scaled(dot(a, sub(p, o)), a))


@kernel
def joint_rotation(to_ee, to_goal, a):
    """Eq. 5: phi = acos(ee' . goal'), of the directions from the joint's origin [rad].

    The paper leaves open the sign: positive about the axis a. Rounding may pass 1, where acos has no value.
    """
    cosine = dot(to_ee, to_goal) / (length(to_ee) * length(to_goal))
    phi = acos(min(max(cosine, -1.0), 1.0))
    return -phi if dot(a, cross(to_ee, to_goal)) < 0 else phi


@kernel
def pose_chain(bodies, joints, first, last, local):
    """Forward kinematics: rotation and origin of the children of joints `first` to `last`, and their axes.

    Returns:
        The world point with coordinates `local` in the frame of the last child.
    """
    for k in range(first, last + 1):
        joint = joints[k]
        parent = bodies[joint["parent"]]
        rotate(parent["rotation"], joint["axis"], joint["world_axis"])
        measure_angle(joint)
        hang(parent, joint, bodies[joint["child"]])
    tip = bodies[joints[last]["child"]]
    return add(vector(tip["position"]), times(tip["rotation"], local))

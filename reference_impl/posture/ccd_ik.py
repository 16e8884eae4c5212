"""Inverse kinematics of a chain by cyclic coordinate descent (Eqs. 2-5).

Passes converge linearly: late passes turn the joints by a constant ratio of the previous pass. Near a
stretched pose that ratio is almost 1. Every third pass may therefore be extrapolated to the series' limit.
"""

from math import acos, atan2, cos, sin, sqrt
from typing import NamedTuple

import numpy as np

from touchstone.reference_impl.core.conventions import (
    ANGLE_ACOS,
    IK_LEVER,
    IK_RATIO_MAX,
    IK_STALL_FALL,
    IK_STALL_PASSES,
    IK_STRIDE,
    PASSES_EXTRAPOLATED,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import rotate
from touchstone.reference_impl.kinematics.reach_cone import (
    keep_in_cone,
    keep_in_cones,
    project,
    take_angles,
    turn_about,
)
from touchstone.reference_impl.kinematics.skeleton import hang, measure_angle


class Hinges(NamedTuple):
    """Consecutive hinges of one chain, root to tip, with whole ball joints."""

    bodies: np.ndarray  # BODY
    joints: np.ndarray  # JOINT
    first: int  # index of the innermost hinge
    last: int  # of the outermost one


@kernel
def ccd_ik(hinges, point, goal, angle, passes, tolerance, cap):
    """Turn hinges, from the last to the first, to move a point of the last link to a goal.

    Args:
        hinges: Hinges; their links are posed, and their angles are within limits and cones.
        point: end effector (3,) [m], world, fixed in the child of the last hinge; updated.
        goal: target of the end effector (3,) [m], world.
        angle: ANGLE_ACOS or ANGLE_ATAN2.
        passes: PASSES_PLAIN or PASSES_EXTRAPOLATED.
        tolerance: distance at which it has converged [m].
        cap: largest number of passes over all joints.
    Returns:
        (passes, distance left [m], whether it converged). The rotation and origin of the chain's links match
        the new angles; their orientation, centre and pieces are stale until `pose_links`.
    """
    bodies, joints, first, last = hinges.bodies, hinges.joints, hinges.first, hinges.last
    fix_end_effector(bodies, joints, last, point)
    for k in range(first, last + 1):
        rotate(bodies[joints[k]["parent"]]["rotation"], joints[k]["axis"], joints[k]["world_axis"])
    left = distance(point, goal)
    marked, since = left, 0
    for done in range(cap):
        if left <= tolerance:
            return done, left, True
        for k in range(first, last + 1):
            joints[k]["pass_angle"] = joints[k]["angle"]
        for k in range(last, first - 1, -1):
            turn_toward(bodies, joints, k, point, goal, angle)
            if joints[k]["cone_count"] > 0 and keep_in_cone(joints, k):
                outer = Hinges(bodies, joints, k, last)
                pose_chain(outer, point)
                if slide_along_edge(bodies, joints, k, point, goal, angle):
                    pose_chain(outer, point)
        # turning inner joints moves the axes and origins of outer ones: update them once per pass
        pose_chain(hinges, point)
        left = distance(point, goal)
        since += 1
        ratio = _ratio_of_passes(hinges, since)
        if passes == PASSES_EXTRAPOLATED and since >= IK_STRIDE and ratio > 0 and left > tolerance:
            left, kept = _extrapolate(hinges, point, goal, left, ratio)
            since = 0 if kept else IK_STRIDE - 1
        if (done + 1) % IK_STALL_PASSES == 0:
            if not left < IK_STALL_FALL * marked:
                return done + 1, left, left <= tolerance
            marked = left
    return cap, left, left <= tolerance


@kernel
def _ratio_of_passes(hinges, since):
    """Ratio of the last pass' turns to those of the pass before, by projection on them [1]; 0 without one."""
    product, square = 0.0, 0.0
    for k in range(hinges.first, hinges.last + 1):
        joint = hinges.joints[k]
        turned = joint["angle"] - joint["pass_angle"]
        product += turned * joint["pass_turn"]
        square += joint["pass_turn"] * joint["pass_turn"]
        joint["pass_turn"] = turned
    return product / square if since > 1 and square > 0 else 0.0


@kernel
def _extrapolate(hinges, point, goal, left, ratio):
    """Extrapolate the angles to the limit of a geometric series with this ratio (Aitken); undo that if the
    end effector comes no nearer to its goal.

    Returns:
        (distance left [m], whether the extrapolation was kept).
    """
    joints, first, last = hinges.joints, hinges.first, hinges.last
    ratio = min(ratio, IK_RATIO_MAX)
    for k in range(first, last + 1):
        joint = joints[k]
        joint["last_angle"] = joint["angle"]
        wanted = joint["angle"] + ratio / (1 - ratio) * joint["pass_turn"]
        joint["angle"] = min(max(wanted, joint["lower"]), joint["upper"])
    keep_in_cones(joints, first, last)
    pose_chain(hinges, point)
    found = distance(point, goal)
    if found < left:
        return found, True
    return_to_last(hinges, point)
    return left, False


@kernel
def return_to_last(hinges, point):
    """Restore the angles from `last_angle`, and pose the links."""
    for k in range(hinges.first, hinges.last + 1):
        hinges.joints[k]["angle"] = hinges.joints[k]["last_angle"]
    pose_angles(hinges, point)


@kernel
def distance(a, b):
    """Distance of two points [m]."""
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return sqrt(x * x + y * y + z * z)


@kernel
def fix_end_effector(bodies, joints, last, point):
    """Store a world point in the frame of the child of hinge `last`."""
    body, local = bodies[joints[last]["child"]], joints[last]["end_effector"]
    r, o = body["rotation"], body["position"]
    x, y, z = point[0] - o[0], point[1] - o[1], point[2] - o[2]
    for i in range(3):
        local[i] = r[0, i] * x + r[1, i] * y + r[2, i] * z


@kernel
def pose_chain(hinges, point):
    """Forward kinematics from the cosines and sines of the angles: rotation and origin of the hinges'
    children, world axes of the hinges, and the end effector `point`, world."""
    bodies, joints, first, last = hinges.bodies, hinges.joints, hinges.first, hinges.last
    for k in range(first, last + 1):
        joint = joints[k]
        parent = bodies[joint["parent"]]
        rotate(parent["rotation"], joint["axis"], joint["world_axis"])
        hang(parent, joint, bodies[joint["child"]])
    tip = bodies[joints[last]["child"]]
    rotate(tip["rotation"], joints[last]["end_effector"], point)
    for i in range(3):
        point[i] += tip["position"][i]


@kernel
def pose_angles(hinges, point):
    """`pose_chain` from the angles: computes their cosines and sines first."""
    for k in range(hinges.first, hinges.last + 1):
        measure_angle(hinges.joints[k])
    pose_chain(hinges, point)


@kernel
def turn_toward(bodies, joints, k, point, goal, angle):
    """Turn hinge k within its limits so that `point` comes nearest to `goal`; updates `point` but no link."""
    joint = joints[k]
    axis, o = joint["world_axis"], bodies[joint["child"]]["position"]
    ax, ay, az = axis[0], axis[1], axis[2]
    ux, uy, uz, along = across(ax, ay, az, point[0] - o[0], point[1] - o[1], point[2] - o[2])
    wx, wy, wz, _ = across(ax, ay, az, goal[0] - o[0], goal[1] - o[1], goal[2] - o[2])
    joint["last_angle"] = joint["angle"]
    u, w = ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz
    if not (u >= IK_LEVER * IK_LEVER and w >= IK_LEVER * IK_LEVER):
        return
    vx, vy, vz = ay * uz - az * uy, az * ux - ax * uz, ax * uy - ay * ux
    wanted = joint["angle"] + signed_angle(
        vx * wx + vy * wy + vz * wz, ux * wx + uy * wy + uz * wz, u * w, angle
    )
    joint["angle"] = min(max(wanted, joint["lower"]), joint["upper"])
    c_old, s_old = joint["cosine"], joint["sine"]
    measure_angle(joint)
    if joint["angle"] == wanted:
        # the end effector now points to the goal: `point` does not depend on the angle's cosine and sine
        c = sqrt(u / w)
        ux, uy, uz, s = wx, wy, wz, 0.0
    else:
        c = joint["cosine"] * c_old + joint["sine"] * s_old
        s = joint["sine"] * c_old - joint["cosine"] * s_old
    point[0] = o[0] + along * ax + c * ux + s * vx
    point[1] = o[1] + along * ay + c * uy + s * vy
    point[2] = o[2] + along * az + c * uz + s * vz


@kernel
def across(ax, ay, az, x, y, z):
    """Component of a vector perpendicular to the unit vector a (Eq. 4), and its length along a."""
    along = ax * x + ay * y + az * z
    return x - along * ax, y - along * ay, z - along * az, along


@kernel
def signed_angle(sine, cosine, square, angle):
    """Angle from its sine and cosine, both scaled by the square root of `square` (Eq. 5) [rad]."""
    if angle == ANGLE_ACOS:
        # rounding may exceed 1, where acos is NaN: clamp
        turn = acos(min(max(cosine / sqrt(square), -1.0), 1.0))
        return -turn if sine < 0 else turn
    return atan2(sine, cosine)


@kernel
def slide_along_edge(bodies, joints, first, point, goal, angle):
    """Slide a ball joint's bone along the edge of its reach cone towards the goal, by a turn about the edge's
    normal. Hinge by hinge, CCD would push the bone out and the projection would bring it back.

    Returns:
        Whether it turned; `point` is not updated.
    """
    joint = joints[first]
    normal, axis, o = joint["outward"], joint["normal"], bodies[joint["child"]]["position"]
    if normal[0] == 0.0 and normal[1] == 0.0 and normal[2] == 0.0:
        return False
    rotate(joint["cone_axes"], normal, axis)
    rotate(bodies[joint["parent"]]["rotation"], axis, axis)
    ax, ay, az = axis[0], axis[1], axis[2]
    ux, uy, uz, _ = across(ax, ay, az, point[0] - o[0], point[1] - o[1], point[2] - o[2])
    wx, wy, wz, _ = across(ax, ay, az, goal[0] - o[0], goal[1] - o[1], goal[2] - o[2])
    u, w = ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz
    if not (u >= IK_LEVER * IK_LEVER and w >= IK_LEVER * IK_LEVER):
        return False
    sine = ax * (uy * wz - uz * wy) + ay * (uz * wx - ux * wz) + az * (ux * wy - uy * wx)
    turn = signed_angle(sine, ux * wx + uy * wy + uz * wz, u * w, angle)
    c, s = cos(turn), sin(turn)
    turn_about(normal, c, s, joint["bone"])
    turn_about(normal, c, s, joint["mark"])
    project(joint)
    for k in range(first, first + 3):
        joints[k]["last_angle"] = joints[k]["angle"]
    take_angles(joints, first)
    return True

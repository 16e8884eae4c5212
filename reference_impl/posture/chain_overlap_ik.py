"""Removal of one chain link's overlap by cyclic coordinate descent (method, section 4)."""

from math import atan2, pi

from touchstone.reference_impl.core.conventions import (
    ALONG_COSINE,
    BEND_ROUNDS,
    BEND_SHARE,
    CHAIN_PASSES,
    CHAIN_TOLERANCE,
    STRETCHED_SHARE,
)
from touchstone.reference_impl.core.counters import CAP_CCD, COUNT_CCD_PASSES, COUNT_IK_JOINTS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import matrix_of
from touchstone.reference_impl.kinematics.skeleton import hang, measure_angle
from touchstone.reference_impl.posture.ccd_ik import Hinges, ccd_ik, distance, pose_angles
from touchstone.reference_impl.posture.chain_overlap_depth import chain_depth


@kernel
def aim(world, end, d, chain, rounds, link):
    """Set `point` and `goal` of `state` for the child of hinge `link`: the end effector (Eq. 2: mean of the
    contact points on the link's own surface) and its goal (Eq. 3).

    Returns:
        The first hinge to turn: the chain's first, or the one after the outermost of the chain's own links
        that this link overlaps.
    """
    bodies, pairs, driver = world.bodies, world.pairs, world.drivers[d]
    point, goal, first = world.state["point"], world.state["goal"], driver["chains"][chain, 0]
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
def bring_out(bodies, joints, first, link, rounds, state):
    """Turn hinges `first` to `link` to move the end effector to its goal. A link that is parallel to the
    obstacle's surface translates instead: the hinges inward of its joint move the joint, and the joint's own
    hinges keep the link's orientation."""
    own = link
    while own > first and _meets_inner(joints[own]):
        own -= 1
    if own == first or not _lies_along(bodies[joints[link]["child"]], state):
        _reach(Hinges(bodies, joints, first, link), rounds, state)
        return
    origin, point, goal = bodies[joints[link]["child"]]["position"], state["point"], state["goal"]
    for i in range(3):
        goal[i] += origin[i] - point[i]
        point[i] = origin[i]
    _reach(Hinges(bodies, joints, first, own - 1), rounds, state)
    for k in range(own, link + 1):
        keep_orientation(bodies[joints[k]["parent"]], joints[k], bodies[joints[k]["child"]])


@kernel
def _meets_inner(joint):
    """Whether a hinge and the next one inward share an origin."""
    position = joint["position"]
    return position[0] == 0 and position[1] == 0 and position[2] == 0


@kernel
def _lies_along(body, state):
    """Whether a link's long axis is nearly perpendicular to the way from the end effector to its goal."""
    point, goal, axis, m = state["point"], state["goal"], body["axis"], body["rotation"]
    along = way = 0.0
    for i in range(3):
        y = goal[i] - point[i]
        along += y * (m[i, 0] * axis[0] + m[i, 1] * axis[1] + m[i, 2] * axis[2])
        way += y * y
    return along * along < ALONG_COSINE * ALONG_COSINE * way


@kernel
def keep_orientation(parent, joint, child):
    """Turn a hinge within its limits so that its child comes as close as possible to the world orientation in
    `orientation`, given the parent's new pose; pose the child."""
    world, frame, axis = child["scratch"], parent["rotation"], joint["axis"]
    matrix_of(child["orientation"], world)
    sine = cosine = 0.0
    for j in range(3):
        # axis j of the child in the parent's frame: (u, v, w) at angle 0, (x, y, z) as wanted
        u, v, w = joint["rest"][0, j], joint["rest"][1, j], joint["rest"][2, j]
        x = frame[0, 0] * world[0, j] + frame[1, 0] * world[1, j] + frame[2, 0] * world[2, j]
        y = frame[0, 1] * world[0, j] + frame[1, 1] * world[1, j] + frame[2, 1] * world[2, j]
        z = frame[0, 2] * world[0, j] + frame[1, 2] * world[1, j] + frame[2, 2] * world[2, j]
        sine += axis[0] * (v * z - w * y) + axis[1] * (w * x - u * z) + axis[2] * (u * y - v * x)
        cosine += u * x + v * y + w * z
        cosine -= (axis[0] * u + axis[1] * v + axis[2] * w) * (axis[0] * x + axis[1] * y + axis[2] * z)
    angle = atan2(sine, cosine)
    angle += 2 * pi * round((joint["angle"] - angle) / (2 * pi))
    joint["angle"] = min(max(angle, joint["lower"]), joint["upper"])
    measure_angle(joint)
    hang(parent, joint, child)


@kernel
def _reach(hinges, rounds, state):
    """Move the end effector to its goal by `ccd_ik`; if a stretched chain fails, bend it and retry once."""
    joints, first, last = hinges.joints, hinges.first, hinges.last
    angle, rule = state["angle"], state["passes"]
    point, goal, counters = state["point"], state["goal"], state["counters"]
    wanted = distance(point, goal)
    for attempt in range(2):
        passes, left, converged = ccd_ik(hinges, point, goal, angle, rule, CHAIN_TOLERANCE, CHAIN_PASSES)
        counters[COUNT_CCD_PASSES] += passes
        if passes == CHAIN_PASSES and not converged:
            counters[CAP_CCD] += 1
        counters[COUNT_IK_JOINTS] += last + 1 - first
        if attempt == 1 or left <= STRETCHED_SHARE * wanted or rounds >= BEND_ROUNDS:
            break
        inner = bend(joints, first, last) - 1
        pose_angles(hinges, point)
        if inner >= first:
            # solve for the hinges inward of the bend first: otherwise the bent hinge straightens again
            inward = Hinges(hinges.bodies, joints, first, inner)
            ccd_ik(inward, point, goal, angle, rule, CHAIN_TOLERANCE, CHAIN_PASSES)
            pose_angles(hinges, point)


@kernel
def bend(joints, first, last):
    """Turn each hinge outside ball joints by BEND_SHARE towards the middle of its range; return the first of
    these hinges, or `last` + 1 if there is none."""
    k, bent = first, last + 1
    while k <= last:
        if joints[k]["cone_count"] > 0:
            k += 3
            continue
        middle = (joints[k]["lower"] + joints[k]["upper"]) / 2
        joints[k]["angle"] += BEND_SHARE * (middle - joints[k]["angle"])
        k, bent = k + 1, min(bent, k)
    return bent

"""Geometric and kinematic overlap avoidance: translation by the global depth, chains by inverse kinematics.

Whose displacement: an object that overlaps a fixed one moves alone; a driven object moves out of a simulated
one, and the simulated one moves only where that is not possible; two objects of one kind move half each. A
link of a chain moves in full, out of other driven objects and of the links of other chains, too.
"""

from math import atan2, pi

from touchstone.reference_impl.core.conventions import DRIVEN, OVERLAP_TOLERANCE, SIMULATED
from touchstone.reference_impl.core.counters import (
    CAP_CHAIN_ROUNDS,
    CAP_TRANSLATION_ROUNDS,
    COUNT_GAVE_UP,
    COUNT_IK_ROUNDS,
    COUNT_ROUNDS,
    COUNT_WAY_BACK,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import matrix_of
from touchstone.reference_impl.kinematics.chain_order import shuffle_chains
from touchstone.reference_impl.kinematics.driver_poses import store_entry, store_free_pose
from touchstone.reference_impl.kinematics.skeleton import hang, measure_angle, place, pose_links
from touchstone.reference_impl.paper.ccd_ik import ccd_ik
from touchstone.reference_impl.paper.penetration_depth import (
    add_depth,
    find_overlap,
    global_depth,
    is_overlapping,
    return_to_free_state,
)
from touchstone.reference_impl.paper.vectors import (
    add,
    cross,
    dot,
    length,
    scaled,
    store,
    sub,
    times,
    transposed_times,
    vector,
)

TRANSLATION_ROUNDS = 32
"""Rounds of translation before step 4 of algorithm 1: a square corner halves the depth in each, 14 from 1
cm."""
CHAIN_ROUNDS = 16
"""Rounds in which the links of a chain are brought out: 1 to 3 are usual."""
PARALLEL_COSINE = 0.17364817766693033
"""Cosine between a link and its way out below which it is "almost parallel to the obstacle's surface" [1].
The paper leaves open the angle: 10 degrees."""


@kernel
def free_driven_objects(world):
    """Lower loop of figure 3: bring every driven object out of overlap.

    Hands, trunks and pelvis move by translation, then chains by inverse kinematics. What still overlaps goes
    back towards its last free state; if that is taken, too, it is counted as given up.
    """
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    for d in range(len(drivers)):
        store_entry(joints, drivers[d])
        pose_links(bodies, joints, drivers[d])
    end = translate_out(world, DRIVEN)
    for d in range(len(drivers)):
        if drivers[d]["chain_count"] > 0:
            end = _free_chains(world, d, end)
    for d in range(len(drivers)):
        drivers[d]["is_free"] = 1
        if is_overlapping(bodies, world.pairs, end, d):
            if return_to_free_state(world, d):
                state["counters"][COUNT_WAY_BACK] += 1
            else:
                state["counters"][COUNT_GAVE_UP] += 1
                drivers[d]["is_free"] = 0
            end, _ = find_overlap(world, DRIVEN)
        if drivers[d]["is_free"] == 1:
            store_free_pose(bodies, joints, drivers[d])


@kernel
def translate_out(world, kind):
    """Translate all objects of a kind by their PD_g until none overlaps: driven objects for the links in no
    chain; simulated objects out of fixed ones, of driven ones that could not move, and apart.

    The paper leaves open when to stop: after TRANSLATION_ROUNDS, which is counted.

    Returns:
        Index after the last pair of the last detection.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    for rounds in range(TRANSLATION_ROUNDS + 1):
        end, _ = find_overlap(world, kind)
        if not _sum_depths(bodies, drivers, pairs, end, kind):
            return end
        if rounds == TRANSLATION_ROUNDS:
            break
        state["counters"][COUNT_ROUNDS] += 1
        if kind == DRIVEN:
            for d in range(len(drivers)):
                if drivers[d]["sums"][1, 1] > OVERLAP_TOLERANCE:
                    position = drivers[d]["position"]
                    store(add(vector(position), global_depth(drivers[d]["sums"])), position)
                    pose_links(bodies, joints, drivers[d])
        else:
            for b in range(len(bodies)):
                if bodies[b]["kind"] == SIMULATED and bodies[b]["sums"][1, 1] > OVERLAP_TOLERANCE:
                    position = bodies[b]["position"]
                    store(add(vector(position), global_depth(bodies[b]["sums"])), position)
                    place(bodies[b])
    state["counters"][CAP_TRANSLATION_ROUNDS] += 1
    return end


@kernel
def _sum_depths(bodies, drivers, pairs, end, kind):
    """Sum Eq. 1 for every object of a kind over `pairs[:end]`; returns whether one of them overlaps."""
    for d in range(len(drivers)):
        drivers[d]["sums"][:] = 0.0
    for b in range(len(bodies)):
        bodies[b]["sums"][:] = 0.0
    found = False
    for k in range(end):
        pair = pairs[k]
        a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
        if pair["depth"] <= 0 or (a["driver"] >= 0 and a["driver"] == b["driver"]):
            continue
        # both are of the kind that moves: half each
        share = 0.5 if a["kind"] == b["kind"] else 1.0
        for side in (-1.0, 1.0):
            body = b if side > 0 else a
            if body["kind"] != kind or body["chain"] >= 0:
                continue
            sums = drivers[body["driver"]]["sums"] if kind == DRIVEN else body["sums"]
            add_depth(sums, side, pair["depth"], vector(pair["normal"]), share)
            found = found or pair["depth"] > OVERLAP_TOLERANCE
    return found


@kernel
def _free_chains(world, d, end):
    """Bring the chains of driven object d out of overlap, one after the other in random order: so arm against
    arm resolves, too.

    Args:
        end: `pairs[:end]` are the pairs at the present poses.
    Returns:
        Index after the last pair of the last detection.
    """
    bodies, joints, driver, state = world.bodies, world.joints, world.drivers[d], world.state
    shuffle_chains(driver, state)
    for i in range(driver["chain_count"]):
        chain = driver["order"][i]
        for rounds in range(CHAIN_ROUNDS + 1):
            link = _closest_to_root(bodies, world.pairs, end, d, chain)
            if link < 0:
                break
            if rounds == CHAIN_ROUNDS:
                state["counters"][CAP_CHAIN_ROUNDS] += 1
                break
            state["counters"][COUNT_IK_ROUNDS] += 1
            first = _set_end_effector_and_goal(world, end, d, chain, link)
            _bring_out(bodies, joints, first, link, state)
            pose_links(bodies, joints, driver)
            end, _ = find_overlap(world, DRIVEN)
    return end


@kernel
def _side_in_chain(bodies, pair, d, chain):
    """Side of a pair that is a link of a chain: 1.0 for B, -1.0 for A, 0.0 for neither; of two links of the
    chain, the outer one."""
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    at_a, at_b = a["driver"] == d and a["chain"] == chain, b["driver"] == d and b["chain"] == chain
    if at_a and at_b:
        return 1.0 if b["hinge"] > a["hinge"] else -1.0
    return 1.0 if at_b else (-1.0 if at_a else 0.0)


@kernel
def _closest_to_root(bodies, pairs, end, d, chain):
    """Link i: joint of the overlapping link of a chain that is closest to the root, or -1."""
    link = -1
    for k in range(end):
        side = _side_in_chain(bodies, pairs[k], d, chain)
        if side != 0.0 and pairs[k]["depth"] > OVERLAP_TOLERANCE:
            hinge = bodies[pairs[k]["body_b"] if side > 0 else pairs[k]["body_a"]]["hinge"]
            link = hinge if link < 0 else min(link, hinge)
    return link


@kernel
def _set_end_effector_and_goal(world, end, d, chain, link):
    """Eqs. 2 and 3: `state["point"]`, the end effector of link i, and `state["goal"]`.

        ee_i = sum_j(c_j) / k,      goal_i = ee_i + PD_g

    c_j are the link's k contact points, on its own surface. PD_g is Eq. 1 over all obstacles of the link; it
    points out of them, so the sign of Eq. 3 is that of `add_depth`.

    Returns:
        The first joint to turn: the chain's first, or the one after an overlapped link of the same chain.
    """
    bodies, pairs, driver, state = world.bodies, world.pairs, world.drivers[d], world.state
    sums, first, ee, count = driver["sums"], driver["chains"][chain, 0], (0.0, 0.0, 0.0), 0
    sums[:] = 0.0
    for k in range(end):
        pair = pairs[k]
        side = _side_in_chain(bodies, pair, d, chain)
        own = bodies[pair["body_b"] if side > 0 else pair["body_a"]]
        if side == 0.0 or pair["depth"] <= 0 or own["hinge"] != link:
            continue
        obstacle = bodies[pair["body_a"] if side > 0 else pair["body_b"]]
        if obstacle["driver"] == d and obstacle["chain"] == chain:
            first = max(first, obstacle["hinge"] + 1)
        ee = add(ee, vector(pair["point_b"] if side > 0 else pair["point_a"]))
        count += 1
        add_depth(sums, side, pair["depth"], vector(pair["normal"]), 1.0)
    ee = scaled(1 / count, ee)
    store(ee, state["point"])
    store(add(ee, global_depth(sums)), state["goal"])
    return first


@kernel
def _bring_out(bodies, joints, first, link, state):
    """Turn joints `first` to `link` until the end effector is at its goal.

    A link that is almost parallel to the obstacle's surface is moved out "with pure translation by PD_g": the
    joints inwards of its own bring its proximal joint there, and its own joint keeps its orientation. The
    first link of a chain has no joints inwards, and is turned.
    """
    own = link
    # the hinges of a ball joint share their origin
    while own > first and length(vector(joints[own]["position"])) == 0:
        own -= 1
    body = bodies[joints[link]["child"]]
    pd = sub(vector(state["goal"]), vector(state["point"]))
    along = dot(times(body["rotation"], vector(body["axis"])), pd)
    if own == first or abs(along) >= PARALLEL_COSINE * length(pd):
        ccd_ik(bodies, joints, first, link, state)
        return
    origin = vector(body["position"])
    store(origin, state["point"])
    store(add(origin, pd), state["goal"])
    ccd_ik(bodies, joints, first, own - 1, state)
    for k in range(own, link + 1):
        _keep_orientation(bodies[joints[k]["parent"]], joints[k], bodies[joints[k]["child"]])


@kernel
def _keep_orientation(parent, joint, child):
    """Turn a joint within its limits so that its child, after its parent has moved, comes nearest to the
    orientation that it had: the angle that maximises the trace of the product of both rotations."""
    old, axis = child["scratch"], vector(joint["axis"])
    matrix_of(child["orientation"], old)
    sine = cosine = 0.0
    for j in range(3):
        # axis j of the child in the parent's frame: at angle 0, and as it was
        at_zero = (joint["rest"][0, j], joint["rest"][1, j], joint["rest"][2, j])
        wanted = transposed_times(parent["rotation"], (old[0, j], old[1, j], old[2, j]))
        sine += dot(axis, cross(at_zero, wanted))
        cosine += dot(at_zero, wanted) - dot(axis, at_zero) * dot(axis, wanted)
    angle = atan2(sine, cosine)
    angle += 2 * pi * round((joint["angle"] - angle) / (2 * pi))
    joint["angle"] = min(max(angle, joint["lower"]), joint["upper"])
    measure_angle(joint)
    hang(parent, joint, child)

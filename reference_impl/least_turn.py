"""Least turn: the smallest change of a chain's angles that meets all its depths at once (ours).

The articulated counterpart of `least_motion`: minimise |dq|^2 subject to n . (J dq) >= d for all overlapping
pairs, J the Jacobian of the point on the chain's own surface, and to the hinges' limits. Repeated, with the
attraction between, it comes to rest where |q - q_tracker|^2 has a local minimum among free postures. Solved
by Hildreth's method (1957), one multiplier after the other, with the angles cut off at their limits. Depths
may be missed by s at a price of (s / TURN_LEVER)^2, or near a stretched posture turns would have no bound.

A pair tells one point of a face or an edge that may lie in an obstacle as a whole. Points and planes met in
earlier rounds of a frame therefore stay: the ankle does not tip the sole from toe to heel and back.
"""

from math import inf

from reference_impl.ccd_ik import keep_in_cones
from reference_impl.chain_depth import chain_depth
from reference_impl.conventions import (
    TURN_CLEARANCE,
    TURN_LEVER,
    TURN_MAX,
    TURN_OVER,
    TURN_PLAIN,
    TURN_ROWS,
    TURN_SWEEPS,
    TURN_TOLERANCE,
)
from reference_impl.kernel import kernel
from reference_impl.rotation import rotate


@kernel
def least_turn(bodies, joints, pairs, end, driver, d, chain, rounds, state):
    """Turn a chain's hinges by the least that frees it, to first order, within limits and reach cones.

    Args:
        pairs: `pairs[:end]` were detected as the links are posed now; links wait for `pose_links`.
        rounds: as in `chain_depth`.
    Returns:
        Share of the largest depth that no turn meets [1]: 1 where a stretched chain is pushed along itself.
    """
    first, last = driver["chains"][chain, 0], driver["chains"][chain, 1]
    for k in range(first, last + 1):
        rotate(bodies[joints[k]["parent"]]["rotation"], joints[k]["axis"], joints[k]["world_axis"])
        joints[k]["pass_turn"] = 0.0
    if rounds == 0:
        state["turn_count"] = 0
    for r in range(state["turn_count"]):
        # planes on the chain's own links have moved with these
        if state["turns"][r]["first"] > first:
            state["turns"][r]["height"] = -inf
    _gather(bodies, joints, pairs, end, driver, d, chain, rounds, state)
    count = state["turn_count"]
    for r in range(count):
        _measure(bodies, joints, first, last, state["turns"][r])
    for k in range(TURN_SWEEPS):
        if _sweep(joints, first, last, state, 1.0 if k < TURN_PLAIN else TURN_OVER) <= TURN_TOLERANCE:
            break
    missed = deepest = 0.0
    for r in range(count):
        row = state["turns"][r]
        made, _ = _progress(joints, first, last, row)
        missed = max(missed, row["depth"] - made)
        deepest = max(deepest, row["depth"])
    _apply(joints, first, last)
    return missed / deepest if deepest > 0 else 0.0


@kernel
def _gather(bodies, joints, pairs, end, driver, d, chain, rounds, state):
    """Add the points of a chain's pairs, fixed in their links, and the planes they are to be on; where there
    is no room, in place of all earlier ones."""
    added = 0
    for k in range(end):
        side, _ = chain_depth(bodies, pairs[k], driver, d, chain, rounds)
        added += 1 if side != 0.0 else 0
    if state["turn_count"] + added > TURN_ROWS:
        state["turn_count"] = 0
    for k in range(end):
        pair = pairs[k]
        side, depth = chain_depth(bodies, pair, driver, d, chain, rounds)
        if side == 0.0 or state["turn_count"] == TURN_ROWS:
            continue
        row = state["turns"][state["turn_count"]]
        state["turn_count"] += 1
        mine = bodies[pair["body_b"] if side > 0 else pair["body_a"]]
        other = bodies[pair["body_a"] if side > 0 else pair["body_b"]]
        # hinges below both links move both
        same = other["driver"] == d and other["chain"] == chain
        row["first"] = other["hinge"] + 1 if same else driver["chains"][chain, 0]
        row["last"] = mine["hinge"]
        p = pair["point_b"] if side > 0 else pair["point_a"]
        link, local, normal = bodies[joints[row["last"]]["child"]], row["point"], row["normal"]
        m, o = link["rotation"], link["position"]
        row["height"] = depth + TURN_CLEARANCE
        for i in range(3):
            normal[i] = side * pair["normal"][i]
            row["height"] += normal[i] * p[i]
            local[i] = m[0, i] * (p[0] - o[0]) + m[1, i] * (p[1] - o[1]) + m[2, i] * (p[2] - o[2])


@kernel
def _measure(bodies, joints, first, last, row):
    """Depth of a point under its plane as the links are posed now, and its fall per turn of each hinge."""
    link, p, n = bodies[joints[row["last"]]["child"]], row["world_point"], row["normal"]
    rotate(link["rotation"], row["point"], p)
    row["depth"] = row["height"]
    for i in range(3):
        p[i] += link["position"][i]
        row["depth"] -= n[i] * p[i]
    row["push"] = 0.0
    for k in range(first, last + 1):
        fall = 0.0
        if row["first"] <= k <= row["last"]:
            a, o = joints[k]["world_axis"], bodies[joints[k]["child"]]["position"]
            x, y, z = p[0] - o[0], p[1] - o[1], p[2] - o[2]
            fall = n[0] * (a[1] * z - a[2] * y) + n[1] * (a[2] * x - a[0] * z)
            fall += n[2] * (a[0] * y - a[1] * x)
        row["fall"][k - first] = fall


@kernel
def _progress(joints, first, last, row):
    """By how much the turns so far lessen a row's depth [m], and how much more a unit of its push would
    [m^2]."""
    made = free = 0.0
    for k in range(first, last + 1):
        joint, fall = joints[k], row["fall"][k - first]
        wanted = joint["angle"] + joint["pass_turn"]
        made += fall * (min(max(wanted, joint["lower"]), joint["upper"]) - joint["angle"])
        if joint["lower"] < wanted < joint["upper"]:
            free += fall * fall
    return made, free


@kernel
def _sweep(joints, first, last, state, factor):
    """Correct the push of every row once, by a factor of what is due; returns the largest change of a depth
    [m]."""
    most = 0.0
    for r in range(state["turn_count"]):
        row = state["turns"][r]
        made, free = _progress(joints, first, last, row)
        given = TURN_LEVER * TURN_LEVER
        due = (row["depth"] - made - given * row["push"]) / (free + given)
        push = max(factor * due, -row["push"])
        row["push"] += push
        for k in range(first, last + 1):
            joints[k]["pass_turn"] += push * row["fall"][k - first]
        most = max(most, abs(push) * (free + given))
    return most


@kernel
def _apply(joints, first, last):
    """Turn the hinges, none by more than TURN_MAX."""
    largest = 0.0
    for k in range(first, last + 1):
        largest = max(largest, abs(joints[k]["pass_turn"]))
    share = min(1.0, TURN_MAX / largest) if largest > 0 else 0.0
    for k in range(first, last + 1):
        joint = joints[k]
        joint["last_angle"] = joint["angle"]
        wanted = joint["angle"] + share * joint["pass_turn"]
        joint["angle"] = min(max(wanted, joint["lower"]), joint["upper"])
    keep_in_cones(joints, first, last)

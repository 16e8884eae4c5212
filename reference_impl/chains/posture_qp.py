"""Least turn: the smallest change of a body's angles that meets all depths of its chains at once (ours).

The articulated counterpart of `min_norm_translation`: minimise |dq - pull|^2 subject to n . (J dq) >= d for
all points at which links touch (`posture_constraints`), J their Jacobian, and to the hinges' limits. All
chains are solved for together: two that push each other share their overlap by |g|^2, g the change of its
depth per turn of each hinge, which makes |dq|^2 least. Without pull it brings chains out of overlap. Pulled
by q_tracker - q it is the attraction (section 4) that knows what the chains touch, and comes to rest where |q
- q_tracker|^2 has a local minimum among free postures. Solved by Hildreth's method (1957), one multiplier
after the other, with the angles cut off at their limits. Depths may be missed by s at a price of (s /
QP_LEVER)^2, or near a stretched posture turns would have no bound.
"""

from touchstone.reference_impl.chains.ccd_ik import keep_in_cones
from touchstone.reference_impl.core.conventions import (
    COUNT_IK_ITERATIONS,
    COUNT_IK_JOINTS,
    QP_LEVER,
    QP_PLAIN_SWEEPS,
    QP_RELAXATION,
    QP_ROUGH_TOLERANCE,
    QP_SWEEPS,
    QP_TOLERANCE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import rotate


@kernel
def solve_posture_qp(bodies, joints, driver, pulled, state):
    """Turns of all hinges of a driver's chains, as `pass_turn`, that are nearest to those they hold at entry
    and lift the points of all rows onto their planes, to first order and within limits; links stay as posed.

    Args:
        pulled: whether by the tracker: such pushes last, and start from those of the last time.
    """
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    state["counters"][COUNT_IK_ITERATIONS] += 1
    state["counters"][COUNT_IK_JOINTS] += _hinges_of_rows(driver)
    for k in range(first, end):
        rotate(bodies[joints[k]["parent"]]["rotation"], joints[k]["axis"], joints[k]["world_axis"])
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        _measure(bodies, joints, row)
        row["multiplier"] = 0.0
        if pulled and row["warm_multiplier"] > 0:
            _push(joints, row, row["warm_multiplier"])
    enough = QP_ROUGH_TOLERANCE if pulled else QP_TOLERANCE
    for k in range(QP_SWEEPS):
        if _sweep(joints, driver, 1.0 if k < QP_PLAIN_SWEEPS else QP_RELAXATION) <= enough:
            break
    if pulled:
        for r in range(driver["constraint_count"]):
            driver["constraints"][r]["warm_multiplier"] = driver["constraints"][r]["multiplier"]


@kernel
def _hinges_of_rows(driver):
    """How many hinges the chains that rows concern have."""
    count = 0
    for i in range(driver["chain_count"]):
        first, last = driver["chains"][i, 0], driver["chains"][i, 1]
        for r in range(driver["constraint_count"]):
            row = driver["constraints"][r]
            if first <= row["last"][0] <= last or first <= row["last"][1] <= last:
                count += last + 1 - first
                break
    return count


@kernel
def missed_share(joints, first, last, driver):
    """Share of the largest depth of a chain, hinges `first` to `last`, that no turn meets [1]: 1 where a
    stretched one is pushed along itself."""
    missed = deepest = 0.0
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        if first <= row["last"][0] <= last or first <= row["last"][1] <= last:
            made, _ = _progress(joints, row)
            missed = max(missed, row["depth"] - made)
            deepest = max(deepest, row["depth"])
    return missed / deepest if deepest > 0 else 0.0


@kernel
def apply_turns(joints, driver, share, most):
    """Turn the hinges of chains by a share of `pass_turn`, none by more than `most` [rad], within limits and
    reach cones; links wait for `pose_links`."""
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    largest = 0.0
    for k in range(first, end):
        largest = max(largest, abs(share * joints[k]["pass_turn"]))
    if largest > most:
        share *= most / largest
    for k in range(first, end):
        joint = joints[k]
        joint["last_angle"] = joint["angle"]
        if joint["chain"] >= 0:
            wanted = joint["angle"] + share * joint["pass_turn"]
            joint["angle"] = min(max(wanted, joint["lower"]), joint["upper"])
    keep_in_cones(joints, first, end - 1)


@kernel
def _measure(bodies, joints, row):
    """Depth of a row as the links are posed now, and its fall per turn of each hinge on both sides."""
    n, p = row["normal"], row["world_point"]
    row["depth"] = row["bound"]
    for side in range(2):
        body = bodies[row["body"] if side == 0 else row["other"]]
        rotate(body["rotation"], row["point"] if side == 0 else row["other_point"], p)
        sign = 1.0 if side == 0 else -1.0
        for i in range(3):
            p[i] += body["position"][i]
            row["depth"] -= sign * n[i] * p[i]
        for k in range(row["first"][side], row["last"][side] + 1):
            a, o = joints[k]["world_axis"], bodies[joints[k]["child"]]["position"]
            x, y, z = p[0] - o[0], p[1] - o[1], p[2] - o[2]
            fall = n[0] * (a[1] * z - a[2] * y) + n[1] * (a[2] * x - a[0] * z)
            fall += n[2] * (a[0] * y - a[1] * x)
            row["jacobian"][side, k - row["first"][side]] = sign * fall


@kernel
def _progress(joints, row):
    """By how much the turns so far lessen a row's depth [m], and how much more a unit of its push would
    [m^2]."""
    made = free = 0.0
    for side in range(2):
        first = row["first"][side]
        for k in range(first, row["last"][side] + 1):
            joint, fall = joints[k], row["jacobian"][side, k - first]
            wanted = joint["angle"] + joint["pass_turn"]
            made += fall * (min(max(wanted, joint["lower"]), joint["upper"]) - joint["angle"])
            if joint["lower"] < wanted < joint["upper"]:
                free += fall * fall
    return made, free


@kernel
def _push(joints, row, push):
    """Add to a row's multiplier, and to the turns what follows."""
    row["multiplier"] += push
    for side in range(2):
        first = row["first"][side]
        for k in range(first, row["last"][side] + 1):
            joints[k]["pass_turn"] += push * row["jacobian"][side, k - first]


@kernel
def _sweep(joints, driver, factor):
    """Correct the push of every row once, by a factor of what is due; returns the largest change of a depth
    [m]."""
    most = 0.0
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        made, free = _progress(joints, row)
        given = QP_LEVER * QP_LEVER
        due = (row["depth"] - made - given * row["multiplier"]) / (free + given)
        push = max(factor * due, -row["multiplier"])
        if push == 0.0:
            continue
        _push(joints, row, push)
        most = max(most, abs(push) * (free + given))
    return most

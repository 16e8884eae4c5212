"""Posture QP: the smallest change of joint angles that resolves all contacts of the chains at once (ours).

It is the articulated counterpart of `min_norm_translation`: minimise |dq - pull|^2 subject to n . (J dq) >= d
at every contact point of the links (`posture_constraints`), where J is the contact Jacobian, and to the joint
limits. One QP covers all chains. Two chains that overlap share the depth in proportion to |g|^2, where g is
the gradient of the depth with respect to a chain's angles; this minimises |dq|^2. With pull = 0 the QP brings
chains out of overlap. With pull = q_tracker - q it computes the attraction subject to the
contacts, and converges to a local minimum of |q - q_tracker|^2 among the free postures. Hildreth's method
(1957) solves it: coordinate ascent on the multipliers, with the angles clamped to their limits. It converges
slowly where contacts nearly oppose each other; after every QP_NEWTON_EVERY sweeps a semismooth Newton step
(Qi & Sun 1993) solves for all positive multipliers at once. A constraint may be violated by s at a cost of
(s / QP_LEVER)^2; without this compliance the turns near a stretched posture would be unbounded.
"""

from math import inf, sqrt

from touchstone.reference_impl.core.conventions import QP_TOLERANCE, SIMULATED
from touchstone.reference_impl.core.counters import CAP_POSTURE_QP, COUNT_IK_JOINTS, COUNT_QP_SOLVES
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import rotate
from touchstone.reference_impl.kinematics.reach_cone import keep_in_cones

QP_SWEEPS = 96
"""Sweeps of Hildreth's method; one pair takes 1, a corner about 5."""
QP_NEWTON_EVERY = 4
"""Sweeps between two Newton steps: sweeps find which constraints push, Newton's method their multipliers."""
QP_NEWTON_STEPS = 4
"""Most Newton steps before the next sweep; one is enough where the same constraints push before and after."""
QP_LINE_SEARCH = 8
"""Steps back of a Newton step that goes too far."""
QP_ROUGH_TOLERANCE = 1e-6
"""The same with the tracker's pull [m]: overlap removal follows it."""
QP_LEVER = 5e-3
"""Lever below which the QP leaves depth instead of turning hinges [m]: of a stretched limb, or between
opposing planes."""

COMPLIANCE = QP_LEVER * QP_LEVER
"""Violation of a constraint per unit of its multiplier [m^2]."""


@kernel
def solve_posture_qp(bodies, joints, driver, pulled, movable, state):
    """Solve the posture QP of a driver; `pass_turn` of its hinges is the pull on entry and the solution dq on
    return. Linearises at the current poses of the links and does not change them.

    Args:
        pulled: whether the pull is that of the tracker; its multipliers are stored and warm start the next.
        movable: whether contacts with simulated bodies are constraints.
    """
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    state["counters"][COUNT_QP_SOLVES] += 1
    state["counters"][COUNT_IK_JOINTS] += _hinges_of_rows(driver)
    for k in range(first, end):
        rotate(bodies[joints[k]["parent"]]["rotation"], joints[k]["axis"], joints[k]["world_axis"])
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        _measure(bodies, joints, row)
        row["multiplier"] = 0.0
        if not movable and bodies[row["other"]]["kind"] == SIMULATED:
            row["depth"] = -inf
        if pulled and row["warm_multiplier"] > 0:
            _push(joints, row, row["warm_multiplier"])
    enough = QP_ROUGH_TOLERANCE if pulled else QP_TOLERANCE
    converged = False
    for k in range(QP_SWEEPS):
        if k > 0 and k % QP_NEWTON_EVERY == 0:
            _newton_steps(joints, driver)
        if _sweep(joints, driver) <= enough:
            converged = True
            break
    if not converged:
        state["counters"][CAP_POSTURE_QP] += 1
    if pulled:
        for r in range(driver["constraint_count"]):
            driver["constraints"][r]["warm_multiplier"] = driver["constraints"][r]["multiplier"]


@kernel
def _hinges_of_rows(driver):
    """Number of hinges in the chains that have constraints."""
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
    """Largest violation left by the solution, over the largest depth of the chain of hinges `first` to `last`
    [1]; 1 where a contact pushes a stretched chain along its length."""
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
    """Turn the hinges of chains by `share` times `pass_turn`, scaled so that none turns by more than `most`
    [rad], within limits and reach cones; the links are not posed."""
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
    """Evaluate a constraint at the current poses: its depth, and the Jacobian row of both bodies."""
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
    """Reduction of a constraint's depth by the current turns [m], and that per unit of its multiplier [m^2]:
    the squared norm of the Jacobian over the hinges that are inside their limits."""
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
    """Add `push` to a constraint's multiplier, and J^T push to the turns."""
    row["multiplier"] += push
    for side in range(2):
        first = row["first"][side]
        for k in range(first, row["last"][side] + 1):
            joints[k]["pass_turn"] += push * row["jacobian"][side, k - first]


@kernel
def _sweep(joints, driver):
    """Update every multiplier once; return the largest change of a depth [m]."""
    most = 0.0
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        made, free = _progress(joints, row)
        stiff = free + COMPLIANCE
        push = max((row["depth"] - made - COMPLIANCE * row["multiplier"]) / stiff, -row["multiplier"])
        if push == 0.0:
            continue
        _push(joints, row, push)
        most = max(most, abs(push) * stiff)
    return most


@kernel
def _newton_steps(joints, driver):
    """Solve for all positive multipliers together. A step ends where one of them becomes zero; the next step
    solves without it."""
    rows, count = driver["constraints"], driver["constraint_count"]
    for _ in range(QP_NEWTON_STEPS):
        _solve_positive(joints, driver)
        share, blocked = 1.0, -1
        for r in range(count):
            if share * rows[r]["step"] < -rows[r]["multiplier"]:
                share, blocked = -rows[r]["multiplier"] / rows[r]["step"], r
        for r in range(count):
            rows[r]["step"] = -rows[r]["multiplier"] if r == blocked else share * rows[r]["step"]
        slope = _dual_slope(joints, driver)
        _add_steps(joints, driver, 1.0)
        if not _step_back(joints, driver, slope) and blocked < 0:
            break


@kernel
def _step_back(joints, driver, slope):
    """Shorten a step, at whose start the dual had a slope, to about the maximum of the dual: hinges that
    reach or leave their limits on the way change the dual's curvature."""
    for _ in range(QP_LINE_SEARCH):
        end = _dual_slope(joints, driver)
        if end >= -0.1 * slope:
            break
        back = end / (slope - end)
        _add_steps(joints, driver, back)
        slope *= 1.0 + back
        for r in range(driver["constraint_count"]):
            driver["constraints"][r]["step"] *= 1.0 + back
    return True


@kernel
def _add_steps(joints, driver, share):
    """Add a share of `step` to every multiplier."""
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        if row["step"] != 0.0:
            _push(joints, row, share * row["step"])


@kernel
def _solve_positive(joints, driver):
    """Write to `step` the change of every positive multiplier that solves for all of these, by Cholesky's
    method, and 0 for the others."""
    rows, count = driver["constraints"], driver["constraint_count"]
    for r in range(count):
        row = rows[r]
        row["step"] = 0.0
        if row["multiplier"] <= 0:
            continue
        row["step"] = row["depth"] - _progress(joints, row)[0] - COMPLIANCE * row["multiplier"]
        pivot = COMPLIANCE + _coupling(joints, row, row)
        for s in range(r):
            if rows[s]["multiplier"] > 0:
                total = _coupling(joints, row, rows[s])
                for k in range(s):
                    if rows[k]["multiplier"] > 0:
                        total -= row["factor"][k] * rows[s]["factor"][k]
                row["factor"][s] = total / rows[s]["factor"][s]
                row["step"] -= row["factor"][s] * rows[s]["step"]
                pivot -= row["factor"][s] ** 2
        # in exact arithmetic a pivot is at least the compliance
        row["factor"][r] = sqrt(max(pivot, COMPLIANCE))
        row["step"] /= row["factor"][r]
    for r in range(count - 1, -1, -1):
        row = rows[r]
        if row["multiplier"] > 0:
            row["step"] /= row["factor"][r]
            for s in range(r):
                if rows[s]["multiplier"] > 0:
                    rows[s]["step"] -= row["factor"][s] * row["step"]


@kernel
def _dual_slope(joints, driver):
    """Derivative of the dual along `step` [1]."""
    slope = 0.0
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        if row["step"] != 0.0:
            left = row["depth"] - _progress(joints, row)[0] - COMPLIANCE * row["multiplier"]
            slope += row["step"] * left
    return slope


@kernel
def _coupling(joints, row, other):
    """Fall of a constraint's depth per unit of another's multiplier [m^2], by hinges inside their limits."""
    total = 0.0
    for i in range(2):
        for j in range(2):
            first, since = row["first"][i], other["first"][j]
            for k in range(max(first, since), min(row["last"][i], other["last"][j]) + 1):
                joint = joints[k]
                if joint["lower"] < joint["angle"] + joint["pass_turn"] < joint["upper"]:
                    total += row["jacobian"][i, k - first] * other["jacobian"][j, k - since]
    return total

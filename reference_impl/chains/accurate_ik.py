"""`ccd_ik` with a damped least-squares finish and seeded random restarts, for profile `accurate`."""

from math import inf

from touchstone.reference_impl.chains.ccd_ik import (
    ccd_ik,
    distance,
    keep_in_cones,
    pose_angles,
    pose_chain,
    return_to_last,
)
from touchstone.reference_impl.core.conventions import (
    IK_DAMPING_FALL,
    IK_DAMPING_MAX,
    IK_DAMPING_MIN,
    IK_DAMPING_START,
    IK_FINISH_CAP,
    IK_RESTARTS,
    RANDOM_PRIME,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import invert_symmetric, rotate


@kernel
def accurate_ik(bodies, joints, first, last, point, goal, angle, passes, tolerance, cap, state):
    """Run `ccd_ik` and a damped least-squares finish; repeat both from up to 8 random postures.

    Args:
        state: each restart advances its `random`; the other arguments are those of `ccd_ik`.
    Returns:
        (passes and steps, distance left [m], whether it converged), for the best posture found.
    """
    total, best = 0, inf
    for start in range(IK_RESTARTS + 1):
        if start > 0:
            _draw_posture(joints, first, last, state)
            pose_chain(bodies, joints, first, last, point)
        done, left, arrived = ccd_ik(bodies, joints, first, last, point, goal, angle, passes, tolerance, cap)
        total += done
        if not arrived:
            steps, left = _finish(bodies, joints, first, last, point, goal, state, tolerance)
            total += steps
        if left < best:
            best = left
            for k in range(first, last + 1):
                joints[k]["best_angle"] = joints[k]["angle"]
        if best <= tolerance:
            break
    for k in range(first, last + 1):
        joints[k]["angle"] = joints[k]["best_angle"]
    pose_angles(bodies, joints, first, last, point)
    return total, best, best <= tolerance


@kernel
def next_random(state):
    """Random number in (0, 1) by the generator of Park and Miller (1988), which fits 64-bit integers."""
    state["random"] = 16807 * state["random"] % RANDOM_PRIME
    return state["random"] / RANDOM_PRIME


@kernel
def _draw_posture(joints, first, last, state):
    """Set random angles within limits and cones; the angles on entry must be within them."""
    for k in range(first, last + 1):
        joint, share = joints[k], next_random(state)
        joint["last_angle"] = joint["angle"]
        joint["angle"] = joint["lower"] + share * (joint["upper"] - joint["lower"])
    keep_in_cones(joints, first, last)


@kernel
def _finish(bodies, joints, first, last, point, goal, state, tolerance):
    """Damped least squares (Levenberg, Marquardt) from the current posture.

    Returns:
        (steps, distance left [m]).
    """
    left, damping = distance(point, goal), IK_DAMPING_START
    for steps in range(IK_FINISH_CAP):
        if left <= tolerance or damping > IK_DAMPING_MAX:
            return steps, left
        _step(bodies, joints, first, last, point, goal, state, damping)
        keep_in_cones(joints, first, last)
        pose_chain(bodies, joints, first, last, point)
        found = distance(point, goal)
        if found < left:
            left, damping = found, max(damping / IK_DAMPING_FALL, IK_DAMPING_MIN)
        else:
            damping *= IK_DAMPING_FALL
            return_to_last(bodies, joints, first, last, point)
    return IK_FINISH_CAP, left


@kernel
def _step(bodies, joints, first, last, point, goal, state, damping):
    """Add J^T (J J^T + damping^2 1)^-1 (goal - point) to the angles, clamped to their limits. J excludes
    hinges at a limit that the first solution pushes beyond it."""
    for k in range(first, last + 1):
        joint = joints[k]
        a, o, column = joint["world_axis"], bodies[joint["child"]]["position"], joint["column"]
        x, y, z = point[0] - o[0], point[1] - o[1], point[2] - o[2]
        column[0], column[1], column[2] = a[1] * z - a[2] * y, a[2] * x - a[0] * z, a[0] * y - a[1] * x
        joint["last_angle"] = joint["angle"]
    for i in range(3):
        state["away"][i] = goal[i] - point[i]
    _pull(joints, first, last, state, damping)
    for k in range(first, last + 1):
        joint, turn = joints[k], _turn(joints[k], state)
        if (turn > 0 and joint["angle"] >= joint["upper"]) or (turn < 0 and joint["angle"] <= joint["lower"]):
            joint["column"][:] = 0.0
    _pull(joints, first, last, state, damping)
    for k in range(first, last + 1):
        joint = joints[k]
        joint["angle"] = min(max(joint["angle"] + _turn(joint, state), joint["lower"]), joint["upper"])


@kernel
def _pull(joints, first, last, state, damping):
    """(J J^T + damping^2 1)^-1 (goal - point)."""
    square = state["square"]
    square[:] = 0.0
    for i in range(3):
        square[i, i] = damping * damping
    for k in range(first, last + 1):
        column = joints[k]["column"]
        for i in range(3):
            for j in range(3):
                square[i, j] += column[i] * column[j]
    invert_symmetric(square, state["inverse"])
    rotate(state["inverse"], state["away"], state["pull"])


@kernel
def _turn(joint, state):
    column, pull = joint["column"], state["pull"]
    return column[0] * pull[0] + column[1] * pull[1] + column[2] * pull[2]

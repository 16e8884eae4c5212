"""Hinges of drivers that move in the simulated loop.

Hinges outside chains go evenly through a frame. The hinges of a chain do so too, along the path that the
driven loop found, but for the offsets x that forces f of simulated bodies caused. They obey the servos of the
dynamics engines, each of its own constant stiffness in the diagonal matrix K,

    M x'' = -K x - (2 / w) K x' + J' f

with M the chain's inertia while its root is held. In the modes x = V z of M and K, with V'M V = 1 and V'K V
diagonal (`hinge_modes`), these are springs of one coordinate each, solved in closed form over a
substep with constant forces. The limit of a hinge that would leave it by that becomes a row of the contact
solver.
"""

from math import sqrt

from touchstone.reference_impl.continuous.coupling_response import decay, unit_response
from touchstone.reference_impl.continuous.hinge_modes import find_modes
from touchstone.reference_impl.core.kernel import kernel

LIMIT_ROUNDING = 1e-9
"""Angle beyond a limit that is none [rad]: 1e-9 m."""
LIMIT_ERROR = LIMIT_ROUNDING / 10
"""Angle to a limit that counts as none, so that what rests at it has no rate [rad]."""


@kernel
def follow_servos(joints, driver, h):
    """Advance the offsets of a driver's hinges by a time h without forces."""
    for i in range(driver["chain_count"]):
        first, end = driver["chains"][i, 0], driver["chains"][i, 1] + 1
        moves = False
        for k in range(first, end):
            moves = moves or joints[k]["offset"] != 0 or joints[k]["offset_rate"] != 0
        if not moves:
            continue
        for k in range(first, end):
            joints[k]["old_offset"], joints[k]["old_offset_rate"] = (
                joints[k]["offset"],
                joints[k]["offset_rate"],
            )
        _follow_modes(joints, driver, first, end, h, h, 0.0)
        small = True
        for k in range(first, end):
            x, rate = joints[k]["offset"], joints[k]["offset_rate"]
            small = small and abs(x) < LIMIT_ROUNDING and abs(h * rate) < LIMIT_ROUNDING
        if small:
            for k in range(first, end):
                joints[k]["offset"] = joints[k]["offset_rate"] = 0.0


@kernel
def _follow_modes(joints, driver, first, end, t, h, share):
    """Set the offsets of a chain's hinges a time t after the start of their substep of length h, with a share
    of the response to its forces."""
    if joints[first]["pace"] == 0:
        find_modes(joints, driver, first, end)
    for m in range(first, end):
        mode, z, rate = joints[m], 0.0, 0.0
        for k in range(first, end):
            bent = joints[k]["modes"][m - first] * joints[k]["servo"] / mode["pace"]
            z += bent * joints[k]["old_offset"]
            rate += bent * joints[k]["old_offset_rate"]
        _find_motion(mode, driver, t, h)
        a = mode["motion"]
        mode["amplitude"] = a[0] * z + a[2] * rate + share * a[4] / h * mode["shift_twist"]
        mode["amplitude_rate"] = a[1] * z + a[3] * rate + share * a[5] / h * mode["twist"]
    for k in range(first, end):
        x = rate = 0.0
        for m in range(first, end):
            x += joints[k]["modes"][m - first] * joints[m]["amplitude"]
            rate += joints[k]["modes"][m - first] * joints[m]["amplitude_rate"]
        joints[k]["offset"], joints[k]["offset_rate"] = x, rate


@kernel
def _find_motion(mode, driver, t, h):
    """Compute the motion of a mode over a time t in a substep of length h, unless it is the last one asked:
    its amplitude and rate per amplitude, and per rate, at the start, and per acceleration all the while."""
    if mode["motion_time"] == t and mode["motion_length"] == h:
        return
    mode["motion_time"], mode["motion_length"] = t, h
    stiffness, damping, a = mode["pace"], _damping(driver, mode["pace"], h), mode["motion"]
    a[0], a[1] = decay(1.0, 0.0, stiffness, damping, t)
    a[2], a[3] = decay(0.0, 1.0, stiffness, damping, t)
    a[4], a[5] = unit_response(stiffness, damping, t)


@kernel
def _damping(driver, stiffness, h):
    """Damping of a mode [1/s]. One that swings faster than the substep is damped critically at least, as a
    coupling is (`driver_motion`)."""
    damping = 2 * stiffness / driver["hinge_frequency"]
    return damping if stiffness * h * h <= 1 else max(damping, 2 * sqrt(stiffness))


@kernel
def set_shares(joints, driver, lead, h):
    """Set the response of all modes over a substep of length h, as the law with this `lead` asks it."""
    for i in range(driver["chain_count"]):
        first, end = driver["chains"][i, 0], driver["chains"][i, 1] + 1
        for m in range(first, end if joints[first]["pace"] > 0 else first):
            _find_motion(joints[m], driver, h, h)
            moved, speed = joints[m]["motion"][4], joints[m]["motion"][5]
            joints[m]["share"] = (1 - lead) * speed / h + 2 * lead * moved / (h * h)


@kernel
def enter_hinges(joints, driver, dt):
    """Set the hinges' paths of a frame: from the angles at its start to those that the driven loop left."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["end_angle"] = joint["path_end"] = joint["angle"]
        joint["path_start"] = joint["shown_angle"]
        if joint["coordinate"] >= 0:
            joint["end_offset"], joint["end_offset_rate"] = joint["offset"], joint["offset_rate"]
            joint["path_start"] -= joint["old_offset"]
            joint["path_end"] -= joint["offset"]
        joint["old_rate"] = (joint["path_end"] - joint["path_start"]) / dt + joint["old_offset_rate"]


@kernel
def leave_hinges(joints, driver, pressed):
    """End the hinges' frame: chains keep what contact made of them; without contact all end where the driven
    loop left them."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["coordinate"] < 0:
            joint["angle"], joint["rate"] = joint["end_angle"], joint["target_rate"]
        elif not pressed:
            joint["angle"] = joint["end_angle"]
            joint["offset"], joint["offset_rate"] = joint["end_offset"], joint["end_offset_rate"]
        else:
            angle = min(max(joint["angle"], joint["lower"]), joint["upper"])
            if abs(angle - joint["angle"]) <= LIMIT_ROUNDING:
                joint["angle"] = angle


@kernel
def begin_hinges(joints, driver):
    """Store the hinges' angles and rates at the start of a substep."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["old_angle"], joint["old_rate"] = joint["angle"], joint["rate"]
        joint["old_offset"], joint["old_offset_rate"] = joint["offset"], joint["offset_rate"]


@kernel
def return_hinges(joints, driver):
    """Return the hinges to the start of their substep."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["angle"], joint["rate"] = joint["old_angle"], joint["old_rate"]
        joint["offset"], joint["offset_rate"] = joint["old_offset"], joint["old_offset_rate"]


@kernel
def clear_twists(joints, driver, both):
    """Set the changes by impulses of the law of velocities to zero or, if `both`, those of both laws."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["twist"] = 0.0
        if both:
            joints[k]["shift_twist"] = 0.0


@kernel
def advance_hinges(joints, driver, t, h, dt, share):
    """Set the hinges' angles and rates a time t after the start of their substep of length h, with a share
    of the response to its forces."""
    for i in range(driver["chain_count"]):
        first, end, moves = driver["chains"][i, 0], driver["chains"][i, 1] + 1, False
        for k in range(first, end):
            joint = joints[k]
            joint["offset"] = joint["offset_rate"] = 0.0
            moves = moves or joint["old_offset"] != 0 or joint["old_offset_rate"] != 0
            moves = moves or joint["twist"] != 0 or joint["shift_twist"] != 0
        if moves:
            _follow_modes(joints, driver, first, end, t, h, share)
    time = driver["clock"] + t
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        pace = (joint["path_end"] - joint["path_start"]) / dt
        joint["angle"], joint["rate"] = joint["path_start"] + pace * time, pace
        if joint["coordinate"] >= 0:
            joint["angle"] += joint["offset"]
            joint["rate"] += joint["offset_rate"]


@kernel
def find_limits(joints, driver):
    """Make rows of the limits that are exceeded at the hinges' present angles, those at the end of a substep;
    returns whether any is new. What has left one limit may reach the other."""
    found = False
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint, side = joints[k], 0
        if joint["coordinate"] < 0 or (joint["limited"] != 0 and joint["limit_impulse"] != 0):
            continue
        if joint["angle"] < joint["lower"] - LIMIT_ROUNDING:
            side = 1
        elif joint["angle"] > joint["upper"] + LIMIT_ROUNDING:
            side = -1
        if side != 0 and side != joint["limited"]:
            joint["limited"], found = side, True
            joint["limit_impulse"] = joint["shift_limit_impulse"] = 0.0
    return found


@kernel
def has_limits(joints, driver):
    """Whether a limit of a driver's hinges is a row."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        if joints[k]["limited"] != 0:
            return True
    return False


@kernel
def drop_limits(joints, driver):
    """Drop the rows of limits without impulse that the hinges have left."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["limited"] != 0 and joint["limit_impulse"] == 0 and limit_gap(joint) > LIMIT_ROUNDING:
            joint["limited"] = 0


@kernel
def limit_gap(joint):
    """Angle between a hinge and the limit that is a row [rad]."""
    if joint["limited"] > 0:
        return joint["angle"] - joint["lower"]
    return joint["upper"] - joint["angle"]


@kernel
def meets_limit(joints, driver):
    """Whether a hinge of a driver moves into a limit at which it is."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["limited"] * joint["rate"] < 0 and limit_gap(joint) <= LIMIT_ROUNDING:
            return True
    return False


@kernel
def ask_limits(joints, driver, lead, h):
    """Set what the rows of limits ask over a substep of length h, at whose start the hinges are: they may
    close their gap at most. `lead` is 1 in the law of positions, which asks for twice the mean rate and takes
    back what a substep that ended early left beyond a limit."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["limited"] != 0:
            gap = limit_gap(joint)
            beyond = gap - min(max(gap, -LIMIT_ERROR), LIMIT_ERROR)
            joint["limit_floor"] = -2 * beyond / h if lead == 1 else -max(beyond, 0.0) / h
            joint["limit_free"] = joint["limited"] * (joint["rate"] + joint["lead_rate"])


@kernel
def exchange_limits(joints, driver):
    """Exchange the impulses of limits in the law of velocities with those in the law of positions."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["limit_impulse"], joint["shift_limit_impulse"] = (
            joint["shift_limit_impulse"],
            joint["limit_impulse"],
        )


@kernel
def set_lead_rates(joints, driver, lead, h):
    """Set `lead_rate`, at the hinges' angles and rates at the end of a substep of length h."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["lead_rate"] = lead * (2 * (joint["angle"] - joint["old_angle"]) / h - joint["rate"])


@kernel
def exchange_rates(joints, driver):
    """Exchange the hinges' rates with their `lead_rate`."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["rate"], joints[k]["lead_rate"] = joints[k]["lead_rate"], joints[k]["rate"]

"""Hinges of drivers that move in the simulated loop.

Hinges outside chains go evenly through a frame. A hinge of a chain does so too, along the path that the
driven loop found, but for the offset x that forces of simulated bodies caused. With the servo of the dynamics
engines it obeys

    x'' = -w^2 x - 2 w x' + S^-1 J' f          (`hinge_response`)

in closed form over a substep with constant forces f. The limit of a hinge that would leave it by that becomes
a row of the contact solver.
"""

from touchstone.reference_impl.continuous.coupling_response import decay, unit_response
from touchstone.reference_impl.core.kernel import kernel

LIMIT_ROUNDING = 1e-9
"""Angle beyond a limit that is none [rad]: 1e-9 m."""
LIMIT_ERROR = LIMIT_ROUNDING / 10
"""Angle to a limit that counts as none, so that what rests at it has no rate [rad]."""


@kernel
def follow_servo(joint, frequency, h):
    """Advance a hinge's offset by a time h without forces; returns whether there is an offset."""
    x, rate = joint["offset"], joint["offset_rate"]
    if x == 0 and rate == 0:
        return False
    x, rate = decay(x, rate, frequency * frequency, 2 * frequency, h)
    if abs(x) < LIMIT_ROUNDING and abs(h * rate) < LIMIT_ROUNDING:
        x = rate = 0.0
    joint["offset"], joint["offset_rate"] = x, rate
    return True


@kernel
def hinge_response(driver, h):
    """`unit_response` of the hinges of a driver's chains."""
    return unit_response(driver["hinge_frequency"] ** 2, 2 * driver["hinge_frequency"], h)


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
    time, turned, spin, w = driver["clock"] + t, 0.0, 0.0, driver["hinge_frequency"]
    if driver["hinge_count"] > 0:
        turned, spin = hinge_response(driver, t)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        pace = (joint["path_end"] - joint["path_start"]) / dt
        path = joint["path_start"] + pace * time
        if joint["coordinate"] < 0:
            joint["angle"], joint["rate"] = path, pace
            continue
        x, rate = decay(joint["old_offset"], joint["old_offset_rate"], w * w, 2 * w, t)
        x += share * turned / h * joint["shift_twist"]
        rate += share * spin / h * joint["twist"]
        joint["offset"], joint["offset_rate"] = x, rate
        joint["angle"], joint["rate"] = path + x, pace + rate


@kernel
def find_limits(joints, driver):
    """Make rows of the limits that are exceeded at the hinges' present angles, those at the end of a substep;
    returns whether any is new."""
    found = False
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["coordinate"] < 0 or joint["limited"] != 0:
            continue
        if joint["angle"] < joint["lower"] - LIMIT_ROUNDING:
            joint["limited"], found = 1, True
        elif joint["angle"] > joint["upper"] + LIMIT_ROUNDING:
            joint["limited"], found = -1, True
        if joint["limited"] != 0:
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

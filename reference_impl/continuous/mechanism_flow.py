"""Motion of mechanisms under the forces of gravity, joints, and known impulses.

By the method of Dormand & Prince (1980), of fifth order, in steps whose error is at most the setting
`joint_error`. Where springs or dampers are too stiff for its steps, by Euler's method, implicit in these,
extrapolated in the number of its steps (Deuflhard 1985).
"""

from math import sqrt

from touchstone.reference_impl.continuous.mechanism_dynamics import (
    answer_step,
    close_loops,
    has_springs,
    joint_mobility,
    joint_power,
    set_slope,
    weigh_mechanism,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.mechanism import add_rates, move_mechanism, pose_mechanism

STEP_GROWTH, STEP_SHARE = 5.0, 0.9
"""Most growth of a step, and share of the length that its error allows [1]."""
MOST_STEPS = 512
"""Most attempts at steps of a substep."""
STIFF = 10.0
"""Rate of a joint's spring and damper times the length of a substep [rad] above which its motion is stiff:
steps of an explicit method, which are stable up to 3.3, cost more than those of an implicit one."""
COLUMNS = 6
"""Most results of Euler's method that an extrapolation takes: of 1, 2, ... steps."""
ENOUGH_COLUMNS = 4
"""Results of Euler's method after which the next extrapolation may be of twice the length."""


@kernel
def flow(bodies, joints, driver, time):
    """Advance a mechanism from its positions and rates by a time [s] under its known forces.

    Sets `work`.

    Returns:
        Whether it took at most MOST_STEPS; otherwise the mechanism is where these led.
    """
    pose_mechanism(bodies, joints, driver)
    move_mechanism(bodies, joints, driver)
    if driver["constrained"] == 1 or has_springs(joints, driver):
        weigh_mechanism(bodies, joints, driver)
    driver["work"] = 0.0
    if _is_stiff(joints, driver, time):
        ended = _flow_implicitly(bodies, joints, driver, time)
    else:
        ended = _flow_explicitly(bodies, joints, driver, time)
    if driver["constrained"] == 1:
        close_loops(bodies, joints, driver)
    return ended


@kernel
def _is_stiff(joints, driver, time):
    """Whether a spring or damper that is not held is too stiff for the explicit method over a time [s]."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        stiffness, damping = joints[k]["stiffness"], joints[k]["damping"]
        if joints[k]["held"] == 0 and joints[k]["width"] > 0 and stiffness + damping > 0:
            m = joint_mobility(joints[k], driver)
            if time * (damping * m + sqrt(stiffness * m)) > STIFF:
                return True
    return False


@kernel
def _stage(bodies, joints, driver, k, a, h):
    """Slope k of a step of length h from `stage_start`, at the sum of the slopes before with weights a."""
    size, count = driver["position_count"], driver["hinge_count"]
    for i in range(size + count):
        x = driver["stage_start"][i]
        for j in range(k):
            x += h * a[j] * driver["slopes"][j, i]
        if i < size:
            driver["positions"][i] = x
        else:
            driver["rates"][i - size] = x
    _move(bodies, joints, driver)
    set_slope(bodies, joints, driver, driver["slopes"][k])


@kernel
def _move(bodies, joints, driver):
    """Pose and move a mechanism's bodies by its positions and rates; weighs it if it is constrained."""
    pose_mechanism(bodies, joints, driver)
    move_mechanism(bodies, joints, driver)
    if driver["constrained"] == 1:
        weigh_mechanism(bodies, joints, driver)


@kernel
def _step(bodies, joints, driver, h):
    """A step of length h from `stage_start`, whose first slope is known; returns its error."""
    a = (1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0)
    _stage(bodies, joints, driver, 1, a, h)
    a = (3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0)
    _stage(bodies, joints, driver, 2, a, h)
    a = (44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0)
    _stage(bodies, joints, driver, 3, a, h)
    a = (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0)
    _stage(bodies, joints, driver, 4, a, h)
    a = (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0)
    _stage(bodies, joints, driver, 5, a, h)
    a = (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84)
    _stage(bodies, joints, driver, 6, a, h)
    s, error, size = driver["slopes"], 0.0, driver["position_count"]
    for i in range(size + driver["hinge_count"]):
        e = 71 / 57600 * s[0, i] - 71 / 16695 * s[2, i] + 71 / 1920 * s[3, i]
        e += -17253 / 339200 * s[4, i] + 22 / 525 * s[5, i] - 1 / 40 * s[6, i]
        error = max(error, h * abs(e) * (1.0 if i < size else h))
    return error


@kernel
def _flow_explicitly(bodies, joints, driver, time):
    """`flow` by steps of Dormand and Prince."""
    size, count = driver["position_count"], driver["hinge_count"]
    set_slope(bodies, joints, driver, driver["slopes"][0])
    left, h, slopes, end = time, time, driver["slopes"], size + count
    for _ in range(MOST_STEPS):
        last = h >= left
        if last:
            h = left
        _store(driver, driver["stage_start"])
        error = _step(bodies, joints, driver, h)
        grown = STEP_GROWTH if error == 0 else 0.0
        if error > 0:
            grown = min(STEP_GROWTH, STEP_SHARE * (driver["step_error"] / error) ** 0.2)
        if error <= driver["step_error"]:
            left -= h
            x = 35 / 384 * slopes[0, end] + 500 / 1113 * slopes[2, end] + 125 / 192 * slopes[3, end]
            driver["work"] += h * (x - 2187 / 6784 * slopes[4, end] + 11 / 84 * slopes[5, end])
            if last:
                return True
            for i in range(end + 1):
                slopes[0, i] = slopes[6, i]
        else:
            _restore(driver, driver["stage_start"])
        h *= max(grown, 0.1)
    return False


@kernel
def _store(driver, out_x):
    """Copy a mechanism's positions, then its rates."""
    size = driver["position_count"]
    for i in range(size):
        out_x[i] = driver["positions"][i]
    for i in range(driver["hinge_count"]):
        out_x[size + i] = driver["rates"][i]


@kernel
def _restore(driver, x):
    """Set a mechanism's positions and rates to those of `_store`."""
    size = driver["position_count"]
    for i in range(size):
        driver["positions"][i] = x[i]
    for i in range(driver["hinge_count"]):
        driver["rates"][i] = x[size + i]


@kernel
def _flow_implicitly(bodies, joints, driver, time):
    """`flow` by extrapolation of Euler's method."""
    left, h, table = time, time, driver["slopes"]
    end = driver["position_count"] + driver["hinge_count"]
    for _ in range(MOST_STEPS):
        last = h >= left
        if last:
            h = left
        _store(driver, driver["stage_start"])
        driver["stage_start"][end] = driver["work"]
        columns = _extrapolate(bodies, joints, driver, h)
        if columns > COLUMNS:
            _restore(driver, driver["stage_start"])
            driver["work"] = driver["stage_start"][end]
            h /= 2
            continue
        _restore(driver, table[1])
        driver["work"] = table[1, end]
        left -= h
        if last:
            left = 0.0
            break
        if columns <= ENOUGH_COLUMNS:
            h *= 2
    _move(bodies, joints, driver)
    return left == 0


@kernel
def _extrapolate(bodies, joints, driver, h):
    """Set row 1 of `slopes` to the state a time h after `stage_start`, with the work done, by the scheme of
    Aitken and Neville; returns how many results of Euler's method it took, one more than COLUMNS if its error
    is too large."""
    size, count, table = driver["position_count"], driver["hinge_count"], driver["slopes"]
    for n in range(1, COLUMNS + 1):
        _restore(driver, driver["stage_start"])
        driver["work"] = driver["stage_start"][size + count]
        _steps_of_euler(bodies, joints, driver, n, h / n)
        _store(driver, table[n])
        table[n, size + count] = driver["work"]
        for k in range(n - 1, 0, -1):
            for i in range(size + count + 1):
                table[k, i] = table[k + 1, i] + (table[k + 1, i] - table[k, i]) * k / (n - k)
        error = 0.0
        for i in range(size + count):
            error = max(error, abs(table[1, i] - table[2, i]) * (1.0 if i < size else h))
        if n > 1 and error <= driver["step_error"]:
            return n
    return COLUMNS + 1


@kernel
def _steps_of_euler(bodies, joints, driver, steps, h):
    """Advance a mechanism by steps of length h, implicit in springs and dampers."""
    count, slope, x = driver["hinge_count"], driver["slopes"][0], driver["force"]
    end = driver["position_count"] + count
    for _ in range(steps):
        # springs act where the rates lead
        pose_mechanism(bodies, joints, driver)
        add_rates(bodies, joints, driver, driver["rates"], h)
        pose_mechanism(bodies, joints, driver)
        move_mechanism(bodies, joints, driver)
        answer_step(joints, driver, h)
        if driver["constrained"] == 1:
            weigh_mechanism(bodies, joints, driver)
        set_slope(bodies, joints, driver, slope)
        driver["stiffened"] = 0
        driver["work"] += h * (slope[end] - joint_power(joints, driver))
        for i in range(count):
            x[i] = h * slope[driver["position_count"] + i]
            driver["rates"][i] += x[i]
        add_rates(bodies, joints, driver, x, h)
        driver["work"] += h * joint_power(joints, driver)

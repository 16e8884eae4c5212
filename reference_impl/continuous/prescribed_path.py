"""Path of a prescribed body within a frame: cubics through its poses and velocities at both ends."""

from touchstone.reference_impl.core.conventions import GAP_LEFT
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import rotation_between, turn

PATH_ERROR = GAP_LEFT / 10
"""Distance of a frame's path from a parabola that is rounding [m]."""


@kernel
def follow_path(driver, time, dt):
    """Set a prescribed driver's pose and velocities at a time of its frame: the cubics through its poses and
    velocities at both ends of the frame; of its rotation, a cubic rotation vector.

    With r the rotation vector since the frame's start, omega = r' + r x r' / 2 + r x (r x r') / 6 to third
    order.
    """
    s = time / dt
    start, rise = 1 - s * s * (3 - 2 * s), s * s * (3 - 2 * s)
    first, last = dt * s * (1 - s) * (1 - s), -dt * s * s * (1 - s)
    climb, early, late = 6 * s * (1 - s) / dt, (1 - s) * (1 - 3 * s), s * (3 * s - 2)
    turned, rate, arc = driver["scratch"][1], driver["scratch"][2], driver["scratch"][0]
    rotation_between(driver["old_target_orientation"], driver["target_orientation"], arc)
    turned[0], turned[1], turned[2] = arc[0], arc[1], arc[2]
    w0, w1, w = driver["old_target_omega"], driver["target_omega"], driver["omega"]
    # the rate of the rotation vector at the end, from omega there
    x, y, z = _cross(turned, w1)
    rate[0], rate[1], rate[2] = x, y, z
    u, v, t = _cross(turned, rate)
    rate[0], rate[1], rate[2] = w1[0] - x / 2 + u / 12, w1[1] - y / 2 + v / 12, w1[2] - z / 2 + t / 12
    for i in range(3):
        x0, x1 = driver["old_target_position"][i], driver["target_position"][i]
        v0, v1 = driver["old_target_velocity"][i], driver["target_velocity"][i]
        driver["position"][i] = start * x0 + rise * x1 + first * v0 + last * v1
        driver["velocity"][i] = climb * (x1 - x0) + early * v0 + late * v1
        angle, end = turned[i], rate[i]
        turned[i] = rise * angle + first * w0[i] + last * end
        rate[i] = climb * angle + early * w0[i] + late * end
    x, y, z = turned[0], turned[1], turned[2]
    turn(driver["old_target_orientation"], x, y, z, driver["orientation"])
    x, y, z = _cross(turned, rate)
    w[0], w[1], w[2] = x, y, z
    u, v, t = _cross(turned, w)
    w[0], w[1], w[2] = rate[0] + x / 2 + u / 6, rate[1] + y / 2 + v / 6, rate[2] + z / 2 + t / 6


@kernel
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@kernel
def is_parabola(driver, dt):
    """Whether a prescribed driver moves over its frame as a body under a constant force: without rotation,
    and with a constant acceleration. Contacts on it are then those of a fixed body in other gravity."""
    x0, x1 = driver["old_target_position"], driver["target_position"]
    v0, v1 = driver["old_target_velocity"], driver["target_velocity"]
    bend = turned = 0.0
    for i in range(3):
        bend = max(bend, abs(x1[i] - x0[i] - dt * (v0[i] + v1[i]) / 2))
        turned = max(turned, abs(driver["old_target_omega"][i]), abs(driver["target_omega"][i]))
    for i in range(4):
        turned = max(turned, abs(driver["target_orientation"][i] - driver["old_target_orientation"][i]))
    return bend <= PATH_ERROR and turned == 0

"""Virtual coupling of a driven body to its tracker (Eq. 6), solved in closed form."""

from math import sqrt

from touchstone.reference_impl.continuous.coupling_response import decay, decay_turn
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, rotation_between, times, turn

COUPLING_REACH = 0.5
"""Distance of a driver with chains from its tracker beyond which the coupling pulls no stronger [m]."""


@kernel
def follow_tracker(driver, h):
    """Move a driver's root for one frame: Eq. 6 in translation, critically damped at sqrt(K / m) in rotation.

    The tracker moves linearly within the frame, from its old target to its new one. The spring of a
    driver with chains pulls as at COUPLING_REACH where it is longer: it would pull the driver through an
    obstacle to a tracker far behind it. A prescribed driver takes its tracker's pose and velocities. Stores
    where the spring pulls, `goal_start` and `goal_end`.
    """
    copy_vector(driver["old_target_position"], driver["goal_start"])
    copy_vector(driver["target_position"], driver["goal_end"])
    if driver["prescribed"] == 1:
        copy_vector(driver["target_position"], driver["position"])
        for i in range(4):
            driver["orientation"][i] = driver["target_orientation"][i]
        copy_vector(driver["target_velocity"], driver["velocity"])
        copy_vector(driver["target_omega"], driver["omega"])
        return
    stiffness, damping = driver["stiffness"] / driver["mass"], driver["damping"] / driver["mass"]
    far = 0.0
    for i in range(3):
        far += (driver["position"][i] - driver["old_target_position"][i]) ** 2
    limited = driver["chain_count"] > 0 and far > COUPLING_REACH**2
    beyond = 1 - COUPLING_REACH / sqrt(far) if limited else 0.0
    for i in range(3):
        old, new = driver["old_target_position"][i], driver["target_position"][i]
        pace = (new - old) / h
        if beyond > 0:
            old += beyond * (driver["position"][i] - old)
            new = old + h * pace
            driver["goal_start"][i], driver["goal_end"][i] = old, new
        x, v = decay(driver["position"][i] - old, driver["velocity"][i] - pace, stiffness, damping, h)
        driver["position"][i] = new + x
        driver["velocity"][i] = pace + v
    _follow_rotation(driver, stiffness, h)


@kernel
def _follow_rotation(driver, stiffness, h):
    turned, error = driver["scratch"][0], driver["scratch"][1]
    rotation_between(driver["old_target_orientation"], driver["target_orientation"], turned)
    rotation_between(driver["old_target_orientation"], driver["orientation"], error)
    w = driver["omega"]
    w[0], w[1], w[2] = decay_turn(error, w, times(1 / h, turned), stiffness, h)
    turn(driver["target_orientation"], error[0], error[1], error[2], driver["orientation"])

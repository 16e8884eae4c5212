"""Virtual coupling between a tracker and its driven object (section "Impulses", Eq. 6)."""

from math import cos, exp, sin, sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import rotation_between, turn
from touchstone.reference_impl.paper.vectors import scaled, sub, vector

NEAR_CRITICAL = 1e-5
"""(w h)^2 below which three terms of the series of sin and sinh are exact to rounding [1]: the exact formula
divides 0 by 0 at critical damping."""


@kernel
def follow_tracker(driver, h):
    """Move a driven object's root for a frame of length h [s], its tracker from `old_target_*` to `target_*`.

    Sets `position`, `orientation` and the coupling velocities `velocity` and `omega`, which carry over to the
    next frame; impulses change them.
    """
    k, r = driver["stiffness"] / driver["mass"], driver["damping"] / driver["mass"]
    # The paper leaves open how the tracker moves within a frame: linearly, at the velocity `pace`
    for i in range(3):
        old, new = driver["old_target_position"][i], driver["target_position"][i]
        pace = (new - old) / h
        x, x_rate = coupled(driver["position"][i] - old, driver["velocity"][i] - pace, k, r, h)
        driver["position"][i], driver["velocity"][i] = new + x, pace + x_rate
    # The paper leaves open the rotation of the coupling: Eq. 6 for the rotation vector from the tracker, with
    # the same K / m and R / m
    turned, away = driver["scratch"][0], driver["scratch"][1]
    rotation_between(driver["old_target_orientation"], driver["target_orientation"], turned)
    rotation_between(driver["old_target_orientation"], driver["orientation"], away)
    pace = scaled(1 / h, (turned[0], turned[1], turned[2]))
    rate = sub(vector(driver["omega"]), pace)
    for i in range(3):
        away[i], x_rate = coupled(away[i], rate[i], k, r, h)
        driver["omega"][i] = pace[i] + x_rate
    turn(driver["target_orientation"], away[0], away[1], away[2], driver["orientation"])


@kernel
def coupled(x, x_rate, k, r, h):
    """Eq. 6, m x'' = -K x - R x', over a time h: x and x' at its end.

    The paper leaves open the integration: the closed form, since explicit steps diverge for light objects
    (below 0.40 kg at 60 frames per second with K = 1000 N/m and R = 40 N s/m).

    Args:
        x, x_rate: deviation from the tracker [m or rad] and its rate, at the start.
        k, r: K / m [1/s^2] and R / m [1/s].
        h: time [s].
    Returns:
        (x, x_rate) at the end.
    """
    b = r / 2
    square = k - b * b
    # x(t) = e^(-b t) (x c(t) + (x' + b x) s(t)); `c` and `s` here have the factor e^(-b h)
    if abs(square) * h * h < NEAR_CRITICAL:
        q = -square * h * h
        c, s = exp(-b * h) * (1 + q / 2 + q * q / 24), exp(-b * h) * h * (1 + q / 6 + q * q / 120)
    elif square > 0:
        w = sqrt(square)
        c, s = exp(-b * h) * cos(w * h), exp(-b * h) * sin(w * h) / w
    else:
        w = sqrt(-square)
        # k / (b + w) is b - w without cancellation
        slow, fast = exp(-k / (b + w) * h), exp(-(b + w) * h)
        c, s = (slow + fast) / 2, (slow - fast) / (2 * w)
    return x * c + (x_rate + b * x) * s, x_rate * c - (b * x_rate + k * x) * s

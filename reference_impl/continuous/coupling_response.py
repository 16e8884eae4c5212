"""Closed form of Eq. 6: the damped spring's free motion, and its response to a constant force."""

from math import cos, cosh, exp, expm1, sin, sinh, sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import plus, rate_of, spin_of, turned_by, vector_of

NEAR_CRITICAL = 1e-5
"""(w h)^2 below which three terms give a nearly critical spring to rounding: the next is 1e-15 / 720 [1]."""
SHORT = 1.0
"""Damping h and stiffness h^2 below which a power series gives the response [1]: 1 - decay would cancel."""
APART = 1e-2
"""(w h)^2 above which an overdamped spring is two exponentials, of which differences do not cancel [1]."""
SERIES_TERMS = 24
"""Terms of that series: the last is below 1 / 24!."""


@kernel
def decay(x, v, stiffness, damping, h):
    """Solve the damped spring x'' = -stiffness x - damping x' over a time h, for any stiffness and step.

    Args:
        x, v: deviation [m or rad] and its rate at the start.
        stiffness, damping: per unit mass [1/s^2], [1/s].
        h: time [s].
    Returns:
        (x, v) at the end.
    """
    half = damping / 2
    square = half * half - stiffness
    if abs(square) * h * h < NEAR_CRITICAL:
        # use the common series: both formulas divide 0 by 0 at critical damping
        q = square * h * h
        c, s = 1 + q / 2 + q * q / 24, h * (1 + q / 6 + q * q / 120)
    elif square < 0:
        w = sqrt(-square)
        c, s = cos(w * h), sin(w * h) / w
    else:
        w = sqrt(square)
        # far above critical damping, cosh overflows although its product with exp does not
        if w * h > 30:
            slow = exp(-stiffness / (half + w) * h)
            return (x + (v + half * x) / w) * slow / 2, (v - (half * v + stiffness * x) / w) * slow / 2
        c, s = cosh(w * h), sinh(w * h) / w
    e = exp(-half * h)
    return e * (x * c + (v + half * x) * s), e * (v * c - (half * v + stiffness * x) * s)


@kernel
def decay_turn(error, omega, pace, stiffness, h):
    """Solve Eq. 6 for the rotation vector `error` from a goal, critically damped, over a time h; in place.

    Args:
        error: rotation vector from the goal to the body (3,) [rad].
        omega: angular velocity of the body (3,) [rad/s].
        pace: that of the goal, which is constant; a tuple.
        stiffness, h: as in `decay`.
    Returns:
        Angular velocity of the body at the end.
    """
    e, damping = vector_of(error), 2 * sqrt(stiffness)
    rate = rate_of(e, plus(omega, -1.0, turned_by(e, pace)))
    x, p = decay(e[0], rate[0], stiffness, damping, h)
    y, q = decay(e[1], rate[1], stiffness, damping, h)
    z, r = decay(e[2], rate[2], stiffness, damping, h)
    error[0], error[1], error[2] = x, y, z
    return plus(turned_by((x, y, z), pace), 1.0, spin_of((x, y, z), (p, q, r)))


@kernel
def unit_response(stiffness, damping, h):
    """Displacement [s^2] and velocity [s] after a time h of a constant unit acceleration on a damped spring
    that starts at rest; arguments as in `decay`.

    A constant force f on a mass m thus gives the displacement f / m times the first: f / K in the long run.
    """
    a, b = damping * h, stiffness * h * h
    if a < SHORT and b < SHORT:
        # y'' = 1 - a y' - b y with the time in units of h: y = sum of c_n t^n
        before, term, moved, speed = 0.0, 0.5, 0.5, 1.0
        for n in range(1, SERIES_TERMS):
            before, term = term, -(a * (n + 1) * term + b * before) / ((n + 1) * (n + 2))
            moved += term
            speed += (n + 2) * term
        return moved * h * h, speed * h
    square = damping * damping / 4 - stiffness
    if square * h * h > APART:
        # two exponentials, of which the slow one may hardly decay
        w = sqrt(square)
        fast = damping / 2 + w
        slow = stiffness / fast
        moved = (slow * expm1(-fast * h) - fast * expm1(-slow * h)) / (2 * w * stiffness)
        return moved, (exp(-slow * h) - exp(-fast * h)) / (2 * w)
    left, _ = decay(1.0, 0.0, stiffness, damping, h)
    speed, _ = decay(0.0, 1.0, stiffness, damping, h)
    return (1 - left) / stiffness, speed

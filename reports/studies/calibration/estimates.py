"""Estimates of restitution and friction from the bodies' motion.

In a free step of a body only gravity changes its velocity; in any other step the floor acts on it.
"""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import Array

FREE = 1e-3
"""Share of its weight by which the floor may push a free body [1]: a solver's residual is far smaller."""
SLIP_WINDOW = (0.7, 0.2)
"""Shares of the first slip between which friction is measured [1]: contacts have settled, and none sticks."""
BOUNCES = 0.25
"""Least restitution at which a body counts as bouncing, for a requested restitution of 1 [1]."""


def restitution_of(gap: Array, rate: Array, g: float, dt: float, level: float = 0.0) -> float:
    """Speed after the first contact over that before it, both extrapolated to the height of contact under
    gravity.

    Args:
        gap, rate: height over the floor [m] and its velocity [m/s], (n,), every dt [s].
        level: height at which bodies touch [m]: 0, except for an engine with a contact margin. Returns:
        0 where the body never rises freely again; NaN where it never lands.
    """
    free = np.abs(np.diff(rate) + g * dt) < FREE * g * dt
    if free.all():
        return float("nan")
    k = int(np.argmin(free))
    approach = rate[k] ** 2 + 2 * g * (gap[k] - level)
    # Out of contact: above the floor or free again, and rising; a body that is only braked still falls.
    later = np.arange(k + 1, len(free))
    left = later[(rate[later] > 0) & ((gap[later] > level) | free[later])]
    if not len(left) or approach <= 0:
        return 0.0
    m = int(left[0])
    return float(np.sqrt(max(0.0, rate[m] ** 2 + 2 * g * (gap[m] - level)) / approach))


def rebound_of(gap: Array) -> float:
    """Square root of the rebound height after the first contact over the drop height; gap (n,) [m]."""
    rising = np.flatnonzero(np.diff(gap) > 0)
    top = float(gap[rising[0] :].max()) if len(rising) else 0.0
    return float(np.sqrt(max(0.0, top) / gap[0]))


def friction_of(velocity: Array, slip: Array, g: float, dt: float) -> float:
    """Mean deceleration over g while the slip falls from 70 to 20 % of the first.

    Args:
        velocity, slip: of the centre of mass, and of the surface over the floor, horizontal (n, 2) [m/s].
    Returns:
        NaN where the slip does not fall that far, or within one step.
    """
    speed = np.linalg.norm(slip, axis=1)
    below = [np.flatnonzero(speed <= share * speed[0]) for share in SLIP_WINDOW]
    if not all(map(len, below)) or below[0][0] == below[1][0]:
        return float("nan")
    first, last = int(below[0][0]), int(below[1][0])
    lost = velocity[first] - velocity[last]
    return float(lost @ slip[0] / speed[0] / ((last - first) * dt * g))


def lowest_speed(speeds: Array, achieved: Array) -> float:
    """The least of ascending speeds from which all return at least BOUNCES [m/s]; NaN if there is none."""
    bouncing = np.append(np.flatnonzero(~(achieved >= BOUNCES)), -1).max() + 1
    return float(speeds[bouncing]) if bouncing < len(speeds) else float("nan")

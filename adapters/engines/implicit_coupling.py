"""Eq. 6 for one step of an engine whose integrator is semi-implicit Euler, without a limit on the step.

An engine computes v' = v + h f / m and x' = x + h v'. A spring and a damper whose force is held over the step
diverge there for light bodies. An implicit one adds an inertia (h R + h^2 K for implicit Euler) to the body.
Its contacts must see that inertia: DART and Bullet solve contacts with the inertia of the bodies alone, so
a force that their implicit springs or motors compute before the contacts presses with a part of K d (DART:
1 / (1 + h R / m + h^2 K / m)). So the inertia is given to the engine as a part of the driven body.

With y = x - x_t the step is  m' (v' - v) = h (-K y - D v),  where m' and D are chosen such that y decays by
the two factors z = exp(lambda h) of the closed form: m' = h^2 K / ((1 - z_1) (1 - z_2)) and
D = m' (1 - z_1 z_2) / h. At rest the force is K y whatever the step.
"""

from typing import NamedTuple

import numpy as np

RESOLVED = 1.0
"""Angle up to which a step resolves an oscillation [rad]; beyond it, implicit Euler damps it: near 2 pi the
samples of the closed form would stand still."""
NEAR_CRITICAL = 1e-5
"""Difference of the exponents, over 2, below which the roots count as equal [1]: an error of its square."""


class StepLaw(NamedTuple):
    """Force -stiffness y - damping (v - w) + lead (w' - w) of a step with the tracker's velocity w before it
    and w' in it, on a body whose inertia is larger by `added`."""

    added: float  # [kg], or [1] if the inertia is 1
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    lead: float  # [N s/m]


def held_law(stiffness: float, damping: float) -> StepLaw:
    """Eq. 6 at the step's start, held over the step; the velocity of the tracker is that in the step."""
    return StepLaw(0.0, stiffness, damping, damping)


def step_law(stiffness: float, damping: float, inertia: float, dt: float, lone: bool) -> StepLaw:
    """Law of a step for m y'' = -K y - R y'.

    Args:
        stiffness, damping: K [N/m] > 0 and R [N s/m].
        inertia: m [kg].
        dt: step [s].
        lone: whether the body always has this inertia: it has no hinges and turns about its mass centre.
            Otherwise the inertia that it shows may be smaller, and `added` is what any inertia needs.
    Returns:
        The law; the closed form for a linear motion of the tracker in each step, if the step resolves it.
    """
    half = damping / (2 * inertia)
    root = np.sqrt(complex(half * half - stiffness / inertia))
    second = -(half + root)
    first = stiffness / inertia / second
    if abs(first.imag) * dt > RESOLVED:
        drag = damping + dt * stiffness
        return StepLaw(dt * drag, stiffness, drag, drag)
    whole = stiffness * dt**2 / (np.expm1(first * dt) * np.expm1(second * dt)).real
    lost = -float(np.expm1(-2 * half * dt))
    if abs(root) * dt < NEAR_CRITICAL:
        kept = np.exp(-half * dt)
    else:
        kept = ((np.exp(first * dt) - np.exp(second * dt)) / (first - second)).real / dt
    drag = whole * lost / dt
    added = whole - inertia
    if not lone:
        added = max(added, drag * dt / 2 + stiffness * dt**2 / 4)
    return StepLaw(float(added), stiffness, float(drag), float(whole * (1 - kept) / dt))

"""`bounce_*`: a ball is dropped and bounces: heights h e^2k, contacts t_0 (1 + 2 (e + ... + e^k))."""

from __future__ import annotations

from math import sqrt

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import ball, slab

HEIGHT = 0.3
"""Drop height of the ball's lowest point [m]: it reaches the floor at 2.43 m/s."""
RADIUS = 0.05
DURATIONS: dict[float, float] = {0.0: 0.5, 0.3: 0.75, 0.5: 1.0, 0.8: 1.5, 1.0: 2.5}
"""Time for five bounces, or until the ball is at rest, per coefficient of restitution [s]."""
STILL = 1e-6
"""Speed of the last bounce before the ball is at rest [m/s]: it would rise by 5e-14 m."""


@scene
def bounces() -> tuple[Scenario, ...]:
    """A ball and a floor for each coefficient of restitution."""
    return tuple(_bounce(e, duration) for e, duration in DURATIONS.items())


def _bounce(e: float, duration: float) -> Scenario:
    return Scenario(
        name=f"bounce_e{e:g}".replace(".", ""),
        summary=f"a ball dropped from {HEIGHT:g} m bounces with e = {e:g}",
        tags=("probe", "impact", *(("conservative",) if e == 1 else ())),
        bodies=(slab("floor", "wood"), ball("ball", "wood", RADIUS, 1.0, (0.0, 0.0, RADIUS + HEIGHT))),
        coefficients=(PairCoefficients("wood", "wood", e, 0.5),),
        duration=duration,
        truths=(Truth("ball", "arcs", _arcs(e, duration)),),
    )


def _arcs(e: float, duration: float) -> tuple[Arc, ...]:
    falling = (0.0, 0.0, -GRAVITY)
    arcs = [Arc(0.0, (0.0, 0.0, RADIUS + HEIGHT), acceleration=falling)]
    time, speed = sqrt(2 * HEIGHT / GRAVITY), e * sqrt(2 * HEIGHT * GRAVITY)
    while time < duration and speed > STILL:
        arcs.append(Arc(time, (0.0, 0.0, RADIUS), (0.0, 0.0, speed), falling))
        time, speed = time + 2 * speed / GRAVITY, e * speed
    if time < duration:
        arcs.append(Arc(time, (0.0, 0.0, RADIUS)))
    return tuple(arcs)

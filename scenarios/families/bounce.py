"""`bounce_*`: a ball is dropped and bounces: heights h e^2k, contacts t_0 (1 + 2 (e + ... + e^k))."""

from math import sqrt

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import ball, slab
from touchstone.scenarios.truths.force_truth import ForceTruth

HEIGHT = 0.3
"""Drop height of the ball's lowest point [m]: it reaches the floor at 2.43 m/s."""
RADIUS, MASS = 0.05, 1.0
"""Radius [m] and mass [kg] of the ball."""
MEASURED = 0.35
"""Time between the first bounce, at 0.247 s, and the second, at 0.396 s or later [s]."""
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
        bodies=(slab("floor", "wood"), ball("ball", "wood", RADIUS, MASS, (0.0, 0.0, RADIUS + HEIGHT))),
        coefficients=(PairCoefficients("wood", "wood", e, 0.5),),
        duration=duration,
        truths=(Truth("ball", "arcs", _arcs(e, duration)),),
        forces=(ForceTruth("floor", "ball", 0.0, MEASURED, _impulse(e), "impulse"),),
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


def _impulse(e: float) -> float:
    """Impulse of the floor until MEASURED [N s]: m (1 + e) v, and the weight of a ball that stays there."""
    resting = MEASURED - sqrt(2 * HEIGHT / GRAVITY) if e == 0 else 0.0
    return MASS * ((1 + e) * sqrt(2 * HEIGHT * GRAVITY) + GRAVITY * resting)

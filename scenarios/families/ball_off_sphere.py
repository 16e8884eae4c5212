"""`ball_off_sphere*`: a ball slides or rolls down a fixed sphere until it leaves."""

from __future__ import annotations

from math import cos, radians, sin

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Body, PairCoefficients, Piece, Scenario, Sphere, Truth
from touchstone.scenarios.solids import ball

SPHERE, BALL = 1.0, 0.1
"""Radii of the fixed sphere and of the ball [m]."""
START = radians(5.0)
"""Angle from the top at which the ball is released [rad]."""


@scene
def balls_off_sphere() -> tuple[Scenario, Scenario]:
    """Without friction the ball leaves where cos(angle) = 2/3 cos(START); with it, it rolls, slips and
    leaves."""
    return (
        _scene("ball_off_sphere", "a ball slides off a fixed sphere without friction", 0.0),
        _scene("ball_off_sphere_rough", "a ball rolls down a fixed sphere, slips and leaves", 0.5),
    )


def _scene(name: str, summary: str, mu: float) -> Scenario:
    reach = SPHERE + BALL
    place = (reach * sin(START), 0.0, reach * cos(START))
    return Scenario(
        name=name,
        summary=summary,
        tags=("curved",) if mu else ("curved", "conservative"),
        bodies=(
            Body("sphere", "fixed", "wood", (Piece("sphere", Sphere(SPHERE)),)),
            ball("ball", "wood", BALL, 1.0, place),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, mu),),
        duration=1.5,
        truths=(Truth("ball", "smooth_contact"),),
    )

"""`ball_off_sphere*`: a ball slides or rolls down a fixed sphere until it leaves."""

from math import cos, radians, sin, sqrt

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import GRAVITY, Body, PairCoefficients, Piece, Scenario, Sphere, Truth
from touchstone.scenarios.solids import ball
from touchstone.scenarios.truths.published import Published

SPHERE, BALL = 1.0, 0.1
"""Radii of the fixed sphere and of the ball [m]."""
START = radians(5.0)
"""Angle from the top at which the ball is released [rad]."""

GOLDSTEIN = (
    "Goldstein (1980), Classical Mechanics, chapter 2: a body that slides off a sphere leaves at 2/3 of its "
    "first height, whence the level speed of its flight"
)


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
        tags=("curved",) if mu else ("curved", "conservative", "literature"),
        bodies=(
            Body("sphere", "fixed", "wood", (Piece("sphere", Sphere(SPHERE)),)),
            ball("ball", "wood", BALL, 1.0, place),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, mu),),
        duration=1.5,
        truths=(Truth("ball", "smooth_contact"),),
        published=() if mu else (_leaves(reach),),
    )


def _leaves(reach: float) -> Published:
    """The level speed after the ball has left, where its weight is all that bends its path: v^2 = g r cos."""
    level = 2 / 3 * cos(START)
    value = sqrt(GRAVITY * reach * level) * level
    return Published("speed", "ball", "velocity", value, 0.01 * value, GOLDSTEIN, 1.5, 1.5)

"""Cones on half-spaces: they roll on their side about their apex, stand on their base, and slide."""

from math import atan, atan2, cos, pi, radians, sin, tan

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth, vector
from touchstone.scenarios.solids import cone, half_space

MASS = 1.0
ROLLER = (0.1, 0.1)
"""Radius and half length of a cone that rolls on its side [m]."""
PACE = 2.0
"""Rate of its steady circle [rad/s]."""
SLOPE, SWING = radians(15.0), radians(50.0)
"""Angle of the plane on which it swings, and of its line of contact to the downhill direction at the start
[rad]."""
POST = (0.05, 0.15)
"""Radius and half length of a cone that tips at tan(slope) = 2/3 [m]."""


def _rolling(name: str, summary: str, slope: float, start: float, pace: float, duration: float) -> Scenario:
    """A cone on its side with its apex at the origin, whose line of contact has the angle `start` to the
    downhill direction and turns at the rate `pace` [rad/s]."""
    radius, half_length = ROLLER
    alpha = atan2(radius, 2 * half_length)
    tilt = Rotation.from_rotvec((0.0, slope, 0.0))
    turn = tilt * Rotation.from_rotvec((0.0, 0.0, start)) * Rotation.from_rotvec((0.0, -pi / 2 - alpha, 0.0))
    out = 1.5 * half_length * turn.apply((0.0, 0.0, -1.0))
    line = tilt.apply((cos(start), sin(start), 0.0))
    spin = -pace / tan(alpha) * line
    body = cone(
        "roller",
        "wood",
        radius,
        half_length,
        MASS,
        vector(out),
        quaternion(turn),
        velocity=vector(np.cross(spin, out)),
        spin=vector(spin),
    )
    return Scenario(
        name,
        summary,
        ("curved", "conservative"),
        (half_space("plane", "wood", orientation=quaternion(tilt)), body),
        duration,
        (PairCoefficients("wood", "wood", 0.0, 1.0),),
        truths=(Truth("roller", "rolling_cone"),),
    )


@scene
def cone_rolls() -> Scenario:
    """On a level plane a cone on its side rolls about its apex at a constant rate."""
    summary = "a cone rolls on its side about its apex, in a steady circle"
    return _rolling("cone_rolls", summary, 0.0, 0.0, PACE, 3.0)


@scene
def cone_swings() -> Scenario:
    """On a slope a cone on its side is a pendulum about the normal of the slope."""
    return _rolling(
        "cone_swings", "a cone on its side swings on a slope without slip", SLOPE, SWING, 0.0, 3.0
    )


@scene
def cone_holds() -> Scenario:
    """A cone stands on a slope at 0.9 of that at which its weight, at a quarter of its height, passes over
    the rim."""
    radius, half_length = POST
    slope = 0.9 * atan(radius / (half_length / 2))
    tilt = Rotation.from_rotvec((0.0, slope, 0.0))
    start = vector(tilt.apply((0.0, 0.0, half_length / 2)))
    return Scenario(
        "cone_holds",
        "a cone holds on a slope, by its width",
        ("probe",),
        (
            half_space("slope", "wood", orientation=quaternion(tilt)),
            cone("post", "wood", radius, half_length, MASS, start, quaternion(tilt)),
        ),
        1.0,
        (PairCoefficients("wood", "wood", 0.0, 1.0),),
        truths=(Truth("post", "arcs", (Arc(0.0, start),)),),
    )


@scene
def cone_slides() -> Scenario:
    """On its base, friction stops a cone that does not turn after v / (mu g)."""
    speed, mu, (radius, half_length) = 1.5, 0.3, ROLLER
    place, time = (0.0, 0.0, half_length / 2), speed / (mu * GRAVITY)
    arcs = (
        Arc(0.0, place, (speed, 0.0, 0.0), (-mu * GRAVITY, 0.0, 0.0)),
        Arc(time, (speed * time / 2, 0.0, half_length / 2)),
    )
    return Scenario(
        "cone_slides",
        "a cone slides on its base to a stop",
        ("probe",),
        (
            half_space("floor", "wood"),
            cone("cone", "wood", radius, half_length, MASS, place, velocity=(speed, 0.0, 0.0)),
        ),
        1.0,
        (PairCoefficients("wood", "wood", 0.0, mu),),
        truths=(Truth("cone", "arcs", arcs),),
    )

"""`turntable`: a ball on a turning plate, whose centre circles at 2/7 of the plate's rate."""

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import ORIGIN, Body, Box, PairCoefficients, Piece, Scenario, Truth
from touchstone.scenarios.solids import ball
from touchstone.scenarios.truths.published import Published

RATE = 2.0
"""Angular velocity of the plate [rad/s]."""
START, RADIUS = 0.1, 0.05
"""Distance of the ball from the axis at the start, and its radius [m]. It reaches six times that distance."""
PLATE = (0.8, 0.8, 0.05)
"""Half extents of the plate [m]."""
DURATION, KEYFRAMES = 6.0, 25
WELTNER = "Weltner (1979), Am. J. Phys. 47, 984: a solid ball rolls in circles at 2/7 of the plate's rate"


@scene
def turntable() -> Scenario:
    """The ball starts with the plate and rolls: its centre circles about a point at -2.5 times its start."""
    times = np.linspace(0.0, DURATION, KEYFRAMES)
    turned = Rotation.from_rotvec(np.outer(RATE * times, (0.0, 0.0, 1.0))).as_quat(scalar_first=True)
    path = keyframed("plate", times, ORIGIN, turned)
    return Scenario(
        name="turntable",
        summary="a ball rolls on a turning plate; its centre circles at 2/7 of the plate's rate",
        tags=("prescribed", "literature"),
        bodies=(
            Body("plate", "prescribed", "wood", (Piece("plate", Box(PLATE)),)),
            ball(
                "ball",
                "wood",
                RADIUS,
                1.0,
                (START, 0.0, PLATE[2] + RADIUS),
                velocity=(0.0, RATE * START, 0.0),
                spin=(0.0, 0.0, RATE),
            ),
        ),
        trackers=(path,),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=DURATION,
        truths=(Truth("ball", "turntable"),),
        published=(
            Published("rate", "ball", "turning", 2 / 7 * RATE, 0.01 * 2 / 7 * RATE, WELTNER, 0.0, DURATION),
        ),
    )

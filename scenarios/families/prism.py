"""`prism_rolls`: a prism of twelve sides tips from edge to edge down a slope."""

from math import cos, pi, radians, sin, sqrt

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import about_y
from touchstone.scenarios.scenario import (
    GRAVITY,
    PairCoefficients,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import hull, slab
from touchstone.scenarios.truths.published import Published

SIDES = 12
RADIUS, HALF_WIDTH = 0.1, 0.05
"""Of the corners, and of the prism along its axis [m]."""
SLOPE = radians(8.0)
"""Angle of the slope [rad]: at most 7.4 rad/s, at which the prism still presses on the slope."""
RATE = 5.0
"""Angular velocity about its lower edge at the start [rad/s]: enough to tip over."""

MCGEER = (
    "McGeer (1990), Int. J. Robotics Res. 9(2), 62, rimless wheel: each edge keeps (I + m R^2 cos(2 pi / n)) "
    "/ (I + m R^2) of the rate, a fall restores it; as others quote it, his page was not seen. Tolerance 2 "
    "%: 1.2 % off at the frames of 1 to 1.5 s"
)


@scene
def prism_rolls() -> Scenario:
    """It starts on one side, about to tip; every edge that lands takes the same share of its rate."""
    turn = about_y(SLOPE)
    angles = 2 * pi * (np.arange(SIDES) + 0.5) / SIDES
    corners: list[Vector] = [
        (RADIUS * sin(a), y, -RADIUS * cos(a)) for y in (-HALF_WIDTH, HALF_WIDTH) for a in angles
    ]
    slope, high = Rotation.from_quat(turn, scalar_first=True), RADIUS * cos(pi / SIDES)
    up, place = (vector(slope.apply((0.0, 0.0, z))) for z in (1.0, high))
    spin = (0.0, RATE, 0.0)
    pace = vector(np.cross(spin, slope.apply((-RADIUS * sin(pi / SIDES), 0.0, high))))
    body = hull("prism", "wood", corners, 1.0, place, turn, velocity=pace, spin=spin)
    about_edge = body.inertia[1][1] + RADIUS**2
    kept = (body.inertia[1][1] + RADIUS**2 * cos(2 * pi / SIDES)) / about_edge
    # each edge falls by 2 R sin(pi / n) sin(slope)
    gained = 4 * GRAVITY * RADIUS * sin(pi / SIDES) * sin(SLOPE) / about_edge
    fastest = sqrt(gained / (1 - kept**2))
    return Scenario(
        name="prism_rolls",
        summary="a prism of twelve sides tips from edge to edge down a slope",
        tags=("curved", "literature"),
        bodies=(slab("slope", "wood", up, turn), body),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 1.0),),
        duration=1.5,
        truths=(Truth("prism", "tipping"),),
        published=(
            Published(
                "largest rate", "prism", "spin", fastest, 0.02 * fastest, MCGEER, 1.0, 1.5, (0.0, 1.0, 0.0)
            ),
        ),
    )

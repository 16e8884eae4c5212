"""Boxes on conveyor belts: they slide at mu g against the slip until they move with the belt, also uphill."""

from math import cos, radians, sin

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import (
    GRAVITY,
    ORIGIN,
    Arc,
    Body,
    Box,
    Expectation,
    PairCoefficients,
    Piece,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import block
from touchstone.scenarios.truths.force_truth import ForceTruth

TAGS = ("belt",)
BELT, LOAD = (2.0, 1.0, 0.05), (0.1, 0.1, 0.05)
"""Half extents of a belt and of a load [m]."""
SPEED, MU, MASS, DURATION = 1.0, 0.5, 1.0, 2.0
"""Speed of a belt [m/s], friction [1], mass of a load [kg], and how long it is played [s]."""
SLOPE = 20.0
"""Incline of `belt_ramp` [degrees], below the angle of friction of 26.6 degrees."""
STARTS: dict[str, tuple[Vector, Vector]] = {
    "set": ((-1.5, -0.6, 0.0), ORIGIN),
    "against": ((0.0, -0.3, 0.0), (-1.0, 0.0, 0.0)),
    "along": ((-1.0, 0.6, 0.0), (2.0, 0.0, 0.0)),
}
"""Place [m] and velocity [m/s] of each load of `belt` at the start."""


@scene
def belt() -> Scenario:
    """Loads that are set on a belt, or slide against and along it, end with its velocity."""
    return _belt("belt", "loads slide on a belt of 1 m/s until it carries them", 0.0, STARTS)


@scene
def belt_across() -> Scenario:
    """A load that slides across a belt at its speed: friction acts at 45 degrees."""
    starts = {"load": ((-1.5, -0.1, 0.0), (0.0, SPEED, 0.0))}
    return _belt("belt_across", "a load slides across a belt until it carries the load", 0.0, starts)


@scene
def belt_ramp() -> Scenario:
    """A belt pulls a load up a slope with mu g cos(slope), against g sin(slope)."""
    starts = {"set": ((-1.5, 0.0, 0.0), ORIGIN)}
    return _belt("belt_ramp", "a belt carries a load up a slope of 20 degrees", SLOPE, starts)


def _belt(name: str, summary: str, slope: float, starts: dict[str, tuple[Vector, Vector]]) -> Scenario:
    """Loads that start on a belt along x, which rises by `slope` [degrees], in its frame."""
    a = -radians(slope)
    turn, tilt = (
        np.array(((cos(a), 0, sin(a)), (0, 1, 0), (-sin(a), 0, cos(a)))),
        (cos(a / 2), 0, sin(a / 2), 0),
    )
    piece = Piece("belt", Box(BELT), surface_velocity=(SPEED, 0.0, 0.0))
    place = vector(turn @ (0.0, 0.0, -BELT[2]))
    loads, truths, expectations, forces = [], [], [], []
    weight = MASS * GRAVITY * cos(a)
    for load, (start, velocity) in starts.items():
        slip = np.subtract((SPEED, 0.0, 0.0), velocity)
        size = float(np.linalg.norm(slip))
        # gravity along the belt is parallel to the slip, or 0
        push = MU * GRAVITY * cos(a) * slip / size + (GRAVITY * sin(a), 0.0, 0.0)
        end = size / float(push @ slip / size)
        first, rate = np.add(start, (0.0, 0.0, LOAD[2])), np.array(velocity)
        last = first + rate * end + push * end**2 / 2
        arcs = (
            Arc(0.0, vector(turn @ first), vector(turn @ rate), vector(turn @ push)),
            Arc(end, vector(turn @ last), vector(turn @ (SPEED, 0.0, 0.0))),
        )
        loads.append(block(load, "wood", LOAD, MASS, arcs[0].position, tilt, velocity=arcs[0].velocity))
        truths.append(Truth(load, "arcs", arcs))
        if not velocity[1]:  # an engine with a pyramid for its cone stops early or late at 45 degrees
            expectations.append(Expectation("roll", load, "belt", end - 0.05, end + 0.05))
        forces.append(ForceTruth("belt", load, 0.1, DURATION, weight))
    return Scenario(
        name=name,
        summary=summary,
        tags=TAGS,
        bodies=(Body("belt", "fixed", "wood", (piece,), position=place, orientation=tilt), *loads),
        coefficients=(PairCoefficients("wood", "wood", 0.0, MU),),
        duration=DURATION,
        expectations=tuple(expectations),
        truths=tuple(truths),
        forces=tuple(forces),
    )

"""`break_15`: a ball breaks a triangle of fifteen; energy, momentum and the mirror symmetry are conserved."""

from __future__ import annotations

from math import sqrt

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import PairCoefficients, Scenario
from touchstone.scenarios.solids import ball

RADIUS, MASS = 0.0286, 0.17
"""Radius and mass of billiard balls [m, kg]."""
ROWS = 5
GAP = 0.153
"""Distance of the cue ball from the first ball [m]: it arrives within a step of every engine."""
SPEED = 2.0


@scene
def break_15() -> Scenario:
    """Without gravity and friction, e = 1; the cue ball moves along y in the mirror plane x = 0."""
    balls = [
        ball(f"ball_{row * (row + 1) // 2 + k + 1}", "wood", RADIUS, MASS, (x, sqrt(3) * RADIUS * row, 0.0))
        for row in range(ROWS)
        for k, x in enumerate((2 * j - row) * RADIUS for j in range(row + 1))
    ]
    cue = ball("cue", "wood", RADIUS, MASS, (0.0, -2 * RADIUS - GAP, 0.0), (0.0, SPEED, 0.0))
    return Scenario(
        name="break_15",
        summary="a ball breaks a triangle of fifteen",
        tags=("probe", "impact", "isolated", "conservative", "collective", "symmetric"),
        bodies=(cue, *balls),
        coefficients=(PairCoefficients("wood", "wood", 1.0, 0.0),),
        duration=0.5,
        effects=("restitution", "friction"),
    )

"""`break_15`: a ball breaks a triangle of fifteen; energy, momentum and the mirror symmetry are conserved."""

from collections.abc import Callable
from math import sqrt

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Body, PairCoefficients, Scenario
from touchstone.scenarios.solids import ball

RADIUS, MASS = 0.0286, 0.17
"""Radius and mass of billiard balls [m, kg]."""
ROWS = 5
GAP = 0.153
"""Distance of the cue ball from the first ball [m]: it arrives within a step of every engine."""
SPEED = 2.0


def broken_rack(rows: int, name: Callable[[int, int], str]) -> tuple[Body, ...]:
    """The cue ball on its way along y to a triangle of balls, which `name` calls by their row and their place
    in it, both from 0."""
    cue = ball("cue", "wood", RADIUS, MASS, (0.0, -2 * RADIUS - GAP, 0.0), (0.0, SPEED, 0.0))
    balls = (
        ball(name(row, k), "wood", RADIUS, MASS, ((2 * k - row) * RADIUS, sqrt(3) * RADIUS * row, 0.0))
        for row in range(rows)
        for k in range(row + 1)
    )
    return cue, *balls


@scene
def break_15() -> Scenario:
    """Without gravity and friction, e = 1; the mirror plane is x = 0."""
    return Scenario(
        name="break_15",
        summary="a ball breaks a triangle of fifteen",
        tags=("probe", "impact", "isolated", "conservative", "collective", "symmetric"),
        bodies=broken_rack(ROWS, lambda row, k: f"ball_{row * (row + 1) // 2 + k + 1}"),
        coefficients=(PairCoefficients("wood", "wood", 1.0, 0.0),),
        duration=0.5,
        effects=("restitution", "friction"),
    )

"""Boxes that slide: over a plane until friction stops them, and on inclines around the friction angle."""

from math import atan, cos, degrees, pi, radians, sin

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import slope
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    PairCoefficients,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import block, slab

HALF = 0.05
"""Half an edge of a cube [m]."""
LANE = 1.0
"""Distance between the starts of neighbouring cubes [m]: they fan out and never touch."""
HEADINGS = (0.0, 22.5, 45.0)
"""Directions of sliding [degrees]: those between reveal a pyramid instead of a friction cone."""


@scene
def slide() -> Scenario:
    """Three cubes at three headings slide v^2 / (2 mu g) = 3.67 m, flat on the plane throughout."""
    return sliding("slide", ("probe", "headings"), HEADINGS, mu=0.5, speed=6.0, duration=1.5)


@scene
def slide_seeded() -> tuple[Scenario, ...]:
    """Cubes as in `slide` with random headings, speeds and frictions."""
    return tuple(_seeded(seed) for seed in range(3))


def _seeded(seed: int) -> Scenario:
    rng = np.random.default_rng(seed)
    mu, speed = rng.uniform(0.2, 0.8), rng.uniform(1.0, 4.0)
    # They stop after at most 4 / (0.2 g) = 2.04 s.
    headings = np.sort(rng.uniform(0.0, 90.0, 3)).tolist()
    return sliding(f"slide_seed{seed}", ("seeded", "headings"), tuple(headings), mu, speed, 2.5, seed)


def sliding(
    name: str,
    tags: tuple[str, ...],
    headings: tuple[float, ...],
    mu: float,
    speed: float,
    duration: float,
    seed: int = 0,
) -> Scenario:
    """Cubes that slide over a plane at `headings` [degrees] from `speed` [m/s] to rest."""
    names = [f"box_{heading:.3g}" for heading in headings]
    # side by side, perpendicular to the first heading, with the last at the left
    starts: list[Vector] = [(0.0, LANE * k, HALF) for k in range(len(headings))]
    turns = [radians(heading) for heading in headings]
    cubes = tuple(
        block(
            box,
            "wood",
            (HALF, HALF, HALF),
            1.0,
            start,
            (cos(turn / 2), 0.0, 0.0, sin(turn / 2)),
            velocity=(speed * cos(turn), speed * sin(turn), 0.0),
        )
        for box, start, turn in zip(names, starts, turns)
    )
    truths = tuple(
        Truth(box, "arcs", _until_rest(start, turn, speed, mu))
        for box, start, turn in zip(names, starts, turns)
    )
    return Scenario(
        name=name,
        summary=f"cubes slide at {speed:.3g} m/s with mu = {mu:.3g} until they stop",
        tags=tags,
        bodies=(slab("plane", "wood"), *cubes),
        coefficients=(PairCoefficients("wood", "wood", 0.0, mu),),
        duration=duration,
        truths=truths,
        seed=seed,
    )


def _until_rest(start: Vector, turn: float, speed: float, mu: float) -> tuple[Arc, Arc]:
    along = np.array([cos(turn), sin(turn), 0.0])
    stop = start + speed**2 / (2 * mu * GRAVITY) * along
    return (
        Arc(0.0, start, vector(speed * along), vector(-mu * GRAVITY * along)),
        Arc(speed / (mu * GRAVITY), vector(stop)),
    )


MU = 0.5
FRICTION_ANGLE = degrees(atan(MU))
"""Friction angle [degrees]: 26.57."""


@scene
def inclines() -> tuple[Scenario, Scenario]:
    """A cube on a slope just below and just above the friction angle: it sticks, or a = g (sin - mu cos)."""
    return _incline("incline_holds", 26.0), _incline("incline_slides", 27.0)


def _incline(name: str, steepness: float) -> Scenario:
    angle = steepness * pi / 180
    turn, downhill, up = slope(angle)
    pull = max(0.0, GRAVITY * (sin(angle) - MU * cos(angle)))
    start = vector(HALF * up)
    cube: Body = block("box", "wood", (HALF, HALF, HALF), 1.0, start, turn)
    does = "slides" if pull else "holds"
    return Scenario(
        name=name,
        summary=f"a cube {does} on a slope of {steepness:g} degrees; friction angle {FRICTION_ANGLE:.4g}",
        tags=("probe",),
        bodies=(slab("slope", "wood", vector(up), turn), cube),
        coefficients=(PairCoefficients("wood", "wood", 0.0, MU),),
        duration=1.5,
        truths=(Truth("box", "arcs", (Arc(0.0, start, acceleration=vector(pull * downhill)),)),),
    )

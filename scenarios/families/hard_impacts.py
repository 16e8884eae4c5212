"""Hard impacts: a break of many balls, cradles, and rows of dominoes."""

from __future__ import annotations

from math import inf, sqrt

from touchstone.scenarios.difficulty.checks import Case, Checks, Region
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.scenario import Arc, Truth, Vector
from touchstone.scenarios.solids import ball, block, slab

RADIUS, MASS, SPEED = 0.0286, 0.17, 2.0
"""Radius [m] and mass [kg] of billiard balls, and the speed of the first one [m/s]."""
GAP = 0.153
"""Distance of the first ball from the others [m]."""
DOMINO: Vector = (0.025, 0.006, 0.05)
"""Half extents of a domino [m]; they stand in a row along y."""
PITCH = 0.04
"""Distance of neighbouring dominoes [m]."""


@family("rows of the triangle", "1", (1.0, 2.0, 5.0, 9.0, 15.0))
def break_balls(level: float) -> Case:
    """A ball breaks a triangle of balls, e = 1: energy and momentum stay."""
    rows = int(level)
    balls = [
        ball(f"ball_{row + 1}_{j + 1}", "wood", RADIUS, MASS, (x, sqrt(3) * RADIUS * row, 0.0))
        for row in range(rows)
        for j, x in enumerate((2 * k - row) * RADIUS for k in range(row + 1))
    ]
    cue = ball("cue", "wood", RADIUS, MASS, (0.0, -2 * RADIUS - GAP, 0.0), (0.0, SPEED, 0.0))
    return Case(
        f"a ball breaks a triangle of {len(balls)}",
        (cue, *balls),
        Checks(energy=0.1, energy_loss=0.2),
        duration=0.4,
        restitution=1.0,
        friction=0.0,
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("number of balls", "1", (2.0, 3.0, 5.0, 10.0, 20.0))
def cradle(level: float) -> Case:
    """A ball hits a touching row, e = 1. Of two the last takes all; longer rows part by the engine's law
    (`truths/impact_laws.py`), with the same momentum and energy."""
    count = int(level)
    row = [(2 * RADIUS * k, 0.0, 0.0) for k in range(count - 1)]
    balls = [ball(f"ball_{k + 2}", "wood", RADIUS, MASS, place) for k, place in enumerate(row)]
    velocity = (1.0, 0.0, 0.0)
    first = ball("ball_1", "wood", RADIUS, MASS, (-2 * RADIUS - GAP, 0.0, 0.0), velocity)
    paths = {
        "ball_1": (Arc(0.0, first.position, velocity), Arc(GAP, (-2 * RADIUS, 0.0, 0.0))),
        **{body.name: (Arc(0.0, body.position),) for body in balls[:-1]},
        balls[-1].name: (Arc(0.0, row[-1]), Arc(GAP, row[-1], velocity)),
    }
    return Case(
        f"a ball hits a row of {count - 1}",
        (first, *balls),
        Checks(position=RADIUS if count == 2 else inf, energy=0.1, energy_loss=0.2),
        duration=0.5,
        restitution=1.0,
        friction=0.0,
        truths=tuple(Truth(name, "arcs", arcs) for name, arcs in paths.items()),
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("number of dominoes", "1", (2.0, 5.0, 10.0, 20.0))
def domino_row(level: float) -> Case:
    """The first domino falls, and so must the last; none leaves the row."""
    count, (_, y, z) = int(level), DOMINO
    rate = 4.0
    row = [block(f"domino_{k + 1}", "wood", DOMINO, 0.1, (0.0, PITCH * k, z)) for k in range(count)]
    row[0] = block(
        "domino_1",
        "wood",
        DOMINO,
        0.1,
        (0.0, 0.0, z),
        velocity=(0.0, rate * z, rate * y),
        spin=(-rate, 0.0, 0.0),
    )
    last = row[-1].name
    far = PITCH * count + 0.3
    return Case(
        f"{count} dominoes fall",
        (slab("floor", "wood"), *row),
        Checks(overlap=4e-3, regions=(Region(last, (-0.02, 0.0, 0.0), (0.02, far, 0.9 * z)),)),
        duration=round((0.7 + 0.05 * count) * 30) / 30,
        friction=0.4,
    )

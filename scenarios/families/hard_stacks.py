"""Hard structures: tall stacks, pyramids, brick walls and arches that stand, and long rest."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin

from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.families.hard_mass import resting
from touchstone.scenarios.scenario import Arc, Body, Truth, Vector
from touchstone.scenarios.solids import block, hull, hull_mass_properties, slab

HALF = 0.05
SPACING = 0.11
"""Distance of neighbours in a row of a pyramid [m]."""
BRICK: Vector = (0.1, 0.05, 0.035)
"""Half extents of a brick [m]."""
RADIUS, THICKNESS, DEPTH = 0.5, 0.1, 0.1
"""Mean radius, thickness and half depth of an arch [m]: a semicircle stands from 0.1075 of its radius on."""


def standing(summary: str, bodies: tuple[Body, ...], friction: float = 0.5, duration: float = 0.5) -> Case:
    """Bodies on a floor that do not move."""
    return Case(
        summary,
        (slab("floor", "wood"), *bodies),
        Checks(rest_from=duration / 2),
        duration=duration,
        friction=friction,
        truths=tuple(Truth(body.name, "arcs", (Arc(0.0, body.position),)) for body in bodies),
    )


@family("number of cubes", "1", (2.0, 5.0, 10.0, 20.0, 50.0, 100.0))
def stack(level: float) -> Case:
    """A tower of equal cubes stands."""
    return resting([1.0] * int(level), f"a tower of {level:g} cubes stands")


@family("rows", "1", (2.0, 3.0, 5.0, 8.0))
def pyramid(level: float) -> Case:
    """A pyramid of cubes stands, each on two of the row below."""
    rows = int(level)
    cubes = tuple(
        block(
            f"box_{row + 1}_{k + 1}",
            "wood",
            (HALF,) * 3,
            1.0,
            (SPACING * (k - (rows - row - 1) / 2), 0.0, (2 * row + 1) * HALF),
        )
        for row in range(rows)
        for k in range(rows - row)
    )
    return standing(f"a pyramid of {len(cubes)} cubes stands", cubes)


@family("courses", "1", (2.0, 4.0, 6.0, 10.0))
def brick_wall(level: float) -> Case:
    """A wall of bricks in a bond stands, in exact contact below, above and beside."""
    x, y, z = BRICK
    courses, across = int(level), 3
    bricks: list[Body] = []
    for course in range(courses):
        edges = [2 * x * k for k in range(across + 1)]
        if course % 2:
            edges = [0.0, *(x + 2 * x * k for k in range(across)), 2 * x * across]
        for k, (left, right) in enumerate(pairwise(edges)):
            half = (right - left) / 2
            place = ((left + right) / 2 - x * across, 0.0, (2 * course + 1) * z)
            bricks.append(block(f"brick_{course + 1}_{k + 1}", "wood", (half, y, z), 2 * half / x, place))
    return standing(f"a wall of {len(bricks)} bricks stands", tuple(bricks))


@family("number of stones", "1", (3.0, 5.0, 11.0, 21.0, 41.0))
def arch(level: float) -> Case:
    """A semicircle of stones without mortar stands."""
    count = int(level)
    stones = tuple(_stone(k, count) for k in range(count))
    return standing(f"an arch of {count} stones stands", stones, friction=0.8)


def _stone(k: int, count: int) -> Body:
    corners: list[Vector] = [
        (-r * cos(pi * j / count), y, r * sin(pi * j / count) if 0 < j < count else 0.0)
        for j in (k, k + 1)
        for r in (RADIUS - THICKNESS / 2, RADIUS + THICKNESS / 2)
        for y in (-DEPTH, DEPTH)
    ]
    mass, centre, _ = hull_mass_properties(corners, density=2000.0)
    return hull(f"stone_{k + 1}", "wood", corners, mass, centre)


@family("duration", "s", (1.0, 10.0, 60.0))
def long_rest(level: float) -> Case:
    """A cube rests on the floor, and another on it."""
    case = resting([1.0, 1.0], f"two cubes rest for {level:g} s", level)
    return Case(
        case.summary,
        case.bodies,
        Checks(rest_from=0.5, creep=1e-4),
        duration=level,
        truths=case.truths,
    )

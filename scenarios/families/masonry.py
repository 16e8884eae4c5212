"""A pyramid, a brick wall and arches without mortar.

A linear program decides which arch can stand (`tests/shared/equilibrium.py`): with too little friction its
stones slide outwards, and one that is too thin folds at hinges.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import cos, pi, sin

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.tower import at_rest
from touchstone.scenarios.scenario import Body, Expectation, PairCoefficients, Scenario, Vector
from touchstone.scenarios.solids import block, hull, hull_mass_properties, slab

HALF = 0.05
"""Half an edge of a cube of the pyramid [m]."""
BASE = 8
"""Number of cubes in the pyramid's lowest row: 36 in all."""
SPACING = 0.11
"""Distance of neighbours in a row [m]: they do not touch."""
BRICK: Vector = (0.1, 0.05, 0.035)
"""Half extents of a brick [m]."""
COURSES, BRICKS = 6, 4
"""Number of rows of the wall, and of bricks in the lowest."""
BRIEF = 0.3
"""Duration of pyramid and wall [s]: simulating a second of either takes DART a minute."""
STONES = 11
"""Number of stones of an arch; the middle one is the keystone."""
RADIUS = 0.5
"""Mean radius of an arch [m]."""
DEPTH = 0.1
"""Half the depth of an arch [m]."""
DENSITY = 2000.0
"""Density of the stones [kg/m^3]."""


@dataclass(frozen=True, slots=True)
class Arch:
    """An arch: its thickness relative to its mean radius [1], the friction of its joints, and whether it
    stands."""

    summary: str
    thickness: float
    friction: float
    stands: bool


ARCHES: dict[str, Arch] = {
    "arch_stands": Arch("a keystone arch stands", 0.2, 0.8, True),
    "arch_slides": Arch("an arch whose joints have too little friction falls", 0.2, 0.15, False),
    "arch_thin": Arch("an arch that is too thin folds and falls", 0.06, 0.8, False),
}


@scene
def pyramid() -> Scenario:
    """36 cubes, each on two of the row below, for BRIEF."""
    cubes = pyramid_of(BASE)
    return _standing("pyramid", f"a pyramid of {len(cubes)} cubes stands", cubes, 0.5, BRIEF)


def pyramid_of(rows: int) -> tuple[Body, ...]:
    """Cubes of a pyramid of some rows, each on two of the row below."""
    return tuple(
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


@scene
def wall() -> Scenario:
    """Bricks in six courses that bond, in exact contact below, above and beside."""
    bricks = wall_of(COURSES, BRICKS)
    return _standing("brick_wall", f"a wall of {len(bricks)} bricks stands", bricks, 0.5, BRIEF)


def wall_of(courses: int, across: int) -> tuple[Body, ...]:
    """Bricks of a wall of some courses, with so many `across` in the lowest."""
    x, y, z = BRICK
    bricks: list[Body] = []
    for course in range(courses):
        edges = [2 * x * k for k in range(across + 1)]
        if course % 2:
            edges = [0.0, *(x + 2 * x * k for k in range(across)), 2 * x * across]
        for k, (left, right) in enumerate(pairwise(edges)):
            name, half = f"brick_{course + 1}_{k + 1}", (right - left) / 2
            place = ((left + right) / 2 - x * across, 0.0, (2 * course + 1) * z)
            bricks.append(block(name, "wood", (half, y, z), 2.0 * half / x, place))
    return tuple(bricks)


@scene
def arches() -> tuple[Scenario, ...]:
    """Semicircles of stones on a floor: one that stands, and two that cannot."""
    return tuple(_arch(name, arch) for name, arch in ARCHES.items())


def _arch(name: str, arch: Arch) -> Scenario:
    stones = arch_of(STONES, arch.thickness)
    if arch.stands:
        return _standing(name, arch.summary, stones, arch.friction)
    keystone = stones[STONES // 2].name
    return Scenario(
        name=name,
        summary=arch.summary,
        tags=("probe", "impact", "collective"),
        bodies=(slab("floor", "wood"), *stones),
        coefficients=(PairCoefficients("wood", "wood", 0.0, arch.friction),),
        duration=1.5,
        expectations=(Expectation("meet", keystone, "floor", earliest=0.2, latest=1.4),),
    )


def arch_of(count: int, thickness: float) -> tuple[Body, ...]:
    """Voussoirs of a semicircle whose thickness is relative to its mean radius."""
    return tuple(_stone(k, count, thickness) for k in range(count))


def _stone(k: int, count: int, thickness: float) -> Body:
    """Voussoir that starts at the angle pi k / count: its corners lie on two arcs, its origin is the centre
    of mass."""
    inner, outer = RADIUS * (1 - thickness / 2), RADIUS * (1 + thickness / 2)
    corners: list[Vector] = [
        (-r * cos(pi * j / count), y, r * sin(pi * j / count) if 0 < j < count else 0.0)
        for j in (k, k + 1)
        for r in (inner, outer)
        for y in (-DEPTH, DEPTH)
    ]
    mass, centre, _ = hull_mass_properties(corners, density=DENSITY)
    return hull(f"stone_{k + 1}", "wood", corners, mass, centre)


def _standing(
    name: str, summary: str, bodies: tuple[Body, ...], mu: float, duration: float = 1.0
) -> Scenario:
    return Scenario(
        name=name,
        summary=summary,
        tags=("probe", "symmetric"),
        bodies=(slab("floor", "wood"), *bodies),
        coefficients=(PairCoefficients("wood", "wood", 0.0, mu),),
        duration=duration,
        truths=at_rest(bodies),
    )

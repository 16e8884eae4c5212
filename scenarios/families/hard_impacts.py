"""Hard impacts: a break of many balls, cradles, and rows of dominoes."""

from math import inf

from touchstone.scenarios.difficulty.checks import Case, Checks, Region
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.families.collide import struck_row
from touchstone.scenarios.families.domino import HALF, SPACING, row_of
from touchstone.scenarios.families.rack import GAP, MASS, RADIUS, broken_rack
from touchstone.scenarios.solids import slab


@family("rows of the triangle", "1", (1.0, 2.0, 5.0, 9.0, 15.0))
def break_balls(level: float) -> Case:
    """A ball breaks a triangle of balls, e = 1: energy and momentum stay."""
    bodies = broken_rack(int(level), lambda row, k: f"ball_{row + 1}_{k + 1}")
    return Case(
        f"a ball breaks a triangle of {len(bodies) - 1}",
        bodies,
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
    bodies, truths = struck_row(count, RADIUS, MASS, GAP)
    return Case(
        f"a ball hits a row of {count - 1}",
        bodies,
        Checks(position=RADIUS if count == 2 else inf, energy=0.1, energy_loss=0.2),
        duration=0.5,
        restitution=1.0,
        friction=0.0,
        truths=truths,
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("number of dominoes", "1", (2.0, 5.0, 10.0, 20.0))
def domino_row(level: float) -> Case:
    """The first domino falls, and so must the last; none leaves the row."""
    count = int(level)
    row = row_of(count, SPACING)
    region = Region(row[-1].name, (-0.02, 0.0, 0.0), (0.02, SPACING * count + 0.3, 0.9 * HALF[2]))
    return Case(
        f"{count} dominoes fall",
        (slab("floor", "wood"), *row),
        Checks(overlap=4e-3, regions=(region,)),
        duration=round((0.7 + 0.05 * count) * 30) / 30,
        friction=0.4,
    )

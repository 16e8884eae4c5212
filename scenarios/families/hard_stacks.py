"""Hard structures: tall stacks, pyramids, brick walls and arches that stand, and long rest."""

from dataclasses import replace

from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.families.hard_mass import resting, standing
from touchstone.scenarios.families.masonry import arch_of, pyramid_of, wall_of

BRIEF = 0.5
"""Duration of structures of many bodies [s]."""


@family("number of cubes", "1", (2.0, 5.0, 10.0, 20.0, 50.0, 100.0))
def stack(level: float) -> Case:
    """A tower of equal cubes stands."""
    return resting([1.0] * int(level), f"a tower of {level:g} cubes stands")


@family("rows", "1", (2.0, 3.0, 5.0, 8.0))
def pyramid(level: float) -> Case:
    """A pyramid of cubes stands, each on two of the row below."""
    cubes = pyramid_of(int(level))
    return standing(f"a pyramid of {len(cubes)} cubes stands", cubes, duration=BRIEF)


@family("courses", "1", (2.0, 4.0, 6.0, 10.0))
def brick_wall(level: float) -> Case:
    """A wall of bricks in a bond stands, in exact contact below, above and beside."""
    bricks = wall_of(int(level), 3)
    return standing(f"a wall of {len(bricks)} bricks stands", bricks, duration=BRIEF)


@family("number of stones", "1", (3.0, 5.0, 11.0, 21.0, 41.0))
def arch(level: float) -> Case:
    """A semicircle of stones without mortar stands."""
    stones = arch_of(int(level), 0.2)
    return standing(f"an arch of {len(stones)} stones stands", stones, friction=0.8, duration=BRIEF)


@family("duration", "s", (1.0, 10.0, 60.0))
def long_rest(level: float) -> Case:
    """A cube rests on the floor, and another on it."""
    case = resting([1.0, 1.0], f"two cubes rest for {level:g} s", level)
    return replace(case, checks=Checks(rest_from=0.5, creep=1e-4))

"""Heaps with published values: grains in a silo, whose walls carry them in part, and columns that collapse.

Neither has a closed form: their values are laws of continua, known as well as their sources agree.
"""

from math import exp, sin

import numpy as np

from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import (
    GRAVITY,
    Body,
    Box,
    PairCoefficients,
    Piece,
    Scenario,
    Tracker,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball, block, slab
from touchstone.scenarios.truths.published import Published

RADIUS, MU = 0.05, 0.5
"""Radius [m] and friction [1] of a grain of 1 kg."""
LOOSE = 2.1
"""Distance of neighbours before they settle, over the radius [1]."""
SCATTER = 0.02
"""Largest offset of a grain from its grid, over the radius [1]: without it they would stack as a crystal."""
WALL = 0.05
"""Half thickness of a wall [m]."""
EVERY_GRAIN = "grain_*"

ACROSS, GRAINS = 4, (160, 1000)
"""Grains side by side in a silo, and their numbers; the larger silo is played by its name."""
WIDTH = 4.6 * 2 * RADIUS
"""Inner width of the square silo [m]."""
SETTLED, LOWERED, SINKING = 1.5, 2.5, 0.01
"""Time after which its floor sinks, end of the scene [s], and the floor's speed [m/s]."""
PACKED = 0.58
"""Share of the silo's volume that grains fill [1], which gives the height of the fill."""
SCATTERS = 0.19
"""Share of the floor's load by which it differs between windows of a run [1]."""
JANSSEN = (
    "Janssen (1895), translated in arXiv:cond-mat/0511618: the floor of a silo carries (1 - e^-x) / x of the "
    "weight, x = 4 mu K h / width; for K sources differ, from Rankine's (1 - sin) / (1 + sin) to "
    "(1 - sin^2) / (1 + sin^2) at a wall that slips, tan = mu: 0.38 to 0.67, both by Mohr's circle, their "
    "pages were not seen. Marini Bettolo Marconi et al. (2000), Physica A 280, 279: loads scatter by their "
    "size. A correlation, not integrated by grains. Value: the middle; tolerance: the ends, and a fifth of "
    "the load"
)


@scene
def silos() -> tuple[Scenario, ...]:
    """Grains settle in a silo; its floor sinks, so that they slip along its walls."""
    return tuple(map(_silo, GRAINS))


def _silo(count: int) -> Scenario:
    rng, half = np.random.default_rng(0), WIDTH / 2
    k = np.arange(count)
    grid = np.stack([k % ACROSS, k // ACROSS % ACROSS, k // ACROSS**2], axis=-1) + 0.5
    places = grid * (WIDTH / ACROSS, WIDTH / ACROSS, LOOSE * RADIUS) - (half, half, 0.0)
    places += rng.uniform(-SCATTER * RADIUS, SCATTER * RADIUS, places.shape)
    high, out = float(places[:, 2].max()) / 2 + RADIUS, half + WALL
    walls: dict[str, tuple[Vector, Vector]] = {
        "west": ((-out, 0.0, high), (WALL, half + 2 * WALL, high)),
        "east": ((out, 0.0, high), (WALL, half + 2 * WALL, high)),
        "south": ((0.0, -out, high), (half, WALL, high)),
        "north": ((0.0, out, high), (half, WALL, high)),
    }
    fill = count * 4 / 3 * np.pi * RADIUS**3 / PACKED / WIDTH**2
    inner = sin(np.arctan(MU))
    loads = [
        count * GRAVITY * (1 - exp(-x)) / x
        for K in ((1 - inner) / (1 + inner), (1 - inner**2) / (1 + inner**2))
        for x in (4 * MU * K * fill / WIDTH,)
    ]
    floor = _mover(
        "floor",
        Box((half - 1e-3, half - 1e-3, WALL)),
        (SETTLED, LOWERED),
        -WALL,
        -SINKING * (LOWERED - SETTLED),
    )
    return Scenario(
        name=f"silo_{count}",
        summary=f"{count} grains in a silo with a floor that sinks",
        tags=("heap", "literature" if count == min(GRAINS) else "large"),
        bodies=(
            floor[0],
            *(block(name, "wood", size, 0.0, place, kind="fixed") for name, (place, size) in walls.items()),
            *_grains(places),
        ),
        trackers=(floor[1],),
        coefficients=(PairCoefficients("wood", "wood", 0.0, MU),),
        duration=LOWERED,
        published=(
            Published(
                "floor", EVERY_GRAIN, "force", sum(loads) / 2,
                (loads[0] - loads[1] + SCATTERS * sum(loads)) / 2, JANSSEN, SETTLED + 0.25, LOWERED,
                other="floor",
            ),
        ),
    )  # fmt: skip


WIDE, DEEP, HIGH = 6, 3, (6, 9)
"""Grains along, across and up a column."""
FREED, OPENED = 0.8, 1.0
"""Time at which the gate begins to rise, and at which it is above the column [s]."""
SMOOTH = 0.1
"""Friction of the gate and of the channel's walls [1]."""
RUN = 3.0
"""Length of the channel before the gate [m]."""
SAND, CONTINUUM = 1.2, 2.28
"""Run-out of the front over aspect ratio and first length [1], by two sources."""
LUBE = (
    "Lube et al. (2005), Phys. Rev. E 72, 041301: the front of sand in a channel runs 1.2 a of the first "
    "length at small a; Dunatunga & Kamrin (2015), J. Fluid Mech. 779, 483, table 3, disagree: 2.28 a "
    "in plane strain. The value is between them, the tolerance reaches both; a correlation, not integrated"
)


@scene
def granular_columns() -> tuple[Scenario, ...]:
    """Columns of aspect ratio 1 and 1.5 behind a gate that opens; they run out along a channel."""
    return tuple(map(_column, HIGH))


def _column(high: int) -> Scenario:
    rng, gap = np.random.default_rng(0), LOOSE * RADIUS
    grid = np.stack(np.meshgrid(range(WIDE), range(DEEP), range(high), indexing="ij"), axis=-1).reshape(-1, 3)
    places = (grid + 0.5) * (-gap, gap, gap) - (0.0, DEEP * gap / 2, 0.0)
    places += rng.uniform(-SCATTER * RADIUS, SCATTER * RADIUS, places.shape)
    length, side, up = WIDE * gap, DEEP * gap / 2, high * gap
    gate = _mover("gate", Box((WALL, side, up / 2)), (FREED, OPENED), up / 2, up, ahead=WALL)
    middle, reach = (RUN - length) / 2, (RUN + length) / 2
    walls: dict[str, tuple[Vector, Vector]] = {
        "west": ((-length - WALL, 0.0, up / 2), (WALL, side + 2 * WALL, up / 2)),
        "south": ((middle, -side - WALL, up / 2), (reach, WALL, up / 2)),
        "north": ((middle, side + WALL, up / 2), (reach, WALL, up / 2)),
    }
    aspect = high / WIDE
    slow, fast = (run * aspect * length for run in (SAND, CONTINUUM))
    return Scenario(
        name=f"column_{10 * aspect:.0f}",
        summary=f"a column of {len(places)} grains collapses, {aspect:g} times as high as long",
        tags=("heap", "literature"),
        bodies=(
            slab("floor", "wood"),
            gate[0],
            *(block(name, "glass", size, 0.0, place, kind="fixed") for name, (place, size) in walls.items()),
            *_grains(places),
        ),
        trackers=(gate[1],),
        coefficients=(
            PairCoefficients("wood", "wood", 0.0, MU),
            PairCoefficients("glass", "wood", 0.0, SMOOTH),
        ),
        duration=2.5,
        published=(
            Published("front", EVERY_GRAIN, "reach", (slow + fast) / 2, (fast - slow) / 2, LUBE, FREED, 2.5),
        ),
    )


def _grains(places: np.ndarray) -> tuple[Body, ...]:
    return tuple(ball(f"grain_{k + 1}", "wood", RADIUS, 1.0, vector(place)) for k, place in enumerate(places))


def _mover(
    name: str, box: Box, window: tuple[float, float], height: float, way: float, ahead: float = 0.0
) -> tuple[Body, Tracker]:
    """A prescribed box at a `height` [m], and its tracker: it rises by `way` [m] in a window of time [s]."""
    times = (0.0, *window, LOWERED) if window[1] < LOWERED else (0.0, *window)
    heights = (height, height, height + way, height + way)[: len(times)]
    path = keyframed(name, times, [(ahead, 0.0, z) for z in heights], interpolation="linear")
    return Body(name, "prescribed", "glass" if ahead else "wood", (Piece(name, box),)), path

"""Dominoes fall one after the other: none leaves the line or gains energy, and their wave has a speed."""

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import IDENTITY, Body, Expectation, PairCoefficients, Scenario, Vector
from touchstone.scenarios.solids import block, slab
from touchstone.scenarios.truths.published import Published

COUNT = 20
HALF: Vector = (0.025, 0.006, 0.05)
"""Half extents of a domino [m]: they stand in a row along y."""
SPACING = 0.04
"""Distance of neighbours [m]: 2.8 cm free between them, for a height of 10 cm."""
RATE = 4.0
"""Angular velocity of the first about its front edge [rad/s]: 1.8 times the minimum for tipping over the
edge."""
MASS = 0.1


WAVES = {0.028: 1.1661, 0.05: 1.0943}
"""Free distance of neighbours [m] -> speed of the wave between two dominoes [m/s], for a friction of 0.4."""
LEEUWEN = (
    "van Leeuwen (2010), Am. J. Phys. 78, 721: falling dominoes lean on each other and rub. Integrated from "
    "his model of contact; no printed speed, his or that of Stronge & Shu (1988), was at hand"
)
FIRST, LAST = 12, 17
"""Dominoes between which the speed is measured: within 0.7 % of that of an endless row."""


@scene
def domino_waves() -> tuple[Scenario, ...]:
    """Rows of two distances: their waves tend to a speed that no push changes."""
    return tuple(_wave(gap, speed) for gap, speed in WAVES.items())


def _wave(gap: float, speed: float) -> Scenario:
    pitch = gap + 2 * HALF[1]
    return Scenario(
        name=f"domino_wave_{gap / (2 * HALF[2]):.0%}".removesuffix("%"),
        summary=f"a wave runs through dominoes that are {gap * 100:g} cm apart",
        tags=("impact", "collective", "literature"),
        bodies=(slab("floor", "wood"), *row_of(LAST + 1, pitch)),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.4),),
        duration=1.3,
        published=(
            Published(
                "speed",
                f"domino_{FIRST}",
                "wave",
                speed,
                0.01 * speed,
                LEEUWEN,
                0.0,
                1.3,
                other=f"domino_{LAST}",
            ),
        ),
    )


def row_of(count: int, pitch: float) -> tuple[Body, ...]:
    """Dominoes that stand at a pitch along y [m], the first of which falls towards the others."""
    _, y, z = HALF
    # It rotates about its front edge: v = w x r.
    push = (IDENTITY, (0.0, RATE * z, RATE * y), (-RATE, 0.0, 0.0))
    return tuple(
        block(f"domino_{k + 1}", "wood", HALF, MASS, (0.0, pitch * k, z), *(push if k == 0 else ()))
        for k in range(count)
    )


@scene
def dominoes() -> Scenario:
    """The first domino is pushed over; the mirror plane is x = 0."""
    row = row_of(COUNT, SPACING)
    last, one_before = row[-1].name, row[-2].name
    return Scenario(
        name="dominoes",
        summary=f"{COUNT} dominoes fall one after the other",
        tags=("probe", "impact", "collective", "symmetric"),
        bodies=(slab("floor", "wood"), *row),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.4),),
        duration=1.0,
        expectations=(Expectation("meet", last, one_before, 0.4, 1.0),),
    )

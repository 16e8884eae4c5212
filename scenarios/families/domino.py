"""`dominoes`: twenty dominoes fall one after the other; none leaves the line or gains energy."""

from __future__ import annotations

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Expectation, PairCoefficients, Scenario, Vector
from touchstone.scenarios.solids import block, slab

COUNT = 20
HALF: Vector = (0.025, 0.006, 0.05)
"""Half extents of a domino [m]: they stand in a row along y."""
SPACING = 0.04
"""Distance of neighbours [m]: 2.8 cm free between them, for a height of 10 cm."""
RATE = 4.0
"""Angular velocity of the first about its front edge [rad/s]: 1.8 times the minimum for tipping over the
edge."""
MASS = 0.1


@scene
def dominoes() -> Scenario:
    """The first domino is pushed over; the mirror plane is x = 0."""
    _, y, z = HALF
    # It rotates about its front edge: v = w x r.
    push = {"velocity": (0.0, RATE * z, RATE * y), "spin": (-RATE, 0.0, 0.0)}
    row = tuple(
        block(f"domino_{k + 1}", "wood", HALF, MASS, (0.0, SPACING * k, z), **(push if k == 0 else {}))  # type: ignore[arg-type]
        for k in range(COUNT)
    )
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

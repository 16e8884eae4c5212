"""`stack`: five stacked boxes do not move."""

from __future__ import annotations

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Arc, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import block, slab

HALF = 0.05
BOXES = 5


@scene
def stack() -> Scenario:
    """Five equal cubes in exact contact for one second: none moves or sinks in."""
    places = {f"box_{k + 1}": (0.0, 0.0, (2 * k + 1) * HALF) for k in range(BOXES)}
    return Scenario(
        name="stack",
        summary="five boxes on each other stay where they are",
        tags=("probe",),
        bodies=(
            slab("floor", "wood"),
            *(block(name, "wood", (HALF,) * 3, 1.0, place) for name, place in places.items()),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.0,
        truths=tuple(Truth(name, "arcs", (Arc(0.0, place),)) for name, place in places.items()),
    )

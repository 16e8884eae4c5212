"""`stack`: five stacked boxes do not move."""

from __future__ import annotations

from itertools import pairwise

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import block, slab
from touchstone.scenarios.truths.force_truth import ForceTruth

HALF = 0.05
BOXES = 5
MASS = 1.0
"""Mass of a box [kg]."""
SETTLED = 0.5
"""Time from which soft contacts bear the weight without oscillating [s]."""


@scene
def stack() -> Scenario:
    """Five equal cubes in exact contact for one second: none moves or sinks in; each bears those above it."""
    names = ("floor", *(f"box_{k + 1}" for k in range(BOXES)))
    places = {f"box_{k + 1}": (0.0, 0.0, (2 * k + 1) * HALF) for k in range(BOXES)}
    return Scenario(
        name="stack",
        summary="five boxes on each other stay where they are",
        tags=("probe",),
        bodies=(
            slab("floor", "wood"),
            *(block(name, "wood", (HALF,) * 3, MASS, place) for name, place in places.items()),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.0,
        truths=tuple(Truth(name, "arcs", (Arc(0.0, place),)) for name, place in places.items()),
        forces=tuple(
            ForceTruth(below, above, SETTLED, 1.0, (BOXES - k) * MASS * GRAVITY)
            for k, (below, above) in enumerate(pairwise(names))
        ),
    )

"""`stack`: five stacked boxes do not move."""

from collections.abc import Sequence
from itertools import pairwise

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.tower import at_rest, stacked
from touchstone.scenarios.scenario import GRAVITY, Body, PairCoefficients, Scenario
from touchstone.scenarios.solids import slab
from touchstone.scenarios.truths.force_truth import ForceTruth

BOXES = 5
MASS = 1.0
"""Mass of a box [kg]."""
SETTLED = 0.5
"""Time from which soft contacts bear the weight without oscillating [s]."""


@scene
def stack() -> Scenario:
    """Five equal cubes in exact contact for one second: none moves or sinks in; each bears those above it."""
    bodies = (slab("floor", "wood"), *stacked([MASS] * BOXES))
    return Scenario(
        name="stack",
        summary="five boxes on each other stay where they are",
        tags=("probe",),
        bodies=bodies,
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.0,
        truths=at_rest(bodies[1:]),
        forces=weights(bodies),
    )


def weights(bodies: Sequence[Body]) -> tuple[ForceTruth, ...]:
    """What bodies of MASS bear that stand on each other for 1 s, from the ground up."""
    return tuple(
        ForceTruth(below.name, above.name, SETTLED, 1.0, (len(bodies) - 1 - k) * MASS * GRAVITY)
        for k, (below, above) in enumerate(pairwise(bodies))
    )

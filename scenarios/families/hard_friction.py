"""Hard friction: slopes that just hold and just slip, and boxes that just do not tip."""

from math import atan, cos, sin

from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.scenario import GRAVITY, Arc, Truth, Vector
from touchstone.scenarios.solids import block, slab

HALF = 0.05
MU = 0.5
MARGINS = (0.5, 0.1, 0.01, 1e-3, 1e-4)
"""Distance of the slope's tangent from its limit, over that limit [1]."""


def _tilted(slope: float) -> Vector:
    """Gravity on a slope whose normal is z and which falls along x [m/s^2]."""
    return (GRAVITY * sin(slope), 0.0, -GRAVITY * cos(slope))


@family("margin of the slope", "1", MARGINS)
def slope_holds(level: float) -> Case:
    """A cube on a slope that is a little less than friction holds."""
    place = (0.0, 0.0, HALF)
    return Case(
        f"a cube holds on a slope {level:g} below its limit",
        (slab("slope", "wood"), block("box", "wood", (HALF,) * 3, 1.0, place)),
        Checks(rest_from=0.0),
        friction=MU,
        truths=(Truth("box", "arcs", (Arc(0.0, place),)),),
        fields={"gravity": _tilted(atan(MU * (1 - level)))},
    )


@family("margin of the slope", "1", MARGINS)
def slope_slips(level: float) -> Case:
    """A flat box on a slope that is a little more than friction holds slides with the remaining force."""
    slope, half = atan(MU * (1 + level)), (0.1, 0.1, 0.02)
    place = (0.0, 0.0, half[2])
    pull = GRAVITY * (sin(slope) - MU * cos(slope))
    start = (0.1, 0.0, 0.0)
    return Case(
        f"a box slides on a slope {level:g} beyond its limit",
        (slab("slope", "wood"), block("box", "wood", half, 1.0, place, velocity=start)),
        Checks(),
        friction=MU,
        truths=(Truth("box", "arcs", (Arc(0.0, place, start, (pull, 0.0, 0.0)),)),),
        fields={"gravity": _tilted(slope)},
    )


@family("margin of the slope", "1", MARGINS)
def tip_holds(level: float) -> Case:
    """A tall box on a slope that is a little less than width over height stands."""
    half = (0.02, 0.02, 0.1)
    place = (0.0, 0.0, half[2])
    return Case(
        f"a tall box stands on a slope {level:g} below the one that tips it",
        (slab("slope", "wood"), block("box", "wood", half, 1.0, place)),
        Checks(rest_from=0.0),
        friction=MU,
        truths=(Truth("box", "arcs", (Arc(0.0, place),)),),
        fields={"gravity": _tilted(atan(half[0] / half[2] * (1 - level)))},
    )

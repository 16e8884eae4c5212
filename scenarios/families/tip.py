"""Boxes on inclines that stand or tip: at tan(slope) = w / h the weight passes over the lower edge."""

from dataclasses import dataclass
from math import radians

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import slope
from touchstone.scenarios.scenario import (
    Arc,
    Body,
    Expectation,
    PairCoefficients,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import block, slab


@dataclass(frozen=True, slots=True)
class Case:
    """Half extents [m] of the box, slope [degrees] and friction; whether it tips or stands."""

    summary: str
    half: Vector
    slope: float
    friction: float
    tips: bool


SQUAT, TALL = (0.05, 0.05, 0.1), (0.02, 0.02, 0.2)
CASES: dict[str, Case] = {
    # w / h = 0.5 corresponds to 26.565 degrees.
    "tip_holds": Case("a box just holds on a slope, by its width and by friction", SQUAT, 26.0, 0.5, False),
    "tip_falls": Case("a box on a slope just tips over its lower edge", SQUAT, 27.5, 0.6, True),
    # w / h = 0.1 corresponds to 5.711 degrees.
    "tall_holds": Case("a tall box just holds on a slope", TALL, 5.5, 0.5, False),
}
STOP_DISTANCE = 1.6
"""Distance from the lower edge down to the stop, relative to the box' half height [1]: a fallen box hits
it."""


@scene
def tips() -> tuple[Scenario, ...]:
    """A box at rest on a slope, in exact contact."""
    return tuple(_tip(name, case) for name, case in CASES.items())


def _tip(name: str, case: Case) -> Scenario:
    turn, downhill, up = slope(radians(case.slope))
    start = vector(case.half[2] * up)
    bodies: list[Body] = [
        slab("slope", "wood", vector(up), turn),
        block("box", "wood", case.half, 1.0, start, turn),
    ]
    if case.tips:
        half: Vector = (0.01, 0.1, 0.02)
        at = (case.half[0] + STOP_DISTANCE * case.half[2] + half[0]) * downhill + half[2] * up
        bodies.append(block("stop", "wood", half, 0.0, vector(at), turn, kind="fixed"))
    return Scenario(
        name=name,
        summary=case.summary,
        tags=("probe", *(("impact",) if case.tips else ())),
        bodies=tuple(bodies),
        coefficients=(PairCoefficients("wood", "wood", 0.0, case.friction),),
        duration=1.0,
        truths=() if case.tips else (Truth("box", "arcs", (Arc(0.0, start),)),),
        expectations=(Expectation("meet", "box", "stop", 0.3, 0.9),) if case.tips else (),
    )

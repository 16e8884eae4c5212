"""`shot_*`: a ball hits a thin plate perpendicularly and returns with e times its speed."""

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Arc, PairCoefficients, Scenario, Truth, Vector
from touchstone.scenarios.solids import ball, block

SPEEDS = (6.0, 30.0, 300.0)
"""Speeds of the ball [m/s]: 0.1, 0.5 and 5 m per frame, 2.5, 12.5 and 125 cm per 1/240 s."""
RADIUS, MASS = 0.05, 1.0
PLATE: Vector = (0.4, 0.4, 0.0005)
"""Half extents of the plate [m]: 1 mm thick."""
RESTITUTION, FRICTION = 0.5, 0.3
DURATION, FRAME_RATE = 0.1, 60
ARRIVAL = 0.35
"""Arrival time of the ball [frames]: within a step of every engine with more than one step per frame."""


@scene
def shots() -> tuple[Scenario, ...]:
    """A ball without spin flies straight down, without gravity."""
    return tuple(shot(speed, PLATE) for speed in SPEEDS)


def shot(speed: float, plate: Vector) -> Scenario:
    """A ball at `speed` [m/s] and a plate with half extents `plate` [m]."""
    arrival, touching = ARRIVAL / FRAME_RATE, plate[2] + RADIUS
    start: Vector = (0.0, 0.0, touching + speed * arrival)
    arcs = (
        Arc(0.0, start, (0.0, 0.0, -speed)),
        Arc(arrival, (0.0, 0.0, touching), (0.0, 0.0, RESTITUTION * speed)),
    )
    return Scenario(
        name=f"shot_{speed:g}",
        summary=f"a ball of 10 cm at {speed:g} m/s on a plate of {2e3 * plate[2]:g} mm",
        tags=("probe", "impact"),
        bodies=(
            block("plate", "wood", plate, kind="fixed"),
            ball("ball", "wood", RADIUS, MASS, start, (0.0, 0.0, -speed)),
        ),
        coefficients=(PairCoefficients("wood", "wood", RESTITUTION, FRICTION),),
        duration=DURATION,
        frame_rate=FRAME_RATE,
        effects=("restitution", "friction"),
        truths=(Truth("ball", "arcs", arcs),),
    )

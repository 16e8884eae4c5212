"""Boxes that a person holds between its hands and carries on them."""

from dataclasses import replace

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.avatar import HIP_HEIGHT, SHOULDER, avatar_parts
from touchstone.scenarios.avatar.postures import CLEARANCE, LEFT, RIGHT, person_tracker, reach
from touchstone.scenarios.avatar.tracking import ease
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Scenario, Vector
from touchstone.scenarios.solids import block, slab

FRAME_RATE = 60
MASS = 1.0
"""Mass of the box [kg]."""
HEIGHT = HIP_HEIGHT + CLEARANCE
"""Height of the origin of the torso's frame above the floor [m]."""
HELD: Vector = (0.06, 0.12, 0.1)
"""Half extents of the box between the hands [m]."""
AHEAD, LOW = 0.42, SHOULDER[2] - 0.42
"""Middle of that box in the torso's frame: x and z [m]."""
SQUEEZE, RISE = 0.03, 0.15
"""Depth of the hands' goals in the box, and rise of the hands [m]."""
GRIP = 120.0
"""Frequency of the servos of a person that holds a box [rad/s]: at a person's usual 40 its arms give way, and
the box slips out."""
CARRIED: Vector = (0.08, 0.2, 0.05)
"""Half extents of the box on the hands [m]."""
PALMS: Vector = (0.42, 0.14, SHOULDER[2] - 0.33)
"""Middle of the left hand below that box, in the torso's frame [m]."""
CLEAR = 0.05
"""Height of the box above the middle of the hands at the start [m]."""


@scene
def hold() -> Scenario:
    """The person squeezes a box on a table between both hands, lifts it and holds it."""
    times = np.arange(4 * FRAME_RATE + 1) / FRAME_RATE
    close, up = ease(times, 0.1, 0.5), ease(times, 0.9, 1.0)
    apart = HELD[1] + 0.06 - (0.04 + SQUEEZE) * close
    hands = [np.column_stack((np.full_like(times, AHEAD), side * apart, LOW + RISE * up)) for side in (1, -1)]
    scenario = _scene(
        "hold",
        "a person holds a box between its hands",
        times,
        hands,
        np.zeros_like(times),
        HELD,
        (AHEAD, 0.0, HEIGHT + LOW),
        (0.1, 0.15, 0.02),
    )
    return replace(scenario, trackers=(replace(scenario.trackers[0], hinge_frequency=GRIP),))


@scene
def carry() -> Scenario:
    """The person lifts a box from a narrow table with both hands below it, and walks backwards by 0.5 m."""
    times = np.arange(4 * FRAME_RATE + 1) / FRAME_RATE
    up, back = ease(times, 0.2, 0.8), ease(times, 1.4, 1.5)
    hands = [np.multiply(PALMS, (1, side, 1)) + np.outer(0.1 * up, (0.0, 0.0, 1.0)) for side in (1, -1)]
    return _scene(
        "carry",
        "a person carries a box on its hands",
        times,
        hands,
        -0.5 * back,
        CARRIED,
        (PALMS[0], 0.0, HEIGHT + PALMS[2] + CLEAR + CARRIED[2]),
        (0.1, 0.04, 0.02),
    )


def _scene(
    name: str,
    summary: str,
    times: Array,
    hands: list[Array],
    way: Array,
    half: Vector,
    middle: Vector,
    table: Vector,
) -> Scenario:
    """A person that stands at x = `way` (n,) [m] with its hands at points (n, 3) of the torso's frame, and a
    box in its `middle` on a table, both of given half extents [m]."""
    bodies, joints, chains = avatar_parts()
    below = middle[2] - half[2] - table[2]
    arms = (reach(side, points) for side, points in zip((LEFT, RIGHT), hands))
    return Scenario(
        name=name,
        summary=summary,
        tags=("driven",),
        bodies=(
            slab("floor", "wood"),
            *bodies,
            block("table", "wood", table, 0.0, (middle[0], 0.0, below), kind="fixed"),
            block("box", "wood", half, MASS, middle),
        ),
        joints=joints,
        chains=chains,
        trackers=(person_tracker(times, np.column_stack((way, np.zeros_like(way))), 0.0, *arms),),
        coefficients=TABLE_1,
        duration=float(times[-1]),
        frame_rate=FRAME_RATE,
    )

"""`push_box`: a person pushes a box over the floor with both hands and releases it."""

from math import pi

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.avatar import SHOULDER, avatar_parts
from touchstone.scenarios.avatar.postures import LEFT, RIGHT, between, hanging, person_tracker, reach, step
from touchstone.scenarios.avatar.tracking import ease
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.gallery import gallery_scene
from touchstone.scenarios.scenario import Expectation, Scenario, Tracker, Vector
from touchstone.scenarios.solids import block

DURATION, FRAME_RATE = 4.0, 60
LANE = 0.85
"""Lane in which the person walks east: y [m]."""
START = 3.55
"""Start of the person: x [m]."""
SPEED = 1.0
"""Walking speed [m/s]."""
OFF, SPEED_UP, STOP, SLOW_DOWN = 0.3, 1.2, 2.1, 0.5
"""Start of the walk, time to full speed, start of the stop, and its duration [s]."""
BOX_HALF: Vector = (0.40, 0.35, 0.55)
"""Half extents of the box [m]: pushed at 1.03 m with mu = 0.3 it does not tip, with a margin of a quarter of
its half depth."""
BOX_MASS = 12.0
"""Mass of an empty crate [kg]: friction on the floor is 35 N."""
BOX_START = 4.30 + BOX_HALF[0]
"""Initial middle of the box: x [m]."""
READY: Vector = (0.40, 0.16, SHOULDER[2] - 0.42)
"""Middle of the left hand when it pushes, in the torso's frame [m]."""
WITHDRAWN: Vector = (0.18, 0.18, SHOULDER[2] - 0.42)
WITHDRAW = 0.25
"""Time in which both hands withdraw [s]."""
STRIDE = 1.2
"""Length of two steps [m]."""


@scene
def push_box() -> Scenario:
    """The person walks up to the box, pushes it at 1 m/s, stops and withdraws the hands; the box slides for a
    further v^2 / (2 mu g), 17 cm at that speed."""
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    crate = block("box", "wood", BOX_HALF, BOX_MASS, (BOX_START, LANE, BOX_HALF[2]))
    return gallery_scene(
        "push_box",
        "a person pushes a box over the floor and lets it go; friction stops it",
        avatar_parts(),
        _tracker(times),
        crate,
        expectations=tuple(
            expectation
            for hand in ("left_hand", "right_hand")
            for expectation in (
                Expectation("meet", "box", hand, earliest=0.8, latest=1.4),
                Expectation("part", "box", hand, earliest=STOP - 0.1, latest=STOP + 0.3),
            )
        ),
    )


def _tracker(times: Array) -> Tracker:
    """Tracker: walk with the hands ahead, stop, and withdraw the hands."""
    way = _way(times)
    speed = np.gradient(way, times)
    gait = np.sin(2 * pi * way / STRIDE) * speed / SPEED
    ready, back = ease(times, 0.0, 0.6), ease(times, STOP, WITHDRAW)
    arms = []
    for side in (LEFT, RIGHT):
        raised = between(hanging(side, times), np.multiply(READY, (1, side, 1)), ready)
        arms.append(reach(side, raised + np.outer(back, np.subtract(WITHDRAWN, READY) * (1, side, 1))))
    legs = (step(side, 0.35 * side * gait, 0.5 * np.abs(gait)) for side in (LEFT, RIGHT))
    places = np.column_stack((START + way, np.full_like(way, LANE)))
    return person_tracker(times, places, 0.0, *arms, *legs)


def _way(times: Array) -> Array:
    """Distance walked [m]: at SPEED, with an eased start and stop."""
    return SPEED * (_eased_way(times, OFF, SPEED_UP) - _eased_way(times, STOP, SLOW_DOWN))


def _eased_way(times: Array, start: float, duration: float) -> Array:
    """Integral of `ease` over time [s]."""
    s = np.clip((times - start) / duration, 0.0, 1.0)
    return duration * s**3 * (1 - s / 2) + np.maximum(0.0, times - start - duration)

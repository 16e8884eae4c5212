"""A person in the gallery: walks into a wall, slides along a corner, pushes a wall, crosses arms.

The person's trackers ignore walls: they continue where the person cannot.
"""

from math import pi
from typing import Any

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.avatar import HIP_HEIGHT, SHOULDER, avatar_parts
from touchstone.scenarios.avatar.postures import (
    CLEARANCE,
    LEFT,
    RIGHT,
    between,
    hanging,
    person_tracker,
    reach,
    step,
)
from touchstone.scenarios.avatar.tracking import ease, through
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.gallery import EAST, NORTH, gallery_scene
from touchstone.scenarios.scenario import Expectation, Scenario, Tracker, Vector

DURATION, FRAME_RATE = 6.0, 60
TIMES: Array = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
"""Keyframes [s]."""
PUSHES, CROSSINGS = (3.0, 4.0, 5.0), (1.8, 3.8)
"""Start times of the pushes of both arms into the wall, and against each other [s]."""
ELBOWS_OUT: dict[int, Vector] = {side: (-0.5, 0.6 * side, -1.0) for side in (LEFT, RIGHT)}


@scene
def wall_push() -> Scenario:
    """Four steps east; the stretched right arm and left leg hit the wall, and leave it 1.3 s later."""
    there, back = ease(TIMES, 0.2, 2.8), ease(TIMES, 4.2, 1.4)
    x = EAST - 2.0 + 1.62 * there - 0.6 * back
    places = np.column_stack((x, np.full_like(x, 0.9)))
    gait = np.sin(2 * pi * 2 * there) * (1 - there)
    raised, ahead = ease(TIMES, 0.6, 1.2), ease(TIMES, 2.0, 1.0) - ease(TIMES, 4.6, 1.0)
    swing = np.column_stack((0.2 * gait, 0 * gait, 0.06 * gait**2))
    forward = between(hanging(RIGHT, TIMES), (0.56, -0.2, SHOULDER[2] - 0.1), raised)
    return _scenario(
        "wall_push",
        "a person walks into a wall, arm and leg stretched out",
        person_tracker(
            TIMES,
            places,
            0.0,
            reach(LEFT, hanging(LEFT, TIMES) + swing),
            reach(RIGHT, forward),
            step(LEFT, 0.35 * gait + 0.7 * ahead, 0.5 * np.abs(gait) + 0.35 * ahead),
            step(RIGHT, -0.35 * gait, 0.5 * np.abs(gait)),
        ),
        (
            Expectation("meet", "right_hand", "east_wall", earliest=1.9, latest=2.5),
            Expectation("meet", "left_foot", "east_wall", earliest=2.3, latest=2.9),
            Expectation("part", "left_foot", "east_wall", earliest=4.4, latest=5.0),
            Expectation("part", "right_hand", "east_wall", earliest=4.5, latest=5.2),
        ),
    )


@scene
def corner_slide() -> Scenario:
    """The right hand touches the north wall, slides into the corner, up and down in it, and out along the
    east wall, which the forearm touches meanwhile; their trackers are up to 6 cm inside the walls."""
    root = np.array((EAST - 0.405, NORTH - 0.30))
    inside, deep = 0.04, 0.06
    stations: tuple[tuple[float, Vector], ...] = (
        # End time [s], and the target: the hand's middle from the corner [m], and its height.
        (0.4, (-0.20, -0.16, 1.15)),
        (1.4, (-0.20, -0.16, 1.25)),
        (1.9, (-0.20, inside, 1.25)),
        (2.9, (deep, inside, 1.25)),
        (3.5, (deep, inside, 1.45)),
        (4.1, (deep, inside, 1.20)),
        (5.0, (-0.02, -0.22, 1.30)),
        (5.5, (-0.20, -0.16, 1.25)),
    )
    path = through(stations, TIMES)
    heading = pi / 2
    beside = ease(TIMES, 1.9, 1.0) - ease(TIMES, 4.1, 0.9)
    elbow = np.outer(1 - beside, (-0.5, -0.2, -1.0)) + np.outer(beside, (0.0, -1.0, -1.0))
    world = path + (EAST, NORTH, 0.0)
    return _scenario(
        "corner_slide",
        "a hand and an arm slide along the corner of two walls",
        person_tracker(
            TIMES,
            np.tile(root, (len(TIMES), 1)),
            heading,
            reach(LEFT, hanging(LEFT, TIMES) - (0.2, 0.0, 0.02)),
            reach(RIGHT, _seen(world, root, heading), elbow),
        ),
        (
            Expectation("meet", "right_hand", "north_wall", earliest=1.4, latest=1.9),
            Expectation("meet", "right_forearm", "east_wall", earliest=1.9, latest=2.9),
            Expectation("part", "right_forearm", "east_wall", earliest=4.1, latest=5.0),
            Expectation("part", "right_hand", "north_wall", earliest=4.1, latest=5.0),
            Expectation("part", "right_hand", "east_wall", earliest=5.0, latest=5.5),
        ),
    )


@scene
def two_arms() -> Scenario:
    """The person raises both arms in the first half and pushes into the wall three times in the second."""
    ready: Vector = (0.36, 0.17, SHOULDER[2] - 0.12)
    pushes = sum(ease(TIMES, t, 0.35) - ease(TIMES, t + 0.45, 0.35) for t in PUSHES)
    arms = []
    for side in (LEFT, RIGHT):
        path = between(hanging(side, TIMES), np.multiply(ready, (1, side, 1)), ease(TIMES, 0.3, 1.4))
        arms.append(reach(side, path + np.outer(pushes, (0.24, 0.0, 0.04))))
    return _scenario(
        "two_arms",
        "both arms push into a wall, three times",
        person_tracker(TIMES, np.tile((EAST - 0.6, -0.4), (len(TIMES), 1)), 0.0, *arms),
        tuple(
            expectation
            for hand in ("left_hand", "right_hand")
            for start in PUSHES
            for expectation in (
                Expectation("meet", hand, "east_wall", earliest=start, latest=start + 0.35),
                Expectation("part", hand, "east_wall", earliest=start + 0.45, latest=start + 0.8),
            )
        ),
    )


@scene
def arms_cross() -> Scenario:
    """The person raises both hands in front of the body; they push each other twice, the left one slightly
    above."""
    ready: Vector = (0.42, 0.12, SHOULDER[2] - 0.12)
    pushes = sum(ease(TIMES, t, 0.6) - ease(TIMES, t + 1.0, 0.6) for t in CROSSINGS)
    arms = []
    for side in (LEFT, RIGHT):
        path = between(hanging(side, TIMES), np.multiply(ready, (1, side, 1)), ease(TIMES, 0.2, 1.3))
        arms.append(reach(side, path + np.outer(pushes, (0.0, -0.14 * side, 0.005 * side)), ELBOWS_OUT[side]))
    return _scenario(
        "arms_cross",
        "a person's arms push against each other",
        person_tracker(TIMES, np.tile((4.6, 1.2), (len(TIMES), 1)), 0.0, *arms),
        tuple(
            expectation
            for start in CROSSINGS
            for expectation in (
                Expectation("meet", "left_hand", "right_hand", earliest=start, latest=start + 0.6),
                Expectation("part", "left_hand", "right_hand", earliest=start + 1.0, latest=start + 1.6),
            )
        ),
        own=True,
    )


def _scenario(
    name: str, summary: str, tracker: Tracker, expectations: tuple[Expectation, ...], own: bool = False
) -> Scenario:
    """The person in the gallery. With contact between its `own` limbs the gallery is of metal, because no
    per-body friction in DART gives both wood-human and human-human their coefficients."""
    effects = ("gravity", "restitution", "friction") + (("self_collision",) if own else ())
    material = "metal" if own else "wood"
    given: dict[str, Any] = {"material": material, "effects": effects, "expectations": expectations}
    return gallery_scene(name, summary, avatar_parts(), tracker, **given)


def _seen(points: Array, place: Array, heading: float) -> Array:
    """World points in the frame of a torso at a place."""
    c, s = np.cos(heading), np.sin(heading)
    away = points - (*place, HIP_HEIGHT + CLEARANCE)
    return away @ np.array(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))

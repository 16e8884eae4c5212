"""`ball_snip`: a finger flicks a ball over a table; it rolls off the edge and falls (paper, figure 1)."""

import numpy as np

from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.gallery import TABLE_TOP, gallery_scene
from touchstone.scenarios.scenario import Expectation, Scenario, Tracker, Vector
from touchstone.scenarios.solids import ball

DURATION = 3.0
FRAME_RATE = 60
BALL_RADIUS = 0.02
BALL_MASS = 0.020
"""A wooden ball of 4 cm: 600 kg/m^3 [kg]."""
BALL_START: Vector = (0.15, 0.0, TABLE_TOP + BALL_RADIUS)
PALM: Vector = (0.078, -0.026, 0.847)
"""Position of the palm, which does not move: the index finger, pointing down, clears the table by 4 mm and
hits the ball [m]."""

FLICK_START = 0.30
FLICK_TIME = 0.12
"""Duration of the flick [s]: the index finger swings from behind the vertical to the front."""
FLEXED = (1.85, 0.10, 0.05)
STRAIGHT = (0.90, 0.10, 0.05)
OTHER_FINGERS = (0.10, 0.15, 0.10)
"""Angles of a finger's three hinges [rad]."""


@scene
def ball_snip() -> Scenario:
    """The gallery, the hand of fifteen parts, and a ball that its index finger flicks off the table."""
    links, joints = hand_parts()
    return gallery_scene(
        "ball_snip",
        "a finger flicks a ball over a table; it rolls off the edge and falls",
        (links, joints),
        _glove(tuple(joint.name for joint in joints)),
        ball("ball", "wood", BALL_RADIUS, BALL_MASS, BALL_START),
        seed=0,
        expectations=(
            Expectation("touch", "ball", "palm", earliest=FLICK_START, latest=FLICK_START + FLICK_TIME),
            Expectation("roll", "ball", "table", earliest=0.35, latest=0.8),
            Expectation("leave", "ball", "table", earliest=0.7, latest=1.3),
            Expectation("land", "ball", "floor", earliest=1.0, latest=1.8),
        ),
    )


def _glove(names: tuple[str, ...]) -> Tracker:
    """Tracker with sixty keyframes per second: the palm rests, the index finger flicks."""
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    blend = ease(times, FLICK_START, FLICK_TIME)
    index = np.outer(1 - blend, FLEXED) + np.outer(blend, STRAIGHT)
    angles = np.tile(OTHER_FINGERS * (len(names) // 3), (len(times), 1))
    first = names.index("index_proximal")
    angles[:, first : first + 3] = index
    return keyframed("palm", times, PALM, joints=names, angles=angles)

"""`table_slide`: a hand moves through the gallery, slides over a table and back, and plays with a ball."""

import numpy as np

from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.avatar.tracking import keyframed, through
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.gallery import DOOR, TABLE_TOP, gallery_scene
from touchstone.scenarios.scenario import Expectation, Scenario, Vector
from touchstone.scenarios.solids import ball

DURATION, FRAME_RATE = 8.0, 60
BACKWARDS = (0.0, 0.0, 0.0, 1.0)
"""Orientation with the fingers to the west and the palm down."""
RELAXED = (0.10, 0.15, 0.10)
"""Angles of every finger's three hinges [rad]."""
BALL_RADIUS, BALL_MASS = 0.02, 0.020
BALL_START: Vector = (-0.40, 0.046, TABLE_TOP + BALL_RADIUS)
"""Start of the ball, in the path of the middle finger."""
HOVER, PRESS, PLAY = TABLE_TOP + 0.08, TABLE_TOP + 0.012, TABLE_TOP + 0.04
"""Heights of the palm [m]: fingers clear of the table, 1 cm in it, and beside the ball."""
STATIONS: tuple[tuple[float, Vector], ...] = (
    # End time [s], and position of the palm then [m].
    (0.2, (DOOR + 1.1, 0.0, 1.3)),
    (1.7, (DOOR + 0.1, 0.0, 1.2)),
    (3.6, (0.40, 0.05, HOVER)),
    (4.0, (0.40, 0.05, PRESS)),
    (5.0, (-0.05, 0.05, PRESS)),
    (5.2, (-0.05, 0.05, HOVER)),
    (5.4, (-0.05, 0.05, HOVER)),
    (5.6, (-0.05, 0.05, PRESS)),
    (6.4, (0.30, 0.05, PRESS)),
    (6.6, (0.30, 0.05, PLAY)),
    (7.3, (-0.32, 0.05, PLAY)),
    (7.6, (-0.20, 0.05, PLAY)),
    (8.0, (-0.20, 0.05, HOVER)),
)


@scene
def table_slide() -> Scenario:
    """The gallery, the hand of fifteen parts, and a ball that its fingers push off the table."""
    links, joints = hand_parts()
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    path = through(STATIONS, times)
    names = tuple(joint.name for joint in joints)
    glove = keyframed("palm", times, path, BACKWARDS, names, RELAXED * (len(names) // 3))
    return gallery_scene(
        "table_slide",
        "a hand slides over a table and back, then pushes a ball off it",
        (links, joints),
        glove,
        ball("ball", "wood", BALL_RADIUS, BALL_MASS, BALL_START),
        expectations=(
            Expectation("meet", "palm", "table", earliest=3.0, latest=4.0),
            Expectation("part", "palm", "table", earliest=4.9, latest=5.3),
            Expectation("meet", "palm", "table", earliest=5.3, latest=5.7),
            Expectation("part", "palm", "table", earliest=6.3, latest=6.7),
            Expectation("touch", "ball", "palm", earliest=6.6, latest=7.3),
        ),
    )

"""`ball_snip`: a finger flicks a ball over a table; it rolls off the edge and falls (paper, figure 1)."""

from __future__ import annotations

import numpy as np

from scenarios.catalogue import scene
from scenarios.hand import hand_parts
from scenarios.materials import TABLE_1
from scenarios.scenario import Body, Box, Expectation, Piece, Scenario, Sphere, Tracker, Vector
from scenarios.solids import sphere_inertia

DURATION = 3.0
FRAME_RATE = 60
TABLE_TOP = 0.75
"""Height of the table's surface [m]."""
TABLE_HALF: Vector = (0.6, 0.4, 0.02)
"""Half extents of the table's top [m]; its edge is at x = 0.6."""
LEG_HALF: Vector = (0.03, 0.03, 0.355)
BALL_RADIUS = 0.02
BALL_MASS = 0.020
"""A wooden ball of 4 cm: 600 kg/m^3 [kg]."""
BALL_START: Vector = (0.15, 0.0, TABLE_TOP + BALL_RADIUS)
PALM: Vector = (0.078, -0.026, 0.847)
"""The palm, held still: its index finger, pointing down, clears the table by 4 mm and meets the ball [m]."""

FLICK_START = 0.30
FLICK_TIME = 0.12
"""The flick [s]: the index finger swings from behind the vertical to the front."""
FLEXED = (1.85, 0.10, 0.05)
STRAIGHT = (0.90, 0.10, 0.05)
OTHER_FINGERS = (0.10, 0.15, 0.10)
"""Angles of a finger's three hinges [rad]."""


@scene
def ball_snip() -> Scenario:
    """Table, floor, the hand of fifteen parts, and a ball that its index finger flicks off the table."""
    links, joints = hand_parts()
    ball = Body(
        "ball",
        "simulated",
        "wood",
        (Piece("ball", Sphere(BALL_RADIUS)),),
        mass=BALL_MASS,
        inertia=sphere_inertia(BALL_MASS, BALL_RADIUS),
        position=BALL_START,
    )
    return Scenario(
        name="ball_snip",
        summary="a finger flicks a ball over a table; it rolls off the edge and falls",
        tags=("gallery",),
        bodies=(_floor(), _table(), *links, ball),
        joints=joints,
        trackers=(_glove(tuple(joint.name for joint in joints)),),
        coefficients=TABLE_1,
        duration=DURATION,
        frame_rate=FRAME_RATE,
        expectations=(
            Expectation("touch", "ball", "palm", earliest=FLICK_START, latest=FLICK_START + FLICK_TIME),
            Expectation("roll", "ball", "table", earliest=0.35, latest=0.8),
            Expectation("leave", "ball", "table", earliest=0.7, latest=1.3),
            Expectation("land", "ball", "floor", earliest=1.0, latest=1.8),
        ),
    )


def _floor() -> Body:
    slab = Piece("floor", Box((4.0, 3.0, 0.1)), position=(0.0, 0.0, -0.1))
    return Body("floor", "fixed", "wood", (slab,))


def _table() -> Body:
    top = Piece("top", Box(TABLE_HALF), position=(0.0, 0.0, TABLE_TOP - TABLE_HALF[2]))
    corners = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    legs = tuple(
        Piece(f"leg_{k}", Box(LEG_HALF), position=(0.5 * x, 0.3 * y, LEG_HALF[2]))
        for k, (x, y) in enumerate(corners)
    )
    return Body("table", "fixed", "wood", (top, *legs))


def _glove(names: tuple[str, ...]) -> Tracker:
    """Sixty keyframes a second: the palm rests, the index finger flicks."""
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    s = np.clip((times - FLICK_START) / FLICK_TIME, 0.0, 1.0)
    blend = s * s * (3 - 2 * s)
    index = np.outer(1 - blend, FLEXED) + np.outer(blend, STRAIGHT)
    angles = np.tile(OTHER_FINGERS * (len(names) // 3), (len(times), 1))
    first = names.index("index_proximal")
    angles[:, first : first + 3] = index
    return Tracker(
        root="palm",
        joints=names,
        times=tuple(times.tolist()),
        positions=(PALM,) * len(times),
        orientations=((1.0, 0.0, 0.0, 0.0),) * len(times),
        angles=tuple(tuple(row) for row in angles.tolist()),
    )

"""`slap_*`: a flat hand moves straight down onto a table, faster than a frame can follow."""

import numpy as np

from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.gallery import TABLE_TOP, gallery
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Expectation, Scenario

SPEEDS = (2.5, 3.0, 6.0)
"""Speeds of the tracker [m/s]: 4.2, 5 and 10 cm per frame, for a table of 4 cm and fingers of 1.6 cm."""
START, HEIGHT, DEPTH = 0.1, 0.25, 0.4
"""Time at which the tracker starts to move [s], its initial height above and final depth below the table's
surface [m]."""
DURATION, FRAME_RATE = 0.6, 60
RELAXED = (0.10, 0.15, 0.10)
"""Angles of every finger's three hinges [rad]."""


@scene
def slaps() -> tuple[Scenario, ...]:
    """The hand of fifteen parts above a table of the gallery; its tracker continues through the table."""
    return tuple(slap(speed) for speed in SPEEDS)


def slap(speed: float) -> Scenario:
    """A hand whose tracker moves down at `speed` [m/s] and accelerates and stops within a frame."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    height = TABLE_TOP + np.maximum(HEIGHT - speed * np.maximum(0.0, times - START), -DEPTH)
    path = [(0.0, 0.0, z) for z in height.tolist()]
    glove = keyframed("palm", times, path, joints=names, angles=RELAXED * (len(names) // 3))
    table = next(body for body in gallery() if body.name == "table")
    return Scenario(
        name=f"slap_{speed:g}",
        summary=f"a hand at {speed:g} m/s straight down on a table of 4 cm",
        tags=("probe",),
        bodies=(table, *links),
        joints=joints,
        trackers=(glove,),
        coefficients=TABLE_1,
        duration=DURATION,
        frame_rate=FRAME_RATE,
        # Its lowest part is 1.9 cm below the palm's origin, and the coupling delays it.
        expectations=(Expectation("touch", "palm", "table", START, START + HEIGHT / speed + 0.1),),
    )

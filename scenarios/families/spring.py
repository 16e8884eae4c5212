"""`spring`: three driven bodies follow a tracker that holds, moves and holds again (Eq. 6)."""

import numpy as np

from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import PairCoefficients, Scenario, Tracker, Truth
from touchstone.scenarios.solids import block

MASSES: dict[str, float] = {"light": 0.1, "critical": 0.4, "heavy": 2.0}
"""Masses that are over-, critically and underdamped at K = 1000 N/m, R = 40 N s/m [kg]."""
HALF = 0.05
LANE = 1.0
DURATION = 1.5
FRAME_RATE = 60
START, TIME, WAY = 0.2, 0.3, 0.3
"""The tracker moves by WAY [m] along x in TIME, starting at START [s]."""


@scene
def spring() -> Scenario:
    """No contacts: the path of a mass on a damped spring, for any step."""
    bodies = tuple(block(name, "wood", (HALF,) * 3, mass, kind="driven") for name, mass in MASSES.items())
    return Scenario(
        name="spring",
        summary="three masses on damped springs follow a tracker",
        tags=("probe",),
        bodies=bodies,
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.0),),
        duration=DURATION,
        frame_rate=FRAME_RATE,
        trackers=tuple(_tracker(body.name, LANE * k) for k, body in enumerate(bodies)),
        truths=tuple(Truth(body.name, "coupling") for body in bodies),
    )


def _tracker(root: str, y: float) -> Tracker:
    times = np.arange(round(DURATION * FRAME_RATE) + 1) / FRAME_RATE
    s = np.clip((times - START) / TIME, 0.0, 1.0)
    way = WAY * s * s * (3 - 2 * s)
    return keyframed(root, times, [(x, y, 0.0) for x in way.tolist()])

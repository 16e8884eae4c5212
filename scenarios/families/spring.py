"""`spring`: three driven bodies follow a tracker that holds, moves and holds again (Eq. 6)."""

from __future__ import annotations

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Body, Box, PairCoefficients, Piece, Scenario, Tracker, Truth
from touchstone.scenarios.solids import box_inertia

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
    bodies = tuple(
        Body(
            name,
            "driven",
            "wood",
            (Piece(name, Box((HALF, HALF, HALF))),),
            mass=mass,
            inertia=box_inertia(mass, (HALF, HALF, HALF)),
        )
        for name, mass in MASSES.items()
    )
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
    return Tracker(
        root,
        (),
        tuple(times.tolist()),
        tuple((x, y, 0.0) for x in way.tolist()),
        ((1.0, 0.0, 0.0, 0.0),) * len(times),
        ((),) * len(times),
        interpolation="cubic",
    )

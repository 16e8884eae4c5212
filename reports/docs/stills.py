"""Stills of scenes from their recordings by the reference."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.mujoco.still import View, still
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.results import write_beside
from touchstone.scenarios.scenario import Scenario


class Shot(NamedTuple):
    """Moment [s] and camera of a still: angles [degrees], and distance [m] from the body `at`, or from the
    middle of all that moves."""

    time: float
    azimuth: float = 60.0
    elevation: float = -18.0
    distance: float = 3.0
    at: str = ""


SHOTS = {
    "arms_cross": Shot(2.4, azimuth=150.0),
    "ball_snip": Shot(0.40, azimuth=120.0, elevation=-25.0, distance=0.5, at="palm"),
    "corner_slide": Shot(2.6),
    "push_box": Shot(1.9, distance=3.2),
    "table_slide": Shot(5.7, elevation=-25.0, distance=0.9, at="palm"),
    "two_arms": Shot(3.25),
    "volley": Shot(0.43, azimuth=100.0, elevation=-15.0),
    "wall_push": Shot(3.0),
}
"""Stills of the gallery."""


def draw(scenarios: Iterable[Scenario], folder: Path) -> Iterator[str]:
    """Play each scene up to its shot and draw it into `folder`; yields the names of the scenes."""
    from PIL import Image

    for scenario in scenarios:
        shot = SHOTS.get(scenario.name, Shot(scenario.duration / 2))
        picture = Image.fromarray(_picture(scenario, shot))
        save = partial(picture.save, format="png", optimize=True)
        write_beside(folder / f"{scenario.name}.png", save)
        yield scenario.name


def _picture(scenario: Scenario, shot: Shot) -> np.ndarray:
    profile, dt = next(iter(ENGINES["reference"].profiles.items()))
    recording = record(load("reference"), scenario, Settings(profile, dt))
    frame = round(shot.time * scenario.frame_rate)
    position, orientation = recording.position[frame], recording.orientation[frame]
    moving = [k for k, body in enumerate(scenario.bodies) if body.kind != "fixed" and body.pieces]
    seen = position[[scenario.body_index(shot.at)] if shot.at else moving]
    x, y, z = ((seen.min(axis=0) + seen.max(axis=0)) / 2).tolist()
    view = View((x, y, z), shot.distance, shot.azimuth, shot.elevation)
    return still(scenario, position, orientation, view)

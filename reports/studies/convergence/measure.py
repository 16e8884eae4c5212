"""Measure of the study `convergence`: the error of a run against the truth of its scene."""

from __future__ import annotations

from dataclasses import replace
from math import floor

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Engine
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.measures import Measured, base_row
from touchstone.scenarios.catalogue import find
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import Scenario

ERROR = "convergence.error"
WHOLE = " whole steps"
"""Of the name of a profile whose steps the reference does not divide for the accuracy of curved contacts."""
FRAME_RATE = 30
"""Displayed frames per second of all scenes, at which errors are taken: the coarsest step is one frame."""
TRUTH_RATE = 2**9 * FRAME_RATE
"""Frames per second of truths: the law `coupling` takes trackers as linear within a frame, here to 1e-9."""
ROUNDING = 1e-9
"""Share of a frame by which rounding may shorten a scene [1]."""


def at_frame_rate(name: str, seed: int) -> Scenario:
    """A scene at FRAME_RATE, cut to whole frames."""
    scenario = find(name)
    frames = floor(scenario.duration * FRAME_RATE + ROUNDING)
    fields = {"frame_rate": FRAME_RATE, "duration": frames / FRAME_RATE}
    return replace(scenario, **fields, expectations=(), forces=())  # type: ignore[arg-type]


def convergence_error(cell: Cell, scenario: Scenario, engine: Engine) -> Measured:
    """Play the whole scene and compare it with its truth."""
    value = error_of(record(engine, scenario, cell.settings), scenario)
    row = replace(base_row(cell), metric=ERROR, value=value, unit="1")
    return Measured((replace(row, profile=row.profile + WHOLE) if cell.changes else row,))


def error_of(recording: Recording, scenario: Scenario) -> float:
    """Largest error of any body in any frame, over the scene's size [1].

    The error of a body is the root of the squares of its centre's distance and of its angle times its radius
    of gyration. The size is the longest way of a centre, or the largest radius of gyration if that is longer.
    """
    centers = Context(recording, scenario).mass_centers
    smooth = replace(scenario, frame_rate=TRUTH_RATE)
    errors, sizes = [], []
    for one in scenario.truths:
        k, truth = scenario.body_index(one.body), motion(smooth, one, recording.time)
        body = scenario.bodies[k]
        radius = (np.trace(body.inertia) / (2 * body.mass)) ** 0.5
        is_at, must_be = (
            Rotation.from_quat(q, scalar_first=True) for q in (recording.orientation[:, k], truth.orientation)
        )
        away = np.linalg.norm(centers[:, k] - truth.position, axis=1)
        errors.append(np.hypot(away, radius * (is_at * must_be.inv()).magnitude()).max())
        sizes.append(max(np.linalg.norm(truth.position - truth.position[0], axis=1).max(), radius))
    return float(max(errors) / max(sizes))

"""Tracked poses of driven bodies, and where these overlap other bodies; the same for every engine."""

from __future__ import annotations

from functools import lru_cache
from types import SimpleNamespace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context, judging
from touchstone.scenarios.avatar.kinematics import tracked_poses
from touchstone.scenarios.scenario import Scenario, Tracker

Mask = NDArray[np.bool_]

PRESSED = 1e-3
"""Depth of a tracked link in a body from which the link is pressed against it [m]: a visible depth."""
KEPT_SCENES = 4
"""Number of scenes whose tracked depths are cached: the columns of a scene are judged in sequence."""


def pressed(context: Context, tracker: Tracker) -> dict[int, Mask]:
    """Mask (f,) of pressed frames, per body that a tracker presses links of its driven body into [bool].

    The body is fixed, or driven too (a link of the same driven body where these may touch). Raises
    JudgeMissing where the overlap oracle cannot be imported.
    """
    scenario, frames = context.scenario, len(context.recording.time)
    links = set(scenario.links(tracker))
    found: dict[int, Mask] = {}
    for (a, b), depth in tracked_depths(scenario).items():
        for link, other in ((a, b), (b, a)):
            if link in links:
                deep = depth[:frames] > PRESSED
                found[other] = found[other] | deep if other in found else deep
    return {other: deep for other, deep in found.items() if deep.any()}


@lru_cache(KEPT_SCENES)
def tracked_depths(scenario: Scenario) -> dict[tuple[int, int], Array]:
    """Depth (f,) [m] of every pair of a tracked link and a body that is not simulated."""
    with judging():
        from touchstone.adapters.oracles.overlap import measure
    frames = scenario.frame_count + 1
    times = np.arange(frames) / scenario.frame_rate
    position = np.tile([body.position for body in scenario.bodies], (frames, 1, 1))
    orientation = np.tile([body.orientation for body in scenario.bodies], (frames, 1, 1))
    for tracker in scenario.trackers:
        links = list(scenario.links(tracker))
        position[:, links], orientation[:, links] = tracked_poses(scenario, tracker, times)
    shown = SimpleNamespace(time=times, position=position, orientation=orientation)
    distances = measure(cast(Recording, shown), scenario).distance
    kinds = [body.kind for body in scenario.bodies]
    return {
        (a, b): np.maximum(0.0, -distance)
        for (a, b), distance in distances.items()
        if "driven" in (kinds[a], kinds[b]) and "simulated" not in (kinds[a], kinds[b])
    }

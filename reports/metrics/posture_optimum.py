"""Deviation of the shown posture from the tracked one, and of the best known free posture from it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Values, judging
from touchstone.reports.metrics.tracked import pressed
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.scenario import Tracker

FRAMES = 6
"""Number of evenly spread pressed frames to optimise, 0.2 s each. Twelve change the result by 0.2 %."""


def posture_deviation(context: Context) -> Values:
    """Angle between shown and tracked hinges, rms over joints and pressed frames [rad]."""
    tracker, frames = _person(context)
    away = _shown(context, tracker) - sample(tracker, context.recording.time).angle
    return {"": float(np.sqrt(np.mean(away[frames] ** 2)))}


def posture_over_best(context: Context) -> Values:
    """Sum of |q - q_tracker|^2 shown over that of the best known free posture, 6 pressed frames [1].

    In pressed frames the tracker's posture overlaps something; they are the same for every engine. The best
    posture is that of 20 starts, with the root in its shown pose (`nearest_posture.py`).
    """
    tracker, frames = _person(context)
    with judging():
        from touchstone.adapters.oracles.nearest_posture import NearestPosture
    scenario, recording = context.scenario, context.recording
    search, root = NearestPosture(scenario, tracker), scenario.body_index(tracker.root)
    chosen = frames[np.linspace(0, len(frames) - 1, min(FRAMES, len(frames))).round().astype(int)]
    shown, tracked = _shown(context, tracker), sample(tracker, recording.time).angle
    rng, best = np.random.default_rng(scenario.seed), 0.0
    last: list[Array] = []
    for f in chosen.tolist():
        turned = Rotation.from_quat(recording.orientation[f], scalar_first=True).as_matrix()
        poses = list(zip(turned, recording.position[f]))
        posture = search.best(poses[root], poses, tracked[f], [tracked[f], shown[f], *last], rng)
        if posture is None:
            raise NotMeasured(f"no free posture found at {recording.time[f]:.3f} s")
        best += float(np.sum((posture - tracked[f]) ** 2))
        last = [posture]
    if best == 0:
        raise NotMeasured(f"tracked postures are free where the root is shown ({len(chosen)} frames)")
    return {"": float(np.sum((shown[chosen] - tracked[chosen]) ** 2)) / best}


def _person(context: Context) -> tuple[Tracker, NDArray[np.int64]]:
    """The first driven body with chains, and the frames in which its tracker presses it into something."""
    scenario = context.scenario
    turned = {name for chain in scenario.chains for name in chain.joints}
    tracker = next((t for t in scenario.trackers if turned & set(t.joints)), None)
    if tracker is None:
        raise NotMeasured("no driven body with chains")
    deep = list(pressed(context, tracker).values())
    if not deep:
        raise NotMeasured("the tracker presses the driven body into nothing")
    return tracker, np.flatnonzero(np.any(deep, axis=0))


def _shown(context: Context, tracker: Tracker) -> Array:
    """Angles of the tracker's hinges (f, j) [rad]."""
    trackers = context.scenario.trackers
    first = sum(len(other.joints) for other in trackers[: trackers.index(tracker)])
    return context.recording.joint_angle[:, first : first + len(tracker.joints)]

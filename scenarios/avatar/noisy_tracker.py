"""Trackers as they are: jitter, lost samples, and 60 samples a second that are held in between.

The default is the `ideal` tracker, whose keyframes are interpolated by cubics (`tracking.py`). `noisy`
replaces each tracker by what a device would report of it. Deterministic: the noise follows from the scene's
seed.
"""

from __future__ import annotations

from dataclasses import replace
from math import ceil, radians

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.tracking import TrackerMotion, sample
from touchstone.scenarios.scenario import Scenario, Tracker, vector

TRACKERS = ("ideal", "noisy")
"""Variants of a scene's trackers; the first is the default."""
RATE = 60
"""Samples a second."""
JITTER, JITTER_ANGLE = 1e-3, radians(0.5)
"""Standard deviations of a sample: of the root's position along each axis [m], and of its rotation about each
axis and of every hinge's angle [rad]."""
LOSS, LONGEST_LOSS = 0.02, 5
"""Chance that a sample is the first of some that are lost [1], and how many at most: a device is blind for up
to 83 ms."""


def noisy(scenario: Scenario) -> Scenario:
    """The scene with noisy trackers; one without trackers stays as it is.

    Closed forms are those of the ideal tracker, and left out. Expectations stay, as times to measure.
    """
    if not scenario.trackers:
        return scenario
    trackers = tuple(
        noisy_tracker(tracker, scenario.duration, np.random.default_rng((scenario.seed, k)))
        for k, tracker in enumerate(scenario.trackers)
    )
    return replace(scenario, trackers=trackers, truths=())


def noisy_tracker(tracker: Tracker, duration: float, rng: np.random.Generator) -> Tracker:
    """What a device reports of a tracker over `duration` [s]: held samples, the first of them good and exact.

    A lost sample repeats the last one that was not, jitter included; `held` counts them.
    """
    times = np.arange(ceil(duration * RATE - 1e-9) + 1) / RATE
    shown = sample(tracker, np.minimum(times, duration))
    positions, turned, angles = _jittered(shown, rng)
    source = _sources(len(times), rng)
    return replace(
        tracker,
        times=tuple(times.tolist()),
        positions=tuple(vector(positions[k]) for k in source),
        orientations=tuple(tuple(turned[k].tolist()) for k in source),
        angles=tuple(tuple(angles[k].tolist()) for k in source),
        held=tracker.held + int((source != np.arange(len(times))).sum()),
        interpolation="held",
    )


def _jittered(
    shown: TrackerMotion, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Positions, orientations and angles of samples with jitter on all but the first."""
    moved, turns, bent = (
        size * rng.standard_normal(like.shape)
        for size, like in (
            (JITTER, shown.position),
            (JITTER_ANGLE, shown.position),
            (JITTER_ANGLE, shown.angle),
        )
    )
    for noise in (moved, turns, bent):
        noise[:1] = 0.0
    turned = Rotation.from_rotvec(turns) * Rotation.from_quat(shown.orientation, scalar_first=True)
    return shown.position + moved, turned.as_quat(scalar_first=True), shown.angle + bent


def _sources(count: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Of every sample the one that is reported (n,): itself, or the last before a loss."""
    lost = np.zeros(count, bool)
    for first in np.flatnonzero(rng.random(count) < LOSS):
        lost[max(1, first) : first + int(rng.integers(1, LONGEST_LOSS + 1))] = True
    return np.maximum.accumulate(np.where(lost, 0, np.arange(count)))

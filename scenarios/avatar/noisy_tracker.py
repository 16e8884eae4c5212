"""Realistic trackers: jitter, lost samples, and 60 samples per second that are held in between.

The default is the `ideal` tracker, which interpolates keyframes by cubics (`tracking.py`). `noisy` replaces
each tracker by the output of a simulated device. The noise is deterministic: it follows from the scene's
seed.
"""

from dataclasses import replace
from math import ceil, radians

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.tracking import TrackerMotion, sample
from touchstone.scenarios.scenario import Scenario, Tracker, vector

TRACKERS = ("ideal", "noisy")
"""Variants of a scene's trackers; the first is the default."""
RATE = 60
"""Samples per second."""
JITTER, JITTER_ANGLE = 1e-3, radians(0.5)
"""Standard deviations of a sample: the root's position along each axis [m]; its rotation about each axis, and
every hinge's angle [rad]."""
LOSS, LONGEST_LOSS = 0.02, 5
"""Probability that a sample starts a loss [1], and the maximum number of lost samples: the device reports
nothing for up to 83 ms."""


def noisy(scenario: Scenario) -> Scenario:
    """Scene with noisy trackers; one without driven bodies is returned as it is. Prescribed paths are exact.

    Removes the truths, which hold for the ideal tracker. Keeps the expectations, as times to measure.
    """
    if all(map(scenario.prescribes, scenario.trackers)):
        return scenario
    trackers = tuple(
        tracker
        if scenario.prescribes(tracker)
        else noisy_tracker(tracker, scenario.duration, np.random.default_rng((scenario.seed, k)))
        for k, tracker in enumerate(scenario.trackers)
    )
    return replace(scenario, trackers=trackers, truths=(), forces=())


def noisy_tracker(tracker: Tracker, duration: float, rng: np.random.Generator) -> Tracker:
    """Output of a simulated device for a tracker over `duration` [s]: held samples, the first of them exact.

    A lost sample repeats the last good one, jitter included; `held` counts them.
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


def _jittered(shown: TrackerMotion, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Positions, orientations and angles of samples, with jitter on all but the first."""
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
    """Index of the sample that is reported for each sample (n,): itself, or the last one before a loss."""
    lost = np.zeros(count, bool)
    for first in np.flatnonzero(rng.random(count) < LOSS):
        lost[max(1, first) : first + int(rng.integers(1, LONGEST_LOSS + 1))] = True
    return np.maximum.accumulate(np.where(lost, 0, np.arange(count)))

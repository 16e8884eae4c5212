"""Ratios of times measured in one run, with bootstrap intervals: the only claims about speed.

A frame of a scene does the same work in every restart of an engine: its time is the median over restarts.
Intervals resample the speeds of restarts first, then blocks of frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array

RESAMPLES = 1000
CONFIDENCE = 95.0
"""Width of the interval [%]."""
BLOCK = 15
"""Consecutive frames that are resampled together, a quarter of a second: neighbours take similar times."""


class Interval(NamedTuple):
    """A value with its bootstrap interval."""

    value: float
    low: float
    high: float


def _around(value: Any, resampled: Array) -> Interval:
    low, high = np.percentile(resampled, [50 - CONFIDENCE / 2, 50 + CONFIDENCE / 2])
    return Interval(float(value), float(low), float(high))


Middle = Callable[..., Any]
"""`np.median`, or `np.mean` where the total counts: both take an axis."""


def time_ratio(ours: Array, theirs: Array, seed: int = 0, middle: Middle = np.median) -> Interval:
    """Ratio of the median of `ours` to that of `theirs`, over their common length; frames are resampled in
    pairs because they share noise."""
    rng = np.random.default_rng(seed)
    count = min(len(ours), len(theirs))
    ours, theirs = ours[:count], theirs[:count]
    drawn = rng.integers(count, size=(RESAMPLES, count))
    ratios = middle(ours[drawn], axis=1) / middle(theirs[drawn], axis=1)
    return _around(middle(ours) / middle(theirs), ratios)


Statistic = Callable[[Array], Array]
"""Statistic of times over the last axis, in proportion to them."""
Indices = NDArray[np.intp]


def mean(times: Array) -> Array:
    """Mean of times [s]."""
    return np.asarray(times.mean(axis=-1))


RATIO = "ratio.time"
STATISTICS: dict[str, Statistic] = {
    "": mean,
    ".all": mean,
    ".median": lambda times: np.median(times, axis=-1),
    ".p99": lambda times: np.percentile(times, 99, axis=-1),
}
"""Suffix of the metric -> statistic; the first over the frames with a contact, the others over all frames."""
RATIOS = tuple(f"{RATIO}{suffix}" for suffix in STATISTICS)


def restart_ratio(
    ours: Array, theirs: Array, statistic: Statistic, chosen: Indices, seed: int = 0
) -> Interval:
    """Ratio of a statistic over the chosen frames of `ours` (r, f) to that of `theirs` (s, f) [s].

    Args:
        ours, theirs: times per restart and frame; both of the same frames.
        statistic: of the times of several frames.
        chosen: indices (c,) of the frames that count, ascending, at least one.
    """
    rng = np.random.default_rng(seed)
    mine, my_speeds = _course(ours[:, chosen], rng)
    other, their_speeds = _course(theirs[:, chosen], rng)
    frames = _blocks(len(chosen), rng)
    found = my_speeds / their_speeds * statistic(mine[frames]) / statistic(other[frames])
    value, low, high = _around(statistic(mine) / statistic(other), found)
    # the spread of so few restarts is underestimated, as a sample's variance is
    fewest = min(len(ours), len(theirs)) if len(theirs) > 1 else len(ours)
    wider = sqrt(fewest / (fewest - 1)) if fewest > 1 else 1.0
    return Interval(value, value * (low / value) ** wider, value * (high / value) ** wider)


def restart_interval(times: Array, statistic: Statistic, chosen: Indices) -> Interval:
    """A statistic over the chosen frames of times (r, f) [s], with its interval, as in `restart_ratio`."""
    return restart_ratio(times, np.ones((1, times.shape[1])), statistic, chosen)


def _course(times: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """What all restarts (r, c) share, and speeds (RESAMPLES,) of as many restarts drawn with replacement.

    The course (c,) is the median over restarts, so that a frame during which another process ran in one
    restart does not count. A restart's speed is its median ratio to the course; it differs with where memory
    lies.
    """
    course: Array = np.median(times, axis=0)
    speeds = np.median(times / course, axis=1)
    drawn = speeds[rng.integers(len(speeds), size=(RESAMPLES, len(speeds)))]
    return course, np.asarray(np.median(drawn, axis=1))


def _blocks(count: int, rng: np.random.Generator) -> Indices:
    """Indices (RESAMPLES, count) of blocks of BLOCK frames, drawn with replacement; the last precedes the
    first."""
    starts = rng.integers(count, size=(RESAMPLES, -(-count // BLOCK)))
    found = (starts[:, :, None] + np.arange(BLOCK)).reshape(RESAMPLES, -1)
    return np.asarray(found[:, :count] % count)


def median_interval(sample: Array, middle: Middle = np.median) -> Interval:
    """Median of a sample with its bootstrap interval."""
    drawn = np.random.default_rng(0).integers(len(sample), size=(RESAMPLES, len(sample)))
    return _around(middle(sample), middle(sample[drawn], axis=1))


def exponent(sizes: Sequence[float], times: Sequence[Array]) -> Interval:
    """Exponent of a power law with its bootstrap interval: the least-squares slope of log median time over
    log size; the repetitions of each size, `times`, are resampled."""
    rng = np.random.default_rng(0)
    x = np.log(np.asarray(sizes, dtype=float))
    weights = (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    medians = [
        np.append(np.median(t[rng.integers(len(t), size=(RESAMPLES, len(t)))], axis=1), np.median(t))
        for t in times
    ]
    slopes = weights @ np.log(medians)
    return _around(slopes[-1], slopes[:-1])

"""Ratios of times measured in one run, with bootstrap intervals: the only claims about speed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchstone.adapters.contract import Array

RESAMPLES = 1000
CONFIDENCE = 95.0
"""Width of the interval [%]."""


@dataclass(frozen=True, slots=True)
class Ratio:
    """A ratio of medians or means with its bootstrap interval."""

    value: float
    low: float
    high: float


Middle = Callable[..., Any]
"""`np.median`, or `np.mean` where the total counts: both take an axis."""


def time_ratio(ours: Array, theirs: Array, seed: int = 0, middle: Middle = np.median) -> Ratio:
    """Ratio of the median of `ours` to that of `theirs`, over their common length; frames are resampled in
    pairs because they share noise."""
    rng = np.random.default_rng(seed)
    count = min(len(ours), len(theirs))
    ours, theirs = ours[:count], theirs[:count]
    drawn = rng.integers(count, size=(RESAMPLES, count))
    ratios = middle(ours[drawn], axis=1) / middle(theirs[drawn], axis=1)
    low, high = np.percentile(ratios, [50 - CONFIDENCE / 2, 50 + CONFIDENCE / 2])
    return Ratio(float(middle(ours) / middle(theirs)), float(low), float(high))


def median_interval(sample: Array, seed: int = 0, middle: Middle = np.median) -> tuple[float, float, float]:
    """Median of a sample with its bootstrap interval."""
    drawn = np.random.default_rng(seed).integers(len(sample), size=(RESAMPLES, len(sample)))
    low, high = np.percentile(middle(sample[drawn], axis=1), [50 - CONFIDENCE / 2, 50 + CONFIDENCE / 2])
    return float(middle(sample)), float(low), float(high)


def exponent(sizes: Sequence[float], times: Sequence[Array], seed: int = 0) -> tuple[float, float, float]:
    """Exponent of a power law with its bootstrap interval: the least-squares slope of log median time over
    log size; the repetitions of each size, `times`, are resampled."""
    rng = np.random.default_rng(seed)
    x = np.log(np.asarray(sizes, dtype=float))
    weights = (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    medians = [
        np.append(np.median(t[rng.integers(len(t), size=(RESAMPLES, len(t)))], axis=1), np.median(t))
        for t in times
    ]
    slopes = weights @ np.log(medians)
    low, high = np.percentile(slopes[:-1], [50 - CONFIDENCE / 2, 50 + CONFIDENCE / 2])
    return float(slopes[-1]), float(low), float(high)

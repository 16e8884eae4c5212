"""Ratios of times measured in one run, with bootstrap intervals: all that may be claimed about speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from adapters.engine import Array

RESAMPLES = 1000
CONFIDENCE = 95.0
"""Width of the interval [%]."""


@dataclass(frozen=True, slots=True)
class Ratio:
    """A ratio of medians with its bootstrap interval."""

    value: float
    low: float
    high: float


def time_ratio(ours: Array, theirs: Array, seed: int = 0) -> Ratio:
    """Median of `ours` over median of `theirs`; frames are resampled in pairs, for they share the noise."""
    rng = np.random.default_rng(seed)
    count = min(len(ours), len(theirs))
    drawn = rng.integers(count, size=(RESAMPLES, count))
    ratios = np.median(ours[drawn], axis=1) / np.median(theirs[drawn], axis=1)
    low, high = np.percentile(ratios, [50 - CONFIDENCE / 2, 50 + CONFIDENCE / 2])
    return Ratio(float(np.median(ours) / np.median(theirs)), float(low), float(high))

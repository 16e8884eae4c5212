"""Verdicts on a series of times, one value per night: rules for noise that is right-tailed and has spikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from touchstone.adapters.contract import Array

FEWEST = 10
"""Nights before which there is no verdict [1]."""
WINDOW = 60
"""Nights before the last ones with which these are compared [1]."""
RECENT = 3
"""Last nights that are compared [1]."""
MADS = 4.0
"""Distance from the median that warns, in median absolute deviations [1]."""
SHARE = 0.05
"""Least relative distance from the median that warns or confirms [1]."""
QUANTILE = 0.85
"""Quantile of the nights before which all RECENT nights must exceed to confirm a step [1].

With independent nights all three do so by chance with a probability of 0.15^3 = 0.3 %, whatever the noise.
"""

LAG = 14
"""Last nights that are not among those before, once there are enough: a step shows for as long [1]."""


@dataclass(frozen=True, slots=True)
class Step:
    """A confirmed step: index of its first night, median before and after."""

    first: int
    before: float
    after: float

    @property
    def ratio(self) -> float:
        """Time after over time before [1]."""
        return self.after / self.before


def warns(values: Array) -> bool:
    """Whether 2 of the last 3 nights lie above median + max(4 MAD, 5 %) of those before."""
    before, last = _split(_finite(values))
    if len(before) < FEWEST:
        return False
    median = np.median(before)
    mad = np.median(np.abs(before - median))
    return int(np.sum(last > median + max(MADS * mad, SHARE * median))) >= 2


def step(values: Array) -> Step | None:
    """The step upwards that the last nights confirm, with its first night.

    Args:
        values: time of each night [s], in order; NaN where a night has none.
    """
    series = _finite(values)
    before, last = _split(series)
    if len(before) < FEWEST:
        return None
    far = float(np.median(last)) > (1 + SHARE) * float(np.median(before))
    if not (far and last.min() > np.quantile(before, QUANTILE)):
        return None
    first = _first_night(series)
    kept = np.flatnonzero(np.isfinite(np.asarray(values, dtype=float)))
    return Step(
        int(kept[first]), float(np.median(series[:first][-WINDOW:])), float(np.median(series[first:]))
    )


def _finite(values: Array) -> Array:
    found = np.asarray(values, dtype=float)
    return found[np.isfinite(found)]


def _split(series: Array) -> tuple[Array, Array]:
    """Nights before, and the last ones."""
    lag = LAG if len(series) >= FEWEST + LAG else RECENT
    return series[:-lag][-WINDOW:], series[-RECENT:]


def _first_night(series: Array) -> int:
    """The split in the last nights that leaves the least sum of absolute deviations from two medians."""
    part = series[-(WINDOW + LAG) :]
    cost = {
        k: np.abs(part[:k] - np.median(part[:k])).sum() + np.abs(part[k:] - np.median(part[k:])).sum()
        for k in range(max(1, len(part) - LAG), len(part) - RECENT + 1)
    }
    return len(series) - len(part) + min(cost, key=lambda k: cost[k])

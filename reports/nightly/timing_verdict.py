"""Verdicts on a series of times, one value per night: rules for noise that is right-tailed and has spikes.

A step is confirmed by an exact permutation test: how much better does one common shift explain the last three
nights than three draws from the noise, compared with every other choice of three nights? The noise model (a
normal core, and spikes with an exponential tail) decides the power only. The rate of false alarms is the
level of the test for any noise whose nights are exchangeable.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

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
LEVEL = 0.0075
"""Level of the test that confirms a step [1]: below the 1 % of false alarms that is allowed."""
NORMAL = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation [1]."""
QUIETEST = 1e-3
"""Least standard deviation of the logarithm of a time [1]: clocks and frequencies vary by as much."""
SPIKE = 3.0
"""Distance from the median from which a night counts as a spike [standard deviations]."""
TAIL = 8.0
"""Mean height of spikes [standard deviations]: 40 % where nights vary by 5 %."""
FEW_SPIKES, MANY_SPIKES = 0.01, 0.3
"""Bounds of the share of spikes in the model [1]."""
LEAST_DENSITY = 1e-4
"""Density that the model adds everywhere [1 / standard deviation], so that no night is impossible."""
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
    middle = float(np.median(before))
    far = float(np.median(last)) > (1 + SHARE) * middle and last.min() > middle
    if not far or chance(before, last) > LEVEL:
        return None
    first = _first_night(series)
    kept = np.flatnonzero(_usable(np.asarray(values, dtype=float)))
    return Step(
        int(kept[first]), float(np.median(series[:first][-WINDOW:])), float(np.median(series[first:]))
    )


def chance(before: Array, last: Array) -> float:
    """P-value of the permutation test: the share of all choices of RECENT nights whose likelihood ratio of a
    step is no less than that of `last` [1].

    Args:
        before, last: times [s], positive; `last` holds RECENT of them.
    """
    logs = np.log(np.r_[before, last])
    middle = np.median(logs)
    scale = max(NORMAL * float(np.median(np.abs(logs - middle))), QUIETEST)
    z = (logs - middle) / scale
    spikes = float(np.clip(np.mean(z > SPIKE), FEW_SPIKES, MANY_SPIKES))
    chosen = _choices(len(z))
    # the shift that explains three nights best is nearly their median
    shift = np.maximum(np.median(z[chosen], axis=1), np.log(1 + SHARE) / scale)
    ratio = (_log_density(z[chosen] - shift[:, None], spikes) - _log_density(z, spikes)[chosen]).sum(axis=1)
    # The last choice is that of the last nights; rounding must not break ties.
    return float(np.mean(ratio >= ratio[-1] - 1e-9))


@cache
def _choices(count: int) -> NDArray[np.intp]:
    """All choices of RECENT of `count` nights, the last nights last."""
    return np.array(list(combinations(range(count), RECENT)))


def _log_density(z: Array, spikes: float) -> Array:
    """Logarithm of the model's density at distances z from the median [standard deviations]."""
    core = np.exp(-z * z / 2) / np.sqrt(2 * np.pi)
    tail = np.where(z > 0, np.exp(-np.abs(z) / TAIL) / TAIL, 0.0)
    found: Array = np.log((1 - spikes) * core + spikes * tail + LEAST_DENSITY)
    return found


def _finite(values: Array) -> Array:
    found = np.asarray(values, dtype=float)
    return found[_usable(found)]


def _usable(values: Array) -> NDArray[np.bool_]:
    """Whether each night has a time."""
    return np.isfinite(values) & (values > 0)


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

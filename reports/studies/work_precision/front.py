"""Pareto fronts of error over time, bands over repeats, and where one front dominates another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from touchstone.adapters.contract import Array


def pareto(time: Array, error: Array, floor: float = 0.0) -> Array:
    """Whether each point is on the front: no other is better in one and no worse in the other (n,).

    Args:
        time: [s] (n,).
        error: (n,); errors below `floor` count as equal.
    """
    time, error = np.asarray(time, dtype=float), np.maximum(np.asarray(error, dtype=float), floor)
    order = np.lexsort((error, time))
    found = np.zeros(len(time), dtype=bool)
    least = np.inf
    for k, i in enumerate(order):
        if not np.isfinite(time[i]) or not np.isfinite(error[i]):
            continue
        # points of equal time and error are all on the front
        twin = (
            k > 0 and found[order[k - 1]] and (time[i], error[i]) == (time[order[k - 1]], error[order[k - 1]])
        )
        if error[i] < least or twin:
            found[i], least = True, error[i]
    return found


def band(samples: Sequence[float]) -> tuple[float, float, float]:
    """Median, least and largest of the repeats; NaN without any."""
    values = np.asarray(samples, dtype=float)
    if not len(values):
        return np.nan, np.nan, np.nan
    return float(np.median(values)), float(values.min()), float(values.max())


def deficit(ours: Array, theirs: Array, floor: float) -> Array:
    """By which factor each of their points is better than the nearest of ours (m,); at most 1: dominated.

    Our point answers theirs up to the larger of both ratios, of time and of error: at most so many times
    slower and so many times less accurate. Of our points the best one counts.

    Args:
        ours: time and error (n, 2).
        theirs: time and error (m, 2).
        floor: errors below it count as equal.
    """
    a, b = (np.array(points, dtype=float).reshape(-1, 2) for points in (ours, theirs))
    a[:, 1], b[:, 1] = np.maximum(a[:, 1], floor), np.maximum(b[:, 1], floor)
    if not len(a):
        return np.full(len(b), np.inf)
    with np.errstate(invalid="ignore"):
        factors = np.maximum(a[None, :, 0] / b[:, None, 0], a[None, :, 1] / b[:, None, 1])
    return np.asarray(np.where(np.isnan(factors), np.inf, factors).min(axis=1))

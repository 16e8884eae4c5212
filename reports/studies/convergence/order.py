"""Order of convergence and floor of errors at decreasing steps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import nan
from typing import Literal

import numpy as np
from scipy.stats import linregress, t

EXACT = 1e-10
"""Error that counts as none, over the scene's size [1]: what the truths' integrations leave open."""
ABOVE = 3.0
"""Ratio to the floor above which an error tells an order [1]: at most a third of it is floor."""
LEAST_POINTS = 3
"""Steps that an order needs: with two there is no interval."""
FALLING = 0.25
"""Order between the two finest steps above which the error still falls [1]."""
CONFIDENCE = 0.95
Kind = Literal["order", "exact", "flat", "few"]


@dataclass(frozen=True, slots=True)
class Order:
    """Order of convergence with its interval, and the floor: the error at the finest step.

    kind: `exact`: no error is above EXACT. `order`: LEAST_POINTS errors or more are above the floor. `flat`:
    none is. `few`: too few are.
    """

    kind: Kind
    floor: float
    falls: bool  # whether the finest step still lowers the error
    value: float = nan
    low: float = nan
    high: float = nan


def order_of(steps: Sequence[float], errors: Sequence[float]) -> Order:
    """Least squares of log error over log step, over the steps above the floor, with Student's interval.

    Args:
        steps: two or more, in any order [s].
        errors: finite.
    """
    order = np.argsort(steps)[::-1]
    h, e = np.array(steps)[order], np.array(errors)[order]
    floor = float(e[-1])
    if e.max() <= ABOVE * EXACT:
        return Order("exact", floor, False)
    falls = bool(EXACT < floor < e[-2] * (h[-1] / h[-2]) ** FALLING)
    kept = e > ABOVE * max(floor, EXACT)
    if kept.sum() < LEAST_POINTS:
        return Order("few" if kept.any() else "flat", floor, falls)
    fit = linregress(np.log(h[kept]), np.log(e[kept]))
    half = float(t.ppf((1 + CONFIDENCE) / 2, kept.sum() - 2) * fit.stderr)
    return Order("order", floor, falls, float(fit.slope), float(fit.slope) - half, float(fit.slope) + half)

"""Ratio of the reference's time to an engine's as a product: steps x articulated dynamics x time per step.

With r the reference at its own step and q at the common step, R an engine at its own step, E at the common
step and P there with kinematic links, all over the same frames: r / R = (r / q * E / R) * (P / E) * (q / P).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import nan

import numpy as np

from touchstone.reports.bootstrap import mean
from touchstone.reports.results import Row
from touchstone.reports.run.ratios import Timed, pair_frames
from touchstone.reports.run.request import EQUAL_PROFILE, MACHINE_PROFILE, REFERENCE
from touchstone.reports.run.time_limits import POSED_LABEL

FACTORS = ("ratio.steps", "ratio.dynamics", "ratio.step")
"""Factors by the numbers of steps, by the dynamics of links, and per step without these."""


def factor_rows(study: str, scenario: str, columns: Mapping[tuple[str, str], Timed]) -> Iterator[Row]:
    """FACTORS of the reference over every engine whose columns are complete."""
    ours, common = (columns.get((REFERENCE, name)) for name in ("balanced", EQUAL_PROFILE))
    for engine in dict.fromkeys(engine for engine, _ in columns if engine != REFERENCE):
        own, equal = (columns.get((engine, name)) for name in (MACHINE_PROFILE, EQUAL_PROFILE))
        posed = columns.get((engine, f"{EQUAL_PROFILE}, {POSED_LABEL}"))
        if ours is None or common is None or own is None or equal is None:
            continue
        r, q, big_r, e, p = _means(ours, common, own, equal, posed or equal)
        values = (r / q * e / big_r, p / e if posed else nan, q / p)
        for name, value in zip(FACTORS, values):
            reason = "" if value == value else "no driven body"
            row = Row(study, scenario, REFERENCE, ours.label, ours.dt, name, value, "1")
            yield replace(row, subject=f"{engine} {own.label}", reason=reason)


def _means(ours: Timed, *others: Timed) -> list[float]:
    """Mean frame [s] of all columns, over the frames that all played in which the first or third has a
    contact."""
    count = min(column.times.shape[1] for column in (ours, *others))
    _, _, chosen, _ = pair_frames(ours, others[1])
    chosen = chosen[chosen < count]
    return [float(mean(np.median(column.times, axis=0)[chosen])) for column in (ours, *others)]

"""Time series: of metrics that report the largest value over the frames, and of contact forces."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts.forces import force_series
from touchstone.reports.metrics.contacts.overlap import overlap_depth
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import energy_rise
from touchstone.scenarios.scenario import ShortRepr

FORCE = "force.contact"
"""Series of the normal force per pair."""
_OVER_TIME: dict[str, Callable[[Context], dict[str, Array]]] = {
    "overlap.max": lambda context: {"": overlap_depth(context)},
    "energy.injected": energy_rise,
    FORCE: force_series,
}


@dataclass(frozen=True, slots=True, repr=False)
class Course(ShortRepr):
    """Per metric and subject the values (f,) at `time` (f,) [s] of which the metric reports the largest; and
    the force of each pair, as the series FORCE."""

    time: Array
    values: dict[tuple[str, str], Array]


def course(context: Context) -> Course:
    """Time series of `overlap.max` [m], `energy.injected` [J] and FORCE [N], without those that cannot be
    measured."""
    found: dict[tuple[str, str], Array] = {}
    for metric, measure in _OVER_TIME.items():
        try:
            values = measure(context)
        except Exception:  # the metric's row holds the reason
            continue
        found |= {(metric, subject): value for subject, value in values.items()}
    return Course(context.recording.time, found)


def heaviest_pairs(courses: Iterable[Course], most: int) -> list[str]:
    """Pairs of the series FORCE, at most `most`, by their largest impulse in any course."""
    largest: dict[str, float] = {}
    for one in courses:
        for (metric, pair), force in one.values.items():
            if metric == FORCE:
                largest[pair] = max(largest.get(pair, 0.0), float(np.nansum(force)))
    return sorted(largest, key=lambda pair: -largest[pair])[:most]

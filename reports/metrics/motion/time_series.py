"""Time series of metrics that report the largest value over the frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts.overlap import overlap_depth
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import energy_rise
from touchstone.scenarios.scenario import ShortRepr

_OVER_TIME: dict[str, Callable[[Context], dict[str, Array]]] = {
    "overlap.max": lambda context: {"": overlap_depth(context)},
    "energy.injected": energy_rise,
}


@dataclass(frozen=True, slots=True, repr=False)
class Course(ShortRepr):
    """Per metric and subject, the values (f,) at `time` (f,) [s] of which the metric reports the largest."""

    time: Array
    values: dict[tuple[str, str], Array]


def course(context: Context) -> Course:
    """Time series of `overlap.max` [m] and `energy.injected` [J], without metrics that cannot be measured."""
    found: dict[tuple[str, str], Array] = {}
    for metric, measure in _OVER_TIME.items():
        try:
            values = measure(context)
        except Exception:  # the metric's row holds the reason
            continue
        found |= {(metric, subject): value for subject, value in values.items()}
    return Course(context.recording.time, found)

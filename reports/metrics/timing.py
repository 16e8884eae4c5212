"""Time and work per frame. Only ratios get verdicts; single times depend on the machine."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Values
from touchstone.reports.metrics.solver import UNRESOLVED

STATISTICS: dict[str, tuple[str, float]] = {
    "median": ("Median", 50),
    "p95": ("95th percentile", 95),
    "p99": ("99th percentile", 99),
    "max": ("Maximum", 100),
}


def _percentile(seconds: Array, share: float) -> Values:
    """A percentile of times; raises NotMeasured where no engine was timed."""
    if not len(seconds):
        raise NotMeasured("no frame was timed")
    return {"": float(np.percentile(seconds, share))}


def time_frame(statistic: str) -> Callable[[Context], Values]:
    """The metric of one statistic of the wall time per displayed frame."""
    name, percentile = STATISTICS[statistic]

    def measure(context: Context) -> Values:
        return _percentile(context.recording.time_frame, percentile)

    measure.__doc__ = f"{name} over the frames of the native step calls of a displayed frame [s]."
    return measure


def time_drive(context: Context) -> Values:
    """Median time per displayed frame to set commands from Python [s]; the reference's frame includes it."""
    return _percentile(context.recording.time_drive, 50)


def time_read(context: Context) -> Values:
    """Median time per displayed frame to read the state out [s]; in no other figure."""
    return _percentile(context.recording.time_read, 50)


def time_crossing(context: Context) -> Values:
    """Median time of an empty call into the engine [s]."""
    return _percentile(context.recording.time_crossing, 50)


def time_share(context: Context) -> Values:
    """Share of each stage in the time of all stages that the engine reports [1]."""
    r = context.recording
    total = r.stage_seconds.sum()
    if not len(r.stage_names) or total == 0:
        raise NotMeasured("the engine tells no stages")
    return {str(name): float(r.stage_seconds[:, k].sum() / total) for k, name in enumerate(r.stage_names)}


def work(context: Context) -> Values:
    """Mean per displayed frame of each counter of the engine [1]."""
    r = context.recording
    if not r.work.size:
        raise NotMeasured("the engine counts nothing")
    counted = [(k, str(name)) for k, name in enumerate(r.work_names) if name not in UNRESOLVED]
    return {name: float(r.work[:, k].mean()) for k, name in counted}

"""What a run reports of itself: counters of its solver, its times, and the hash of its states."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from touchstone.adapters.contract import MOMENT_WORK, RESIDUAL_COUNTERS, Array
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values

RESIDUAL, BODY_A, BODY_B = RESIDUAL_COUNTERS
CAPS = ("gave_up", "unconverged", "lost")
"""Counters of iterations and buffers that reached their cap."""
CAP_PREFIX = "cap."
"""Prefix of the counters of single caps: a counter with this prefix is counted and shown."""
UNRESOLVED = (*RESIDUAL_COUNTERS, "dropped_time", "parted_energy")
"""Counters that hold quantities or body indices, not counts; they have metrics of their own."""


@dataclass(frozen=True, slots=True)
class Place:
    """A displayed frame, counted from 1 (0 is the initial state), and the names of a pair, if known."""

    frame: int
    pair: tuple[str, str] | None

    def __str__(self) -> str:
        return f"frame {self.frame}" + (f" ({', '.join(self.pair)})" if self.pair else "")


def solver_residual(context: Context) -> Values:
    """Largest speed by which a contact violates its law after the solve, over all frames [m/s]."""
    return _told(context, RESIDUAL, total=False)


def solver_dropped_time(context: Context) -> Values:
    """Time that was not simulated, over all frames [s]."""
    return _told(context, "dropped_time")


def solver_parted_energy(context: Context) -> Values:
    """Potential energy added by separating overlapping simulated bodies, over all frames [J]."""
    return _told(context, "parted_energy")


def solver_caps(context: Context) -> Values:
    """Caps reached: iterations that gave up or did not converge, contacts without a buffer [1]."""
    names = cap_counters(context)
    (found,) = _told(context, *names).values()
    if not isinstance(found, Value):
        return {"": found}
    counts = {name: float(_per_frame(context, name).sum()) for name in names}
    text = ", ".join(f"{name} {count:g}" for name, count in counts.items() if count)
    return {"": Value(found.value, f"{text}; {found.reason}")}


def cap_counters(context: Context) -> tuple[str, ...]:
    """The counters of caps that a recording has, CAPS first."""
    names = context.recording.work_names.tolist()
    return (*CAPS, *(name for name in names if name.startswith(CAP_PREFIX)))


def worst_place(context: Context, *counters: str) -> Place:
    """The frame in which the counters' sum is largest, with a pair: the one with the largest residual, or the
    deepest contact of the frame."""
    step = int(np.argmax(np.abs(_per_frame(context, *counters))))
    pair = tuple(int(_per_frame(context, name)[step]) for name in (BODY_A, BODY_B))
    rows = context.recording.contacts
    if min(pair) < 0 or counters == ("parted_energy",):
        here = rows[context.contact_frame == step]
        if not len(here):
            return Place(step + 1, None)
        deepest = here[np.argmin(here["distance"])]
        pair = int(deepest["body_a"]), int(deepest["body_b"])
    bodies = context.scenario.bodies
    return Place(step + 1, (bodies[pair[0]].name, bodies[pair[1]].name))


def _told(context: Context, *counters: str, total: bool = True) -> Values:
    """The sum of counters over all frames, or the largest of a frame; with the worst place if not zero."""
    frames = _per_frame(context, *counters)
    value = float(frames.sum() if total else frames.max(initial=0.0))
    return {"": Value(value, f"most in {worst_place(context, *counters)}") if value else value}


def _per_frame(context: Context, *counters: str) -> Array:
    r = context.recording
    names = r.work_names.tolist()
    if not set(counters) <= set(names):
        raise NotMeasured("the engine does not report what its solver leaves unresolved")
    return np.asarray(r.work[:, [names.index(name) for name in counters]].sum(axis=1))


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
    others = (*UNRESOLVED, MOMENT_WORK)
    counted = [(k, str(name)) for k, name in enumerate(r.work_names) if name not in others]
    return {name: float(r.work[:, k].mean()) for k, name in counted}


STATES = ("position", "orientation", "linear_velocity", "angular_velocity", "joint_angle", "joint_rate")
"""Fields of a recording that hold the state of the bodies and the joints, in the order in which they are
hashed."""
DIGITS = 13
"""Hexadecimal digits that a float holds exactly."""


def state_hash(recording: Recording) -> str:
    """Hash of all states of all frames (16 hexadecimal digits): equal exactly where all bits are.

    It depends neither on times nor on what an engine counted. -0.0 and 0.0 differ.
    """
    found = hashlib.sha256()
    for name in STATES:
        found.update(np.ascontiguousarray(getattr(recording, name), dtype="<f8").tobytes())
    return found.hexdigest()[:16]


def state_hashed(context: Context) -> Values:
    """Hash of all states of all frames, as a number; its digits are the remark [1]."""
    digits = state_hash(context.recording)
    return {"": Value(float(int(digits[:DIGITS], 16)), digits)}

"""Metrics of the quantities that a solver reports as unresolved, 0 if none. Only the reference reports
them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from touchstone.adapters.contract import RESIDUAL_COUNTERS, Array
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

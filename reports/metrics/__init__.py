"""The METRICS table: name, unit, which direction is better, formula. Rows of reports keep this order."""

from __future__ import annotations

from reports.metrics import contact, energy, events, friction, overlap, timing
from reports.metrics.evidence import Metric

_MM, _US = ("mm", 1e3), ("us", 1e6)

_ALL = (
    Metric("events.touch", "s", "none", events.event_time("touch")),
    Metric("events.roll", "s", "none", events.event_time("roll")),
    Metric("events.leave", "s", "none", events.event_time("leave")),
    Metric("events.land", "s", "none", events.event_time("land")),
    Metric("events.land.place", "m", "none", events.event_place("land")),
    Metric("overlap.max", "m", "lower", overlap.overlap_max, _MM),
    Metric("overlap.p95", "m", "lower", overlap.overlap_p95, _MM),
    Metric("overlap.time", "m s", "lower", overlap.overlap_time, ("mm s", 1e3)),
    Metric("overlap.tunnelled", "1", "lower", overlap.overlap_tunnelled),
    Metric("contact.gap", "m", "lower", overlap.contact_gap, _MM),
    Metric("contact.impulse_balance", "1", "lower", contact.impulse_balance),
    Metric("restitution.achieved", "1", "none", contact.restitution_achieved),
    Metric("restitution.error", "1", "lower", contact.restitution_error),
    Metric("friction.cone", "1", "lower", friction.friction_cone),
    Metric("friction.deficit", "1", "lower", friction.friction_deficit),
    Metric("friction.direction", "rad", "lower", friction.friction_direction),
    Metric("energy.injected", "J", "lower", energy.energy_injected, ("mJ", 1e3)),
    Metric("time.frame.median", "s", "lower", timing.time_frame("median"), _US),
    Metric("time.frame.p95", "s", "lower", timing.time_frame("p95"), _US),
    Metric("time.frame.p99", "s", "lower", timing.time_frame("p99"), _US),
    Metric("time.frame.max", "s", "lower", timing.time_frame("max"), _US),
    Metric("time.drive", "s", "lower", timing.time_drive, _US),
    Metric("time.read", "s", "lower", timing.time_read, _US),
    Metric("time.crossing", "s", "lower", timing.time_crossing, _US),
    Metric("time.share", "1", "none", timing.time_share),
    Metric("work", "1", "none", timing.work),
)

METRICS: dict[str, Metric] = {metric.name: metric for metric in _ALL}
IMPULSE_METRICS = ("friction.cone", "friction.deficit", "friction.direction", "energy.injected")
"""Metrics that trust the engine's impulses: rejected where `contact.impulse_balance` fails its audit."""

"""The METRICS table: name, unit, better direction, formula. Rows of reports have this order."""

from __future__ import annotations

from touchstone.reports.metrics import posture, solver
from touchstone.reports.metrics.contacts import contact, forces, overlap, rest
from touchstone.reports.metrics.context import Metric
from touchstone.reports.metrics.motion import energy, events, truth

_MM, _MS, _US = ("mm", 1e3), ("ms", 1e3), ("us", 1e6)

_ALL = (
    Metric("truth.position", "1", "lower", truth.truth_position),
    Metric("truth.velocity", "1", "lower", truth.truth_velocity),
    Metric("truth.orientation", "rad", "lower", truth.truth_orientation),
    Metric("truth.spin", "1", "lower", truth.truth_spin),
    Metric("published.error", "1", "lower", truth.published_error),
    Metric("bounce.height", "1", "lower", truth.bounce_height),
    Metric("rotation.flip", "s", "lower", truth.rotation_flip, _MS),
    Metric("rolling.time", "1", "lower", forces.rolling_time),
    Metric("events.touch", "s", "none", events.event_time("touch")),
    Metric("events.roll", "s", "none", events.event_time("roll")),
    Metric("events.leave", "s", "none", events.event_time("leave")),
    Metric("events.land", "s", "none", events.event_time("land")),
    Metric("events.meet", "s", "none", events.event_time("meet")),
    Metric("events.part", "s", "none", events.event_time("part")),
    Metric("events.land.place", "m", "none", events.event_place("land")),
    Metric("rest.speed", "m/s", "lower", rest.rest_speed),
    Metric("rest.lost", "1", "lower", rest.rest_lost),
    Metric("rest.settled", "m", "lower", rest.rest_settled, _MM),
    Metric("rest.drift", "m", "lower", rest.rest_drift, _MM),
    Metric("symmetry.mirror", "m/s", "lower", truth.symmetry_mirror),
    Metric("symmetry.offset", "m", "lower", truth.symmetry_offset, _MM),
    Metric("overlap.max", "m", "lower", overlap.overlap_max, _MM),
    Metric("overlap.p95", "m", "lower", overlap.overlap_p95, _MM),
    Metric("overlap.time", "m s", "lower", overlap.overlap_time, ("mm s", 1e3)),
    Metric("overlap.tunnelled", "1", "lower", overlap.overlap_tunnelled),
    Metric("contact.gap", "m", "lower", overlap.contact_gap, _MM),
    Metric("contact.impulse_balance", "1", "lower", contact.impulse_balance),
    Metric("contact.impulse_balance.driven", "1", "lower", contact.impulse_balance_driven),
    Metric("contact.complementarity", "1", "lower", contact.complementarity),
    Metric("contact.at_distance", "m", "lower", contact.at_distance, _MM),
    Metric("force.error", "1", "lower", forces.force_error),
    Metric("force.contact.mean", "N", "none", forces.force_mean),
    Metric("force.contact.peak", "N", "none", forces.force_peak),
    Metric("force.contact.impulse", "N s", "none", forces.force_impulse),
    Metric("restitution.achieved", "1", "none", contact.restitution_achieved),
    Metric("restitution.error", "1", "lower", contact.restitution_error),
    Metric("friction.cone", "1", "lower", forces.friction_cone),
    Metric("friction.cone.point", "1", "lower", forces.friction_cone_point),
    Metric("friction.deficit", "1", "lower", forces.friction_deficit),
    Metric("friction.direction", "rad", "lower", forces.friction_direction),
    Metric("friction.stop", "1", "lower", forces.friction_stop),
    Metric("friction.coast", "1", "lower", forces.friction_coast),
    Metric("friction.lift", "m", "lower", forces.friction_lift, _MM),
    Metric("friction.tilt", "rad", "lower", forces.friction_tilt),
    Metric("friction.creep", "m/s", "lower", forces.friction_creep, ("mm/s", 1e3)),
    Metric("friction.heading", "1", "lower", forces.friction_heading),
    Metric("momentum.linear", "1", "lower", energy.momentum_linear),
    Metric("momentum.angular", "1", "lower", energy.momentum_angular),
    Metric("momentum.withheld", "1", "lower", energy.momentum_withheld),
    Metric("impact.law", "1", "none", truth.impact_law),
    Metric("energy.gain", "1", "lower", energy.energy_gain),
    Metric("energy.loss", "1", "lower", energy.energy_loss),
    Metric("energy.injected", "J", "lower", energy.energy_injected, ("mJ", 1e3)),
    Metric("energy.drive", "J", "none", energy.energy_drive, ("mJ", 1e3)),
    Metric("energy.ledger", "J", "none", energy.energy_ledger, ("mJ", 1e3)),
    Metric("solver.residual", "m/s", "lower", solver.solver_residual),
    Metric("solver.dropped_time", "s", "lower", solver.solver_dropped_time, _MS),
    Metric("solver.parted_energy", "J", "lower", solver.solver_parted_energy, ("mJ", 1e3)),
    Metric("solver.caps", "1", "lower", solver.solver_caps),
    Metric("joint.limit", "rad", "lower", posture.joint_limit),
    Metric("joint.cone", "rad", "lower", posture.joint_cone),
    Metric("joint.speed", "rad/s", "lower", posture.joint_speed),
    Metric("posture.deviation", "rad", "lower", posture.posture_deviation),
    Metric("posture.over_best", "1", "lower", posture.posture_over_best),
    Metric("time.frame.median", "s", "lower", solver.time_frame("median"), _US),
    Metric("time.frame.p95", "s", "lower", solver.time_frame("p95"), _US),
    Metric("time.frame.p99", "s", "lower", solver.time_frame("p99"), _US),
    Metric("time.frame.max", "s", "lower", solver.time_frame("max"), _US),
    Metric("time.drive", "s", "lower", solver.time_drive, _US),
    Metric("time.read", "s", "lower", solver.time_read, _US),
    Metric("time.crossing", "s", "lower", solver.time_crossing, _US),
    Metric("time.share", "1", "none", solver.time_share),
    Metric("work", "1", "none", solver.work),
    Metric("state.hash", "1", "none", solver.state_hashed),
)

PAIR_METRICS = (
    *("contact.gap", "restitution.achieved", "restitution.error"),
    *("force.contact.mean", "force.contact.peak", "force.contact.impulse"),
    *("friction.deficit", "friction.direction"),
)
"""Metrics of single pairs. They mean nothing in a heap, where other contacts act at the same time."""

SOLVER_METRICS = ("solver.residual", "solver.dropped_time", "solver.parted_energy", "solver.caps")
"""Metrics of what a solver leaves unresolved. A run that breaks one of their limits prints a warning."""

SPREAD, HORIZON = "position.spread", "position.horizon"
"""Metrics of all engines: largest distance between two columns [m], and until when they are compared [s]."""
METRICS: dict[str, Metric] = {metric.name: metric for metric in _ALL}
IMPULSE_METRICS = (
    *("contact.complementarity", "contact.at_distance", "force.error", "energy.drive"),
    *("force.contact.mean", "force.contact.peak", "force.contact.impulse"),
    *("friction.cone", "friction.cone.point", "friction.deficit", "friction.direction", "energy.injected"),
)
"""Metrics that use the engine's impulses; rejected where `contact.impulse_balance` fails its audit."""
DRIVEN_METRICS = tuple(name for name in IMPULSE_METRICS if name != "contact.at_distance")
"""Metrics that also use impulses on driven bodies."""

"""The METRICS table: name, unit, better direction, formula. Rows of reports have this order."""

from __future__ import annotations

from touchstone.reports.metrics import posture, solver
from touchstone.reports.metrics.contacts import contact, forces, overlap
from touchstone.reports.metrics.context import Metric
from touchstone.reports.metrics.motion import energy, events, joints, truth

_MM, _MS, _US = ("mm", 1e3), ("ms", 1e3), ("us", 1e6)

_ALL = (
    Metric("truth.position", "error of position", "1", "lower", truth.truth_position),
    Metric("truth.velocity", "error of velocity", "1", "lower", truth.truth_velocity),
    Metric("truth.orientation", "error of orientation", "rad", "lower", truth.truth_orientation),
    Metric("truth.spin", "error of angular velocity", "1", "lower", truth.truth_spin),
    Metric("published.error", "error against a published value", "1", "lower", truth.published_error),
    Metric("bounce.height", "error of bounce height", "1", "lower", truth.bounce_height),
    Metric("rotation.flip", "error of flip time", "s", "lower", truth.rotation_flip, _MS),
    Metric("rolling.time", "error of the time until rolling", "1", "lower", forces.rolling_time),
    Metric("events.touch", "time of touch", "s", "none", events.event_time("touch")),
    Metric("events.roll", "time of rolling", "s", "none", events.event_time("roll")),
    Metric("events.leave", "time of leaving", "s", "none", events.event_time("leave")),
    Metric("events.land", "time of landing", "s", "none", events.event_time("land")),
    Metric("events.meet", "time of meeting", "s", "none", events.event_time("meet")),
    Metric("events.part", "time of parting", "s", "none", events.event_time("part")),
    Metric("events.land.place", "distance of landing", "m", "none", events.event_place("land")),
    Metric("rest.speed", "speed at rest", "m/s", "lower", overlap.rest_speed),
    Metric("rest.lost", "bodies lost", "1", "lower", overlap.rest_lost),
    Metric("rest.settled", "settling at rest", "m", "lower", overlap.rest_settled, _MM),
    Metric("rest.drift", "drift at rest", "m", "lower", overlap.rest_drift, _MM),
    Metric("symmetry.mirror", "asymmetry of velocity", "m/s", "lower", truth.symmetry_mirror),
    Metric("symmetry.offset", "asymmetry of position", "m", "lower", truth.symmetry_offset, _MM),
    Metric("overlap.max", "deepest overlap", "m", "lower", overlap.overlap_max, _MM),
    Metric("overlap.p95", "overlap, 95th percentile", "m", "lower", overlap.overlap_p95, _MM),
    Metric("overlap.time", "overlap over time", "m s", "lower", overlap.overlap_time, ("mm s", 1e3)),
    Metric("overlap.tunnelled", "passages through a body", "1", "lower", overlap.overlap_tunnelled),
    Metric("contact.gap", "gap at rest", "m", "lower", overlap.contact_gap, _MM),
    Metric("contact.impulse_balance", "imbalance of impulses", "1", "lower", contact.impulse_balance),
    Metric(
        "contact.impulse_balance.driven",
        "imbalance of impulses, driven bodies",
        "1",
        "lower",
        contact.impulse_balance_driven,
    ),
    Metric("contact.complementarity", "error of complementarity", "1", "lower", contact.complementarity),
    Metric("contact.at_distance", "distance of contacts", "m", "lower", contact.at_distance, _MM),
    Metric("force.error", "error of contact force", "1", "lower", forces.force_error),
    Metric("force.contact.mean", "contact force, mean", "N", "none", forces.force_mean),
    Metric("force.contact.peak", "contact force, peak", "N", "none", forces.force_peak),
    Metric("force.contact.impulse", "contact force, impulse", "N s", "none", forces.force_impulse),
    Metric("restitution.achieved", "restitution", "1", "none", contact.restitution_achieved),
    Metric("restitution.error", "error of restitution", "1", "lower", contact.restitution_error),
    Metric("friction.cone", "excess over the friction cone", "1", "lower", forces.friction_cone),
    Metric(
        "friction.cone.point",
        "excess over the friction cone, per point",
        "1",
        "lower",
        forces.friction_cone_point,
    ),
    Metric("friction.deficit", "missing share of friction", "1", "lower", forces.friction_deficit),
    Metric("friction.direction", "error of friction direction", "rad", "lower", forces.friction_direction),
    Metric("friction.stop", "error of stopping distance", "1", "lower", forces.friction_stop),
    Metric("friction.coast", "error of sliding distance", "1", "lower", forces.friction_coast),
    Metric("friction.lift", "rise while sliding", "m", "lower", forces.friction_lift, _MM),
    Metric("friction.tilt", "tilt while sliding", "rad", "lower", forces.friction_tilt),
    Metric("friction.creep", "creep while sticking", "m/s", "lower", forces.friction_creep, ("mm/s", 1e3)),
    Metric("friction.heading", "dependence on heading", "1", "lower", forces.friction_heading),
    Metric("momentum.linear", "change of linear momentum", "1", "lower", energy.momentum_linear),
    Metric("momentum.angular", "change of angular momentum", "1", "lower", energy.momentum_angular),
    Metric("momentum.withheld", "withheld momentum", "1", "lower", energy.momentum_withheld),
    Metric("impact.law", "distance from a law of impact", "1", "none", truth.impact_law),
    Metric("energy.gain", "gain of energy", "1", "lower", energy.energy_gain),
    Metric("energy.loss", "loss of energy", "1", "lower", energy.energy_loss),
    Metric("energy.injected", "injected energy", "J", "lower", energy.energy_injected, ("mJ", 1e3)),
    Metric("energy.drive", "work of drivers", "J", "none", energy.energy_drive, ("mJ", 1e3)),
    Metric("energy.ledger", "energy per mechanism", "J", "none", energy.energy_ledger, ("mJ", 1e3)),
    Metric("solver.residual", "residual of the solver", "m/s", "lower", solver.solver_residual),
    Metric("solver.dropped_time", "time not simulated", "s", "lower", solver.solver_dropped_time, _MS),
    Metric(
        "solver.parted_energy", "energy of separation", "J", "lower", solver.solver_parted_energy, ("mJ", 1e3)
    ),
    Metric("solver.caps", "caps reached", "1", "lower", solver.solver_caps),
    Metric("joint.limit", "excess over a hinge limit", "rad", "lower", posture.joint_limit),
    Metric("joint.stop", "excess over a slider's limit", "m", "lower", joints.joint_stop, _MM),
    Metric("joint.drift", "distance of a joint's anchors", "m", "lower", joints.joint_drift, _MM),
    Metric("joint.turn", "turn of a joint across its axis", "rad", "lower", joints.joint_turn),
    Metric("joint.force", "error of a joint's force", "1", "lower", joints.joint_force),
    Metric("joint.cone", "excess over a reach cone", "rad", "lower", posture.joint_cone),
    Metric("joint.speed", "hinge speed", "rad/s", "lower", posture.joint_speed),
    Metric("posture.deviation", "deviation of posture", "rad", "lower", posture.posture_deviation),
    Metric("posture.over_best", "posture against the best", "1", "lower", posture.posture_over_best),
    Metric("time.frame.median", "median frame time", "s", "lower", solver.time_frame("median"), _US),
    Metric("time.frame.p95", "frame time, 95th percentile", "s", "lower", solver.time_frame("p95"), _US),
    Metric("time.frame.p99", "frame time, 99th percentile", "s", "lower", solver.time_frame("p99"), _US),
    Metric("time.frame.max", "longest frame time", "s", "lower", solver.time_frame("max"), _US),
    Metric("time.drive", "time of commands", "s", "lower", solver.time_drive, _US),
    Metric("time.read", "time of reading the state", "s", "lower", solver.time_read, _US),
    Metric("time.crossing", "time of an empty call", "s", "lower", solver.time_crossing, _US),
    Metric("time.share", "share of a stage", "1", "none", solver.time_share),
    Metric("work", "work per frame", "1", "none", solver.work),
    Metric("state.hash", "hash of all states", "1", "none", solver.state_hashed),
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
PARITY = "backend.parity"
"""Metric of a second backend of an engine: how long all bodies are within 1 mm of the first one's [s]."""
METRICS: dict[str, Metric] = {metric.name: metric for metric in _ALL}
IMPULSE_METRICS = (
    *("contact.complementarity", "contact.at_distance", "force.error", "energy.drive"),
    *("force.contact.mean", "force.contact.peak", "force.contact.impulse"),
    *("friction.cone", "friction.cone.point", "friction.deficit", "friction.direction", "energy.injected"),
)
"""Metrics that use the engine's impulses; rejected where `contact.impulse_balance` fails its audit."""
DRIVEN_METRICS = tuple(name for name in IMPULSE_METRICS if name != "contact.at_distance")
"""Metrics that also use impulses on driven bodies."""


def in_tables(metric: str) -> tuple[str, float]:
    """Unit of a metric in tables, and how many of it make one of the metric's."""
    known = METRICS.get(metric)
    return (known.shown or (known.unit, 1.0)) if known else ("1", 1.0)


OTHER_LABELS = {
    "run": "run",
    "ratio.time": "mean frame time with contact, over that of",
    "ratio.time.all": "mean frame time, over that of",
    "ratio.time.median": "median frame time, over that of",
    "ratio.time.p99": "99th percentile of frame times, over that of",
    "ratio.frames": "frames with contact",
    "stability.outcome": "outcome",
}
"""Names for readers of what is no metric of a recording."""


def label(metric: str) -> str:
    """Name of a metric for readers; that of the table where it has none, such as the metric of a study."""
    return METRICS[metric].label if metric in METRICS else OTHER_LABELS.get(metric, metric)

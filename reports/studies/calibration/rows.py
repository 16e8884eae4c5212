"""Rows of the study `calibration`: achieved and requested values, per engine, profile and step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from math import isnan, nan

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.results import Row
from touchstone.reports.runner.tasks import own_step
from touchstone.reports.studies.calibration.probes import (
    BOUNCES,
    DROP,
    G,
    Probe,
    ProbeMotion,
    ProbeTask,
    friction_of,
    lowest_speed,
    pull_of,
    rebound_of,
    restitution_of,
    slow_friction_of,
)

STUDY = "calibration"
ALL = "all"
"""Scenario name of the aggregate over all pairs."""
JUDGED_SPEED = 1.0
"""Least approach speed of the aggregated bias of restitution [m/s]; below it, engines fade it out."""
LARGEST = {
    "restitution.bias": "restitution.bias.max",
    "friction.bias": "friction.bias.max",
    "friction.slow": "friction.slow.max",
}
"""Metric -> the name of its aggregate."""
SLOW = "restitution.slow.max"
"""Aggregate of the bias of restitution below JUDGED_SPEED."""
HOP_STEPS = 2
"""Least duration of a hop, to distinguish it from rest [steps]."""


def subject_of(kind: str, requested: float, value: float) -> str:
    """Subject of a row: the requested value, and the speed [m/s] or heading [degrees]."""
    if kind == "restitution":
        return f"e={requested:g} v={value:.3g}"
    if kind == "slow":
        return f"mu={requested:g} v={value:.3g}"
    return f"mu={requested:g} heading={value:g}"


def rows_of_engine(found: Sequence[tuple[ProbeTask, ProbeMotion | Ended]]) -> list[Row]:
    """The achieved values of an engine, the largest biases, gaps at rest, and failures."""
    rows: list[Row] = []
    ended = [(task, one) for task, one in found if isinstance(one, Ended)]
    motions = [(task, one) for task, one in found if isinstance(one, ProbeMotion)]
    resting = {
        _base(task): float(np.median(motion.gap[-1]))
        for task, motion in motions
        if (task.probe.kind, task.probe.requested) == ("restitution", 0.0)
    }
    ladders: dict[Row, list[tuple[float, float]]] = {}
    for task, motion in motions:
        base, probe = _base(task), task.probe
        # never below 0: a body that rests deeper touched before
        achieved = partial(_restitutions, probe, motion, base.dt, max(0.0, resting.get(base, 0.0)))
        match probe.kind:
            case "restitution":
                rows += _restitution(base, probe, achieved())
            case "lowest":
                ladders.setdefault(base, []).extend(zip(probe.speeds, achieved()[:, 0].tolist()))
            case "friction":
                rows += _friction(base, probe, motion)
            case "slow":
                rows.append(_slow(base, probe, motion))
            case "drop":
                rows.append(_drop(base, motion))
    rows += _largest(rows)
    rows += [replace(base, metric="gap.rest", unit="m", value=level) for base, level in resting.items()]
    rows += [_lowest(base, rungs) for base, rungs in ladders.items()]
    if len({one for _, one in ended}) == 1 and not motions:  # the engine itself fails
        profiles = dict.fromkeys(task.settings.profile for task, _ in ended)
        ((first, one), *_) = ended
        base = replace(_base(first), scenario=ALL, metric="run", verdict=one.status, reason=one.reason)
        return [replace(base, profile=name, dt=own_step(base.engine, name)) for name in profiles]
    for task, one in ended:
        row = replace(_base(task), metric="run", subject=f"{task.probe.kind} {task.probe.requested:g}")
        rows.append(replace(row, verdict=one.status, reason=one.reason))
    return rows


def _base(task: ProbeTask) -> Row:
    return Row(STUDY, task.probe.pair, task.engine, task.settings.profile, task.settings.dt, "")


def _restitutions(probe: Probe, motion: ProbeMotion, dt: float, level: float) -> Array:
    """Achieved restitution per speed and phase; NaN where a hop is too short to measure."""
    bodies = zip(motion.gap.T, motion.velocity[..., 2].T)
    achieved = np.array([restitution_of(gap, rate, G, dt, level) for gap, rate in bodies])
    achieved = achieved.reshape(len(probe.speeds), len(probe.phases))
    hop = 2 * probe.requested * np.array(probe.speeds) / G
    achieved[(hop > 0) & (hop < HOP_STEPS * dt)] = nan
    return achieved


def _restitution(base: Row, probe: Probe, achieved: Array) -> list[Row]:
    """Achieved restitution and bias per speed: the median over the phases with its range."""
    rows = []
    for speed, values in zip(probe.speeds, achieved):
        subject = subject_of("restitution", probe.requested, speed)
        row = replace(base, metric="restitution.achieved", subject=subject, unit="1")
        if np.isnan(values).any():
            reason = f"asked {probe.requested:g}; a hop of less than {HOP_STEPS} steps"
            rows.append(replace(row, verdict="skipped", reason=reason))
            continue
        middle, low, high = float(np.median(values)), float(values.min()), float(values.max())
        rows.append(replace(row, value=middle, low=low, high=high, reason=f"asked {probe.requested:g}"))
        asked = probe.requested
        bias = replace(row, metric="restitution.bias", value=middle - asked)
        rows.append(replace(bias, low=low - asked, high=high - asked))
    return rows


def _lowest(base: Row, rungs: Sequence[tuple[float, float]]) -> Row:
    """The lowest speed that bounces, from all rungs of the ladder."""
    speeds, returned = np.array(sorted(rungs)).T
    lowest = lowest_speed(speeds, returned)
    row = replace(base, metric="restitution.lowest", subject="e=1", unit="m/s", value=lowest)
    if isnan(lowest):
        reason = f"not even {speeds[-1]:.2f} m/s returns {BOUNCES:g} of e = 1"
        return replace(row, verdict="skipped", reason=reason)
    return replace(row, reason=f"from here on at least {BOUNCES:g} of e = 1 is returned")


def _drop(base: Row, motion: ProbeMotion) -> Row:
    """Restitution after a fall from DROP for e = 1, and its range over the phases of a step."""
    values = [rebound_of(gap) for gap in motion.gap.T]
    row = replace(base, metric="restitution.drop", subject=f"e=1 h={DROP:g}", unit="1", reason="asked 1")
    return replace(row, value=values[0], low=min(values), high=max(values))


def _friction(base: Row, probe: Probe, motion: ProbeMotion) -> list[Row]:
    rows = []
    for k, heading in enumerate(probe.headings):
        mu = friction_of(motion.velocity[:, k, :2], motion.surface[:, k, :2], G, base.dt)
        subject = subject_of("friction", probe.requested, heading)
        row = replace(base, metric="friction.achieved", subject=subject, unit="1", value=mu)
        if isnan(mu):
            reason = f"asked {probe.requested:g}; slides on"
            rows.append(replace(row, verdict="skipped", reason=reason))
            continue
        rows.append(replace(row, reason=f"asked {probe.requested:g}"))
        rows.append(replace(row, metric="friction.bias", value=mu / probe.requested - 1))
    return rows


def _slow(base: Row, probe: Probe, motion: ProbeMotion) -> Row:
    """Friction over the one asked for while a body slides slowly."""
    mu = slow_friction_of(motion.surface[:, 0, 0], pull_of(probe), G, base.dt)
    subject = subject_of("slow", probe.requested, probe.speeds[0])
    row = replace(base, metric="friction.slow", subject=subject, unit="1", value=mu / probe.requested)
    if isnan(mu):
        return replace(row, verdict="skipped", reason=f"asked {probe.requested:g}; it stops within two steps")
    return replace(row, reason=f"asked {probe.requested:g}")


def _largest(found: Sequence[Row]) -> list[Row]:
    """Largest biases per profile and pair, and over all pairs; those of restitution from JUDGED_SPEED on, and
    below it."""
    sizes: dict[tuple[str, str, float, str], list[float]] = {}
    for row in found:
        if row.metric not in LARGEST or isnan(row.value):
            continue
        name, value = LARGEST[row.metric], row.value - (row.metric == "friction.slow")
        if row.metric == "restitution.bias" and float(row.subject.partition("v=")[2]) < JUDGED_SPEED:
            name = SLOW
        for pair in (row.scenario, ALL):
            sizes.setdefault((name, row.profile, row.dt, pair), []).append(abs(value))
    return [
        Row(STUDY, pair, found[0].engine, profile, dt, name, max(values), "1")
        for (name, profile, dt, pair), values in sizes.items()
    ]

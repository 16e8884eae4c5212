"""Rows of the study `calibration`: achieved and requested values, per engine, profile and step."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isnan, nan

import numpy as np

from touchstone.adapters.contract import Array, Settings
from touchstone.adapters.registry import ENGINES
from touchstone.reports.results import Row
from touchstone.reports.studies.calibration.children import Motion
from touchstone.reports.studies.calibration.estimates import (
    BOUNCES,
    friction_of,
    lowest_speed,
    rebound_of,
    restitution_of,
)
from touchstone.reports.studies.calibration.scenes import DROP, G, Probe

STUDY = "calibration"
ALL = "all"
"""Scenario name of the aggregate over all pairs."""
JUDGED_SPEED = 1.0
"""Least approach speed of the aggregated bias of restitution [m/s]; below it, engines fade it out."""
LARGEST = {name: f"{name}.max" for name in ("restitution.bias", "friction.bias")}
"""Metric -> the name of its aggregate."""
HOP_STEPS = 2
"""Least duration of a hop, to distinguish it from rest [steps]."""


@dataclass(slots=True)
class Measured:
    """Results of an engine: motions per settings and probe; verdict and reason of probes that failed.
    `ended`: verdict and reason of an engine that stopped."""

    profiles: Sequence[str]
    version: str = ""
    motions: dict[tuple[Settings, Probe], Motion] = field(default_factory=dict)
    failures: dict[tuple[Settings, Probe], tuple[str, str]] = field(default_factory=dict)
    ended: tuple[str, str] | None = None


def subject_of(kind: str, requested: float, value: float) -> str:
    """Subject of a row: the requested value, and the speed [m/s] or heading [degrees]."""
    if kind == "restitution":
        return f"e={requested:g} v={value:.3g}"
    return f"mu={requested:g} heading={value:g}"


def rows_of_study(measured: Mapping[str, Measured]) -> list[Row]:
    """Per engine the achieved values, the largest biases, gaps at rest, and failures."""
    rows: list[Row] = []
    for name, mine in measured.items():
        found: list[Row] = []
        for (settings, probe), motion in mine.motions.items():
            base = Row(STUDY, probe.pair, name, settings.profile, settings.dt, "")
            if probe.kind == "restitution":
                level = _level(mine, settings, probe.pair)
                found += _restitution(base, probe, _restitutions(probe, motion, settings.dt, level))
            elif probe.kind == "friction":
                found += _friction(base, probe, motion)
            elif probe.kind == "drop":
                found.append(_drop(base, motion))
        rows += found + _largest(found) + _levels(name, mine) + _lowest(name, mine) + _failed(name, mine)
    return rows


def _failed(name: str, mine: Measured) -> list[Row]:
    """Rows of failed probes, or of an engine that stopped."""
    rows = []
    for (settings, probe), (verdict, reason) in mine.failures.items():
        row = Row(STUDY, probe.pair, name, settings.profile, settings.dt, "run")
        subject = f"{probe.kind} {probe.requested:g}"
        rows.append(replace(row, subject=subject, verdict=verdict, reason=reason))
    if mine.ended is not None:
        for profile in mine.profiles:
            row = Row(STUDY, ALL, name, profile, ENGINES[name].profiles[profile], "run")
            rows.append(replace(row, verdict=mine.ended[0], reason=mine.ended[1]))
    return rows


def _restitutions(probe: Probe, motion: Motion, dt: float, level: float) -> Array:
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


def _lowest(name: str, mine: Measured) -> list[Row]:
    """Per profile the lowest speed that bounces, from all rungs of the ladder."""
    ladders: dict[Settings, list[tuple[float, float]]] = {}
    for (settings, probe), motion in mine.motions.items():
        if probe.kind == "lowest":
            achieved = _restitutions(probe, motion, settings.dt, _level(mine, settings, probe.pair))
            ladders.setdefault(settings, []).extend(zip(probe.speeds, achieved[:, 0].tolist()))
    rows = []
    for settings, rungs in ladders.items():
        speeds, returned = np.array(sorted(rungs)).T
        row = Row(STUDY, "sphere-box", name, settings.profile, settings.dt, "restitution.lowest")
        row = replace(row, subject="e=1", unit="m/s", value=lowest_speed(speeds, returned))
        if isnan(row.value):
            reason = f"not even {speeds[-1]:.2f} m/s returns {BOUNCES:g} of e = 1"
            rows.append(replace(row, verdict="skipped", reason=reason))
        else:
            rows.append(replace(row, reason=f"from here on at least {BOUNCES:g} of e = 1 is returned"))
    return rows


def _drop(base: Row, motion: Motion) -> Row:
    """Restitution after a fall from DROP for e = 1, and its range over the phases of a step."""
    values = [rebound_of(gap) for gap in motion.gap.T]
    row = replace(base, metric="restitution.drop", subject=f"e=1 h={DROP:g}", unit="1", reason="asked 1")
    return replace(row, value=values[0], low=min(values), high=max(values))


def _friction(base: Row, probe: Probe, motion: Motion) -> list[Row]:
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


def _level(mine: Measured, settings: Settings, pair: str) -> float:
    """Height at which bodies of a pair touch [m]: their height at rest for e = 0. Never below 0: a body that
    rests deeper touched before."""
    for (other, probe), motion in mine.motions.items():
        if (other, probe.pair, probe.kind, probe.requested) == (settings, pair, "restitution", 0.0):
            return max(0.0, float(np.median(motion.gap[-1])))
    return 0.0


def _levels(name: str, mine: Measured) -> list[Row]:
    """Gap at rest per profile and pair."""
    rows = []
    for (settings, probe), motion in mine.motions.items():
        if (probe.kind, probe.requested) == ("restitution", 0.0):
            base = Row(STUDY, probe.pair, name, settings.profile, settings.dt, "gap.rest", unit="m")
            rows.append(replace(base, value=float(np.median(motion.gap[-1]))))
    return rows


def _largest(found: Sequence[Row]) -> list[Row]:
    """Largest biases per profile and pair, and over all pairs; those of restitution from JUDGED_SPEED."""
    sizes: dict[tuple[str, str, float, str], list[float]] = {}
    for row in found:
        if row.metric not in LARGEST:
            continue
        if row.metric == "restitution.bias" and float(row.subject.partition("v=")[2]) < JUDGED_SPEED:
            continue
        for pair in (row.scenario, ALL):
            sizes.setdefault((row.metric, row.profile, row.dt, pair), []).append(abs(row.value))
    name = found[0].engine if found else ""
    return [
        Row(STUDY, pair, name, profile, dt, LARGEST[metric], max(values), "1")
        for (metric, profile, dt, pair), values in sizes.items()
    ]

"""Errors of a cell per quantity, against the closed form or the band of converged solutions, and horizons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.reports.studies.work_precision.bands import Band, Code, band_of, outside
from touchstone.reports.studies.work_precision.definitions import HORIZON_DISTANCE, QUANTITIES
from touchstone.reports.sweep.measures import FRAMES, PATH, moving
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import Scenario

FRICTION = ("friction.stop", "friction.coast", "friction.heading", "friction.cone", "rolling.time")
"""Relative errors whose largest is the error of friction."""
EVENTS = ("events.touch", "events.roll", "events.leave", "events.land", "events.meet", "events.part")
LEAST_DROP = 0.01
"""Height whose potential energy is the least scale of energy [m]: where nothing moves."""
CLOSED_FORM, BAND = "closed form", "band"


@dataclass(frozen=True, slots=True)
class CellRun:
    """What a cell left: its rows, centres of mass (f, n, 3) [m] of the moving bodies, seconds per frame."""

    rows: pd.DataFrame
    path: Array
    frames: Array

    def values(self, *metrics: str) -> dict[tuple[str, str], float]:
        """(metric, subject) -> value, without what was not measured."""
        part = self.rows[self.rows.metric.isin(metrics)]
        found = zip(part.metric, part.subject, part.value, part.verdict)
        return {(m, s): v for m, s, v, verdict in found if np.isfinite(v) or verdict == "fail"}


@dataclass(frozen=True, slots=True)
class TrueMotion:
    """The true motion of a scene, which is known to a band where it has no closed form.

    Attributes:
        low, high: least and largest coordinates of the moving bodies (f, n, 3) [m], the same in closed form;
            None where codes do not agree.
        source: per quantity CLOSED_FORM or BAND.
        width: per quantity width of the band.
        horizon: frame up to which positions and events are compared.
        energy: scale of energies [J].
        events: (metric, subject) -> earliest and latest time [s].
        band: what the codes agree on, with the outliers; None without codes.
    """

    low: Array | None
    high: Array | None
    horizon: int
    energy: float
    source: Mapping[str, str] = field(default_factory=dict)
    width: Mapping[str, float] = field(default_factory=dict)
    events: Mapping[tuple[str, str], tuple[float, float]] = field(default_factory=dict)
    band: Band | None = None


def run_of(rows: pd.DataFrame, scenario: Scenario) -> CellRun | None:
    """Rows of one cell, with its series; None if it did not end."""
    if rows.empty or (rows.outcome != "done").any():
        return None
    series = {m: np.asarray(s, dtype=float) for m, s in zip(rows.metric, rows.series) if s is not None}
    return CellRun(rows, series[PATH].reshape(-1, len(moving(scenario)), 3), series[FRAMES])


def truth_of(
    scenario: Scenario,
    codes: Mapping[str, tuple[CellRun, CellRun]],
    plain: CellRun | None,
    perturbed: Iterable[CellRun],
) -> TrueMotion | None:
    """The true motion: positions from the closed form if there is one, else the band of the codes, which
    also times the events.

    Args:
        codes: engine -> its converged solution and the check at half the step, which is the better of both.
        plain, perturbed: runs at one step, of the scene as it is and moved by a little.
    """
    closed = closed_path(scenario)
    if closed is None and not codes:
        return None
    horizon = _horizon(plain, perturbed, scenario.frame_count)
    band = None
    if codes:
        paths = {name: Code(fine.path, finer.path) for name, (fine, finer) in codes.items()}
        band = band_of(paths, horizon, QUANTITIES["position"].tolerance, closed)
    low, high = (band.low, band.high) if band and band.codes else (closed, closed)
    path = low if low is not None else next(iter(codes.values()))[1].path
    source = dict.fromkeys(("overlap", "energy", "friction"), CLOSED_FORM)
    source |= {"position": BAND if closed is None else CLOSED_FORM, "events": BAND}
    width = {"position": band.width} if band and band.codes and closed is None else {}
    events = _events([codes[name][1] for name in band.codes] if band else [], horizon / scenario.frame_rate)
    if events:
        width["events"] = max(last - first for first, last in events.values())
    return TrueMotion(low, high, horizon, _energy_scale(scenario, path), source, width, events, band)


def _events(runs: Sequence[CellRun], until: float) -> dict[tuple[str, str], tuple[float, float]]:
    """Earliest and latest time [s] of the events that all runs have until a time."""
    times = [run.values(*EVENTS) for run in runs]
    found = {}
    for key in times[0] if times else ():
        each = [one.get(key, inf) for one in times]
        if max(each) <= until:
            found[key] = min(each), max(each)
    return found


def closed_path(scenario: Scenario) -> Array | None:
    """Centres of mass of the moving bodies in closed form (f, n, 3) [m]; None unless all have one."""
    truths = {scenario.body_index(truth.body): truth for truth in scenario.truths}
    bodies = moving(scenario)
    if not truths or not set(bodies) <= truths.keys():
        return None
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    return np.stack([motion(scenario, truths[k], times).position for k in bodies], axis=1)


def _horizon(plain: CellRun | None, perturbed: Iterable[CellRun], last: int) -> int:
    """Last frame before a perturbed run is farther than HORIZON_DISTANCE from the unperturbed one."""
    found = last
    for other in perturbed:
        if plain is None:
            break
        apart = np.linalg.norm(plain.path - other.path, axis=-1).max(axis=1)
        beyond = np.flatnonzero(apart > HORIZON_DISTANCE)
        found = min(found, int(beyond[0]) - 1 if len(beyond) else last)
    return max(found, 1)


def _energy_scale(scenario: Scenario, path: Array) -> float:
    """Largest kinetic energy of translation in the true motion, at least that of a fall of LEAST_DROP [J]."""
    mass = np.array([scenario.bodies[k].mass for k in moving(scenario)])
    speed = np.diff(path, axis=0) * scenario.frame_rate
    kinetic = ((speed**2).sum(axis=-1) @ mass).max(initial=0.0) / 2
    return float(max(kinetic, mass.sum() * 9.81 * LEAST_DROP))


def errors_of(run: CellRun, truth: TrueMotion) -> dict[str, float]:
    """Error of a run per quantity; a quantity that does not apply is missing.

    A body that passed through another has an infinite error of overlap, an event that did not happen one of
    events. Positions and events have none where codes do not agree.
    """
    found = {}
    if truth.low is not None and truth.high is not None:
        found["position"] = outside(run.path, truth.low, truth.high, truth.horizon)
    tunnelled = run.values("overlap.tunnelled")
    overlap = run.values("overlap.max")
    if overlap:
        found["overlap"] = inf if any(tunnelled.values()) else max(0.0, *overlap.values())
    energy = _energy(run, truth.energy)
    if energy is not None:
        found["energy"] = energy
    friction = [abs(value) for value in run.values(*FRICTION).values() if np.isfinite(value)]
    if friction:
        found["friction"] = max(friction)
    if truth.events:
        times = run.values(*EVENTS)
        apart = [_beyond(times.get(key, inf), *ends) for key, ends in truth.events.items()]
        found["events"] = max(apart)
    return found


def _beyond(time: float, first: float, last: float) -> float:
    return max(0.0, first - time, time - last) if time == time else inf


def _energy(run: CellRun, scale: float) -> float | None:
    """Energy gained or lost without a cause, over the scale.

    Of the whole scene where nothing does work, else of the simulated bodies, else of all.
    """
    whole = run.values("energy.gain", "energy.loss")
    if whole:
        return max(abs(value) for value in whole.values())
    injected = {subject: value for (_, subject), value in run.values("energy.injected").items()}
    value = injected.get("simulated", injected.get("all"))
    return None if value is None else value / scale

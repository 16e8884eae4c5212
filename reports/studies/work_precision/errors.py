"""Errors of a cell per quantity, against the closed form or the converged solution, and horizons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from math import inf, nan

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.reports.studies.work_precision.definitions import HORIZON_DISTANCE, QUANTITIES
from touchstone.reports.sweep.measures import FRAMES, PATH, moving
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.scenario import Scenario

FRICTION = ("friction.stop", "friction.coast", "friction.heading", "friction.cone", "rolling.time")
"""Relative errors whose largest is the error of friction."""
EVENTS = ("events.touch", "events.roll", "events.leave", "events.land", "events.meet", "events.part")
LEAST_DROP = 0.01
"""Height whose potential energy is the least scale of energy [m]: where nothing moves."""
CLOSED_FORM, CONVERGED, NOT_CONVERGED = "closed form", "converged", "not converged"


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
    """The true motion of a scene.

    Attributes:
        path: centres of mass of the moving bodies (f, n, 3) [m].
        source: per quantity CLOSED_FORM, CONVERGED or NOT_CONVERGED.
        change: per quantity what halving the step of the converged solution changed.
        horizon: frame up to which positions and events are compared.
        events: (metric, subject) -> time [s].
        energy: scale of energies [J].
    """

    path: Array
    horizon: int
    energy: float
    source: Mapping[str, str] = field(default_factory=dict)
    change: Mapping[str, float] = field(default_factory=dict)
    events: Mapping[tuple[str, str], float] = field(default_factory=dict)


def run_of(rows: pd.DataFrame, scenario: Scenario) -> CellRun | None:
    """Rows of one cell, with its series; None if it did not end."""
    if rows.empty or (rows.outcome != "done").any():
        return None
    series = {m: np.asarray(s, dtype=float) for m, s in zip(rows.metric, rows.series) if s is not None}
    return CellRun(rows, series[PATH].reshape(-1, len(moving(scenario)), 3), series[FRAMES])


def truth_of(
    scenario: Scenario,
    fine: CellRun | None,
    finer: CellRun | None,
    plain: CellRun | None,
    perturbed: Iterable[CellRun],
) -> TrueMotion | None:
    """The true motion: positions from the closed form if there is one, all else from the converged solution.

    Args:
        fine, finer: the converged solution and its check at half the step, which is the better of both.
        plain, perturbed: runs at one step, of the scene as it is and moved by a little.
    """
    closed = closed_path(scenario)
    if closed is None and finer is None:
        return None
    path = closed if closed is not None else finer.path  # type: ignore[union-attr]
    horizon = _horizon(plain, perturbed, len(path) - 1)
    change: dict[str, float] = {}
    events: dict[tuple[str, str], float] = {}
    if fine is not None and finer is not None:
        change["position"] = distance(fine.path, finer.path, horizon)
        until = horizon / scenario.frame_rate
        events = {key: t for key, t in finer.values(*EVENTS).items() if t <= until}
        others = fine.values(*EVENTS)
        change["events"] = max((abs(others.get(key, inf) - t) for key, t in events.items()), default=nan)
    source = {
        name: CONVERGED if change.get(name, inf) < QUANTITIES[name].tolerance / 10 else NOT_CONVERGED
        for name in ("position", "events")
    }
    if closed is not None:
        source["position"] = CLOSED_FORM
    for name in ("overlap", "energy", "friction"):
        source[name] = CLOSED_FORM
    return TrueMotion(path, horizon, _energy_scale(scenario, path), source, change, events)


def closed_path(scenario: Scenario) -> Array | None:
    """Centres of mass of the moving bodies in closed form (f, n, 3) [m]; None unless all have one."""
    truths = {scenario.body_index(truth.body): truth for truth in scenario.truths}
    bodies = moving(scenario)
    if not truths or not set(bodies) <= truths.keys():
        return None
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    return np.stack([motion(scenario, truths[k], times).position for k in bodies], axis=1)


def distance(one: Array, other: Array, horizon: int) -> float:
    """Largest distance of two paths over bodies and frames up to the horizon [m]."""
    last = min(len(one), len(other), horizon + 1)
    return float(np.linalg.norm(one[:last] - other[:last], axis=-1).max())


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
    events.
    """
    found = {"position": distance(run.path, truth.path, truth.horizon)}
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
        apart = [abs(times.get(key, inf) - t) for key, t in truth.events.items()]
        found["events"] = max(inf if np.isnan(one) else one for one in apart)
    return found


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

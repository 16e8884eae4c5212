"""Errors of a cell per quantity, against the closed form or the band of converged solutions, and horizons."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from math import inf

import numpy as np
import pandas as pd

from touchstone.adapters.contract import Array
from touchstone.reports.runner.measures import (
    FRAMES,
    HORIZON_DISTANCE,
    PATH,
    closed_path,
    last_within,
    moving,
)
from touchstone.reports.studies.work_precision.definitions import QUANTITIES
from touchstone.scenarios.scenario import Scenario

SPREAD = 0.05
"""Share of the way of the bodies within which codes agree, and by which half the step may change one [1]:
what a first-order engine at a fitting step may be off (`verdict/limits.toml`)."""


@dataclass(frozen=True, slots=True)
class Code:
    """Paths (f, n, 3) [m] of an engine at its finest step, `finer`, and at twice that step."""

    fine: Array
    finer: Array


@dataclass(frozen=True, slots=True)
class Band:
    """Positions per frame and body between those of the codes that agree, per coordinate.

    Attributes:
        codes: those that agree; fewer than two: there is no band, and `low` and `high` are empty.
        low, high: least and largest coordinates (f, n, 3) [m].
        width: largest distance of two of them [m].
        within: distance up to which codes agree and converge [m].
        change: what half the step changes of each code [m].
        outliers: distance from the band [m] of the other converged codes; without a band, from the nearest.
    """

    codes: tuple[str, ...]
    low: Array
    high: Array
    width: float = 0.0
    within: float = 0.0
    outliers: Mapping[str, float] = field(default_factory=dict)
    change: Mapping[str, float] = field(default_factory=dict)

    @property
    def words(self) -> str:
        """One line: who agrees, to what, who is off, who has not converged."""
        off = [f"{name} is {1e3 * far:.3g} mm off" for name, far in self.outliers.items()]
        open_codes = [name for name in self.change if name not in (*self.codes, *self.outliers)]
        said = [
            f"{name} changes by {1e3 * self.change[name]:.3g} mm with half the step" for name in open_codes
        ]
        if self.codes:
            head = f"{', '.join(self.codes)} agree to {1e3 * self.width:.3g} mm"
        elif len(self.outliers) > 1:
            head = f"codes converge to different models, more than {1e3 * self.within:.3g} mm apart"
            off = [f"{name} is {1e3 * far:.3g} mm from the nearest" for name, far in self.outliers.items()]
        else:
            head = f"fewer than two codes converge to {1e3 * self.within:.3g} mm"
            off = []
        return "; ".join([head, *off, *said])


def distance(one: Array, other: Array, horizon: int) -> float:
    """Largest distance of two paths over bodies and frames up to the horizon [m]."""
    return outside(one, other, other, horizon)


def outside(path: Array, low: Array, high: Array, horizon: int) -> float:
    """Largest distance of a path from a band over bodies and frames up to the horizon [m]."""
    last = min(len(path), len(low), horizon + 1)
    beyond = path[:last] - np.clip(path[:last], low[:last], high[:last])
    return float(np.linalg.norm(beyond, axis=-1).max())


def band_of(codes: Mapping[str, Code], horizon: int, least: float, closed: Array | None = None) -> Band:
    """The band of the largest group of converged codes that agree pairwise, of equally large ones the
    narrowest. There is none where as many others agree on something else.

    Args:
        horizon: frame up to which paths are compared.
        least: distance within which codes agree in any case [m].
        closed: the closed form (f, n, 3) [m], which is the band: codes agree if they are near it.
    """
    starts = {name: np.broadcast_to(one.finer[:1], one.finer.shape) for name, one in codes.items()}
    way = float(np.median([distance(one.finer, starts[name], horizon) for name, one in codes.items()]))
    within = max(least, SPREAD * way)
    change = {name: distance(one.fine, one.finer, horizon) for name, one in codes.items()}
    paths = {name: one.finer for name, one in codes.items() if change[name] <= within}
    apart = {
        frozenset((one, other)): distance(paths[one], paths[other], horizon)
        for one, other in combinations(paths, 2)
    }
    if closed is not None:
        group = tuple(name for name in paths if distance(paths[name], closed, horizon) <= within)
        low = high = closed
    else:
        group = _agreeing(tuple(paths), apart, within)
        if not group:
            far = {name: min((apart[p] for p in apart if name in p), default=np.inf) for name in paths}
            nothing = np.zeros((0, 0, 3))
            return Band((), nothing, nothing, 0.0, within, far, change)
        low, high = (bound([paths[name] for name in group], axis=0) for bound in (np.min, np.max))
    outliers = {name: outside(paths[name], low, high, horizon) for name in paths if name not in group}
    return Band(group, low, high, _width(group, apart), within, outliers, change)


def _width(group: Sequence[str], apart: Mapping[frozenset[str], float]) -> float:
    return max((apart[frozenset(pair)] for pair in combinations(group, 2)), default=0.0)


def _agreeing(names: Sequence[str], apart: Mapping[frozenset[str], float], within: float) -> tuple[str, ...]:
    """The largest group of two or more within a distance; empty if there is none, or a rival one."""
    for size in range(len(names), 1, -1):
        found = [group for group in combinations(names, size) if _width(group, apart) <= within]
        if found:
            best = min(found, key=lambda group: _width(group, apart))
            return () if any(not set(best) & set(group) for group in found) else best
    return ()


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


def _horizon(plain: CellRun | None, perturbed: Iterable[CellRun], last: int) -> int:
    """Last frame before a perturbed run is farther than HORIZON_DISTANCE from the unperturbed one."""
    found = last
    for other in perturbed:
        if plain is None:
            break
        apart = np.linalg.norm(plain.path - other.path, axis=-1).max(axis=1)
        found = min(found, last_within(apart, HORIZON_DISTANCE))
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
        each = ((times.get(key, inf), *ends) for key, ends in truth.events.items())
        found["events"] = max(
            max(0.0, first - time, time - last) if time == time else inf for time, first, last in each
        )
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

"""The study `agreement`: what the step of an engine and what its model adds to its error, and the outlier.

Every engine plays a scene at its own step and at a ladder of halved steps. The *discretisation* error is the
change of its result below its own step. The *model* error is the error of the ladder's limit (Richardson's,
where there is an order: the slope of the change from rung to rung). Errors are the largest over frames and
bodies: of positions over the longest path of any body, of orientations in radians.

Where a scene has no closed form, its truth is the band of the codes that converge to one motion
(`work_precision/errors.py`). The error of an engine at its own step is its distance from the band.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isnan, nan
from pathlib import Path

import numpy as np
import pandas as pd
from rich.text import Text
from scipy.spatial.transform import Rotation
from scipy.stats import linregress, t

from touchstone.adapters.contract import DRIVES, Array, Engine
from touchstone.adapters.registry import ENGINES, installed
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.metrics.context import Context
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row, rows_of
from touchstone.reports.runner.cells import Cell, grid
from touchstone.reports.runner.request import step_text
from touchstone.reports.runner.sweep import sweep
from touchstone.reports.runner.tasks import PROCESSES, Task, own_profile, own_settings, own_step, played
from touchstone.reports.studies.study import RefusedError, failures, kept, missing_rows
from touchstone.reports.studies.work_precision.points import (
    FINER,
    TRUTH_PROFILE,
    SweptRuns,
    errors_of,
    truth_cells,
)
from touchstone.reports.verdict.judge import judged
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import number
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

STUDY = "agreement"
LADDER = tuple(1 / (120 * 2**k) for k in range(5))
"""Steps [s]: halved four times, around the 1/240 s that all engines share in `equal-step`."""
ROUNDING = 1e-9
"""Change or error below which rounding of some ten thousand steps dominates, not discretisation [1, rad]."""
FALLS = 0.5
"""Share of the error left at the smallest step above which it does not converge [1]; order 1 leaves 1/16."""
LEAST_ORDER = 0.5
"""Least order of an extrapolation [1]: none where the order's interval reaches below it."""
CONFIDENCE = 0.95
UNITS = {"position": "1", "orientation": "rad"}
SCENES = (
    *("fall", "tumble_stable", "tumble_unstable", "spring", "bounce_e05", "collide_sticks", "cradle"),
    *("roll", "slip", "slide", "incline_slides", "push_box"),
)
"""Default scenes: one or two of each family with a closed form, and one whose truth is a band."""


@dataclass(frozen=True, slots=True)
class Trajectory:
    """Trajectories of bodies with a truth: centres of mass over the longest path (f, n, 3), orientations wxyz
    (f, n, 4)."""

    position: Array
    orientation: Array

    @property
    def turned(self) -> Rotation:
        """All orientations."""
        return Rotation.from_quat(self.orientation.reshape(-1, 4), scalar_first=True)

    def limit(self, coarser: Trajectory, order: float) -> Trajectory:
        """Richardson extrapolation from the trajectory at twice the step and this one."""
        share = 1 / (2**order - 1)
        further = Rotation.from_rotvec(share * (self.turned * coarser.turned.inv()).as_rotvec())
        turned = (further * self.turned).as_quat(scalar_first=True).reshape(self.orientation.shape)
        return Trajectory(self.position + share * (self.position - coarser.position), turned)

    def apart(self, other: Trajectory, quantity: str) -> float:
        """Largest distance over frames and bodies."""
        if quantity == "position":
            return float(np.linalg.norm(self.position - other.position, axis=-1).max())
        return float((self.turned * other.turned.inv()).magnitude().max())


def trajectory(engine: Engine, task: Task) -> tuple[Trajectory, Trajectory]:
    """Trajectories of the bodies with a truth as an engine plays them, and as they are in closed form."""
    context = Context(task.record(engine), task.scenario)
    motions = context.truths.values()  # lengths are over the longest path; 1 m where nothing moves
    way = float(max(np.linalg.norm(m.position - m.position[0], axis=1).max() for m in motions)) or 1.0
    turned = context.recording.orientation[:, list(context.truths)]
    position = np.stack([m.position for m in motions], axis=1)
    exact = Trajectory(position / way, np.stack([m.orientation for m in motions], axis=1))
    return Trajectory(context.mass_centers[:, list(context.truths)] / way, turned), exact


def tasks(scenarios: Sequence[Scenario], folder: Path = Path()) -> list[Task]:
    """Every scene with a closed form on every installed engine: at the engine's own step, then at those of
    the ladder."""
    return [
        Task(
            scenario,
            engine,
            # at coarse steps bodies leave a plan's bounds
            own_settings(engine, dt, PLANNED),
            folder / f"{scenario.name}-{engine}-{round(1 / dt)}.npz",
        )
        for scenario in scenarios
        if scenario.truths
        for rung in (None, *LADDER)
        for engine in ENGINES
        if installed(engine) and rung != own_step(engine)
        for dt in (rung or own_step(engine),)
    ]


def run(scenarios: Sequence[Scenario], out: Path, progress: Progress) -> pd.DataFrame:
    """Play all steps, judge and store; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        (folder / "recordings").mkdir()
        asked = tasks(scenarios, folder / "recordings")
        found = played(trajectory, asked, folder / "output", progress) if asked else []
        rows: list[Row] = []
        for scenario in scenarios:
            if scenario.truths:
                mine = [(task, one) for task, one in zip(asked, found) if task.scenario is scenario]
                some = rows_of_scene(scenario, mine)
            else:
                some = _band_rows(scenario, folder, progress)
            rows += [judged(row, scenario.tags) for row in some]
        facts = {
            "study": STUDY,
            "steps": LADDER,
            "scenarios": {s.name: {"tags": s.tags, "seed": s.seed} for s in scenarios},
            "own_steps": {engine: own_step(engine) for engine in ENGINES},
        }
        return kept(rows, folder, facts)


def band_cells(scenario: Scenario) -> list[Cell]:
    """Converged solutions of a scene without a closed form, and every installed engine at its own step."""
    return [*truth_cells(scenario.name, drive=_drive(scenario)), *own_cells(scenario)]


def own_cells(scenario: Scenario) -> list[Cell]:
    """A scene on every installed engine in its own profile, at its step."""
    columns = [(engine, own_profile(engine)) for engine in ENGINES if installed(engine)]
    cells, drive = grid([scenario.name], columns), _drive(scenario)
    return [replace(one, options=(f"drive={drive}",)) for one in cells]


def _drive(scenario: Scenario) -> str:
    """Kinematic links where they drive simulated bodies: contacts are compared, not servos."""
    return "posed" if any(body.kind == "simulated" for body in scenario.bodies) else DRIVES[0]


def steps(scenarios: Sequence[Scenario]) -> int:
    """Number of plays."""
    return len(tasks(scenarios)) + sum(len(band_cells(s)) for s in scenarios if not s.truths)


def _band_rows(scenario: Scenario, folder: Path, progress: Progress) -> list[Row]:
    """Rows of a scene without a closed form: the band, and per engine its distance from it at its finest
    and at its own step, and what half the step changes."""
    cells = band_cells(scenario)
    swept = SweptRuns(sweep(cells, folder / "cells", progress=progress, jobs=PROCESSES, series=True))
    rows = missing_rows(STUDY, [(engine, own_profile(engine)) for engine in ENGINES], scenario.name)
    truth = swept.truth(scenario, truth_cells(scenario.name, drive=_drive(scenario)))
    if truth is None or (band := truth.band) is None:
        return rows
    base = Row(STUDY, scenario.name, "all", TRUTH_PROFILE, FINER, "agreement.band", unit="m")
    rows.append(replace(base, value=band.width if band.codes else nan, reason=band.words))
    for engine, change in band.change.items():
        far = 0.0 if engine in band.codes else band.outliers.get(engine, nan)
        for name, value in (("change", change), ("distance", far)):
            mine = replace(base, engine=engine, subject="position")
            rows.append(replace(mine, metric=f"agreement.{name}", value=value))
    for cell in own_cells(scenario):
        run = swept.run(cell)
        error = errors_of(run, truth).get("position", nan) if run else nan
        own = replace(base, engine=cell.engine, profile=cell.profile, dt=cell.dt, subject="position")
        rows.append(replace(own, metric="agreement.error", value=error))
    return rows


def require_truths(scenarios: Iterable[Scenario], kind: str = "closed form") -> None:
    """Refuse scenes without a truth, of a kind that the message names."""
    if lacking := [scenario.name for scenario in scenarios if not scenario.truths]:
        valid = ", ".join(s.name for s in catalogue().values() if s.truths)
        raise RefusedError(f"no {kind} for {', '.join(lacking)}; valid: {valid}")


def rows_of_scene(
    scenario: Scenario, found: Iterable[tuple[Task, tuple[Trajectory, Trajectory] | Ended]]
) -> list[Row]:
    """All rows of one scene: per engine its errors and order, and the outlier of them all."""
    columns = [(engine, own_profile(engine)) for engine in ENGINES]
    rows = missing_rows(STUDY, columns, scenario.name)
    paths: dict[str, dict[float, Trajectory]] = {engine: {} for engine in ENGINES if installed(engine)}
    truth: Trajectory | None = None
    for task, one in found:
        if task.engine not in paths:
            continue
        if not isinstance(one, Ended):
            paths[task.engine][task.settings.dt], truth = one
            continue
        row = replace(_base(scenario, task.engine), dt=task.settings.dt)
        rows.append(replace(row, verdict=one.status, reason=one.reason))
        # An engine that refuses a step of the ladder is compared at the others.
        if one.status != "skipped" or not paths[task.engine]:
            paths.pop(task.engine)
    if truth is not None:
        still = Trajectory(*(np.broadcast_to(x[:1], x.shape) for x in (truth.position, truth.orientation)))
        for quantity in UNITS:
            if truth.apart(still, quantity) > ROUNDING:
                for engine, mine in paths.items():
                    rows += _rows_of_engine(_base(scenario, engine), mine, truth, quantity)
                rows += _outlier(_base(scenario, "all"), paths, quantity)
    return rows


def _base(scenario: Scenario, engine: str) -> Row:
    if engine not in ENGINES:
        return Row(STUDY, scenario.name, engine, "own step", nan, "run")
    return Row(STUDY, scenario.name, engine, own_profile(engine), own_step(engine), "run")


def _rows_of_engine(
    base: Row, paths: Mapping[float, Trajectory], truth: Trajectory, quantity: str
) -> list[Row]:
    """Rows of an engine: error at each step, and its two parts."""
    base = replace(base, subject=quantity, unit=UNITS[quantity])
    errors = {dt: path.apart(truth, quantity) for dt, path in paths.items()}
    rungs = [dt for dt in LADDER if dt in paths]
    if not rungs:
        reason = "it refuses all steps of the ladder"
        return [replace(base, metric="agreement.model", verdict="skipped", reason=reason)]
    changes = np.array([paths[a].apart(paths[b], quantity) for a, b in pairwise(rungs)])
    slope, low = order_of(np.array(rungs[:-1]), changes)
    finest = paths[rungs[-1]]
    limit = finest.limit(paths[rungs[-2]], slope) if low > LEAST_ORDER else finest
    coarsest, foot = errors[rungs[0]], errors[rungs[-1]]
    remark = ""
    if foot > max(FALLS * coarsest, ROUNDING):
        remark = f"the error does not fall with the step: {coarsest:.2g} at {step_text(rungs[0])} s, "
        remark += f"{foot:.2g} at {step_text(rungs[-1])} s"
    apart, left = paths[base.dt].apart(limit, quantity), limit.apart(truth, quantity)
    return [
        *(replace(base, metric="agreement.error", dt=dt, value=error) for dt, error in errors.items()),
        replace(base, metric="agreement.discretisation", value=apart),
        replace(base, metric="agreement.model", dt=rungs[-1], value=left, reason=remark),
    ]


def order_of(dt: Array, changes: Array) -> tuple[float, float]:
    """Slope of log change over log step, and the low end of its interval; NaN if fewer than three changes
    exceed rounding."""
    clear = changes > ROUNDING
    if clear.sum() < 3:
        return nan, nan
    return slope_of(dt[clear], changes[clear])[:2]


def slope_of(dt: Array, errors: Array) -> tuple[float, float, float]:
    """Slope of log error over log step, with its interval (Student's t)."""
    fit = linregress(np.log(dt), np.log(errors))
    half = float(t.ppf((1 + CONFIDENCE) / 2, len(dt) - 2) * fit.stderr)
    return float(fit.slope), float(fit.slope) - half, float(fit.slope) + half


def _outlier(base: Row, played_at: Mapping[str, Mapping[float, Trajectory]], quantity: str) -> list[Row]:
    """The engine farthest from the nearest of the others at its own step; of three or more."""
    own = {engine: paths[own_step(engine)] for engine, paths in played_at.items()}
    if len(own) < 3:
        return []
    lone = {a: min(own[a].apart(own[b], quantity) for b in own if b != a) for a in own}
    name = max(lone, key=lambda engine: lone[engine])
    base = replace(base, metric="agreement.outlier", subject=quantity, unit=UNITS[quantity])
    return [replace(base, value=lone[name], reason=name)]


HEADS = ("engine", "own step\n[s]", "error", "discreti-\nsation", "model", "")
NOTES = (
    "error: at the own step, largest over frames and bodies; positions over the longest way, turns in rad",
    "discretisation: what smaller steps change of it; model: by how much their limit misses the closed form",
    "what all play to rounding is left out   * farthest from its nearest neighbour",
    "! does not fall with the step   orders of convergence: touchstone study convergence",
)


def report(frame: pd.DataFrame) -> list[Part]:
    """One block per scene and quantity, and every remark."""
    rows: list[list[str | Text]] = []
    models = frame[frame.metric == "agreement.model"]
    for (scenario, quantity), part in models.groupby(["scenario", "subject"], sort=False):
        block = frame[(frame.scenario == scenario) & (frame.subject == quantity)]
        if not (block[block.metric == "agreement.error"].value > ROUNDING).any():
            continue
        rows.append([Text.assemble((str(scenario), "bold"), f" {quantity}")])
        outliers = rows_of(block[block.metric == "agreement.outlier"])
        lone = next((row.reason for row in outliers if row.value > ROUNDING), "")
        for model in rows_of(part[part.verdict != "skipped"]):
            rows.append([*_cells(model, rows_of(block[block.engine == model.engine]), lone)])
    title = "agreement: scenes with a closed form, each engine at its own step and down to 1/1920 s"
    table = Part(title, HEADS, rows, NOTES) if rows else Part()
    return [table, _bands(frame), failures(frame)]


BAND_HEADS = ("engine", "own step\n[s]", "error\n[mm]", "finest\n[mm]", "change\n[mm]")
BAND_NOTES = (
    "error: distance at the own step from the band of the codes that agree; driven links are kinematic",
    "finest: the same at 1/3840 s, without a band from the nearest code; change: by half of that step",
)


def _bands(frame: pd.DataFrame) -> Part:
    """One block per scene without a closed form, and who agrees on it."""
    bands, rows = rows_of(frame[frame.metric == "agreement.band"]), []
    for band in bands:
        rows.append([band.scenario])
        mine = rows_of(frame[(frame.scenario == band.scenario) & (frame.subject == "position")])
        found = {(row.engine, row.metric): row.value for row in mine}
        for row in mine:
            if row.metric == "agreement.error":
                names = (f"agreement.{name}" for name in ("error", "distance", "change"))
                values = (found.get((row.engine, name), nan) for name in names)
                cells = ("-" if isnan(one) else number(1e3 * one) for one in values)
                rows.append([row.engine, step_text(row.dt), *cells])
    if not bands:
        return Part()
    lines = [f"{band.scenario}: {band.reason}" for band in bands]
    return Part("agreement: scenes without a closed form", BAND_HEADS, rows, BAND_NOTES, lines)


def _cells(model: Row, mine: list[Row], lone: str) -> list[str]:
    step = next(row for row in mine if row.metric == "agreement.discretisation")
    error = next(row for row in mine if row.metric == "agreement.error" and row.dt == step.dt)
    return [
        model.engine + ("*" if model.engine == lone else ""),
        step_text(step.dt),
        *("0" if one.value < ROUNDING else number(one.value) for one in (error, step, model)),
        "!" if model.reason else "",
    ]

"""The study `agreement`: what the step of an engine and what its model adds to its error, and the outlier.

Every engine plays a scene at its own step and at a ladder of halved steps. The *discretisation* error is the
change of its result below its own step. The *model* error is the error of the ladder's limit (Richardson's,
where there is an order: the slope of the change from rung to rung). Errors are the largest over frames and
bodies: of positions over the longest path of any body, of orientations in radians.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation
from scipy.stats import linregress, t

from touchstone.adapters.contract import MISSING, Array, Settings
from touchstone.adapters.recording import load
from touchstone.adapters.registry import ENGINES, installed, missing_reason
from touchstone.adapters.workers.children import Children, Job, Outcome
from touchstone.reports.cli.progress import Progress
from touchstone.reports.metrics.context import Context
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, save, save_manifest, table
from touchstone.reports.run.request import step_text
from touchstone.reports.verdict.judge import judged
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
QUANTITIES = ("position", "orientation")
SCENES = (
    *("fall", "tumble_stable", "tumble_unstable", "spring", "bounce_e05", "collide_sticks", "cradle"),
    *("roll", "slip", "slide", "incline_slides"),
)
"""Default scenes: one or two of each family with a closed form."""


@dataclass(frozen=True, slots=True)
class Course:
    """Trajectories of bodies with a truth: centres of mass over the longest path (f, n, 3), orientations wxyz
    (f, n, 4)."""

    position: Array
    orientation: Array

    def limit(self, coarser: Course, order: float) -> Course:
        """Richardson extrapolation from the trajectory at twice the step and this one."""
        share = 1 / (2**order - 1)
        shape = self.orientation.shape
        mine, theirs = (
            Rotation.from_quat(course.orientation.reshape(-1, 4), scalar_first=True)
            for course in (self, coarser)
        )
        turned = Rotation.from_rotvec(share * (mine * theirs.inv()).as_rotvec()) * mine
        return Course(
            self.position + share * (self.position - coarser.position),
            turned.as_quat(scalar_first=True).reshape(shape),
        )

    def apart(self, other: Course, quantity: str) -> float:
        """Largest distance over frames and bodies."""
        if quantity == "position":
            return float(np.linalg.norm(self.position - other.position, axis=-1).max())
        mine, theirs = (
            Rotation.from_quat(path.orientation.reshape(-1, 4), scalar_first=True) for path in (self, other)
        )
        return float((mine * theirs.inv()).magnitude().max())


class NoTruth(Exception):
    """A scene without a closed form; the message says so."""


def own_profile(engine: str) -> str:
    """The profile in which an engine is compared: its default."""
    return next(iter(ENGINES[engine].profiles))


def steps(scenarios: Sequence[Scenario]) -> int:
    """Number of progress steps of a run: displayed frames."""
    return sum(s.frame_count for s in scenarios) * len(ENGINES) * (len(LADDER) + 1)


def run(scenarios: Sequence[Scenario], out: Path, progress: Progress) -> pd.DataFrame:
    """Play all steps, judge and store; the folder appears complete or not at all."""
    if lacking := [scenario.name for scenario in scenarios if not scenario.truths]:
        with_truth = [s.name for s in catalogue().values() if s.truths]
        raise NoTruth(f"no closed form for {', '.join(lacking)}; valid: {', '.join(with_truth)}")
    with output_folder(out) as folder:
        (folder / "output").mkdir()
        (folder / "recordings").mkdir()
        rows: list[Row] = []
        with Children(together=True) as children:
            for scenario in scenarios:
                found = rows_of_scene(scenario, folder, children, progress)
                rows += [judged(row, scenario.tags) for row in found]
        frame = table(rows)
        save(frame, folder)
        _save_manifest(scenarios, folder)
    return frame


def rows_of_scene(scenario: Scenario, folder: Path, children: Children, progress: Progress) -> list[Row]:
    """All rows of one scene: per engine its errors and order, and the outlier of them all."""
    rows: list[Row] = []
    engines = []
    for engine in ENGINES:
        if installed(engine):
            engines.append(engine)
        else:
            rows.append(replace(_base(scenario, engine), verdict=MISSING, reason=missing_reason(engine)))
    truth: Course | None = None
    played: dict[str, dict[float, Course]] = {engine: {} for engine in engines}
    for rung in (None, *LADDER):
        jobs = [_job(scenario, engine, rung, folder) for engine in engines if engine in played]
        for outcome in children.play(jobs, progress):
            engine, dt = outcome.job.engine, outcome.job.settings.dt
            if outcome.status != "done":
                rows.append(_ended(scenario, outcome))
                # An engine that refuses a step of the ladder is compared at the others.
                if outcome.status != "skipped" or rung is None:
                    played.pop(engine, None)
                continue
            context = Context(load(outcome.job.recording), scenario)
            way = _way(context)
            bodies = list(context.truths)
            played[engine][dt] = Course(
                context.mass_centers[:, bodies] / way, context.recording.orientation[:, bodies]
            )
            motions = context.truths.values()
            truth = Course(
                np.stack([m.position for m in motions], axis=1) / way,
                np.stack([m.orientation for m in motions], axis=1),
            )
    if truth is not None:
        for quantity in QUANTITIES:
            if _changes(truth, quantity):
                for engine, paths in played.items():
                    rows += _rows_of_engine(_base(scenario, engine), paths, truth, quantity)
                rows += _outlier(_base(scenario, "all"), played, quantity)
    return rows


def _job(scenario: Scenario, engine: str, rung: float | None, folder: Path) -> Job:
    profile = own_profile(engine)
    dt = ENGINES[engine].profiles[profile] if rung is None else rung
    name = f"{scenario.name}-{engine}-{round(1 / dt)}"
    return Job(
        engine,
        scenario,
        Settings(profile, dt, effects=PLANNED),  # at coarse steps bodies leave a plan's bounds
        folder / "recordings" / f"{name}.npz",
        folder / "output" / f"{name}.txt",
    )


def _base(scenario: Scenario, engine: str) -> Row:
    profile = own_profile(engine) if engine in ENGINES else "own step"
    dt = ENGINES[engine].profiles[profile] if engine in ENGINES else float("nan")
    return Row(STUDY, scenario.name, engine, profile, dt, "run")


def _ended(scenario: Scenario, outcome: Outcome) -> Row:
    row = replace(_base(scenario, outcome.job.engine), dt=outcome.job.settings.dt)
    return replace(row, verdict=outcome.status, reason=outcome.reason)


def _way(context: Context) -> float:
    """The longest path of any body in closed form [m]; 1 m where nothing moves."""
    ways = [np.linalg.norm(m.position - m.position[0], axis=1).max() for m in context.truths.values()]
    return float(max(ways)) or 1.0


def _changes(truth: Course, quantity: str) -> bool:
    """Whether any truth changes its position, or its orientation."""
    start = Course(
        np.broadcast_to(truth.position[:1], truth.position.shape),
        np.broadcast_to(truth.orientation[:1], truth.orientation.shape),
    )
    return truth.apart(start, quantity) > ROUNDING


def _rows_of_engine(base: Row, paths: Mapping[float, Course], truth: Course, quantity: str) -> list[Row]:
    """Rows of an engine: error at each step, and its two parts."""
    unit = "1" if quantity == "position" else "rad"
    base = replace(base, subject=quantity, unit=unit)
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
    """Slope of log change over log step, and the low end of its interval (Student's t); NaN if fewer than
    three changes exceed rounding."""
    kept = changes > ROUNDING
    if kept.sum() < 3:
        return float("nan"), float("nan")
    fit = linregress(np.log(dt[kept]), np.log(changes[kept]))
    half = float(t.ppf((1 + CONFIDENCE) / 2, kept.sum() - 2) * fit.stderr)
    return float(fit.slope), float(fit.slope) - half


def _outlier(base: Row, played: Mapping[str, Mapping[float, Course]], quantity: str) -> list[Row]:
    """The engine farthest from the nearest of the others at its own step; of three or more."""
    own = {engine: paths[ENGINES[engine].profiles[own_profile(engine)]] for engine, paths in played.items()}
    if len(own) < 3:
        return []
    lone = {a: min(own[a].apart(own[b], quantity) for b in own if b != a) for a in own}
    name = max(lone, key=lambda engine: lone[engine])
    return [
        replace(
            base,
            metric="agreement.outlier",
            subject=quantity,
            unit="1" if quantity == "position" else "rad",
            value=lone[name],
            reason=name,
        )
    ]


def _save_manifest(scenarios: Sequence[Scenario], folder: Path) -> None:
    facts = {
        "study": STUDY,
        "steps": LADDER,
        "scenarios": {s.name: {"tags": s.tags, "seed": s.seed} for s in scenarios},
        "own_steps": {e: ENGINES[e].profiles[own_profile(e)] for e in ENGINES},
    }
    save_manifest(folder, facts)

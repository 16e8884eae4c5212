"""The study `robustness`: random scenes for which nothing was tuned, assessed without a closed form.

At most two processes play the scenes of consecutive seeds (`scenarios.random_scenes`). Each run belongs to
one class of RANDOM_CLASSES. The rows hold, per kind of scene and for `all`, the number of runs of each class
and the spread of the figures; `runs.csv` has one line per run. Limits apply to the reference, over all kinds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import MISSING, Settings
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.adapters.workers.pool import EngineProcess, Loader, Pool, Slot
from touchstone.reference_impl.solver.tolerances import RESIDUAL_OPEN
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, illustrate, save, save_manifest, table, write_beside
from touchstone.reports.studies.robustness.picture import rise_over_residual
from touchstone.reports.studies.robustness.play import (
    PATIENCE,
    Task,
    asked_of,
    assess_task,
)
from touchstone.reports.verdict.judge import judged
from touchstone.reports.verdict.outcomes import RANDOM_CLASSES
from touchstone.reports.verdict.random_outcomes import COUNTERS, Assessment
from touchstone.scenarios.random_scenes import ALL_KINDS, kind_of

STUDY = "robustness"
ALL = "all"
"""Scenario name of the rows over all kinds."""
PROFILES = ("balanced", "accurate", "recommended")
"""Default profiles."""
PROCESSES = 2
"""Largest number of processes that play at a time."""
WORST = 8
"""Number of runs that are listed per column and class."""
SPREADS: dict[str, tuple[tuple[str, float], ...]] = {
    # metric: percentiles
    "rise": (("p50", 50), ("p99", 99), ("max", 100)),
    "residual": (("p50", 50), ("p995", 99.5), ("max", 100)),
    "overlap": (("max", 100),),
    "momentum": (("max", 100),),
    "dropped_time": (("p99", 99), ("max", 100)),
    "slowest": (("p50", 50), ("max", 100)),
}
UNITS = {
    "rise": "1",
    "residual": "m/s",
    "overlap": "m",
    "momentum": "1",
    "dropped_time": "s",
    "slowest": "s",
}
COUNTS = tuple(f"{STUDY}.{outcome.replace(' ', '_')}" for outcome in RANDOM_CLASSES)
OPEN = f"{STUDY}.solves.open"
"""Metric: share of contact solves with a residual over RESIDUAL_OPEN [1]."""
METRICS = (*COUNTS, *(f"{STUDY}.{name}.{part}" for name, parts in SPREADS.items() for part, _ in parts), OPEN)
"""Metrics of the study's rows; each name begins with the study's."""
Run = tuple[Task, Assessment]


def tasks(
    columns: Iterable[tuple[str, str]], scenes: int, seed: int, kind: str | None = None, size: float = 0.0
) -> list[Task]:
    """The runs of `scenes` seeds from `seed` on, per (engine, profile) of an installed engine."""
    return [
        Task(engine, Settings(profile, ENGINES[engine].profiles[profile]), seed + k, kind, size)
        for engine, profile in columns
        if installed(engine)
        for k in range(scenes)
    ]


def run(
    columns: Sequence[tuple[str, str]],
    asked: Sequence[Task],
    out: Path,
    progress: Progress,
    loader: Loader = load,
    patience: float = PATIENCE,
) -> pd.DataFrame:
    """Play all tasks and judge the columns; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        runs = played(asked, folder, progress, loader, patience)
        rows = [
            Row(STUDY, ALL, engine, profile, np.nan, "run", verdict=MISSING, reason=missing_reason(engine))
            for engine, profile in columns
            if not installed(engine)
        ]
        frame = table([*rows, *(judged(row, ()) for row in rows_of_runs(runs))])
        save(frame, folder)
        write_beside(folder / "runs.csv", lambda part: table_of_runs(runs).to_csv(part, index=False))
        seeds = [task.seed for task in asked]
        save_manifest(folder, {"study": STUDY, "seeds": [min(seeds), max(seeds)] if seeds else []})

        illustrate(folder / "robustness.png", lambda part: rise_over_residual(table_of_runs(runs), part))
    return frame


def played(
    asked: Sequence[Task], folder: Path, progress: Progress, loader: Loader = load, patience: float = PATIENCE
) -> list[Run]:
    """Play tasks in processes; a process that dies or hangs gives a run of that class and is replaced."""

    def one(slot: Slot[EngineProcess], task: Task) -> list[Run]:
        return [(task, asked_of(slot, task))]

    start = partial(EngineProcess, assess_task, loader=loader, patience=patience)
    runs: dict[Task, Assessment] = {}
    for task, found in Pool(start, min(PROCESSES, len(asked)), folder).each(asked, one):
        runs[task] = found
        progress(f"{task.engine} {task.settings.label}", 1)
    return [(task, runs[task]) for task in asked]


def rows_of_runs(runs: Sequence[Run]) -> list[Row]:
    """Counts and spreads per column, over all kinds and per kind, and the worst runs with their commands."""
    rows: list[Row] = []
    columns = dict.fromkeys((task.engine, task.settings) for task, _ in runs)
    for engine, settings in columns:
        mine = [(task, found) for task, found in runs if (task.engine, task.settings) == (engine, settings)]
        for kind in (ALL, *ALL_KINDS):
            part = [found for task, found in mine if kind in (ALL, kind_of(task.seed, task.kind))]
            base = Row(STUDY, kind, engine, settings.label, settings.dt, "")
            rows += _figures(base, part) if part else []
        rows += _worst(Row(STUDY, "", engine, settings.label, settings.dt, "run"), mine)
    return rows


def _figures(base: Row, found: list[Assessment]) -> list[Row]:
    """Rows of one kind in a column."""
    outcomes = [one.outcome for one in found]
    rows = [
        replace(base, metric=metric, value=float(outcomes.count(outcome)), unit="1")
        for metric, outcome in zip(COUNTS, RANDOM_CLASSES)
    ]
    rows[-1] = replace(rows[-1], reason=f"of {len(found)}")
    for name, parts in SPREADS.items():
        values = np.array(
            [value for one in found for value in one.residuals]
            if name == "residual"
            else [getattr(one, name) for one in found]
        )
        values = values[np.isfinite(values)]
        for part, percent in parts if len(values) else ():
            value = float(np.percentile(values, percent, method="higher"))
            rows.append(replace(base, metric=f"{STUDY}.{name}.{part}", value=value, unit=UNITS[name]))
    solves, unsolved = (float(np.nansum(column)) for column in zip(*(one.solves for one in found)))
    if solves > 0:
        said = f"{unsolved:.0f} of {solves:.0f} contact solves leave more than {RESIDUAL_OPEN:g} m/s"
        rows.append(replace(base, metric=OPEN, value=unsolved / solves, unit="1", reason=said))
    return rows


def _worst(base: Row, runs: Sequence[Run]) -> list[Row]:
    """The worst runs of every class but `ok`, with the command that repeats each."""
    rows = []
    for outcome in RANDOM_CLASSES[:-1]:
        these = [(task, found) for task, found in runs if found.outcome == outcome]
        size = "residual" if outcome == "residual" else "overlap" if outcome == "overlap" else "gain"
        size = outcome if outcome in ("rise", "momentum") else size
        these.sort(key=lambda one: -np.nan_to_num(getattr(one[1], size), nan=0.0))
        for task, found in these[:WORST]:
            rows.append(
                replace(
                    base,
                    scenario=kind_of(task.seed, task.kind),
                    seed=task.seed,
                    subject=outcome,
                    value=float(getattr(found, size)),
                    unit="m/s" if size == "residual" else "m" if size == "overlap" else "1",
                    reason=found.reason,
                    reproduce=line(task),
                )
            )
    return rows


def line(task: Task) -> str:
    """The command that repeats a task."""
    extra = f" --kind {task.kind}" if task.kind else ""
    extra += f" --perturbation {task.perturbation:g}" if task.perturbation else ""
    return (
        f"touchstone study {STUDY} --scenes 1 --seed {task.seed} --engine {task.engine} "
        f"--profile {task.settings.profile}{extra}"
    )


def table_of_runs(runs: Sequence[Run]) -> pd.DataFrame:
    """Table with one line per run."""
    lines = []
    for task, found in runs:
        facts = asdict(found)
        residuals = facts.pop("residuals")
        counters = dict(zip(COUNTERS, facts.pop("counters")))
        lines.append(
            {
                "seed": task.seed,
                "kind": kind_of(task.seed, task.kind),
                "engine": task.engine,
                "profile": task.settings.label,
                **facts,
                "residual": found.residual,
                "unsolved_frames": sum(value > RESIDUAL_OPEN for value in residuals),
                **counters,
            }
        )
    return pd.DataFrame(lines)

"""The study `parity`: what an engine repeats to the bit, and how long it stays near itself where it does not.

Each scene is played again in another process, on two threads, with its bodies in reverse order, in a batch of
worlds, and on the other backend of an engine that has two. An engine without the choice has no row for it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from touchstone.adapters.contract import STATE_FIELDS, Array, Engine
from touchstone.adapters.registry import backend_of, installed, registered
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.output_folder import output_folder
from touchstone.reports.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.run.farthest_apart import THRESHOLD
from touchstone.reports.runner.measures import last_within
from touchstone.reports.runner.tasks import Task, played, tasks_of
from touchstone.reports.studies.study import Column, failures, kept, missing_rows
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import length_text
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import permuted

STUDY = "parity"
SCENES = ("bounce_e05", "slide", "stack", "collide_oblique", "pyramid")
"""Default scenes: an impact, friction, rest, a spin, and a pile that amplifies."""
THREADS = {"physx": "cpu_workers=2", "rapier": "num_threads=2"}
BATCH = {"mujoco_warp": "worlds=4", "newton": "worlds=4"}
"""Settings of engines that step on two threads, or four worlds at a time."""
COMPARED = STATE_FIELDS[:4]
"""What must be equal: poses and velocities."""


def _changed(choice: dict[str, str]) -> Callable[[Task], Task | None]:
    """The task with one more setting, for the engines that have it."""

    def change(task: Task) -> Task | None:
        if task.engine not in choice:
            return None
        return replace(task, settings=replace(task.settings, changes=(choice[task.engine],)))

    return change


def _reversed(task: Task) -> Task:
    return replace(task, scenario=permuted(task.scenario, range(len(task.scenario.bodies))[::-1]))


def _other_backend(task: Task) -> Task | None:
    other = backend_of(task.engine)
    return replace(task, engine=registered(other)) if other and installed(other) else None


VARIANTS: dict[str, tuple[str, Callable[[Task], Task | None]]] = {
    "process": ("in another process", lambda task: task),
    "threads": ("on two threads instead of one", _changed(THREADS)),
    "order": ("with the bodies in reverse order", _reversed),
    "batch": ("as the first of four worlds that are stepped together", _changed(BATCH)),
    "backend": ("on the backend in double precision", _other_backend),
}
METRICS = tuple(f"{STUDY}.{name}{end}" for name in VARIANTS for end in ("", ".horizon"))
"""Metrics of the rows: the largest distance [m], and until when no body is farther away than 1 mm [s]."""


def path(engine: Engine, task: Task) -> Array:
    """Poses and velocities (f, n, 13) of the bodies in the order of their names."""
    found, names = task.record(engine), [body.name for body in task.scenario.bodies]
    whole = np.concatenate([getattr(found, field) for field in COMPARED], axis=2)
    return np.asarray(whole[:, np.argsort(names)])


def tasks(columns: Sequence[Column], scenes: Sequence[Scenario]) -> list[Task]:
    """Every scene in every column of an installed engine."""
    return [task for column in columns for task in tasks_of(scenes, [column])]


def steps(columns: Sequence[Column], scenes: Sequence[Scenario]) -> int:
    """Number of plays."""
    asked = tasks(columns, scenes)
    return len(asked) + sum(change(task) is not None for task in asked for _, change in VARIANTS.values())


def run(columns: Sequence[Column], scenes: Sequence[Scenario], out: Path, progress: Progress) -> pd.DataFrame:
    """Play all tasks and their variants; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        asked = tasks(columns, scenes)
        rows = missing_rows(STUDY, columns)
        first = played(path, asked, folder / "output", progress)
        for name, (_, change) in VARIANTS.items():
            changed = [change(task) for task in asked]
            some = [(task, one, other) for task, one, other in zip(asked, first, changed) if other]
            # other processes than those of the plays before
            again = played(path, [other for _, _, other in some], folder / f"output-{name}", progress)
            for (task, one, _), other in zip(some, again):
                rows += rows_of_pair(name, task, one, other)
        facts = {"study": STUDY, "scenes": [scene.name for scene in scenes]}
        return kept(rows, folder, facts)


def rows_of_pair(name: str, task: Task, one: Array | Ended, other: Array | Ended) -> list[Row]:
    """Distance and horizon of a scene in two plays, or why there is none."""
    key = (STUDY, task.scenario.name, task.engine, task.settings.label, task.settings.dt)
    for found in (one, other):
        if isinstance(found, Ended):
            verdict = found.status if found.status in ("skipped", "missing") else "error"
            return [Row(*key, f"{STUDY}.{name}", verdict=verdict, reason=found.reason)]
    a, b = np.asarray(one), np.asarray(other)
    away = np.linalg.norm(a[..., :3] - b[..., :3], axis=-1).max(axis=1)
    last = last_within(away, THRESHOLD)
    until = last / task.scenario.frame_rate
    said = "equal to the bit" if np.array_equal(a, b) else "not equal"
    distance = Row(*key, f"{STUDY}.{name}", float(away.max()), "m", reason=said)
    reason = "end" if last == len(away) - 1 else "beyond 1 mm"
    return [distance, Row(*key, f"{STUDY}.{name}.horizon", until, "s", reason=reason)]


NOTES = (
    "scenes that are equal to the bit, of those played; where not all are, the largest distance of a body,",
    "and the earliest time after which one is more than 1 mm apart, if any is.",
    *(f"{name}: {summary}" for name, (summary, _) in VARIANTS.items()),
)


def report(frame: pd.DataFrame) -> list[Part]:
    """A line per column, with a cell per variant."""
    measured = frame[frame.metric != "run"]
    lines = [
        [f"{engine} {profile}", *(_cell(part, name) for name in VARIANTS)]
        for (engine, profile), part in measured.groupby(["engine", "profile"], sort=False)
    ]
    failed = frame[frame.verdict.isin(["error", "missing"])]
    return [Part("parity of repeated plays", ["engine", *VARIANTS], lines, NOTES), failures(failed)]


def _cell(part: pd.DataFrame, name: str) -> str:
    rows = part[(part.metric == f"{STUDY}.{name}") & part.value.notna()]
    if rows.empty:
        return "-"
    equal = int((rows.reason == "equal to the bit").sum())
    text = f"{equal} of {len(rows)}"
    if equal == len(rows):
        return text
    horizons = part[(part.metric == f"{STUDY}.{name}.horizon") & (part.reason == "beyond 1 mm")]
    text += f"; {length_text(rows.value.max())}"
    return text if horizons.empty else f"{text}, from {horizons.value.min():.2g} s on"

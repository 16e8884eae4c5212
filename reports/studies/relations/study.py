"""The study `relations`: truths that need no answer, on every scene and engine.

Each scene is changed in a way whose effect on the motion is known (`scenarios.relations`). The rows hold the
deviation over the scene's size. It is judged, for the reference, over the scene's amplification: what an
engine makes of a perturbation of 1e-9 m.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import MISSING, Settings
from touchstone.adapters.registry import ENGINES, installed, load, missing_reason
from touchstone.adapters.workers.pool import EngineProcess, Loader, Pool, Slot
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, save, save_manifest, table, write_beside
from touchstone.reports.studies.relations.picture import deviations_picture
from touchstone.reports.studies.relations.play import NAMES, PATIENCE, Compared, Task, compare
from touchstone.scenarios.catalogue import tagged
from touchstone.scenarios.scenario import Scenario

STUDY = "relations"
AMPLIFICATION = f"{STUDY}.amplification"
METRICS = (*(f"{STUDY}.{name}" for name in NAMES), AMPLIFICATION)
"""Metrics of the study's rows."""
HELD = 1e-9
"""Largest deviation of a relation that holds, over the scene's size and its amplification [1]: rounding."""
PROCESSES = 2
MOST_BODIES = 16
"""Largest number of bodies of a default scene: eleven runs of a larger one take DART minutes."""
QUICK = ("fall", "slide", "stack", "bounce_e05", "collide_oblique", "roll")
"""Scenes of a quick study."""
Column = tuple[str, str]


def default_scenes() -> list[Scenario]:
    """The probes of up to MOST_BODIES bodies."""
    return [scene for scene in tagged("probe") if len(scene.bodies) <= MOST_BODIES]


def tasks(columns: Sequence[Column], scenes: Sequence[Scenario]) -> list[Task]:
    """Every scene in every column of an installed engine."""
    return [
        Task(scene, engine, Settings(profile, ENGINES[engine].profiles[profile]))
        for scene in scenes
        for engine, profile in columns
        if installed(engine)
    ]


def run(
    columns: Sequence[Column],
    scenes: Sequence[Scenario],
    out: Path,
    progress: Progress,
    loader: Loader = load,
    patience: float = PATIENCE,
) -> pd.DataFrame:
    """Play all tasks; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        found = _played(tasks(columns, scenes), folder, progress, loader, patience)
        rows = [
            Row(
                STUDY,
                "all",
                engine,
                profile,
                float("nan"),
                "run",
                verdict=MISSING,
                reason=missing_reason(engine),
            )
            for engine, profile in columns
            if not installed(engine)
        ]
        frame = table([*rows, *(row for task, one in found for row in rows_of_task(task, one))])
        save(frame, folder)
        save_manifest(folder, {"study": STUDY, "scenes": [scene.name for scene in scenes]})
        write_beside(folder / "relations.png", lambda part: deviations_picture(frame, part))
    return frame


def rows_of_task(task: Task, found: Compared) -> list[Row]:
    """Rows of a scene on an engine: one per relation, and the amplification."""
    label, dt = task.settings.label, task.settings.dt
    key = (STUDY, task.scenario.name, task.engine, label, dt)
    if found.failure:
        return [Row(*key, "run", verdict="error", reason=found.failure)]
    rows = [Row(*key, AMPLIFICATION, found.amplification, "1")]
    for name in NAMES:
        value, verdict, limit = found.deviations[name], "", float("nan")
        if name in found.reasons:
            verdict = "skipped"
        elif task.engine == "reference":
            limit = HELD * found.amplification
            verdict = "pass" if value <= limit else "fail"
        rows.append(
            Row(
                *(*key, f"{STUDY}.{name}", value, "1"),
                limit=limit,
                verdict=verdict,
                reason=found.reasons.get(name, ""),
            )
        )
    return rows


def _played(
    asked: Sequence[Task], folder: Path, progress: Progress, loader: Loader, patience: float
) -> list[tuple[Task, Compared]]:
    """Play tasks in processes; one that dies or hangs costs its task, and is replaced."""

    def one(slot: Slot[EngineProcess], number: int) -> list[tuple[int, Compared]]:
        child = slot.child()
        found = child.ask("play", asked[number])
        if child.failure is not None:
            found = Compared({}, {}, failure=child.failure[1])
        return [(number, found)]

    start = partial(EngineProcess, compare, loader=loader, patience=patience)
    done: dict[int, Compared] = {}
    for number, found in Pool(start, min(PROCESSES, len(asked)), folder).each(range(len(asked)), one):
        done[number] = found
        progress(f"{asked[number].engine} {asked[number].settings.label}", 1)
    return [(task, done[number]) for number, task in enumerate(asked)]

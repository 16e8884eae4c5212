"""The study `convergence`: errors against truths at seven steps, their order and floor per engine and scene.

Every scene with a truth plays at 30 frames per second at STEPS and at each engine's own step. An engine that
is nearer to the truth than the reference at the same step is a row of its own (`convergence.nearer`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path

import pandas as pd

from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import COLUMNS, Row, illustrate, rows_of, save, save_manifest, table
from touchstone.reports.run.request import REFERENCE, step_text
from touchstone.reports.studies.convergence.definitions import (
    FLOOR,
    NEAR,
    NEARER,
    ORDER,
    STEPS,
    STUDY,
    own_step,
)
from touchstone.reports.studies.convergence.measure import ERROR, FRAME_RATE
from touchstone.reports.studies.convergence.order import EXACT, order_of
from touchstone.reports.studies.convergence.picture import draw
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.sweep import quietly, sweep
from touchstone.reports.sweep.worker import DIVERGED
from touchstone.reports.views.tables import number


def run(
    asked: Sequence[Cell], store: Path, out: Path, jobs: int | None = None, progress: Progress = quietly
) -> pd.DataFrame:
    """Measure what the store lacks; the folder `out` appears complete or not at all."""
    with output_folder(out) as folder:
        measured = sweep(asked, store, jobs=jobs, progress=progress)
        # a run that diverges at a coarse step is a measurement, not a fault
        measured.loc[measured.outcome == DIVERGED, "verdict"] = ""
        errors = measured[measured.metric.isin((ERROR, "run"))][list(COLUMNS)].assign(study=STUDY)
        frame = pd.concat([errors, table(findings(errors))], ignore_index=True)
        save(frame, folder)
        save_manifest(folder, {"study": STUDY, "store": str(store), "steps": STEPS, "frame_rate": FRAME_RATE})
        illustrate(folder / "convergence.png", lambda part: draw(frame, part))
    return frame


def findings(errors: pd.DataFrame) -> Iterator[Row]:
    """Order and floor of every engine and profile per scene, and where another is nearer to the truth."""
    for scenario, scene in errors[errors.metric == ERROR].groupby("scenario", sort=False):
        ladder = scene[scene.dt.isin(STEPS)]
        for (engine, profile), part in ladder.groupby(["engine", "profile"], sort=False):
            names = str(scenario), str(engine), str(profile)
            base = Row(STUDY, *names, own_step(*names[1:]), ORDER)
            if len(part) < 2:
                continue
            found = order_of(part.dt.to_list(), part.value.to_list())
            base = replace(base, unit="1", reason_code=found.kind)
            yield replace(base, value=found.value, low=found.low, high=found.high)
            yield replace(base, metric=FLOOR, value=found.floor, reason="still falls" if found.falls else "")
        for ours, theirs in product(rows_of(ladder[ladder.engine == REFERENCE]), rows_of(ladder)):
            if theirs.dt == ours.dt and theirs.engine != REFERENCE and _nearer(theirs.value, ours.value):
                numbers = f"{number(theirs.value)} beside {number(ours.value)} at {step_text(ours.dt)} s"
                ratio = ours.value / max(theirs.value, EXACT)
                yield replace(ours, metric=NEARER, subject=theirs.engine, value=ratio, reason=numbers)


def _nearer(theirs: float, ours: float) -> bool:
    return ours > NEAR * max(theirs, EXACT)

"""The study `stability`: how far each engine goes in each kind of difficulty before it fails, and how.

A sweep plays the cells: hard scenes (`scenarios.difficulty`) on every engine, profile and step. Its store
holds what was measured, so that an interrupted study goes on. Independent oracles judge each run
(`reports.verdict.outcomes`). `cells.csv` has one line per cell with the command that plays it; the store
keeps the recordings of failed runs in `output/failed/`.
"""

from __future__ import annotations

from math import nan
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import MISSING
from touchstone.adapters.registry import installed, load, missing_reason
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, save, save_manifest, table, write_beside
from touchstone.reports.studies.stability.cells import Plan
from touchstone.reports.studies.stability.measure import Loader, play_all
from touchstone.reports.studies.stability.picture import envelope_picture, step_pictures
from touchstone.reports.studies.stability.play import PATIENCE
from touchstone.reports.studies.stability.rows import (
    STUDY,
    Results,
    results_of,
    rows_of,
    table_of_cells,
)


def run(
    plan: Plan,
    out: Path,
    store: Path,
    progress: Progress,
    loader: Loader = load,
    patience: float = PATIENCE,
    jobs: int | None = None,
) -> tuple[pd.DataFrame, Results]:
    """Play all cells of a plan that the store does not hold, in `jobs` processes (None: one per core); the
    folder appears complete or not at all."""
    with output_folder(out) as folder:
        played = play_all(plan.cells(), store, progress, loader, patience, jobs)
        results = results_of(plan, played)
        rows = [
            Row(STUDY, "all", engine, profile, nan, "run", verdict=MISSING, reason=missing_reason(engine))
            for engine, profile in plan.columns
            if not installed(engine)
        ]
        frame = table([*rows, *rows_of(results)])
        save(frame, folder)
        cells = table_of_cells(results)
        write_beside(folder / "cells.csv", lambda part: cells.to_csv(part, index=False))
        write_beside(folder / "stability.png", lambda part: envelope_picture(results, part))
        if not plan.quick:
            step_pictures(results, folder / "steps")
        facts = {"study": STUDY, "quick": plan.quick, "families": [f.name for f in plan.families]}
        save_manifest(folder, facts)
    return frame, results

"""The study `stability`: how far each engine goes in each kind of difficulty before it fails, and how.

At most two processes play the cells: hard scenes (`scenarios.difficulty`) on every engine, profile and
step. Independent oracles judge each run (`reports.outcome`). `cells.csv` has one line per cell with the
command that plays it; failed runs keep their recordings in `failed/`.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from math import nan
from pathlib import Path
from queue import SimpleQueue

import pandas as pd

from touchstone.adapters.contract import MISSING
from touchstone.adapters.registry import installed, load, missing_reason
from touchstone.reports.cli.progress import Progress
from touchstone.reports.outcome.classes import Outcome
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import Row, save, save_manifest, table, write_beside
from touchstone.reports.studies.stability.cells import Plan
from touchstone.reports.studies.stability.picture import envelope_picture, step_pictures
from touchstone.reports.studies.stability.play import PATIENCE, Cell, Child, Loader, Played
from touchstone.reports.studies.stability.rows import (
    STUDY,
    Results,
    results_of,
    rows_of,
    table_of_cells,
)

PROCESSES = 2
"""Largest number of processes that play at a time."""


def run(
    plan: Plan, out: Path, progress: Progress, loader: Loader = load, patience: float = PATIENCE
) -> tuple[pd.DataFrame, Results]:
    """Play all cells of a plan; the folder appears complete or not at all."""
    with output_folder(out) as folder:
        played = play_all(plan.cells(), folder, progress, loader, patience)
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


def play_all(
    asked: Sequence[Cell], folder: Path, progress: Progress, loader: Loader = load, patience: float = PATIENCE
) -> dict[Cell, Played]:
    """Play cells in processes; a process that dies or hangs costs its cell, and is replaced."""
    count = min(PROCESSES, len(asked))
    idle: SimpleQueue[Child] = SimpleQueue()
    for k in range(count):
        idle.put(Child(folder / f"output-{k + 1}.txt", folder / "failed", loader, patience))

    def one(cell: Cell) -> tuple[Cell, Played]:
        child = idle.get()
        found = child.ask("play", cell)
        if child.failure is not None:
            reason = child.failure[1]
            name = "timed out" if reason.startswith("hung") else "error"
            found = Played(Outcome(name, reason), cell.line)
            child = Child(folder / "output-more.txt", folder / "failed", loader, patience)
        idle.put(child)
        return cell, found

    played: dict[Cell, Played] = {}
    with ThreadPoolExecutor(max(1, count)) as pool:
        futures = [pool.submit(one, cell) for cell in asked]
        try:
            for future in as_completed(futures):
                cell, found = future.result()
                played[cell] = found
                progress(f"{cell.engine} {cell.settings.label}", 1)
        finally:
            pool.shutdown(cancel_futures=True)
            while not idle.empty():
                idle.get().stop()
    return {cell: played[cell] for cell in asked}

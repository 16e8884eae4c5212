"""The study `work-precision`: cells, their sweep, the table of errors over time, and its verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

import pandas as pd

from touchstone.adapters.registry import ENGINES
from touchstone.reports.cli.progress import Progress
from touchstone.reports.output_folder import output_folder
from touchstone.reports.results import save_manifest, write_beside
from touchstone.reports.studies.work_precision.definitions import (
    QUANTITIES,
    QUICK_LADDER,
    QUICK_REPEATS,
    REFERENCE,
    REPEATS,
    STUDY,
    measured_cells,
    truth_cells,
)
from touchstone.reports.studies.work_precision.fronts import fronts
from touchstone.reports.studies.work_precision.ladder import ladder
from touchstone.reports.studies.work_precision.ladder_cells import ladder_cells
from touchstone.reports.studies.work_precision.points import points, timing_cell
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.content_hash import hash_of
from touchstone.reports.sweep.sweep import quietly, sweep
from touchstone.reports.sweep.timing_rounds import TimingRounds


class Plan:
    """Cells of the study: measured ones (accuracy and time), ladder (the same), truths (accuracy only)."""

    def __init__(
        self, names: Sequence[str], engines: Sequence[str] = (), quick: bool = False, with_ladder: bool = True
    ) -> None:
        self.names, self.quick = tuple(names), quick
        self.rounds = QUICK_REPEATS if quick else REPEATS
        self.measured = measured_cells(names, engines or tuple(ENGINES), quick)
        climbed = [name for name in names if not quick or name in QUICK_LADDER]
        self.ladder = ladder_cells(climbed) if with_ladder and REFERENCE in (engines or ENGINES) else []
        self.truths = truth_cells(names)

    @property
    def accuracy(self) -> list[Cell]:
        """All accuracy cells, those of the truth first: they take longest."""
        return list(dict.fromkeys([*self.truths, *self.measured, *self.ladder]))

    @property
    def timing(self) -> list[Cell]:
        """All timing cells; the ladder has one round."""
        timed = [timing_cell(cell, repeat) for repeat in range(self.rounds) for cell in self.measured]
        return list(dict.fromkeys([*timed, *(timing_cell(cell, 0) for cell in self.ladder)]))

    @property
    def size(self) -> int:
        """Number of cells."""
        return len(self.accuracy) + len(self.timing)


def measure(
    plan: Plan, store: Path, jobs: int | None = None, progress: Progress = quietly
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measure what the store lacks; returns the tables of points and of the ladder."""
    accuracy = sweep(plan.accuracy, store, jobs=jobs, progress=progress, series=True)
    ended = set(accuracy[(accuracy.metric == "run") & (accuracy.outcome == "done")].cell)
    done = {(c.scenario, c.engine, c.profile, c.dt, c.changes) for c in plan.accuracy if hash_of(c) in ended}
    timed = [c for c in plan.timing if (c.scenario, c.engine, c.profile, c.dt, c.changes) in done]
    timing = sweep(timed, store, executor=TimingRounds, progress=progress, series=True)
    frame = pd.concat([accuracy, timing], ignore_index=True)
    table = points(frame, plan.measured, plan.rounds)
    return table, ladder(frame, plan.ladder)


def run(
    plan: Plan, store: Path, out: Path, jobs: int | None = None, progress: Progress = quietly
) -> pd.DataFrame:
    """Measure, draw and store; the folder `out` appears complete or not at all, `store` keeps every cell."""
    from touchstone.reports.studies.work_precision.picture import draw

    with output_folder(out) as folder:
        table, rungs = measure(plan, store, jobs, progress)
        found = fronts(table)
        for name, frame in (("results", table), ("fronts", found), ("ladder", rungs)):
            write_beside(folder / f"{name}.parquet", partial(frame.to_parquet, index=False))
            write_beside(folder / f"{name}.csv", partial(frame.to_csv, index=False))
        save_manifest(
            folder,
            {
                "study": STUDY,
                "store": str(store),
                "rounds of timing": plan.rounds,
                "quantities": {q.name: q.meaning for q in QUANTITIES.values()},
            },
        )
        draw(table, folder)
    table.attrs |= {"fronts": found, "ladder": rungs}
    return table

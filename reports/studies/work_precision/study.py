"""The study `work-precision`: cells, their sweep, the table of errors over time, and its verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from time import perf_counter

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
from touchstone.scenarios.catalogue import catalogue


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
        """All accuracy cells: longest scenes first, so that all processes end at about the same time, and
        smallest steps first; scene by scene, because processes keep what they derive from a scene."""
        cells = dict.fromkeys([*self.truths, *self.measured, *self.ladder])
        return sorted(cells, key=lambda cell: (-_size(cell.scenario), cell.scenario, cell.dt))

    @property
    def timing(self) -> list[Cell]:
        """All timing cells; the ladder has one round."""
        timed = [timing_cell(cell, repeat) for repeat in range(self.rounds) for cell in self.measured]
        return list(dict.fromkeys([*timed, *(timing_cell(cell, 0) for cell in self.ladder)]))

    @property
    def size(self) -> int:
        """Number of cells."""
        return len(self.accuracy) + len(self.timing)


def _size(scene: str) -> float:
    """Bodies times simulated seconds: what a step size costs in a scene, roughly."""
    scenario = catalogue()[scene]
    return len(scenario.bodies) * scenario.duration


class Phases:
    """Wall time of the parts of a study [s], by name."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time what happens meanwhile."""
        start = perf_counter()
        yield
        self.seconds[name] = perf_counter() - start


def measure(
    plan: Plan,
    store: Path,
    jobs: int | None = None,
    progress: Progress = quietly,
    phases: Phases | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measure what the store lacks; returns the tables of points and of the ladder."""
    phases = phases or Phases()
    with phases.phase("accuracy"):
        accuracy = sweep(plan.accuracy, store, jobs=jobs, progress=progress, series=True)
    ended = set(accuracy[(accuracy.metric == "run") & (accuracy.outcome == "done")].cell)
    done = {(c.scenario, c.engine, c.profile, c.dt, c.changes) for c in plan.accuracy if hash_of(c) in ended}
    timed = [c for c in plan.timing if (c.scenario, c.engine, c.profile, c.dt, c.changes) in done]
    with phases.phase("timing"):
        timing = sweep(timed, store, executor=TimingRounds, progress=progress, series=True)
    with phases.phase("errors"):
        frame = pd.concat([accuracy, timing], ignore_index=True)
        table = points(frame, plan.measured, plan.rounds)
        rungs = ladder(frame, plan.ladder)
    return table, rungs


def run(
    plan: Plan, store: Path, out: Path, jobs: int | None = None, progress: Progress = quietly
) -> pd.DataFrame:
    """Measure, draw and store; the folder `out` appears complete or not at all, `store` keeps every cell."""
    from touchstone.reports.studies.work_precision.picture import draw

    phases = Phases()
    with output_folder(out) as folder:
        table, rungs = measure(plan, store, jobs, progress, phases)
        found = fronts(table)
        for name, frame in (("results", table), ("fronts", found), ("ladder", rungs)):
            write_beside(folder / f"{name}.parquet", partial(frame.to_parquet, index=False))
            write_beside(folder / f"{name}.csv", partial(frame.to_csv, index=False))
        with phases.phase("pictures"):
            draw(table, folder)
        save_manifest(
            folder,
            {
                "study": STUDY,
                "store": str(store),
                "rounds of timing": plan.rounds,
                "seconds": {name: round(value, 1) for name, value in phases.seconds.items()},
                "quantities": {q.name: q.meaning for q in QUANTITIES.values()},
            },
        )
    table.attrs |= {"fronts": found, "ladder": rungs, "seconds": phases.seconds}
    return table

"""Cells of the study `stability` as cells of a sweep: what is measured, and how it is read back."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path

import pandas as pd

from touchstone.adapters.contract import Engine
from touchstone.adapters.registry import load
from touchstone.reports.cli.progress import Progress
from touchstone.reports.results import Row
from touchstone.reports.studies.stability import play
from touchstone.reports.studies.stability.play import PATIENCE, Cell, Played, play_cell
from touchstone.reports.sweep import cells as sweep_cells
from touchstone.reports.sweep.batch_pool import BatchPool
from touchstone.reports.sweep.content_hash import hash_of
from touchstone.reports.sweep.measures import Measured, base_row
from touchstone.reports.sweep.sweep import sweep
from touchstone.reports.verdict import figures, outcomes
from touchstone.reports.verdict.outcomes import Outcome
from touchstone.scenarios.difficulty.family import hard_names, hard_scene
from touchstone.scenarios.scenario import Scenario

Loader = Callable[[str], Engine]
HERE = __name__
OUTCOME, FIGURE, UNDER, COMMAND, HASH = (
    f"stability.{name}" for name in ("outcome", "figure", "under", "command", "hash")
)
FAILED = "TOUCHSTONE_FAILED_RUNS"
"""Environment variable with the folder of the recordings of failed runs: it must not belong to the hash of a
cell, so that a store can be moved."""


KEPT = "TOUCHSTONE_KEPT_RUNS"
"""Environment variable with the folder of the recordings of all runs, for `sheet`."""


def scene(name: str, seed: int) -> Scenario:
    """Source of scenes: a hard scene by name."""
    return hard_scene(name)[0]


def outcome(cell: sweep_cells.Cell, scenario: Scenario, engine: Engine) -> Measured:
    """Measure of a cell: its outcome, the figures that decided it, its command and the hash of its states."""
    failed, kept = os.environ.get(FAILED), os.environ.get(KEPT)
    mine = Cell(cell.scenario, cell.engine, cell.settings, float(cell.option("budget", "inf")))
    folder = kept or failed
    played = play_cell(engine, mine, Path(folder) if folder else None, keep_all=kept is not None)
    return Measured(tuple(_rows(base_row(cell), played)))


def play_all(
    asked: Sequence[Cell],
    store: Path,
    progress: Progress,
    loader: Loader = load,
    patience: float = PATIENCE,
    jobs: int | None = None,
) -> dict[Cell, Played]:
    """Play the cells that the store does not hold, in parallel; one that ends its process costs itself only.

    Raises:
        StoreError: the store cannot be used.
    """
    wanted = {hash_of(_swept(cell)): cell for cell in asked}
    count = jobs or os.cpu_count() or 1
    with _failures(store / "output" / "failed"):
        frame = sweep(
            [_swept(cell) for cell in asked],
            store,
            executor=lambda output: BatchPool(count, output, loader, patience),
            progress=progress,
        )
    found = {str(key): part for key, part in frame.groupby("cell", sort=False)}
    return {cell: _played(cell, found[key]) for key, cell in wanted.items()}


@contextmanager
def _failures(folder: Path) -> Iterator[None]:
    """Let processes that start meanwhile keep recordings of failed runs in a folder."""
    before = os.environ.get(FAILED)
    os.environ[FAILED] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[FAILED]
        else:
            os.environ[FAILED] = before


def _swept(cell: Cell) -> sweep_cells.Cell:
    return sweep_cells.Cell(
        cell.scene,
        cell.engine,
        cell.settings.profile,
        cell.settings.dt,
        measure=f"{HERE}:{outcome.__name__}",
        source=f"{HERE}:{scene.__name__}",
        options=(f"budget={cell.budget!r}", f"judge={_judge(cell.scene)}"),
    )


def _judge(name: str) -> str:
    """Digest of what decides an outcome beside the run: the judge's sources and the scene's checks."""
    return hashlib.sha256(_sources() + repr(hard_scene(name)[1]).encode()).hexdigest()[:12]


@cache
def _sources() -> bytes:
    """Sources of the judge and of the play."""
    paths = [Path(outcomes.__file__), Path(figures.__file__), Path(play.__file__)]
    return b"".join(path.read_bytes() for path in sorted(paths))


def _rows(base: Row, played: Played) -> Iterator[Row]:
    family, level = hard_names()[base.scenario]
    one = played.outcome
    yield replace(base, metric=OUTCOME, value=level, unit=family.unit, subject=one.name, reason=one.reason)
    yield replace(base, metric=UNDER, subject=one.under)
    yield replace(base, metric=COMMAND, reason=played.line)
    yield replace(base, metric=HASH, reason=played.state_hash)
    for name, value in one.figures.items():
        yield replace(base, metric=FIGURE, subject=name, value=value)


def _played(cell: Cell, rows: pd.DataFrame) -> Played:
    """Outcome of a cell from its rows in the store; a cell that ended its process has one row."""
    by_metric = {row["metric"]: row for row in rows.to_dict("records")}
    if OUTCOME not in by_metric:
        reason = str(rows.reason.iloc[0])
        return Played(Outcome("slow" if reason.startswith("hung") else "error", reason), cell.line)
    figures = rows[rows.metric == FIGURE]
    outcome_row = by_metric[OUTCOME]
    return Played(
        Outcome(
            str(outcome_row["subject"]),
            str(outcome_row["reason"]),
            str(by_metric[UNDER]["subject"]),
            dict(zip(figures.subject, figures.value.astype(float))),
        ),
        str(by_metric[COMMAND]["reason"]),
        float(by_metric["seconds"]["value"]),
        str(by_metric[HASH]["reason"]),
    )

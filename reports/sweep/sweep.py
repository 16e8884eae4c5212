"""Run a sweep: skip the cells that a store holds, play the others, append each batch as it ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

import pandas as pd

from touchstone.reports.cli.progress import Progress
from touchstone.reports.sweep.batch_pool import BatchPool
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.content_hash import hash_of
from touchstone.reports.sweep.store import Done, Store


class Executor(Protocol):
    """Plays cells somewhere: `BatchPool`, `DaskPool` or `TimingRounds`."""

    def play(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        """Play all cells; yields batches in the order in which they end."""


def quietly(label: str, cells: int) -> None:
    """No progress."""


def sweep(
    cells: Iterable[Cell],
    folder: Path,
    *,
    jobs: int | None = None,
    executor: Callable[[Path], Executor] | None = None,
    progress: Progress = quietly,
    series: bool = False,
) -> pd.DataFrame:
    """Measure all cells that the store in `folder` does not hold yet.

    Args:
        jobs: processes (default: one per core).
        executor: made from the folder of the processes' output; default: a pool of `jobs` processes.
        progress: receives the label of a cell and how many cells just ended.
        series: with the column of series (`measures.Measured`).
    Returns:
        Rows of all cells, in the cells' order; column `cell` holds the content hash.
    Raises:
        StoreError: the store is damaged, of another version, or cannot be written; what it holds is kept.
    """
    wanted = {hash_of(cell): cell for cell in cells}
    with Store(folder).opened() as store:
        finished = store.finished()
        left = [cell for key, cell in wanted.items() if key not in finished]
        if len(left) < len(wanted):
            progress("finished before", len(wanted) - len(left))
        if left:
            output = folder / "output"
            output.mkdir(exist_ok=True)
            player = executor(output) if executor else BatchPool(jobs or os.cpu_count() or 1, output)
            for batch in player.play(left):
                store.append(batch)
                for done in batch:
                    progress(done.cell.label, 1)
        frame = store.table(series=series)
    frame = frame[frame.cell.isin(wanted.keys())]
    order = {key: k for k, key in enumerate(wanted)}
    return frame.sort_values("cell", key=lambda cells: cells.map(order), kind="stable", ignore_index=True)

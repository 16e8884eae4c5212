"""Run a sweep: skip the cells that a store holds, play the others, append them as they end."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from time import monotonic

import pandas as pd

from touchstone.reports.progress import Progress, quietly
from touchstone.reports.runner.cells import TIMING, Cell
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.executors import Executor, InPool, InTurns
from touchstone.reports.runner.store import Done, Store

GROUP_SECONDS = 0.5
"""Time after which the cells that ended are appended to the store [s]: what a kill loses."""


def sweep_timed(
    cells: Iterable[Cell], folder: Path, rounds: int, *, jobs: int | None = None, progress: Progress = quietly
) -> pd.DataFrame:
    """Measure all cells, then time those that ended well: alone on one core, interleaved, in `rounds` rounds.

    Returns:
        The rows of `sweep`, and those of the timing cells, whose column `measure` is TIMING.
    """
    asked = list(cells)
    accuracy = sweep(asked, folder, jobs=jobs, progress=progress)
    ended = set(accuracy[(accuracy.metric == "run") & (accuracy.outcome == "done")].cell)
    timed = [
        replace(cell, measure=TIMING, repeat=repeat)
        for repeat in range(rounds)
        for cell in dict.fromkeys(replace(cell, repeat=0) for cell in asked if hash_of(cell) in ended)
    ]
    if len(timed) < rounds * len(asked):
        progress("not timed: the run did not end", rounds * len(asked) - len(timed))
    timing = sweep(timed, folder, executor=InTurns, progress=progress)
    return pd.concat([accuracy, timing], ignore_index=True)


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
            player = executor(output) if executor else InPool(jobs or os.cpu_count() or 1, output)
            group: list[Done] = []
            since = monotonic()
            for done in player.play(left):
                progress(done.cell.label, 1)
                group.append(done)
                if monotonic() - since > GROUP_SECONDS:
                    store.append(group)
                    group, since = [], monotonic()
            store.append(group)
        frame = store.table(series=series)
    frame = frame[frame.cell.isin(wanted.keys())]
    order = {key: k for k, key in enumerate(wanted)}
    return frame.sort_values("cell", key=lambda cells: cells.map(order), kind="stable", ignore_index=True)

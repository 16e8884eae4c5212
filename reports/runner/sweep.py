"""Run a sweep: skip the cells that a store holds, play the others, append each batch as it ends.

Executor of timing cells: one at a time, on one core, engines interleaved, all processes new in each round.

The rules are those of `docs/fairness.md`: nothing else of this program runs meanwhile, each round draws its
own order, and the spread over rounds is what a second run would show.
"""

from __future__ import annotations

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Protocol

import numpy as np
import pandas as pd

from touchstone.adapters.registry import load, packages_of
from touchstone.adapters.workers.pool import Pool, Slot
from touchstone.reports.cli.progress import Progress
from touchstone.reports.runner.cells import TIMING, Cell
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.store import Done, Store
from touchstone.reports.runner.worker import PATIENCE, Loader, Worker, played_batch

GROUP = 8
"""Cells that are appended to the store together: what a kill loses, some two seconds."""


class TimingRounds:
    """Plays cells of one repeat after those of another; each round starts new processes, one per engine.

    Args:
        output: folder of the processes' output.
        seed: of the order.
    """

    def __init__(
        self, output: Path, seed: int = 0, loader: Loader = load, patience: float = PATIENCE
    ) -> None:
        self._output, self._seed, self._loader, self._patience = output, seed, loader, patience
        self._core = max(os.sched_getaffinity(0))

    def play(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        """Play all cells; yields groups in the order in which they end."""
        rng = np.random.default_rng(self._seed)
        for repeat in sorted({cell.repeat for cell in cells}):
            mine = [cell for cell in cells if cell.repeat == repeat]
            drawn = [mine[k] for k in rng.permutation(len(mine))]
            yield from self._round(drawn)

    def _round(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        slots = {cell.engine: self._slot(cell.engine) for cell in cells}
        try:
            for cell in {cell.engine: cell for cell in cells}.values():
                slots[cell.engine].child().begin([cell])
            done: list[Done] = []
            for cell in cells:
                for found in played_batch(slots[cell.engine], [cell]):
                    done += found
                if len(done) >= GROUP:
                    yield done
                    done = []
            if done:
                yield done
        finally:
            for slot in slots.values():
                slot.stop()

    def _slot(self, engine: str) -> Slot[Worker]:
        output = self._output / f"timing-{engine}.txt"
        return Slot(lambda: Worker(output, self._loader, self._patience, self._core))


BATCH_SECONDS, BATCH_MOST = 0.5, 100
"""Duration of a batch that is aimed at [s], and the largest number of its cells: what a kill loses."""


class BatchPool:
    """Processes that share a list of cells. A cell that kills its process or hangs costs a row and a restart.

    Args:
        output: folder of the processes' output.
        patience: time of one cell after which it counts as hung [s].
    """

    def __init__(self, jobs: int, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        self._jobs, self._output, self._loader, self._patience = jobs, output, loader, patience
        self._lock = threading.Lock()
        self._spent, self._played = 0.0, 0

    def play(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        """Play all cells; yields batches in the order in which they end."""
        pool = Pool(self._start, min(self._jobs, len(cells)), self._output)
        return pool.each(self._batches(cells), self._timed)

    def _start(self, file: Path) -> Worker:
        return Worker(file, self._loader, self._patience)

    def _batches(self, cells: Sequence[Cell]) -> Iterator[list[Cell]]:
        """The cells, as many at a time as last about BATCH_SECONDS."""
        left = deque(cells)
        while left:
            with self._lock:
                size = int(BATCH_SECONDS * self._played / self._spent) if self._played else 1
            share = -(-len(left) // self._jobs)
            size = max(1, min(size, share, BATCH_MOST))
            batch = [left.popleft()]
            while left and len(batch) < size and packages_of(left[0].engine) == packages_of(batch[0].engine):
                batch.append(left.popleft())
            yield batch

    def _timed(self, slot: Slot[Worker], batch: list[Cell]) -> Iterator[list[Done]]:
        start = perf_counter()
        yield from played_batch(slot, batch)
        with self._lock:
            self._spent += perf_counter() - start
            self._played += len(batch)


class Executor(Protocol):
    """Plays cells somewhere: `BatchPool`, `DaskPool` or `TimingRounds`."""

    def play(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        """Play all cells; yields batches in the order in which they end."""


def quietly(label: str, cells: int) -> None:
    """No progress."""


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
    timing = sweep(timed, folder, executor=TimingRounds, progress=progress)
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
            player = executor(output) if executor else BatchPool(jobs or os.cpu_count() or 1, output)
            for batch in player.play(left):
                store.append(batch)
                for done in batch:
                    progress(done.cell.label, 1)
        frame = store.table(series=series)
    frame = frame[frame.cell.isin(wanted.keys())]
    order = {key: k for k, key in enumerate(wanted)}
    return frame.sort_values("cell", key=lambda cells: cells.map(order), kind="stable", ignore_index=True)

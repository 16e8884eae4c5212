"""Executor of cells in parallel processes, in batches that grow for tiny cells."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter

from touchstone.adapters.registry import load, packages_of
from touchstone.adapters.workers.pool import Pool, Slot
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.store import Done
from touchstone.reports.sweep.worker import PATIENCE, Loader, Worker, played_batch

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

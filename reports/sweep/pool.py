"""Pool of spawned processes that play cells in parallel, in batches that grow for tiny cells."""

from __future__ import annotations

import queue
import threading
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path
from time import perf_counter

from touchstone.adapters.registry import load
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.store import Done
from touchstone.reports.sweep.worker import PATIENCE, Loader, Worker, failed

BATCH_SECONDS, BATCH_MOST = 0.5, 100
"""Duration of a batch that is aimed at [s], and the largest number of its cells: what a kill loses."""


class Pool:
    """Processes that share a list of cells. A cell that kills its process or hangs costs a row and a restart.

    Args:
        output: folder of the processes' output.
        patience: time of one cell after which it counts as hung [s].
    """

    def __init__(self, jobs: int, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        self._jobs, self._output, self._loader, self._patience = jobs, output, loader, patience
        self._left: deque[Cell] = deque()
        self._lock = threading.Lock()
        self._spent, self._played = 0.0, 0
        self._workers: dict[int, Worker] = {}
        self._stopped = False

    def play(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        """Play all cells; yields batches in the order in which they end."""
        self._left.extend(cells)
        ended: queue.SimpleQueue[list[Done] | BaseException | None] = queue.SimpleQueue()
        count = min(self._jobs, len(cells))
        threads = [threading.Thread(target=self._serve, args=(k, ended), daemon=True) for k in range(count)]
        try:
            for thread in threads:
                thread.start()
            while count:
                found = ended.get()
                if isinstance(found, BaseException):
                    raise found
                if found is None:
                    count -= 1
                else:
                    yield found
        finally:
            self._stopped = True
            for worker in list(self._workers.values()):
                worker.stop()

    def _serve(self, number: int, ended: queue.SimpleQueue[list[Done] | BaseException | None]) -> None:
        """Thread of one process: play batches until none is left."""
        try:
            while batch := self._take():
                start = perf_counter()
                for found in self._played_batch(number, batch):
                    ended.put(found)
                with self._lock:
                    self._spent += perf_counter() - start
                    self._played += len(batch)
            ended.put(None)
        except BaseException as error:
            ended.put(error)

    def _take(self) -> list[Cell]:
        """Next cells, as many as last about BATCH_SECONDS."""
        with self._lock:
            if self._stopped:
                return []
            share = -(-len(self._left) // self._jobs)
            size = int(BATCH_SECONDS * self._played / self._spent) if self._played else 1
            size = max(1, min(size, share, BATCH_MOST))
            return [self._left.popleft() for _ in range(min(size, len(self._left)))]

    def _played_batch(self, number: int, batch: list[Cell]) -> Iterator[list[Done]]:
        """Play a batch; if the process dies, play its cells one by one to find which of them it was."""
        found = self._worker(number).play(batch)
        if found is not None:
            yield found
        elif len(batch) > 1:
            for cell in batch:
                yield from self._played_batch(number, [cell])
        elif not self._stopped:
            worker = self._workers[number]
            yield [failed(batch[0], worker.outcome, worker.failure[1] if worker.failure else "")]

    def _worker(self, number: int) -> Worker:
        """Process of a thread; a new one if it has failed."""
        worker = self._workers.get(number)
        if worker is None or worker.failure is not None:
            output = self._output / f"worker-{number}.txt"
            worker = self._workers[number] = Worker(output, self._loader, self._patience)
        return worker

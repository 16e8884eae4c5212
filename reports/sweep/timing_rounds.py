"""Executor of timing cells: one at a time, on one core, engines interleaved, all processes new in each round.

The rules are those of `docs/fairness.md`: nothing else of this program runs meanwhile, each round draws its
own order, and the spread over rounds is what a second run would show.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from touchstone.adapters.registry import load
from touchstone.adapters.workers.pool import Slot
from touchstone.reports.sweep.cells import Cell
from touchstone.reports.sweep.store import Done
from touchstone.reports.sweep.worker import PATIENCE, Loader, Worker, played_batch

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

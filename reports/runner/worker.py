"""Work of a process that plays cells: engines, loaded once, and a row for whatever ends a cell."""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from time import perf_counter

from touchstone.adapters.contract import MISSING, AdapterError, Engine
from touchstone.adapters.recorder import warm_up
from touchstone.adapters.registry import installed, load, missing_reason, packages_of
from touchstone.adapters.workers.pool import Slot
from touchstone.adapters.workers.process import ChildProcess, failure_of
from touchstone.reports.machine import machine
from touchstone.reports.runner.cells import Cell, named, scene_of
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.measures import Measured, base_row
from touchstone.reports.runner.store import Done

Loader = Callable[[str], Engine]
PATIENCE = 300.0
"""Time of one cell after which it counts as hung [s]; a cold compilation takes about 65."""
START_PATIENCE = 300.0
"""Time for the start of a process, with its imports [s]."""
DIVERGED, HANG, CRASH = "diverged", "hang", "crash"
"""Outcomes of cells that did not end, beside those of `AdapterError.status`."""


@cache
def _processor() -> str:
    return machine()["processor"]


_engines: dict[tuple[Loader, str], Engine] = {}


def play(cells: Sequence[Cell], loader: Loader = load) -> list[Done]:
    """Play cells in this process; one that fails is a row with its outcome and reason."""
    return [play_one(cell, loader) for cell in cells]


def play_one(cell: Cell, loader: Loader = load) -> Done:
    """Play one cell in this process."""
    start = perf_counter()
    try:
        if loader is load and not installed(cell.engine):
            return failed(cell, MISSING, missing_reason(cell.engine))
        scenario = scene_of(cell.source, cell.scenario, cell.seed)
        key = loader, cell.engine
        engine = _engines.get(key) or loader(cell.engine)
        if key not in _engines:
            # Compiled code is loaded only now. What the engine refuses is for the measure to say.
            with suppress(AdapterError):
                warm_up(engine, scenario, cell.settings)
                _engines[key] = engine
        found: Measured = named(cell.measure)(cell, scenario, engine)
    except Exception as error:
        status, reason = failure_of(error)
        return failed(cell, DIVERGED if reason.startswith(DIVERGED) else status, reason)
    series = {metric: array.tolist() for metric, array in found.series.items()}
    seconds = replace(base_row(cell), metric="seconds", value=perf_counter() - start, unit="s")
    return Done(cell, hash_of(cell), (*found.rows, seconds), series=series, machine=_processor())


def failed(cell: Cell, outcome: str, reason: str) -> Done:
    """A cell that was not measured; verdicts as in `results.VERDICTS`."""
    verdict = "error" if outcome in (DIVERGED, HANG, CRASH) else outcome
    row = replace(base_row(cell), verdict=verdict, reason=reason)
    return Done(cell, hash_of(cell), (row,), outcome, machine=_processor())


class Worker(ChildProcess):
    """Parent's end of a process that plays cells; `core` pins it to a processor core."""

    def __init__(
        self, output: Path, loader: Loader = load, patience: float = PATIENCE, core: int | None = None
    ) -> None:
        super().__init__(_Server, (loader, core), output, START_PATIENCE)
        self._cell_patience, self._begun, self._started = patience, False, False

    def begin(self, cells: Sequence[Cell]) -> None:
        """Import all that the first cell needs, without waiting: several processes can start in parallel."""
        self.turn_to(packages_of(cells[0].engine))
        self.send("start", list(cells))
        self._begun = True

    def play(self, cells: Sequence[Cell]) -> list[Done] | None:
        """Play cells of engines of one environment; None if the process failed (`failure`)."""
        if not self._begun:
            self.begin(cells)
        if not self._started:
            self.receive()
            self._patience, self._started = self._cell_patience, True
        self.turn_to(packages_of(cells[0].engine))
        found: list[Done] | None = self.ask("play", list(cells))
        return found

    @property
    def outcome(self) -> str:
        """Outcome of the cell that ended the process."""
        reason = self.failure[1] if self.failure else ""
        return HANG if reason.startswith("hung") else CRASH


def played_batch(slot: Slot[Worker], batch: list[Cell]) -> Iterator[list[Done]]:
    """Play a batch; if the process dies, play its cells one by one to find which of them it was."""
    worker = slot.child()
    found = worker.play(batch)
    if found is not None:
        yield found
    elif len(batch) > 1:
        for cell in batch:
            yield from played_batch(slot, [cell])
    else:
        yield [failed(batch[0], worker.outcome, worker.failure[1] if worker.failure else "")]


class _Server:
    """Child's end."""

    def __init__(self, loader: Loader, core: int | None) -> None:
        self._loader, self._core = loader, core

    def handle(self, command: str, cells: Sequence[Cell]) -> list[Done]:
        """Play a batch of cells, or import all that the first of them needs (`start`)."""
        if command == "start":
            hash_of(cells[0])
            gc.freeze()
            return []
        if self._core is not None:
            os.sched_setaffinity(0, {self._core})
        return play(cells, self._loader)

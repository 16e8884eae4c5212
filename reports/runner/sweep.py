"""Run a sweep: skip the cells that a store holds, play the others, append them as they end.

Executors of cells are a pool of processes, turns of one process per engine for timing, Dask and Slurm.

A cell that kills its process or hangs costs a row and a restart. The rules of timing are those of
`docs/fairness.md`: nothing else of this program runs meanwhile, each round draws its own order, and the
spread over rounds is what a second run would show. Workers of a cluster must be able to import touchstone.
"""

from __future__ import annotations

import contextlib
import os
import shlex
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from time import monotonic, perf_counter
from typing import Any, Protocol

import numpy as np
import pandas as pd

from touchstone.adapters.contract import AdapterError, Engine
from touchstone.adapters.recorder import warm_up
from touchstone.adapters.registry import load
from touchstone.adapters.workers.pool import (
    CRASH,
    HANG,
    Ended,
    EngineProcess,
    EngineServer,
    Loader,
    Slot,
    played_in_pool,
)
from touchstone.adapters.workers.process import last_core, main_left_out, one_thread
from touchstone.reports.machine import machine
from touchstone.reports.progress import Progress, quietly
from touchstone.reports.runner.cells import TIMING, Cell, named, scene_of
from touchstone.reports.runner.content_hash import hash_of
from touchstone.reports.runner.measures import Measured, base_row
from touchstone.reports.runner.store import Done, Store

PATIENCE = 300.0
"""Time of one cell after which it counts as hung [s]; a cold compilation takes about 65."""
DIVERGED = "diverged"
"""Outcome of cells that did not end, beside HANG, CRASH and those of `AdapterError.status`."""

_warm: set[str] = set()
"""Engines whose compiled code this process has loaded."""


class Executor(Protocol):
    """Plays cells somewhere."""

    def play(self, cells: Sequence[Cell]) -> Iterator[Done]:
        """Play all cells; yields them in the order in which they end."""


def play_cell(engine: Engine, cell: Cell) -> Done:
    """Play one cell in this process."""
    start = perf_counter()
    scenario = scene_of(cell.source, cell.scenario, cell.seed)
    if cell.engine not in _warm:
        # What the engine refuses is for the measure to say.
        with suppress(AdapterError):
            warm_up(engine, scenario, cell.settings)
            _warm.add(cell.engine)
    found: Measured = named(cell.measure)(cell, scenario, engine)
    series = {metric: array.tolist() for metric, array in found.series.items()}
    seconds = replace(base_row(cell), metric="seconds", value=perf_counter() - start, unit="s")
    return Done(cell, (*found.rows, seconds), series=series, machine=machine()["processor"])


def finished(cell: Cell, found: Done | Ended) -> Done:
    """The result of a cell; one that was not measured is a row with its reason and a verdict of
    `results.VERDICTS`."""
    if isinstance(found, Done):
        return found
    diverged = found.reason.startswith(DIVERGED)
    row = replace(base_row(cell), verdict=found.status, reason=found.reason)
    outcome = found.process or (DIVERGED if diverged else found.status)
    return Done(cell, (row,), outcome, machine=machine()["processor"])


class InPool:
    """Processes that share a list of cells.

    Args:
        output: folder of the processes' output.
        patience: time of one cell after which it counts as hung [s].
    """

    def __init__(self, jobs: int, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        self._played = partial(
            played_in_pool, folder=output, processes=jobs, loader=loader, patience=patience
        )

    def play(self, cells: Sequence[Cell]) -> Iterator[Done]:
        """Play all cells; yields them in the order in which they end."""
        for number, found in self._played(play_cell, cells):
            yield finished(cells[number], found)


class InTurns:
    """Plays one cell at a time, on one core, engines interleaved. Each repeat is a round of its own, in an
    order that the seed draws, by new processes, one per engine.

    Args:
        output: folder of the processes' output.
        seed: of the order.
    """

    def __init__(
        self, output: Path, seed: int = 0, loader: Loader = load, patience: float = PATIENCE
    ) -> None:
        self._output, self._seed, self._loader, self._patience = output, seed, loader, patience

    def play(self, cells: Sequence[Cell]) -> Iterator[Done]:
        """Play all cells; yields them in the order in which they end."""
        rng = np.random.default_rng(self._seed)
        for repeat in sorted({cell.repeat for cell in cells}):
            mine = [cell for cell in cells if cell.repeat == repeat]
            yield from self._round([mine[k] for k in rng.permutation(len(mine))])

    def _round(self, cells: Sequence[Cell]) -> Iterator[Done]:
        slots = {cell.engine: Slot(partial(self._start, cell.engine)) for cell in cells}
        try:
            firsts = {cell.engine: cell for cell in reversed(cells)}
            children = [slots[engine].child() for engine in firsts]
            for child, cell in zip(children, firsts.values()):
                child.send("load", cell)
            for child in children:
                child.receive()
            for cell in cells:
                yield finished(cell, slots[cell.engine].child().ask("play", cell))
        finally:
            for slot in slots.values():
                slot.stop()

    def _start(self, engine: str) -> EngineProcess:
        output = self._output / f"timing-{engine}.txt"
        return EngineProcess(play_cell, output, self._loader, self._patience, last_core())


LOCAL = "local"
"""Address that stands for a cluster on this machine."""
CONNECT_SECONDS = 10
"""Time after which a scheduler counts as unreachable [s]."""
TASKS_PER_WORKER, BATCH_MOST = 50, 20
"""Least number of tasks of a worker before cells share a task, and the largest number that share one."""


TRIES = 3
"""How often a cell is played whose worker dies: Dask blames all tasks that the worker held."""


class ClusterError(Exception):
    """The cluster cannot be used; the message says why, in one line."""


@cache
def _server(loader: Loader) -> EngineServer:
    return EngineServer(play_cell, loader)


def _play_batch(cells: Sequence[Cell], loader: Loader) -> list[Done]:
    return [finished(cell, _server(loader).handle("play", cell)) for cell in cells]  # type: ignore[arg-type]


class DaskPool:
    """Plays cells on the workers of a Dask cluster.

    Args:
        address: of the scheduler, such as tcp://host:8786; or LOCAL.
        jobs: workers of a LOCAL cluster.
        output: unused; workers keep their own logs.
        patience: time without any finished task after which those that run count as hung [s].
    """

    def __init__(
        self, address: str, jobs: int, output: Path, loader: Loader = load, patience: float = PATIENCE
    ) -> None:
        self._address, self._jobs, self._loader, self._patience = address, jobs, loader, patience

    def play(self, cells: Sequence[Cell]) -> Iterator[Done]:
        """Play all cells; yields them in the order in which they end.

        Raises:
            ClusterError: the scheduler cannot be reached, or distributed is not installed.
        """
        try:
            import distributed
        except ImportError as error:
            raise ClusterError("--dask: not installed (pip install dask distributed)") from error
        with contextlib.ExitStack() as stack:
            client = stack.enter_context(self._client(distributed, stack))
            workers = max(1, len(client.scheduler_info()["workers"]))
            size = max(1, min(BATCH_MOST, len(cells) // (TASKS_PER_WORKER * workers)))
            batches = [list(cells[k : k + size]) for k in range(0, len(cells), size)]
            yield from self._collected(distributed, client, batches)

    def _client(self, distributed: Any, stack: contextlib.ExitStack) -> Any:
        address: Any = self._address
        if address == LOCAL:
            import dask

            stack.enter_context(dask.config.set({"distributed.scheduler.allowed-failures": 0}))
            with main_left_out(), one_thread():
                address = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=self._jobs, threads_per_worker=1, dashboard_address=None, silence_logs=50
                    )
                )
        try:
            return distributed.Client(address, timeout=CONNECT_SECONDS)
        except (OSError, ValueError, TypeError) as error:
            reason = str(error).partition("\n")[0][:120]
            raise ClusterError(f"--dask {self._address}: cannot be reached ({reason})") from error

    def _collected(self, distributed: Any, client: Any, batches: Sequence[list[Cell]]) -> Iterator[Done]:
        """Results of all batches; one that failed is played again cell by cell."""
        pending = {self._submitted(client, batch): batch for batch in batches}
        tries: Counter[Cell] = Counter()
        while pending:
            try:
                ended = distributed.wait(list(pending), self._patience, "FIRST_COMPLETED").done
            except TimeoutError:
                ended = self._hung(client, pending)
                for future in ended:
                    future.cancel(force=True)
                    hung = Ended("error", f"no answer for {self._patience:g} s", HANG)
                    yield from (finished(cell, hung) for cell in pending.pop(future))
                continue
            for future in ended:
                batch = pending.pop(future)
                error = future.exception()
                if error is None:
                    yield from future.result()
                elif len(batch) > 1 or tries[batch[0]] + 1 < TRIES:
                    tries.update(batch if len(batch) == 1 else ())
                    pending |= {self._submitted(client, [cell]): [cell] for cell in batch}
                else:
                    reason = f"{type(error).__name__}: {error}".partition("\n")[0][:200]
                    yield finished(batch[0], Ended("error", reason, CRASH))

    def _submitted(self, client: Any, batch: list[Cell]) -> Any:
        return client.submit(_play_batch, batch, self._loader, pure=False, retries=0)

    @staticmethod
    def _hung(client: Any, pending: dict[Any, list[Cell]]) -> list[Any]:
        """Futures that a worker has, or all if none says so."""
        running = {key for keys in client.processing().values() for key in keys}
        return [future for future in pending if future.key in running] or list(pending)


TASKS_MOST = 64
"""Largest number of tasks of an array."""
SCRIPT = """\
#!/bin/bash
# {cells} cells in {tasks} tasks; finished cells are skipped, so the job may be sent again.
#SBATCH --job-name=touchstone-sweep
#SBATCH --array=0-{last}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task=1
#SBATCH --output=touchstone-sweep-%A_%a.txt
set -euo pipefail
exec {command} --jobs 1 --quiet --part "$SLURM_ARRAY_TASK_ID/{tasks}"
"""


class PartError(ValueError):
    """A part that is none; the message says what is valid."""


def script(arguments: Sequence[str], cells: int) -> str:
    """Text of the script.

    Args:
        arguments: of `touchstone sweep`, without those of the script itself.
        cells: number of cells of the sweep.
    """
    tasks = max(1, min(cells, TASKS_MOST))
    command = shlex.join(["touchstone", "sweep", *arguments])
    return SCRIPT.format(cells=cells, tasks=tasks, last=tasks - 1, command=command)


def part_of(cells: Sequence[Cell], text: str) -> list[Cell]:
    """Every n-th cell from the k-th on, for "k/n"; raises PartError."""
    try:
        number, _, count = text.partition("/")
        k, n = (int(number), int(count)) if text.isascii() else (-1, 0)
    except ValueError:
        k, n = -1, 0
    if not 0 <= k < n:
        raise PartError(f"--part {text}: expected K/N with K from 0 to N - 1")
    return list(cells[k::n])


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

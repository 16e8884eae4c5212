"""Sweeps on clusters: by Dask, or by an array job of Slurm.

Executor on a Dask cluster: an existing one, or one on this machine (extra `dask`).

The cluster's workers must be able to import touchstone. A cell that kills its worker, or hangs, costs a row.
"""

from __future__ import annotations

import contextlib
import shlex
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from touchstone.adapters.registry import load
from touchstone.adapters.workers.process import main_left_out, one_thread
from touchstone.reports.runner.cells import Cell
from touchstone.reports.runner.store import Done
from touchstone.reports.runner.worker import CRASH, HANG, PATIENCE, Loader, failed, play

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

    def play(self, cells: Sequence[Cell]) -> Iterator[list[Done]]:
        """Play all cells; yields batches in the order in which they end.

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
                        n_workers=self._jobs,
                        threads_per_worker=1,
                        dashboard_address=None,
                        silence_logs=50,
                    )
                )
        try:
            return distributed.Client(address, timeout=CONNECT_SECONDS)
        except (OSError, ValueError, TypeError) as error:
            reason = str(error).partition("\n")[0][:120]
            raise ClusterError(f"--dask {self._address}: cannot be reached ({reason})") from error

    def _collected(
        self, distributed: Any, client: Any, batches: Sequence[list[Cell]]
    ) -> Iterator[list[Done]]:
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
                    yield [
                        failed(cell, HANG, f"no answer for {self._patience:g} s")
                        for cell in pending.pop(future)
                    ]
                continue
            for future in ended:
                batch = pending.pop(future)
                error = future.exception()
                if error is None:
                    yield future.result()
                elif len(batch) > 1 or tries[batch[0]] + 1 < TRIES:
                    tries.update(batch if len(batch) == 1 else ())
                    pending |= {self._submitted(client, [cell]): [cell] for cell in batch}
                else:
                    reason = f"{type(error).__name__}: {error}".partition("\n")[0][:200]
                    yield [failed(batch[0], CRASH, reason)]

    def _submitted(self, client: Any, batch: list[Cell]) -> Any:
        return client.submit(play, batch, self._loader, pure=False, retries=0)

    @staticmethod
    def _hung(client: Any, pending: dict[Any, list[Cell]]) -> list[Any]:
        """Futures that a worker has, or all if none says so."""
        running = {key for keys in client.processing().values() for key in keys}
        return [future for future in pending if future.key in running] or list(pending)


TASKS_MOST = 64
"""Largest number of tasks of an array."""


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
    return "\n".join(
        [
            "#!/bin/bash",
            f"# {cells} cells in {tasks} tasks; finished cells are skipped, so the job may be sent again.",
            "#SBATCH --job-name=touchstone-sweep",
            f"#SBATCH --array=0-{tasks - 1}",
            "#SBATCH --ntasks=1",
            "#SBATCH --cpus-per-task=1",
            "#SBATCH --output=touchstone-sweep-%A_%a.txt",
            "set -euo pipefail",
            f'exec {command} --jobs 1 --quiet --part "$SLURM_ARRAY_TASK_ID/{tasks}"',
            "",
        ]
    )


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

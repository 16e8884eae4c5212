"""One spawned child per detector, so that a crash is one row; its parent lets one of them be timed at a time.

A child's standard output and error go to a file of its own. Commands: `load`, `prepare` (pairs), `time`
(passes), `answers`. The first that fails ends the child; what it was and why stands in `failure`.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from adapters.detectors import Batch, Detector, Pair, load
from adapters.engine import AdapterError, Array

PATIENCE = 300.0
"""Seconds a child may take for one command before it counts as hung: a cold compilation takes about 40."""
CROSSINGS = 8
"""Queries of the crossing pair per pass: some, for the first of them pays for cold caches."""

Loader = Callable[[str], Detector]


class Times(NamedTuple):
    """Seconds per pass and query (p, n), and of the crossings per repeat, apart and touching
    (p * CROSSINGS, 2), zeros where a batch crosses once."""

    query: Array
    crossing: Array


class Child:
    """The parent's end of one child process."""

    def __init__(self, name: str, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        context = multiprocessing.get_context("spawn")
        self.name, self._patience = name, patience
        self.failure: tuple[str, str] | None = None
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, name, output, loader), daemon=True)
        self._process.start()
        theirs.close()

    def send(self, command: str, argument: object = None) -> None:
        """Send a command; several children may work at what is not timed."""
        if self.failure is None:
            self._command = command
            try:
                self._pipe.send((command, argument))
            except OSError:
                self._died()

    def receive(self) -> Any:
        """The answer to the last command; None where the child failed, now or before."""
        if self.failure is not None:
            return None
        try:
            if not self._pipe.poll(self._patience):
                self._fail("error", f"hung: no answer to '{self._command}' for {self._patience:g} s")
                return None
            status, answer = self._pipe.recv()
        except (EOFError, OSError):
            self._died()
            return None
        if status != "ok":
            self._fail(status, answer)
            return None
        return answer

    def ask(self, command: str, argument: object = None) -> Any:
        """Send a command and wait for its answer."""
        self.send(command, argument)
        return self.receive()

    def _died(self) -> None:
        self._process.join(5)
        code = self._process.exitcode
        end = f"signal {signal.Signals(-code).name}" if code is not None and code < 0 else f"exit code {code}"
        self._fail("error", f"died during '{self._command}': {end}")

    def _fail(self, status: str, reason: str) -> None:
        self.failure = (status, reason)
        self.stop()

    def stop(self) -> None:
        """End the process, by force if need be."""
        self._pipe.close()
        self._process.join(0.5)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


class _Server:
    """The child's end: a detector and its current batches."""

    def __init__(self, detector: Detector) -> None:
        self.detector = detector
        self.batch: Batch | None = None
        self.crossing: Batch | None = None

    def prepare(self, pairs: Sequence[Pair]) -> None:
        for batch in (self.batch, self.crossing):
            if batch is not None:
                batch.close()
        self.batch = self.detector.prepare(pairs)
        crossings = self.detector.crossings
        self.crossing = self.detector.prepare(crossings * CROSSINGS) if crossings else None

    def time(self, passes: int) -> Times:
        """Warm up, then time every query once a pass."""
        assert self.batch is not None
        self.batch.ask()
        query = np.array([self.batch.ask() for _ in range(passes)])
        if self.crossing is None:
            return Times(query, np.zeros((passes * CROSSINGS, 2)))
        self.crossing.ask()
        return Times(query, np.concatenate([self.crossing.ask().reshape(-1, 2) for _ in range(passes)]))


def _serve(pipe: Connection, name: str, output: Path, loader: Loader) -> None:
    """Obey commands until the pipe closes."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    _divert_output(output)
    server: _Server | None = None
    while True:
        try:
            command, argument = pipe.recv()
        except (EOFError, OSError):
            return
        answer: object = None
        try:
            match command:
                case "load":
                    server = _Server(loader(name))
                    answer = dict(server.detector.describe())
                case "prepare" if server:
                    server.prepare(argument)
                case "time" if server:
                    answer = server.time(argument)
                case "answers" if server and server.batch:
                    answer = server.batch.answers()
            pipe.send(("ok", answer))
        except ImportError as error:
            pipe.send(("skipped", f"cannot be imported: {error}".splitlines()[0]))
        except AdapterError as error:
            pipe.send(("error", str(error)))
        except Exception as error:
            import traceback

            traceback.print_exc()
            pipe.send(("error", f"{type(error).__name__}: {error}".splitlines()[0]))


def _divert_output(path: Path) -> None:
    """Send this process' standard output and error to a file, native code's included."""
    sys.stdout.flush()
    sys.stderr.flush()
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)

"""A spawned child process that obeys commands: the parent's end, and the child's.

A crash, a hang or an exception in the child ends in a failure with its reason, never in the parent. The
child's standard output and error, native code's included, go to a file of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

from touchstone.adapters.contract import UNIMPORTABLE, AdapterError

PATIENCE = 300.0
"""Seconds a child may take for one command before it counts as hung: a cold compilation takes about 40."""

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""What numpy's linear algebra looks at when it is loaded."""


@contextmanager
def interrupt_held() -> Iterator[None]:
    """Hold Ctrl-C back. Children that start meanwhile inherit this for good: it is the parent's to handle."""
    resource_tracker.ensure_running()  # starting it would let Ctrl-C through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let processes that start meanwhile do linear algebra on one thread each: on small matrices a second one
    waits busily, which costs four times the work and disturbs whoever is timed."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


@contextmanager
def main_left_out() -> Iterator[None]:
    """Keep processes that start meanwhile from importing the caller's main module: servers need nothing of
    it, and a script without a `__main__` guard would run again in each."""
    main = sys.modules["__main__"]
    before: dict[str, Any] = {
        name: vars(main)[name] for name in ("__file__", "__spec__") if name in vars(main)
    }
    main.__dict__.update(dict.fromkeys(before))
    try:
        yield
    finally:
        main.__dict__.update(before)


class Server(Protocol):
    """What obeys commands in a child."""

    def handle(self, command: str, argument: Any) -> object:
        """Obey one command; the answer goes back to the parent."""


class ChildProcess:
    """The parent's end. `failure` is None, or the status and the reason of the first command that failed."""

    def __init__(
        self, server: Callable[..., Server], arguments: tuple[Any, ...], output: Path, patience: float
    ) -> None:
        """Start a process in which `server(*arguments)` obeys (`obey`)."""
        context = multiprocessing.get_context("spawn")
        self.failure: tuple[str, str] | None = None
        self._patience = patience
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=obey, args=(theirs, output, server, arguments), daemon=True)
        with interrupt_held(), one_thread(), main_left_out():
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


def obey(pipe: Connection, output: Path, server: Callable[..., Server], arguments: tuple[Any, ...]) -> None:
    """The child's end: answer commands by `server(*arguments)` until the pipe closes."""
    divert_output(output)
    handle = server(*arguments).handle
    while True:
        try:
            command, argument = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            pipe.send(("ok", handle(command, argument)))
        except Exception as error:
            if not isinstance(error, AdapterError | ImportError):
                import traceback

                traceback.print_exc()
            pipe.send(failure_of(error))


def failure_of(error: Exception) -> tuple[str, str]:
    """The status and the reason, one line, of a command that raised."""
    if isinstance(error, AdapterError):
        return error.status, str(error)
    if isinstance(error, ImportError):
        return UNIMPORTABLE, f"cannot be imported: {error}".splitlines()[0]
    return "error", f"{type(error).__name__}: {error}".splitlines()[0]


def divert_output(path: Path) -> None:
    """Send this process' standard output and error, native code's included, to the end of a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)

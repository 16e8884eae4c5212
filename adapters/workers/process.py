"""Spawned child process that executes commands: the parent's end and the child's end.

A crash, a hang or an exception in the child gives a failure with its reason; it never affects the parent. The
child's standard output and error, including those of native code, go to a file.
"""

import multiprocessing
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path
from time import monotonic
from typing import Any, NoReturn, Protocol

from touchstone.adapters.contract import UNIMPORTABLE, AdapterError
from touchstone.adapters.engines.entry import ENGINES, Entry
from touchstone.adapters.workers.orphans import end_with_parent
from touchstone.adapters.workers.own_environment import found_first

PATIENCE = 120.0
"""Time for one command after which a child counts as hung [s]; children answer within ten seconds of play."""
COMPILE_PATIENCE = 900.0
"""The same for commands that may compile the reference [s]: 54 s on the machine of the measurements."""


def patience_of(engine: str) -> float:
    """Least time for which an answer is waited for where the engine may compile [s]; 0 if it does not."""
    return COMPILE_PATIENCE if engine in ENGINES and ENGINES[engine].compiles else 0.0


STARTED = "started"
"""First message of a child: its interpreter and the modules of its server are there."""

WAITING = 1.0
"""Interval at which a parent is notified that it still waits [s]."""

THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that numpy's linear algebra reads when it is loaded."""

STARTING = threading.Lock()
"""Held while a process starts: the environment and the main module are changed for it meanwhile."""

ENDING = (signal.SIGTERM, signal.SIGHUP)
"""Signals that end a run as Ctrl-C does, and that end a child at once."""


@contextmanager
def interrupt_held() -> Iterator[None]:
    """Hold back Ctrl-C, and signals that end a run as Ctrl-C does, until the end.

    Child processes that start meanwhile do not hear Ctrl-C: the parent handles it. Blocking holds back this
    thread alone, and another one (numpy's linear algebra has its own) may receive the signal, whose handler
    then runs in the main thread: handlers of Python only record it meanwhile.
    """
    resource_tracker.ensure_running()  # Its start would unblock Ctrl-C.
    held: list[int] = []
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, *ENDING)}
        handlers = {number: handler for number, handler in handlers.items() if callable(handler)}
    for number in handlers:
        signal.signal(number, lambda received, _: held.append(received))
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, *ENDING})
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
        for number in held[:1]:
            signal.raise_signal(number)


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit linear algebra to one thread in processes that start meanwhile.

    On small matrices a second thread busy-waits, which costs four times the work and disturbs timed
    processes.
    """
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
    """Prevent processes that start meanwhile from importing the caller's main module.

    Servers do not need it, and a script without a `__main__` guard would run again in each process.
    """
    main = sys.modules["__main__"]
    before: dict[str, Any] = {
        name: vars(main)[name] for name in ("__file__", "__spec__") if name in vars(main)
    }
    main.__dict__.update(dict.fromkeys(before))
    try:
        yield
    finally:
        main.__dict__.update(before)


def last_core() -> int | None:
    """The last processor that this process may use; None if there is no choice."""
    if not hasattr(os, "sched_getaffinity"):
        return None
    allowed = sorted(os.sched_getaffinity(0))
    return allowed[-1] if len(allowed) > 1 else None


def pin(core: int) -> None:
    """Run this process on one processor."""
    os.sched_setaffinity(0, {core})


def queued_seconds(pid: int | None) -> float:
    """Time in which a process was ready to run while others had the processors [s]; 0 where the system does
    not say."""
    with suppress(OSError, ValueError, IndexError):
        return int(Path(f"/proc/{pid}/schedstat").read_text("ascii").split()[1]) * 1e-9
    return 0.0


class Server(Protocol):
    """Handler of commands in a child process."""

    def handle(self, command: str, argument: Any) -> object:
        """Execute one command; the result is sent to the parent."""


class ChildProcess:
    """Parent's end. `failure` is None, or the status and the reason of the first command that failed; `hung`
    says that the failure was a missing answer."""

    def __init__(
        self,
        server: Callable[..., Server],
        arguments: tuple[Any, ...],
        output: Path,
        patience: float,
        packages: Path | None = None,
    ) -> None:
        """Start a process in which `server(*arguments)` executes commands (`obey`); it finds `packages`
        first."""
        self.failure: tuple[str, str] | None = None
        self.hung = False
        self._patience = patience
        self._called = output, server, arguments
        self._start(packages)

    def _start(self, packages: Path | None) -> None:
        context = multiprocessing.get_context("spawn")
        self._packages = packages
        self._up = False
        known, by_kernel = dict(ENGINES), threading.current_thread() is threading.main_thread()
        with STARTING, interrupt_held(), one_thread(), main_left_out(), found_first(packages):
            # a process that starts meanwhile and is forked would hold the child's end open beyond its death
            self._pipe, theirs = context.Pipe()
            self._process = context.Process(
                target=obey, args=(theirs, *self._called, known, by_kernel), daemon=True
            )
            self._process.start()
            theirs.close()

    def turn_to(self, packages: Path | None) -> None:
        """Replace the process by one that finds `packages` first, unless this one does."""
        if self.failure is None and packages != self._packages:
            self.stop()
            self._start(packages)

    def send(self, command: str, argument: object = None) -> None:
        """Send a command without waiting, so that several children can do untimed work in parallel."""
        if self.failure is None:
            self._command = command
            try:
                self._pipe.send((command, argument))
            except OSError:
                self._died()

    def receive(self, at_least: float = 0.0, waiting: Callable[[], None] | None = None) -> Any:
        """Wait for the answer to the last command, for the child's patience or `at_least` so long [s] once it
        has started; None if the child has failed. `waiting` is called every second meanwhile."""
        if self.failure is not None:
            return None
        patience = max(self._patience, at_least)
        try:
            if not self._up and self._answered(max(PATIENCE, patience), waiting):
                self._up = self._pipe.recv() == STARTED
            if not self._up or not self._answered(patience, waiting):
                self.hung = True
                self._fail("error", f"hung: no answer to '{self._command}' for {patience:g} s")
                return None
            status, answer = self._pipe.recv()
        except (EOFError, OSError):
            self._died()
            return None
        if status != "ok":
            self._fail(status, answer)
            return None
        return answer

    def _answered(self, patience: float, waiting: Callable[[], None] | None) -> bool:
        """Whether there is an answer within `patience` seconds, in which the child did not wait for a
        processor that others had."""
        begun, queued = monotonic(), queued_seconds(self._process.pid)
        while True:
            lost = max(0.0, queued_seconds(self._process.pid) - queued)
            left = max(0.0, begun + patience + lost - monotonic())
            if self._pipe.poll(left if waiting is None else min(WAITING, left)):
                return True
            if waiting is not None:
                waiting()
            if not left:
                return False

    def ask(self, command: str, argument: object = None) -> Any:
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
        """End the process; kill it if it does not exit."""
        self._pipe.close()
        self._process.join(0.5)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def obey(
    pipe: Connection,
    output: Path,
    server: Callable[..., Server],
    arguments: tuple[Any, ...],
    engines: dict[str, Entry],
    by_kernel: bool = False,
) -> None:
    """Child's end: execute commands by `server(*arguments)` until the pipe closes or the parent ends
    (`end_with_parent`).

    `engines` are those that the parent knows, plug-ins included.
    """
    ENGINES.update(engines)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, ENDING)
    if (parent := multiprocessing.parent_process()) is not None and parent.pid is not None:
        end_with_parent(parent.pid, by_kernel)
    divert_output(output)
    with suppress(OSError):  # a parent that is gone
        pipe.send(STARTED)
    handle = server(*arguments).handle
    while True:
        try:
            command, argument = pipe.recv()
        except (EOFError, OSError):
            _exit_at_once()
        try:
            pipe.send(("ok", handle(command, argument)))
        except Exception as error:
            if not isinstance(error, AdapterError | ImportError):
                traceback.print_exc()
            pipe.send(failure_of(error))


def _exit_at_once() -> NoReturn:
    """End this process without tearing down the interpreter, which takes 0.5 s with kernels loaded."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


def failure_of(error: Exception) -> tuple[str, str]:
    """Status and one-line reason for an exception of a command."""
    if isinstance(error, AdapterError):
        return error.status, "; ".join(str(error).splitlines())
    if isinstance(error, ImportError):
        return UNIMPORTABLE, f"cannot be imported: {error}".splitlines()[0]
    return "error", f"{type(error).__name__}: {error}".splitlines()[0] + _place(error)


def _place(error: Exception) -> str:
    """File and line of the last call in a plug-in that is not installed, in brackets; else empty."""
    ours, place = Path(__file__).resolve().parents[2], ""
    for frame, line in traceback.walk_tb(error.__traceback__):
        path = Path(frame.f_code.co_filename)
        installed = "site-packages" in path.parts or path.resolve().is_relative_to(ours)
        if path.is_file() and not installed:
            place = f" ({path.name}, line {line})"
    return place


def divert_output(path: Path) -> None:
    """Append this process's standard output and error, including those of native code, to a file."""
    sys.stdout.flush()
    sys.stderr.flush()
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
    os.dup2(file, 1)
    os.dup2(file, 2)
    os.close(file)

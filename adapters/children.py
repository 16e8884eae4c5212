"""One spawned child per run, so that a crash is one column; a token lets only one of them work at a time.

The parent sends a child one command, waits for its answer, and turns to the next child: engines play in
slices of `SLICE` frames, interleaved. A child's standard output and error go to a file of its own.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection
from pathlib import Path

from adapters.engine import AdapterError, Engine, Settings, Unsupported
from adapters.record import Player, warm_up
from adapters.registry import load
from scenarios.scenario import Scenario

SLICE = 30
"""Displayed frames per turn: half a second of the scene."""
PATIENCE = 300.0
"""Seconds a child may take for one command before it counts as hung: a cold compilation takes about 40."""

Loader = Callable[[str], Engine]
Progress = Callable[[str, int], None]
"""Called with what is being done and how many frames were just finished."""


@dataclass(frozen=True, slots=True)
class Job:
    """One engine, under one setting, on one scene; where the recording and the child's output go."""

    engine: str
    scenario: Scenario
    settings: Settings
    recording: Path
    output: Path


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended: `done`, `skipped` (unsupported) or `error`, with the reason of the last two."""

    job: Job
    status: str
    reason: str = ""


def play(
    jobs: Iterable[Job], progress: Progress, loader: Loader = load, patience: float = PATIENCE
) -> list[Outcome]:
    """Play all jobs of one scene, interleaved; one that fails does not stop the others.

    Raises OSError where a recording cannot be written: no engine is to blame for a full disk.
    """
    children: list[_Child] = []
    try:
        with _interrupt_held():
            for job in jobs:
                children.append(_Child(job, loader, patience))
        for command in ("build", "warm up", "start"):
            for child in children:
                if child.outcome is None:
                    progress(f"{child.label}: {command}", 0)
                    child.ask(command)
        frames = max((child.job.scenario.frame_count for child in children), default=0)
        for first in range(0, frames, SLICE):
            for child in children:
                count = min(SLICE, frames - first)
                if child.outcome is None:
                    progress(child.label, 0)
                    child.ask("play", count)
                progress(child.label, count)
        for child in children:
            if child.outcome is None:
                progress(f"{child.label}: save", 0)
                child.ask("save")
            if child.outcome and child.outcome.status == "unsaved":
                raise OSError(child.outcome.reason)
        return [child.outcome or Outcome(child.job, "done") for child in children]
    finally:
        for child in children:
            child.stop()


@contextmanager
def _interrupt_held() -> Iterator[None]:
    """Hold Ctrl-C back. Children that start meanwhile inherit this for good: it is the parent's to handle."""
    resource_tracker.ensure_running()  # starting it would let Ctrl-C through
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Child:
    """The parent's end of one child process."""

    def __init__(self, job: Job, loader: Loader, patience: float) -> None:
        context = multiprocessing.get_context("spawn")
        self.job, self._patience = job, patience
        self.outcome: Outcome | None = None
        self.label = f"{job.engine} {job.settings.profile}"
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, job, loader), daemon=True)
        self._process.start()
        theirs.close()

    def ask(self, command: str, count: int = 0) -> None:
        """Send a command and wait for its answer; sets `outcome` where it fails."""
        try:
            self._pipe.send((command, count))
            if not self._pipe.poll(self._patience):
                self._fail("error", f"hung: no answer to '{command}' for {self._patience:g} s")
                return
            status, reason = self._pipe.recv()
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._process.join(5)
            self._fail("error", f"died during '{command}': {_end_of(self._process.exitcode)}")
            return
        if status != "ok":
            self._fail(status, reason)

    def _fail(self, status: str, reason: str) -> None:
        self.outcome = Outcome(self.job, status, reason)
        self.stop()

    def stop(self) -> None:
        """End the process, by force if need be."""
        self._pipe.close()
        self._process.join(0.5)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()


def _end_of(exitcode: int | None) -> str:
    if exitcode is not None and exitcode < 0:
        return f"signal {signal.Signals(-exitcode).name}"
    return f"exit code {exitcode}"


def _serve(pipe: Connection, job: Job, loader: Loader) -> None:
    """The child's end: obey commands until the pipe closes."""
    _divert_output(job.output)
    engine: Engine | None = None
    player: Player | None = None
    while True:
        try:
            command, count = pipe.recv()
        except (EOFError, OSError):
            return
        try:
            match command:
                case "build":
                    engine = loader(job.engine)
                case "warm up" if engine:
                    warm_up(engine, job.scenario, job.settings)
                case "start" if engine:
                    player = Player(engine.build(job.scenario, job.settings), job.scenario, job.settings)
                case "play" if player:
                    player.play(count)
                case "save" if player:
                    recording = player.recording()
                    try:
                        recording.save(job.recording)
                    except OSError as error:
                        pipe.send(("unsaved", error.strerror or str(error)))
                        continue
            pipe.send(("ok", ""))
        except Unsupported as error:
            pipe.send(("skipped", str(error)))
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

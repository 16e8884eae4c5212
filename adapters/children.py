"""One spawned child per run, so that a crash is one column; a token lets only one of them work at a time.

The parent sends a child one command, waits for its answer, and turns to the next child: engines play in
slices of `SLICE` frames, interleaved. A child's standard output and error go to a file of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path

from adapters.engine import AdapterError, Engine, Settings
from adapters.process import PATIENCE, ChildProcess, interrupt_held, obey
from adapters.record import Player, warm_up
from adapters.registry import load
from scenarios.scenario import Scenario

SLICE = 30
"""Displayed frames per turn: half a second of the scene."""
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
        with interrupt_held():
            for job in jobs:
                children.append(_Child(job, loader, patience))
        for command in ("build", "warm up", "start"):
            for child in children:
                if child.failure is None:
                    progress(f"{child.label}: {command}", 0)
                    child.ask(command)
        frames = max((child.job.scenario.frame_count for child in children), default=0)
        for first in range(0, frames, SLICE):
            for child in children:
                count = min(SLICE, frames - first)
                if child.failure is None:
                    progress(child.label, 0)
                    child.ask("play", count)
                progress(child.label, count)
        for child in children:
            if child.failure is None:
                progress(f"{child.label}: save", 0)
                child.ask("save")
            if child.outcome.status == _NotSaved.status:
                raise OSError(child.outcome.reason)
        return [child.outcome for child in children]
    finally:
        for child in children:
            child.stop()


class _NotSaved(AdapterError):
    """A recording could not be written."""

    status = "unsaved"


class _Child(ChildProcess):
    """The parent's end of one run."""

    def __init__(self, job: Job, loader: Loader, patience: float) -> None:
        super().__init__(_serve, (job, loader), patience)
        self.job = job
        self.label = f"{job.engine} {job.settings.profile}"

    @property
    def outcome(self) -> Outcome:
        """How the run ended, or that it goes well so far."""
        return Outcome(self.job, *(self.failure or ("done",)))


def _serve(pipe: Connection, job: Job, loader: Loader) -> None:
    run = _Run(job, loader)
    obey(pipe, job.output, run.handle)


class _Run:
    """The child's end: an engine and the world it plays."""

    def __init__(self, job: Job, loader: Loader) -> None:
        self._job, self._loader = job, loader

    def handle(self, command: str, count: int) -> None:
        """Obey one command; they come in the order below."""
        job = self._job
        match command:
            case "build":
                self._engine = self._loader(job.engine)
            case "warm up":
                warm_up(self._engine, job.scenario, job.settings)
            case "start":
                world = self._engine.build(job.scenario, job.settings)
                self._player = Player(world, job.scenario, job.settings)
            case "play":
                self._player.play(count)
            case "save":
                recording = self._player.recording()
                try:
                    recording.save(job.recording)
                except OSError as error:
                    raise _NotSaved(error.strerror or str(error)) from error

"""One spawned child per engine and profile, so that a crash is one column; a token lets only one of them play
at a time.

The parent sends a child one command, waits for its answer, and turns to the next child: engines play in
slices of `SLICE` frames, interleaved. What is not timed (building, warming up, saving) all do together. A
child goes on from scene to scene, for starting it and importing its engine takes longer than most scenes; one
that failed is replaced. What it prints goes to the job's file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import AdapterError, Engine, Settings
from touchstone.adapters.recorder import ready, warm_up
from touchstone.adapters.registry import load
from touchstone.adapters.workers.process import (
    PATIENCE,
    ChildProcess,
    divert_output,
    failure_of,
    interrupt_held,
)
from touchstone.scenarios.scenario import Scenario

SLICE = 30
"""Displayed frames per turn: half a second of the scene."""
PART = 10.0
"""Seconds after which a child answers in the middle of a turn, and is asked to go on: it does not hang."""
Loader = Callable[[str], Engine]
Progress = Callable[[str, int], None]
"""Called with what is being done and how many frames were just finished."""


@dataclass(frozen=True, slots=True)
class Job:
    """One engine, under one setting, on one scene; where the recording and the child's output go.

    The rest of the scene is left out once the steps took longer than `budget` seconds.
    """

    engine: str
    scenario: Scenario
    settings: Settings
    recording: Path
    output: Path
    budget: float = inf


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job ended: `done`, `skipped` (unsupported), `missing`, `unimportable` or `error`, and why it did
    not end well. One that failed while it played leaves the recording of what it played before, unless its
    process died."""

    job: Job
    status: str
    reason: str = ""

    @property
    def recorded(self) -> bool:
        """Whether there is a recording, whole or until the run failed."""
        return self.job.recording.exists()


class Children:
    """The children of a run, per engine and profile; a context that ends them. `together`: all work at the
    same time, where nobody looks at their clocks."""

    def __init__(self, loader: Loader = load, patience: float = PATIENCE, together: bool = False) -> None:
        self._loader, self._patience, self._together = loader, patience, together
        self._kept: dict[tuple[str, str], _Child] = {}

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        for child in self._kept.values():
            child.stop()

    def play(self, jobs: Iterable[Job], progress: Progress) -> list[Outcome]:
        """Play all jobs of one scene, interleaved; one that fails does not stop the others.

        Raises OSError where a recording cannot be written: no engine is to blame for a full disk.
        """
        children: list[_Child] = []
        with interrupt_held():
            for job in jobs:
                children.append(self._child(job))
        turns = [children] if self._together else [[child] for child in children]
        for command in ("build", "warm up", "start"):
            _order(children, command, progress)
        frames = max((child.job.scenario.frame_count for child in children), default=0)
        for first in range(0, frames, SLICE):
            for turn in turns:
                _play(turn, min(SLICE, frames - first), progress)
        _order(children, "save", progress)
        for child in children:
            if child.outcome.status == _NotSaved.status:
                raise OSError(child.outcome.reason)
        return [child.outcome for child in children]

    def _child(self, job: Job) -> _Child:
        """The child of the job's column, started if there is none or no longer one."""
        key = (job.engine, job.settings.label)
        child = self._kept.get(key)
        if child is None or child.failure is not None:
            child = self._kept[key] = _Child(job, self._loader, self._patience)
        child.job = job
        return child


def _order(turn: list[_Child], command: str, progress: Progress) -> None:
    """Let the children of a turn obey a command."""
    for child in turn:
        if child.failure is None:
            progress(f"{child.label}: {command}", 0)
        child.send(command, child.job if command == "build" else None)
    for child in turn:
        child.receive()


def _play(turn: list[_Child], frames: int, progress: Progress) -> None:
    """Let the children of a turn play so many frames, in parts."""
    left = dict.fromkeys(turn, frames)
    while left:
        for child, count in left.items():
            progress(child.label, 0)
            child.send("play", count)
        # nothing is left to one that failed
        left = {child: count for child in left if (count := child.receive())}
    for child in turn:
        progress(child.label, frames)


class _NotSaved(AdapterError):
    """A recording could not be written."""

    status = "unsaved"


class _Child(ChildProcess):
    """The parent's end of one column."""

    def __init__(self, job: Job, loader: Loader, patience: float) -> None:
        super().__init__(_Run, (job.engine, loader), job.output, patience)
        self.job = job
        self.label = f"{job.engine} {job.settings.label}"

    @property
    def outcome(self) -> Outcome:
        """How the run ended, or that it goes well so far."""
        return Outcome(self.job, *(self.failure or ("done",)))


class _Run:
    """The child's end: an engine, loaded once, and the world it plays."""

    _engine: Engine | None = None

    def __init__(self, name: str, loader: Loader) -> None:
        self._name, self._loader = name, loader

    def handle(self, command: str, argument: Any) -> int:
        """Obey one command; they come in the order below, for each job anew. How many frames are left."""
        if command == "build":
            self._job: Job = argument
            divert_output(self._job.output)
            self._engine = self._engine or self._loader(self._name)
            return 0
        job, engine = self._job, self._engine
        assert engine is not None
        match command:
            case "warm up":
                warm_up(engine, job.scenario, job.settings)
            case "start":
                self._player = ready(engine, job.scenario, job.settings)
            case "play":
                if self._player.seconds_played < job.budget:
                    try:
                        return self._player.play(argument, min(PART, job.budget))
                    except Exception as error:
                        self._save(failure_of(error)[1])
                        raise
            case "save":
                self._save()
                self._player.world.close()
        return 0

    def _save(self, ended: str = "") -> None:
        """Save what was played; of a run that failed as far as its engine can still be asked."""
        try:
            recording = self._player.recording(ended)
        except Exception:
            if ended:
                return
            raise
        try:
            recording.save(self._job.recording)
        except OSError as error:
            raise _NotSaved(error.strerror or str(error)) from error

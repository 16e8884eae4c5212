"""Child processes that play scenes, one per engine and profile, so that a crash affects one column only.

Timed play is serialized: the parent sends a child one command, waits for its answer and turns to the next
child. Engines play in interleaved slices of `SLICE` frames. Untimed work (build, warm-up, save) runs in all
children in parallel. A child serves many scenes, because its start and the import of its engine take longer
than most scenes; a child that failed is replaced. Its output goes to the job's file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import AdapterError, Engine, Settings
from touchstone.adapters.recorder import ready, warm_up
from touchstone.adapters.recording import RecordingError
from touchstone.adapters.registry import ENGINES, load, packages_of, waiting_note
from touchstone.adapters.workers.process import (
    COMPILE_PATIENCE,
    PATIENCE,
    ChildProcess,
    divert_output,
    failure_of,
    interrupt_held,
    pin,
)
from touchstone.scenarios.scenario import Scenario

SLICE = 30
"""Displayed frames per slice: half a second of the scene."""
PART = 10.0
"""Time after which a child answers within a slice and is asked to continue [s], so that it does not count as
hung."""
Loader = Callable[[str], Engine]
Progress = Callable[[str, int], None]
"""Callback with the current activity and the number of frames just finished."""


@dataclass(frozen=True, slots=True)
class Job:
    """One engine, one setting and one scene, with the paths of the recording and of the child's output.

    Play ends early once the steps took more than `budget` seconds. Without `reading` the recording has the
    times of the frames, and the start in place of their states.
    """

    engine: str
    scenario: Scenario
    settings: Settings
    recording: Path
    output: Path
    budget: float = inf
    reading: bool = True


@dataclass(frozen=True, slots=True)
class Outcome:
    """End of a job: `done`, `skipped` (unsupported), `missing`, `unimportable` or `error`, with the reason.

    A job that fails during play leaves the recording up to the failure, unless its process died.
    """

    job: Job
    status: str
    reason: str = ""

    @property
    def recorded(self) -> bool:
        """Whether there is a recording, complete or up to a failure."""
        return self.job.recording.exists()


class Children:
    """Child processes of a run, per engine and profile; a context manager that ends them.

    With `together`, all children play in parallel: for runs whose times are not used. An engine that hung in
    a scene skips the scenes that follow: each would cost `patience` seconds. `compile_patience` [s] is for
    commands that may compile the reference. With `per_engine`, one child plays all settings of an engine, one
    job at a time. With `core`, children run on that processor.
    """

    def __init__(
        self,
        loader: Loader = load,
        patience: float = PATIENCE,
        together: bool = False,
        compile_patience: float = COMPILE_PATIENCE,
        per_engine: bool = False,
        core: int | None = None,
    ) -> None:
        self._loader, self._patience, self._together = loader, patience, together
        self._compile_patience = compile_patience
        self._per_engine, self._core = per_engine, core
        self._kept: dict[tuple[str, str], _Child] = {}
        self._hung: dict[tuple[str, str], str] = {}

    def __enter__(self) -> Children:
        return self

    def __exit__(self, *_: object) -> None:
        for child in self._kept.values():
            child.stop()

    def play(self, jobs: Iterable[Job], progress: Progress) -> list[Outcome]:
        """Play all jobs of one scene, interleaved; a failing job does not stop the others.

        Raises OSError if a recording cannot be written: a full disk is not an engine's failure.
        """
        jobs = list(jobs)
        children: list[_Child] = []
        with interrupt_held():
            for job in jobs:
                if _key(job) not in self._hung:
                    children.append(self._child(job))
        turns = [children] if self._together else [[child] for child in children]
        for command in ("build", "warm up", "start"):
            _order(children, command, progress, self._compile_patience)
        frames = max((child.job.scenario.frame_count for child in children), default=0)
        for first in range(0, frames, SLICE):
            for turn in turns:
                _play(turn, min(SLICE, frames - first), progress)
        _order(children, "save", progress)
        for child in children:
            if child.outcome.status == _NotSaved.status:
                raise OSError(child.outcome.reason)
        played = {_key(child.job): child.outcome for child in children}
        skipped = {key: f"not played: the engine hung in {scene}" for key, scene in self._hung.items()}
        self._hung |= {_key(child.job): child.job.scenario.name for child in children if child.hung}
        return [played.get(_key(job)) or Outcome(job, "skipped", skipped[_key(job)]) for job in jobs]

    def _child(self, job: Job) -> _Child:
        """Child for the job's engine and settings; starts one if there is none or if it failed."""
        key = (job.engine, "") if self._per_engine else _key(job)
        child = self._kept.get(key)
        if child is None or child.failure is not None:
            child = self._kept[key] = _Child(job, self._loader, self._patience, self._core)
        child.take(job)
        return child


def _key(job: Job) -> tuple[str, str]:
    return job.engine, job.settings.label


def _order(turn: list[_Child], command: str, progress: Progress, compile_patience: float = 0.0) -> None:
    """Send a command to all children and wait for their answers; for those that compile, at least
    `compile_patience` seconds."""
    for child in turn:
        if child.failure is None:
            progress(f"{child.label}: {command}", 0)
        child.send(command, child.job if command == "build" else None)
    for child in turn:
        if child.compiles:
            child.receive(compile_patience, partial(_note_compilation, child, progress))
        else:
            child.receive()


def _note_compilation(child: _Child, progress: Progress) -> None:
    if note := waiting_note(child.job.engine):
        progress(note, 0)


def _play(turn: list[_Child], frames: int, progress: Progress) -> None:
    """Play a number of frames in all children, in parts."""
    left = dict.fromkeys(turn, frames)
    while left:
        for child, count in left.items():
            progress(child.label, 0)
            child.send("play", count)
        # A failed child answers None and has no frames left.
        left = {child: count for child in left if (count := child.receive())}
    for child in turn:
        progress(child.label, frames)


class _NotSaved(AdapterError):
    """A recording could not be written."""

    status = "unsaved"


class _Child(ChildProcess):
    """Parent's end of one child."""

    def __init__(self, job: Job, loader: Loader, patience: float, core: int | None) -> None:
        packages = packages_of(job.engine)
        super().__init__(_Run, (job.engine, loader, core), job.output, patience, packages)
        self.take(job)

    def take(self, job: Job) -> None:
        self.job = job
        self.label = f"{job.engine} {job.settings.label}"
        self.compiles = job.engine in ENGINES and bool(ENGINES[job.engine].compiles)

    @property
    def outcome(self) -> Outcome:
        """Outcome of the job; `done` unless it has failed."""
        return Outcome(self.job, *(self.failure or ("done",)))


class _Run:
    """Child's end: an engine, loaded once, and the world it plays."""

    _engine: Engine | None = None

    def __init__(self, name: str, loader: Loader, core: int | None) -> None:
        self._name, self._loader = name, loader
        if core is not None:
            pin(core)

    def handle(self, command: str, argument: Any) -> int:
        """Execute one command and return the number of frames left; each job sends them in the order
        below."""
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
                self._player.reading = job.reading
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
        """Save the recording; after a failure (`ended`), only if the engine still answers."""
        try:
            recording = self._player.recording(ended)
        except Exception:
            if ended:
                return
            raise
        try:
            recording.save(self._job.recording)
        except RecordingError:
            if not ended:
                raise
        except OSError as error:
            raise _NotSaved(error.strerror or str(error)) from error

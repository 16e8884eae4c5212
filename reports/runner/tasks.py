"""Tasks of studies in child processes, which import the module of what they play: this one is light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import UNIMPORTABLE, AdapterError, Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording, RunEnded
from touchstone.adapters.registry import ENGINES, load
from touchstone.adapters.workers.pool import EngineProcess, EngineTask, Loader, Pool, Slot
from touchstone.reports.cli.progress import Progress
from touchstone.scenarios.scenario import Scenario

PATIENCE = 600.0
"""Time without an answer after which a process is terminated [s]: longer than a cold compilation."""
PROCESSES = 2
"""Largest number of processes that play untimed tasks at a time."""


@dataclass(frozen=True, slots=True)
class Task:
    """A scene on an engine; `file` keeps its recording."""

    scenario: Scenario
    engine: str
    settings: Settings
    file: Path | None = None

    def record(self, engine: Engine) -> Recording:
        """Play the scene in this process; a run that fails leaves its recording, too."""
        try:
            found = record(engine, self.scenario, self.settings)
        except RunEnded as error:
            if self.file is not None:
                error.recording.save(self.file)
            raise
        if self.file is not None:
            found.save(self.file)
        return found


@dataclass(frozen=True, slots=True)
class Ended:
    """Verdict and reason of a task without a result; `hung`: because there was no answer."""

    status: str
    reason: str
    hung: bool = False


def own_profile(engine: str) -> str:
    """The profile in which an engine is compared with others: its first."""
    return next(iter(ENGINES[engine].profiles))


def own_step(engine: str, profile: str = "") -> float:
    """Native step of a profile, or of an engine's own one [s]."""
    return ENGINES[engine].profiles[profile or own_profile(engine)]


def own_settings(engine: str, dt: float = 0.0, effects: tuple[str, ...] | None = None) -> Settings:
    """Settings of an engine's own profile at its step, or at another."""
    return Settings(own_profile(engine), dt or own_step(engine), effects=effects)


def played(
    play: Callable[[Engine, Any], object],
    tasks: Sequence[EngineTask],
    folder: Path,
    progress: Progress,
    *,
    loader: Loader = load,
    patience: float = PATIENCE,
    processes: int = PROCESSES,
) -> list[Any]:
    """Result of `play(engine, task)` per task, in child processes whose output goes to `folder`.

    A task that an engine refuses, or that ends its process, gives Ended, and the process is replaced. An
    engine that cannot be imported is tried once.
    """

    unimportable: dict[str, Ended] = {}

    def one(slot: Slot[EngineProcess], number: int) -> list[tuple[int, object]]:
        engine = tasks[number].engine
        found = unimportable.get(engine) or asked_of(slot, tasks[number])
        if isinstance(found, Ended) and found.status == UNIMPORTABLE:
            unimportable[engine] = found
        return [(number, found)]

    folder.mkdir(exist_ok=True)
    start = partial(EngineProcess, partial(refusable, play), loader=loader, patience=patience)
    done: dict[int, object] = {}
    for number, found in Pool(start, min(processes, len(tasks)), folder).each(range(len(tasks)), one):
        done[number] = found
        progress(f"{tasks[number].engine} {tasks[number].settings.label}", 1)
    return [done[number] for number in range(len(tasks))]


def asked_of(slot: Slot[EngineProcess], task: EngineTask) -> Any:
    """Result of a task by a process that plays it, or Ended if the process failed."""
    child = slot.child()
    found = child.ask("play", task)
    return found if child.failure is None else Ended(*child.failure, child.hung)


def refusable(play: Callable[[Engine, Any], object], engine: Engine, task: object) -> object:
    """Result of a task, or Ended if the engine refuses it: the process goes on."""
    try:
        return play(engine, task)
    except AdapterError as error:
        return Ended(error.status, str(error))

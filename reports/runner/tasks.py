"""Tasks of studies in child processes, which import the module of what they play: this one is light."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from touchstone.adapters.contract import Engine, Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording, RunEnded
from touchstone.adapters.registry import ENGINES, installed, load
from touchstone.adapters.workers.pool import EngineTask, Loader, played_in_pool
from touchstone.reports.progress import Progress
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


def own_profile(engine: str) -> str:
    """The profile in which an engine is compared with others: its first."""
    return next(iter(ENGINES[engine].profiles))


def own_step(engine: str, profile: str = "") -> float:
    """Native step of a profile, or of an engine's own one [s]."""
    return ENGINES[engine].profiles[profile or own_profile(engine)]


def own_settings(engine: str, dt: float = 0.0, effects: tuple[str, ...] | None = None) -> Settings:
    """Settings of an engine's own profile at its step, or at another."""
    return Settings(own_profile(engine), dt or own_step(engine), effects=effects)


def tasks_of(scenes: Sequence[Scenario], columns: Sequence[tuple[str, str]]) -> list[Task]:
    """Every scene in every (engine, profile) column of an installed engine, at the profile's step."""
    there = [column for column in columns if installed(column[0])]
    return [Task(s, name, Settings(p, own_step(name, p))) for s in scenes for name, p in there]


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
    """Result of `play(engine, task)` or Ended per task, in child processes whose output goes to `folder`."""
    folder.mkdir(exist_ok=True)
    done: dict[int, object] = {}
    for number, found in played_in_pool(play, tasks, folder, processes, loader, patience):
        done[number] = found
        progress(f"{tasks[number].engine} {tasks[number].settings.label}", 1)
    return [done[number] for number in range(len(tasks))]

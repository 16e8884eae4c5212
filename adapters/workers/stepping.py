"""Child processes that time the steps of worlds without reading the state, one per engine: for benchmarks."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from touchstone.adapters.contract import Array, Engine, Settings, World
from touchstone.adapters.recorder import frame_seconds, undisturbed
from touchstone.adapters.registry import load, packages_of
from touchstone.adapters.workers.process import PATIENCE, ChildProcess
from touchstone.scenarios.scenario import Scenario

Loader = Callable[[str], Engine]


class Stepper(ChildProcess):
    """Parent's end of one engine's process.

    Commands: `load`; `build` (scenario, settings, frames to warm up); `frames` (scenario's name, count),
    which returns the time of each frame without preemption [s].
    """

    def __init__(self, engine: str, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        super().__init__(_Server, (engine, loader), output, patience, packages_of(engine))
        self.engine = engine


class _Server:
    """Child's end: an engine, and its worlds by scenario name."""

    def __init__(self, name: str, loader: Loader) -> None:
        self._name, self._loader = name, loader
        self._worlds: dict[str, tuple[World, Scenario, Settings]] = {}
        self._played: dict[str, int] = {}

    def handle(self, command: str, argument: Any) -> object:
        """Execute one command."""
        match command:
            case "load":
                self._engine = self._loader(self._name)
                return None
            case "build":
                scenario, settings, warm_up = argument
                world = self._engine.build(scenario, settings)
                self._worlds[scenario.name], self._played[scenario.name] = (world, scenario, settings), 0
                self._frames(scenario.name, warm_up)
                return None
        return self._frames(*argument)

    def _frames(self, name: str, count: int) -> Array:
        return np.array([undisturbed(lambda: self._frame(name)) for _ in range(count)])

    def _frame(self, name: str) -> float:
        number = self._played[name]
        self._played[name] += 1
        return frame_seconds(*self._worlds[name], number)

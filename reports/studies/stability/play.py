"""Plays one cell of the study `stability`, a hard scene on an engine at a step, and judges its outcome."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from time import perf_counter, process_time

from touchstone.adapters.contract import AdapterError, Engine, Settings, Unsupported
from touchstone.adapters.recorder import Player, ready
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import load
from touchstone.adapters.workers.process import ChildProcess
from touchstone.reports.metrics.state import state_hash
from touchstone.reports.outcome.classes import Outcome
from touchstone.reports.outcome.judge import judge
from touchstone.scenarios.difficulty.checks import Checks
from touchstone.scenarios.difficulty.family import hard_scene
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

Loader = Callable[[str], Engine]
PATIENCE = 300.0
"""Time without an answer after which the process is terminated [s]: longer than a cold compilation."""
AROUND = 4.0
"""Processor time of a whole run, reading and recording included, over that of its steps, from which it is cut
off as well [1]."""
LEFT_BOUNDS = "the plan does not hold"
"""Part of the reason of a run that left the bounds of its plan; it is played again with all effects."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One run: a hard scene on an engine, for at most `budget` seconds of its steps."""

    scene: str
    engine: str
    settings: Settings
    budget: float = inf

    @property
    def line(self) -> str:
        """The command that plays the cell's scene."""
        rate = 1 / self.settings.dt
        step = f"1/{round(rate)}" if abs(rate - round(rate)) < 1e-6 * rate else f"{self.settings.dt!r}"
        effects = " --effects all" if self.settings.effects == PLANNED else ""
        return (
            f"touchstone run {self.scene} --engine {self.engine} --profile {self.settings.profile} "
            f"--dt {step}{effects}"
        )


@dataclass(frozen=True, slots=True)
class Played:
    """Outcome of a cell, the command that plays it, time of its steps and of all [s], hash of its states."""

    outcome: Outcome
    line: str
    steps_seconds: float = 0.0
    seconds: float = 0.0
    state_hash: str = ""


def play_cell(engine: Engine, cell: Cell, failures: Path | None = None) -> Played:
    """Play a cell in this process and classify it; a failed run leaves its recording in `failures`."""
    scenario, checks = hard_scene(cell.scene)
    start = perf_counter()
    outcome, recording, steps = _play(engine, scenario, checks, cell.settings, cell.budget)
    if LEFT_BOUNDS in outcome.reason:
        cell = replace(cell, settings=replace(cell.settings, effects=PLANNED))
        outcome, recording, steps = _play(engine, scenario, checks, cell.settings, cell.budget)
    if failures is not None and recording is not None and outcome.name != "ok":
        failures.mkdir(parents=True, exist_ok=True)
        step = f"{cell.settings.dt:.3g}"
        recording.save(failures / f"{cell.scene}-{cell.engine}-{cell.settings.profile}-{step}.npz")
    digits = "" if recording is None else state_hash(recording)
    return Played(outcome, cell.line, steps, perf_counter() - start, digits)


def play_scenario(
    engine: Engine, scenario: Scenario, checks: Checks, settings: Settings, budget: float = inf
) -> Outcome:
    """Outcome of any scene with its checks, played in this process."""
    return _play(engine, scenario, checks, settings, budget)[0]


def _play(
    engine: Engine, scenario: Scenario, checks: Checks, settings: Settings, budget: float
) -> tuple[Outcome, Recording | None, float]:
    """Outcome, recording up to a failure, and time of the steps [s]."""
    player: Player | None = None
    ended = ""
    try:
        player = ready(engine, scenario, settings)
        end = process_time() + AROUND * budget
        for _ in range(scenario.frame_count):
            player.play(1)
            if player.seconds_played > budget or process_time() > end:
                break
    except Unsupported as error:
        return Outcome("skipped", str(error)), None, 0.0
    except AdapterError as error:
        ended = str(error)
        if player is None:
            return Outcome("gave up", ended), None, 0.0
    except Exception as error:
        return Outcome("error", f"{type(error).__name__}: {error}".splitlines()[0]), None, 0.0
    assert player is not None
    recording = player.recording(ended)
    player.world.close()
    return judge(recording, scenario, checks, ended), recording, player.seconds_played


class Child(ChildProcess):
    """The parent's end of a process that plays cells."""

    def __init__(
        self, output: Path, failures: Path | None, loader: Loader = load, patience: float = PATIENCE
    ) -> None:
        super().__init__(_Server, (loader, failures), output, patience)


class _Server:
    """The child's end: engines, loaded once each."""

    def __init__(self, loader: Loader, failures: Path | None) -> None:
        self._loader, self._failures = loader, failures
        self._engines: dict[str, Engine] = {}

    def handle(self, command: str, cell: Cell) -> Played:
        """Handle `play`."""
        if cell.engine not in self._engines:
            self._engines[cell.engine] = self._loader(cell.engine)
        return play_cell(self._engines[cell.engine], cell, self._failures)

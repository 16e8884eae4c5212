"""Plays one cell of the study `stability`, a hard scene on an engine at a step, and judges its outcome."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from time import perf_counter

from touchstone.adapters.contract import AdapterError, Engine, Settings, Unsupported
from touchstone.adapters.recorder import Player, ready
from touchstone.adapters.recording import Recording
from touchstone.reports.metrics.state import state_hash
from touchstone.reports.verdict.outcomes import Outcome, judge
from touchstone.scenarios.difficulty.checks import Checks
from touchstone.scenarios.difficulty.family import hard_scene
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

PATIENCE = 300.0
"""Time without an answer after which the process is terminated [s]: longer than a cold compilation."""
LEFT_BOUNDS = "the plan does not hold"
"""Part of the reason of a run that left the bounds of its plan; it is played again with all effects."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One run: a hard scene on an engine, until the engine's steps have taken `budget` seconds."""

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

    @property
    def file(self) -> str:
        """Name of the cell's recording."""
        return f"{self.scene}-{self.engine}-{self.settings.profile}-{self.settings.dt:.3g}.npz"


@dataclass(frozen=True, slots=True)
class Played:
    """Outcome of a cell, the command that plays it, its time [s] and the hash of its states."""

    outcome: Outcome
    line: str
    seconds: float = 0.0
    state_hash: str = ""


def play_cell(engine: Engine, cell: Cell, folder: Path | None = None, keep_all: bool = False) -> Played:
    """Play a cell in this process and classify it; a failed run, or every one, leaves its recording in
    `folder`."""
    scenario, checks = hard_scene(cell.scene)
    start = perf_counter()
    outcome, recording = _play(engine, scenario, checks, cell.settings, cell.budget)
    if LEFT_BOUNDS in outcome.reason:
        cell = replace(cell, settings=replace(cell.settings, effects=PLANNED))
        outcome, recording = _play(engine, scenario, checks, cell.settings, cell.budget)
    if folder is not None and recording is not None and (keep_all or outcome.name != "ok"):
        folder.mkdir(parents=True, exist_ok=True)
        recording.save(folder / cell.file)
    digits = "" if recording is None else state_hash(recording)
    return Played(outcome, cell.line, perf_counter() - start, digits)


def play_scenario(
    engine: Engine, scenario: Scenario, checks: Checks, settings: Settings, budget: float = inf
) -> Outcome:
    """Outcome of any scene with its checks, played in this process."""
    return _play(engine, scenario, checks, settings, budget)[0]


def _play(
    engine: Engine, scenario: Scenario, checks: Checks, settings: Settings, budget: float
) -> tuple[Outcome, Recording | None]:
    """Outcome, and the recording up to a failure."""
    player: Player | None = None
    ended = ""
    try:
        player = ready(engine, scenario, settings)
        while player.frames_played < scenario.frame_count and player.seconds_played <= budget:
            player.play(1)
    except Unsupported as error:
        return Outcome("skipped", str(error)), None
    except AdapterError as error:
        ended = str(error)
        if player is None:
            return Outcome("gave up", ended), None
    except Exception as error:
        return Outcome("error", f"{type(error).__name__}: {error}".splitlines()[0]), None
    assert player is not None
    try:
        recording = player.recording(ended)
        player.world.close()
    except Exception as error:
        return Outcome("error", f"{type(error).__name__}: {error}".splitlines()[0]), None
    return judge(recording, scenario, checks, ended), recording

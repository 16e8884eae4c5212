"""Plays one random scene on one engine, and assesses the run (`reports/verdict/outcomes.py`)."""

from __future__ import annotations

from dataclasses import dataclass
from time import process_time

from touchstone.adapters.contract import AdapterError, Engine, Settings, Unsupported
from touchstone.adapters.recorder import Player, ready
from touchstone.adapters.workers.pool import HANG, Ended
from touchstone.reports.runner.tasks import Task
from touchstone.reports.verdict.outcomes import (
    EXACT,
    FIRST_ORDER,
    Assessment,
    RunBounds,
    class_of_end,
    judge_random,
)
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import perturbed

FRAME_SECONDS = 5.0
"""Time of a frame from which a run counts as hanging [s]: three hundred times a frame of 60 Hz."""
SCENE_SECONDS = 120.0
"""Processor time of a whole run from which it counts as hanging [s]: one that waits ends after PATIENCE."""
PATIENCE = 300.0
"""Time without an answer after which the process is terminated [s]: longer than a cold compilation."""


@dataclass(frozen=True, slots=True)
class SeededTask:
    """One run: the scene of a seed on an engine; `perturbation` displaces each body by that distance [m]."""

    engine: str
    settings: Settings
    seed: int
    kind: str | None = None
    perturbation: float = 0.0

    @property
    def scenario(self) -> Scenario:
        """The scene to play."""
        scenario = random_scene(self.seed, self.kind)
        return perturbed(scenario, self.perturbation, self.seed) if self.perturbation else scenario


def assess(engine: Engine, scenario: Scenario, settings: Settings, bounds: RunBounds) -> Assessment:
    """Play a scene in this process and classify the run; a failed run is assessed up to its failure."""
    player: Player | None = None
    outcome, reason = "", ""
    try:
        player = ready(engine, scenario, settings)
        outcome = _play(player, scenario)
    except Unsupported as error:
        return Assessment("skipped", str(error))
    except AdapterError as error:
        outcome, reason = class_of_end(str(error), "error"), str(error)
    if player is None:
        return Assessment(outcome, reason)
    recording = player.recording(reason)
    player.world.close()
    return judge_random(recording, scenario, bounds, outcome, reason)


def _play(player: Player, scenario: Scenario) -> str:
    """Play frame by frame until the end or a timeout; returns "" or "hang"."""
    start = process_time()
    for _ in range(scenario.frame_count):
        before = player.seconds_played
        player.play(1)
        if player.seconds_played - before > FRAME_SECONDS or process_time() - start > SCENE_SECONDS:
            return "hang"
    return ""


def assess_task(engine: Engine, task: Task | SeededTask) -> Assessment:
    """Play a task in this process, with the bounds of its engine."""
    bounds = EXACT if task.engine == "reference" else FIRST_ORDER
    return assess(engine, task.scenario, task.settings, bounds)


def assessment_of(found: Assessment | Ended) -> Assessment:
    """Assessment of a task, or the class of one that ended its process."""
    if not isinstance(found, Ended):
        return found
    skipped = found.status if found.status == "skipped" else "error"
    return Assessment(HANG if found.process == HANG else skipped, found.reason)

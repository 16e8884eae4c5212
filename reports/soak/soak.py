"""The soak: random scenes of consecutive seeds, each judged by all invariants, until the time is up.

A run breaks an invariant if it is not finite, explodes, hangs, passes through something, overlaps, gains
energy or loses momentum beyond what the reference guarantees (`studies.robustness.play.EXACT`). A residual
that the reference itself reports is counted, and is no failure.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass, field, replace
from pathlib import Path
from queue import SimpleQueue
from time import monotonic

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import ENGINES, load
from touchstone.reports.results import write_beside
from touchstone.reports.soak.shrink import MOST_TRIES, shrunk
from touchstone.reports.studies.robustness.play import PATIENCE, Assessment, Child, Loader
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import Scenario

ENGINE = "reference"
SOUND = ("ok", "skipped", "residual")
"""Classes that break no invariant."""
PROCESSES = 2
Told = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Task:
    """One scene on an engine, as `studies.robustness.play.Child` plays it."""

    engine: str
    settings: Settings
    scenario: Scenario


@dataclass(frozen=True, slots=True)
class Failure:
    """A broken invariant: its seed, class and reason, the file of the smallest scene, and the command."""

    seed: int
    outcome: str
    reason: str
    bodies: int
    file: Path
    command: str


@dataclass(slots=True)
class Soaked:
    """What was played: scenes, displayed frames, classes, and failures."""

    scenes: int = 0
    frames: int = 0
    first_seed: int = 0
    classes: Counter[str] = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Extent:
    """How long a soak lasts: minutes after which no scene is started, first seed, largest number of scenes
    (None: only the time counts), and largest number of scenes that are played to shrink one."""

    minutes: float
    seed: int = 0
    most: int | None = None
    tries: int = MOST_TRIES


def soak(
    extent: Extent,
    profile: str,
    folder: Path,
    tell: Told,
    loader: Loader = load,
    scene: Callable[[int], Scenario] = random_scene,
) -> Soaked:
    """Play random scenes of consecutive seeds.

    Args:
        folder: where scenes of failures are written, as they are found.
        tell: receives one line per failure.
    """
    seed, most = extent.seed, extent.most
    folder.mkdir(parents=True, exist_ok=True)
    end, found, lock = monotonic() + 60 * extent.minutes, Soaked(first_seed=seed), threading.Lock()
    settings = Settings(profile, ENGINES[ENGINE].profiles[profile])
    idle: SimpleQueue[Child] = SimpleQueue()
    children = [Child(folder / f"output-{k + 1}.txt", loader, PATIENCE) for k in range(PROCESSES)]
    for child in children:
        idle.put(child)

    def played(scenario: Scenario) -> Assessment:
        child = idle.get()
        result: Assessment | None = child.ask("play", Task(ENGINE, settings, scenario))
        if child.failure is not None:
            status, reason = child.failure
            result = Assessment("hang" if reason.startswith("hung") else status, reason)
            child = Child(folder / "output-more.txt", loader, PATIENCE)
        idle.put(child)
        assert result is not None
        return result

    def one(number: int) -> None:
        scenario = scene(number)
        first = played(scenario)
        with lock:
            found.scenes += 1
            found.frames += first.frames
            found.classes[first.outcome] += 1
        if first.outcome in SOUND:
            return
        smallest = shrunk(scenario, lambda smaller: played(smaller).outcome == first.outcome, extent.tries)
        failure = _written(smallest, number, first, profile, folder)
        with lock:
            found.failures.append(failure)
        tell(f"{failure.outcome}: seed {number}, {failure.bodies} bodies left: {failure.command}")

    try:
        with ThreadPoolExecutor(PROCESSES) as pool:
            running: set[Future[None]] = set()
            number, last = seed, seed + most if most is not None else None
            while monotonic() < end and (last is None or number < last):
                while len(running) < PROCESSES and (last is None or number < last):
                    running.add(pool.submit(one, number))
                    number += 1
                done, running = wait(running, timeout=1.0, return_when=FIRST_COMPLETED)
                for future in done:
                    future.result()
            for future in running:
                future.result()
    finally:
        while not idle.empty():
            idle.get().stop()
    return found


def _written(scenario: Scenario, seed: int, first: Assessment, profile: str, folder: Path) -> Failure:
    """Write the smallest scene as a file that replays it."""
    name = f"soak_{seed}_{first.outcome.replace(' ', '_')}"
    named = replace(scenario, name=name, tags=("soak", *scenario.tags))
    path = folder / f"{name}.toml"
    command = f"touchstone run {path} --engine {ENGINE} --profile {profile}"
    comment = f"{first.outcome}: {first.reason or 'breaks an invariant'}\nshrunk from seed {seed}\n{command}"
    write_beside(path, lambda part: part.write_text(scene_toml(named, comment)))
    return Failure(seed, first.outcome, first.reason, len(scenario.bodies), path, command)

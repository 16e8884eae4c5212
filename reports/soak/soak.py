"""The soak: random scenes of consecutive seeds, each judged by all invariants, until the time is up.

A run breaks an invariant if it is not finite, explodes, hangs, passes through something, overlaps, gains
energy or loses momentum beyond what the reference guarantees (`verdict.random_outcomes.EXACT`). A residual
that the reference itself reports is counted, and is no failure.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from time import monotonic

from touchstone.adapters.contract import Settings
from touchstone.adapters.registry import ENGINES, load
from touchstone.adapters.workers.pool import EngineProcess, Loader, Pool, Slot
from touchstone.reports.results import write_beside
from touchstone.reports.soak.shrink import MOST_TRIES, shrunk
from touchstone.reports.studies.robustness.play import PATIENCE, assess_task, assessment_of
from touchstone.reports.studies.tasks import Task, asked_of
from touchstone.reports.verdict.random_outcomes import Assessment
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import Scenario

ENGINE = "reference"
SOUND = ("ok", "skipped", "residual")
"""Classes that break no invariant."""
PROCESSES = 2
Listener = Callable[[str], None]


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
    tell: Listener,
    loader: Loader = load,
    scene: Callable[[int], Scenario] = random_scene,
) -> Soaked:
    """Play random scenes of consecutive seeds.

    Args:
        folder: where scenes of failures are written, as they are found.
        tell: receives one line per failure.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = Soaked(first_seed=extent.seed)
    settings = Settings(profile, ENGINES[ENGINE].profiles[profile])

    def one(slot: Slot[EngineProcess], seed: int) -> Iterator[Assessment | Failure]:
        def played(scenario: Scenario) -> Assessment:
            return assessment_of(asked_of(slot, Task(scenario, ENGINE, settings)))

        def fails(scenario: Scenario) -> bool:
            return played(scenario).outcome == first.outcome

        scenario = scene(seed)
        first = played(scenario)
        yield first
        if first.outcome not in SOUND:
            yield _written(shrunk(scenario, fails, extent.tries), seed, first, profile, folder)

    start = partial(EngineProcess, assess_task, loader=loader, patience=PATIENCE)
    for result in Pool(start, PROCESSES, folder).each(_seeds(extent), one):
        if isinstance(result, Failure):
            found.failures.append(result)
            tell(f"{result.outcome}: seed {result.seed}, {result.bodies} bodies left: {result.command}")
        else:
            found.scenes += 1
            found.frames += result.frames
            found.classes[result.outcome] += 1
    return found


def _seeds(extent: Extent) -> Iterator[int]:
    """Seeds of the scenes that are started in time."""
    end = monotonic() + 60 * extent.minutes
    for seed in count(extent.seed):
        if monotonic() >= end or (extent.most is not None and seed >= extent.seed + extent.most):
            return
        yield seed


def _written(scenario: Scenario, seed: int, first: Assessment, profile: str, folder: Path) -> Failure:
    """Write the smallest scene as a file that replays it."""
    name = f"soak_{seed}_{first.outcome.replace(' ', '_')}"
    named = replace(scenario, name=name, tags=("soak", *scenario.tags))
    path = folder / f"{name}.toml"
    command = f"touchstone run {path} --engine {ENGINE} --profile {profile}"
    comment = f"{first.outcome}: {first.reason or 'breaks an invariant'}\nshrunk from seed {seed}\n{command}"
    write_beside(path, lambda part: part.write_text(scene_toml(named, comment)))
    return Failure(seed, first.outcome, first.reason, len(scenario.bodies), path, command)

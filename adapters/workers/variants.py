"""One spawned child per engine that plays a scene under several plans by turns, and tells them apart.

Frames of all variants are interleaved, one of each in turn, starting with another each time; nothing is read
out within the clock. What a variant's bodies do is held against the first one's, frame by frame. Frames of
microseconds are timed in passes of their own, for there two worlds share the caches, not all.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from touchstone.adapters.contract import AdapterError, Array, Engine, Settings, State, World
from touchstone.adapters.divergence import Watch
from touchstone.adapters.motion_bounds import bounds, planned
from touchstone.adapters.recorder import frame_seconds, ready, undisturbed, warm_up
from touchstone.adapters.registry import load
from touchstone.adapters.workers.process import PATIENCE, ChildProcess
from touchstone.adapters.workers.stepping import Loader
from touchstone.scenarios.effects import plan
from touchstone.scenarios.scenario import Scenario

PLANS = 3
"""Times that a scene is planned against the clock, after once without."""
FIELDS = ("position", "orientation", "linear_velocity", "angular_velocity", "joint_angle", "joint_rate")
"""What is compared to the bit."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Step calls of the frames played, and an empty call into the engine right after each, both (f,) [s]; of
    several passes the fastest. Empty calls are 0 where they were not timed."""

    seconds: Array
    crossing: Array

    @property
    def net(self) -> Array:
        """Seconds without the crossing from Python."""
        return self.seconds - self.crossing


@dataclass(frozen=True, slots=True)
class Variant:
    """What one of several plans of a scene did.

    Attributes:
        pace: what its frames took.
        beside: what the first variant's took, by turns with them.
        moved, turned: largest difference of positions [m] and orientations [rad] from the first variant's.
        same: whether all bodies and hinges did the same to the bit.
        ended: why it could not be played to the end; empty where it was.
    """

    pace: Pace
    beside: Pace
    moved: float
    turned: float
    same: bool
    ended: str


class VariantPlayer(ChildProcess):
    """The parent's end of one engine's process. Commands: `plan` (scenario): seconds of planning it; `play`
    (scenario, settings of each, seconds of steps after which frames are left out, passes): their Variants."""

    def __init__(self, engine: str, output: Path, loader: Loader = load, patience: float = PATIENCE) -> None:
        super().__init__(_Server, (engine, loader), output, patience)


class _Server:
    """The child's end: an engine, loaded for the first command."""

    _engine: Engine | None = None

    def __init__(self, name: str, loader: Loader) -> None:
        self._name, self._loader = name, loader

    def handle(self, command: str, argument: Any) -> object:
        """Obey one command."""
        if self._engine is None:
            self._engine = self._loader(self._name)
        return plan_seconds(argument) if command == "plan" else play(self._engine, *argument)


def plan_seconds(scenario: Scenario) -> Array:
    """Seconds of planning a scene, its bounds included, once its hulls are known, undisturbed (PLANS,)."""

    def once() -> float:
        start = perf_counter()
        plan(scenario, bounds(scenario))
        return perf_counter() - start

    once()
    return np.array([undisturbed(once) for _ in range(PLANS)])


def play(
    engine: Engine, scenario: Scenario, settings: Sequence[Settings], budget: float = inf, passes: int = 0
) -> list[Variant]:
    """Play all variants side by side; every one to the frame in which the steps of all took `budget`. With
    `passes` each is timed so many times beside the first one alone, over the same frames."""
    runs = [_Run(engine, scenario, one) for one in settings]
    spent, number = 0.0, 0
    while number < scenario.frame_count and spent < budget:
        for turn in range(len(runs)):
            spent += runs[(number + turn) % len(runs)].step(number)
        for run in runs[1:]:
            run.compare(runs[0])
        number += 1
    found = [run.close(runs[0]) for run in runs]
    for k in range(1, len(found)) if passes and not found[0].ended else ():
        if not found[k].ended:
            beside, pace = _time(engine, scenario, (settings[0], settings[k]), number, passes)
            found[k] = replace(found[k], pace=pace, beside=beside)
            found[0] = replace(found[0], pace=beside, beside=beside)
    return found


def _time(
    engine: Engine, scenario: Scenario, pair: tuple[Settings, Settings], frames: int, passes: int
) -> tuple[Pace, Pace]:
    """Frames of two variants by turns: of a frame in which something happens the first one finds cold caches,
    so another one is the first in each pass."""
    fastest = np.full((2, frames, 2), inf)
    for turn in range(passes):
        spent = np.zeros((2, frames, 2))
        worlds = [ready(engine, scenario, one).world for one in pair]
        for number in range(frames):
            for k in ((number + turn) % 2, (number + turn + 1) % 2):
                seconds = frame_seconds(worlds[k], scenario, pair[k], number)
                start = perf_counter()
                worlds[k].cross()
                spent[k, number] = seconds, perf_counter() - start
        for world in worlds:
            world.close()
        fastest = np.minimum(fastest, spent)
    one, two = (Pace(each[:, 0], each[:, 1]) for each in fastest)
    return one, two


class _Run:
    """One variant while it is played; one that fails stays where it is."""

    def __init__(self, engine: Engine, scenario: Scenario, settings: Settings) -> None:
        self._scenario, self._settings = scenario, settings
        self._seconds: list[float] = []
        self._moved = self._turned = 0.0
        self._same, self._ended = True, ""
        self.state = State(scenario)
        self._world: World | None = None
        try:
            self._watch = Watch(scenario, planned(scenario, settings.effects))
            warm_up(engine, scenario, settings)
            self._world = ready(engine, scenario, settings).world
        except AdapterError as error:
            self._ended = str(error)

    def step(self, number: int) -> float:
        """Play a frame; returns its seconds."""
        if self._world is None or self._ended:
            return 0.0
        try:
            seconds = frame_seconds(self._world, self._scenario, self._settings, number)
            self.state.clear_contacts()
            self._world.read(self.state)
        except AdapterError as error:
            self._ended = str(error)
            return 0.0
        self._seconds.append(seconds)
        self._ended = self._watch.step_fault(self.state) or self._watch.frame_fault(self.state) or ""
        return seconds

    def compare(self, other: _Run) -> None:
        """Hold the present state against another run's; of one that ended nothing more is said."""
        if self._ended or other._ended:
            return
        mine, theirs = self.state, other.state
        self._same = self._same and all(np.array_equal(getattr(mine, f), getattr(theirs, f)) for f in FIELDS)
        moved = np.linalg.norm(mine.position - theirs.position, axis=1).max()
        dot = np.abs((mine.orientation * theirs.orientation).sum(axis=1))
        away = np.minimum(
            np.linalg.norm(mine.orientation - theirs.orientation, axis=1),
            np.linalg.norm(mine.orientation + theirs.orientation, axis=1),
        )
        # of small turns the cosine tells nothing
        turned = np.where(
            dot > 0.99, 4 * np.arcsin(np.minimum(away / 2, 1)), 2 * np.arccos(np.minimum(dot, 1))
        )
        self._moved, self._turned = max(self._moved, float(moved)), max(self._turned, float(turned.max()))

    def close(self, first: _Run) -> Variant:
        """What it did beside the first one; frees the world."""
        if self._world is not None:
            self._world.close()
        same = self._same and not self._ended
        pace, beside = (_gross(seconds) for seconds in (self._seconds, first._seconds))
        return Variant(pace, beside, self._moved, self._turned, same, self._ended)


def _gross(seconds: Sequence[float]) -> Pace:
    return Pace(np.array(seconds), np.zeros(len(seconds)))

"""Plays a scene under several plans in one process, and compares timing and motion.

Frames of all variants are interleaved; the variant that goes first changes every frame. No state is read
within the timed section. Each frame compares the motion of a variant with that of the first one. Frames of
microseconds are timed in separate passes, in which only two worlds share the caches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import inf
from time import perf_counter, process_time

import numpy as np

from touchstone.adapters.contract import STATE_FIELDS, AdapterError, Array, Engine, Settings, State, World
from touchstone.adapters.divergence import Watch
from touchstone.adapters.motion_bounds import bounds, planned
from touchstone.adapters.recorder import frame_seconds, ready, warm_up
from touchstone.scenarios.plan import plan
from touchstone.scenarios.scenario import Scenario

PLANS = 3
"""Number of timed plannings of a scene, after one that is not timed."""
BLOCK = 32
"""Frames that a timed variant plays before the other's turn: caches hold its code after the first few."""


@dataclass(frozen=True, slots=True)
class Pace:
    """Times of step calls and of an empty call right after each, both (f,) [s]; the minimum over several
    passes.

    Empty calls are 0 if they were not timed.
    """

    seconds: Array
    crossing: Array

    @property
    def net(self) -> Array:
        """Times of step calls without the call overhead from Python [s]."""
        return self.seconds - self.crossing


@dataclass(frozen=True, slots=True)
class Variant:
    """Result of one of several plans of a scene.

    Attributes:
        pace: times of its frames.
        beside: times of the first variant's frames, interleaved with them.
        moved, turned: maximum differences of positions [m] and orientations [rad] from the first variant.
        same: whether all bodies and hinges moved bitwise as in the first variant.
        ended: why play stopped early; empty if it did not.
    """

    pace: Pace
    beside: Pace
    moved: float
    turned: float
    same: bool
    ended: str


def plan_seconds(scenario: Scenario) -> Array:
    """Processor times of planning a scene with its bounds, hulls cached (PLANS,) [s]: what other processes
    take of the machine does not count."""

    def once() -> float:
        start = process_time()
        plan(scenario, bounds(scenario))
        return process_time() - start

    once()
    return np.array([once() for _ in range(PLANS)])


def play(
    engine: Engine, scenario: Scenario, settings: Sequence[Settings], budget: float = inf, passes: int = 0
) -> list[Variant]:
    """Play all variants interleaved until the steps of all took `budget` seconds in total.

    With `passes`, time each variant that many times together with the first one only, over the same frames.
    """
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
    """Times of two variants' frames, each the fastest of `passes`; variants take turns by blocks of frames.

    Two worlds of one variant step in turn, so that a frame finds the code that it runs in the caches: between
    frames of another variant the first contact after a flight takes microseconds more, and only with a plan.
    Blocks begin elsewhere in each pass, so that no frame is the first of a block in all of them; another
    process that takes seconds of the machine slows both variants.
    The first frame is not timed where others follow: it is the first to touch the memory of its world, which
    takes up to 0.1 ms in some passes and nothing in others.
    """
    fastest = np.full((2, frames, 2), inf)
    turns = -(-passes // 2)
    for turn in range(turns):
        worlds = [[ready(engine, scenario, one).world for _ in range(2)] for one in pair]
        edges = [0, *range(1 + turn * BLOCK // turns, frames, BLOCK), frames]
        for (begin, end), k in product(pairwise(edges), (turn % 2, (turn + 1) % 2)):
            for number, world in product(range(begin, end), worlds[k]):
                seconds = frame_seconds(world, scenario, pair[k], number)
                start = perf_counter()
                world.cross()
                spent = seconds, perf_counter() - start
                fastest[k, number] = np.minimum(fastest[k, number], spent)
        for world in worlds[0] + worlds[1]:
            world.close()
    first = min(1, frames - 1)
    one, two = (Pace(each[first:, 0], each[first:, 1]) for each in fastest)
    return one, two


class _Run:
    """State of one variant during play; a variant that fails stops."""

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
        """Update the differences from another run's state; a run that ended is not compared further."""
        if self._ended or other._ended:
            return
        mine, theirs = self.state, other.state
        equal = (np.array_equal(getattr(mine, f), getattr(theirs, f)) for f in STATE_FIELDS)
        self._same = self._same and all(equal)
        moved = np.linalg.norm(mine.position - theirs.position, axis=1).max()
        dot = np.abs((mine.orientation * theirs.orientation).sum(axis=1))
        away = np.minimum(
            np.linalg.norm(mine.orientation - theirs.orientation, axis=1),
            np.linalg.norm(mine.orientation + theirs.orientation, axis=1),
        )
        # arccos loses precision at small angles.
        turned = np.where(
            dot > 0.99, 4 * np.arcsin(np.minimum(away / 2, 1)), 2 * np.arccos(np.minimum(dot, 1))
        )
        self._moved, self._turned = max(self._moved, float(moved)), max(self._turned, float(turned.max()))

    def close(self, first: _Run) -> Variant:
        if self._world is not None:
            self._world.close()
        same = self._same and not self._ended
        pace, beside = (
            Pace(np.array(seconds), np.zeros(len(seconds))) for seconds in (self._seconds, first._seconds)
        )
        return Variant(pace, beside, self._moved, self._turned, same, self._ended)

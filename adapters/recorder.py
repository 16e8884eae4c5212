"""Playback and timing of a world, frame by frame; the only loop and the only clock of all engines."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping
from functools import lru_cache
from math import ceil, floor, inf
from resource import RUSAGE_SELF, RUSAGE_THREAD, getrusage
from time import perf_counter, process_time

import numpy as np

from touchstone.adapters.contract import (
    RESIDUAL_COUNTERS,
    STATE_FIELDS,
    AdapterError,
    Array,
    Engine,
    Manifest,
    Settings,
    State,
    Unsupported,
    World,
    state_fields,
)
from touchstone.adapters.divergence import Watch
from touchstone.adapters.engines.entry import ENGINES
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recording import Recording, RunEnded
from touchstone.adapters.step_log import StepLog
from touchstone.scenarios.effects import EFFECT_TABLE, PLANNED
from touchstone.scenarios.files.write import scene_data
from touchstone.scenarios.places import coinciding
from touchstone.scenarios.plan import Decision, Plan
from touchstone.scenarios.scenario import FRICTION_LAWS, Scenario
from touchstone.scenarios.truths.pair_groups import grouped

WARM_UP_FRAMES = 3
"""Untimed frames before the run, which fill compilers' and processors' caches."""
TRIES = 10
"""Maximum number of tries for a measurement without preemption: frames of milliseconds are as long as a
scheduler's time slice."""
MOST_STEPS = 10**6
"""Steps of a frame above which it never ends [1]: engines take a microsecond or more for one."""
LEAST_SUGGESTED = 1e-9
"""Step below which an error suggests no steps next to it [s]."""
CROSSINGS = 200
"""Empty calls timed per run."""


@lru_cache(maxsize=16)
def scenario_json(scenario: Scenario) -> str:
    """A scenario as JSON text."""
    return json.dumps(scene_data(scenario), allow_nan=False)


def manifest_json(manifest: Manifest) -> str:
    """A manifest as JSON text; pairs of bodies with equal coefficients are one entry."""
    pairs = {(pair.body_a, pair.body_b): (pair.restitution, pair.friction) for pair in manifest.pairs}
    groups = [
        {"bodies_a": a, "bodies_b": b, "restitution": e, "friction": mu} for (e, mu), a, b in grouped(pairs)
    ]
    return json.dumps({**dataclasses.asdict(dataclasses.replace(manifest, pairs=())), "pairs": groups})


def substeps(scenario: Scenario, dt: float) -> int:
    """Native steps per displayed frame; raises ValueError if `dt` does not divide the frame."""
    frame = 1 / scenario.frame_rate
    count = round(frame / dt) if dt > 0 else 0
    if count < 1 or abs(count * dt - frame) > 1e-9 * frame:
        fault = f"dt = {dt:g} s does not divide the frame of 1/{scenario.frame_rate} s"
        raise ValueError(fault + _near_steps(dt, scenario.frame_rate))
    if count > MOST_STEPS:
        raise ValueError(f"dt = {dt:g} s is {count:.3g} steps a frame, expected at most {MOST_STEPS}")
    return count


def _near_steps(dt: float, frame_rate: int) -> str:
    """Remark on the next steps that divide a frame."""
    if not LEAST_SUGGESTED < dt < inf:
        return f" (such as 1/{4 * frame_rate})"
    counts = sorted({max(1, floor(1 / (frame_rate * dt))), ceil(1 / (frame_rate * dt))})
    return f" (next to it: {', '.join(f'1/{frame_rate * count}' for count in counts)})"


def ready(engine: Engine, scenario: Scenario, settings: Settings) -> Player:
    """Player of a world that simulates the effects of the plan only."""
    world, settings, plan = build(engine, scenario, settings)
    return Player(world, scenario, settings, plan)


def build(engine: Engine, scenario: Scenario, settings: Settings) -> tuple[World, Settings, Plan]:
    """A world that simulates the effects of the plan only, its settings, and the plan.

    Raises AdapterError if two bodies start at the same place: engines resolve this arbitrarily; Unsupported
    if the scene has joints between bodies, exclusions of contact or laws of friction that the engine lacks.
    """
    fault = coinciding(scenario)
    if fault:
        raise AdapterError(fault)
    name = getattr(engine, "name", "")
    if scenario.body_joints and not getattr(engine, "plays_body_joints", False):
        raise Unsupported(f"{name}: the adapter has no joints between bodies")
    if scenario.contact_exclusions and not getattr(engine, "plays_body_joints", False):
        raise Unsupported(f"{name}: the adapter has no exclusions of contact")
    applied, settings, plan = planned_for(name, scenario, settings)
    for law in FRICTION_LAWS:
        asked = any(getattr(pair, law) > 0 for pair in applied.coefficients)
        if asked and law not in getattr(engine, "friction_laws", ()):
            raise Unsupported(f"{name}: the adapter has no {law.replace('_', ' ')}")
    return engine.build(applied, settings), settings, plan


def planned_for(engine: str, scenario: Scenario, settings: Settings) -> tuple[Scenario, Settings, Plan]:
    """The scene and the settings that an engine of this name gets, and the plan."""
    plan = planned(scenario, settings.effects)
    applied = plan.applied(scenario, _kept_by(engine))
    whole = bool(plan.removed) or set(PLANNED) <= set(settings.effects or ())  # no bound of the plan holds
    left = dataclasses.replace(
        settings, skipped=plan.skipped, fat_bounds=not whole, sleeping=plan.on("sleeping")
    )
    return applied, left, plan


def _kept_by(engine: str) -> tuple[str, ...]:
    return ENGINES[engine].keeps if engine in ENGINES else ()


def warm_up(engine: Engine, scenario: Scenario, settings: Settings) -> None:
    """Play a few frames in a world that is then discarded."""
    player = ready(engine, scenario, settings)
    player.play(min(WARM_UP_FRAMES, scenario.frame_count))
    player.world.close()


def record(engine: Engine, scenario: Scenario, settings: Settings) -> Recording:
    """Play a whole scene in this process, without warm-up.

    Raises:
        RunEnded: the run diverged, violated its plan or failed in the engine; holds the recording until then.
    """
    player = ready(engine, scenario, settings)
    try:
        player.play(scenario.frame_count)
        return player.recording()
    except AdapterError as error:
        raise RunEnded(str(error), player.recording(str(error))) from error
    finally:
        player.world.close()


def undisturbed(measure: Callable[[], float]) -> float:
    """Repeat a measurement until the process is not preempted, at most TRIES times; then return the
    minimum."""
    seconds = []
    for _ in range(TRIES):
        before = getrusage(RUSAGE_THREAD).ru_nivcsw
        seconds.append(measure())
        if getrusage(RUSAGE_THREAD).ru_nivcsw == before:
            return seconds[-1]
    return min(seconds)


def frame_seconds(world: World, scenario: Scenario, settings: Settings, number: int) -> float:
    """Time of the step calls of one displayed frame [s]; reads no state."""
    each = substeps(scenario, settings.dt)
    seconds = 0.0
    for substep in range(number * each, (number + 1) * each):
        world.drive(substep)
        start = perf_counter()
        world.step()
        seconds += perf_counter() - start
    return seconds


class StepClock:
    """Clock of a call that excludes time in which the system ran another process."""

    def __init__(self) -> None:
        self._switches = getrusage(RUSAGE_SELF).ru_nivcsw
        self._processor = process_time()

    def own_seconds(self, seconds: float) -> float:
        """The call's wall time [s]; if the process was preempted, at most its processor time. A call that
        waits by itself keeps its wall time."""
        processor = process_time() - self._processor
        preempted = getrusage(RUSAGE_SELF).ru_nivcsw != self._switches
        return min(seconds, processor) if preempted else seconds


class Player:
    """A world, its scene and the recording so far.

    A run ends with an AdapterError if it diverges, or if it violates the bounds of its plan: an effect that
    was left out may then matter. `recording` holds all complete frames before.

    Without `reading` only times are taken: reading the state slows the next step.
    """

    reading = True

    def __init__(
        self, world: World, scenario: Scenario, settings: Settings, plan: Plan | None = None
    ) -> None:
        self.world = world
        self._scenario = scenario
        self._settings = settings
        self._plan = plan
        self._watch = Watch(scenario, plan)
        self._substeps = substeps(scenario, settings.dt)
        self._state = State(scenario)
        world.read(self._state)
        self._log = StepLog(scenario, settings.dt, self._state)
        self._frames: list[Array] = []
        self._timings: list[tuple[float, float, float]] = []
        self._stages: list[Mapping[str, float]] = []
        self._counters: list[dict[str, float]] = []
        self._keep_frame()
        world.stage_seconds()

    @property
    def frames_played(self) -> int:
        """Number of displayed frames played."""
        return len(self._timings)

    def play(self, frames: int, most: float = inf) -> int:
        """Advance by a number of displayed frames, or until `most` seconds have passed, but by at least one;
        returns the number of frames left."""
        end = perf_counter() + most
        for left in reversed(range(frames)):
            stepping = driving = reading = 0.0
            counters: dict[str, float] = {}
            for substep in range(self._substeps):
                step, drive, read = self._step(len(self._timings) * self._substeps + substep)
                stepping, driving, reading = stepping + step, driving + drive, reading + read
                _count(counters, self.world.work())
            self._timings.append((stepping, driving, reading))
            self._stages.append(dict(self.world.stage_seconds()))
            self._counters.append(counters)
            self._keep_frame()
            fault = self._watch.frame_fault(self._state)
            if fault:
                raise AdapterError(f"{fault}, {self._moment(len(self._timings) * self._substeps)}")
            if perf_counter() > end:
                return left
        return 0

    @property
    def seconds_played(self) -> float:
        """Total time of the native steps so far [s]."""
        return sum(step for step, _, _ in self._timings)

    def _step(self, number: int) -> tuple[float, float, float]:
        """Advance one native step; returns the times of step, drive and read [s]."""
        self._state.clear_contacts()
        try:
            start = perf_counter()
            self.world.drive(number)
            clock = StepClock()
            driven = perf_counter()
            self.world.step()
            stepped = perf_counter()
            own = clock.own_seconds(stepped - driven)
            if not self.reading:
                return own, driven - start, 0.0
            self.world.read(self._state)
            done = perf_counter()
        except AdapterError as error:
            raise AdapterError(f"{error}, {self._moment(number + 1)}") from error
        fault = self._watch.step_fault(self._state)
        if fault:
            raise AdapterError(f"{fault}, {self._moment(number + 1)}")
        self._log.add(number * self._settings.dt, self._state)
        return own, driven - start, done - stepped

    def _moment(self, steps: int) -> str:
        """Text for the end time of a number of native steps; frame 0 is the initial state."""
        frame = -(-steps // self._substeps)
        return f"in frame {frame} at {steps * self._settings.dt:.4f} s"

    def _keep_frame(self) -> None:
        if name := self._state.replaced:
            raise AdapterError(f"`read` replaces state.{name}; write into it (state.{name}[:] = ...)")
        self._frames.append(self._state.values.copy())
        self._log.mark()

    def recording(self, ended: str = "") -> Recording:
        """Recording of all complete frames; `ended`: why the run ended before its scene."""
        stage_names = sorted({name for stages in self._stages for name in stages})
        work_names = sorted({name for counters in self._counters for name in counters})
        timings = np.array(self._timings).reshape(-1, 3)
        fields = zip(STATE_FIELDS, state_fields(np.array(self._frames), self._scenario))
        frames = {name: np.ascontiguousarray(field) for name, field in fields}
        work, impulse = self._log.drive()
        return Recording(
            scenario=scenario_json(self._scenario),
            manifest=manifest_json(self._manifest()),
            time=np.arange(len(self._frames)) / self._scenario.frame_rate,
            contacts=self._log.contacts(),
            driver_work=work,
            driver_impulse=impulse,
            time_frame=timings[:, 0],
            time_drive=timings[:, 1],
            time_read=timings[:, 2],
            time_crossing=self._time_crossing(),
            stage_names=np.array(stage_names, dtype=str),
            stage_seconds=_table(self._stages, stage_names),
            work_names=np.array(work_names, dtype=str),
            work=_table(self._counters, work_names),
            ended=ended,
            **frames,
        )

    def _manifest(self) -> Manifest:
        """Manifest of the engine, with the plan."""
        manifest = self.world.describe()
        if self._plan is None:
            return manifest
        effects = {
            one.effect: f"{one.state}: {one.reason}{_beyond(manifest.engine, one)}"
            for one in self._plan.decisions
        }
        return dataclasses.replace(manifest, effects=effects)

    def _time_crossing(self) -> Array:
        times = np.zeros(CROSSINGS)
        for k in range(CROSSINGS):
            start = perf_counter()
            self.world.cross()
            times[k] = perf_counter() - start
        return times


BODIES_KEPT = {
    "fixed": "fixed bodies",
    "met": "bodies that something can meet",
    "moving": "bodies that move",
}
"""Whose pieces an engine keeps (`Entry.keeps`), in words."""


def _beyond(engine: str, decision: Decision) -> str:
    """Note on an effect that an engine cannot represent."""
    only = EFFECT_TABLE[decision.effect].only
    if only and (only == "reference") != (engine == "reference"):
        return f"; {engine} has no such stage"
    if decision.effect == "rotation" and decision.state == "not needed":
        return f"; {engine} integrates it all the same"
    keeps = _kept_by(engine)
    if decision.effect == "gravity" and decision.state == "not needed" and "gravity" in keeps:
        return f"; {engine} keeps it: its steps take no less time without"
    if decision.effect == "contact" and decision.state != "forced off":
        kept = [BODIES_KEPT[one] for one in keeps if one in BODIES_KEPT and (decision.on or one == "moving")]
        if kept:
            whose = " and of ".join(kept)
            return f"; {engine} keeps all pieces of {whose}: its steps take no less time without"
    return ""


def _count(counters: dict[str, float], step: Mapping[str, float]) -> None:
    """Add a native step's counters to those of its frame; for residuals keep the largest, with its bodies."""
    largest = RESIDUAL_COUNTERS[0]
    if largest in step and step[largest] >= counters.get(largest, 0.0):
        counters.update({name: step[name] for name in RESIDUAL_COUNTERS if name in step})
    for name, value in step.items():
        if name not in RESIDUAL_COUNTERS:
            counters[name] = counters.get(name, 0.0) + value


def _table(rows: list[Mapping[str, float]] | list[dict[str, float]], names: list[str]) -> Array:
    return np.array([[row.get(name, 0.0) for name in names] for row in rows]).reshape(len(rows), len(names))

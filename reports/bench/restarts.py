"""Frames of all engines, each started several times, in drawn order, on one processor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path

import numpy as np

from touchstone.adapters.contract import MISSING, Array, Settings
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.registry import ENGINES, installed, missing_reason
from touchstone.adapters.workers.children import Children, Job
from touchstone.adapters.workers.process import last_core
from touchstone.reports.cli.progress import Progress
from touchstone.reports.run.request import EQUAL_PROFILE, MACHINE_PROFILE, REFERENCE
from touchstone.scenarios.scenario import Scenario

BUDGET = 5.0
"""Seconds of native steps after which a column stops in a scene: DART takes 20 minutes for 216 balls."""
SLOW = 20.0
"""A column that takes this many times as long as the fastest one of its scene is started once [1]."""
OURS, THEIRS = ("balanced", "paper", EQUAL_PROFILE), (MACHINE_PROFILE, EQUAL_PROFILE)
"""Profiles of the reference, and of the engines."""


@dataclass(frozen=True, slots=True)
class Contestant:
    """An engine under a name of its own: one process per restart plays all its settings."""

    name: str
    engine: str

    def settings(self, scenario: Scenario) -> list[Settings]:
        """Settings of all columns: where a scene has driven bodies, engines also with kinematic links."""
        profiles = ENGINES[self.engine].profiles
        if self.engine == REFERENCE:
            return [Settings(name, profiles[name]) for name in OURS]
        drives = ("native", "posed") if scenario.trackers else ("native",)
        names = [name for name in THEIRS if name in profiles]
        return [Settings(name, profiles[name], drive=drive) for name in names for drive in drives]


CONTESTANTS = tuple(Contestant(name, name) for name in ENGINES)
Key = tuple[str, str, str]
"""Scene, contestant's name and label of its settings."""


@dataclass(slots=True)
class Take:
    """What a column did in a scene: settings, the first restart's recording, times [s] of all restarts, and
    status and reason if it failed."""

    engine: str
    settings: Settings
    first: Recording | None = None
    times: list[Array] = field(default_factory=list)
    ended: tuple[str, str] | None = None

    @property
    def frame(self) -> float:
        """Mean time of a frame in the first restart [s]; infinite if there is none."""
        return float(self.times[0].mean()) if self.times else inf


def played(
    contestants: Sequence[Contestant],
    scenarios: Sequence[Scenario],
    restarts: int,
    seed: int,
    folder: Path,
    progress: Progress,
) -> Mapping[Key, Take]:
    """Play all scenes `restarts` times; contestants, scenes and settings in an order that the seed draws.

    The first restart plays each column once more before, for its recording, which stays in
    `folder`/recordings: times are those of plays that read no state.
    """
    rng = np.random.default_rng(seed)
    takes: dict[Key, Take] = {}
    for name in ("recordings", "output"):
        (folder / name).mkdir()
    for restart in range(restarts):
        for k in rng.permutation(len(contestants)):
            one = contestants[k]
            with Children(per_engine=True, core=last_core()) as children:
                for i in rng.permutation(len(scenarios)):
                    settings = one.settings(scenarios[i])
                    for j in rng.permutation(len(settings)):
                        key = (scenarios[i].name, one.name, settings[j].label)
                        take = takes.setdefault(key, Take(one.engine, settings[j]))
                        if take.ended is None and not (restart and _slow(key, takes)):
                            _play(key, take, scenarios[i], children, folder, progress)
                        progress(f"{one.name} {settings[j].label}", scenarios[i].frame_count)
    return {
        key: takes[key]
        for scenario in scenarios
        for one in contestants
        for settings in one.settings(scenario)
        if (key := (scenario.name, one.name, settings.label)) in takes
    }


def _play(
    key: Key, take: Take, scenario: Scenario, children: Children, folder: Path, progress: Progress
) -> None:
    if not installed(take.engine):
        take.ended = (MISSING, missing_reason(take.engine))
        return
    name = "-".join(key).replace(", ", "+")
    for reading in (True, False) if take.first is None else (False,):
        path = folder / "recordings" / f"{name if reading else 'times'}.npz"
        output = folder / "output" / f"{name}.txt"
        job = Job(take.engine, scenario, take.settings, path, output, BUDGET, reading)
        (outcome,) = children.play([job], lambda label, count: progress(label, 0))
        if outcome.status != "done":
            take.ended = (outcome.status, outcome.reason)
            return
        recording = load(path)
        if reading:
            take.first = recording
        else:
            path.unlink()
            take.times.append(recording.time_frame)


def _slow(key: Key, takes: Mapping[Key, Take]) -> bool:
    fastest = min(take.frame for other, take in takes.items() if other[0] == key[0])
    return takes[key].frame > SLOW * fastest

"""Play scenes for tests: each once a session, in child processes that are kept.

With a cache, a later session plays again only what other sources, versions, settings or scenes decide.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.recorder import scenario_json, substeps
from touchstone.adapters.recording import Recording, load
from touchstone.adapters.registry import installed, missing_reason, profiles_of, registered
from touchstone.adapters.workers.children import Children, Job
from touchstone.reports.assertions.play_cache import PlayCache
from touchstone.reports.names import checked
from touchstone.reports.sweep.content_hash import hash_of_run
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario

PATIENCE = 300.0
"""Time after which an engine that does not answer counts as hung [s]."""
ENGINE = "reference"
Played = tuple[str, str, Recording | None]
"""Status, reason and recording of a run."""


@dataclass
class Player:
    """Plays scenes for one test session; `profile` is that of all engines, "" the first of each.

    `played` and `found` count the runs that were played and those that `cache` had.
    """

    profile: str = ""
    cache: PlayCache = field(default_factory=PlayCache)
    played: int = 0
    found: int = 0
    _children: Children = field(default_factory=lambda: Children(patience=PATIENCE, together=True))
    _played: dict[tuple[str, str, Settings, int], Played] = field(default_factory=dict)

    def play(
        self,
        scene: str | Scenario,
        engine: str = ENGINE,
        profile: str = "",
        *,
        dt: float | None = None,
        effects: tuple[str, ...] | None = None,
        again: int = 0,
    ) -> Recording:
        """Recording of a scene on an engine, played once a session for equal arguments.

        Args:
            scene: name in the catalogue, or a scenario.
            engine: name, or "module:Class".
            profile: "": that of `--touchstone-profile`, or the first of the engine.
            dt: native step [s]; None: that of the profile.
            effects: as in `Settings`; None: those that the scene requires.
            again: a different number plays the same once more, and is kept beside it.
        The test is skipped where the engine is not installed or cannot represent the scene, and fails where
        the engine fails.
        """
        try:
            scenario = _scenario(scene)
            name = registered(engine)
            settings = _settings(name, profile or self.profile, dt, effects, scenario)
        except (AdapterError, ValueError) as error:
            said = str(error)
        else:
            said = ""
        if said:
            pytest.fail(said, pytrace=False)
        if not installed(name):
            pytest.skip(f"{name}: {missing_reason(name)}")
        text = scenario_json(scenario)
        key = (text, name, settings, again)
        if key not in self._played:
            self._played[key] = self._once(name, scenario, settings, again)
        status, reason, recording = self._played[key]
        if status == "skipped":
            pytest.skip(reason)
        if recording is None or (status != "done" and not recording.ended):
            pytest.fail(f"{name} {settings.label} on {scenario.name}: {reason}", pytrace=False)
        return recording

    def _once(self, name: str, scenario: Scenario, settings: Settings, again: int) -> Played:
        """Status, reason and recording of a run, from the cache if it has them."""
        key = hash_of_run(scenario, name, settings, again)
        kept = self.cache.get(key)
        if kept is not None:
            self.found += 1
            return kept
        self.played += 1
        with TemporaryDirectory() as folder:
            job = Job(name, scenario, settings, Path(folder, "run.npz"), Path(folder, "output.txt"))
            outcome = self._children.play([job], lambda label, frames: None)[0]
            self.cache.put(key, outcome.status, outcome.reason, job.recording)
            recording = load(job.recording) if outcome.recorded else None
            return outcome.status, outcome.reason, recording

    def close(self) -> None:
        """End the child processes; remove old recordings."""
        self._children.__exit__()
        self.cache.trim()


def _scenario(scene: str | Scenario) -> Scenario:
    """The scenario; raises ValueError for an unknown name."""
    return scene if isinstance(scene, Scenario) else catalogue()[checked("scene", scene, catalogue())]


def _settings(
    name: str, profile: str, dt: float | None, effects: tuple[str, ...] | None, scenario: Scenario
) -> Settings:
    """Settings of a run; raises AdapterError or ValueError for an unknown profile or an unfit step."""
    chosen = profile or next(iter(profiles_of(name)))
    step = dt or profiles_of(name, chosen)[chosen]
    substeps(scenario, step)
    return Settings(chosen, step, effects=effects)

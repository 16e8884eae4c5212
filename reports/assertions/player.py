"""Play scenes for tests: each once a session, in child processes that are kept.

With a cache, a later session plays again only what other sources, versions, settings or scenes decide.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.recorder import scenario_json, substeps
from touchstone.adapters.recording import Recording, RecordingError, load
from touchstone.adapters.registry import installed, missing_reason, profiles_of, registered
from touchstone.adapters.workers.children import Children, Job
from touchstone.reports.runner.content_hash import hash_of_run
from touchstone.scenarios.files.named import scenes_called
from touchstone.scenarios.scenario import Scenario

LARGEST = 10**9
"""Size of a cache that is kept [bytes]; beyond, what was not used for the longest time goes first."""
RECORDING, REFUSAL = ".npz", ".txt"


class PlayCache:
    """Recordings and refusals by key. Without a folder it is empty and stays so."""

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder

    def get(self, key: str) -> tuple[str, str, Recording | None] | None:
        """Status, reason and recording of a run; None if it is not kept. A damaged recording is removed."""
        if self._folder is None:
            return None
        refusal, recording = self._folder / (key + REFUSAL), self._folder / (key + RECORDING)
        try:
            if refusal.exists():
                os.utime(refusal)
                return "skipped", refusal.read_text(encoding="utf-8"), None
            if recording.exists():
                os.utime(recording)
                return "done", "", load(recording)
        except (RecordingError, OSError):
            recording.unlink(missing_ok=True)
        return None

    def put(self, key: str, status: str, reason: str, recording: Path) -> None:
        """Keep a run that was played to its end, or refused; others are played again. A full disk keeps
        nothing."""
        if self._folder is None or status not in ("done", "skipped"):
            return
        path = self._folder / (key + (RECORDING if status == "done" else REFUSAL))
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        try:
            if status == "done":
                shutil.copyfile(recording, part)
            else:
                part.write_text(reason, encoding="utf-8")
            os.replace(part, path)
        except OSError:
            part.unlink(missing_ok=True)

    def trim(self, largest: int = LARGEST) -> None:
        """Remove what was not used for the longest time until at most `largest` bytes remain."""
        if self._folder is None:
            return
        kept = []
        for path in self._folder.iterdir():
            try:
                facts = path.stat()
            except OSError:  # another worker of this session removed it
                continue
            kept.append((facts.st_mtime, facts.st_size, path))
        size = 0
        for _, own, path in sorted(kept, reverse=True):
            size += own
            if size > largest:
                path.unlink(missing_ok=True)


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
        scene: str | Path | Scenario,
        engine: str = ENGINE,
        profile: str = "",
        *,
        dt: float | None = None,
        effects: tuple[str, ...] | None = None,
        again: int = 0,
    ) -> Recording:
        """Recording of a scene on an engine, played once a session for equal arguments.

        Args:
            scene: name in the catalogue, file of a scene (.toml, .json, .py), or a scenario.
            engine: name, or "module:Class".
            profile: "": that of `--touchstone-profile`, or the first of the engine.
            dt: native step [s]; None: that of the profile.
            effects: as in `Settings`; None: those that the scene requires.
            again: a different number plays the same once more, and is kept beside it.
        The test is skipped where the engine is not installed or cannot represent the scene, and fails where
        the engine fails.
        """
        try:
            scenario = scene_of(scene)
            name = registered(engine)
            chosen = profile or self.profile or next(iter(profiles_of(name)))
            settings = Settings(chosen, dt or profiles_of(name, chosen)[chosen], effects=effects)
            substeps(scenario, settings.dt)
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


def scene_of(scene: str | Path | Scenario) -> Scenario:
    """The scenario of a name or a file; raises ValueError for an unknown name, an invalid file, or one with
    several scenes."""
    found = scenes_called(scene)
    if len(found) > 1:
        raise ValueError(f"{scene}: {len(found)} scenes; expected a file of one")
    return found[0]

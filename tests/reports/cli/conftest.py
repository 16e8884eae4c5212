"""What the program plays, and what it leaves in a folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from touchstone.adapters.workers.children import Outcome
from touchstone.reports.run import study
from touchstone.scenarios.catalogue import built, scene
from touchstone.scenarios.families import ball_snip as snip


@pytest.fixture
def handed_over(monkeypatch, registry):
    """Children that hand over the session's recordings in place of playing."""

    def play(self, jobs, progress):
        outcomes = []
        for job in jobs:
            progress(f"{job.engine} {job.settings.profile}", 0)
            registry.played(job.scenario.name, job.engine).save(job.recording)
            outcomes.append(Outcome(job, "done"))
        return outcomes

    monkeypatch.setattr(study.Children, "play", play)


@pytest.fixture
def quick(handed_over, monkeypatch):
    """The same, and no pictures."""
    for name in ("write_picture", "draw", "draw_forces"):
        monkeypatch.setattr(study, name, lambda *_: None)


@pytest.fixture(scope="module")
def stored_run(tmp_path_factory):
    """Copy the folder of a run into a working folder; the first time, play it."""
    kept = tmp_path_factory.mktemp("stored") / "run"

    def copy(play, folder):
        if not kept.exists():
            play()
            shutil.copytree(folder, kept)
        elif not folder.exists():
            shutil.copytree(kept, folder)

    return copy


@pytest.fixture
def added(monkeypatch):
    """Add a scene to the catalogue, or put another one in its place."""

    def add(build):
        monkeypatch.setattr(snip, "added", scene(build), raising=False)
        built.cache_clear()

    yield add
    built.cache_clear()


@pytest.fixture(scope="session")
def left():
    """Names in a folder."""
    return lambda folder: sorted(path.name for path in Path(folder).iterdir())

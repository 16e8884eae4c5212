"""What the program plays, and what it leaves in a folder."""

import pkgutil
import shutil
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.adapters.workers.children import Outcome
from touchstone.reports.run import study
from touchstone.scenarios import catalogue
from touchstone.scenarios.families import ball_snip as snip


@pytest.fixture
def played_by(monkeypatch):
    """Let jobs end as a function of each says, in place of children that play them."""

    def patch(outcome):
        def play(self, jobs, progress):
            for job in jobs:
                progress(f"{job.engine} {job.settings.profile}", 0)
            return [outcome(job) for job in jobs]

        monkeypatch.setattr(study.Children, "play", play)

    return patch


@pytest.fixture
def handed_over(played_by, registry):
    """Children that hand over the session's recordings in place of playing."""

    def outcome(job):
        registry.played(job.scenario.name, job.engine).save(job.recording)
        return Outcome(job, "done")

    played_by(outcome)


@pytest.fixture
def here(touchstone, played_by):
    """The program, whose children play in this process."""

    def outcome(job):
        settings = Settings(job.settings.profile, 1 / 60 if job.engine == "reference" else 1 / 480)
        record(load(job.engine), job.scenario, settings).save(job.recording)
        return Outcome(job, "done")

    played_by(outcome)
    return touchstone


@pytest.fixture
def unpictured(monkeypatch):
    """Runs that draw no pictures."""
    for name in ("write_picture", "draw"):
        monkeypatch.setattr(study, name, lambda *_: None)


@pytest.fixture
def quick(handed_over, unpictured):
    """Neither play nor pictures."""


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
    """Add a scene to a catalogue of the file of `ball_snip`, or put another one in its place."""
    families = [one for one in pkgutil.iter_modules([Path(snip.__file__).parent]) if one.name == "ball_snip"]
    monkeypatch.setattr(catalogue, "pkgutil", SimpleNamespace(iter_modules=lambda _: families))
    monkeypatch.setattr(catalogue, "built", cache(catalogue.built.__wrapped__))

    def add(build):
        monkeypatch.setattr(snip, "added", catalogue.scene(build), raising=False)
        catalogue.built.cache_clear()

    return add


@pytest.fixture(scope="session")
def left():
    """Names in a folder."""
    return lambda folder: sorted(path.name for path in Path(folder).iterdir())

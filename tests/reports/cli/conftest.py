"""The program called in an empty folder, and what it leaves there."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from touchstone.adapters.workers.children import Outcome
from touchstone.reports.cli import main as cli
from touchstone.reports.run import study
from touchstone.scenarios.catalogue import built, scene
from touchstone.scenarios.families import ball_snip as snip


@pytest.fixture
def touchstone(monkeypatch, capfd, tmp_path):
    """Call the program in this process, in an empty folder: (exit code, stdout, stderr)."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments):
        monkeypatch.setattr(sys, "argv", ["touchstone", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, err = capfd.readouterr()
        return end.value.code or 0, out, err

    return call


@pytest.fixture
def quick(monkeypatch, registry):
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

"""Runs that take too long or too much memory are refused before they do."""

from dataclasses import replace
from itertools import count

import pytest
import typer

from touchstone.reports.cli import main
from touchstone.reports.cli.options import YesOption, measuring
from touchstone.reports.runner import request as cost
from touchstone.reports.runner.request import TooLargeError, check_memory, limited
from touchstone.scenarios.catalogue import catalogue


@pytest.fixture
def clock(monkeypatch):
    """A clock that goes on by a second each time it is read, on an idle machine of two processors."""
    seconds = count(1.0)
    monkeypatch.setattr(cost, "monotonic", lambda: next(seconds))
    monkeypatch.setattr("os.getloadavg", lambda: (1.0, 1.0, 1.0))
    monkeypatch.setattr("os.cpu_count", lambda: 2)


def played(total, calls=40, frames=30):
    """Labels that a progress passes on while frames are played, one turn a second."""
    seen = []
    step = limited(lambda label, count: seen.append((label, count)), total)
    for k in range(calls):
        step("compiling", 0)
        step(f"turn {k}", frames)
    return seen


def test_a_long_run_is_told_by_its_first_frames(clock):
    """30 frames a second: 9 days of them are refused after FIRST_SECONDS, an hour and a half too."""
    with pytest.raises(TooLargeError, match=r"^23328000 frames would take about 9 days; --yes plays them$"):
        played(30 * 9 * 86400)
    with pytest.raises(TooLargeError, match=r"about 1\.5 hours"):
        played(30 * 5400)


def test_a_short_run_is_played(clock):
    """What ends within the hour, or before FIRST_SECONDS, has all its progress; above a minute, an
    estimate."""
    assert len(played(30 * 60)) == 80
    assert ("about 49.8 minutes for 90000 frames", 0) in played(30 * 3000)
    assert len(played(10**12, calls=5)) == 10


def test_a_loaded_machine_refuses_no_short_run(clock, monkeypatch):
    """Twenty processes on two processors: what takes five hours now takes half an hour without them."""
    monkeypatch.setattr("os.getloadavg", lambda: (20.0, 20.0, 20.0))
    assert len(played(30 * 5 * 3600)) == 81
    with pytest.raises(TooLargeError, match=r"about 21\.6 hours"):
        played(30 * 9 * 86400)


def test_recordings_that_no_memory_holds_are_refused():
    """The line names the scene, what it takes, and what there is."""
    fall = catalogue()["fall"]
    check_memory(list(catalogue().values()), 8)
    with pytest.raises(TooLargeError, match=r"^fall: 4 recordings of 599999940 frames take \d+ GB, and this"):
        check_memory([replace(fall, duration=9999999.0, expectations=())], 4)


def test_a_study_may_take_a_night(clock):
    """Studies say their steps, and have a longer limit."""

    def study(total: int) -> None:
        step = limited(lambda label, count: None, total, cost.STUDY_LONGEST, "steps")
        for _ in range(40):
            step("cell", 1)

    with pytest.raises(TooLargeError, match=r"^1000000000 steps would take about 31\.7 years; --yes"):
        study(10**9)
    study(40_000)


def test_studies_and_sweeps_ask_before_a_long_one(clock, capfd):
    """`--yes` is an option of all that play for long, and decides."""
    command = typer.main.get_command(main.app)
    for name in ("sweep", "cheapest", "versions"):
        assert "yes" in {one.name for one in command.commands[name].params}
    for study in command.commands["study"].commands.values():
        assert "yes" in {one.name for one in study.params}, study.name
    app = typer.Typer()

    @app.command()
    def long(yes: YesOption = False) -> None:
        with measuring(10**9, True) as step:
            for _ in range(40):
                step("cell", 1)

    assert app(["--yes"], standalone_mode=False) is None
    with pytest.raises(SystemExit, match="2"):
        app([], standalone_mode=False)
    assert "1000000000 steps would take about" in capfd.readouterr().err

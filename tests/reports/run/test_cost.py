"""Around a run: what it costs before it is played, slow heaps, and commands that measure rows again."""

import shlex
from dataclasses import replace
from itertools import count
from unittest.mock import Mock

import pytest
import typer

from touchstone.reports.cli import main
from touchstone.reports.cli.options import YesOption, measuring
from touchstone.reports.results import Row, rows_of
from touchstone.reports.run import ratios, study
from touchstone.reports.runner import request as cost
from touchstone.reports.runner.request import Request, TooLargeError, check_memory, limited, reproduce
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
    for own in command.commands["study"].commands.values():
        assert "yes" in {one.name for one in own.params}, own.name
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


def test_a_slow_engine_skips_the_rest_of_a_heap(monkeypatch, tmp_path):
    """Beyond its budget a column is skipped, with how far it came; scenes that are no heaps have none."""
    monkeypatch.setattr(study, "HEAP_BUDGET", 1e-9)
    scene = catalogue()["slip"]
    chosen = (replace(scene, name="heap", tags=("heap",)), scene)
    asked = Request(chosen, (("reference", "balanced"),), tmp_path / "run", metrics=("overlap.max",))
    rows = rows_of(study.run(asked, lambda label, frames: None).frame)
    (skipped,) = [row for row in rows if row.scenario == "heap"]
    assert (skipped.metric, skipped.verdict) == ("run", "skipped")
    assert skipped.reason.startswith("slow: its steps took ")
    assert skipped.reason.endswith(f" of {scene.frame_count} frames")
    assert any(row.metric == "overlap.max" for row in rows if row.scenario == "slip")


BOTH = "--engine reference --engine mujoco --profile balanced --profile recommended"


def row(engine: str, profile: str, dt: float, metric: str, subject: str = "") -> Row:
    return Row("run", "fall", engine, profile, dt, metric, 1.0, subject=subject)


OVERLAP = row("dart", "recommended", 1 / 1020, "overlap.max")
RATIO = row("reference", "balanced", 1 / 60, "ratio.time.p99", "mujoco recommended")


@pytest.mark.parametrize(
    ("rows", "line"),
    [
        ([OVERLAP], "--engine dart --profile recommended --metric overlap.max"),
        (
            [replace(OVERLAP, profile="recommended, drive=torque", dt=1 / 480)],
            "--engine dart --profile recommended --drive torque --dt 1/480 --metric overlap.max",
        ),
        (
            [replace(OVERLAP, profile="recommended, solver=pgs, effects=gravity+contact")],
            "--engine dart --profile recommended --set solver=pgs --effects gravity,contact"
            " --metric overlap.max",
        ),
        ([RATIO], f"{BOTH} --metric ratio.time.p99"),
        (
            [replace(RATIO, subject="mujoco recommended, cone=elliptic, drive=posed")],
            f"{BOTH} --set mujoco.cone=elliptic --drive posed --metric ratio.time.p99",
        ),
        (
            [replace(RATIO, profile="equal-step", dt=1 / 240, subject="dart equal-step")],
            "--engine reference --engine dart --profile equal-step --metric ratio.time.p99",
        ),
        (
            [
                row("reference", "balanced", 1 / 60, "time.frame.median"),
                row("mujoco", "recommended", 1 / 540, "time.frame.median"),
            ],
            f"{BOTH} --metric time.frame.median",
        ),
        (
            [row("all", "recommended", float("nan"), "events.touch.spread")],
            "--profile balanced --profile recommended --metric events.touch.spread",
        ),
    ],
)
def test_every_row_has_its_command(rows, line, monkeypatch):
    """Name scene, engines and profiles of all sides, changes, another step than the profile's, and metric."""
    assert reproduce(*rows) == f"touchstone run fall {line}"
    asked = Mock(side_effect=SystemExit)
    monkeypatch.setattr(cost, "Request", asked)
    with pytest.raises(SystemExit):
        main.app(shlex.split(reproduce(*rows))[1:], standalone_mode=False)
    asked.assert_called_once()


def test_restarts_are_those_of_the_bench():
    """A row of several restarts is measured again by the bench that restarts engines."""
    assert reproduce(replace(RATIO, study="bench frame")) == "touchstone bench frame fall"


def test_a_ratio_of_times_says_how_to_see_it(registry):
    """The ratio's row names the command that plays both of its engines, as the page shows it."""
    scene = catalogue()["ball_snip"]
    columns = [
        ratios.timed(engine, profile, first, [first.time_frame])
        for engine, profile in (("reference", "balanced"), ("mujoco", "recommended"))
        for first in [registry.played("ball_snip", engine)]
    ]
    rows = [r for r in ratios.ratio_rows("run", scene, columns, one_run=True) if r.metric == "ratio.time"]
    assert [r.reproduce for r in rows] == [f"touchstone run ball_snip {BOTH} --metric ratio.time"]


def test_a_column_has_the_frames_that_every_restart_played(registry):
    """A recorded restart of fewer frames than those played for their times is compared over its own."""
    whole = registry.played("fall", "reference")
    stages = whole.stage_seconds[:-2]
    cut = replace(whole, time_frame=whole.time_frame[:-2], work=whole.work[:-2], stage_seconds=stages)
    column = ratios.timed("reference", "balanced", cut, [whole.time_frame, whole.time_frame])
    assert column.times.shape == (2, len(cut.time_frame))
    assert column.contact.shape == cut.time_frame.shape

"""Commands that measure rows again."""

import shlex
from dataclasses import replace

import pytest

from touchstone.reports.cli import main as cli
from touchstone.reports.results import Row
from touchstone.reports.run import ratios
from touchstone.reports.runner.reproduce import reproduce
from touchstone.scenarios.catalogue import catalogue

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
    played = []
    monkeypatch.setattr(cli, "_request", lambda *given: played.append(given) or sys_exit())
    with pytest.raises(SystemExit):
        cli.app(shlex.split(reproduce(*rows))[1:], standalone_mode=False)
    assert played


def sys_exit():
    raise SystemExit


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

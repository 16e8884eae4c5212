"""Farthest apart: which body, between which columns, when, from when on, and up to which horizon."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.workers.children import Children, Job
from touchstone.reports.metrics.context import Context
from touchstone.reports.run.farthest_apart import THRESHOLD, apart_rows, measured_horizon
from touchstone.reports.views.apart import apart_table, headlines
from touchstone.scenarios.catalogue import catalogue

BALANCED, PAPER, MUJOCO = ("reference", "balanced"), ("reference", "paper"), ("mujoco", "recommended")


@pytest.fixture
def apart(lab, recordings):
    """Rows of one ball of 30 frames whose columns follow given heights over the frames."""
    scenario = lab.scene(lab.ball(), duration=0.5)

    def rows(horizon=lambda: np.nan, **heights):
        played = {}
        for column, height in zip((BALANCED, PAPER, MUJOCO), heights.values()):
            still = recordings.recording(scenario)
            position = still.position.copy()
            position[: len(height), 0, 2] += height
            played[column] = Context(replace(still, position=position), scenario)
        return apart_rows(scenario, played, horizon)

    return rows


def test_names_pair_moment_and_onset(apart):
    """A ball that leaves at a speed of 0.6 m/s is 0.3 m away after 0.5 s, and above 1 mm after one frame."""
    (row,) = apart(still=np.zeros(31), leaves=np.arange(31) * 0.01, close=np.full(31, 4e-4))
    assert (row.engine, row.metric, row.subject, row.unit) == ("all", "position.spread", "ball", "m")
    assert row.value == pytest.approx(0.3)
    assert row.reason == (
        "reference balanced and reference paper at 0.5 s; above 1 mm from 0.0167 s on; "
        "400 um without reference paper"
    )
    assert headlines([row]) == [f"farthest apart: ball, 300 mm: {row.reason}"]


def test_says_that_columns_stay_together(apart):
    """Below the threshold there is no outlier, and nothing is measured twice: no horizon is asked for."""

    def never():
        raise AssertionError

    (row,) = apart(never, one=np.zeros(31), other=np.full(31, THRESHOLD / 2), third=np.zeros(31))
    assert row.value == pytest.approx(THRESHOLD / 2)
    assert row.reason.endswith("; never above 1 mm")


def test_one_column_has_nothing_to_compare(apart):
    """No row and no line."""
    assert apart(one=np.zeros(31)) == []
    assert headlines([]) == []


def test_compares_up_to_the_horizon(apart):
    """What columns do after the horizon does not count; the row says so, and another one has the horizon."""
    late = np.where(np.arange(31) > 15, 5.0, 0.02)
    horizon, row = apart(lambda: 15 / 60, one=np.zeros(31), other=late)
    assert (horizon.metric, horizon.value, horizon.unit) == ("position.horizon", 0.25, "s")
    assert row.value == pytest.approx(0.02)
    assert row.reason.endswith("; until 0.25 s, the horizon of the scene")


def test_a_column_that_ends_early_is_compared_until_then(lab, recordings):
    """Recordings of 10 and 31 frames are compared over 10."""
    scenario = lab.scene(lab.ball(), duration=0.5)
    whole = recordings.recording(scenario)
    ended = replace(
        whole,
        **{n: getattr(whole, n)[:10] for n in ("time", "position", "orientation")},
        contacts=whole.contacts,
    )
    moved = replace(whole, position=whole.position + np.linspace(0, 1, 31)[:, None, None] * [0, 0, 1.0])
    played = {BALANCED: Context(ended, scenario), MUJOCO: Context(moved, scenario)}
    (row,) = apart_rows(scenario, played, lambda: np.nan)
    assert row.value == pytest.approx(9 / 30)


def test_a_table_counts_what_it_does_not_show(apart):
    """Of ten bodies the eight that are farthest apart, and the number of the others."""
    (row,) = apart(one=np.zeros(31), other=np.full(31, 0.01))
    lines = apart_table([replace(row, subject=f"b{k}", value=0.01 * k) for k in range(10)])
    assert [line[1] for line in lines] == [*(f"b{k}" for k in range(9, 1, -1)), "and 2 more"]
    assert lines[-1][2] == "at most 20 mm"


def played(scenario, folder: Path, children):
    job = Job("reference", scenario, Settings("balanced", 1 / 60), folder / "a.npz", folder / "a.txt")
    (outcome,) = children.play([job], lambda *_: None)
    assert outcome.status == "done", outcome.reason
    return job


def test_the_horizon_of_a_fall_is_its_end_and_of_collisions_before(tmp_path):
    """A fall keeps a perturbation as it is; a break of fifteen balls multiplies it at every collision."""
    with Children(together=True) as children:
        for scenario, amplifies in ((catalogue()["fall"], False), (catalogue()["break_15"], True)):
            job = played(scenario, tmp_path, children)
            horizon = measured_horizon(scenario, job, children, lambda *_: None)
            assert (horizon < scenario.duration) == amplifies
            assert horizon > 0


SQUEEZE = """
summary = "two pads squeeze a cube of 0.1 kg with 20 N"
duration = 2.0
coefficients = [
  { material_a = "wood", material_b = "pad", restitution = 0.0, friction = 0.7 },
  { material_a = "pad", material_b = "pad", restitution = 0.0, friction = 0.7 },
]

[[bodies]]
name = "cube"
kind = "simulated"
material = "wood"
position = [0.0, 0.0, 0.5]
mass = 0.1
pieces = [{ name = "cube", shape = { half_extents = [0.02, 0.02, 0.02] } }]
"""
PAD = """
[[bodies]]
name = "NAME"
kind = "driven"
material = "pad"
mass = 0.5
pieces = [{ name = "NAME", shape = { half_extents = [0.01, 0.03, 0.06] } }]

[[trackers]]
root = "NAME"
times = [0.0, 0.1, 2.0]
positions = [[SIGN0.0305, 0.0, 0.5], [SIGN0.02, 0.0, 0.5], [SIGN0.02, 0.0, 0.5]]
orientations = [[1.0, 0, 0, 0], [1.0, 0, 0, 0], [1.0, 0, 0, 0]]
interpolation = "linear"
stiffness = 2000.0
damping = 63.25
"""


@pytest.mark.engines
def test_the_first_line_of_an_own_scene_names_the_farthest_body(touchstone, tmp_path):
    """The paper's pipeline drops a cube by metres that the other columns hold; no limit judges it."""
    pads = (PAD.replace("NAME", name).replace("SIGN", sign) for name, sign in (("left", "-"), ("right", "")))
    (tmp_path / "squeeze.toml").write_text(SQUEEZE + "".join(pads))
    code, out, err = touchstone(
        *("run", "squeeze.toml", "--engine", "reference", "--engine", "mujoco", "--out", "run")
    )
    assert code == 0, err
    first = out.splitlines()[0]
    assert first.startswith("farthest apart: cube, "), first
    assert "m: reference balanced and reference paper at 2 s; above 1 mm from 0.0167 s on" in first
    report = (tmp_path / "run" / "report.md").read_text()
    assert "| squeeze | cube |" in report.partition("## Differences")[0]
    assert "position." not in report.partition("### Spread of the events")[2].partition("###")[0]
    assert "farthest apart: cube" in (tmp_path / "run" / "report.html").read_text()
    code, _, err = touchstone("judge", "run", "--out", "again", "--quiet")
    assert code == 0, err
    code, out, _ = touchstone("compare", "run", "again", "--metric", "position.*")
    assert (code, "0 worse" in out) == (0, True), out
    limit = "[[limits]]\nmetric = 'position.spread'\nsubject = 'cube'\nlargest = 0.01\n"
    (tmp_path / "limits.toml").write_text(limit)
    code, _, err = touchstone("judge", "run", "--out", "judged", "--limits", "limits.toml", "--quiet")
    assert (code, "position.spread" in err) == (1, True), err

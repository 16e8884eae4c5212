"""Parity of repeated plays, and of two backends of an engine."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.workers.pool import Ended
from touchstone.reports.metrics import PARITY
from touchstone.reports.metrics.context import Context
from touchstone.reports.run.farthest_apart import parity_rows
from touchstone.reports.runner.tasks import Task
from touchstone.reports.studies import parity
from touchstone.scenarios.catalogue import catalogue

FRAMES = 31
RECOMMENDED = Settings("recommended", 1 / 540)


@pytest.fixture
def task():
    return Task(catalogue()["fall"], "mujoco", RECOMMENDED)


def values(task, one, other):
    """Values and reasons of the rows of a pair of plays."""
    return [(row.value, row.reason, row.verdict) for row in parity.rows_of_pair("order", task, one, other)]


def test_a_pair_of_plays_has_a_distance_and_a_horizon(task):
    """Equal plays are equal to the bit; others have the last frame before a body is 1 mm away."""
    one = np.random.default_rng(0).normal(size=(FRAMES, 2, 13))
    end = (FRAMES - 1) / 60
    assert values(task, one, one.copy()) == [(0.0, "equal to the bit", ""), (end, "end", "")]
    turned = one.copy()
    turned[-1, 0, 5] += 1e-15 + np.spacing(turned[-1, 0, 5])
    assert values(task, one, turned) == [(0.0, "not equal", ""), (end, "end", "")]
    away = one.copy()
    away[12:, 1, 2] += 2e-3
    (distance, said, _), horizon = values(task, one, away)
    assert (distance, said) == (pytest.approx(2e-3), "not equal")
    assert horizon == (11 / 60, "beyond 1 mm", "")


def test_what_was_not_played_has_a_reason(task):
    """A variant that an engine refuses is skipped; one that fails is an error."""
    one = np.zeros((FRAMES, 1, 13))
    assert values(task, one, Ended("skipped", "no batch"))[0][1:] == ("no batch", "skipped")
    assert values(task, Ended("error", "died"), one)[0][1:] == ("died", "error")


def test_mujoco_repeats_itself_in_another_process(tmp_path):
    """The study plays what applies to an engine: no threads, batch or backend of MuJoCo."""
    frame = parity.run([("mujoco", "recommended")], [catalogue()["fall"]], tmp_path / "out", lambda *_: None)
    assert set(frame.metric) == {
        f"parity.{one}{end}" for one in ("process", "order") for end in ("", ".horizon")
    }
    assert frame[frame.metric == "parity.process"].reason.tolist() == ["equal to the bit"]
    assert parity.steps([("mujoco", "recommended")], [catalogue()["fall"]]) == 3
    (line,) = parity.report(frame)[0].rows
    assert line[:3] == ["mujoco recommended", "1 of 1", "-"]


def test_a_backend_is_compared_with_the_engine(registry):
    """The row of the second backend has the time for which bodies are within 1 mm of the first one's."""
    recording = registry.played("slide", "mujoco")
    scene = catalogue()["slide"]
    moved = recording.position.copy()
    moved[30:, 1:, 0] += 5e-3
    first, second = (Context(one, scene) for one in (recording, replace(recording, position=moved)))
    rows = parity_rows(scene, {("mujoco", "recommended"): first, ("mujoco_warp", "recommended"): second})
    (row,) = rows
    assert (row.engine, row.metric, row.value) == ("mujoco_warp", PARITY, pytest.approx(29 / 60))
    assert row.reason == "bodies are within 1 mm of those of mujoco, at most 5 mm apart"
    assert parity_rows(scene, {("mujoco_warp", "recommended"): second}) == []
    assert parity_rows(scene, {("mujoco", "default"): first, ("mujoco_warp", "recommended"): second}) == []

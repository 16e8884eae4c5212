"""Every engine on every scene of the gallery: what must happen happens, and no limit is broken unawares."""

from __future__ import annotations

import numpy as np
import pytest
from same_recording import SHORT, different

from touchstone.adapters.recorder import record
from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.motion.events import subjects
from touchstone.scenarios.catalogue import catalogue, tagged

GALLERY = [scenario.name for scenario in tagged("gallery")]
USUAL = ("ball_snip",)
"""A hand's scene: what other engines than the reference play, but in slow tests."""
PLAYED = [
    (engine, scene)
    if engine == "reference" or scene in USUAL
    else pytest.param(engine, scene, marks=pytest.mark.slow)
    for engine in ENGINES
    for scene in GALLERY
]
REPEATED = [
    pytest.param(one.name, marks=pytest.mark.slow) if "heap" in one.tags else one.name
    for one in catalogue().values()
    if one.name not in SHORT
]
"""Scenes that are played twice here: `test_plan_and_all_effects_are_one` plays all others a second time."""


@pytest.fixture(scope="module")
def rows(registry):
    """The judged rows of an engine on a scene."""
    return lambda engine, scene: registry.judged_rows(scene, engine)


@pytest.mark.parametrize(("engine", "scene"), PLAYED)
def test_no_limit_is_broken(rows, engine, scene):
    """No row fails: every limit is met, or its breach is a known failing that still fails."""
    failed = [f"{r.metric} {r.subject}: {r.reason}" for r in rows(engine, scene) if r.verdict == "fail"]
    assert failed == []


@pytest.mark.parametrize(("engine", "scene"), PLAYED)
def test_every_metric_leaves_a_row(rows, engine, scene):
    """Each metric has at least one row, a value or a reason: never a missing one."""
    found = rows(engine, scene)
    assert {row.metric for row in found} == set(METRICS)
    assert all(np.isfinite(row.value) or row.reason for row in found)


@pytest.mark.parametrize(("engine", "scene"), PLAYED)
def test_what_is_expected_happens(rows, engine, scene):
    """Every expected event has its own row, happened within its window, and passes, or is known not to."""
    events = {(row.metric, row.subject): row for row in rows(engine, scene)}
    expectations = subjects(catalogue()[scene])
    assert expectations
    for (event, subject), e in expectations.items():
        row = events[f"events.{event}", subject]
        if row.verdict == "known":  # a documented failing keeps it from happening
            continue
        assert e.earliest <= row.value <= e.latest
        assert (row.verdict, row.low, row.high) == ("pass", e.earliest, e.latest)


@pytest.mark.parametrize(("engine", "scene"), PLAYED)
def test_states_stay_sane(registry, engine, scene):
    """States are finite, quaternions are unit, and fixed bodies stay where they are."""
    recording, scenario = registry.played(scene, engine), catalogue()[scene]
    for name in (
        "position",
        "orientation",
        "linear_velocity",
        "angular_velocity",
        "joint_angle",
        "joint_rate",
    ):
        assert np.isfinite(getattr(recording, name)).all(), name
    # rounding; Bullet normalises once a step
    assert np.linalg.norm(recording.orientation, axis=2) == pytest.approx(1.0, abs=1e-9)
    for k, body in enumerate(scenario.bodies):
        if body.kind == "fixed":
            assert np.ptp(recording.position[:, k], axis=0).max() == 0
            assert (recording.linear_velocity[:, k] == 0).all()


@pytest.mark.slow
def test_a_heap_comes_to_rest(rows):
    """Lose no ball of 216, leave none rolling, and meet every other limit or fail as it is known to."""
    reported = {row.metric: row for row in rows("reference", "balls_box")}
    assert [row.metric for row in reported.values() if row.verdict == "fail"] == []
    assert {reported[name].verdict for name in ("rest.speed", "rest.lost", "overlap.max")} == {"pass"}


@pytest.mark.parametrize("scene", REPEATED)
def test_the_reference_repeats_to_the_bit(registry, scene):
    """Two runs of the reference leave the same recording, but for what the clock says."""
    again = record(registry.engine("reference"), catalogue()[scene], registry.settings("reference"))
    assert different(registry.played(scene, "reference"), again) == set()

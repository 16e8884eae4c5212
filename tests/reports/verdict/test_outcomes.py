"""The classifier names every scripted failure, and no engine's word changes it."""

from dataclasses import replace

import pytest

from tests.reports.verdict.fake_engines import Engine
from touchstone.adapters.contract import Settings
from touchstone.reports.studies.stability.play import FAILED, hard_cell, outcome, play_scenario, recordings_in
from touchstone.reports.verdict.outcomes import GROSS, HARD_CLASSES, SILENT
from touchstone.scenarios.difficulty.family import families, hard_names, hard_scene, level_text

SCRIPTS = {
    "rests": "ok",
    "unsupported": "skipped",
    "raises": "error",
    "slow": "slow",
    "announces": "gave up",
    "sinks and says so": "gave up",
    "not finite": "non-finite",
    "finite position only": "exploded",
    "resets": "auto-reset",
    "explodes": "exploded",
    "spins up": "exploded",
    "tunnels": "tunnelled",
    "sinks": "sink-through",
    "lies about contacts": "sink-through",
    "creeps": "creep",
    "jitters": "jitter",
    "sinks a little": "inaccurate",
    "hovers": "inaccurate",
}
"""Script of a fake engine, and its class."""


@pytest.fixture
def scene():
    """A cube that rests on the floor."""
    return hard_scene("hard_strong_gravity_9.81")


@pytest.mark.parametrize(("script", "expected"), SCRIPTS.items())
def test_each_script_has_its_class(scene, script, expected):
    """A script of every class is recognised, with a reason for all but `ok`."""
    scenario, checks = scene
    budget = 0.2 if script == "slow" else 60.0
    found = play_scenario(Engine(script), scenario, checks, Settings("any", 1 / 60), budget)
    assert found.name == expected, found.reason
    assert bool(found.reason) == (expected != "ok")


def test_every_class_has_a_script():
    """No class is without a fake."""
    assert set(SCRIPTS.values()) == set(HARD_CLASSES)
    assert set(GROSS) < set(SILENT) < set(HARD_CLASSES)


def test_what_gave_up_keeps_the_failure_below(scene):
    """A failure that was announced names the silent class that it would have been."""
    scenario, checks = scene
    found = play_scenario(Engine("sinks and says so"), scenario, checks, Settings("any", 1 / 60))
    assert found.under == "sink-through"
    assert "gave_up" in found.reason


def test_an_allowed_overlap_is_one_at_the_start_alone(scene):
    """Where the scene starts in overlap, what remains of it later fails."""
    scenario, checks = scene
    body = replace(scenario.bodies[-1], position=(0.0, 0.0, 0.04))
    deep = replace(scenario, bodies=(*scenario.bodies[:-1], body), truths=())
    settings = Settings("any", 1 / 60)
    allowed, parted = (replace(checks, parted_by=end) for end in (float("inf"), 0.5))
    assert play_scenario(Engine("rests"), deep, allowed, settings).name == "ok"
    assert play_scenario(Engine("rests"), deep, parted, settings).name == "inaccurate"


def test_a_failed_cell_keeps_its_recording(tmp_path):
    """A failed run leaves its recording, one that is ok leaves none."""
    cell = hard_cell("hard_strong_gravity_9.81", "fake", "any", 1 / 60)
    for fault, name, count in (("tunnels", "tunnelled", 1), ("rests", "ok", 0)):
        folder = tmp_path / fault
        with recordings_in(FAILED, folder):
            measured = outcome(cell, hard_scene(cell.scenario)[0], Engine(fault))
        assert measured.rows[0].subject == name
        assert len(list(folder.glob("*.npz"))) == count


def test_names_of_hard_scenes_are_known_without_building_them(monkeypatch):
    """Names and levels need no scene; each scene has the name that it is listed by."""
    monkeypatch.setattr("touchstone.scenarios.difficulty.family.Family.scene", None)
    assert len(hard_names()) == sum(len(one.levels) for one in families().values())
    assert level_text(1e-5) == "1e-5"
    assert level_text(1e6) == "1e6"


@pytest.mark.parametrize("name", families())
def test_every_level_is_a_valid_scene(name):
    """All levels of a family build, in the tag `hard`, with steps from 1/30 s on."""
    family = families()[name]
    assert family.summary
    for level in family.levels:
        scenario, _ = family.scene(level)
        assert scenario.name == family.scene_name(level)
        assert scenario.tags[0] == "hard"
        assert scenario.frame_rate == 30

"""Deviation from the tracked posture in closed form, and against the best known one."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.reports.metrics import posture as posture_optimum
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue


def test_deviation_is_the_root_mean_square(registry, known):
    """One of 27 hinges off by 0.1 rad in every frame deviates by 0.1 / sqrt 27, whoever is said to play."""
    scenario = catalogue()["wall_push"]
    shown = sample(scenario.trackers[0], registry.played("wall_push", "reference").time).angle
    shown[:, 3] += 0.1
    recording = replace(registry.played("wall_push", "reference"), joint_angle=shown)
    found = known.value("posture.deviation", recording, scenario)[""]
    assert found == pytest.approx(0.1 / np.sqrt(27), rel=1e-9)


@pytest.mark.parametrize("scene", ["wall_push", "arms_cross"])
def test_nothing_shown_beats_the_best(registry, known, monkeypatch, scene):
    """The posture shown is free and one of the starts: the best is nearer, but for 1e-6 m of overlap."""
    monkeypatch.setattr(posture_optimum, "FRAMES", 3)
    recording = registry.played(scene, "reference")
    found = known.value("posture.over_best", recording, catalogue()[scene])
    assert set(found) == {""}
    assert 1 - 1e-4 < found[""] < 1.3


def test_where_it_is_not_measured(registry, known):
    """Hands have no chains."""
    scene = catalogue()["ball_snip"]
    said = known.unmeasured("posture.over_best", registry.played("ball_snip", "reference"), scene)
    assert "no driven body with chains" in said


def test_a_trunk_out_of_reach_leaves_nothing_to_compare(registry, known, monkeypatch):
    """A person shown high above floor and wall could take the tracked posture itself: there is no ratio."""
    monkeypatch.setattr(posture_optimum, "FRAMES", 2)
    scenario, recording = catalogue()["wall_push"], registry.played("wall_push", "reference")
    lift = [[0.0, 0.0, 0.0 if body.kind == "fixed" else 5.0] for body in scenario.bodies]
    away = replace(recording, position=recording.position + lift)
    said = known.unmeasured("posture.over_best", away, scenario)
    assert "tracked postures are free where the root is shown" in said


def test_the_pressed_frames_are_the_trackers(registry):
    """The frames that are judged follow from the tracker, whatever is shown."""
    scenario, recording = catalogue()["wall_push"], registry.played("wall_push", "reference")
    away = replace(recording, position=recording.position + (0.0, 5.0, 0.0))
    ours, theirs = (posture_optimum._person(Context(r, scenario))[1] for r in (recording, away))
    assert len(ours) > 30
    np.testing.assert_array_equal(ours, theirs)

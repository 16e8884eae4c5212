"""Mirror symmetry and rest, kept and broken by known amounts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from touchstone.reports.metrics.context import NotMeasured
from touchstone.scenarios.catalogue import catalogue


def moving(recordings, scenario, velocities):
    """A recording in which bodies have constant velocities, by name, and stand all the same."""
    columns = np.zeros((scenario.frame_count + 1, len(scenario.bodies), 3))
    for name, velocity in velocities.items():
        columns[:, scenario.body_index(name)] = velocity
    return recordings.recording(scenario, linear_velocity=columns)


def test_a_mirrored_break_is_symmetric(recordings, known):
    """Balls 2 and 3 part to either side; what one lacks is found, and named."""
    scenario = catalogue()["break_15"]
    mirrored = {"cue": (0.0, 1.0, 0.0), "ball_2": (-1.0, 2.0, 0.3), "ball_3": (1.0, 2.0, 0.3)}
    found = known.value("symmetry.mirror", moving(recordings, scenario, mirrored), scenario)[""]
    assert found.value == 0.0
    broken = moving(recordings, scenario, mirrored | {"ball_3": (1.0, 2.0, 0.2)})
    found = known.value("symmetry.mirror", broken, scenario)[""]
    assert found.value == pytest.approx(0.1, rel=1e-12)
    assert found.reason in ("of ball_2", "of ball_3")


def test_what_leaves_the_mirror_plane_counts_twice(recordings, known):
    """A domino that drifts aside is as far from its own mirror image as it drifts to both sides."""
    scenario = catalogue()["dominoes"]
    aside = moving(recordings, scenario, {"domino_4": (0.01, 0.5, 0.0)})
    assert known.value("symmetry.mirror", aside, scenario)[""].value == pytest.approx(0.02, rel=1e-12)
    position = aside.position.copy()
    position[7, scenario.body_index("domino_4"), 0] += 3e-3
    found = known.value("symmetry.offset", replace(aside, position=position), scenario)[""]
    assert (found.value, found.reason) == (pytest.approx(6e-3, rel=1e-12), "of domino_4")


def test_no_symmetry_without_partners(recordings, known):
    """Measure nothing in scenes that are not tagged, or that are tagged by mistake."""
    scenario = catalogue()["tower_10"]
    with pytest.raises(NotMeasured, match="not tagged symmetric"):
        known.value("symmetry.mirror", recordings.recording(scenario), scenario)
    wrong = replace(catalogue()["tip_holds"], tags=("symmetric",))
    with pytest.raises(NotMeasured, match="box has no mirror image"):
        known.value("symmetry.mirror", recordings.recording(wrong), wrong)


def test_what_settles_does_not_drift(recordings, known):
    """Tell the farthest of what must stay in the first half, and of what moves on in the second."""
    scenario = catalogue()["tower_10"]
    still = recordings.recording(scenario)
    middle = len(still.time) // 2
    position = still.position.copy()
    position[7:, 3] += (3e-3, 0.0, -4e-3)
    position[middle + 9, 5] += (1e-3, 0.0, 0.0)
    moved = replace(still, position=position)
    for metric, value, body in (("rest.settled", 5e-3, "box_3"), ("rest.drift", 1e-3, "box_5")):
        assert known.value(metric, still, scenario)[""].value == 0.0
        found = known.value(metric, moved, scenario)[""]
        assert (found.value, found.reason) == (pytest.approx(value, rel=1e-9), f"of {body}")
        with pytest.raises(NotMeasured, match="no body rests"):
            known.value(metric, recordings.recording(catalogue()["fall"]), catalogue()["fall"])

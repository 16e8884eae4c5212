"""Rest at the end of a run: what still goes, and what is no longer where it should be."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from touchstone.reports.metrics.context import NotMeasured


@pytest.fixture
def scene(lab):
    """Two balls over a fixed block of 2 m by 2 m by 1 m, turned by a quarter about z and shifted by 1 m."""
    block = lab.block("block", (1.0, 1.0, 0.5), (1.0, 0.0, -0.5), kind="fixed")
    block = dataclasses.replace(block, orientation=(0.5**0.5, 0.0, 0.0, 0.5**0.5))
    one, two = lab.ball("one", (0.5, 0.0, -0.2)), lab.ball("two", (1.5, 0.5, -0.2))
    return dataclasses.replace(lab.scene(block, one, two, duration=1.0), tags=("settles",))


def moved(recordings, scene, way):
    """A recording in which the second ball goes `way` [m], evenly over the last half second."""
    position = np.tile([body.position for body in scene.bodies], (61, 1, 1))
    position[30:, 2] += np.linspace(0, 1, 31)[:, None] * way
    return recordings.recording(scene, position=position)


@pytest.mark.parametrize(
    ("way", "lost"), [((0, 0, 0), 0), ((0.4, 0.4, 0), 0), ((0.6, 0, 0), 1), ((0, 0, 0.3), 1)]
)
def test_what_goes_and_what_is_gone(recordings, known, scene, way, lost):
    """Tell the way of the last half second over it, and who ends outside the box round the fixed bodies."""
    recording = moved(recordings, scene, way)
    reported = known.value("rest.speed", recording, scene)[""]
    assert reported.value == pytest.approx(np.linalg.norm(way) / 0.5, rel=1e-12)
    if any(way):
        assert reported.reason == "of two"
    assert known.value("rest.lost", recording, scene) == {"": lost}


@pytest.mark.parametrize("name", ["rest.speed", "rest.lost"])
def test_only_an_end_that_is_asked_for_is_judged(recordings, known, scene, name):
    """Measure nothing in scenes that need not settle, nor in a run that was left off."""
    recording = moved(recordings, scene, (0, 0, 0))
    with pytest.raises(NotMeasured, match="nothing has to come to rest"):
        known.value(name, recording, dataclasses.replace(scene, tags=()))
    with pytest.raises(NotMeasured, match="the end was not played"):
        known.value(name, recording, dataclasses.replace(scene, duration=2.0))

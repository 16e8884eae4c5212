"""Overlap and hovering of known size; passages have a file of their own."""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.context import Context
from touchstone.scenarios.scenario import Tracker

EXACT = 1e-7
"""Ten times the oracle's tolerance [m]."""
ROUNDING = 1e-9


@pytest.fixture(scope="module")
def sinking(lab, recordings):
    """A block and a ball on the ground; the block's depth over the 11 frames, the ball stays 1 mm deep."""
    block = lab.block("block", (0.1, 0.1, 0.1), (0.0, 0.0, 0.1))
    ball = lab.ball(position=(1.0, 0.0, 0.049))
    scenario = lab.scene(lab.ground(), block, ball, duration=10 / 60)
    depth = np.array([0, 0, 2, 3, 8, 3, 2, 0, 0, 0, 0]) * 1e-3
    position = np.tile([body.position for body in scenario.bodies], (11, 1, 1))
    position[:, 1, 2] -= depth
    return recordings.recording(scenario, position=position), scenario, depth


def test_overlap_of_known_depth(sinking, known):
    """The deepest frame, the 95th percentile of the deepest pair, and the sum over pairs and time."""
    recording, scenario, depth = sinking
    deepest = np.maximum(depth, 1e-3)
    assert known.value("overlap.max", recording, scenario)[""] == pytest.approx(8e-3, abs=EXACT)
    p95 = np.sort(deepest)[9] / 2 + np.sort(deepest)[10] / 2
    assert known.value("overlap.p95", recording, scenario)[""] == pytest.approx(p95, abs=EXACT)
    total = (depth.sum() + 11 * 1e-3) / 60
    assert known.value("overlap.time", recording, scenario)[""] == pytest.approx(total, abs=11 * EXACT / 60)


def test_a_lone_body_overlaps_nothing(lab, recordings, known):
    """In a scene where nothing may touch there is no overlap to measure, and no error."""
    scenario = lab.scene(lab.ball(), duration=0.1)
    recording = recordings.recording(scenario)
    for name in ("overlap.max", "overlap.p95"):
        assert "no two bodies may touch" in known.unmeasured(name, recording, scenario)
    assert known.value("overlap.time", recording, scenario)[""] == 0.0
    assert known.value("energy.injected", recording, scenario)["simulated"] == 0.0


@pytest.mark.parametrize("gap", [3e-4, -2e-3])
def test_the_gap_of_a_body_at_rest_is_signed(lab, recordings, known, gap):
    """A resting body's hovering or sinking is its median gap over the frames in which it rests."""
    scenario = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 0.05 + gap)), duration=1.0)
    columns = known.path(scenario, 1, scenario.bodies[1].position, np.zeros(3))
    columns["linear_velocity"][:20, 1] = (0.5, 0.0, 0.0)  # a third of the time it moves
    columns["position"][:20, 1, 2] += 2e-3
    recording = recordings.recording(scenario, **columns)
    assert known.value("contact.gap", recording, scenario) == {"ground-ball": pytest.approx(gap, abs=EXACT)}


def test_pairs_at_rest_are_visited_once(lab, recordings):
    """A thousand bodies on a floor have a thousand pairs: a visit of all of them per body takes minutes."""

    class Visited(dict):
        visits = 0

        def items(self):
            self.visits += 1
            return super().items()

    balls = [lab.ball(f"ball {k}", position=(k, 0.0, 0.05)) for k in range(6)]
    scenario = lab.scene(lab.ground(), *balls, duration=0.5)
    context = Context(recordings.recording(scenario), scenario)
    object.__setattr__(context.distances, "distance", Visited(context.distances.distance))
    found = dict(METRICS["contact.gap"].measure(context))
    assert list(found) == [f"ground-ball {k}" for k in range(6)]
    assert context.distances.distance.visits == 1


def test_what_never_rests_has_no_gap(lab, recordings, known):
    """A body that hangs in the air, or moves on its support, has no gap at rest."""
    for height, speed in ((1.0, 0.0), (0.05, 0.5)):
        scenario = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, height)), duration=0.5)
        columns = known.path(scenario, 1, scenario.bodies[1].position, (speed, 0.0, 0.0))
        said = known.unmeasured("contact.gap", recordings.recording(scenario, **columns), scenario)
        assert "no body rests" in said


@pytest.fixture
def pressed(lab):
    """A driven box whose tracker stands 1 cm inside the ground from the third frame on: scenario."""
    box = lab.block("box", (0.05, 0.05, 0.05), (0.0, 0.0, 0.0), kind="driven")
    tracker = Tracker(
        "box",
        (),
        (0.0, 0.03, 1.0),
        ((0.0, 0.0, 0.2), (0.0, 0.0, 0.04), (0.0, 0.0, 0.04)),
        ((1.0, 0.0, 0.0, 0.0),) * 3,
        ((), (), ()),
    )
    return lab.scene(lab.ground(), box, trackers=(tracker,), duration=0.5)


@pytest.mark.parametrize("gap", [1e-3, 0.0, -2e-3])
def test_the_gap_of_a_pressed_body_is_signed(recordings, known, pressed, gap):
    """What a tracker presses down hovers, touches or sinks; where it comes from does not count."""
    height = np.full(pressed.frame_count + 1, 0.05 + gap)
    height[:8] = 0.3
    path = np.column_stack((np.zeros((len(height), 2)), height))
    recording = recordings.recording(pressed, **known.path(pressed, 1, path, 0.0))
    found = known.value("contact.gap", recording, pressed)
    assert found == {"ground-box": pytest.approx(gap, abs=EXACT)}


def test_what_is_pressed_into_nothing_has_no_gap(lab, recordings, known, pressed):
    """A body that hovers with its tracker is not pressed; nor is one far from what it is pressed at."""
    free = replace(pressed, trackers=(lab.still("box", (0.0, 0.0, 0.051)),))
    for scenario, height in ((free, 0.051), (pressed, 0.5)):
        path = np.tile((0.0, 0.0, height), (scenario.frame_count + 1, 1))
        recording = recordings.recording(scenario, **known.path(scenario, 1, path, 0.0))
        assert "none is pressed" in known.unmeasured("contact.gap", recording, scenario)

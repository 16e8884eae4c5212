"""Bounces and landings between frames, against the closed form of a bouncing ball."""

from __future__ import annotations

import numpy as np
import pytest

from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.events import TOUCH_GAP, bounces, first_closing, gap_of
from touchstone.scenarios.scenario import Expectation

BETWEEN_FRAMES = 1e-6
"""What the oracle's 1e-8 m are worth in time at the slowest speed here, ten times over [s]."""
HEIGHT = 1.0


@pytest.fixture(scope="module")
def drop(lab, recordings, known):
    """Context of a ball dropped from HEIGHT that bounces with e, asked to have 0.6, for a duration."""

    def build(e, duration=1.5, height=HEIGHT):
        expected = (Expectation("land", "ball", "ground", 0.0, duration),)
        ball, ground = lab.ball(position=(0.0, 0.0, height + known.radius)), lab.ground()
        scenario = lab.scene(ground, ball, e=0.6, duration=duration, expectations=expected)
        times = np.arange(scenario.frame_count + 1) / 60
        gap, speed = known.bouncing(times, height, e)
        position = np.column_stack([0 * gap, 0 * gap, gap + known.radius])
        velocity = np.column_stack([0 * gap, 0 * gap, speed])
        return recordings.recording(scenario, **known.path(scenario, 1, position, velocity)), scenario

    return build


@pytest.mark.parametrize("e", [0.5, 0.8, 1.0])
def test_bounces_have_their_time_and_restitution(drop, known, e):
    """Every bounce of a ball is found at its time, with its speeds and its restitution."""
    recording, scenario = drop(e)
    found = bounces(Context(recording, scenario), (0, 1))
    impact = (2 * HEIGHT * known.g) ** 0.5
    fall = impact / known.g
    times = [fall]
    # as long as they are judged at all
    while (speed := e ** len(times) * impact) > 1 and times[-1] + 2 * speed / known.g < scenario.duration:
        times.append(times[-1] + 2 * speed / known.g)
    assert len(times) >= 2
    assert len([bounce for bounce in found if bounce.approach > 1]) == len(times)
    for k, (bounce, time) in enumerate(zip(found, times)):
        approach = e**k * impact
        assert bounce.approach == pytest.approx(approach, abs=1e-6)
        # the gap is closed at TOUCH_GAP, so much earlier
        at_gap = (approach**2 - 2 * known.g * TOUCH_GAP) ** 0.5
        assert bounce.time == pytest.approx(time - (approach - at_gap) / known.g, abs=BETWEEN_FRAMES)
        assert bounce.restitution == pytest.approx(e, abs=1e-6)


def test_restitution_is_reported_beside_what_was_asked(drop, known):
    """Fast bounces on fixed bodies are numbered rows beside the e asked for; the error is the worst one."""
    recording, scenario = drop(0.7)
    achieved = known.value("restitution.achieved", recording, scenario)
    assert list(achieved) == ["ground-ball #1", "ground-ball #2"]
    for found in achieved.values():
        assert found.value == pytest.approx(0.7, abs=1e-6)
    assert achieved["ground-ball #1"].reason == "asked 0.6, approach 4.43 m/s"
    error = known.value("restitution.error", recording, scenario)
    assert error[""] == pytest.approx(max(abs(found.value - 0.6) for found in achieved.values()), abs=1e-12)


@pytest.mark.parametrize("height", [0.003, 0.1, 0.31, 1.0, 2.5])
def test_landing_time_of_a_fall(drop, known, height):
    """A ball dropped at rest lands after sqrt(2 h / g), whatever the frames around it."""
    recording, scenario = drop(0.0 if height < 0.1 else 0.4, 1.0, height)
    landing = known.value("events.land", recording, scenario)["ball-ground"]
    assert landing == pytest.approx((2 * (height - TOUCH_GAP) / known.g) ** 0.5, abs=BETWEEN_FRAMES)


def test_slow_bounces_are_not_judged(drop, known):
    """A drop that ends below 1 m/s has no judged bounce, and says so."""
    recording, scenario = drop(0.5, 0.5, height=0.03)
    with pytest.raises(NotMeasured, match="no bounce faster than 1"):
        known.value("restitution.achieved", recording, scenario)


def test_what_passes_by_does_not_touch(lab, recordings, known):
    """A ball that is thrown up and falls back to just above the ground never closes the gap."""
    expected = (Expectation("touch", "ball", "ground", 0.0, 0.5),)
    scenario = lab.scene(lab.ground(), lab.ball(), duration=0.5, expectations=expected)
    t = np.arange(31) / 60
    z = known.radius + 0.01 + 2.0 * t - known.g / 2 * t**2
    z, vz = z[t < 0.4], (2.0 - known.g * t)[t < 0.4]
    # held before it comes down
    z, vz = (np.concatenate([a, np.full(31 - len(a), b)]) for a, b in ((z, z[-1]), (vz, 0.0)))
    zero = np.zeros(31)
    columns = known.path(scenario, 1, np.column_stack([zero, zero, z]), np.column_stack([zero, zero, vz]))
    touch = known.value("events.touch", recordings.recording(scenario, **columns), scenario)
    assert np.isnan(touch["ball-ground"])


def test_the_nearest_of_several_pairs_counts(lab, recordings):
    """The gap to a group of bodies is the gap to the nearest, frame by frame."""
    bodies = (lab.ball("one"), lab.ball("two", (1.0, 0.0, 1.0)), lab.ball("mover", (0.2, 0.0, 1.0)))
    expected = tuple(Expectation("touch", "mover", name, 0.0, 0.1) for name in ("one", "two"))
    scenario = lab.scene(*bodies, effects=(), duration=0.1, expectations=expected)
    positions = np.tile([body.position for body in bodies], (7, 1, 1))
    positions[:, 2, 0] = np.linspace(0.2, 0.8, 7)
    velocities = np.zeros_like(positions)
    velocities[:, 2, 0] = 6.0
    context = Context(
        recordings.recording(scenario, position=positions, linear_velocity=velocities), scenario
    )
    g = gap_of(context, [(0, 2), (1, 2)])
    assert g.gap == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.3, 0.2, 0.1], abs=1e-7)
    assert g.rate == pytest.approx([6.0] * 4 + [-6.0] * 3, abs=1e-6) or g.rate == pytest.approx(
        [6.0] * 3 + [-6.0] * 4, abs=1e-6
    )
    # without gravity the last frames' arc would close a frame later
    assert np.isnan(first_closing(context, g, 0.0))

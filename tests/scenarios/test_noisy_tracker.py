"""Noisy trackers: what they add to an ideal one, and that they add the same every time."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.noisy_tracker import JITTER, JITTER_ANGLE, LOSS, RATE, noisy, noisy_tracker
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import IDENTITY, Tracker

LONG = 200.0
"""A recording of 12,001 samples [s]: standard deviations are good to a percent, chances to a tenth."""


@pytest.fixture(scope="module")
def still() -> Tracker:
    """A tracker at rest that reports noise alone."""
    tracker = Tracker("hand", ("a", "b"), (0.0, LONG), ((0.0,) * 3,) * 2, (IDENTITY,) * 2, ((0.5, -0.5),) * 2)
    return noisy_tracker(tracker, LONG, np.random.default_rng(7))


def moved(tracker: Tracker) -> np.ndarray:
    """Which samples differ from the one before (n,)."""
    return np.r_[True, (np.diff(tracker.positions, axis=0) != 0).any(axis=1)]


def test_jitter_has_its_size(still: Tracker) -> None:
    """Scatter by 1 mm along each axis and by half a degree about each, hinges too; the first sample is
    exact."""
    own = moved(still)
    turns = Rotation.from_quat(still.orientations, scalar_first=True).as_rotvec()
    assert (still.positions[0], still.orientations[0], still.angles[0]) == ((0.0,) * 3, IDENTITY, (0.5, -0.5))
    # 10,000 samples and more: four standard errors are below 3 %
    assert np.std(np.array(still.positions)[own], axis=0) == pytest.approx([JITTER] * 3, rel=0.03)
    assert np.std(turns[own], axis=0) == pytest.approx([JITTER_ANGLE] * 3, rel=0.03)
    assert np.std(np.array(still.angles)[own], axis=0) == pytest.approx([JITTER_ANGLE] * 2, rel=0.03)
    assert (JITTER, np.degrees(JITTER_ANGLE)) == pytest.approx((1e-3, 0.5))


def test_lost_samples_repeat_the_last_one(still: Tracker) -> None:
    """Hold all three parts of a sample, count every sample held, and lose as many as the chance says."""
    lost = np.flatnonzero(~moved(still))
    assert still.held == len(lost)
    for k in lost:
        assert still.angles[k] == still.angles[k - 1]
        assert still.orientations[k] == still.orientations[k - 1]
    # 2 % begin a loss of three on average; a few overlap
    assert len(lost) / len(still.times) == pytest.approx(3 * LOSS, rel=0.15)


def test_samples_are_held_over_a_frame(still: Tracker) -> None:
    """Show every native step of a displayed frame the sample of its end, with the rate that led to it."""
    steps = np.arange(1, 9) / 240
    shown = sample(still, steps)
    for part, keys in ((shown.position, still.positions), (shown.angle, still.angles)):
        np.testing.assert_array_equal(part, np.repeat(np.array(keys)[1:3], 4, axis=0))
    rates = np.diff(still.positions[:3], axis=0) * RATE
    np.testing.assert_allclose(shown.linear_velocity, np.repeat(rates, 4, axis=0), rtol=1e-12)  # rounding
    turned = Rotation.from_rotvec(shown.angular_velocity[0] / RATE)
    np.testing.assert_allclose(turned.as_quat(scalar_first=True), still.orientations[1], atol=1e-12)
    start = sample(still, np.zeros(1))
    assert not start.linear_velocity.any()
    np.testing.assert_array_equal(start.position, [still.positions[0]])


def test_noise_is_the_same_every_time() -> None:
    """Follow from the scene's seed: equal for equal seeds, different for others and for each tracker."""
    scene = catalogue()["ball_snip"]
    assert noisy(scene) == noisy(scene)
    assert noisy(replace(scene, seed=scene.seed + 1)) != noisy(scene)
    masses = noisy(catalogue()["spring"]).trackers
    offsets = [np.array(t.positions) - t.positions[0] for t in masses]
    assert not np.array_equal(offsets[0], offsets[1])


def test_noise_follows_the_motion() -> None:
    """Stay within five standard deviations of the ideal tracker where no sample is lost."""
    scene = catalogue()["wall_push"]
    (ideal,), (tracker,) = scene.trackers, noisy(scene).trackers
    away = np.array(tracker.positions) - sample(ideal, np.array(tracker.times)).position
    assert np.abs(away[moved(tracker)]).max() < 5 * JITTER
    assert 0 < tracker.held < len(tracker.times) / 4


def test_what_the_noise_changes() -> None:
    """Leave scenes without trackers as they are; take out closed forms of the ideal tracker, and nothing
    else."""
    probe, spring = catalogue()["bounce_e1"], catalogue()["spring"]
    assert noisy(probe) is probe
    found = noisy(spring)
    assert spring.truths
    assert replace(found, trackers=spring.trackers, truths=spring.truths) == spring

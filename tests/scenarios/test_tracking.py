"""Paths between keyframes, and noisy trackers: shape-preserving by default; noise is the same every time."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.noisy_tracker import JITTER, JITTER_ANGLE, LOSS, RATE, noisy, noisy_tracker
from touchstone.scenarios.avatar.tracking import sample, swings
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import IDENTITY, INTERPOLATIONS, Tracker, vector

SMOOTH = [name for name in INTERPOLATIONS if name != "held"]
GRID = 400


def tracker(times, values, interpolation="pchip", turns=None):
    """Tracker of a body whose x and only hinge take values (k,), turned by rotation vectors (k, 3)."""
    turned = Rotation.from_rotvec(np.zeros((len(times), 3)) if turns is None else turns)
    return Tracker(
        "hand",
        ("hinge",),
        tuple(times),
        tuple((x, 0.0, 0.0) for x in values),
        tuple(map(tuple, turned.as_quat(scalar_first=True).tolist())),
        tuple((x,) for x in values),
        interpolation=interpolation,
    )


@st.composite
def keyframes(draw):
    """Increasing times and values, some of which are held."""
    count = draw(st.integers(2, 8))
    gaps = draw(st.lists(st.floats(1e-3, 10.0), min_size=count - 1, max_size=count - 1))
    values = draw(st.lists(st.sampled_from([0.0, 0.0125]) | st.floats(-5, 5), min_size=count, max_size=count))
    return [0.0, *np.cumsum(gaps).tolist()], values


@given(keyframes())
def test_the_default_stays_between_its_keyframes(keys):
    """Positions and angles never leave the range of the two keyframes around them, and rest at both ends."""
    path = tracker(*keys)
    assert path == tracker(*keys, "pchip")
    ends, values = map(np.array, keys)
    times = np.linspace(0.0, ends[-1], GRID)
    found = sample(path, times)
    k = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(ends) - 2)
    low, high = np.minimum(values[k], values[k + 1]), np.maximum(values[k], values[k + 1])
    slack = 1e-12
    for there in (found.position[:, 0], found.angle[:, 0]):
        assert np.all((there >= low - slack) & (there <= high + slack))
    rest = sample(path, ends[[0, -1]])
    assert rest.linear_velocity == pytest.approx(0.0, abs=1e-11)
    assert rest.rate == pytest.approx(0.0, abs=1e-11)
    assert swings(path) == []


def test_slopes_inside_are_those_of_pchip():
    """Between the second and the last but one keyframe the path is scipy's."""
    times, values = [0.0, 0.2, 0.5, 1.0, 1.4, 2.0], [0.0, 0.1, 0.4, 0.4, -0.3, 0.0]
    inside = np.linspace(0.2, 1.4, GRID)
    path = PchipInterpolator(times, values)
    found = sample(tracker(times, values), inside)
    assert found.position[:, 0] == pytest.approx(path(inside), abs=1e-14)
    assert found.rate[:, 0] == pytest.approx(path(inside, 1), abs=1e-13)


def test_a_turn_about_one_axis_is_the_path_of_its_angle():
    """About any axis, orientations and hinges of equal angles agree, and hold where they are held."""
    axis = np.array((1.0, 2.0, -2.0)) / 3
    times, angles = [0.0, 0.05, 1.0, 2.0], [0.0, 1.5, 1.5, -1.0]
    grid = np.linspace(0.0, 2.0, GRID)
    for name in ("pchip", "linear"):
        found = sample(tracker(times, angles, name, np.outer(angles, axis)), grid)
        turned = Rotation.from_quat(found.orientation, scalar_first=True)
        wanted = Rotation.from_rotvec(np.outer(found.angle[:, 0], axis))
        assert (turned * wanted.inv()).magnitude() == pytest.approx(0.0, abs=1e-12)
        assert found.angular_velocity == pytest.approx(np.outer(found.rate[:, 0], axis), abs=1e-11)


@pytest.mark.parametrize("name", SMOOTH)
def test_velocities_are_those_of_the_motion(name):
    """Velocities of turns about changing axes are the motion's differences; those of pchip do not jump."""
    turns = np.random.default_rng(5).uniform(-1.5, 1.5, (6, 3))
    times = [0.0, 0.3, 0.5, 1.1, 1.2, 2.0]
    path = tracker(times, [0.0, 1.0, 1.0, -1.0, 0.5, 0.0], name, turns)
    step = 1e-6
    grid = np.linspace(0.01, 1.98, GRID)
    before, now, after = (sample(path, grid + k * step) for k in (-1, 0, 1))
    first, last = (Rotation.from_quat(one.orientation, scalar_first=True) for one in (before, after))
    assert (last * first.inv()).as_rotvec() / (2 * step) == pytest.approx(now.angular_velocity, abs=1e-5)
    assert (after.position - before.position) / (2 * step) == pytest.approx(now.linear_velocity, abs=1e-5)
    assert (after.angle - before.angle) / (2 * step) == pytest.approx(now.rate, abs=1e-5)
    assert np.allclose(sample(path, np.array(times)).position, path.positions, rtol=0, atol=1e-14)
    if name != "linear":
        sides = [sample(path, np.array(times[1:-1]) + side).angular_velocity for side in (-1e-9, 1e-9)]
        assert sides[0] == pytest.approx(sides[1], abs=1e-5)


def test_a_spline_that_leaves_its_keyframes_says_so():
    """0, 12.5 mm, 12.5 mm at 0, 0.05, 10 s: the spline swings to 562 mm; the note names place and remedy."""
    path = tracker([0.0, 0.05, 10.0], [0.0, 0.0125, 0.0125], "cubic")
    assert sample(path, np.linspace(0, 10, GRID)).position.max() == pytest.approx(0.562, abs=1e-3)
    assert swings(path) == [
        "hand leaves its keyframes by 548 mm from 0.05 to 10 s",
        "hinge leaves its keyframes by 31.4 degrees from 0.05 to 10 s",
    ]
    assert swings(replace(path, interpolation="linear")) == []
    turns = np.outer([0.0, 0.5, 0.5], (0.0, 1.0, 0.0))
    turned = tracker([0.0, 0.05, 10.0], [0.0, 0.0, 0.0], "cubic", turns)
    assert [line.partition(" by ")[0] for line in swings(turned)] == ["hand turns beyond its keyframes"]


def test_no_scene_of_ours_leaves_its_keyframes():
    """Trackers of the catalogue name the splines that they use, and stay between their keyframes."""
    for scene in catalogue().values():
        for one in scene.trackers:
            assert one.interpolation in ("cubic", "linear") or len(one.times) == 2, scene.name
            assert swings(one) == [], scene.name


def test_a_tracker_that_stands_still_stands_still():
    """Equal keyframes are one place, in every interpolation."""
    still = (vector((1.0, 2.0, 3.0)),) * 3
    for name in INTERPOLATIONS:
        path = Tracker("hand", (), (0.0, 1.0, 2.0), still, (IDENTITY,) * 3, ((),) * 3, interpolation=name)
        found = sample(path, np.linspace(0, 2, 7))
        assert np.all(found.position == still[0])
        assert not np.any(found.linear_velocity)
        assert found.angle.shape == (7, 0)


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

"""Touch, roll and leave, on motions whose events are known."""

import numpy as np
import pytest

from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.events import OPEN_GAP, PART_GAP, ROLL_SLIP, TOUCH_GAP, bounces
from touchstone.scenarios.scenario import Expectation

BETWEEN_FRAMES = 1e-6
"""What the oracle's 1e-8 m are worth in time at the slowest speed here, ten times over [s]."""
HEIGHT = 1.0
UP = np.array((0.0, 0.0, 1.0))


@pytest.fixture(scope="module")
def over_ground(lab, known):
    """A ball a gap over the ground, of which events are expected: (name, earliest, latest)."""

    def build(duration, *events, gap=0.0, **fields):
        expected = tuple(Expectation(name, "ball", "ground", *window) for name, *window in events)
        ball = lab.ball(position=(0.0, 0.0, gap + known.radius))
        return lab.scene(lab.ground(), ball, duration=duration, expectations=expected, **fields)

    return build


@pytest.fixture(scope="module")
def risen(recordings, known):
    """A recording in which the ball of a scene is so far over the ground, with a vertical speed."""

    def build(scenario, gap, speed=0.0):
        place = (0.0, 0.0, known.radius) + np.outer(gap, UP)
        return recordings.recording(scenario, **known.path(scenario, 1, place, np.outer(speed, UP)))

    return build


@pytest.fixture(scope="module")
def drop(over_ground, risen, known):
    """Recording and scene of a ball dropped from a height that bounces with e, asked to have 0.6."""

    def build(e, duration=1.5, height=HEIGHT):
        scenario = over_ground(duration, ("land", 0.0, duration), gap=height, e=0.6)
        return risen(scenario, *known.bouncing(frame_times(scenario), height, e)), scenario

    return build


def frame_times(scenario):
    """Times of the frames [s]."""
    return np.arange(scenario.frame_count + 1) / 60


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
    assert "no bounce faster than 1" in known.unmeasured("restitution.achieved", recording, scenario)


def test_what_passes_by_does_not_touch(over_ground, risen, known):
    """A ball that is thrown up and falls back to just above the ground never closes the gap."""
    scenario = over_ground(0.5, ("touch", 0.0, 0.5), gap=1.0)
    t = np.minimum(frame_times(scenario), 23 / 60)  # held before it comes down
    recording = risen(
        scenario, 0.01 + 2.0 * t - known.g / 2 * t**2, np.where(t < 23 / 60, 2.0 - known.g * t, 0.0)
    )
    assert np.isnan(known.value("events.touch", recording, scenario)["ball-ground"])


EXACT = 1e-6
"""The oracle's 1e-8 m at the speeds here, tenfold [s]."""


@pytest.mark.parametrize("hit", [0.2, 0.2 + 1 / 120, 0.2 + 1 / 75])
def test_touch_of_a_driven_finger(lab, recordings, known, hit):
    """A finger that flicks a resting ball away between two frames touches it when the gap is closed."""
    ball, trackers = lab.ball(position=(0.0, 0.0, known.radius)), (lab.still("hand", (0.0, 0.0, 0.0)),)
    expected = {"expectations": (Expectation("touch", "ball", "hand", 0.0, 0.5),), "duration": 0.5}
    scenario = lab.scene(lab.ground(), known.hand(), ball, trackers=trackers, **expected)
    t = np.arange(31) / 60
    # 2 m/s, and the ball leaves at 3 m/s; level with the ball's centre
    level = np.column_stack([2.0 * (t - hit) - 0.06, 0 * t, 0 * t + known.radius])
    columns = known.path(scenario, 1, level, (2.0, 0.0, 0.0))
    gone = t > hit
    columns["position"][gone, 2, 0], columns["linear_velocity"][gone, 2, 0] = 3.0 * (t[gone] - hit), 3.0
    touch = known.value("events.touch", recordings.recording(scenario, **columns), scenario)["ball-hand"]
    assert touch == pytest.approx(hit - TOUCH_GAP / 2.0, abs=EXACT)


def test_roll_is_when_slip_ends(over_ground, recordings, known):
    """A ball that slides into rolling rolls when its slip falls below the limit, on a line between frames."""
    mu, v0 = 0.2, 1.5
    scenario = over_ground(0.5, ("roll", 0.0, 0.5), mu=mu)
    t = frame_times(scenario)
    a = mu * known.g
    end = 2 * v0 / (7 * a)  # textbook: slip v0 - 7/2 mu g t
    s = np.minimum(t, end)
    speed = v0 - a * s
    way = v0 * s - a / 2 * s**2 + speed * (t - s)
    place = (0.0, 0.0, known.radius) + np.outer(way, (1.0, 0.0, 0.0))
    spin = np.outer(2.5 * a * s / known.radius, (0.0, 1.0, 0.0))
    columns = known.path(scenario, 1, place, np.outer(speed, (1.0, 0.0, 0.0)), spin=spin)
    roll = known.value("events.roll", recordings.recording(scenario, **columns), scenario)
    # between the last frame that slips and the first that does not the line misses the kink
    frame = np.searchsorted(t, end)
    slip = v0 - 3.5 * a * t[frame - 1]
    assert roll["ball-ground"] == pytest.approx(t[frame - 1] + (slip - ROLL_SLIP) / slip / 60, abs=EXACT)
    assert abs(roll["ball-ground"] - end) < 1 / 60


@pytest.mark.parametrize("event", ["roll", "meet", "part"])
def test_a_ball_that_lies_still_has_no_event(over_ground, recordings, known, event):
    """It never slipped, so it does not begin to roll; it was closed before, so it does not meet, nor part."""
    scenario = over_ground(0.5, (event, 0.0, 0.5))
    found = known.value(f"events.{event}", recordings.recording(scenario), scenario)
    assert np.isnan(found["ball-ground"])


def test_leave_is_the_last_opening(over_ground, risen, known):
    """A ball that hops and is then lifted for good leaves when the second gap opens past a millimetre."""
    scenario = over_ground(0.5, ("leave", 0.0, 0.5), effects=())
    t = frame_times(scenario)
    start, lift = 0.31, 0.4
    gap = np.where(t < 0.2, np.maximum(0.0, 0.05 - np.abs(t - 0.1)), np.maximum(0.0, lift * (t - start)))
    leave = known.value("events.leave", risen(scenario, gap), scenario)["ball-ground"]
    k = np.flatnonzero(gap <= OPEN_GAP)[-1]
    line = t[k] + (OPEN_GAP - gap[k]) / (gap[k + 1] - gap[k]) / 60
    assert leave == pytest.approx(line, abs=EXACT)
    assert abs(leave - (start + OPEN_GAP / lift)) < 1 / 60
    # one that comes back has not left
    gap[-1] = 0.0
    assert np.isnan(known.value("events.leave", risen(scenario, gap), scenario)["ball-ground"])


def test_place_is_where_the_body_was_at_that_time(lab, recordings, known):
    """The place of a landing is its horizontal distance from the start, along both axes."""
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(1.0, 2.0, 0.5 + known.radius)), duration=0.5,
        expectations=(Expectation("land", "ball", "ground", 0.0, 0.5),),
    )  # fmt: skip
    t = frame_times(scenario)
    landing = (2 * (0.5 - TOUCH_GAP) / known.g) ** 0.5
    fallen = np.minimum(known.g / 2 * t**2, 0.5)
    position = np.column_stack([1.0 + 3.0 * t, 2.0 - 4.0 * t, 0.5 + known.radius - fallen])
    velocity = np.column_stack([0 * t + 3.0, 0 * t - 4.0, np.where(fallen < 0.5, -known.g * t, 0.0)])
    recording = recordings.recording(scenario, **known.path(scenario, 1, position, velocity))
    assert known.value("events.land", recording, scenario)["ball-ground"] == pytest.approx(landing, abs=EXACT)
    place = known.value("events.land.place", recording, scenario)["ball-ground"]
    assert place == pytest.approx(5.0 * landing, abs=1e-5)


@pytest.mark.parametrize("event", ["touch", "roll", "leave", "land", "land.place"])
def test_events_that_nobody_expects_are_not_measured(over_ground, recordings, known, event):
    """A scene without the expectation has no such row, with the reason."""
    scenario = over_ground(0.1)
    said = known.unmeasured(f"events.{event}", recordings.recording(scenario), scenario)
    assert f"expects no {event.split('.')[0]}" in said


def test_what_meets_and_parts_twice_is_numbered(over_ground, risen, known):
    """A block that comes to the ground and leaves it twice has four events, each in its window."""
    windows = (("meet", 0.0, 0.5), ("part", 0.5, 1.0), ("meet", 1.0, 1.5), ("part", 1.5, 2.0))
    scenario = over_ground(2.0, *windows)
    # down from 0.1 m and up again at 0.4 m/s, at rest between
    turns = (0.0, 0.25, 0.75, 1.0, 1.25, 1.75, 2.0)
    recording = risen(scenario, np.interp(frame_times(scenario), turns, (0.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1)))
    meet, part = (known.value(f"events.{event}", recording, scenario) for event in ("meet", "part"))
    assert list(meet) == ["ball-ground #1", "ball-ground #2"]
    assert list(meet.values()) == pytest.approx([0.25 - TOUCH_GAP / 0.4, 1.25 - TOUCH_GAP / 0.4], abs=EXACT)
    assert list(part.values()) == pytest.approx([0.75 + PART_GAP / 0.4, 1.75 + PART_GAP / 0.4], abs=EXACT)


@pytest.mark.parametrize(
    ("opened", "closed", "found"), [(0.42, 0.47, 0.75 + PART_GAP / 0.4), (0.36, 0.56, np.nan)]
)
def test_a_moment_open_is_not_parted(over_ground, risen, known, opened, closed, found):
    """A gap open for less than a tenth of a second when the window begins parts later; a wider one has."""
    scenario = over_ground(1.0, ("part", 0.43, 1.0))
    t = frame_times(scenario)
    gap = np.where((t > opened) & (t < closed), 2 * PART_GAP, np.maximum(0.0, 0.4 * (t - 0.75)))
    part = known.value("events.part", risen(scenario, gap), scenario)["ball-ground"]
    assert part == pytest.approx(found, abs=EXACT, nan_ok=True)

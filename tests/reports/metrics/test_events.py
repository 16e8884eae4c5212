"""Touch, roll and leave, on motions whose events are known."""

import numpy as np
import pytest

from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.events import OPEN_GAP, PART_GAP, ROLL_SLIP, TOUCH_GAP, bounces
from touchstone.scenarios.scenario import Body, Expectation, Piece, Sphere
from touchstone.scenarios.solids import sphere_inertia

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


EXACT = 1e-6
"""The oracle's 1e-8 m at the speeds here, tenfold [s]."""


def columns(position, velocity, spin=None):
    found = {"position": position, "linear_velocity": velocity}
    return found if spin is None else found | {"angular_velocity": spin}


@pytest.mark.parametrize("hit", [0.2, 0.2 + 1 / 120, 0.2 + 1 / 75])
def test_touch_of_a_driven_finger(lab, recordings, known, hit):
    """A finger that flicks a resting ball away between two frames touches it when the gap is closed."""
    finger = Body(
        "finger", "driven", "wood", (Piece("f", Sphere(0.01)),), 0.1, inertia=sphere_inertia(0.1, 0.01)
    )
    ball = lab.ball(position=(0.0, 0.0, known.radius))
    scenario = lab.scene(
        lab.ground(), finger, ball, trackers=(lab.still("finger", (0.0, 0.0, 0.0)),), duration=0.5,
        expectations=(Expectation("touch", "ball", "finger", 0.0, 0.5),),
    )  # fmt: skip
    t = np.arange(31) / 60
    position, velocity = np.tile([b.position for b in scenario.bodies], (31, 1, 1)), np.zeros((31, 3, 3))
    # 2 m/s, and the ball leaves at 3 m/s; level with the ball's centre
    position[:, 1] = np.column_stack([2.0 * (t - hit) - 0.06, 0 * t, 0 * t + known.radius])
    velocity[:, 1, 0] = 2.0
    gone = t > hit
    position[gone, 2, 0], velocity[gone, 2, 0] = 3.0 * (t[gone] - hit), 3.0
    recording = recordings.recording(scenario, **columns(position, velocity))
    touch = known.value("events.touch", recording, scenario)["ball-finger"]
    assert touch == pytest.approx(hit - TOUCH_GAP / 2.0, abs=EXACT)


def test_roll_is_when_slip_ends(lab, recordings, known):
    """A ball that slides into rolling rolls when its slip falls below the limit, on a line between frames."""
    mu, v0 = 0.2, 1.5
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(0.0, 0.0, known.radius)), mu=mu, duration=0.5,
        expectations=(Expectation("roll", "ball", "ground", 0.0, 0.5),),
    )  # fmt: skip
    t = np.arange(31) / 60
    a = mu * known.g
    end = 2 * v0 / (7 * a)  # textbook: slip v0 - 7/2 mu g t
    s = np.minimum(t, end)
    speed = v0 - a * s
    spin = 2.5 * a * s / known.radius
    way = v0 * s - a / 2 * s**2 + speed * (t - s)
    zero = 0 * t
    position = np.tile([b.position for b in scenario.bodies], (31, 1, 1))
    position[:, 1, 0] = way
    velocity, omega = np.zeros((31, 2, 3)), np.zeros((31, 2, 3))
    velocity[:, 1] = np.column_stack([speed, zero, zero])
    omega[:, 1] = np.column_stack([zero, spin, zero])
    roll = known.value(
        "events.roll", recordings.recording(scenario, **columns(position, velocity, omega)), scenario
    )
    # between the last frame that slips and the first that does not the line misses the kink
    frame = np.searchsorted(t, end)
    slip = v0 - 3.5 * a * t[frame - 1]
    assert roll["ball-ground"] == pytest.approx(t[frame - 1] + (slip - ROLL_SLIP) / slip / 60, abs=EXACT)
    assert abs(roll["ball-ground"] - end) < 1 / 60


def test_a_ball_that_always_rolls_never_starts_to(lab, recordings, known):
    """Rolling from the start is no event: slip must be seen before it ends."""
    expected = (Expectation("roll", "ball", "ground", 0.0, 0.5),)
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(0.0, 0.0, known.radius)), duration=0.5, expectations=expected
    )
    roll = known.value("events.roll", recordings.recording(scenario), scenario)
    assert np.isnan(roll["ball-ground"])


def test_leave_is_the_last_opening(lab, recordings, known):
    """A ball that hops and is then lifted for good leaves when the second gap opens past a millimetre."""
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(0.0, 0.0, known.radius)), duration=0.5, effects=(),
        expectations=(Expectation("leave", "ball", "ground", 0.0, 0.5),),
    )  # fmt: skip
    t = np.arange(31) / 60
    start, lift = 0.31, 0.4
    gap = np.where(t < 0.2, np.maximum(0.0, 0.05 - np.abs(t - 0.1)), np.maximum(0.0, lift * (t - start)))
    position = np.tile([b.position for b in scenario.bodies], (31, 1, 1))
    position[:, 1, 2] += gap
    leave = known.value("events.leave", recordings.recording(scenario, position=position), scenario)
    k = np.flatnonzero(gap <= OPEN_GAP)[-1]
    line = t[k] + (OPEN_GAP - gap[k]) / (gap[k + 1] - gap[k]) / 60
    assert leave["ball-ground"] == pytest.approx(line, abs=EXACT)
    assert abs(leave["ball-ground"] - (start + OPEN_GAP / lift)) < 1 / 60
    # one that comes back has not left
    position[-1, 1, 2] = known.radius
    back = known.value("events.leave", recordings.recording(scenario, position=position), scenario)
    assert np.isnan(back["ball-ground"])


def test_place_is_where_the_body_was_at_that_time(lab, recordings, known):
    """The place of a landing is its horizontal distance from the start, along both axes."""
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(1.0, 2.0, 0.5 + known.radius)), duration=0.5,
        expectations=(Expectation("land", "ball", "ground", 0.0, 0.5),),
    )  # fmt: skip
    t = np.arange(31) / 60
    landing = (2 * (0.5 - TOUCH_GAP) / known.g) ** 0.5
    fallen = np.minimum(known.g / 2 * t**2, 0.5)
    position = np.column_stack([1.0 + 3.0 * t, 2.0 - 4.0 * t, 0.5 + known.radius - fallen])
    velocity = np.column_stack([0 * t + 3.0, 0 * t - 4.0, np.where(fallen < 0.5, -known.g * t, 0.0)])
    recording = recordings.recording(scenario, **known.path(scenario, 1, position, velocity))
    assert known.value("events.land", recording, scenario)["ball-ground"] == pytest.approx(landing, abs=EXACT)
    place = known.value("events.land.place", recording, scenario)["ball-ground"]
    assert place == pytest.approx(5.0 * landing, abs=1e-5)


@pytest.mark.parametrize("event", ["touch", "roll", "leave", "land", "land.place"])
def test_events_that_nobody_expects_are_not_measured(lab, recordings, known, event):
    """A scene without the expectation has no such row, with the reason."""
    scenario = lab.scene(lab.ground(), lab.ball(), duration=0.1)
    with pytest.raises(NotMeasured, match=f"expects no {event.split('.')[0]}"):
        known.value(f"events.{event}", recordings.recording(scenario), scenario)


def test_what_meets_and_parts_twice_is_numbered(lab, recordings, known):
    """A block that comes to the ground and leaves it twice has four events, each in its window."""
    windows = (("meet", 0.0, 0.5), ("part", 0.5, 1.0), ("meet", 1.0, 1.5), ("part", 1.5, 2.0))
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(0.0, 0.0, known.radius)), duration=2.0,
        expectations=tuple(Expectation(event, "ball", "ground", *window) for event, *window in windows),
    )  # fmt: skip
    t = np.arange(121) / 60
    # down from 0.1 m and up again at 0.4 m/s, at rest between
    gap = np.interp(t, (0.0, 0.25, 0.75, 1.0, 1.25, 1.75, 2.0), (0.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1))
    position, velocity = np.tile([b.position for b in scenario.bodies], (121, 1, 1)), np.zeros((121, 2, 3))
    position[:, 1, 2] += gap
    recording = recordings.recording(scenario, **columns(position, velocity))
    meet, part = (known.value(f"events.{event}", recording, scenario) for event in ("meet", "part"))
    assert list(meet) == ["ball-ground #1", "ball-ground #2"]
    assert list(meet.values()) == pytest.approx([0.25 - TOUCH_GAP / 0.4, 1.25 - TOUCH_GAP / 0.4], abs=EXACT)
    assert list(part.values()) == pytest.approx([0.75 + PART_GAP / 0.4, 1.75 + PART_GAP / 0.4], abs=EXACT)


@pytest.mark.parametrize(("opened", "found"), [(0.42, 0.75), (0.36, None)])
def test_a_moment_open_is_not_parted(lab, recordings, known, opened, found):
    """A gap open for less than a tenth of a second when the window begins parts later; a wider one has."""
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(0.0, 0.0, known.radius)), duration=1.0,
        expectations=(Expectation("part", "ball", "ground", 0.43, 1.0),),
    )  # fmt: skip
    t = np.arange(61) / 60
    closed_again = 0.47 if found else 0.56
    gap = np.where((t > opened) & (t < closed_again), 2 * PART_GAP, np.maximum(0.0, 0.4 * (t - 0.75)))
    position, velocity = np.tile([b.position for b in scenario.bodies], (61, 1, 1)), np.zeros((61, 2, 3))
    position[:, 1, 2] += gap
    recording = recordings.recording(scenario, **columns(position, velocity))
    part = known.value("events.part", recording, scenario)["ball-ground"]
    if found:
        assert part == pytest.approx(found + PART_GAP / 0.4, abs=EXACT)
    else:
        assert np.isnan(part)


def test_what_is_closed_before_does_not_meet(lab, recordings, known):
    """A ball that lies on the ground neither meets it nor parts."""
    scenario = lab.scene(
        lab.ground(), lab.ball(position=(0.0, 0.0, known.radius)), duration=0.5,
        expectations=tuple(Expectation(event, "ball", "ground", 0.0, 0.5) for event in ("meet", "part")),
    )  # fmt: skip
    for event in ("meet", "part"):
        assert np.isnan(
            known.value(f"events.{event}", recordings.recording(scenario), scenario)["ball-ground"]
        )

"""Energy, impulse balance and Coulomb's law on contact rows written by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import FRICTION_IMPULSES, NOT_REPORTED
from touchstone.reports.metrics.contacts.contact import LACKING, REFERENCE_SPEED
from touchstone.reports.results import Row
from touchstone.reports.verdict.rows import measured
from touchstone.scenarios.catalogue import catalogue

ROUNDING = 1e-12
MU, MASS, DT = 0.5, 2.0, 1 / 240
NOISE = 1e-3 * MASS * 9.81 * DT
"""j_0 of the definition [N s]."""
UP = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def resting(lab):
    """A ball of 2 kg on the ground, half a second."""
    ball = lab.ball(position=(0.0, 0.0, 0.05), mass=MASS)
    return lab.scene(lab.ground(), ball, mu=MU, duration=0.5)


def pressing(recordings, scenario, share=1.0, along=(0.0, 0.0, 0.0)):
    """A contact of the ground per substep that carries `share` of the ball's weight, plus `along`."""
    count = scenario.frame_count * 4
    impulse = np.array([0.0, 0.0, share * MASS * 9.81 * DT]) + along
    rows = [{"time": k * DT, "body_b": 1, "normal": UP, "impulse": impulse} for k in range(count)]
    return recordings.recording(scenario, DT, contacts=recordings.contacts(*rows))


@pytest.mark.parametrize(("share", "missed"), [(1.0, 0.0), (0.5, 0.5), (1.2, 0.2), (0.0, 1.0)])
def test_impulse_balance_of_a_body_at_rest(recordings, known, resting, share, missed):
    """Impulses that carry a share of the weight miss the motion by the rest of it."""
    found = known.value("contact.impulse_balance", pressing(recordings, resting, share), resting)
    assert found == {"ball": pytest.approx(missed, abs=1e-9)}  # 120 sums


def test_impulses_without_those_of_friction_are_not_judged(recordings, known, resting):
    """Where an engine reports none, contacts with friction have no balance, and no cone; others have both."""
    recording = pressing(recordings, resting)
    told = {"settings": {FRICTION_IMPULSES: NOT_REPORTED}}
    partial = replace(recording, manifest=json.dumps(recording.facts | told))
    rows = measured(Row("run", "test", "mujoco", "recommended", DT, ""), resting, partial, ["friction.cone"])
    assert {(row.metric, row.verdict, row.reason) for row in rows} >= {
        ("contact.impulse_balance", "skipped", LACKING),
        ("friction.cone", "skipped", LACKING),
    }
    smooth = replace(resting, coefficients=(replace(resting.coefficients[0], friction=0.0),))
    assert known.value("contact.impulse_balance", partial, smooth) == {"ball": pytest.approx(0.0, abs=1e-9)}


def test_impulse_balance_counts_sides_and_frames(lab, recordings, known):
    """A body that comes first feels the impulse reversed; an impulse in the wrong frame is missed twice."""
    ball = lab.ball(position=(0.0, 0.0, 0.05), mass=MASS)
    scenario = lab.scene(ball, lab.ground(), effects=(), duration=0.1)
    velocity = np.zeros((7, 2, 3))
    velocity[3:, 0, 0] = 4.0  # hit in the third frame
    for frame, missed in ((2, 0.0), (1, 2.0)):
        row = {"time": frame / 60 + DT, "body_b": 1, "normal": UP, "impulse": (-4.0 * MASS, 0.0, 0.0)}
        played = recordings.recording(scenario, linear_velocity=velocity, contacts=recordings.contacts(row))
        found = known.value("contact.impulse_balance", played, scenario)
        assert found == {"ball": pytest.approx(missed, abs=1e-9)}


@pytest.mark.parametrize("number", [np.float64, np.float32])
@pytest.mark.parametrize("effects", [(), ("gravity",)])
def test_a_body_in_free_flight_has_no_impulses_to_balance(lab, recordings, known, effects, number):
    """A body that nothing touches is not audited: what is left of its motion is rounding, in single precision
    too."""
    scenario = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 9.0)), effects=effects, duration=0.5)
    t = np.arange(31) / 60
    speed = np.full(31, 0.1, dtype=number)
    for k in range(1, 31):  # as an engine adds it up
        speed[k] = speed[k - 1] - number(9.81 / 60 if effects else 0.0)
    velocity = np.column_stack([0 * t, 0 * t, speed])
    columns = known.path(scenario, 1, (0.0, 0.0, 9.0), velocity)
    said = known.unmeasured("contact.impulse_balance", recordings.recording(scenario, **columns), scenario)
    assert "no simulated body is touched" in said


def test_energy_from_nowhere_is_the_largest_rise(lab, recordings, known):
    """A free body whose speed jumps and sags gains the largest rise over any window, spin included."""
    scenario = lab.scene(lab.ground(), lab.ball(position=(0, 0, 9), mass=MASS), effects=(), duration=0.1)
    speed, spin = np.array([3.0, 1.0, 2.0, 2.0, 1.5, 3.5, 0.0]), np.array([0, 0, 0, 0, 0, 7.0, 0])
    columns = known.path(scenario, 1, (0.0, 0.0, 9.0), np.outer(speed, [0.6, 0.0, 0.8]))
    columns["angular_velocity"] = np.zeros((7, 2, 3))
    columns["angular_velocity"][:, 1, 1] = spin
    found = known.value("energy.injected", recordings.recording(scenario, **columns), scenario)
    inertia = 0.4 * MASS * known.radius**2
    risen = 0.5 * MASS * (3.5**2 - 1.0**2) + 0.5 * inertia * 7.0**2
    assert found == {"simulated": pytest.approx(risen, rel=ROUNDING)}


def test_falling_and_losing_inject_nothing(lab, recordings, known):
    """Free fall trades height for speed; a ball that bounces lower only loses."""
    scenario = lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 1.05)), duration=1.5)
    gap, speed = known.bouncing(np.arange(91) / 60, 1.0, 0.7)
    zero = 0 * gap
    columns = known.path(
        scenario, 1, np.column_stack([zero, zero, gap + 0.05]), np.column_stack([zero, zero, speed])
    )
    found = known.value("energy.injected", recordings.recording(scenario, **columns), scenario)
    assert max(found.values()) == pytest.approx(0.0, abs=1e-12)  # rounding of 10 J


def test_the_drives_work_is_no_gift(lab, recordings, known):
    """The drive's work is taken off; where it is unknown the whole is not measured, with a reason."""
    hand = known.hand(MASS)
    tracker = lab.still("hand", (0.0, 0.0, 5.0))
    scenario = lab.scene(
        lab.ground(), lab.ball(mass=MASS), hand, trackers=(tracker,), effects=(), duration=0.1
    )
    speed = np.array([0, 0, 1.0, 1.0, 1.0, 1.0, 1.0])
    columns = known.path(scenario, 2, (0.0, 0.0, 5.0), np.outer(speed, [1.0, 0.0, 0.0]))
    energy = 0.5 * MASS * speed**2
    paid = recordings.recording(scenario, driver_work=energy, **columns)
    assert known.value("energy.injected", paid, scenario) == {
        "all": pytest.approx(0.0, abs=ROUNDING),
        "simulated": 0.0,
    }
    short = replace(paid, driver_work=0.75 * energy)
    found = known.value("energy.injected", short, scenario)["all"]
    assert found == pytest.approx(0.25 * energy[-1], rel=ROUNDING)
    unknown = known.value("energy.injected", replace(paid, driver_work=np.full(7, np.nan)), scenario)["all"]
    assert np.isnan(unknown.value)
    assert "not known" in unknown.reason


@pytest.mark.parametrize("ball_first", [True, False])
def test_a_push_of_the_hand_is_no_gift(lab, recordings, known, ball_first):
    """The work of a driven body's impulse, J (v- + v+) / 2, is taken off the simulated body's gain."""
    hand = known.hand(MASS)
    tracker = lab.still("hand", (0.0, 0.0, 5.0))
    pair = (lab.ball(mass=MASS), hand)
    ball = 0 if ball_first else 1
    scenario = lab.scene(*(pair if ball_first else pair[::-1]), trackers=(tracker,), effects=(), duration=0.1)
    v = 3.0
    columns = known.path(scenario, ball, (0.0, 0.0, 1.0), np.outer(np.arange(7) > 2, [v, 0.0, 0.0]))
    side, sign = ("a", -1) if ball_first else ("b", 1)
    row = {
        "time": 2 / 60, "body_b": 1, "normal": (sign, 0, 0), "impulse": (sign * MASS * v, 0, 0),
        f"velocity_{side}_after": (v, 0, 0),
    }  # fmt: skip
    whole = recordings.recording(scenario, contacts=recordings.contacts(row), **columns)
    assert known.value("energy.injected", whole, scenario)["simulated"] == pytest.approx(0.0, abs=ROUNDING)
    row["impulse"] = (sign * 0.9 * MASS * v, 0, 0)
    weak = replace(whole, contacts=recordings.contacts(row))
    gift = known.value("energy.injected", weak, scenario)["simulated"]
    assert gift == pytest.approx(0.1 * 0.5 * MASS * v * v, rel=ROUNDING)


def test_the_cone_of_a_point_in_closed_form(recordings, known, resting):
    """The excess over mu j_n is relative to it, plus the noise; a pull has no cone at all."""
    for normal, tangential, excess in (
        (2.0, 1.0, 0.0),
        (2.0, 1.5, 0.5 / (1.0 + NOISE)),
        (0.0, 0.25, 0.25 / NOISE),
        (-1.0, 0.25, 0.25 / NOISE),
    ):
        impulse = (0.6 * tangential, -0.8 * tangential, normal)
        rows = recordings.contacts(
            {"body_b": 1, "normal": UP, "impulse": impulse}, {"body_b": 1, "normal": UP}
        )
        recording = recordings.recording(resting, DT, contacts=rows)
        found = known.value("friction.cone.point", recording, resting)[""]
        assert found == pytest.approx(excess, rel=1e-9, abs=1e-12)


def points(recordings, resting, *steps):
    """A recording in which the pair has points of (normal, tangential) impulse [N s] per native step."""
    rows = [
        {"time": k * DT, "body_b": 1, "normal": UP, "impulse": (tangential, 0.0, normal)}
        for k, impulses in enumerate(steps)
        for normal, tangential in impulses
    ]
    return recordings.recording(resting, DT, contacts=recordings.contacts(*rows))


def test_the_cone_of_a_pair_in_closed_form(recordings, known, resting):
    """Points of a pair share their load in a step; a step without load counts against the usual one."""
    for steps, excess in (
        # mu is 0.5: a point without load beside one that bears all
        ([[(2.0, 0.0), (0.0, 0.9)]], 0.0),
        ([[(2.0, 0.0), (0.0, 1.5)]], 0.5 / (1.0 + NOISE)),
        # friction to either side does not cancel
        ([[(2.0, 0.75), (0.0, -0.75)]], 0.5 / (1.0 + NOISE)),
        # another step's load does not help, and the median step is what an unloaded one is measured by
        ([[(2.0, 1.0)], [(2.0, 1.25)], [(6.0, 0.0)]], 0.25 / (1.0 + NOISE)),
        ([[(2.0, 0.0)], [(2.0, 0.0)], [(0.0, 0.25)]], 0.25 / (1.0 + NOISE)),
        # a pair that never presses has friction from nothing
        ([[(0.0, 0.25)]], 0.25 / NOISE),
        ([[(-1.0, 0.25)]], 0.25 / NOISE),
    ):
        found = known.value("friction.cone", points(recordings, resting, *steps), resting)[""].value
        assert found == pytest.approx(excess, rel=1e-9, abs=1e-12)


def sliding(normal, tangential, slip, turn=0.0, **changes):
    """A contact that slides along x, its friction turned from the reverse slip."""
    along = tangential * np.array([-np.cos(turn), -np.sin(turn), 0.0])
    row = {"body_b": 1, "normal": UP, "impulse": along + np.array([0.0, 0.0, normal])}
    row |= {"velocity_b_before": (slip, 0.0, -0.3), "velocity_b_after": (slip, 0.0, 0.1)}
    return row | changes


def test_deficit_and_direction_in_closed_form(recordings, known, resting):
    """Deficit and angle are means over the sliding contacts, weighted by j_n; the rest does not count."""
    rows = recordings.contacts(
        sliding(1.0, 0.5, 1.0),  # just so
        sliding(3.0, 0.9, 0.2, turn=0.2),  # 60 % of mu, askew
        sliding(5.0, 0.0, 0.04),  # too slow
        sliding(0.5 * NOISE, 0.0, 1.0),  # too weak
        sliding(5.0, 0.0, 1.0, velocity_b_after=(0.01, 0.0, 0.0)),  # caught within the step
        sliding(2.0, 0.3, 1.0, velocity_a_before=(1.0, 0.0, 0.0)),  # no slip before: both move
        sliding(5.0, 0.1, 1.0, velocity_b_after=(-1.0, 0.0, 0.1)),  # rolls past, or slides back
    )
    recording = recordings.recording(resting, DT, contacts=rows)
    deficit = known.value("friction.deficit", recording, resting)
    assert deficit == {"ground-ball": pytest.approx(1 - (0.5 + 0.9) / (MU * 4.0), rel=1e-9)}
    angle = known.value("friction.direction", recording, resting)
    assert angle == {"ground-ball": pytest.approx(3 * 0.2 / 4, rel=1e-9)}


def test_full_reversal_is_half_a_turn(recordings, known, resting):
    """Friction that pushes along the slip is pi off; friction of the right size has no deficit."""
    recording = recordings.recording(
        resting, DT, contacts=recordings.contacts(sliding(1.0, 0.5, 1.0, turn=np.pi))
    )
    assert known.value("friction.direction", recording, resting)["ground-ball"] == pytest.approx(
        np.pi, abs=1e-9
    )
    assert known.value("friction.deficit", recording, resting)["ground-ball"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("friction.cone", "no contact"),
        ("friction.deficit", "no contact slides faster than 0.05 m/s"),
        ("friction.direction", "no contact slides faster than 0.05 m/s"),
        ("time.share", "the engine tells no stages"),
        ("work", "the engine counts nothing"),
    ],
)
def test_what_did_not_happen_is_not_measured(recordings, known, resting, name, reason):
    """A recording without contacts, stages or counters has no such value, with the reason."""
    assert reason in known.unmeasured(name, recordings.recording(resting), resting)


def test_time_and_work_in_closed_form(recordings, known, resting):
    """Statistics of known times; shares of stages add up to one; counters are means per frame."""
    frames = resting.frame_count
    times = np.arange(1, frames + 1) * 1e-6
    recording = replace(
        recordings.recording(resting),
        time_frame=times[::-1],
        time_drive=3 * times,
        time_read=np.full(frames, 2e-6),
        stage_names=np.array(["a", "b"]),
        stage_seconds=np.column_stack([times, 3 * times]),
        work_names=np.array(["pairs"]),
        work=np.arange(frames)[:, None] * 2.0,
    )
    wanted = {"median": 15.5e-6, "p95": 28.55e-6, "p99": 29.71e-6, "max": 30e-6}
    for name, value in wanted.items():
        assert known.value(f"time.frame.{name}", recording, resting)[""] == pytest.approx(value, rel=1e-9)
    assert known.value("time.drive", recording, resting)[""] == pytest.approx(46.5e-6, rel=1e-9)
    assert known.value("time.read", recording, resting)[""] == pytest.approx(2e-6, rel=1e-9)
    assert known.value("time.crossing", recording, resting)[""] == pytest.approx(1e-6, rel=1e-9)
    share = known.value("time.share", recording, resting)
    assert share == {"a": pytest.approx(0.25, rel=1e-9), "b": pytest.approx(0.75, rel=1e-9)}
    assert known.value("work", recording, resting) == {"pairs": 29.0}


def struck(recordings, known, scenario, time, **rows):
    """The scene's closed form with one contact of its first two bodies."""
    row = {"time": time, "body_a": 0, "body_b": 1, "normal": UP, "impulse": (0.0, 0.0, 2.0)} | rows
    return known.ideal(recordings, scenario, contacts=recordings.contacts(row))


@pytest.mark.parametrize(("before", "after", "breach"), [(-2.0, 1.0, 0.0), (-2.0, 1.5, 0.5), (0.3, 0.0, 0.0)])
def test_newtons_law_per_contact(recordings, known, before, after, breach):
    """What a contact leaves beyond e times the approach counts over 1.4 m/s; e = 0.5 here."""
    scenario = catalogue()["bounce_e05"]
    recording = struck(
        recordings,
        known,
        scenario,
        0.2,
        velocity_b_before=(0.0, 0.0, before),
        velocity_b_after=(0.0, 0.0, after),
    )
    found = known.value("contact.complementarity", recording, scenario)[""]
    assert found == pytest.approx(breach / REFERENCE_SPEED, abs=1e-15)


def test_breaches_are_weighted_by_impulse(recordings, known):
    """A contact without impulse, or one that pulls, weighs nothing."""
    scenario = catalogue()["bounce_e05"]
    rows = [
        {"body_b": 1, "normal": UP, "impulse": (0.0, 0.0, j), "velocity_b_after": (0.0, 0.0, v)}
        for j, v in ((3.0, 0.14), (1.0, 0.0), (0.0, 9.0), (-1.0, 9.0))
    ]
    recording = known.ideal(recordings, scenario, contacts=recordings.contacts(*rows))
    found = known.value("contact.complementarity", recording, scenario)[""]
    assert found == pytest.approx(0.75 * 0.1, rel=1e-12)


@pytest.mark.parametrize("early", [0.0, 0.003, 0.01, -0.003])
def test_a_contact_beside_the_touch(recordings, known, early):
    """An impulse some milliseconds before or after the ball is there acts across the gap it has then."""
    scenario = catalogue()["bounce_e1"]
    arrival = scenario.truths[0].arcs[1].start
    recording = struck(recordings, known, scenario, arrival - early)
    speed = scenario.truths[0].arcs[1].velocity[2]
    gap = speed * abs(early) - 9.81 * early**2 / 2
    found = known.value("contact.at_distance", recording, scenario)[""]
    # the oracle's distance of a ball over a box is exact
    assert found == pytest.approx(gap, abs=1e-12)


def test_contacts_in_touch_are_at_no_distance(recordings, known):
    """A body that lies, slides or overlaps has no gap."""
    scenario = catalogue()["slide"]
    rows = [{"time": k / 60, "body_b": 1 + k % 3, "normal": UP, "impulse": (0, 0, 0.1)} for k in range(90)]
    recording = known.ideal(recordings, scenario, contacts=recordings.contacts(*rows))
    # the oracle's 1e-8 m
    assert known.value("contact.at_distance", recording, scenario)[""] < 1e-8
    sunk = replace(
        recording, position=recording.position - np.array([0.0, 0.0, 1e-3]) * (np.arange(4) > 0)[:, None]
    )
    assert known.value("contact.at_distance", sunk, scenario)[""] == 0.0


def test_without_pressing_contacts_nothing_is_measured(recordings, known):
    """No contact, or none that presses, is not measured."""
    scenario = catalogue()["bounce_e1"]
    empty = known.ideal(recordings, scenario)
    pulling = struck(recordings, known, scenario, 0.1, impulse=(0.0, 0.0, -1.0))
    for recording in (empty, pulling):
        for metric in ("contact.complementarity", "contact.at_distance"):
            assert "no contact presses" in known.unmeasured(metric, recording, scenario)


def test_contacts_of_driven_bodies_have_no_gap(recordings, known):
    """How a driven body moves within a frame is not known: its contacts tell Newton's law alone."""
    scenario = catalogue()["spring"]
    row = {"body_a": 0, "body_b": 1, "normal": UP, "impulse": (0.0, 0.0, 1.0)}
    recording = recordings.recording(scenario, contacts=recordings.contacts(row))
    assert known.value("contact.complementarity", recording, scenario) == {"": 0.0}
    assert "no contact presses" in known.unmeasured("contact.at_distance", recording, scenario)


def test_restitution_of_two_free_balls(recordings, known):
    """A head-on collision is judged by its free arcs; one off centre, whose normal turns, is not."""
    scenario = catalogue()["collide_central"]
    found = known.value("restitution.achieved", known.ideal(recordings, scenario), scenario)
    assert list(found) == ["mover-target #1"]
    assert found["mover-target #1"].value == pytest.approx(0.5, abs=1e-12)
    assert found["mover-target #1"].reason == "asked 0.5, approach 2.00 m/s"
    oblique = catalogue()["collide_slips"]
    said = known.unmeasured("restitution.achieved", known.ideal(recordings, oblique), oblique)
    assert "no bounce faster" in said


def test_rounding_of_a_normal_is_no_friction(recordings, known):
    """A frictionless impulse may have a few roundings of itself across the normal, and no more."""
    scenario = catalogue()["collide_oblique"]
    normal = np.array([0.6, 0.0, 0.8])
    for across, fine in ((1e-16, True), (1e-14, False)):
        impulse = 2.0 * normal + 2.0 * across * np.array([0.8, 0.0, -0.6])
        recording = struck(recordings, known, scenario, 0.2, normal=normal, impulse=impulse)
        assert (known.value("friction.cone", recording, scenario)[""].value < 1e-12) == fine
        assert (known.value("friction.cone.point", recording, scenario)[""] < 1e-12) == fine

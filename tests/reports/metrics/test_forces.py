"""Contact forces, the work of drivers, and gaps of carried bodies, on contact rows written by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.registry import ENGINES
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.time_series import FORCE, course, heaviest_pairs
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Body, Joint, Piece, Scenario, Sphere, Tracker
from touchstone.scenarios.solids import sphere_inertia
from touchstone.scenarios.truths.force_truth import ForceTruth

ROUNDING, EXACT = 1e-12, 1e-7
DT, MASS, G = 1 / 240, 2.0, 9.81
UP, ALONG = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
WEIGHT = MASS * G
INERTIA = sphere_inertia(1.0, 0.05)


@pytest.fixture(scope="module")
def resting(lab):
    """A ball of 2 kg on the ground, half a second."""
    return lab.scene(lab.ground(), lab.ball(position=(0.0, 0.0, 0.05), mass=MASS), duration=0.5)


def pressed(recordings, scenario, forces, **columns):
    """A contact of bodies 0 and 1 per native step, with the normal force of its displayed frame [N]."""
    rows = [
        {"time": k * DT, "body_b": 1, "normal": UP, "impulse": (0.3, 0.0, DT * forces[k // 4])}
        for k in range(4 * len(forces))
    ]
    return recordings.recording(scenario, DT, contacts=recordings.contacts(*rows), **columns)


def test_force_of_known_impulses(recordings, known, resting):
    """The mean counts frames that press, the peak is that of a frame; friction and pulls do not count."""
    forces = np.array([0.0] * 10 + [WEIGHT] * 15 + [3 * WEIGHT] + [-WEIGHT] * 4)
    recording = pressed(recordings, resting, forces)
    wanted = {
        "force.contact.mean": 18 * WEIGHT / 16,
        "force.contact.peak": 3 * WEIGHT,
        "force.contact.impulse": 18 * WEIGHT / 60,
    }
    for name, value in wanted.items():
        assert known.value(name, recording, resting) == {"ground-ball": pytest.approx(value, rel=ROUNDING)}
    series = course(Context(recording, resting)).values[FORCE, "ground-ball"]
    assert np.isnan(series[0])
    assert series[1:] == pytest.approx(np.maximum(forces, 0.0), abs=1e-9)
    said = known.unmeasured("force.contact.mean", recordings.recording(resting, DT), resting)
    assert "no contact presses" in said


@pytest.mark.parametrize(
    ("truth", "error"),
    [
        (ForceTruth("ground", "ball", 0.2, 0.3, WEIGHT), 0.0),
        (ForceTruth("ball", "ground", 0.2, 0.3, WEIGHT / 1.25), 0.25),
        (
            ForceTruth("ground", "ball", 0.19, 0.312, WEIGHT),
            0.0,
        ),  # frames that are partly outside do not count
        (ForceTruth("ground", "ball", 0.1, 0.3, WEIGHT), -0.5),
        (ForceTruth("ground", "ball", 0.0, 0.1, WEIGHT), -1.0),
        (ForceTruth("ground", "ball", 0.0, 0.5, 0.3 * WEIGHT, "impulse"), 0.0),
        (ForceTruth("ground", "ball", 0.0, 0.3, 0.2 * WEIGHT, "impulse"), -0.5),
    ],
)
def test_error_of_a_force(recordings, known, resting, truth, error):
    """The force of the frames in the window, or its integral, over the truth, less 1."""
    scenario = replace(resting, forces=(truth,))
    recording = pressed(recordings, scenario, [0.0] * 12 + [WEIGHT] * 18)
    found = known.value("force.error", recording, scenario)[f"{truth.body}-{truth.other}"]
    assert found.value == pytest.approx(error, abs=ROUNDING)
    assert f"of {truth.value:.6g} N" in found.reason


def test_the_worst_window_of_a_pair_is_reported(recordings, known, resting):
    """One row per pair; a run that ends before a window, and a scene without one, are not measured."""
    windows = (ForceTruth("ground", "ball", 0.3, 0.5, WEIGHT), ForceTruth("ground", "ball", 0.1, 0.3, WEIGHT))
    scenario = replace(resting, forces=windows)
    recording = pressed(recordings, scenario, [0.0] * 12 + [WEIGHT] * 18)
    found = known.value("force.error", recording, scenario)["ground-ball"]
    assert found.value == pytest.approx(-0.5, abs=ROUNDING)
    assert found.reason.endswith("from 0.1 to 0.3 s")
    assert "states no force" in known.unmeasured("force.error", recording, resting)
    said = known.unmeasured("force.error", replace(recording, time=recording.time[:20]), scenario)
    assert "not played" in said


@pytest.fixture(scope="module")
def arm(lab):
    """Two links on a hinge, a ball, and the ground; the links may touch each other."""
    upper, middle, lower = (
        Body(name, "driven", "wood", (Piece(name, Sphere(0.05)),), 1.0, inertia=INERTIA)
        for name in ("upper", "middle", "lower")
    )
    hinges = tuple(
        Joint(child, parent, child, (0.3, 0.0, 0.0), (0.0, 1.0, 0.0))
        for parent, child in (("upper", "middle"), ("middle", "lower"))
    )
    quiet = ((1.0, 0.0, 0.0, 0.0),) * 2
    tracker = Tracker(
        "upper", ("middle", "lower"), (0.0, 1.0), ((0.0, 0.0, 1.0),) * 2, quiet, ((0.0, 0.0),) * 2
    )
    bodies = (lab.ball(mass=MASS), upper, middle, lower, lab.ground())
    effects = ("gravity", "self_collision")
    return lab.scene(*bodies, joints=hinges, trackers=(tracker,), effects=effects, duration=0.1)


def row(a, b, impulse, time=0.0, **velocities):
    """A contact row of bodies a and b, with velocities of their surfaces."""
    return {
        "time": time, "body_a": a, "body_b": b, "normal": (1.0, 0.0, 0.0), "impulse": (impulse, 0.0, 0.0)
    } | {name: (value, 0.0, 0.0) for name, value in velocities.items()}  # fmt: skip


def test_links_count_as_their_body(arm, recordings, known):
    """The forces of two links on one ball add up, and the truth of the root's pair counts them all."""
    contacts = recordings.contacts(*(row(0, link, 0.5, time=k / 60) for link in (1, 3) for k in range(6)))
    scenario = replace(arm, forces=(ForceTruth("upper", "ball", 0.0, 0.1, 60.0),))
    recording = recordings.recording(scenario, 1 / 60, contacts=contacts)
    mean = known.value("force.contact.mean", recording, scenario)
    assert mean == {"ball-upper": pytest.approx(60.0, rel=ROUNDING)}
    found = known.value("force.error", recording, scenario)["upper-ball"]
    assert found.value == pytest.approx(0.0, abs=ROUNDING)
    assert heaviest_pairs([course(Context(recording, scenario))], 1) == ["ball-upper"]


def test_work_of_a_driver(arm, recordings, known):
    """The impulse on what a link touches times the mean velocity of the link; its own links do not count."""
    moving = {"velocity_b_before": 2.0, "velocity_b_after": 4.0}
    link_first = {"velocity_a_before": 1.0, "velocity_a_after": 1.0}
    contacts = recordings.contacts(
        row(0, 3, -0.5, **moving),  # pushes the ball, which comes first, with 0.5 N s at 3 m/s
        row(3, 4, 0.2, **link_first),  # rubs the ground at 1 m/s
        row(1, 3, 7.0, **moving),
    )
    recording = recordings.recording(arm, 1 / 60, contacts=contacts)
    assert known.value("energy.drive", recording, arm) == {"upper": pytest.approx(1.5 + 0.2, rel=ROUNDING)}
    said = known.unmeasured("energy.drive", recordings.recording(arm, 1 / 60), arm)
    assert "no impulse of a driven" in said


@pytest.mark.parametrize("ball_first", [True, False])
def test_a_contact_gives_no_more_than_its_driver(lab, recordings, known, ball_first):
    """A ball that leaves a driver at twice its speed has the work of the driver; any faster, more than it."""
    bodies = (lab.ball(mass=MASS), known.hand())
    ball, sign = (0, -1.0) if ball_first else (1, 1.0)
    scenario = lab.scene(
        *bodies[:: -int(sign)], trackers=(lab.still("hand", (0.0, 0.0, 5.0)),), effects=(), duration=0.1
    )
    mine, its = ("a", "b") if ball_first else ("b", "a")
    for ratio, injected in ((1.0, 0.0), (2.0, 0.0), (3.0, 1.5)):
        speed = ratio * 2.0  # of the ball after it; the hand moves at 2 m/s
        columns = known.path(scenario, ball, (0.0, 0.0, 1.0), np.outer(np.arange(7) > 2, [speed, 0.0, 0.0]))
        its_speed = {f"velocity_{its}_{moment}": 2.0 for moment in ("before", "after")}
        hit = row(0, 1, sign * MASS * speed, 2 / 60, **its_speed, **{f"velocity_{mine}_after": speed})
        recording = recordings.recording(scenario, contacts=recordings.contacts(hit), **columns)
        found = known.value("energy.injected", recording, scenario)
        assert found["simulated"] == pytest.approx(0.0, abs=ROUNDING)
        # m u^2 / 2 - m u v, with u = ratio v
        assert found["driven"] == pytest.approx(injected * MASS * 2.0**2, abs=1e-9)


@pytest.mark.parametrize("gap", [25e-3, 0.0, -2e-3])
def test_the_gap_of_a_carried_body(lab, recordings, known, gap):
    """A load that a driven plate lifts at 1.5 m/s hovers, touches or sinks."""
    plate = lab.block("plate", (0.2, 0.2, 0.05), (0.0, 0.0, 0.0), kind="driven")
    load = lab.block("load", (0.1, 0.1, 0.1), (0.0, 0.0, 0.15 + gap))
    scenario = lab.scene(plate, load, trackers=(lab.still("plate", (0.0, 0.0, 0.0)),), duration=0.5)
    frames = scenario.frame_count + 1
    height = np.zeros((frames, 2, 3))
    height[:, :, 2] = 1.5 * np.arange(frames)[:, None] / 60
    position = np.tile([body.position for body in scenario.bodies], (frames, 1, 1)) + height
    position[:6, 1, 2] += 0.3  # in the air, not on the plate yet
    forces = [0.0] * 6 + [G] * (frames - 7)
    recording = pressed(recordings, scenario, forces, position=position)
    ((pair, found),) = known.value("contact.gap", recording, scenario).items()
    assert (pair, found.value) == ("plate-load", pytest.approx(gap, abs=EXACT))
    assert not gap or found.reason == f"{abs(gap):.2g} m in one of 20 frames"
    apart = [
        G if k % 2 else 0.0 for k in range(frames - 1)
    ]  # bounces: never pressed before and after a frame
    said = known.unmeasured("contact.gap", pressed(recordings, scenario, apart, position=position), scenario)
    assert "none is pressed" in said


@pytest.mark.parametrize("engine", ENGINES)
def test_engines_bear_what_a_lift_asks(registry, known, engine):
    """To 1e-6 in the reference, to 5 % in every engine; limits judge loads at rest and impacts."""
    scene = catalogue()["platform_lift"]
    (found,) = known.value("force.error", registry.played("platform_lift", engine), scene).values()
    assert abs(found.value) < (1e-6 if engine == "reference" else 0.05)


MU, SPEED, RELEASE = 0.3, 1.2, 10
"""The box is pushed until the end of frame RELEASE."""


@pytest.fixture
def pushed(lab: SimpleNamespace, known) -> Scenario:
    """A floor, a box on it and a driven ball beside it."""
    box, trackers = lab.block("box", (0.1, 0.1, 0.1), (0.0, 0.0, 0.1)), (lab.still("hand", (-0.5, 0.0, 0.1)),)
    return lab.scene(lab.ground(), box, known.hand(), mu=MU, trackers=trackers)


@pytest.fixture
def coasting(pushed: Scenario, recordings, known):
    """The box slides at SPEED until it is let go, and then with `mu` to rest."""

    def build(mu: float = MU, turned: float = 0.0, driven: bool = True):
        t = np.arange(pushed.frame_count + 1) / pushed.frame_rate
        since = np.clip(t - RELEASE / pushed.frame_rate, 0.0, SPEED / (mu * G))
        x = SPEED * np.minimum(t, RELEASE / pushed.frame_rate) + SPEED * since - mu * G * since**2 / 2
        half = turned / 2 * np.linspace(0, 1, len(t))
        place = (0.0, 0.0, 0.1) + np.outer(x, ALONG)
        turns = np.outer(np.cos(half), (1, 0, 0, 0)) + np.outer(np.sin(half), (0, 0, 0, 1))
        columns = known.path(pushed, 1, place, np.outer(SPEED - mu * G * since, ALONG), turns)
        rows = [{"time": k / 60, "body_a": 0, "body_b": 1, "normal": (0, 0, 1)} for k in range(60)]
        push = {"body_a": 1, "body_b": 2, "normal": (-1, 0, 0), "impulse": (-1, 0, 0)}
        rows += [{"time": (RELEASE - 0.5) / 60, **push}] if driven else []
        return recordings.recording(pushed, contacts=recordings.contacts(*rows), **columns)

    return build


def test_a_box_that_obeys_coulomb_coasts_as_it_should(pushed, coasting, known):
    """Find no error where the way is v^2 / (2 mu g), and mu's own error where it is not."""
    assert known.value("friction.coast", coasting(), pushed)["box"] == pytest.approx(
        0.0, abs=1e-9
    )  # rounding
    found = known.value("friction.coast", coasting(mu=0.9 * MU), pushed)["box"]
    assert found == pytest.approx(1 / 0.9 - 1, rel=1e-9)


@pytest.mark.parametrize(
    ("fields", "reason"),
    [({"driven": False}, "no box that a driven body pushed"), ({"turned": 0.5}, "turns or topples")],
)
def test_what_does_not_coast_is_not_measured(pushed, coasting, known, fields, reason):
    """Tell why there is no number: nothing pushed the box, or it turned."""
    assert reason in known.unmeasured("friction.coast", coasting(**fields), pushed)

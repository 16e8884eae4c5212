"""Metrics against the closed form, on recordings that follow it, and that leave it by a known amount."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reports.metrics.context import NotMeasured
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import flips
from touchstone.scenarios.families.roll import rolling

PROBES = [scenario.name for scenario in tagged("probe")]
OF_TRUTH = ("truth.position", "truth.velocity", "truth.orientation", "truth.spin")
OF_MOTION = (*OF_TRUTH, "bounce.height", "rotation.flip", "rolling.time", "friction.stop", "friction.heading")


@pytest.mark.parametrize("scene", [name for name in PROBES if catalogue()[name].truths])
def test_what_follows_the_truth_is_right(recordings, known, scene):
    """A recording made of the closed form has no error in any metric of motion that applies."""
    scenario = catalogue()[scene]
    recording = known.ideal(recordings, scenario)
    measured = 0
    for name in (*OF_MOTION, "friction.lift", "friction.tilt", "friction.creep"):
        try:
            values = known.value(name, recording, scenario)
        except NotMeasured:
            continue
        measured += 1
        for value in values.values():
            # rounding; flips between frames are cubics: h^4 / 384 of the fourth derivative, 6^4 rad/s^5
            tolerance = 1e-6 if name == "rotation.flip" else 1e-9
            assert abs(getattr(value, "value", value)) < tolerance, name
    assert measured >= 1


@pytest.mark.parametrize("scene", ["fall", "slide", "bounce_e1", "collide_slips", "tumble_stable", "spring"])
def test_what_leaves_the_truth_is_measured(recordings, known, scene):
    """A constant offset of the last body shows in each metric at its size, with the body's name."""
    scenario = catalogue()[scene]
    right = known.ideal(recordings, scenario)
    k = scenario.body_index(scenario.truths[-1].body)
    turn = Rotation.from_rotvec((0.0, 0.02, 0.0))
    moved = {n: getattr(right, n).copy() for n in ("position", "linear_velocity", "angular_velocity")}
    moved["position"][:, k] += (0.0, 0.003, 0.004)
    moved["linear_velocity"][:, k, 0] += 0.01
    moved["angular_velocity"][:, k, 2] += 0.05
    turned = turn * Rotation.from_quat(right.orientation[:, k], scalar_first=True)
    moved["orientation"] = right.orientation.copy()
    moved["orientation"][:, k] = turned.as_quat(scalar_first=True)
    recording = replace(right, **moved)
    roots = [scenario.body_index(truth.body) for truth in scenario.truths]
    way = np.linalg.norm(right.position - right.position[0], axis=2)[:, roots].max()
    speed = np.linalg.norm(right.linear_velocity, axis=2)[:, roots].max()
    spin = np.linalg.norm(right.angular_velocity, axis=2)[:, roots].max()
    sizes = {"truth.position": 0.005 / way, "truth.velocity": 0.01 / speed, "truth.orientation": 0.02}
    sizes |= {"truth.spin": 0.05 / spin} if spin > 0 else {}
    for name, size in sizes.items():
        found = known.value(name, recording, scenario)[""]
        assert found.value == pytest.approx(size, rel=1e-9), name
        assert found.reason == (f"of {scenario.truths[-1].body}" if len(scenario.truths) > 1 else "")
    if spin == 0:
        assert "nothing turns" in known.unmeasured("truth.spin", recording, scenario)


def test_a_scene_without_truth_is_not_measured(recordings, known):
    """Scenes without a closed form have none of its metrics, with the reason."""
    scenario = catalogue()["rod_e1"]
    for name in OF_MOTION:
        assert known.unmeasured(name, recordings.recording(scenario), scenario)


@pytest.mark.parametrize("e", [0.5, 0.8])
def test_bounces_that_lose_too_much(recordings, known, e):
    """Heights fall short by the square of the coefficients' ratio; a bounce that never comes counts as -1."""
    scenario = catalogue()[f"bounce_e{e:g}".replace(".", "")]
    times = np.arange(scenario.frame_count + 1) / 60
    gap, speed = known.bouncing(times, 0.3, 0.9 * e)
    right = known.ideal(recordings, scenario)
    position, velocity = right.position.copy(), right.linear_velocity.copy()
    position[:, 1, 2], velocity[:, 1, 2] = 0.05 + gap, speed
    recording = replace(right, position=position, linear_velocity=velocity)
    found = known.value("bounce.height", recording, scenario)
    for k, value in enumerate(found.values(), start=1):
        # touches are found at 1e-4 m; a low bounce may have no frame of its own
        if value > -1:
            assert value == pytest.approx(0.9 ** (2 * k) - 1, abs=1e-6)
    assert found["#1"] > -1
    still = recordings.recording(scenario)
    assert set(known.value("bounce.height", still, scenario).values()) == {-1.0}


def test_flips_that_come_late_or_never(recordings, known):
    """A top that turns 1 % too slowly flips 1 % too late; one that does not turn over misses to the end."""
    scenario = catalogue()["tumble_unstable"]
    right = known.ideal(recordings, scenario)
    slow = replace(
        scenario, bodies=(replace(scenario.bodies[0], angular_velocity=(0.1 / 1.01, 6 / 1.01, 0.1 / 1.01)),)
    )
    late = known.ideal(recordings, slow)
    last = flips(scenario, scenario.truths[0])[-1]
    assert known.value("rotation.flip", late, scenario)["box"] == pytest.approx(0.01 * last, abs=1e-5)
    steady = replace(
        right,
        orientation=np.tile((1.0, 0.0, 0.0, 0.0), (601, 1, 1)),
        angular_velocity=np.tile((0.0, 6.0, 0.0), (601, 1, 1)),
    )
    first = flips(scenario, scenario.truths[0])[0]
    assert known.value("rotation.flip", steady, scenario)["box"] == pytest.approx(10.0 - first, abs=1e-9)


def test_stopping_short_and_sliding_on(recordings, known):
    """Ways are compared along the heading, relative to the closed form; one heading that differs shows."""
    scenario = catalogue()["slide"]
    right = known.ideal(recordings, scenario)
    position = right.position.copy()
    for k, share in ((1, 0.9), (2, 1.0), (3, 1.25)):
        position[:, k] = position[0, k] + share * (position[:, k] - position[0, k])
    recording = replace(right, position=position)
    found = known.value("friction.stop", recording, scenario)
    assert list(found.values()) == pytest.approx([-0.1, 0.0, 0.25], abs=1e-12)
    # against the mean way
    assert known.value("friction.heading", recording, scenario)[""] == pytest.approx(0.35 / 1.05, rel=1e-9)


def test_a_cube_that_lifts_tilts_and_creeps(recordings, known):
    """Rise and tilt are measured against the support, and creep over the second half of the rest."""
    scenario = catalogue()["slide"]
    right = known.ideal(recordings, scenario)
    position, orientation = right.position.copy(), right.orientation.copy()
    position[20:30, 2, 2] += 0.007
    turned = Rotation.from_rotvec((0.03, 0, 0)) * Rotation.from_quat(orientation[40, 3], scalar_first=True)
    orientation[40, 3] = turned.as_quat(scalar_first=True)
    time = right.time
    position[:, 1, 1] += 0.004 * np.maximum(0.0, time - 6.0 / (0.5 * 9.81))
    recording = replace(right, position=position, orientation=orientation)
    lift = known.value("friction.lift", recording, scenario)[""]
    tilt = known.value("friction.tilt", recording, scenario)[""]
    creep = known.value("friction.creep", recording, scenario)[""]
    assert (lift.reason, tilt.reason, creep.reason) == ("of box_22.5", "of box_45", "of box_0")
    assert lift.value == pytest.approx(0.007, abs=1e-12)
    assert tilt.value == pytest.approx(0.03, abs=1e-12)
    assert creep.value == pytest.approx(0.004, rel=1e-9)


def test_what_still_slides_does_not_creep(recordings, known):
    """Creep begins where a body that slid too far has stopped; one that never stops has none."""
    scenario = catalogue()["slide"]
    right = known.ideal(recordings, scenario)
    time, position = right.time, right.position.copy()
    stop = 6.0 / (0.5 * 9.81)
    late = stop + (time[-1] - stop) / 2
    position[:, 1, 1] += 0.3 * np.clip(time - stop, 0.0, late - stop) + 0.002 * np.maximum(0.0, time - late)
    creep = known.value("friction.creep", replace(right, position=position), scenario)[""]
    assert (creep.value, creep.reason) == (pytest.approx(0.002, rel=1e-9), "of box_0")
    for k in (1, 2, 3):
        position[:, k, 1] += 0.3 * np.maximum(0.0, time - stop)
    with pytest.raises(NotMeasured, match=r"box_0, .*, box_45 still slides at the end"):
        known.value("friction.creep", replace(right, position=position), scenario)


def test_what_should_never_slide_creeps_however_fast(recordings, known):
    """A body that should stick from the start is not excused by sliding away."""
    scenario = catalogue()["incline_holds"]
    right = known.ideal(recordings, scenario)
    body = scenario.body_index(scenario.truths[0].body)
    position = right.position.copy()
    position[:, body, 0] += 0.5 * right.time
    found = known.value("friction.creep", replace(right, position=position), scenario)[""]
    assert found.value == pytest.approx(0.5, rel=1e-9)


def test_yaw_is_no_tilt(recordings, known):
    """A cube that turns about the support's normal does not tilt."""
    scenario = catalogue()["incline_holds"]
    right = known.ideal(recordings, scenario)
    normal = Rotation.from_quat(scenario.bodies[0].orientation, scalar_first=True).apply((0.0, 0.0, 1.0))
    turned = Rotation.from_rotvec(np.outer(np.linspace(0, 2, len(right.time)), normal))
    orientation = right.orientation.copy()
    orientation[:, 1] = (turned * Rotation.from_quat(orientation[:, 1], scalar_first=True)).as_quat(
        scalar_first=True
    )
    recording = replace(right, orientation=orientation)
    assert known.value("friction.tilt", recording, scenario)[""].value < 1e-7


def test_slip_that_ends_late(recordings, known):
    """Friction at 0.8 of mu ends the slip 1.25 times as late; a ball that never slows never rolls."""
    scenario = catalogue()["slip"]
    weaker = replace(scenario, coefficients=(replace(scenario.coefficients[0], friction=0.24),))
    late = rolling("slip", ("headings",), (0.0, 22.5, 45.0), 0.24, 2.0, 0.0, 1.0)
    assert weaker.coefficients == late.coefficients
    found = known.value("rolling.time", known.ideal(recordings, late), scenario)
    assert list(found.values()) == pytest.approx([0.25] * 3, rel=1e-9)
    still = known.ideal(recordings, scenario)
    slipping = replace(
        still,
        linear_velocity=np.tile(still.linear_velocity[0], (len(still.time), 1, 1)),
        angular_velocity=np.zeros_like(still.angular_velocity),
    )
    assert set(known.value("rolling.time", slipping, scenario).values()) == {np.inf}


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
    said = known.unmeasured("symmetry.mirror", recordings.recording(scenario), scenario)
    assert "not tagged symmetric" in said
    wrong = replace(catalogue()["tip_holds"], tags=("symmetric",))
    said = known.unmeasured("symmetry.mirror", recordings.recording(wrong), wrong)
    assert "box has no mirror image" in said


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
        said = known.unmeasured(metric, recordings.recording(catalogue()["fall"]), catalogue()["fall"])
        assert "no body rests" in said


@pytest.fixture
def scene(lab):
    """Two balls over a fixed block of 2 m by 2 m by 1 m, turned by a quarter about z and shifted by 1 m."""
    block = lab.block("block", (1.0, 1.0, 0.5), (1.0, 0.0, -0.5), kind="fixed")
    block = replace(block, orientation=(0.5**0.5, 0.0, 0.0, 0.5**0.5))
    one, two = lab.ball("one", (0.5, 0.0, -0.2)), lab.ball("two", (1.5, 0.5, -0.2))
    return replace(lab.scene(block, one, two, duration=1.0), tags=("settles",))


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
    assert "nothing has to come to rest" in known.unmeasured(name, recording, replace(scene, tags=()))
    assert "the end was not played" in known.unmeasured(name, recording, replace(scene, duration=2.0))

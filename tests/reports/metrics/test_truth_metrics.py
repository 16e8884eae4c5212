"""Metrics against the closed form, on recordings that follow it, and that leave it by a known amount."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reports.metrics.context import NotMeasured
from touchstone.scenarios.catalogue import catalogue, tagged

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
    moved = {
        name: getattr(right, name).copy() for name in ("position", "linear_velocity", "angular_velocity")
    }
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
        with pytest.raises(NotMeasured, match="nothing turns"):
            known.value("truth.spin", recording, scenario)


def test_a_scene_without_truth_is_not_measured(recordings, known):
    """Scenes without a closed form have none of its metrics, with the reason."""
    scenario = catalogue()["rod_e1"]
    for name in OF_MOTION:
        with pytest.raises(NotMeasured):
            known.value(name, recordings.recording(scenario), scenario)


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
    from touchstone.scenarios.closed_form import flips

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
    turned = Rotation.from_rotvec((0.03, 0.0, 0.0)) * Rotation.from_quat(
        orientation[40, 3], scalar_first=True
    )
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
    from touchstone.scenarios.families.roll import rolling

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

"""Metrics of joints between bodies on motions that are known: drift, turns, limits, springs.

Scenes are parameters, so that the worker that has integrated their truths runs these tests.
"""

from dataclasses import replace

import numpy as np
import pytest

from touchstone.reports.metrics.context import Context, NotMeasured
from touchstone.reports.metrics.motion.joints import joint_force, joint_motion
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.truths.mechanism import played

ROUNDING = 1e-11
"""Drift of an integrated truth [m, rad]."""


@pytest.mark.parametrize("name", ["bricard", "slider_crank"])
def test_truths_do_not_drift(recordings, known, name):
    """Anchors meet and axes agree where every body moves by the truth."""
    scene = catalogue()[name]
    recording = known.ideal(recordings, scene)
    assert known.value("joint.drift", recording, scene)[""].value == pytest.approx(0, abs=ROUNDING)
    turn = known.value("joint.turn", recording, scene)[""]
    assert getattr(turn, "value", turn) == pytest.approx(0, abs=ROUNDING)


@pytest.mark.parametrize("name", ["motor_hinge", "slider_spring"])
def test_positions_count_whole_turns(recordings, known, name):
    """A flywheel's angle is that of the integration, over several turns; a slider's is its travel."""
    scene = catalogue()[name]
    recording = known.ideal(recordings, scene)
    found = joint_motion(recording, scene, scene.body_joints[0]).position
    if name == "motor_hinge":
        expected = played(scene)[0].solution(recording.time)[13]
        assert expected[-1] > 4 * np.pi
    else:
        expected = recording.position[:, 0] @ np.array(scene.body_joints[0].axis)
    np.testing.assert_allclose(found, expected, atol=1e-10 if name == "motor_hinge" else 1e-14)


@pytest.mark.parametrize("name", ["four_bar"])
def test_drift_is_the_distance_of_the_anchors(recordings, known, name):
    """A link that is 1 mm off in one frame has parted by that; one turned about z by that angle."""
    scene = catalogue()[name]
    right = known.ideal(recordings, scene)
    position = right.position.copy()
    position[30, 1] += (0.0, 1e-3, 0.0)
    parted = known.value("joint.drift", replace(right, position=position), scene)[""]
    assert parted.value == pytest.approx(1e-3, rel=1e-9)
    assert parted.reason in ("of b_coupler", "of c_rocker")
    orientation = right.orientation.copy()
    w, x, y, z = orientation[30, 1]
    half = 0.005
    orientation[30, 1] = np.cos(half) * np.array((w, x, y, z)) + np.sin(half) * np.array((-z, -y, x, w))
    turned = known.value("joint.turn", replace(right, orientation=orientation), scene)[""]
    assert turned.value == pytest.approx(0.01, rel=1e-6)


@pytest.mark.parametrize("name", ["geared_pendulums"])
def test_a_coupling_that_slips_is_a_turn(recordings, known, name):
    """A pendulum that lags by an angle turns by it otherwise than it may."""
    scene = catalogue()[name]
    right = known.ideal(recordings, scene)
    assert known.value("joint.turn", right, scene)[""].value == pytest.approx(0, abs=ROUNDING)
    short = scene.body_joints[1]
    slow = replace(scene, body_joints=(scene.body_joints[0], replace(short, ratio=-1.9)), truths=())
    angle = joint_motion(right, scene, scene.body_joints[0]).position
    turn = known.value("joint.turn", right, slow)[""]
    assert turn.value == pytest.approx(0.1 * np.abs(angle).max(), rel=1e-9)
    assert turn.reason == "of shaft_short"


@pytest.mark.parametrize("name", ["slider_crank"])
def test_a_coupling_that_slips_is_a_drift(recordings, known, name):
    """A slider that lags behind has drifted by its lag."""
    scene = catalogue()[name]
    crank, *others, bore = scene.body_joints
    assert bore.type == "slider"
    recording = known.ideal(recordings, scene)
    rest = {"linear_velocity": (0.0, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.0)}
    bodies = tuple(replace(body, **rest) for body in scene.bodies)
    coupled = (crank, *others, replace(bore, mimics=crank.name, ratio=0.5))
    lag = joint_motion(recording, scene, bore).position - joint_motion(recording, scene, crank).position / 2
    scene = replace(scene, bodies=bodies, body_joints=coupled, truths=())
    drift = known.value("joint.drift", recording, scene)[""]
    assert drift.value == pytest.approx(np.abs(lag).max(), rel=1e-9)


@pytest.mark.parametrize(
    ("name", "metric"), [("motor_hinge", "joint.limit"), ("slider_spring", "joint.stop")]
)
def test_excess_is_beyond_the_limits(recordings, known, name, metric):
    """A hinge and a slider that move farther than their limits exceed them by the rest."""
    scene = catalogue()[name]
    recording = known.ideal(recordings, scene)
    reach = joint_motion(recording, scene, scene.body_joints[0]).position.max()
    bound = replace(scene.body_joints[0], upper=0.75 * reach)
    bounded = replace(scene, body_joints=(bound,), truths=())
    assert known.value(metric, recording, bounded)[""].value == pytest.approx(reach / 4, rel=1e-9)
    assert "limits" in known.unmeasured(metric, recording, scene)


@pytest.mark.parametrize("name", ["slider_spring"])
def test_springs_store_energy(recordings, known, name):
    """Without its damper a spring keeps the energy; with it, energy only falls."""
    scene = catalogue()[name]
    damped = known.ideal(recordings, scene)
    assert known.value("energy.injected", damped, scene)["simulated"] < 1e-12
    joint = replace(scene.body_joints[0], damping=0.0)
    free = replace(scene, body_joints=(joint,), tags=("joints", "conservative"))
    recording = known.ideal(recordings, free)
    assert abs(known.value("energy.gain", recording, free)[""]) < 1e-10
    assert abs(known.value("energy.loss", recording, free)[""]) < 1e-10
    # without the spring's energy, that of the motion would be lost
    bare = replace(free, body_joints=(replace(joint, stiffness=0.0),))
    assert known.value("energy.loss", recording, bare)[""] < -1e-3


@pytest.mark.parametrize("name", ["motor_hinge"])
def test_the_work_of_motors_is_not_known(recordings, known, name):
    """Energy is not judged where a joint drives its bodies."""
    scene = catalogue()[name]
    said = known.unmeasured("energy.injected", known.ideal(recordings, scene), scene)
    assert "drives its bodies: its work is not known" in said


@pytest.mark.parametrize("name", ["four_bar", "hinged_pair"])
def test_forces_of_joints_are_no_missing_impulses(recordings, known, name):
    """Bodies that nothing touches are balanced together with what they are joined to, or not at all."""
    scene = catalogue()[name]
    said = known.unmeasured("contact.impulse_balance", known.ideal(recordings, scene), scene)
    assert "no simulated body is touched" in said


@pytest.mark.parametrize("name", ["double_pendulum"])
def test_forces_are_what_changes_momentum(recordings, known, name):
    """They are exact on a truth; a link that is too fast by 0.01 m/s in one frame errs by m 0.01 / frame."""
    scene = catalogue()[name]
    right = known.ideal(recordings, scene)
    assert known.value("joint.force", right, scene)[""].value == 0.0
    velocity = right.linear_velocity.copy()
    velocity[30, 1] += (0.01, 0.0, 0.0)
    found = known.value("joint.force", replace(right, linear_velocity=velocity), scene)[""]
    hanging = sum(body.mass for body in scene.bodies) * np.array(scene.acting_gravity)
    momentum = np.tensordot([body.mass for body in scene.bodies], right.linear_velocity, (0, 1))
    largest = np.linalg.norm(60 * np.diff(momentum, axis=0) - hanging, axis=1).max()
    assert found.value == pytest.approx(scene.bodies[1].mass * 0.01 * 60 / largest, rel=1e-9)


@pytest.mark.parametrize("name", ["four_bar"])
def test_forces_in_loops_are_not_known(recordings, known, name):
    """Momentum does not tell the forces of joints in a loop."""
    scene = catalogue()[name]
    with pytest.raises(NotMeasured, match="outside loops"):
        joint_force(Context(known.ideal(recordings, scene), scene))

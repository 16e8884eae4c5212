"""Joint limits, reach cones and speeds of a person, against closed forms and sampling."""

from math import radians

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.posture import cone_excess, limit_excess
from touchstone.scenarios.avatar.chains import hinge_axes


@pytest.fixture
def shown(lab, recordings):
    """The context of a person whose named hinges have given angles, one a frame; others rest at 0."""
    scenario = lab.person()
    names = list(scenario.trackers[0].joints)

    def build(**angles) -> Context:
        columns = np.zeros((scenario.frame_count + 1, len(names)))
        for name, rows in angles.items():
            columns[: len(rows), names.index(name)] = rows
        return Context(recordings.recording(scenario, joint_angle=columns), scenario)

    return build


def test_excess_over_a_limit(shown, known):
    """An elbow 0.1 rad beyond its least angle is reported with its name; one within is not."""
    context = shown(left_elbow=[0.0, -0.1, 0.2])
    found = known.value("joint.limit", context.recording, context.scenario)[""]
    assert (found.value, found.reason) == (pytest.approx(0.1, rel=1e-12), "of left_elbow")
    assert limit_excess(shown(left_elbow=[0.0, 0.5])).max() == 0


def test_speed_is_the_change_of_angle(shown, known):
    """A knee that turns 0.05 rad in a frame turns at 3 rad/s."""
    context = shown(right_knee=[0.0, 0.05, 0.05])
    found = known.value("joint.speed", context.recording, context.scenario)[""]
    assert found.value == pytest.approx(3.0, rel=1e-12)


def cones(scenario):
    return [cone for chain in scenario.chains for cone in chain.cones]


@pytest.mark.parametrize("number", range(5))
def test_a_bone_outside_is_as_far_as_the_nearest_point_of_its_cone(shown, number):
    """Random bones without twist: 0 inside, else the angle to the nearest of many points on the edges."""
    cone = cones(shown().scenario)[number]
    joints = {joint.name: joint for joint in shown().scenario.joints}
    axes = hinge_axes(tuple(joints[name] for name in cone.joints))
    rng = np.random.default_rng(number)
    center, corners = np.array(cone.center) @ axes, np.array(cone.swing) @ axes
    # to the centre by the shortest way and on in its plane: twist 0
    toward = rng.normal(size=(40, 3))
    across = np.cross(center, toward)
    across *= (rng.uniform(0, 2.2, 40) / np.linalg.norm(across, axis=1))[:, None]
    turned = Rotation.from_rotvec(across) * _shortest((0.0, 0.0, 1.0), center)
    angles = turned.as_euler("XYZ")
    context = shown(**{name: angles[:, k] for k, name in enumerate(cone.joints)})
    found = cone_excess(context, cone)[:40]
    bones = turned.apply((0.0, 0.0, 1.0))
    share = np.linspace(0, 1, 400)[:, None, None]
    edge = ((1 - share) * corners + share * np.roll(corners, -1, axis=0)).reshape(-1, 3)
    edge /= np.linalg.norm(edge, axis=1)[:, None]
    nearest = np.arccos(np.clip(bones @ edge.T, -1, 1)).min(axis=1)
    outside = found > 0
    assert 5 < outside.sum() < 40
    # points on an edge of a radian are 2.5 mrad apart
    np.testing.assert_allclose(found[outside], nearest[outside], atol=2e-3)


def _shortest(start, end) -> Rotation:
    axis = np.cross(start, end)
    size = np.linalg.norm(axis)
    return Rotation.from_rotvec(axis * (np.arctan2(size, np.dot(start, end)) / size if size > 0 else 1.0))


def test_twist_beyond_its_range(shown):
    """A hip turned about its bone by 10 degrees more than it may is so far outside."""
    cone = next(c for c in cones(shown().scenario) if c.joints[0] == "left_hip_1")
    low, high = cone.twist
    joints = {joint.name: joint for joint in shown().scenario.joints}
    axes = hinge_axes(tuple(joints[name] for name in cone.joints))
    at_center = _shortest((0.0, 0.0, 1.0), np.array(cone.center) @ axes)
    twists = (high + radians(10), high - radians(10), low - radians(10))
    angles = np.array([(at_center * Rotation.from_rotvec((0, 0, t))).as_euler("XYZ") for t in twists])
    context = shown(**{name: angles[:, k] for k, name in enumerate(cone.joints)})
    np.testing.assert_allclose(cone_excess(context, cone)[:3], [radians(10), 0, radians(10)], atol=1e-12)

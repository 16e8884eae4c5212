"""Scenes as MJCF and URDF: engines' own loaders read them with the scene's masses, places and corners."""

import mujoco
import numpy as np
import pytest

from touchstone.adapters.robots.export_mjcf import mjcf
from touchstone.adapters.robots.export_urdf import urdf_files
from touchstone.adapters.robots.robot_scene import imported
from touchstone.scenarios.avatar.kinematics import tracked_poses
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import TRACKED, UNMOVED, Capsule, Ellipsoid, Hull
from touchstone.scenarios.solids import capsule, ellipsoid

SCENES = ("ball_snip", "wall_push", "dominoes", "arch_stands", "fall", "platform_lift", "turntable", "belt")


@pytest.mark.parametrize("name", SCENES)
def test_mujoco_reads_the_mjcf(name):
    """Bodies have the scene's poses, masses and inertias to rounding; hinges have its limits."""
    scenario = catalogue()[name]
    model = mujoco.MjModel.from_xml_string(mjcf(scenario))
    data = mujoco.MjData(model)
    for tracker in scenario.trackers:
        for joint, angle in zip(tracker.joints, tracker.angles[0]):
            data.qpos[model.jnt_qposadr[model.joint(joint).id]] = angle
    mujoco.mj_kinematics(model, data)
    for body in scenario.bodies:
        own = model.body(body.name)
        if body.kind not in TRACKED:
            assert np.allclose(data.xpos[own.id], body.position, atol=1e-15)
        assert (model.body_mocapid[own.id] >= 0) == (body.kind == "prescribed")
        if body.kind not in UNMOVED:
            moments = np.linalg.eigvalsh(body.inertia)
            assert own.mass[0] == body.mass
            assert np.allclose(np.sort(own.inertia), moments, rtol=1e-9)
        assert own.geomnum[0] == len(body.pieces)
        moves = [(*piece.surface_velocity, *piece.surface_angular_velocity) for piece in body.pieces]
        assert model.geom_surfacevel[model.geom_bodyid == own.id].tolist() == list(map(list, moves))
    for joint in scenario.joints:
        assert model.joint(joint.name).range.tolist() == [joint.lower, joint.upper]
    for tracker in scenario.trackers:
        places = tracked_poses(scenario, tracker, np.zeros(1))[0][0]
        found = [data.xpos[model.body(scenario.bodies[k].name).id] for k in scenario.links(tracker)]
        assert np.allclose(found, places, atol=1e-12)


@pytest.mark.parametrize("name", ["ball_snip", "wall_push"])
def test_a_urdf_comes_back(name, tmp_path):
    """A driven body exported and imported has the same links, masses, limits and corners of hulls."""
    scenario = catalogue()[name]
    for file, text in urdf_files(scenario).items():
        (tmp_path / file).write_text(text)
    tracker = scenario.trackers[0]
    again = imported(tmp_path / f"{tracker.root}.urdf", "again").scenario
    links = [scenario.bodies[k] for k in scenario.links(tracker)]
    found = {body.name: body for body in again.bodies}
    assert {body.name for body in links} == found.keys() - {"floor"}
    for body in links:
        own = found[body.name]
        assert own.mass == pytest.approx(body.mass, rel=1e-12)
        assert np.allclose(own.center_of_mass, body.center_of_mass, atol=1e-12)
        assert np.allclose(own.inertia, body.inertia, rtol=1e-9, atol=1e-9 * np.max(body.inertia))
        hulls = [piece.shape for piece in own.pieces if isinstance(piece.shape, Hull)]
        wanted = [piece.shape for piece in body.pieces if isinstance(piece.shape, Hull)]
        assert [len(one.vertices) for one in hulls] == [len(one.vertices) for one in wanted]
    limits = {joint.name: (joint.lower, joint.upper) for joint in again.joints}
    assert limits == {joint.name: (joint.lower, joint.upper) for joint in scenario.joints}


def test_bullet_loads_the_urdf(tmp_path, lab):
    """Every file of a scene loads in Bullet, with its mass; shapes that URDF lacks become others."""
    pybullet = pytest.importorskip("pybullet")
    bodies = (
        capsule("a capsule", "wood", 0.1, 0.2, 1.5),
        ellipsoid("egg", "wood", (0.3, 0.1, 0.1), 0.5, position=(2.0, 0.0, 0.0)),
    )
    scenario = lab.scene(*bodies, lab.ground())
    assert isinstance(scenario.bodies[0].pieces[0].shape, Capsule)
    assert isinstance(scenario.bodies[1].pieces[0].shape, Ellipsoid)
    files = urdf_files(scenario)
    for file, text in files.items():
        (tmp_path / file).write_text(text)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        for file, mass in (("a_capsule.urdf", 1.5), ("egg.urdf", 0.5)):
            loaded = pybullet.loadURDF(str(tmp_path / file), physicsClientId=client)
            assert pybullet.getDynamicsInfo(loaded, -1, physicsClientId=client)[0] == mass
    finally:
        pybullet.disconnect(client)
    assert sum(name.endswith(".urdf") for name in files) == len(scenario.bodies)

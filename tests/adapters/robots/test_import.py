"""Robots as scenes: mass, inertia, joints and limits are the model's; what cannot be kept is named."""

import re
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from foreign_models import folders, models
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.oracles.robot_file import EQUAL, deviations, trees_of
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import imported
from touchstone.adapters.robots.source import compiled
from touchstone.scenarios.files.read import read_scene
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.scenario import Box, Cylinder
from touchstone.scenarios.triangle_mesh import solid_below

QUICK = (
    *("kuka_iiwa/model.urdf", "quadruped/minitaur.urdf", "pendulum5.urdf", "mjcf/humanoid.xml"),
    *("mini_cheetah/mini_cheetah.urdf", "mjcf/hopper.xml"),
)
"""Models with small meshes; the last two are refused."""
ARM = """<robot name="arm"><link name="base">
 <inertial><mass value="2"/><inertia ixx="1" ixy="0.1" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  <collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
 <link name="rod"><inertial><origin xyz="0 0 0.2" rpy="0.3 0 0"/><mass value="0.5"/>
   <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.011" iyz="0" izz="0.002"/></inertial>
  <collision><geometry><cylinder radius="0.02" length="0.4"/></geometry></collision></link>
 <link name="tip"><inertial><mass value="0.1"/>
  <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
  <collision><geometry><mesh filename="tip.obj"/></geometry></collision></link>
 <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/>
  <origin xyz="0 0 0.1" rpy="0 0.2 0"/><axis xyz="0 1 1"/>
  <limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
 <joint name="glue" type="fixed"><parent link="rod"/><child link="tip"/><origin xyz="0 0 0.4"/></joint>
</robot>
"""
TIP = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
BODY = """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
<body name="torso" pos="0 0 1"><freejoint name="free"/><geom name="belly" type="capsule" size="0.1 0.2"/>
 <body name="leg" pos="0 0 -0.3" euler="10 0 0">
  <joint name="x" axis="1 0 0" range="-30 30"/><joint name="y" axis="0 1 0" range="-40 40"/>
  <joint name="z" axis="0 0 1" range="-50 50"/>
  <geom type="capsule" fromto="0 0 0 0 0.1 -0.4" size="0.05"/>
  <body name="foot" pos="0 0.1 -0.4"><joint name="ankle" pos="0 0.02 0" axis="0 1 0"/>
   <geom size="0.06"/></body></body></body></worldbody></mujoco>
"""
END = "</worldbody>"
TERRAIN = """<mujoco><asset><mesh name="groove" file="groove.obj"/>
 <hfield name="hill" nrow="3" ncol="4" size="0.6 0.4 0.3 0.1" elevation="0 1 2 1  3 0 2 1  1 2 0 3"/></asset>
<worldbody><geom name="field" type="hfield" hfield="hill" pos="0.1 0 0.2" euler="0 0 20"/>
<body pos="2 0 0" euler="0 0 30"><geom name="rock" type="mesh" mesh="groove"/></body>
<body pos="0 0 2"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>
"""


@pytest.fixture
def robot(tmp_path):
    """Import a text as a file with the mesh of a tip beside it; returns the scene and its notes."""
    (tmp_path / "tip.obj").write_text(TIP)

    def make(text: str, name: str = "robot.xml", **options):
        (tmp_path / name).write_text(text)
        return imported(tmp_path / name, "robot", **options)

    return make


def check_whole(path, found) -> None:
    """Masses, hinges and limits of the scene are those that other readers find in the file."""
    trees = trees_of(path, compiled(path, allow_paths=True), found.scenario)
    assert max(deviations(found, trees).values()) <= EQUAL


def test_a_urdf_keeps_its_masses_and_joints(robot, tmp_path):
    """Fixed joints merge links; the hinge has its axis, place and limits; a hull has the mesh's corners."""
    found = robot(ARM, "arm.urdf")
    scenario = found.scenario
    assert [body.name for body in scenario.bodies] == ["floor", "base", "rod"]
    (joint,) = scenario.joints
    assert (joint.name, joint.lower, joint.upper) == ("hinge", -1.0, 2.0)
    turn = Rotation.from_euler("xyz", (0, 0.2, 0))
    assert np.allclose(joint.axis, turn.apply((0, 0.5**0.5, 0.5**0.5)), atol=1e-15)
    assert scenario.bodies[2].mass == pytest.approx(0.6, rel=1e-15)
    rod, tip = (piece.shape for piece in scenario.bodies[2].pieces)
    assert rod == Cylinder(0.02, 0.2)
    assert len(tip.vertices) == 4
    check_whole(tmp_path / "arm.urdf", found)
    assert [note.partition(":")[0] for note in found.notes] == ["mesh 'tip'", "friction", "floor"]
    assert found.notes[1] == "friction: no shape states one; 1 holds for all, as in MuJoCo, restitution 0"
    # what is written is read again, to the bit
    (tmp_path / "again.toml").write_text(scene_toml(scenario, "\n".join(found.notes)))
    assert read_scene(tmp_path / "again.toml") == scenario


def test_several_hinges_share_a_body(robot, tmp_path):
    """A body with three hinges becomes three links that weigh the same in every posture."""
    found = robot(BODY)
    scenario = found.scenario
    assert [joint.name for joint in scenario.joints] == ["x", "y", "z", "ankle"]
    assert [chain.joints for chain in scenario.chains] == [("x", "y", "z", "ankle")]
    assert scenario.joints[3].upper == 1000.0
    assert any("joint 'ankle': without limits;" in note for note in found.notes)
    stated = robot(BODY.replace('<geom size="0.06"', '<geom friction="1" size="0.06"'))
    assert not any(note.startswith("friction") for note in stated.notes)
    assert scenario.trackers[0].positions[0] == (0.0, 0.0, 1.0)
    floor, (slab,) = scenario.bodies[0], scenario.bodies[0].pieces
    assert (floor.kind, slab.shape, slab.position[2]) == ("fixed", Box((10.0, 10.0, 0.5)), -0.5)
    check_whole(tmp_path / "robot.xml", found)


def test_a_note_tells_limits_that_are_missing_from_none(robot):
    """A continuous hinge needs no limits; a revolute one states them."""
    for kind, text in (("continuous", "without limits"), ("revolute", "limits equal or missing")):
        arm = ARM.replace('"revolute"', f'"{kind}"').replace('lower="-1" upper="2"', 'lower="1" upper="1"')
        assert robot(arm, "arm.urdf").notes[-1].startswith(f"joint 'hinge': {text}; the scene has 1000 rad")


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ('"revolute"', '"planar"', "r.urdf:10: joint 'hinge': type planar: three degrees of freedom"),
        ('"revolute"', '"floating"', "r.urdf:10: joint 'hinge': type floating: six degrees"),
        ("tip.obj", "none.obj", "r.urdf:9: mesh: file 'none.obj' is missing"),
        ("tip.obj", "/etc/passwd", "r.urdf:9: mesh: file '/etc/passwd' lies outside the robot's"),
        ("tip.obj", "tip.dae", "r.urdf:9: mesh: tip.dae: Collada: File came out empty"),
        ("tip.obj", "tip.ply", "r.urdf:9: mesh: tip.ply: found .ply, expected .stl, .obj, .msh, .dae"),
        ('ixx="0.01"', 'ixx="0.1"', "r.urdf:4: link 'rod': a moment of inertia exceeds the sum"),
        ("</robot>", "", "r.urdf:15: not XML: no element found"),
        ("robot", "rebot", "r.urdf:1: found <rebot>, expected <robot> (URDF) or <mujoco> (MJCF)"),
        ('<robot name="arm">', '<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;">', "r.urdf:1: entity 'a'"),
        (
            END,
            f'{END}\n<tendon><spatial name="t"><site site="a"/></spatial></tendon>',
            "r.xml:9: spatial 't': a tendon that spans bodies cannot be kept",
        ),
        (
            END,
            f'{END}\n<equality><connect body1="foot" anchor="0 0 0"/></equality>',
            "r.xml:9: connect: a closed loop cannot be kept",
        ),
        ("<worldbody>", '<include file="../x.xml"/><worldbody>', "r.xml:1: include: file '../x.xml' is"),
        ('type="capsule" size="0.1', 'type="blob" size="0.1', "r.xml:2: geom 'belly': invalid keyword"),
    ],
)
def test_what_no_scene_holds_is_refused_by_name(robot, tmp_path, old, new, line):
    """One line per fault: file, line, element and reason; nothing outside the folder is read."""
    name = line.partition(":")[0]
    text = ARM if name == "r.urdf" else BODY
    assert old in text
    (tmp_path / "tip.dae").write_text("<COLLADA/>")
    (tmp_path / "tip.ply").write_text("ply")
    with pytest.raises(RobotError, match=re.escape(line)):
        robot(text.replace(old, new), name)


def test_slides_are_held_and_named(robot):
    """A sliding joint stays where it starts, and its body is part of its parent."""
    found = robot(BODY.replace('<joint name="ankle"', '<joint name="ankle" type="slide"'))
    assert [joint.name for joint in found.scenario.joints] == ["x", "y", "z"]
    assert "joint 'ankle' slides: it stays where it starts, since scenes have hinges only" in found.notes


def test_what_mujoco_warns_of_is_a_note(robot, tmp_path, monkeypatch):
    """A warning of MuJoCo becomes a note, not a log in the current folder."""
    monkeypatch.chdir(tmp_path)
    found = robot(
        '<mujoco><custom><numeric name="n" data="nan"/></custom>'
        '<worldbody><body name="a"><freejoint/><geom size="1" mass="1"/></body></worldbody></mujoco>'
    )
    assert found.notes[0] == "MuJoCo: XML contains a 'NaN'. Please check it carefully."
    assert {path.name for path in tmp_path.iterdir()} == {"robot.xml", "tip.obj"}


def test_models_of_pybullet_import_or_say_why(tmp_path):
    """Each model gives a valid scene of the model's mass, or one line with its element."""
    home = folders()["pybullet"]
    if home is None:
        pytest.skip("pybullet is not installed")
    refused = []
    for name in QUICK:
        try:
            found = imported(home / name, "robot", allow_paths=True)
        except RobotError as error:
            refused.append(str(error))
            continue
        check_whole(home / name, found)
    places = [line.partition(": ")[0].split("/")[-1] for line in refused]
    assert places == ["mini_cheetah.urdf:57", "hopper.xml:2"]


@pytest.mark.slow
def test_foreign_models_import_and_weigh_the_same_in_every_engine(capsys):
    """At least 25 of 30 models of others import; every engine agrees on mass, inertia and limits to 1e-9."""
    from touchstone.reports.views.model_card import AGREED, _held, deviation

    paths = models()
    if len(paths) < 30:
        pytest.skip("pip install -e '.[models]' for models of gymnasium, dm_control and example-robot-data")
    played, refused, differ, skipped, complete = [], [], [], [], 0
    for path in paths:
        try:
            found = imported(path, "robot", allow_paths=True)
        except RobotError as error:
            refused.append(str(error).splitlines()[0])
            continue
        played.append(path.name)
        scenario = found.scenario
        if len(scenario.trackers) == 1:
            check_whole(path, found)
        held, reasons = _held(scenario)
        # An engine may lack a shape, or find no way out of links that start in each other.
        skipped += [f"{path.name} {engine}: {reason}" for engine, reason in reasons.items()]
        complete += not reasons
        for engine, recording in held.items():
            for tracker in scenario.trackers:
                off = deviation(scenario, tracker, recording)
                if off > AGREED:
                    differ.append(f"{path.name} {engine}: {off:.1e}")
    with capsys.disabled():
        print(
            f"\n{len(played)} of {len(paths)} import; refused:", *refused, "not played:", *skipped, sep="\n  "
        )
    assert len(played) >= 25
    assert all(re.search(r":\d+: \w+", line) for line in refused)
    assert differ == []
    assert complete >= 25


BELT = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 1" pos="40 5 -1" euler="0 0 30"/>
<geom name="belt" type="box" size="2 .3 .1" pos="0 0 -.1" surfacevel="1 0 0 0 0 0"/>
<geom name="disc" type="plane" size="1 1 1" pos="0 0 -3" surfacevel="0 0 0 0 2 0.5"/>
<body name="load" pos="0 0 .1"><freejoint/>
 <geom type="box" size=".1 .1 .1" mass="1" surfacevel="0 2 0 0 0 0"/></body></worldbody></mujoco>"""


def test_belts_keep_their_surface_velocity(robot):
    """Surfaces of fixed geoms move, each in a body of its own; those of bodies that can move are named."""
    found = robot(BELT)
    bodies = {body.name: body for body in found.scenario.bodies}
    assert bodies.keys() == {"world", "belt", "disc", "load"}
    (piece,) = bodies["belt"].pieces
    assert (piece.surface_velocity, piece.surface_angular_velocity) == ((1.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    # the slab of a plane has its origin 0.5 m below that point of it which is next to the world's
    np.testing.assert_allclose(bodies["world"].pieces[0].position, (0.0, 0.0, -1.5), atol=1e-12)
    (piece,) = bodies["disc"].pieces
    assert (piece.surface_velocity, piece.surface_angular_velocity) == ((-1.0, 0.0, 0.0), (0.0, 2.0, 0.5))
    assert bodies["load"].pieces[0].surface_velocity == (0.0, 0.0, 0.0)
    assert "left out: moving surfaces of 1 geom of bodies that can move" in found.notes
    seen = record(load("reference"), replace(found.scenario, duration=1.0), Settings("balanced", 1 / 60))
    # it slides for 1 / g seconds, mu = 1
    assert seen.position[-1, -1, 0] == pytest.approx(1 - 1 / (2 * 9.81), abs=1e-6)


def test_terrain_keeps_its_triangles(robot, tmp_path):
    """A height field's surface is where MuJoCo's rays meet it; a fixed mesh with a hollow has its triangles,
    in the world's frame, and its hull if it is not closed."""
    x, y = np.meshgrid((-0.5, 0.0, 0.5), (-0.4, 0.4), indexing="ij")
    groove = solid_below(np.stack([x, y, np.abs(x)], axis=-1), -0.2)
    lines = [f"v {a} {b} {c}" for a, b, c in groove.vertices]
    faces = ["f {} {} {}".format(*(k + 1 for k in corners)) for corners in groove.triangles]
    (tmp_path / "groove.obj").write_text("\n".join([*lines, *faces]))
    found = robot(TERRAIN)
    field, rock = (body for body in found.scenario.bodies if body.kind == "fixed")
    assert len(field.pieces) == 12
    assert len(rock.pieces) == len(faces)
    assert any(f"{len(faces)} triangles" in note for note in found.notes)
    corners = [np.array(piece.shape.vertices[:3]) for piece in rock.pieces]
    turned = [world_of(piece, top) for piece, top in zip(rock.pieces, corners)]
    moved = Rotation.from_euler("z", 30, True).apply(groove.vertices) + (2, 0, 0)
    expected = {tuple(np.round(p, 6)) for p in moved}
    assert {tuple(np.round(p, 6)) for p in np.concatenate(turned)} == expected

    model = compiled(tmp_path / "robot.xml").model
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for weights in np.random.default_rng(0).dirichlet(np.ones(3), 5):
        for piece in field.pieces:
            place = weights @ world_of(piece, np.array(piece.shape.vertices[:3]))
            down, geom = np.array([0.0, 0.0, -1.0]), np.zeros(1, np.int32)
            above = mujoco.mj_ray(model, data, place + (0, 0, 1.0), down, None, 1, -1, geom)
            assert above == pytest.approx(1.0, abs=1e-6)

    (tmp_path / "open.obj").write_text("\n".join([*lines, *faces[1:]]))
    found = robot(TERRAIN.replace("groove.obj", "open.obj"))
    assert [len(body.pieces) for body in found.scenario.bodies if body.kind == "fixed"] == [12, 1]
    assert any("expected a closed mesh" in note for note in found.notes)


def world_of(piece, points: np.ndarray) -> np.ndarray:
    """Points of a piece's frame in that of its body."""
    return Rotation.from_quat(piece.orientation, scalar_first=True).apply(points) + piece.position

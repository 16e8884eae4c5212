"""Imported scenes are compared with their files by readers that find each kind of difference."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="not installed (pip install mujoco)")
pytest.importorskip("pinocchio", reason="not installed (pip install pin)")

from touchstone.adapters.oracles.robot_file import EQUAL, QUANTITIES, deviations, trees_of
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import imported
from touchstone.adapters.robots.source import compiled

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0.2" rpy="0.3 0 0"/><mass value="MASS"/><inertia ixx="0.02" ixy="0.001"'
)
INERTIAL += ' ixz="0" iyy="0.03" iyz="0" izz="0.012"/></inertial>'
SHAPE = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'


def link(name: str, mass: str = "2", shape: str = "") -> str:
    inertial = INERTIAL.replace("MASS", mass) if mass else ""
    return f'<link name="{name}">{inertial}{shape}</link>'


def joint(name, parent, child, kind="revolute", limit='lower="-1" upper="2"') -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="0 0.5 1" rpy="0 0.2 -1.5"/>'
    limit = f'<limit {limit} effort="1" velocity="1"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="0 0.6 0.8"/>{limit}</joint>'


def urdf(*parts: str) -> str:
    return f'<robot name="r">{"".join(parts)}</robot>'


ARM = urdf(link("base"), link("arm"), link("tip", "0.5"), joint("a", "base", "arm"), joint("b", "arm", "tip"))
ANCHORS = """<mujoco><worldbody><body name="base"><freejoint/><geom type="sphere" size="0.2"/>
 <body name="foot" pos="0 0 -0.6"><geom type="box" size="0.1 0.2 0.05" pos="0.05 0 -0.1"/>
  <joint name="y" axis="0 1 0" pos="0 0 0.08" range="-50 50"/><joint name="x" axis="1 0 0.5" pos="0 0 0.04"/>
 </body></body></worldbody></mujoco>"""
ROBOTS = {
    "arm": ("r.urdf", ARM),
    "its root is fixed to the world": ("r.urdf", urdf(
        link("world", ""), link("base"), link("arm"), joint("w", "world", "base", "fixed"),
        joint("a", "base", "arm"),
    )),
    "its root turns": ("r.urdf", urdf(link("world", ""), link("arm"), joint("a", "world", "arm"))),
    "its root has no mass": ("r.urdf", urdf(
        link("base", ""), link("arm"), joint("a", "base", "arm")
    )),
    "a joint slides": ("r.urdf", urdf(
        link("base"), link("arm"), link("tip"), joint("s", "base", "arm", "prismatic"),
        joint("a", "arm", "tip"),
    )),
    "a joint has no limits": ("r.urdf", urdf(
        link("base"), link("arm"), link("tip"), joint("c", "base", "arm", "continuous"),
        joint("a", "arm", "tip", limit=""),
    )),
    "free": ("r.urdf", urdf(link("cube", shape=SHAPE))),
    "hinges with different anchors": ("r.xml", ANCHORS),
    "a ball and a start that is not 0": ("r.xml", """<mujoco><worldbody><body name="base"><freejoint/>
     <geom type="sphere" size="0.2"/><body pos="1 0 0" euler="0 30 0"><joint name="s" type="ball"/>
      <geom type="capsule" size="0.1" fromto="0 0 0 1 0 0"/><body pos="1 0 0">
       <joint name="h" axis="0 1 0" ref="20" range="-30 60"/><geom type="box" size="0.1 0.2 0.3"/>
      </body></body></body>
     <body name="cube" pos="3 0 0"><freejoint/><geom type="box" size="0.1 0.2 0.3" pos="0.1 0 0"/></body>
     </worldbody></mujoco>"""),
}  # fmt: skip


@pytest.fixture
def compared(tmp_path):
    """Deviations of a scene from its file, after a change of the scene."""

    def compare(name: str, text: str, change=lambda scenario: scenario):
        path = tmp_path / name
        path.write_text(text)
        found = imported(path, "robot")
        found = replace(found, scenario=change(found.scenario))
        return deviations(found, trees_of(path, compiled(path), found.scenario))

    return compare


@pytest.mark.parametrize(("name", "text"), ROBOTS.values(), ids=ROBOTS)
def test_an_imported_scene_is_as_its_file(compared, name, text):
    """Mass, centre, inertia in three postures, axes and limits are equal to 1e-9."""
    assert max(compared(name, text).values()) <= EQUAL


def changed(**of):
    """A change of a joint or of a body of the scene, by the name of what it is in."""

    def change(scenario):
        joints = tuple(replace(j, **of["joint"](j)) if "joint" in of else j for j in scenario.joints)
        bodies = tuple(
            replace(b, **of["body"](b)) if "body" in of and b.name == "tip" else b for b in scenario.bodies
        )
        return replace(scenario, joints=joints, bodies=bodies)

    return change


CHANGES = {
    "mass": changed(body=lambda b: {"mass": b.mass * (1 + 1e-6)}),
    "centre": changed(body=lambda b: {"center_of_mass": (*b.center_of_mass[:2], b.center_of_mass[2] + 1e-6)}),
    "inertia": changed(body=lambda b: {"inertia": tuple(map(tuple, np.array(b.inertia) * (1 + 1e-4)))}),
    "axes": changed(joint=lambda j: {"position": (*j.position[:2], j.position[2] + 1e-6)}),
    "limits": changed(joint=lambda j: {"upper": j.upper + 1e-6}),
}


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_what_differs_from_the_file_is_found(compared, quantity):
    """A millionth of a mass or a metre, or a limit, of one link deviates in its quantity."""
    off = compared("r.urdf", ARM, CHANGES[quantity])
    assert EQUAL < off[quantity] < 1


def test_a_missing_hinge_is_found(tmp_path):
    """A scene that lacks a hinge of the file deviates in axes and limits without bound."""
    (tmp_path / "r.urdf").write_text(ARM)
    (tmp_path / "other.urdf").write_text(ARM.replace('name="b"', 'name="other"'))
    found = imported(tmp_path / "r.urdf", "robot")
    other = tmp_path / "other.urdf"
    off = deviations(found, trees_of(other, compiled(other), found.scenario))
    assert (off["axes"], off["limits"]) == (np.inf, np.inf)


def test_faults_of_the_reader_have_the_line_of_the_file(tmp_path):
    """A fault in an element without a name is found by its line, in URDF too."""
    path = tmp_path / "r.urdf"
    path.write_text(urdf(link("base"), link("arm"), "\n\n", joint("a", "base", "arm").replace(
        "<axis", '\n<axis xyz="1 0 0"/><axis'
    )))  # fmt: skip
    with pytest.raises(RobotError, match=r"r\.urdf:4: axis: repeated element: 'axis'"):
        imported(path, "robot")

"""Files of robots as others leave them: kept as they say, or refused by name, line and remedy."""

import numpy as np
import pytest

from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import imported
from touchstone.reports.studies.robots import checked

MOMENTS = 'ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"'
INERTIAL = f'<inertial><mass value="1"/><inertia {MOMENTS}/></inertial>'
LIMIT = '<limit lower="{}" upper="{}" effort="1" velocity="1"/>'
LIMITED = LIMIT.format(-1, 1)
MASSLESS = "robot.urdf:3: link 'b': joint 'j' moves it, but it has no mass or no inertia"
SHAPE = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
TIP = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
MESHED = """<mujoco><asset><mesh name="tip" file="tip.obj"/></asset>
<worldbody><body name="b" pos="0 0 1">
<freejoint/><geom type="mesh" mesh="tip" density="500"/></body></worldbody></mujoco>"""

BALL = '<mujoco><worldbody><body name="b" pos="0 0 1"><geom size="0.1"/></body></worldbody></mujoco>'


def link(name, inertial=INERTIAL):
    """A link with a shape."""
    return f'<link name="{name}">{inertial}{SHAPE}</link>\n'


def joint(name, parent, child, kind="revolute", more=LIMITED):
    """A joint half a metre above its parent."""
    ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{"" if kind == "fixed" else more}</joint>\n'


def robot(*parts):
    """Text of a URDF, one part a line from the second on."""
    return f'<robot name="r">\n{"".join(parts)}</robot>\n'


@pytest.fixture
def load(tmp_path):
    """Import a text as a file; returns the scene and its notes."""

    def make(text, name="robot.urdf"):
        (tmp_path / name).write_text(text)
        return imported(tmp_path / name, "robot")

    return make


def test_a_shape_without_inertial_has_no_mass(load):
    """In URDF no <inertial> is no mass: the links that it is fixed to keep theirs, and their centre."""
    found = load(robot(link("a"), link("guard", ""), joint("f", "a", "guard", "fixed"))).scenario
    body = next(one for one in found.bodies if one.kind == "simulated")
    assert (body.mass, len(body.pieces)) == (1.0, 2)
    assert body.center_of_mass == pytest.approx((0, 0, 0), abs=1e-15)
    assert np.array(body.inertia) == pytest.approx(0.01 * np.eye(3), abs=1e-15)
    # a hinge moves what is fixed below it
    text = robot(link("a"), link("b", ""), link("c"), joint("j", "a", "b"), joint("f", "b", "c", "fixed"))
    masses = {one.name: one.mass for one in load(text).scenario.bodies if one.kind == "driven"}
    assert masses == {"a": 1.0, "b": 1.0}


@pytest.mark.parametrize(
    ("written", "angle"),
    [
        ("1.5707963", np.pi / 2),
        ("-1.5708", -np.pi / 2),
        ("3.1415", np.pi),
        ("1.57", 1.57),
        ("1.5706", 1.5706),
    ],
)
def test_a_written_quarter_turn_of_a_shape_is_exact(load, written, angle):
    """As far as it is written: what turns by 1.57 leans by 8e-4 rad, as the file says."""
    turned = SHAPE.replace("<geometry>", f'<origin rpy="{written} 0 0"/><geometry>')
    imported = load(robot(link("a").replace(SHAPE, turned), link("b"), joint("j", "a", "b")))
    noted = "quarter turns: exact for shapes of link 'a'" in imported.notes
    assert noted == (angle != float(written))
    found = imported.scenario
    w, x, *others = found.bodies[found.body_index("a")].pieces[0].orientation
    assert 2 * np.arctan2(x, w) == pytest.approx(angle, abs=4e-16)
    assert others == [0, 0]


def test_an_inertia_of_no_body_counts_in_what_it_is_fixed_to(load, tmp_path):
    """A sensor that turns about one axis alone, on a turned mount: their sum is what pinocchio has."""
    bent = INERTIAL.replace('ixx="0.01"', 'ixx="0.1"')
    fixed = joint("f", "a", "s", "fixed").replace('xyz="0 0 0.5"', 'xyz="0.1 0.2 0.3" rpy="0.3 -0.2 0.5"')
    sensor = link("s", bent.replace("<mass", '<origin xyz="0 0.1 0" rpy="0.4 0 1"/><mass'))
    text = robot(link("a"), sensor, link("b"), fixed, joint("j", "a", "b"))
    found = load(text)
    assert max(checked(tmp_path / "robot.urdf", found, False).values()) < 1e-12
    world = '<link name="world"/>\n', joint("w", "world", "a", "fixed")
    for more in (
        world,
        (link("e", INERTIAL.replace('"1"', '"0"').replace("0.01", "0")), joint("e", "a", "e", "fixed")),
    ):
        found = load(text.replace("</robot>", f"{''.join(more)}</robot>"))
        assert max(checked(tmp_path / "robot.urdf", found, False).values()) < 1e-12
    empty = INERTIAL.replace('"1"', '"0"').replace("0.01", "0")
    found = load(robot(link("o", empty), link("a"), joint("g", "o", "a", "fixed"), sensor, fixed))
    assert max(checked(tmp_path / "robot.urdf", found, False).values()) < 1e-12
    alone = robot(link("a"), link("s", bent), joint("j", "a", "s"))
    with pytest.raises(RobotError, match=r"robot\.urdf:3: link 's': a moment of inertia exceeds the sum"):
        load(alone)


def test_tendons_of_joints_and_skins_are_noted(load):
    """A tendon that couples joints does less than the joints: it is left out as other couplings are."""
    text = """<mujoco><worldbody><body name="a"><geom size="0.1"/><body name="b"><joint name="j"/>
<geom size="0.1"/></body></body></worldbody>
<tendon><fixed name="t"><joint joint="j" coef="1"/></fixed></tendon>
</mujoco>"""
    assert "left out: 1 tendon between joints" in load(text, "robot.xml").notes


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (robot(link("a"), link("b", INERTIAL.replace("0.01", "0")), joint("j", "a", "b")), MASSLESS),
        (robot(link("a"), link("b", ""), joint("j", "a", "b")), MASSLESS),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", more=LIMIT.format(1, -1))),
            "robot.urdf:4: joint 'j': limits from 1 to -1 are inverted",
        ),
        (
            '<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro">\n<xacro:macro name="leg"/></robot>',
            "robot.urdf:2: xacro:macro 'leg': not expanded; do it before: xacro robot.urdf > expanded.urdf",
        ),
        (
            robot(link("a", INERTIAL.replace('"1"', '"${m}"'))),
            "robot.urdf:2: mass: not expanded; do it before: xacro robot.urdf > expanded.urdf",
        ),
        (
            robot(link("a", INERTIAL.replace('"1"', '"1,5"'))),
            "robot.urdf:2: mass: bad format in attribute 'value': found '1,5'",
        ),
        *(
            (
                robot(link("a"), link("b", INERTIAL.replace('"1"', f'"{mass}"')), joint("j", "a", "b")),
                f"robot.urdf:3: link 'b': mass: found {mass}, expected a number from 0 to 1e+30",
            )
            for mass in ("-1", "1e300", "inf", "nan")
        ),
        (
            robot(link("a"), link("b", INERTIAL.replace('ixx="0.01"', 'ixx="nan"')), joint("j", "a", "b")),
            "robot.urdf:3: link 'b': ixx: found nan, expected a number from -1e+30 to 1e+30",
        ),
        (
            BALL.replace("/>", ' density="-1"/>'),
            "robot.urdf:1: body 'b': density: found -1, expected a number from 0 to 1e+30",
        ),
        (
            BALL.replace("<geom", '<inertial pos="0 0 0" mass="nan" diaginertia="1 1 1"/><geom'),
            "robot.urdf:1: body 'b': mass: found nan, expected a number from 0 to 1e+30",
        ),
        (
            robot(*map(link, "abc"), joint("j", "a", "b"), joint("k", "b", "c"), joint("l", "a", "c")),
            "robot.urdf:7: joint 'l': link 'c' has a parent by joint 'k' (line 6) too: a URDF has no closed "
            "loops; leave out one of the joints, and close the loop in the scene (body_joints)",
        ),
        (
            robot(*map(link, "abc"), joint("j", "a", "b"), joint("k", "b", "c"), joint("l", "c", "a")),
            "robot.urdf:7: joint 'l': link 'a' is above its own parent 'c': no link is the root",
        ),
        (
            robot(link("a"), joint("j", "a", "a")),
            "robot.urdf:3: joint 'j': it connects link 'a' to itself",
        ),
        (
            robot(link("base"), link("b"), joint("j", "bse", "b")),
            "robot.urdf:4: joint 'j': its parent 'bse' is no link of the file; did you mean 'base'?",
        ),
        (
            robot(link("a"), link("b"), joint("j", "a", "b").replace('<child link="b"/>', "")),
            "robot.urdf:4: joint 'j': it has no child; expected <child link=\"NAME\"/>",
        ),
        (
            robot(link("a"), link("b"), joint("j", "a", "b", "rotary")),
            "robot.urdf:4: joint 'j': type: found 'rotary', expected revolute, continuous, prismatic, fixed, "
            "floating, planar",
        ),
        (
            "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n",
            "robot.urdf: a Git LFS pointer, not the file itself; fetch it by: git lfs pull",
        ),
    ],
)
def test_what_cannot_be_kept_is_refused_by_name(load, text, line):
    """File, line, element and remedy."""
    with pytest.raises(RobotError) as refused:
        load(text)
    assert str(refused.value).endswith(line)
    assert "\n" not in str(refused.value)


def test_a_mesh_that_was_not_fetched_is_named(load, tmp_path):
    """A Git LFS pointer in place of a mesh."""
    (tmp_path / "tip.obj").write_text("version https://git-lfs.github.com/spec/v1\n")
    with pytest.raises(RobotError, match=r"robot\.xml:1: mesh 'tip': file 'tip\.obj': a Git LFS pointer"):
        load(MESHED, "robot.xml")


def test_a_mesh_as_text_is_read(load, tmp_path):
    """STL as text, which MuJoCo does not read; the mesh is open, without a volume of its own."""
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0)], [(0, 0, 0), (0.1, 0, 0), (0, 0, 0.1)]
    faces = (
        "facet normal 0 0 1\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in three)
        + "endloop\nendfacet\n"
        for three in corners
    )
    (tmp_path / "tip.stl").write_text(f"solid tip\n{''.join(faces)}endsolid tip\n")
    meshed = link("a").replace('<box size="0.1 0.1 0.1"/>', '<mesh filename="tip.stl"/>')
    (piece,) = next(one for one in load(robot(meshed)).scenario.bodies if one.name == "a").pieces
    assert len(piece.shape.vertices) == 4


def test_a_number_that_is_not_finite_is_named(load):
    """In a URDF, with its link and line."""
    far = INERTIAL.replace("<mass", '<origin xyz="0 0 inf"/><mass')
    with pytest.raises(RobotError, match=r"robot\.urdf:2: link 'a': its mass, inertia or pose is not finite"):
        load(robot(link("a", far)))
    turning = joint("turns", "a", "b").replace("0 1 0", "0 1.3407807929942597e+154 0")
    with pytest.raises(RobotError, match=r"robot\.urdf:4: joint 'turns': its axis is not finite"):
        load(robot(link("a"), link("b"), turning))


def test_a_note_names_the_joint_that_mimics(load):
    """Not the one that it follows."""
    mimics = joint("follower", "b", "c", more=f'{LIMITED}<mimic joint="master" multiplier="-2"/>')
    text = robot(link("a"), link("b"), link("c"), joint("master", "a", "b"), mimics)
    assert "left out: the coupling of joint 'follower'" in load(text).notes


@pytest.mark.parametrize("suffix", ["xml", "mjcf"])
@pytest.mark.parametrize(
    ("inner", "text"),
    [
        ("", '<compiler meshdir="meshes"/><include file="part.xml"/>'),
        ('<compiler meshdir="elsewhere"/>', '<include file="part.xml"/><compiler meshdir="meshes"/>'),
    ],
)
def test_an_included_file_has_the_folders_of_the_last_compiler(load, tmp_path, suffix, inner, text):
    """`meshdir` of the file that includes another holds in that one, whatever the suffix."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "tip.obj").write_text(TIP)
    (tmp_path / "part.xml").write_text(MESHED.replace("<mujoco>", f"<mujoco>{inner}"))
    text = f"<mujoco>{text}</mujoco>"
    masses = [one.mass for one in load(text, f"robot.{suffix}").scenario.bodies if one.kind == "simulated"]
    assert masses == pytest.approx([500 * 0.1**3 / 6], rel=1e-6)

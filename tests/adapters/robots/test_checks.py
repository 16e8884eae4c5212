"""`touchstone check-robot`: each fault is found with its size, and a sound robot has none."""

import json

import pytest
from foreign_models import models

from touchstone.adapters.registry import installed
from touchstone.adapters.robots.checks.check import findings
from touchstone.adapters.robots.checks.finding import FAULT, NOTE, Finding
from touchstone.adapters.robots.robot_error import RobotError

pytestmark = pytest.mark.skipif(not installed("mujoco"), reason="the importer needs MuJoCo")

# an L of two cubes of 0.1 m on a third: the hull adds half a cube to three
L_SHAPE = """v 0 0 0\nv 0.2 0 0\nv 0.2 0 0.1\nv 0.1 0 0.1\nv 0.1 0 0.2\nv 0 0 0.2
v 0 0.1 0\nv 0.2 0.1 0\nv 0.2 0.1 0.1\nv 0.1 0.1 0.1\nv 0.1 0.1 0.2\nv 0 0.1 0.2
f 1 2 3\nf 1 3 4\nf 1 4 5\nf 1 5 6\nf 7 9 8\nf 7 10 9\nf 7 11 10\nf 7 12 11
f 1 7 8\nf 1 8 2\nf 2 8 9\nf 2 9 3\nf 3 9 10\nf 3 10 4\nf 4 10 11\nf 4 11 5\nf 5 11 12\nf 5 12 6
f 6 12 7\nf 6 7 1\n"""


def arm(
    joint: str = 'range="-1 1"',
    geom: str = 'mass="1"',
    actuator: str = '<position joint="elbow" kp="100" ctrlrange="-1 1" forcerange="-20 20"/>',
    more: str = "",
    pos: str = "0 0 1",
) -> str:
    """A horizontal rod of 1 kg and 0.4 m on a hinge, and a free plate far above it."""
    return f"""<mujoco><compiler angle="radian"/><worldbody><body name="rod" pos="{pos}">
<joint name="elbow" axis="0 1 0" {joint}/>
<geom type="box" size="0.2 0.05 0.05" pos="0.2 0 0" {geom}/></body>
<body name="plate" pos="0 0 3"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body>{more}
</worldbody><actuator>{actuator}</actuator></mujoco>"""


def gripper(force: float = 20.0, friction: float = 0.5, reach: float = 0.04, mass: float = 0.1) -> str:
    """Two fingers that slide together from 80 mm; the hand points up."""
    fingers = "".join(
        f"""<body name="{name}" pos="{side * 0.05} 0 0.1">
<joint name="slide_{name}" type="slide" axis="{-side} 0 0" range="0 {reach}"/>
<geom type="box" size="0.01 0.01 0.03" mass="{mass}" friction="{friction}"/></body>"""
        for name, side in (("left", -1), ("right", 1))
    )
    motors = "".join(f'<motor joint="slide_{n}" ctrlrange="-1 1" gear="{force}"/>' for n in ("left", "right"))
    return f"""<mujoco><worldbody><body name="palm" pos="0 0 1"><freejoint/>
<geom type="box" size="0.06 0.03 0.02" mass="0.5"/>{fingers}</body></worldbody>
<actuator>{motors}</actuator></mujoco>"""


@pytest.fixture
def check(tmp_path):
    """Findings about a text, with an L-shaped mesh beside it."""

    def make(text: str, name: str = "robot.xml") -> list[Finding]:
        (tmp_path / "l.obj").write_text(L_SHAPE)
        (tmp_path / name).write_text(text)
        return list(findings(tmp_path / name))

    return make


def test_a_sound_robot_has_no_findings(check):
    """A rod that its drive holds, inside its limits, with the mass of its shape."""
    assert check(arm()) == []


@pytest.mark.parametrize(
    ("text", "name", "remedy"),
    [
        (
            '<mujoco><worldbody><body><geom size="0.1" mass="1"/></body></worldbody></mujoco>',
            "robot.xml",
            "no scene can be made of it; name what its joints are",
        ),
        (
            '<robot name="r"><link name="a"><inertial><mass value="1"/>'
            '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>',
            "robot.urdf",
            "as a scene it is one free body; name what its joints are",
        ),
    ],
)
def test_a_file_in_which_nothing_moves_says_so(check, text, name, remedy):
    """A note, since fixed robots are no fault."""
    (found,) = check(text, name)
    assert (found.check, found.verdict, found.remedy) == ("motion", NOTE, remedy)
    assert found.line.startswith("robot: nothing moves: ")


def test_a_hull_that_fills_a_hollow_is_measured(check):
    """The hull of an L of three cubes adds half a cube, whose surface is 50 mm from the L at most."""
    mesh = '<asset><mesh name="l" file="l.obj"/></asset><worldbody><body pos="0 0 9"><freejoint/>'
    mesh += '<geom type="mesh" mesh="l" mass="3"/></body>'
    (found,) = check(arm().replace("<worldbody>", mesh, 1))
    assert (found.check, found.verdict, found.subject) == ("hull", FAULT, "mesh 'l'")
    # 2 % of the size is the spacing of samples
    depth = float(found.text.partition("hollows of ")[2].partition(" mm")[0])
    assert depth == pytest.approx(50, abs=4)
    assert found.text.endswith("adds 17 % to its volume")


def test_links_that_overlap_at_the_start_are_named(check):
    """A plate 8 cm above the rod's middle is 7 cm deep in it; neighbours at a hinge are not asked."""
    (found,) = check(arm().replace('pos="0 0 3"', 'pos="0.2 0 1.08"'))
    assert (found.check, found.subject) == ("overlap", "body 'rod' and body 'plate'")
    assert found.text == "overlap by 70 mm at the start"
    excluded = arm().replace("</mujoco>", '<contact><exclude body1="rod" body2="plate"/></contact></mujoco>')
    assert check(excluded.replace('pos="0 0 3"', 'pos="0.2 0 1.08"')) == []
    key = '<keyframe><key name="home" qpos="0 0.2 0 1.08 1 0 0 0"/></keyframe></mujoco>'
    (found,) = check(arm().replace("</mujoco>", key))
    assert found.text == "overlap by 70 mm at keyframe 'home'"


@pytest.mark.parametrize(
    ("inertia", "text"),
    [
        ('mass="1" diaginertia="1 1 1"', "its moments are 71 to 6e+02 times those"),
        ('mass="1" diaginertia="0.0167 0.142 0.142"', "its moments are 10 times those"),
        ('mass="1" diaginertia="1e-5 1e-5 1e-5"', "its moments are 0.00071 to 0.006 times those"),
        ('mass="1000" diaginertia="1.67 14.2 14.2"', "1e+03 kg in its shapes are 2.5e+05 kg/m^3"),
    ],
)
def test_inertia_is_compared_with_the_shape(check, inertia, text):
    """A box of 0.4 x 0.1 x 0.1 m and 1 kg has 1/600, 17/1200 and 17/1200 kg m^2, and 0.004 m^3."""
    stated = f'range="-1 1"/><inertial pos="0.2 0 0" {inertia}/><site'
    found = [one for one in check(arm(joint=stated)) if one.check == "inertia"]
    assert [one.subject for one in found] == ["body 'rod'"]
    assert found[0].text.startswith(text)


def test_roots_that_the_model_fixes_have_a_mass_too(check):
    """URDF's root is fixed to MuJoCo's world, and MJCF may fix one; a table that no joint moves may weigh
    anything."""
    inertia = '<inertia ixx="25" iyy="25" izz="25" ixy="0" ixz="0" iyz="0"/>'
    shape = '<collision><geometry><box size="0.3 0.3 0.3"/></geometry></collision>'
    chassis = f'<link name="chassis"><inertial><mass value="3000"/>{inertia}</inertial>{shape}</link>'
    joint = '<joint name="j" type="continuous"><parent link="chassis"/><child link="wheel"/></joint>'
    wheel = chassis.replace("chassis", "wheel").replace("3000", "30").replace('"25"', '"0.4"')
    found = check(f'<robot name="r">{chassis}{wheel}{joint}</robot>', "robot.urdf")
    assert [(one.verdict, one.subject) for one in found] == [(FAULT, "body 'chassis'")]
    geom = '<geom type="box" size="0.1 0.1 0.1" pos="-0.5 0 0" mass="1000"/>'
    table = f'<body name="table" pos="3 0 0">{geom}</body>'
    found = check(
        arm(
            more=table
            + f'<body name="base" pos="-2 0 0">{geom}<body><joint/><geom size="0.1"/></body></body>'
        )
    )
    assert [one.subject for one in found if one.check == "inertia"] == ["body 'base'"]


def test_a_centre_of_mass_outside_the_shape_is_named(check):
    """A centre half a metre above the box is 450 mm outside."""
    stated = 'range="-1 1"/><inertial pos="0.2 0 0.5" mass="1" diaginertia="0.0017 0.0142 0.0142"/><site'
    found = [one for one in check(arm(joint=stated)) if one.check == "inertia"]
    assert [one.text for one in found] == ["its centre of mass is 450 mm outside its shapes"]


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"joint": 'range="-1 1" limited="false"'}, "its range from -1 to 1 rad is not applied"),
        ({"joint": 'range="-30 30"'}, "its range of 60 rad is more than two turns: the limit stops nothing"),
        ({"joint": 'range="0.5 1"'}, "the start has it at 0 rad, outside its range 0.5 to 1"),
        ({"joint": 'range="-1 1" frictionloss="30"'}, "its dry friction of 30 N m is more than the 20 N m"),
        # 1 kg at 0.2 m: 1.96 N m
        (
            {"actuator": '<motor joint="elbow" gear="1.5" ctrlrange="-1 1"/>'},
            "its drive has 1.5 N m, and gravity takes 1.96 N m at the start",
        ),
        ({"actuator": '<motor joint="elbow" gear="0"/>'}, "gear 0: its force is the same"),
        ({"actuator": '<position joint="elbow" kp="0"/>'}, "gain 0: its force is the same"),
        ({"more": '<body name="b" pos="5 0 1"><joint name="free"/><geom size="0.1" mass="1"/></body>'},
         "has no actuator"),
    ],
)  # fmt: skip
def test_limits_and_drives_that_do_nothing(check, changes, line):
    """One finding each, which begins with what was measured."""
    (found,) = check(arm(**changes))
    assert found.text.startswith(line)
    assert found.check in ("limit", "drive")
    assert found.remedy


@pytest.mark.parametrize(
    ("limit", "text"),
    [
        (
            'lower="-90" upper="90" effort="5" velocity="1"',
            "its range of 180 rad is more than two turns: the",
        ),
        ('lower="-1" upper="1" effort="0" velocity="1"', "effort 0 allows its drive no force"),
        ('lower="-1" upper="1" effort="5" velocity="0"', "velocity 0 allows its drive no speed"),
        ('effort="5" velocity="1"', "its limits are equal or missing: nothing stops it"),
        (
            'lower="-1" upper="1" effort="1" velocity="1"',
            "its drive has 1 N m, and gravity takes 1.96 N m at the start",
        ),
    ],
)
def test_limits_of_urdf(check, limit, text):
    """Effort, velocity and bounds of <limit>; gravity turns the rod by 1.96 N m."""
    moments = 'ixx="0.00167" iyy="0.0142" izz="0.0142" ixy="0" ixz="0" iyz="0"'
    inertial = f'<inertial><origin xyz="0.2 0 0"/><mass value="1"/><inertia {moments}/></inertial>'
    shape = '<collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.1 0.1"/></geometry></collision>'
    links = f'<link name="base"/><link name="rod">{inertial}{shape}</link>'
    ends = '<parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>'
    joint = f'<joint name="elbow" type="revolute">{ends}<limit {limit}/></joint>'
    found = check(f'<robot name="r">{links}{joint}</robot>', "robot.urdf")
    assert [(one.verdict, one.text.startswith(text)) for one in found] == [(FAULT, True)]


@pytest.mark.parametrize(
    ("changes", "verdict", "text"),
    [
        # 20 N at a friction of 0.5; the weight of the fingers does not load their slides
        ({}, NOTE, "open to 80 mm, close to 0 mm, press with 20 N and hold 2.04 kg at a friction of 0.5"),
        # fingers of 100 g hold 51 g, frictionless ones nothing
        ({"force": 0.5}, FAULT, "hold 0.051 kg"),
        ({"friction": 0.0}, FAULT, "hold 0 kg"),
        # strokes of 30 mm leave 20 mm
        ({"reach": 0.03}, NOTE, "open to 80 mm, close to 20 mm"),
    ],
)
def test_a_gripper_says_what_it_holds(check, changes, verdict, text):
    """How far it opens and closes, and the mass that it carries, a fault if less than a finger's."""
    (found,) = check(gripper(**changes))
    assert (found.check, found.verdict) == ("grip", verdict)
    assert text in found.text


def test_a_follower_shares_the_force_of_its_drive(check):
    """One motor of 20 N closes both fingers: each presses with 10 N."""
    text = gripper().replace('<motor joint="slide_right" ctrlrange="-1 1" gear="20.0"/>', "")
    text = text.replace(
        "</mujoco>", '<equality><joint joint1="slide_right" joint2="slide_left"/></equality></mujoco>'
    )
    (found,) = check(text)
    assert "press with 10 N and hold 1.02 kg" in found.text
    # a follower that goes the other way as its master does, with another zero
    mirrored = text.replace('axis="-1 0 0" range="0 0.04"', 'axis="1 0 0" range="-0.04 0"')
    mirrored = mirrored.replace('joint2="slide_left"', 'joint2="slide_left" polycoef="0 -1 0 0 0"')
    (found,) = check(mirrored)
    assert "open to 80 mm, close to 0 mm, press with 10 N" in found.text


def test_the_command_prints_a_line_each(capfd, monkeypatch, tmp_path):
    """A fault exits with 1, `--quiet` prints it alone, JSON has all fields, a missing file is one line."""
    from touchstone.reports.cli import main as cli

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["touchstone", "check-robot", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.main()
        out, err = capfd.readouterr()
        return int(end.value.code or 0), out, err

    sound, weak = tmp_path / "sound.xml", tmp_path / "weak.xml"
    sound.write_text(arm())
    weak.write_text(arm(actuator='<motor joint="elbow" gear="1.5" ctrlrange="-1 1"/>'))
    code, out, _ = call(str(sound))
    assert (code, len(out.splitlines())) == (0, 7)
    code, out, _ = call(str(weak))
    assert (code, len(out.splitlines())) == (1, 7)
    assert out.startswith("fault drive    joint 'elbow': its drive has 1.5 N m")
    code, out, err = call(str(weak), "--quiet")
    assert (code, out, len(err.splitlines())) == (1, "", 1)
    code, out, _ = call(str(weak), "--format", "json")
    assert json.loads(out)[0]["remedy"].startswith("it sinks")
    code, _, err = call(str(tmp_path / "none.xml"))
    assert (code, len(err.splitlines())) == (2, 1)


@pytest.mark.slow
@pytest.mark.parametrize("path", models(), ids=lambda path: "/".join(path.parts[-3:]))
def test_public_models_are_checked(path):
    """Each is checked or refused by name; every line has a measurement and a remedy."""
    try:
        found = list(findings(path, allow_paths=True))
    except RobotError:
        found = []
    assert all(one.text and one.remedy for one in found)
    assert not any("nan" in one.line for one in found)

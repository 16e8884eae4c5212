"""`touchstone import`: the comparison with the file, of one robot and of folders."""

import csv
import io

import pytest

from touchstone.reports.docs.reference import page_of
from touchstone.scenarios.files.read import read_scene

pytest.importorskip("mujoco", reason="not installed (pip install mujoco)")

INERTIAL = '<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
ARM = f"""<robot name="arm"><link name="base">{INERTIAL}</link>
<link name="upper">{INERTIAL}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
ARM_IN = "import robots/a/arm.urdf --as arm"


@pytest.fixture
def robots(tmp_path):
    """A folder with two robots of one file name, one that is refused, and two files that are no robots."""
    for name, text in {
        "a/arm.urdf": ARM,
        "b/arm.urdf": ARM.replace('value="2"', 'value="3"'),
        "c/planar.urdf": ARM.replace("revolute", "planar"),
        "d/other.xml": "<note/>",
        "d/part.xml": "<mujocoinclude><asset/></mujocoinclude>",
    }.items():
        path = tmp_path / "robots" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)


def test_robots_of_a_folder_are_listed_by_result(touchstone, robots, tmp_path):
    """Equal ones with their deviation, refused ones with element and line; results have a page."""
    code, out, err = touchstone("import --check robots --out found")
    assert code == 0, err
    assert "2 equal, 1 refused" in out
    assert "refused: robots/planar.urdf: planar.urdf:3: joint 'shoulder': type planar" in out
    code, out, _ = touchstone("import --check robots --out again --format csv")
    found = {(row["scenario"], row["metric"]): row for row in csv.DictReader(io.StringIO(out))}
    assert {scene for scene, _ in found} == {"robots/a/arm.urdf", "robots/b/arm.urdf", "robots/planar.urdf"}
    assert float(found["robots/b/arm.urdf", "robot.mass"]["value"]) <= 1e-9
    code, out, _ = touchstone("import --check . --out here --format csv")
    assert {row["scenario"].partition("/")[0] for row in csv.DictReader(io.StringIO(out))} == {tmp_path.name}
    name, text, _ = page_of(tmp_path / "found")
    assert name == "import.md"
    assert "# `touchstone import`" in text


def test_a_scene_that_differs_from_its_file_is_exit_1(touchstone, robots, monkeypatch):
    """A comparison that fails names its quantities, for one robot and for many."""
    from touchstone.adapters.oracles import robot_file
    from touchstone.reports.studies import robots as study

    assert touchstone(ARM_IN)[0] == 0
    off = dict.fromkeys(robot_file.QUANTITIES, 0.0) | {"axes": 1e-3}
    monkeypatch.setattr(study, "deviations", lambda *_: off)
    code, _, err = touchstone(f"{ARM_IN} --force")
    assert (code, "differs from what pinocchio reads in the file: axes by 1.0e-03" in err) == (1, True), err
    code, out, _ = touchstone("import --check robots --out found")
    assert (code, "differs: robots/a/arm.urdf: axes by 1.0e-03" in out) == (1, True), out


def test_the_model_card_has_the_file(touchstone, robots):
    """The card of an imported scene names the file's figures; another file's differ."""
    code, out, err = touchstone(ARM_IN)
    assert "checked: mass, centre, inertia, axes, limits as pinocchio reads them in the file" in out, err
    for file, mass, remark in (("a", "4", "the scene agrees"), ("b", "6", "the scene differs: mass by")):
        code, out, err = touchstone(f"show arm --model-card --format csv --file robots/{file}/arm.urdf")
        assert code == 0, err
        last = list(csv.DictReader(io.StringIO(out)))[-1]
        assert (last["model"], last["mass [kg]"]) == ("arm.urdf (pinocchio)", mass)
        assert last["remark"].startswith(remark)


@pytest.mark.parametrize(
    ("command", "line"),
    [
        ("import", "expected a robot's file and --as NAME, or --check FOLDER"),
        ("import robots/a/arm.urdf", "expected a robot's file and --as NAME, or --check FOLDER"),
        ("import --check robots --as arm", "--check takes folders"),
        ("import --check nowhere", "--check nowhere: no such folder"),
        ("import --check robots/d", "no robots (.urdf, .mjcf, .xml) below robots/d"),
        ("show ball_snip --file robots/a/arm.urdf", "--file is compared by --model-card"),
    ],
)
def test_wrong_arguments_are_one_line(refused, robots, command, line):
    """Each exits with 2, and names what was expected."""
    assert line in refused(command)


def test_a_robot_is_written_as_simulated_bodies(touchstone, refused, robots, tmp_path):
    """`--free` writes joints instead of a tracker, equal to the file; its options need it; folders too."""
    for option in ("--hold", "--fixed-base"):
        assert refused(f"{ARM_IN} {option}") == "--fixed-base and --hold are options of --free"
    code, out, err = touchstone(f"{ARM_IN} --free --hold")
    assert (code, "3 bodies, 1 joint" in out, "as pinocchio reads them" in out) == (0, True, True), err
    (joint,) = read_scene(tmp_path / "arm.toml").body_joints
    assert (joint.parent, joint.child, joint.lower, joint.upper) == ("base", "upper", -1.0, 1.0)
    assert joint.stiffness > 0
    said = refused("export arm.toml --format mjcf")
    assert "joints between bodies (arm) are not written; toml and json keep" in said
    assert touchstone(f"{ARM_IN} --free --fixed-base --force")[0] == 0
    scene = read_scene(tmp_path / "arm.toml")
    assert ([body.name for body in scene.bodies], scene.body_joints[0].parent) == (["upper"], "")
    code, out, _ = touchstone("import --check robots --free --out found")
    assert (code, "2 equal, 1 refused" in out) == (0, True)

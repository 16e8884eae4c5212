"""Robots as simulated bodies: they have what their file says, move as in MuJoCo, and stand on servos."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from foreign_models import folders, models

from touchstone.adapters.contract import Settings
from touchstone.adapters.oracles.robot_file import EQUAL, deviations, trees_of
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import installed, load
from touchstone.adapters.robots.mechanism import HOLD_FREQUENCY, Simulated
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import Imported, imported
from touchstone.adapters.robots.source import compiled
from touchstone.scenarios.files.read import read_scene
from touchstone.scenarios.files.write import scene_toml
from touchstone.scenarios.scenario import UNBOUNDED, Scenario

WALKER = """<mujoco><compiler angle="radian"/><worldbody>
<body name="torso" pos="0 0 2" euler="0.3 0 0"><freejoint/><geom type="box" size="0.2 0.1 0.05"/>
 <body name="thigh" pos="0.2 0 0"><geom type="capsule" fromto="0 0 0 0 0 -0.4" size="0.04"/>
  <joint name="x" axis="1 0 0" stiffness="20" springref="0.4" damping="0.3"/>
  <joint name="y" axis="0 1 0" stiffness="15" springref="-0.5"/>
  <joint name="z" axis="0 0 1" damping="0.2"/>
  <body name="shin" pos="0 0 -0.4"><geom type="capsule" fromto="0 0 0 0.1 0 -0.3" size="0.03"/>
   <joint name="knee" axis="0 1 0" pos="0 0 0.02" ref="0.2"/></body></body>
 <body name="slide" pos="-0.2 0 0.1"><geom type="box" size="0.1 0.05 0.05"/>
  <joint name="s" type="slide" axis="1 0 1" stiffness="300" springref="0.05" damping="2"/>
  <body name="tail" pos="-0.2 0 0"><geom type="capsule" fromto="0 0 0 -0.3 0 0.1" size="0.03"/>
   <joint name="b" type="ball" damping="0.05"/></body></body>
</body></worldbody>
<actuator>
 <position name="servo" joint="knee" kp="30" kv="1" gear="1.5" ctrlrange="0.1 1"/>
</actuator></mujoco>"""
ARM = """<mujoco><compiler angle="radian"/><worldbody><geom type="plane" size="1 1 1" pos="0 0 -5"/>
<body name="cart" pos="0 0 1"><geom type="box" size="0.2 0.1 0.05"/>
 <joint name="rail" type="slide" axis="1 0 0" limited="true" range="-0.3 0.5"/>
 <joint name="roll" axis="1 0 0"/>
 <body name="pole" pos="0 0 0.05"><geom type="capsule" fromto="0 0 0 0.2 0.1 0.6" size="0.03"/>
  <joint name="tilt" axis="0 1 0" limited="true" range="0.3 0.4"/></body></body></worldbody></mujoco>"""
TARGET = """<mujoco><worldbody><body name="ball" pos="0.1 -0.1 1"><geom type="sphere" size="0.009"/>
 <joint name="x" type="slide" axis="1 0 0" limited="true" range="-0.27 0.27" ref="0.1"/>
 <joint name="y" type="slide" axis="0 1 0" limited="true" range="-0.27 0.27" ref="-0.1"/>
</body></worldbody></mujoco>"""
ROBOT = """<robot name="r"><link name="trunk">
  <inertial><mass value="5"/><inertia ixx="0.05" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
  <collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision></link>{legs}</robot>"""
LEG = """<link name="{n}"><inertial><origin xyz="0 0 -0.2"/><mass value="0.5"/>
   <inertia ixx="0.007" ixy="0" ixz="0" iyy="0.007" iyz="0" izz="0.001"/></inertial>
  <collision><origin xyz="0 0 -0.2"/><geometry><box size="0.06 0.06 0.4"/></geometry></collision></link>
 <joint name="hip_{n}" type="revolute"><parent link="trunk"/><child link="{n}"/>
  <origin xyz="{x} {y} 0"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="60" velocity="9"/>
  <dynamics damping="0.1"/></joint>"""
LEGS = "".join(LEG.format(n=f"l{k}", x=x, y=y) for k, (x, y) in enumerate(
    [(0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2)]
))  # fmt: skip
QUADRUPED = ROBOT.format(legs=LEGS)


@pytest.fixture
def robot(tmp_path):
    """Import a text as simulated bodies."""

    def make(text: str, **how: bool) -> Imported:
        path = tmp_path / ("r.urdf" if "<robot" in text else "r.xml")
        path.write_text(text)
        return imported(path, "robot", simulated=Simulated(**how))

    return make


COUPLED = """<mujoco><compiler angle="radian"/><worldbody><body name="hand" pos="0 0 1">
 <joint name="lift" type="slide" axis="0 0 1" stiffness="200"/><geom type="box" size="0.1 0.1 0.02" mass="1"/>
 <body name="long" pos="0.1 0 0"><joint name="m" axis="0 1 0" ref="0.3" limited="true" range="0.5 2"/>
  <geom type="capsule" fromto="0 0 0 0.3 0 0.1" size="0.02" mass="0.4"/></body>
 <body name="short" pos="-0.1 0 0"><joint name="f" axis="0 1 0" limited="true" range="-3 1"/>
  <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02" mass="0.3"/></body>
 <body name="rack" pos="0 0.3 0"><joint name="s" type="slide" axis="0.6 0 0.8"/>
  <geom type="sphere" size="0.04" mass="0.2"/></body></body></worldbody>
<equality><joint joint1="f" joint2="m" polycoef="0.1 -2 0 0 0"/>
 <joint joint1="s" joint2="f" polycoef="0 0.1 0 0 0"/></equality></mujoco>"""


def without_floor(scenario: Scenario, seconds: float) -> Scenario:
    """The scene without its fixed bodies, for some time."""
    kept = tuple(body for body in scenario.bodies if body.kind != "fixed")
    return replace(scenario, bodies=kept, duration=seconds)


def played_by_mujoco(text: str, dt: float, seconds: float, integrator: str, names: list[str]) -> np.ndarray:
    """Origins of bodies at 60 frames per second, of the file itself."""
    model = mujoco.MjModel.from_xml_string(text)
    model.opt.timestep = dt
    model.opt.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator}")
    data = mujoco.MjData(model)
    frames = []
    for _ in range(round(seconds * 60) + 1):
        mujoco.mj_kinematics(model, data)
        frames.append([data.body(name).xpos.copy() for name in names])
        for _ in range(round(1 / 60 / dt)):
            mujoco.mj_step(model, data)
    return np.array(frames)


def test_couplings_are_those_of_the_file(robot, tmp_path):
    """Ratios to the joint that follows none, and a start that obeys offsets and the limits of both joints."""
    found = robot(COUPLED)
    assert not any("coupling" in note for note in found.notes)
    joints = {joint.name: joint for joint in found.scenario.body_joints}
    assert {name: (joint.mimics, joint.ratio) for name, joint in joints.items()} == {
        "lift": ("", 1.0), "m": ("", 1.0), "f": ("m", -2.0), "s": ("m", -0.2),
    }  # fmt: skip
    # from their references: 0.2 is the least of m, which starts the range of f in that of m at -0.45
    assert found.start == pytest.approx({"lift": 0.0, "m": 0.2, "f": -0.3, "s": -0.03})
    assert (joints["f"].lower, joints["f"].upper) == pytest.approx((-2.7, 1.3))
    trees = trees_of(tmp_path / "r.xml", compiled(tmp_path / "r.xml"), found.scenario)
    assert max(deviations(found, trees).values()) < EQUAL
    tight = robot(COUPLED.replace("-3 1", "-3 -0.5")).start
    assert tight == pytest.approx({"lift": 0.0, "m": 0.3, "f": -0.5, "s": -0.05})


def test_coupled_joints_move_as_in_mujoco(robot):
    """To what MuJoCo's equality gives way, which is less where it is stiffer."""
    found, names = robot(COUPLED), ["long", "short", "rack"]
    scenario = without_floor(found.scenario, 0.2)
    seen = record(load("reference"), scenario, Settings("balanced", 1 / 60)).position
    own = seen[:, [scenario.body_index(name) for name in names]]
    assert np.abs(own[-1] - own[0]).max() > 0.15

    def error(stiffness: float) -> float:
        equality = f'<default><equality solref="{stiffness} 1"/></default><equality>'
        model = mujoco.MjModel.from_xml_string(COUPLED.replace("<equality>", equality))
        model.opt.timestep, model.opt.integrator = 1 / 7680, mujoco.mjtIntegrator.mjINT_RK4
        data = mujoco.MjData(model)
        for name, q in found.start.items():
            data.qpos[model.joint(name).qposadr[0]] += q
        away = []
        for place in own:
            mujoco.mj_kinematics(model, data)
            away.append(max(np.abs(data.body(name).xpos - at).max() for name, at in zip(names, place)))
            for _ in range(128):
                mujoco.mj_step(model, data)
        return max(away)

    assert error(0.001) < 1e-5
    assert error(0.001) < 0.3 * error(0.002)


@pytest.mark.parametrize(
    ("equality", "reason"),
    [
        ('<joint joint1="f" joint2="m" polycoef="0 1 0.5 0 0"/>', "it is not linear"),
        ('<joint joint1="f"/>', "it holds the joint where it is"),
        ('<joint joint1="f" joint2="m" active="false"/>', "it is not active"),
        ('<joint joint1="f" joint2="m" polycoef="3 1 0 0 0"/>', "its limits do not allow it"),
    ],
)
def test_couplings_that_are_not_kept_are_named(robot, equality, reason):
    """Each with its joint and why; the joint is free."""
    text = re.sub("<equality>.*</equality>", f"<equality>{equality}</equality>", COUPLED, flags=re.DOTALL)
    found = robot(text)
    assert f"left out: the coupling of joint 'f': {reason}" in found.notes
    assert not any(joint.mimics for joint in found.scenario.body_joints)


def test_couplings_are_resolved_to_one_joint(robot):
    """Of two of one joint the first counts, and of a circle one less."""
    second = '<joint joint1="f" joint2="s"/></equality>'
    assert (
        "left out: the coupling of joint 'f': it has another"
        in robot(COUPLED.replace("</equality>", second)).notes
    )
    circle = '<joint joint1="m" joint2="s"/></equality>'
    found = robot(COUPLED.replace("</equality>", circle).replace('limited="true"', 'limited="false"'))
    assert [note for note in found.notes if "coupling" in note] == [
        "left out: the coupling of joint 'f': it follows itself"
    ]
    named = {joint.name: joint.mimics for joint in found.scenario.body_joints}
    assert named == {"lift": "", "m": "f", "f": "", "s": "f"}


@pytest.mark.parametrize(
    "text", [WALKER, ARM.replace('limited="true"', 'limited="false"')], ids=["free", "rail"]
)
def test_a_robot_moves_as_its_file_does_in_mujoco(robot, text):
    """Springs, dampers, servos, sliders, balls, several hinges of a body: equal to MuJoCo's own error, which
    halves with its step; with its integrator of fourth order, to what lightens the links between hinges."""
    seconds = 0.5
    scenario = without_floor(robot(text).scenario, seconds)
    names = ["torso", "thigh", "slide", "tail"] if text is WALKER else ["cart", "pole"]
    seen = record(load("reference"), scenario, Settings("balanced", 1 / 60))
    own = seen.position[:, [scenario.body_index(name) for name in names]]
    assert np.abs(own[-1] - own[0]).max() > 0.03

    def error(dt: float, integrator: str) -> float:
        return float(np.abs(own - played_by_mujoco(text, dt, seconds, integrator, names)).max())

    coarse, fine = error(1 / 1920, "EULER"), error(1 / 3840, "EULER")
    assert fine == pytest.approx(coarse / 2, rel=0.05)
    assert error(1 / 3840, "RK4") < 1e-7


@pytest.mark.parametrize(
    "text",
    [WALKER, ARM, QUADRUPED, TARGET, QUADRUPED.replace('lower="-1" upper="1"', 'lower="-1e16" upper="1e16"')],
    ids=["free", "rail", "urdf", "small body that slides far", "limits beyond all turns"],
)
@pytest.mark.parametrize("fixed_base", [False, True])
def test_independent_readers_have_the_same_robot(robot, tmp_path, text, fixed_base):
    """Mass, centre, inertia, axes and limits are the file's; what is written is read again, to the bit."""
    found = robot(text, fixed_base=fixed_base)
    path = next(tmp_path.glob("r.*"))
    off = deviations(found, trees_of(path, compiled(path), found.scenario))
    assert max(off.values()) <= EQUAL
    (tmp_path / "again.toml").write_text(scene_toml(found.scenario, ""))
    assert read_scene(tmp_path / "again.toml") == replace(found.scenario, name=found.scenario.name)


def test_springs_and_servos_keep_their_forces(robot):
    """Gear, gains, control range and reference become stiffness, damping and target; balls keep damping."""
    joints = {joint.name: joint for joint in robot(WALKER).scenario.body_joints}
    assert (joints["x"].stiffness, joints["x"].target, joints["x"].damping) == (20.0, 0.4, 0.3)
    knee = joints["knee"]
    # 1.5 (30 0.1 - 30 1.5 (0.2 + q) - 1.5 q')
    assert (knee.stiffness, knee.damping) == pytest.approx((67.5, 2.25))
    assert knee.target == pytest.approx((1.5 * 3 - 67.5 * 0.2) / 67.5)
    assert (joints["b"].type, joints["b"].damping, joints["s"].type) == ("ball", 0.05, "slider")
    assert {joint.largest_force for joint in joints.values()} == {UNBOUNDED}


def test_a_start_beyond_a_limit_is_moved_to_it(robot):
    """A joint whose range does not hold 0 starts at the limit next to it."""
    tilt = robot(ARM).scenario.body_joints[-1]
    assert (tilt.lower, tilt.upper) == pytest.approx((0.0, 0.1))
    w, _, y, _ = next(body for body in robot(ARM).scenario.bodies if body.name == "pole").orientation
    assert 2 * np.arctan2(y, w) == pytest.approx(0.3)


@pytest.mark.parametrize("engine", [name for name in ("reference", "mujoco") if installed(name)])
def test_a_held_robot_stands_and_another_falls(robot, engine):
    """On servos the trunk stays at its height for ten seconds; without them it falls to the floor."""
    heights = {}
    for hold in (True, False):
        scenario = robot(QUADRUPED, hold=hold).scenario
        if not hold:
            # straight legs balance: a push
            pushed = [
                replace(body, linear_velocity=(0.5, 0.0, 0.0)) if body.kind == "simulated" else body
                for body in scenario.bodies
            ]
            scenario = replace(scenario, bodies=tuple(pushed))
        profile = "balanced" if engine == "reference" else "recommended"
        seen = record(load(engine), scenario, Settings(profile, 1 / 60 if engine == "reference" else 1 / 240))
        height = seen.position[:, scenario.body_index("trunk"), 2]
        heights[hold] = float(height[-1] - height[0])
    assert abs(heights[True]) < 0.005
    assert heights[False] < -0.1


def test_hold_servos_carry_what_lies_beyond_the_ground(robot):
    """A hip carries the trunk and the other legs; its servo is critically damped, without a bound."""
    found = robot(QUADRUPED, hold=True)
    hip = found.scenario.body_joints[0]
    assert hip.damping == pytest.approx(2 * hip.stiffness / HOLD_FREQUENCY + 0.1)
    moment = hip.stiffness / HOLD_FREQUENCY**2
    trunk = 0.1 + 5 * 0.2**2
    legs = 0.007 + 0.5 * 0.2**2 + 2 * (0.007 + 0.5 * (0.4**2 + 0.2**2))
    assert moment == pytest.approx(trunk + legs)
    assert hip.largest_force == UNBOUNDED
    assert "hold: servos take the place of motors, and no effort bounds them" in found.notes


def test_what_passes_through_is_excluded(robot):
    """Masks and overlaps at the start become exclusions of contact."""
    masked = WALKER.replace("<geom ", '<geom contype="1" conaffinity="0" ')
    (group,) = robot(masked).scenario.contact_exclusions
    assert set(group) == {"torso", "thigh", "shin", "slide", "tail"}
    deep = WALKER.replace('fromto="0 0 0 -0.3 0 0.1"', 'fromto="0 0 0 0.4 0 -0.1"')
    found = robot(deep)
    assert ("torso", "tail") in found.scenario.contact_exclusions
    assert any(re.match(r"contacts: links that overlap at .*'tail' and 'torso' by", n) for n in found.notes)


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [
        ('stiffness="15"', 'armature="0.1"', "left out: rotor inertia (armature) of 1 joint"),
        ('damping="0.05"', 'range="0 0.5" limited="true"', "left out: the limit of ball joint 'b'"),
        ('<position name="servo" joint="knee" kp="30" kv="1" gear="1.5" ctrlrange="0.1 1"/>',
         '<motor joint="knee"/>', "actuators: no force of 1 motor, since controls are 0"),
        ('ctrlrange="0.1 1"', 'forcerange="-2 5"', "actuator 'servo': its force is at most 7.5 both ways"),
        ('kp="30" kv="1" gear="1.5" ctrlrange="0.1 1"', 'kp="-30"',
         "left out: actuator 'servo': its force grows with position or speed"),
        ("<position", '<general joint="knee" gaintype="affine" gainprm="1 1"/><position',
         "left out: actuator '0': its force is no spring"),
    ],
)  # fmt: skip
def test_what_is_not_kept_is_named(robot, old, new, note):
    """A note for each kind of thing that no joint of a scene has."""
    assert old in WALKER
    assert any(line.startswith(note) for line in robot(WALKER.replace(old, new)).notes)


def test_a_body_too_light_for_its_joints_is_refused(robot):
    """The links between several joints would count as massless."""
    light = ARM.replace(
        '<geom type="box" size="0.2 0.1 0.05"/>', '<geom type="box" size="0.2 0.1 0.05" mass="1e-12"/>'
    )
    with pytest.raises(RobotError, match=r"body 'cart': 1e-12 kg are too little for 2 joints"):
        robot(light)


@pytest.mark.skipif(folders()["pybullet"] is None, reason="pybullet is not installed")
def test_wheels_of_a_robot_roll():
    """A car that is pushed with its wheels at rest spins them up: v = v_0 / (1 + sum I / (m r^2)) = w r.

    Its free steering, which the start turns by some 1e-5 rad, makes a wheel on one side faster than that on
    the other.
    """
    path = folders()["pybullet"] / "racecar/racecar.urdf"
    found = imported(path, "robot", allow_paths=True, simulated=Simulated()).scenario
    pushed = [
        replace(body, linear_velocity=(1.0, 0.0, 0.0)) if body.kind == "simulated" else body
        for body in found.bodies
    ]
    scene = replace(found, bodies=tuple(pushed), duration=0.1)
    wheels = [k for k, body in enumerate(scene.bodies) if body.name.endswith("wheel")]
    (radius,) = {scene.bodies[k].pieces[0].shape.radius for k in wheels}
    spun = sum(scene.bodies[k].inertia[2][2] for k in wheels) / radius**2
    seen = record(load("reference"), scene, Settings("balanced", 1 / 60))
    speed = 1 / (1 + spun / sum(body.mass for body in scene.bodies))
    assert len(wheels) == 4
    for found in (seen.angular_velocity[-1, wheels, 1] * radius, seen.linear_velocity[-1, wheels, 0]):
        np.testing.assert_allclose(found.mean(), speed, rtol=1e-5)
        np.testing.assert_allclose(found, speed, rtol=5e-5)


STEP = 1 / 480
"""Step of MuJoCo beside which robots are judged [s]; its error is what half the step changes, twice."""


def compared(scenario: Scenario, measure: Callable[[Scenario, Recording], np.ndarray]) -> tuple[float, float]:
    """Largest distance of the reference from MuJoCo, and MuJoCo's own error by its step, of a measure."""
    own = measure(scenario, record(load("reference"), scenario, Settings("balanced", 1 / 60)))
    coarse, fine = (
        measure(scenario, record(load("mujoco"), scenario, Settings("recommended", dt)))
        for dt in (STEP, STEP / 2)
    )
    return float(np.abs(own - coarse).max()), 2 * float(np.abs(coarse - fine).max())


def untouched(scenario: Scenario) -> Scenario:
    """The robot for a third of a second without contact and limits, which are soft in MuJoCo."""
    joined = {name for joint in scenario.body_joints for name in (joint.parent, joint.child)}
    kept = tuple(body for body in scenario.bodies if body.kind == "simulated" or body.name in joined)
    names = tuple(body.name for body in kept)
    joints = tuple(replace(one, lower=-UNBOUNDED, upper=UNBOUNDED) for one in scenario.body_joints)
    return replace(scenario, bodies=kept, body_joints=joints, contact_exclusions=(names,), duration=0.3)


def end_height(scenario: Scenario, seen: Recording) -> np.ndarray:
    """Height of the centre of mass at the end [m]."""
    mass = np.array([body.mass * (body.kind == "simulated") for body in scenario.bodies])
    return np.asarray(seen.position[-1, :, 2] @ mass / mass.sum())


def size_of(scenario: Scenario) -> float:
    """Largest distance of the origins of two links at the start, at least 0.1 [m]."""
    places = np.array([body.position for body in scenario.bodies if body.kind == "simulated"])
    return max(0.1, float(np.ptp(places, axis=0).max()))


def of_others(path: Path) -> Imported:
    """A robot of others as simulated bodies; skips the test if it is refused."""
    try:
        return imported(path, "robot", allow_paths=True, simulated=Simulated())
    except RobotError as error:
        pytest.skip(f"refused: {str(error).splitlines()[0]}")


@pytest.mark.slow
def test_35_models_of_others_import():
    """Of those that pip packages bring, at least 35."""
    paths = models()
    if len(paths) < 40:
        pytest.skip("pip install -e '.[models]' for models of gymnasium, dm_control and example-robot-data")
    refused = 0
    for path in paths:
        try:
            imported(path, "robot", allow_paths=True, simulated=Simulated())
        except RobotError:
            refused += 1
    assert len(paths) - refused >= 35


@pytest.mark.slow
@pytest.mark.parametrize("path", models(), ids=lambda path: f"{path.parent.name}/{path.name}")
def test_a_model_of_others_moves_as_in_mujoco(path):
    """It equals its file. Without contact and limits it moves as in MuJoCo to the error of MuJoCo's steps; on
    the floor it stands or falls with it: a second later, its centre of mass is as high, to that error or a
    tenth of its size, since falls amplify what differs."""
    found = of_others(path)
    off = deviations(found, trees_of(path, compiled(path, True), found.scenario))
    assert max(off.values()) <= EQUAL
    free, error = compared(untouched(found.scenario), lambda _, seen: seen.position)
    fallen, spread = compared(replace(found.scenario, duration=1.0), end_height)
    size = size_of(found.scenario)
    print(f"free {free:.1e} of {error:.1e} m, fall {fallen:.1e} of {spread:.1e} m, size {size:.2f} m")
    assert free <= 1.05 * error + 1e-6
    assert fallen <= max(spread, 0.1 * size)

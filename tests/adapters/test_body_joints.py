"""Joints between bodies in the engines: their motion tends to the scene's truth as the step shrinks."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings, Unsupported
from touchstone.adapters.recorder import build, record
from touchstone.adapters.registry import installed, load
from touchstone.adapters.scripts.process import written
from touchstone.scenarios.body_joints import reversed_joint
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.families.literature import even
from touchstone.scenarios.families.mechanisms import ACROSS, mechanism, rod
from touchstone.scenarios.scenario import (
    UNBOUNDED,
    Body,
    BodyJoint,
    Hull,
    Piece,
    Scenario,
    Sphere,
    Tracker,
    vector,
)
from touchstone.scenarios.solids import ball, slab

ENGINES = [name for name in ("mujoco", "dart", "bullet") if installed(name)]
SMOOTH = ("double_pendulum", "spherical_pendulum", "slider_spring", "hinged_pair")


def far(engine: str, scenario: Scenario, rate: int, profile: str = "recommended") -> float:
    """Largest distance of a body from its truth [m]."""
    kept = record(load(engine), scenario, Settings(profile, 1 / rate))
    bodies = [scenario.body_index(truth.body) for truth in scenario.truths]
    true = [motion(scenario, truth, kept.time).position for truth in scenario.truths]
    return float(np.abs(kept.position[:, bodies] - np.stack(true, axis=1)).max())


def error(engine: str, scene: str, rate: int) -> float:
    """Largest distance of a body from its truth over the first half second [m]."""
    return far(engine, replace(catalogue()[scene], duration=0.5, expectations=(), published=()), rate)


@pytest.mark.parametrize("scene", SMOOTH)
@pytest.mark.parametrize("engine", ENGINES)
def test_the_error_falls_with_the_step(engine: str, scene: str) -> None:
    """Integrators of first order come four times as near at a quarter of the step."""
    coarse, fine = error(engine, scene, 480), error(engine, scene, 1920)
    assert fine < 0.3 * coarse
    assert coarse < 0.05


TENSOR = ((2.0e-2, 3.0e-3, -2.0e-3), (3.0e-3, 3.0e-2, 4.0e-3), (-2.0e-3, 4.0e-3, 2.5e-2))
"""An inertia with no axis of the body as principal axis [kg m^2]."""


def uneven(first: str, second: str, **forces: float) -> Scenario:
    """Two bodies off their centres of mass in a chain of two joints, of which the second has forces."""
    cube = Hull(tuple((x, y, z) for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.05, 0.05)))
    pieces = (Piece("near", cube), Piece("far", cube, (0.2, 0.0, 0.0)))
    common = {"mass": 1.0, "inertia": TENSOR, "center_of_mass": (0.05, -0.02, 0.03)}
    upper, lower = (
        Body(name, "simulated", "steel", pieces, position=place, orientation=(0.8, 0.0, 0.6, 0.0), **common)
        for name, place in (("upper", (0.0, 0.0, 0.0)), ("lower", (1.0, 0.3, 0.0)))
    )
    joints = (
        BodyJoint("first", first, "", "upper", (0.1, 0.2, 0.3), (0.6, 0.8, 0.0)),
        BodyJoint("second", second, "upper", "lower", (0.5, 0.1, 0.0), (0.0, 0.6, 0.8), **forces),
    )
    return mechanism("uneven", "a chain of two bodies", [upper, lower], joints, 0.5)


@pytest.mark.parametrize(
    ("first", "second", "forces"),
    [
        ("hinge", "slider", {"stiffness": 30.0, "damping": 0.2, "target": 0.1}),
        ("ball", "hinge", {"stiffness": 3.0, "damping": 0.2, "target": 1.0}),
        ("slider", "ball", {"damping": 0.1}),
        ("hinge", "fixed", {}),
    ],
)
@pytest.mark.parametrize("engine", ENGINES)
def test_bodies_keep_their_mass_and_axes(engine: str, first: str, second: str, forces: dict) -> None:
    """Joints off the bodies' axes and centres of mass move them to within the step's error, 2.5 mm; mass
    properties read back are those of the scene."""
    scenario = uneven(first, second, **forces)
    world, _, _ = build(load(engine), scenario, Settings("recommended", 1 / 960))
    read_back = world.describe()
    world.close()
    kept = record(load(engine), scenario, Settings("recommended", 1 / 960))
    for k, truth in enumerate(scenario.truths):
        true = motion(scenario, truth, kept.time).position
        turn = Rotation.from_quat(kept.orientation[:, k], scalar_first=True)
        center = kept.position[:, k] + turn.apply(scenario.bodies[k].center_of_mass)
        assert np.abs(center - true).max() < 0.0025
        facts = read_back.bodies[truth.body]
        assert facts.center_of_mass == pytest.approx(scenario.bodies[k].center_of_mass, abs=1e-9)
        assert np.array(facts.inertia) == pytest.approx(np.array(TENSOR), abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_parent_and_child_may_change_places(engine: str) -> None:
    """A joint that its tree enters by the child moves its bodies as if it were given the other way round."""
    scenario = uneven("ball", "hinge", stiffness=3.0, damping=0.2, target=1.0)
    first, second = scenario.body_joints
    turned = replace(scenario, body_joints=(first, reversed_joint(second)))
    settings = Settings("recommended", 1 / 480)
    one, other = (record(load(engine), scene, settings).position for scene in (scenario, turned))
    assert other == pytest.approx(one, abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_weld_locks_a_loop(engine: str) -> None:
    """Two rods that hang side by side do not swing where a fixed joint closes the loop."""
    places = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    rods = [rod(f"rod_{k}", place, vector(np.add(place, (0.3, 0.0, -0.4)))) for k, place in enumerate(places)]
    joints = [BodyJoint(f"top_{k}", "hinge", "", f"rod_{k}", place, ACROSS) for k, place in enumerate(places)]
    joints.append(BodyJoint("weld", "fixed", "rod_0", "rod_1", (0.5, 0.0, -0.2)))
    scenario = mechanism("locked", "two rods and a weld", rods, joints, 0.5, truths=())
    kept = record(load(engine), scenario, Settings("recommended", 1 / 960))
    assert np.abs(kept.position - kept.position[0]).max() < 0.001


@pytest.mark.parametrize("engine", ENGINES)
def test_a_loop_closes_as_far_as_constraints_are_stiff(engine: str) -> None:
    """The bars of a four-bar follow the truth to some millimetres in half a second."""
    assert error(engine, "four_bar", 1920) < 0.01


@pytest.mark.parametrize("engine", ENGINES)
def test_a_motor_drives_its_wheel(engine: str) -> None:
    """The motor's largest torque accelerates, and its target rate ends that."""
    scenario = catalogue()["motor_hinge"]
    kept = record(load(engine), scenario, Settings("recommended", 1 / 480))
    assert np.abs(kept.angular_velocity[-1, 0]).max() == pytest.approx(10.0, abs=0.05)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_stiff_damper_holds_its_rate(engine: str) -> None:
    """Dampers whose explicit force would carry wheels 33 times beyond their rates keep them at these."""
    scenario = replace(catalogue()["wheel_motor"], duration=0.5, published=())
    kept = record(load(engine), scenario, Settings("default", 1 / 240))
    wheels = [scenario.body_index(joint.child) for joint in scenario.body_joints]
    assert kept.angular_velocity[-1, wheels, 1] == pytest.approx(10.0, abs=0.5)


def pair(first: str, second: str, ratio: float, parent: str = "") -> Scenario:
    """Two rods of 1 and 2 kg on joints of the world, or the second on the first, that are coupled."""
    places = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0) if parent else (0.0, 0.3, 0.0))
    rods = [
        rod("a", places[0], (0.5, 0.0, 0.0)),
        rod("b", places[1], vector(np.add(places[1], (0.2, 0.0, 0.4))), 2.0),
    ]
    up = (0.0, 0.0, 1.0)
    joints = (
        BodyJoint("one", first, "", "a", places[0], ACROSS if first == "hinge" else up),
        BodyJoint("two", second, parent, "b", places[1], ACROSS if second == "hinge" else up),
    )
    coupled = replace(joints[1], mimics="one", ratio=ratio)
    return mechanism("coupled", "two coupled rods", rods, (joints[0], coupled), 0.3)


@pytest.mark.parametrize(
    "scenario",
    [
        pair("hinge", "hinge", -1.5),
        pair("hinge", "slider", 0.2),
        pair("slider", "hinge", -3.0),
        pair("slider", "slider", -1.2),
        pair("hinge", "hinge", 0.5, "a"),
        pair("hinge", "slider", 0.3, "a"),
    ],
    ids=["hinges", "rack", "pinion", "sliders", "arm", "arm and rack"],
)
@pytest.mark.parametrize("engine", ENGINES)
def test_coupled_joints_come_near_their_truth(engine: str, scenario: Scenario) -> None:
    """Forces of a coupling act on both joints: the error falls with the step, whichever joint is heavier."""
    coarse, fine = (far(engine, scenario, rate) for rate in (480, 1920))
    assert fine < 0.3 * coarse
    assert coarse < 0.02


@pytest.mark.parametrize(
    ("engine", "rate", "most"), [("reference", 60, 1e-6), ("mujoco", 540, 0.01), ("bullet", 240, 0.01)]
)
def test_a_gripper_with_one_motor_lifts(engine: str, rate: int, most: float) -> None:
    """A motor of twice the force in one finger, which the other mimics: the coupling carries half of it."""
    if not installed(engine):
        pytest.skip(f"needs {engine}")
    scenario = catalogue()["gripper_lifts"]
    lift, right, left = scenario.body_joints
    one = replace(right, largest_force=2 * right.largest_force)
    other = replace(left, damping=0.0, target_rate=0.0, largest_force=UNBOUNDED, mimics=right.name)
    scenario = replace(scenario, body_joints=(lift, one, other))
    profile = "balanced" if engine == "reference" else "recommended"
    assert far(engine, scenario, rate, profile) < most


@pytest.mark.skipif(not installed("bullet"), reason="needs Bullet")
def test_bullet_couples_no_two_free_roots() -> None:
    """Its gears between multibodies exert other forces: couplings of a free root with another are refused."""
    rods = [rod(f"rod_{k}", (0.5 * k, 0.0, 0.0), (0.5 * k + 0.4, 0.0, 0.0)) for k in range(4)]
    hinges = [
        BodyJoint(f"hinge_{k}", "hinge", f"rod_{k}", f"rod_{k + 1}", rods[k].position, ACROSS) for k in (0, 2)
    ]
    hinges[1] = replace(hinges[1], mimics="hinge_0")
    scenario = mechanism("robots", "two robots", rods, hinges, 0.1, truths=())
    with pytest.raises(Unsupported, match=r"bullet: a gear couples joints of one multibody.*'hinge_2'"):
        load("bullet").build(scenario, Settings("recommended", 1 / 480))
    record(load("reference"), scenario, Settings("balanced", 1 / 60))


def driven_follower() -> Scenario:
    """Two coupled rods, of which the lighter one has a motor."""
    scenario = pair("hinge", "hinge", 0.5)
    first, second = scenario.body_joints
    return replace(scenario, body_joints=(first, replace(second, damping=1.0, target_rate=1.0)))


def coupled_loop() -> Scenario:
    """A four-bar at rest, whose joints follow the first one."""
    scenario = catalogue()["four_bar"]
    first, *others = scenario.body_joints
    rest = {"linear_velocity": (0.0, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.0)}
    still = tuple(replace(body, **rest) for body in scenario.bodies)
    coupled = (first, *(replace(one, mimics=first.name) for one in others))
    return replace(scenario, body_joints=coupled, bodies=still, truths=())


def limited_loop() -> Scenario:
    """A four-bar, all of whose joints have limits."""
    scenario = catalogue()["four_bar"]
    limited = tuple(replace(joint, lower=-3.0, upper=3.0) for joint in scenario.body_joints)
    return replace(scenario, body_joints=limited, truths=())


def prescribed_wire() -> Scenario:
    """A bead on a wire that a prescribed body carries."""
    scenario = catalogue()["bead_on_wire"]
    path = Body("path", "prescribed", "steel", (Piece("ball", Sphere(0.01)),))
    tracker = Tracker("path", (), (0.0, 2.0), ((0.0, 0.0, 0.0),) * 2, ((1.0, 0.0, 0.0, 0.0),) * 2, ((), ()))
    held = tuple(replace(joint, parent="path") for joint in scenario.body_joints)
    bodies = (path, *scenario.bodies)
    return replace(scenario, bodies=bodies, body_joints=held, trackers=(tracker,), truths=())


@pytest.mark.parametrize(
    ("engine", "make", "message"),
    [
        *((one, driven_follower, r"no motor in the lighter one of two coupled joints \('two'\)")
          for one in ENGINES if one == "dart"),
        *((one, coupled_loop, "no coupled joint closes a loop") for one in ("reference", *ENGINES)),
        *((one, limited_loop, "no hinge with forces or limits closes a loop") for one in ENGINES),
        *((one, prescribed_wire, r"no joint with a prescribed body \('wire'\)") for one in ENGINES),
    ],
)  # fmt: skip
def test_joints_that_an_engine_lacks_are_refused(engine: str, make: Callable, message: str) -> None:
    """In one line that names the engine, and the joint where others are kept."""
    profile = "balanced" if engine == "reference" else "recommended"
    with pytest.raises(Unsupported, match=f"{engine}: {message}"):
        load(engine).build(make(), Settings(profile, 1 / 480))


def test_an_engine_without_joints_refuses_them() -> None:
    """The recorder says so before anything is built."""
    with pytest.raises(Unsupported, match="toy: the adapter has no joints between bodies"):
        build(SimpleNamespace(name="toy"), catalogue()["four_bar"], Settings("recommended", 1 / 240))


def test_no_script_is_written_of_joints() -> None:
    """Scripts in an engine's own API have no words for joints."""
    with pytest.raises(Unsupported, match="mujoco: no words for joints between bodies"):
        written(catalogue()["four_bar"], "mujoco", Settings("recommended", 1 / 480))


@pytest.mark.parametrize("engine", ["reference", *ENGINES])
@pytest.mark.parametrize("groups", [(("a", "b", "c"),), (("a", "c"), ("b", "c"))], ids=["a group", "pairs"])
def test_excluded_bodies_pass_through_each_other(engine: str, groups: tuple[tuple[str, ...], ...]) -> None:
    """A ball falls through those that a joint holds, onto the floor, which it was not excluded from."""
    one, two = (ball(n, "steel", 0.1, 1.0, (x, 0.0, 0.5)) for n, x in (("a", 0.0), ("b", 0.25)))
    third = ball("c", "steel", 0.1, 1.0, (0.1, 0.0, 0.75))
    hinge = BodyJoint("h", "hinge", "a", "b", (0.12, 0.0, 0.5))
    pin = BodyJoint("p", "fixed", "", "a", (0.0, 0.0, 0.5))
    scenario = Scenario(
        "s", "", (), (slab("floor", "steel"), one, two, third), 1.0, even("steel", mu=0.5),
        body_joints=(pin, replace(hinge, axis=(0.0, 1.0, 0.0), stiffness=1e4, damping=100.0)),
        contact_exclusions=groups,
    )  # fmt: skip
    profile, dt = ("balanced", 1 / 60) if engine == "reference" else ("recommended", 1 / 240)
    fallen = record(load(engine), scenario, Settings(profile, dt)).position[-1, 3]
    assert np.abs(fallen - (0.1, 0.0, 0.1)).max() < 0.01
    held = record(load(engine), replace(scenario, contact_exclusions=()), Settings(profile, dt))
    assert np.linalg.norm(held.position[:, 3] - held.position[:, 1], axis=1).min() > 0.19

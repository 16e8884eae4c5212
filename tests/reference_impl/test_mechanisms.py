"""Bodies that joints connect: equations of motion, loops, limits, contacts, and guarantees."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import AdapterError, Settings, Unsupported
from touchstone.adapters.recorder import record
from touchstone.adapters.recording import Recording
from touchstone.adapters.registry import load
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import mechanical_energy, spin
from touchstone.reports.metrics.motion.joints import joint_drift, joint_turn
from touchstone.reports.verdict.outcomes import EXACT, judge_random
from touchstone.scenarios.body_joints import ALONG_AXIS, reversed_joint
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.files.mass_properties import uniform
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import (
    ORIGIN,
    Body,
    BodyJoint,
    Box,
    Cylinder,
    PairCoefficients,
    Piece,
    Scenario,
    Shape,
    Sphere,
)
from touchstone.scenarios.solids import sphere_inertia

Array = NDArray[np.float64]
Y = (0.0, 1.0, 0.0)
STEEL = (PairCoefficients("steel", "steel", 0.0, 0.5),)
FLOOR = Body("floor", "fixed", "steel", (Piece("top", Box((5.0, 5.0, 0.5))),), position=(0.0, 0.0, -0.5))


def solid(name: str, shape: Shape, center: tuple[float, ...], mass: float = 1.0, **fields: object) -> Body:
    piece = Piece("piece", shape)
    middle, inertia = uniform((piece,), mass)
    x, y, z = (float(v) for v in center)
    return Body(name, "simulated", "steel", (piece,), mass, middle, inertia, position=(x, y, z), **fields)  # type: ignore[arg-type]


def rod(
    name: str,
    center: tuple[float, ...],
    half: tuple[float, float, float],
    mass: float = 1.0,
    **fields: object,
) -> Body:
    return solid(name, Box(half), center, mass, **fields)


def scene(bodies: list[Body], joints: list[BodyJoint], duration: float, **fields: object) -> Scenario:
    fields = {"coefficients": STEEL, **fields}
    return Scenario("joints", "", (), tuple(bodies), duration, body_joints=tuple(joints), **fields)  # type: ignore[arg-type]


def play(scenario: Scenario, profile: str = "balanced", rate: int = 60) -> Context:
    """What the reference makes of a scene."""
    return Context(record(load("reference"), scenario, Settings(profile, 1 / rate)), scenario)


def energy(context: Context) -> Array:
    """Of all simulated bodies, after each frame [J]."""
    return mechanical_energy(context, context.simulated)[1:]


def drift(context: Context) -> float:
    """Largest distance of two anchors, or angle that a joint does not allow [m or rad]."""
    turned = {} if all(one.type == "ball" for one in context.scenario.body_joints) else joint_turn(context)
    return max(one.value for found in (joint_drift(context), turned) for one in found.values())


def momenta(context: Context, bodies: list[int]) -> Array:
    """Linear and angular momentum of some bodies after each frame (6, f)."""
    r, total = context.recording, 0.0
    for k in bodies:
        linear = context.mass[k] * r.linear_velocity[:, k]
        turning = spin(context, k, r.orientation[:, k], r.angular_velocity[:, k])
        total += np.hstack([linear, np.cross(context.mass_centers[:, k], linear) + turning])
    return np.asarray(total).T


def coupled(ratio: float) -> Scenario:
    """The double pendulum whose second joint turns by a ratio of the first one's angle."""
    scenario = catalogue()["double_pendulum"]
    first, second = scenario.body_joints
    bodies = tuple(replace(body, linear_velocity=ORIGIN, angular_velocity=ORIGIN) for body in scenario.bodies)
    joints = (first, replace(second, mimics=first.name, ratio=ratio))
    return replace(scenario, name=f"coupled_{ratio:g}", bodies=bodies, body_joints=joints)


JOINED = {scene.name: scene for scene in (*tagged("joints"), coupled(-2.0), coupled(0.5)) if scene.truths}
FARTHEST = {"balanced": 5e-8, "accurate": 1e-10}
"""Distance of a body from its truth [m]."""
HELD = {"wheel_motor": 2e-5}
"""The same of motors that are too stiff for explicit steps."""


def test_a_ball_on_a_ball_joint_slides_on_a_floor_as_a_pendulum() -> None:
    """Swing on a tilted floor without friction as the pendulum in its plane, and keep the energy: what the
    joint holds presses nothing on the floor."""
    radius, arm, pull = 0.08, 0.4, 9.81 * 0.5
    bob = solid("bob", Sphere(radius), (arm * np.cos(1.0), arm * np.sin(1.0), radius))
    joint = BodyJoint("joint", "ball", "", "bob", (0.0, 0.0, radius))
    fields = {
        "gravity": (pull, 0.0, -9.81 * np.sqrt(0.75)),
        "coefficients": (PairCoefficients("steel", "steel", 0.0, 0.0),),
    }
    about = sphere_inertia(1.0, radius)[2][2] + arm**2
    swing = solve_ivp(
        lambda _, y: (y[1], -pull * arm * np.sin(y[0]) / about),
        (0.0, 1.2),
        (1.0, 0.0),
        rtol=1e-12,
        atol=1e-13,
    )
    angle = swing.y[0, -1]
    for rate, most in ((60, 5e-6), (240, 2e-8)):
        context = play(scene([FLOOR, bob], [joint], 1.2, **fields), rate=rate)
        place = (arm * np.cos(angle), arm * np.sin(angle), radius)
        np.testing.assert_allclose(context.recording.position[-1, 1], place, atol=most)


def test_what_slides_on_a_joint_turns_its_slip_to_second_order() -> None:
    """A ball that spins on an arm about an axis askew slides on a floor in a direction that turns: friction
    opposes the mean of the slip before and after."""
    radius, axis = 0.05, (np.sqrt(0.5), np.sqrt(0.5), 0.0)
    arm = rod("arm", (0.18, 0.0, radius), (0.15, 0.02, 0.02), 0.3)
    spin = (40 * axis[0], 40 * axis[1], 0.0)
    ball = solid("ball", Sphere(radius), (0.4, 0.0, radius), angular_velocity=spin)
    joints = [
        BodyJoint("shoulder", "ball", "", "arm", (0.0, 0.0, radius)),
        BodyJoint("axle", "hinge", "arm", "ball", (0.4, 0.0, radius), axis),
    ]
    scenario = scene([FLOOR, arm, ball], joints, 0.1)
    ends = {}
    for rate in (60, 120, 960):
        ends[rate] = play(replace(scenario, frame_rate=rate), rate=rate).recording.position[-1, 1:]
    coarse, fine = (np.abs(ends[rate] - ends[960]).max() for rate in (60, 120))
    assert fine < 3e-5
    assert coarse > 3 * fine


@pytest.mark.parametrize("rate", [60, 240])
def test_a_brake_at_its_largest_torque_stops_within_a_substep(rate: int) -> None:
    """A wheel on a base that turns freely on the floor: the brake slows it evenly, and no momentum is lost
    where it stops."""
    smooth = (PairCoefficients("steel", "steel", 0.0, 0.0),)
    base = rod("base", (0.0, 0.0, 0.1), (0.2, 0.2, 0.1))
    wheel = rod("wheel", (0.0, 0.0, 0.27), (0.15, 0.15, 0.02), angular_velocity=(0.0, 0.0, 10.0))
    brake = BodyJoint(
        "brake", "hinge", "base", "wheel", (0.0, 0.0, 0.25), (0.0, 0.0, 1.0), damping=50.0, largest_force=0.5
    )
    recording = play(
        scene([FLOOR, base, wheel], [brake], 0.4, coefficients=smooth, frame_rate=rate), rate=rate
    ).recording
    heavy, light = 2 * 0.2**2 / 3, 2 * 0.15**2 / 3
    common, stop = 10 * light / (heavy + light), 10 * heavy * light / (0.5 * (heavy + light))
    np.testing.assert_allclose(recording.angular_velocity[-1, 1:, 2], common, atol=1e-12)
    turned = Rotation.from_quat(recording.orientation[-1, 1], scalar_first=True).as_rotvec()[2]
    assert turned == pytest.approx(0.25 * stop**2 / heavy + common * (0.4 - stop), abs=1e-4)


@pytest.mark.parametrize("largest", [0.1, 0.02])
@pytest.mark.parametrize("rate", [60, 240])
def test_a_weak_brake_yields_to_an_impact(largest: float, rate: int) -> None:
    """A ball hits a rod on a stiff brake with a small largest torque: what is bounded changes no velocity at
    once, so the ball rebounds as from a rod without a brake."""
    arm, mass, speed, restitution = 0.35, 0.2, 2.0, 0.5
    beam = rod("rod", (0.2, 0.0, 0.1), (0.2, 0.02, 0.02), 0.5)
    ball = solid("ball", Sphere(0.02), (arm, -0.2, 0.1), mass, linear_velocity=(0.0, speed, 0.0))
    brake = BodyJoint(
        "brake", "hinge", "", "rod", (0.0, 0.0, 0.1), (0.0, 0.0, 1.0), damping=50.0, largest_force=largest
    )
    bounce = (PairCoefficients("steel", "steel", restitution, 0.0),)
    context = play(
        scene([beam, ball], [brake], 0.1, gravity=ORIGIN, coefficients=bounce, frame_rate=rate), rate=rate
    )
    inertia = 0.5 * ((0.4**2 + 0.04**2) / 12 + 0.2**2)
    impulse = (1 + restitution) * speed / (arm**2 / inertia + 1 / mass)
    struck = arm * impulse / inertia - largest * (0.1 - 0.16 / speed) / inertia
    assert context.recording.linear_velocity[-1, 1, 1] == pytest.approx(speed - impulse / mass, abs=1e-9)
    assert context.recording.angular_velocity[-1, 0, 2] == pytest.approx(struck, abs=1e-6)


@pytest.mark.parametrize("rate", [60, 90, 240])
def test_a_sprung_slider_launches_a_ball_where_its_force_ends(rate: int) -> None:
    """A ball leaves the slider that pushes it at the spring's rest, with the speed of both as one mass."""
    slider, mass, stiffness, way = rod("slider", ORIGIN, (0.05,) * 3), 0.5, 100.0, 0.2
    thrown = solid("ball", Sphere(0.05), (0.1, 0.0, 0.0), mass)
    joint = BodyJoint(
        "joint", "slider", "", "slider", ORIGIN, (1.0, 0.0, 0.0), stiffness=stiffness, target=way
    )
    context = play(scene([slider, thrown], [joint], 0.3, gravity=ORIGIN, frame_rate=rate), rate=rate)
    speed = way * np.sqrt(stiffness / (1.0 + mass))
    assert context.recording.linear_velocity[-1, 1, 0] == pytest.approx(speed, abs=20 / rate**3)


@pytest.mark.parametrize("seconds", [1.0, pytest.param(inf, marks=pytest.mark.slow)])
@pytest.mark.parametrize("profile", FARTHEST)
@pytest.mark.parametrize("name", JOINED)
def test_mechanisms_follow_their_truths(name: str, profile: str, seconds: float) -> None:
    """Pendulums, loops, couplings, springs, dampers, motors and grippers move as integrated; joints hold, and
    what is conservative keeps its energy."""
    duration = min(seconds, JOINED[name].duration)
    scenario = replace(JOINED[name], duration=duration, expectations=(), published=(), forces=())
    context = play(scenario, profile)
    most = HELD.get(name, FARTHEST[profile])
    for body, truth in context.truths.items():
        np.testing.assert_allclose(context.mass_centers[:, body], truth.position, atol=most)
    assert drift(context) < 1e-12
    if "conservative" in context.scenario.tags:
        assert np.ptp(energy(context)) < 2 * FARTHEST[profile]


def test_pendulums_keep_their_energy_for_a_minute() -> None:
    scenario = replace(catalogue()["pendulums"], duration=60.0, truths=(), published=())
    context = play(scenario)
    assert np.ptp(energy(context)) < 1e-6 * 9.81
    assert drift(context) < 1e-12


def test_the_direction_of_a_joint_does_not_matter() -> None:
    scenario = replace(catalogue()["double_pendulum"], truths=())
    first, second = scenario.body_joints
    other = replace(scenario, body_joints=(first, reversed_joint(second)))
    one, two = (play(scene).recording.position for scene in (scenario, other))
    assert two == pytest.approx(one, abs=1e-12)


def test_every_loop_of_a_mechanism_stays_closed() -> None:
    """Seventeen pairs of rods on one free body, each closed by a ball joint: 51 constraints on 108 rates."""
    bodies = [rod("hub", (0.0, 0.0, 0.0), (1.0, 0.1, 0.1), mass=20.0, angular_velocity=(2.0, 0.0, 0.0))]
    joints = []
    for k, x in enumerate(np.linspace(-0.96, 0.96, 17)):
        for name, y in (("left", -0.25), ("right", 0.25)):
            lean = np.arctan2(0.5, -np.sign(y) * 0.25) / 2
            turn = (np.cos(lean), np.sin(lean), 0.0, 0.0)
            velocity = tuple(np.cross((2.0, 0.0, 0.0), (x, y, 0.5)).tolist())
            bodies.append(
                rod(
                    f"{name}{k:02d}",
                    (x, y, 0.5),
                    (0.01, 0.2, 0.01),
                    orientation=turn,
                    linear_velocity=velocity,
                    angular_velocity=(2.0, 0.0, 0.0),
                )
            )
            joints.append(BodyJoint(f"{name}{k}", "ball", "hub", bodies[-1].name, (x, 2 * y, 0.0)))
        joints.append(BodyJoint(f"top{k}", "ball", f"left{k:02d}", f"right{k:02d}", (x, 0.0, 1.0)))
    scenario = scene(bodies, joints, 0.25)
    context = play(scenario)
    assert drift(context) < 1e-12
    assert np.ptp(energy(context)) < 1e-8 * 9.81


@pytest.mark.parametrize("kind", ["hinge", "ball", "fixed"])
def test_a_loop_closed_twice_moves_as_one_closed_once(kind: str) -> None:
    base = replace(catalogue()["four_bar"], duration=1.0, truths=())
    # a second joint at the same place repeats the constraints of the first
    bodies, again = base.bodies, replace(base.body_joints[3], name="again", type=kind)
    if kind == "fixed":
        x, y, z = bodies[0].position
        light = {"mass": 1e-9, "inertia": sphere_inertia(1e-9, 0.1)}
        bodies = (*bodies, replace(bodies[0], name="plate", position=(x, y - 0.2, z), **light))
        again = BodyJoint("again", "fixed", bodies[0].name, "plate", bodies[0].position)
    other = replace(base, bodies=bodies, body_joints=(*base.body_joints, again))
    one, two = (play(scene).recording.position[:, :3] for scene in (base, other))
    assert two == pytest.approx(one, abs=1e-8)


def test_coupled_joints_of_a_free_mechanism_keep_its_momenta() -> None:
    """A slider and a hinge on one free body, coupled: forces of the coupling are inner ones; so are those
    between two free mechanisms, which keep the momentum of each."""
    base = rod("base", (0.0, 0.0, 0.0), (0.3, 0.05, 0.05), angular_velocity=(0.3, 0.0, 0.2))
    arm = rod("arm", (0.0, 0.0, 0.5), (0.02, 0.03, 0.3), angular_velocity=(0.3, 2.0, 0.2))
    cart = rod("cart", (0.0, -0.4, 0.0), (0.05, 0.05, 0.05), angular_velocity=(0.3, 0.0, 0.2))
    arm = replace(arm, linear_velocity=tuple(np.cross(arm.angular_velocity, arm.position).tolist()))
    along = np.cross(cart.angular_velocity, cart.position) + (0.6, 0.0, 0.0)
    cart = replace(cart, linear_velocity=tuple(along.tolist()))
    joints = [
        BodyJoint("hinge", "hinge", "base", "arm", (0.0, 0.0, 0.0), Y),
        BodyJoint(
            "rack", "slider", "base", "cart", (0.0, -0.4, 0.0), (1.0, 0.0, 0.0), mimics="hinge", ratio=0.3
        ),
    ]
    other = [
        rod("far", (3.0, 0.0, 0.0), (0.3, 0.05, 0.05)),
        rod("lever", (3.3, 0.0, 0.0), (0.2, 0.1, 0.05), angular_velocity=(0.0, 0.0, 4.0)),
    ]
    gear = BodyJoint(
        "gear", "hinge", "far", "lever", (3.3, 0.0, 0.0), (0.0, 0.0, 1.0), mimics="hinge", ratio=2.0
    )
    scenario = scene([base, arm, cart, *other], [*joints, gear], 1.0, gravity=(0.0, 0.0, 0.0))
    context = play(scenario)
    for group in ([0, 1, 2], [3, 4]):
        assert np.ptp(momenta(context, group), axis=1).max() < 1e-9
    assert np.ptp(energy(context)) < 1e-8
    omega = context.recording.angular_velocity
    back = Rotation.from_quat(context.recording.orientation[:, 0], scalar_first=True).inv()
    hinge = back.apply(omega[:, 1] - omega[:, 0])[:, 1]
    assert np.ptp(hinge) > 0.1
    assert omega[:, 4, 2] - omega[:, 3, 2] == pytest.approx(2 * hinge, abs=1e-12)


def test_a_limit_stops_a_hinge_and_holds_it() -> None:
    body = rod("rod", (0.5, 0.0, 0.0), (0.5, 0.02, 0.02))
    joint = BodyJoint("pivot", "hinge", "", "rod", (0.0, 0.0, 0.0), Y, lower=-1.0, upper=0.5)
    motion = play(scene([body], [joint], 2.0)).recording
    angle = 2 * np.arctan2(motion.orientation[:, 0, 2], motion.orientation[:, 0, 0])
    assert angle.max() <= 0.5 + 1e-9
    assert angle[-60:] == pytest.approx(np.full(60, 0.5), abs=1e-9)
    assert np.abs(motion.angular_velocity[-60:]).max() < 1e-12


@pytest.mark.parametrize(("stiffness", "damping"), [(1e12, 0.0), (0.0, 1e9), (1e12, 1e8)])
def test_what_is_too_stiff_for_explicit_steps_stays_where_it_is(stiffness: float, damping: float) -> None:
    body = rod("rod", (0.5, 0.0, 0.0), (0.5, 0.02, 0.02))
    joint = BodyJoint("pivot", "hinge", "", "rod", (0.0, 0.0, 0.0), Y, stiffness=stiffness, damping=damping)
    motion = play(scene([body], [joint], 0.5)).recording
    assert np.abs(motion.position[:, 0, 2]).max() < 1e-6


def standing(stiffness: float, damping: float, foot: float, duration: float, **fields: object) -> Scenario:
    """A trunk of 5 kg, 30 mm in front of its ankle, on a foot on the floor."""
    sole = rod("foot", (0.0, 0.0, 0.02), (0.15, 0.1, 0.02), mass=foot)
    trunk = rod("trunk", (0.03, 0.0, 0.4), (0.1, 0.1, 0.1), mass=5.0)
    ankle = BodyJoint("ankle", "hinge", "foot", "trunk", (0.0, 0.0, 0.04), Y)
    ankle = replace(ankle, stiffness=stiffness, damping=damping, **fields)  # type: ignore[arg-type]
    return scene([FLOOR, sole, trunk], [ankle], duration)


@pytest.mark.parametrize("stiffness", [30.0, 1e3, 1e5, 1e8])
def test_a_servo_holds_a_trunk_on_a_light_foot(stiffness: float) -> None:
    """The foot stays where it is; the trunk follows its equation of motion to first order, and ends where the
    torques are in balance."""
    arm, lean = np.hypot(0.03, 0.36), np.arctan2(0.03, 0.36)
    inertia = 5 * (arm**2 + 2 * 0.1**2 / 3)
    damping = 2 * np.sqrt(stiffness * inertia)

    def law(_: float, y: Array) -> tuple[float, float]:
        torque = 5 * 9.81 * arm * np.sin(lean + y[0]) - stiffness * y[0] - damping * y[1]
        return y[1], torque / inertia

    times = np.arange(121) / 60
    true = solve_ivp(law, (0.0, 2.0), (0.0, 0.0), "Radau", times, rtol=1e-10, atol=1e-14).y[0]
    way, errors = arm * (np.sin(lean + true) - np.sin(lean)), []
    for n in (1, 2):
        motion = play(standing(stiffness, damping, 0.2, 2.0), rate=60 * n).recording
        assert np.abs(motion.position[:, 1] - (0.0, 0.0, 0.02)).max() < 1.1e-9
        errors.append(np.abs(motion.position[:, 2, 0] - 0.03 - way))
    assert errors[0][-1] < 2e-3 * way[-1] + 1e-8
    # in a step much longer than its own time, the servo reaches its end at once
    if stiffness <= 1e3:
        assert errors[0].max() < 0.1 * way[-1]
        assert errors[1].max() < 0.55 * errors[0].max()


def test_a_stiff_spring_on_a_standing_foot_keeps_its_energy() -> None:
    context = play(standing(1e4, 0.0, 5.0, 2.0))
    turned = context.recording.orientation[:, 2]
    bent = 2 * np.arctan2(turned[:, 2], turned[:, 0])
    assert np.ptp(bent) > 1e-4
    assert np.ptp(energy(context)) < 1e-2 * 1e4 * bent.max() ** 2 / 2


def test_a_bound_that_is_never_reached_changes_nothing() -> None:
    free, bounded = (
        play(standing(2000.0, 80.0, 0.2, 0.5, **fields)).recording for fields in ({}, {"largest_force": 60.0})
    )
    assert (free.position == bounded.position).all()


def test_a_rod_on_a_hinge_rests_on_the_floor() -> None:
    body = rod("rod", (0.5, 0.0, 0.5), (0.5, 0.02, 0.02))
    scenario = scene([FLOOR, body], [BodyJoint("pivot", "hinge", "", "rod", (0.0, 0.0, 0.5), Y)], 2.0)
    motion = play(scenario).recording
    angle = 2 * np.arctan2(motion.orientation[-1, 1, 2], motion.orientation[-1, 1, 0])
    assert 0 <= 0.5 - np.sin(angle) - 0.02 * np.cos(angle) < 2e-9
    assert np.abs(motion.angular_velocity[-1]).max() < 1e-12


def test_a_seesaw_with_equal_weights_stays_level_and_tips_under_one() -> None:
    plank = rod("plank", (0.0, 0.0, 0.5), (0.6, 0.1, 0.02), mass=2.0)
    weights = [rod(name, (x, 0.0, 0.57), (0.05, 0.05, 0.05)) for name, x in (("one", 0.4), ("two", -0.4))]
    pivot = BodyJoint("pivot", "hinge", "", "plank", (0.0, 0.0, 0.5), Y)
    level = play(scene([FLOOR, plank, *weights], [pivot], 2.0)).recording
    assert np.abs(level.linear_velocity).max() < 1e-12
    tipped = play(scene([FLOOR, plank, weights[0]], [pivot], 2.0)).recording
    assert tipped.position[-1, 2, 2] < 0.1


def assert_kept(scenario: Scenario) -> None:
    """Play a random mechanism, which keeps what free bodies keep, and stays joined."""
    context = play(scenario)
    found = judge_random(context.recording, scenario, EXACT, "", "")
    assert found.outcome == "ok", found
    assert drift(context) < 1e-12


@pytest.mark.parametrize(
    ("kind", "seed"),
    [("mechanism", seed) for seed in (1, 29, 61, 89, *range(900, 905))]
    + [("servo", seed) for seed in (35, 49, 138, *range(900, 905))],
)
def test_a_random_mechanism_keeps_what_free_bodies_keep(kind: str, seed: int) -> None:
    """It gains no energy, overlaps nothing, leaves no residual, and stays joined; 29 and 61 hit limits at
    200 rad/s, 89 bounces with friction, 1 is a jam that turns fast; servos are soft to all but rigid."""
    assert_kept(random_scene(seed, kind))


@pytest.mark.parametrize("kind", ["mechanism", "servo"])
@pytest.mark.parametrize("seed", [3, 900, 903])
def test_a_random_mechanism_with_a_coupling_keeps_as_much(kind: str, seed: int) -> None:
    """Two of its joints are coupled: with limits, contact and springs it has the same guarantees."""
    scenario = random_scene(seed, kind)
    first, second = [one for one in scenario.body_joints if one.type in ALONG_AXIS][:2]
    coupled = replace(second, mimics=first.name, ratio=-2.0)
    joints = tuple(coupled if one is second else one for one in scenario.body_joints)
    assert_kept(replace(scenario, body_joints=joints))


def legs(friction: float, damping: float = 0.0) -> Scenario:
    """Two legs of 1 and 3 kg, joined at the top, whose feet part on the floor."""
    top, feet = np.array((0.0, 0.0, 1.0)), {"one": -0.6, "two": 0.9}
    bodies = [FLOOR]
    for (name, x), mass in zip(feet.items(), (1.0, 3.0)):
        way = np.array((x, 0.0, 0.05)) - top
        length = float(np.linalg.norm(way))
        a, b, c, d = Rotation.align_vectors([way / length], [[0.0, 0.0, 1.0]])[0].as_quat(scalar_first=True)
        across = mass * length**2 / 12
        inertia = ((across, 0.0, 0.0), (0.0, across, 0.0), (0.0, 0.0, 0.002 * mass))
        foot = (Piece("foot", Sphere(0.05), (0.0, 0.0, length / 2)),)
        x, y, z = (top + way / 2).tolist()
        bodies.append(Body(
            name, "simulated", "steel", foot, mass, inertia=inertia, position=(x, y, z),
            orientation=(float(a), float(b), float(c), float(d)),
        ))  # fmt: skip
    joint = BodyJoint("top", "hinge", "one", "two", (0.0, 0.0, 1.0), Y, damping=damping)
    law = (PairCoefficients("steel", "steel", 0.0, friction),)
    return scene(bodies, [joint], 0.3, coefficients=law)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_contact_on_turning_limbs_is_of_second_order(friction: float) -> None:
    ends = {n: play(legs(friction), rate=60 * n).recording.position[-1] for n in (2, 4, 16)}
    errors = [np.abs(ends[n] - ends[16]).max() for n in (2, 4)]
    assert errors[0] < 2e-5
    assert errors[0] / errors[1] > 3.5


def test_legs_that_part_without_friction_keep_energy_and_stay_where_they_are() -> None:
    context = play(legs(0.0))
    total = energy(context)
    assert np.abs(total / total[0] - 1).max() < 1e-8
    assert np.abs(context.recording.linear_velocity[:, 1:, 0] @ (1.0, 3.0)).max() < 2e-3


def test_the_guard_returns_no_energy_that_a_damper_took() -> None:
    """Without friction, the momentum along the floor stays 0 while a damper takes energy."""
    context = play(legs(0.0, damping=1.0))
    assert np.ptp(energy(context)) > 0.5
    assert np.abs(context.recording.linear_velocity[:, 1:, 0] @ (1.0, 3.0)).max() < 2e-3


def cart(lean: float, speed: float, left: float = 10.0) -> Scenario:
    """Two motored wheels, which lean against their axle, roll and push a caster that slides ahead; `left` is
    the rate of the left motor."""
    turn = Rotation.from_rotvec((np.pi / 2 + lean, 0.0, 0.0)).as_quat(scalar_first=True)
    caster, forward = Piece("caster", Sphere(0.02), position=(0.12, 0.0, -0.06)), (speed, 0.0, 0.0)
    chassis = rod("chassis", (0.0, 0.0, 0.08), (0.15, 0.1, 0.04), mass=3.0, linear_velocity=forward)
    bodies, joints = [FLOOR, replace(chassis, pieces=(*chassis.pieces, caster))], []
    for name, y, rate in (("left", 0.12, left), ("right", -0.12, 10.0)):
        rolls, place = (0.0, speed / 0.08, 0.0), (-0.08, y, 0.08)
        piece = Piece("wheel", Cylinder(0.08, 0.015), orientation=tuple(turn.tolist()))
        middle, inertia = uniform((piece,), 0.3)
        bodies.append(
            Body(
                name,
                "simulated",
                "steel",
                (piece,),
                0.3,
                middle,
                inertia,
                place,
                (1.0, 0.0, 0.0, 0.0),
                forward,
                rolls,
            )
        )
        joints.append(BodyJoint(name, "hinge", "chassis", name, place, Y, damping=0.5, target_rate=rate))
    return scene(bodies, joints, 4.0, coefficients=(PairCoefficients("steel", "steel", 0.0, 1.0),))


@pytest.mark.parametrize(("lean", "error"), [(0.0, 1e-7), (1.5e-4, 2e-3)])
def test_a_cart_drives_as_fast_as_its_motors_push_its_caster(lean: float, error: float) -> None:
    """The caster bears the chassis with 0.08 of 0.2 m of its lever. Wheels that lean run on one rim, then on
    the other: impacts of 1e-4 m/s, in which their motors, too fast for a step, take part."""
    drag = 3.0 * 9.81 * 0.08 / 0.2
    speed = 0.08 * (10.0 - 0.08 * drag / (2 * 0.5))
    driven = play(cart(lean, speed)).recording
    np.testing.assert_allclose(driven.linear_velocity[:, 1, 0], speed, rtol=error)
    assert np.abs(driven.position[:, 1, 1]).max() < (0.02 if lean else 1e-9)
    assert work_of(driven)["dropped_time"].sum() == 0


def work_of(driven: Recording) -> dict[str, Array]:
    """Counters by name."""
    return dict(zip(driven.work_names.tolist(), driven.work.T))


def test_line_contacts_of_wheels_that_turn_are_solved() -> None:
    """Four ends of line contacts and a caster are more than the degrees of freedom of a cart, and their
    predicted velocities differ. Where one side is slower, all slip in directions of their own."""
    turns, pace = replace(cart(0.0, 0.6, left=5.0), duration=3.0), []
    for rate in (60, 240):
        driven = play(turns, rate=rate).recording
        work = work_of(driven)
        assert work["unconverged"].sum() == 0
        assert work["residual"].max() < 1e-9
        assert work["dropped_time"].max() == 0
        pace.append(driven.angular_velocity[-1, 1, 2])
    assert pace[0] == pytest.approx(pace[1], rel=5e-3)


def car() -> Scenario:
    """Two motored wheels push a chassis whose front wheels turn on sprung steering knuckles."""
    bodies, joints = [FLOOR, rod("chassis", (0.0, 0.0, 0.1), (0.2, 0.1, 0.04), mass=4.0)], []
    turn = Rotation.from_rotvec((np.pi / 2, 0.0, 0.0)).as_quat(scalar_first=True)
    for x, y in ((-0.13, -0.14), (-0.13, 0.14), (0.13, -0.14), (0.13, 0.14)):
        name, place, inner = f"wheel {x} {y}", (x, y, 0.08), (x, 0.8 * y, 0.08)
        piece = Piece("tyre", Cylinder(0.08, 0.02), orientation=tuple(turn.tolist()))
        middle, inertia = uniform((piece,), 0.4)
        bodies.append(Body(name, "simulated", "steel", (piece,), 0.4, middle, inertia, place))
        if x < 0:
            motored = BodyJoint(name, "hinge", "chassis", name, place, Y, damping=0.5, target_rate=8.0)
            joints.append(motored)
        else:
            knuckle = rod(f"knuckle {y}", inner, (0.02, 0.01, 0.02), mass=0.2)
            bodies.append(knuckle)
            sprung = BodyJoint(
                knuckle.name,
                "hinge",
                "chassis",
                knuckle.name,
                inner,
                (0.0, 0.0, 1.0),
                stiffness=50.0,
                damping=1.0,
            )
            joints += [sprung, BodyJoint(name, "hinge", knuckle.name, name, place, Y, damping=0.002)]
    return scene(bodies, joints, 3.0)


def test_all_rims_of_a_car_press_and_it_drives_straight() -> None:
    """Eight ends of line contacts leave five loads free; each bears its share, and none steers."""
    driven = play(car()).recording
    assert work_of(driven)["residual"].max() < 1e-8
    assert np.abs(driven.position[:, 1, 1]).max() < 1e-6
    last = driven.contacts[driven.contacts["time"] > 2.95]
    loads = [last["impulse"][last["body_b"] == wheel][:, 2] for wheel in np.unique(last["body_b"])]
    assert len(loads) == 4
    assert all(rims.min() > 0.9 * rims.max() for rims in loads)


def test_what_the_reference_cannot_represent_is_named() -> None:
    with pytest.raises(Unsupported, match="profile paper has no joints between bodies"):
        play(catalogue()["double_pendulum"], "paper")
    bodies = [rod(f"b{k:03d}", (0.2 * k, 0.0, 0.0), (0.1, 0.01, 0.01)) for k in range(130)]
    joints = [
        BodyJoint(f"j{k}", "hinge", f"b{k - 1:03d}" if k else "", f"b{k:03d}", (0.2 * k - 0.1, 0.0, 0.0), Y)
        for k in range(130)
    ]
    with pytest.raises(AdapterError, match="more than 120 degrees of freedom in one mechanism"):
        play(scene(bodies, joints, 1.0))

"""Truths of mechanisms against closed forms, other coordinates and another library.

A test of one scene has its name as a parameter: the worker that runs all tests of it integrates it once.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.families.mechanisms import (
    ACROSS,
    PERIOD,
    SLOPE,
    SMOOTH,
    mechanism,
    pendulum_length,
    rod,
)
from touchstone.scenarios.families.squeezer import END, SIZE, STRUT, places, squeezer
from touchstone.scenarios.relations.changes import heavier, rescaled, rotated
from touchstone.scenarios.scenario import GRAVITY, BodyJoint, Scenario, ScenarioError, Tracker, Truth
from touchstone.scenarios.solids import ball, block
from touchstone.scenarios.transforms import mirrored, permuted, translated
from touchstone.scenarios.truths.body_motion import Motion
from touchstone.scenarios.truths.mechanism import Mechanism, played

SCENES = [s.name for s in tagged("joints") if {truth.law for truth in s.truths} == {"mechanism"}]
INTEGRATED = 1e-10
"""What an integration of relative tolerance 1e-12 adds up to over some hundred steps [1]."""
ORIGIN = (0.0, 0.0, 0.0)


@cache
def truth_of(name: str, body: str) -> Motion:
    """The truth of a body of a scene in its displayed frames."""
    return motions(catalogue()[name])[body]


def frames(scene: Scenario) -> np.ndarray:
    """Times of the displayed frames [s]."""
    return np.arange(scene.frame_count + 1) / scene.frame_rate


def motions(scene: Scenario) -> dict[str, Motion]:
    """Motion of every body with a truth."""
    return {truth.body: motion(scene, truth, frames(scene)) for truth in scene.truths}


def with_truths(scene: Scenario) -> Scenario:
    """A changed scene whose bodies have truths again."""
    simulated = [body.name for body in scene.bodies if body.kind == "simulated"]
    return replace(scene, truths=tuple(Truth(name, "mechanism") for name in simulated))


def angle_of(found: Motion) -> np.ndarray:
    """Angle about y of a body that starts in any orientation (n,) [rad]."""
    turned = Rotation.from_quat(found.orientation, scalar_first=True)
    return np.unwrap((turned * turned[0].inv()).as_rotvec()[:, 1])


@pytest.mark.parametrize("name", SCENES)
def test_joints_hold(name: str) -> None:
    """Keep anchors, axes and velocities of every joint to rounding, closed loops included."""
    scene = catalogue()[name]
    for one in played(scene):
        for time in np.linspace(0.0, scene.duration, 50):
            state = one.solution(time)
            moved = one.mechanism.unpacked(time, state)[:3]
            rows = one.mechanism.rows(*moved, state[13 * len(one.mechanism.names) :])[0]
            assert np.abs(rows.error).max() < 1e-11
            assert np.abs(rows.rate).max() < 2e-10


@pytest.mark.parametrize("degrees", [30, 90, 150])
@pytest.mark.parametrize("name", ["pendulums"])
def test_a_pendulum_has_the_period_of_the_elliptic_integral(name: str, degrees: int) -> None:
    """Pass the lowest place after a quarter of a period, and come back after a whole one."""
    scene, bob = catalogue()[name], f"bob_{degrees}"
    quarters = PERIOD * np.array([0.0, 0.25, 0.5, 1.0])
    found = motion(scene, next(truth for truth in scene.truths if truth.body == bob), quarters)
    start = found.position[0] - (0.0, found.position[0, 1], 0.0)
    places = found.position - (0.0, found.position[0, 1], 0.0)
    expected = [start, (0.0, 0.0, -np.linalg.norm(start)), start * (-1.0, 1.0, 1.0), start]
    np.testing.assert_allclose(places, expected, atol=INTEGRATED)
    # the length of oscillation of a ball is that of the simple pendulum
    arm, radius = np.linalg.norm(start), 0.05
    assert arm + 2 / 5 * radius**2 / arm == pytest.approx(pendulum_length(np.radians(degrees)), rel=1e-12)


@pytest.mark.parametrize("name", ["slider_spring"])
def test_a_spring_with_a_damper_swings_by_its_closed_form(name: str) -> None:
    """Follow q = q_0 (1 - exp(-d t) (cos w t + d / w sin w t)) with q_0 = m g sin / k."""
    scene, found = catalogue()[name], truth_of(name, "block")
    joint, mass = scene.body_joints[0], scene.bodies[0].mass
    d = joint.damping / (2 * mass)
    w, t = np.sqrt(joint.stiffness / mass - d**2), frames(scene)
    rest = mass * GRAVITY * np.sin(SLOPE) / joint.stiffness
    expected = rest * (1 - np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t)))
    np.testing.assert_allclose(found.position @ np.array(joint.axis), expected, atol=1e-13)


@pytest.mark.parametrize("name", ["motor_hinge"])
def test_a_motor_is_bound_by_its_largest_torque(name: str) -> None:
    """Speed up evenly while the torque is at its bound, then approach the target exponentially."""
    scene, found = catalogue()[name], truth_of(name, "wheel")
    joint, moment = scene.body_joints[0], scene.bodies[0].inertia[2][2]
    free = joint.target_rate - joint.largest_force / joint.damping
    until, t = free * moment / joint.largest_force, frames(scene)
    later = joint.target_rate - (joint.target_rate - free) * np.exp(
        -joint.damping / moment * np.maximum(t - until, 0)
    )
    expected = np.where(t < until, joint.largest_force / moment * t, later)
    np.testing.assert_allclose(found.angular_velocity @ np.array(joint.axis), expected, atol=1e-10)


def pendulum_on_cart() -> Scenario:
    """A rod hangs from a cart that a prescribed path moves to and fro, up to 3.75 m/s2."""
    times = (0.0, 0.8, 1.6, 2.4, 3.2)
    tracker = Tracker(
        "cart",
        (),
        times,
        tuple((0.4 * (k % 2), 0.0, 0.0) for k in range(len(times))),
        ((1.0, 0.0, 0.0, 0.0),) * len(times),
        ((),) * len(times),
        interpolation="cubic",
    )
    cart = block("cart", "steel", (0.15, 0.1, 0.05), kind="prescribed")
    body = rod("rod", (0.0, 0.0, 0.0), (0.0, 0.0, -0.5))
    joint = BodyJoint("hinge", "hinge", "cart", "rod", (0.0, 0.0, 0.0), ACROSS)
    summary = "a rod hangs from a cart that moves to and fro"
    return mechanism("pendulum_on_cart", summary, [cart, body], [joint], 3.0, trackers=(tracker,))


def test_a_rod_on_a_cart_feels_its_acceleration() -> None:
    """Match 2/3 l a'' = -g sin a - x'' cos a with the second derivative of the cart's path."""
    scene = pendulum_on_cart()
    found = motions(scene)["rod"]

    def rate(t: float, y: np.ndarray) -> tuple[float, float]:
        part, since = divmod(t, 0.8)
        pull = (-1) ** part * 3.75 * (1 - 2 * since / 0.8)
        return y[1], -1.5 / 0.5 * (GRAVITY * np.sin(y[0]) + pull * np.cos(y[0]))

    run = solve_ivp(
        rate, (0, scene.duration), (0.0, 0.0), "DOP853", frames(scene), rtol=1e-13, atol=1e-14, max_step=5e-3
    )
    # positive about -y: from z = -1 towards x
    np.testing.assert_allclose(-angle_of(found), run.y[0], atol=1e-9)


def test_a_turning_support_carries_what_hangs_on_it() -> None:
    """Match the pendulum in a plane that turns: a'' = w^2 sin a cos a - g / l sin a, for a small bob."""
    times, rate, radius = np.arange(31) / 10, 4.0, 1e-3
    turns = [(float(np.cos(rate * t / 2)), 0.0, 0.0, float(np.sin(rate * t / 2))) for t in times]
    tracker = Tracker(
        "post", (), tuple(times.tolist()), (ORIGIN,) * 31, tuple(turns), ((),) * 31, interpolation="cubic"
    )
    start = (np.sin(0.5), 0.0, -np.cos(0.5))
    bob = replace(
        ball("bob", "steel", radius, 1.0, start),
        linear_velocity=(0.0, rate * start[0], 0.0),
        angular_velocity=(0.0, 0.0, rate),
    )
    post = block("post", "steel", (0.1, 0.1, 0.1), kind="prescribed")
    joint = BodyJoint("hinge", "hinge", "post", "bob", ORIGIN, ACROSS)
    scene = mechanism("turned", "", [post, bob], [joint], 2.0, trackers=(tracker,))
    found = motions(scene)["bob"]
    length = 1 + 2 / 5 * radius**2

    def law(_: float, y: np.ndarray) -> tuple[float, float]:
        a, va = y
        return va, (rate**2 * np.sin(a) * np.cos(a) - GRAVITY * np.sin(a)) / length

    run = solve_ivp(law, (0, 2), (0.5, 0), "DOP853", frames(scene), rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(np.arccos(-found.position[:, 2]), np.abs(run.y[0]), atol=1e-8)


@pytest.mark.parametrize("name", ["squeezer"])
def test_the_squeezer_ends_as_published(name: str) -> None:
    """Reach the published angles of the IVP test set, extrapolated to a strut without mass."""
    found = []
    for scene in (catalogue()[name], squeezer(2 * STRUT)):
        found.append([motion(scene, truth, np.array([3.0])).position[0] for truth in scene.truths[:7]])
    ends = np.array([(SIZE * x, 0.0, SIZE * z) for x, z in places(END)[1].values()])
    ends[:, 1] = [body.position[1] for body in scene.bodies[:7]]
    # what is linear in the mass is gone; the rest is its square, 1e-7 of lengths of 0.1 m
    np.testing.assert_allclose(2 * np.array(found[0]) - found[1], ends, atol=1e-7)


def random_tree(seed: int) -> Scenario:
    """Eight bodies with random masses, places, hinges, sliders, ball and fixed joints, at random rates."""
    rng = np.random.default_rng(seed)
    bodies, joints, pace = [], [], {}
    for k in range(8):
        name, place = f"b{k}", rng.normal(size=3)
        parent = f"b{rng.integers(k)}" if k else ""
        kind = ("hinge", "slider", "ball", "fixed")[rng.integers(4)] if k else "hinge"
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        anchor = rng.normal(size=3)
        v, w, at = pace.get(parent, (np.zeros(3), np.zeros(3), np.zeros(3)))
        v = v + np.cross(w, anchor - at)
        rate = rng.normal()
        w = w + {"hinge": rate * axis, "ball": rng.normal(size=3)}.get(kind, 0.0)
        v = v + (rate * axis if kind == "slider" else 0.0) + np.cross(w, place - anchor)
        pace[name] = (v, w, place)
        turn = Rotation.random(random_state=rng).as_quat(scalar_first=True)
        half = tuple(rng.uniform(0.05, 0.3, 3).tolist())
        body = block(
            name, "steel", half, float(rng.uniform(0.5, 3)), tuple(place.tolist()), tuple(turn.tolist())
        )
        bodies.append(replace(body, linear_velocity=tuple(v.tolist()), angular_velocity=tuple(w.tolist())))
        joints.append(BodyJoint(name, kind, parent, name, tuple(anchor.tolist()), tuple(axis.tolist())))
    return Scenario("tree", "", (), tuple(bodies), 1.0, SMOOTH, body_joints=tuple(joints), truths=())


@pytest.mark.parametrize("seed", range(5))
def test_accelerations_are_those_of_another_library(seed: int) -> None:
    """Match pinocchio's articulated-body algorithm for a random tree in motion."""
    pin = pytest.importorskip("pinocchio")
    scene = random_tree(seed)
    model, frame, rates = pin.Model(), {"": (0, np.eye(3), np.zeros(3))}, []
    model.gravity.linear = np.array(scene.gravity)
    pace = {"": (np.zeros(3), np.zeros(3))}
    for joint, body in zip(scene.body_joints, scene.bodies):
        # joint frames have the world's axes at the start
        number, _, place = frame[joint.parent]
        anchor, axis = np.array(joint.anchor), np.array(joint.axis)
        where = pin.SE3(np.eye(3), anchor - place)
        turn = Rotation.from_quat(body.orientation, scalar_first=True).as_matrix()
        inertia = pin.Inertia(body.mass, np.zeros(3), turn @ np.array(body.inertia) @ turn.T)
        relative = np.array(body.angular_velocity) - pace[joint.parent][1]
        kind = {
            "hinge": lambda axis=axis: pin.JointModelRevoluteUnaligned(axis),
            "slider": lambda axis=axis: pin.JointModelPrismaticUnaligned(axis),
            "ball": pin.JointModelSpherical,
        }.get(joint.type)
        if kind:
            number = model.addJoint(number, kind(), where, joint.name)
            origin = anchor
            v, w = pace[joint.parent]
            here = v + np.cross(
                w,
                anchor
                - (np.array(scene.bodies[scene.body_index(joint.parent)].position) if joint.parent else 0.0),
            )
            there = np.array(body.linear_velocity) + np.cross(
                body.angular_velocity, anchor - np.array(body.position)
            )
            rates += {
                "hinge": [relative @ axis], "slider": [(there - here) @ axis], "ball": relative.tolist()
            }[joint.type]  # fmt: skip
        else:
            origin = place
        model.appendBodyToJoint(number, inertia, pin.SE3(np.eye(3), np.array(body.position) - origin))
        frame[body.name] = (number, None, origin)
        pace[body.name] = (np.array(body.linear_velocity), np.array(body.angular_velocity))
    data = model.createData()
    q, v = pin.neutral(model), np.array(rates)
    pin.aba(model, data, q, v, np.zeros(model.nv))
    pin.forwardKinematics(model, data, q, v, data.ddq)
    one = Mechanism(scene, scene.body_joints)
    n = len(one.names)
    rate = one.rate(0.0, one.start())
    found, turned = rate[7 * n : 10 * n].reshape(n, 3), rate[10 * n : 13 * n].reshape(n, 3)
    for k, name in enumerate(one.names):
        number, _, origin = frame[name]
        body = scene.bodies[scene.body_index(name)]
        # classical acceleration of the joint's origin, in world axes, carried to the centre of mass
        moved = pin.getClassicalAcceleration(model, data, number, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        w, arm = np.array(body.angular_velocity), np.array(body.position) - origin
        linear = moved.linear + np.cross(moved.angular, arm) + np.cross(w, np.cross(w, arm))
        scale = np.abs(found).max()
        np.testing.assert_allclose(found[k], linear, atol=1e-10 * scale)
        np.testing.assert_allclose(turned[k], moved.angular, atol=1e-10 * np.abs(turned).max())


CHANGED = ("four_bar", "slider_spring", "governor")


@pytest.mark.slow
@pytest.mark.parametrize("name", CHANGED)
def test_changed_scenes_have_changed_motions(name: str) -> None:
    """Integrate the mirrored, moved, permuted, turned, heavier and scaled scene: its motion changes so."""
    scene = replace(catalogue()[name], duration=0.5)
    turn = Rotation.from_rotvec((0.3, -0.5, 0.8))
    mirror, offset = np.diag((-1.0, 1.0, 1.0)), np.array((2.0, -3.0, 0.5))
    plain = motions(scene)
    order = tuple(reversed(range(len(scene.bodies))))
    changed = {
        "mirrored": (mirrored(scene), mirror, -mirror, 0.0, 1.0),
        "moved": (translated(scene, tuple(offset)), np.eye(3), np.eye(3), offset, 1.0),
        "permuted": (permuted(scene, order), np.eye(3), np.eye(3), 0.0, 1.0),
        "turned": (with_truths(rotated(scene, turn)), turn.as_matrix(), turn.as_matrix(), 0.0, 1.0),
        "heavier": (with_truths(heavier(scene, 8.0)), np.eye(3), np.eye(3), 0.0, 1.0),
        "scaled": (with_truths(rescaled(scene, 0.5)), np.eye(3), np.eye(3), 0.0, 0.5),
    }
    for what, (other, vectors, axes, shift, times) in changed.items():
        for body, found in motions(other).items():
            one = plain[body]
            limit = {"atol": 1e-9, "err_msg": f"{what} {body}"}
            np.testing.assert_allclose(found.position, one.position @ vectors.T * times**2 + shift, **limit)
            np.testing.assert_allclose(found.velocity, one.velocity @ vectors.T * times, **limit)
            np.testing.assert_allclose(found.angular_velocity, one.angular_velocity @ axes.T / times, **limit)


def test_a_loop_that_is_doubled_moves_as_before() -> None:
    """Take a joint that is given twice in the least-norm sense."""
    scene = replace(catalogue()["slider_crank"], duration=0.5)
    twice = replace(scene, body_joints=(*scene.body_joints, replace(scene.body_joints[1], name="again")))
    for body, found in motions(twice).items():
        np.testing.assert_allclose(found.position, motions(scene)[body].position, atol=1e-9)


def faulty(**fields: object) -> str:
    """The faults of a pendulum that differs in some fields."""
    scene = catalogue()["slider_spring"]
    with pytest.raises(ScenarioError) as caught:
        replace(scene, **fields)
    return str(caught.value)


def test_what_the_law_does_not_cover_is_refused() -> None:
    """Refuse limits, bodies in no joint and paths whose velocities jump."""
    scene = catalogue()["slider_spring"]
    body, joint = scene.bodies[0], scene.body_joints[0]
    assert "'slider' has limits" in faulty(body_joints=(replace(joint, upper=1.0),))
    free = ball("free", "steel", 0.1, 1.0, (9.0, 0.0, 0.0))
    assert "'free' is simulated and in no joint" in faulty(bodies=(body, free))
    assert "'block' is in no joint" in faulty(body_joints=())
    cart = pendulum_on_cart()
    with pytest.raises(ScenarioError, match="'cart' moves by pchip, expected cubic"):
        replace(cart, trackers=(replace(cart.trackers[0], interpolation="pchip"),))


def test_bodies_that_may_touch_are_refused() -> None:
    """Refuse a motion whose rods come together, with the time."""
    bodies = [rod(f"rod_{k}", (0.3 * k, 0.0, 0.0), (0.3 * k + 0.5, 0.0, 0.1 - k)) for k in range(2)]
    joints = [
        BodyJoint(body.name, "hinge", "", body.name, (0.3 * k, 0.0, 0.0), ACROSS)
        for k, body in enumerate(bodies)
    ]
    scene = mechanism("meet", "", bodies, joints, 1.0)
    with pytest.raises(RuntimeError, match=r"meet: rod_0 and rod_1 may touch at 0\.\d+ s"):
        motions(scene)

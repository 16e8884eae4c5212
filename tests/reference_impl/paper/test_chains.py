"""Chains under profile `paper`: end effector, goal, cyclic coordinate descent, parallel links, order."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core.conventions import DRIVEN
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.kinematics.reach_cone import bone_and_mark, is_inside
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.paper import frame
from touchstone.reference_impl.paper.attraction import ATTRACTION_TIME, attract
from touchstone.reference_impl.paper.ccd_ik import CCD_PASSES, CCD_TOLERANCE, ccd_ik
from touchstone.reference_impl.paper.impulses import normal_velocity
from touchstone.reference_impl.paper.overlap_avoidance import (
    _bring_out,
    _closest_to_root,
    _set_end_effector_and_goal,
    free_driven_objects,
)
from touchstone.scenarios.avatar.chains import hinge_axes
from touchstone.scenarios.scenario import Scenario

CHAIN = 1
"""The left arm."""
FOREARM_RADIUS = 0.04


def build(scenario: Scenario) -> World:
    """A world ready for its first step in profile `paper`."""
    world = translate(scenario)
    world.state["dt"] = 1 / 60
    frame.prepare(*world)
    return world


def forearm_in_a_table(lab: SimpleNamespace, depth: float) -> tuple[World, int]:
    """The left forearm level, so deep in a table that ends before the hand; its body."""
    person = lab.person()
    names = [joint.name for joint in person.joints]
    world = build(person)
    first = world.drivers[0]["chains"][CHAIN, 0]
    # upper arm half-way forward, the elbow makes up for it
    hinges = {joint.name: joint for joint in person.joints}
    axes = hinge_axes(tuple(hinges[name] for name in person.chains[CHAIN].cones[0].joints))
    lifted = Rotation.from_euler("y", -45, degrees=True).as_matrix()
    world.joints["angle"][first : first + 3] = Rotation.from_matrix(axes.T @ lifted @ axes).as_euler("XYZ")
    world.joints["angle"][names.index("left_elbow")] = np.pi / 4
    pose_links(world.bodies, world.joints, world.drivers[0])
    forearm = person.body_index("left_forearm")
    elbow = world.bodies[forearm]["position"].copy()
    top = elbow[2] - FOREARM_RADIUS + depth
    table = lab.block("table", (0.06, 0.3, 0.1), (elbow[0] + 0.13, elbow[1], top - 0.1), kind="fixed")
    built = build(lab.person(bodies=(*person.bodies, table)))
    built.joints["angle"] = world.joints["angle"]
    pose_links(built.bodies, built.joints, built.drivers[0])
    built.state["counters"][:] = 0
    return built, forearm


def test_eq_7_relative_normal_velocity(lab: SimpleNamespace) -> None:
    """v_n = n . v_ab, with the velocities of both surfaces at the contact."""
    world = build(lab.scene(lab.ball("ball", (0.0, 0.0, 0.05)), lab.ground()))
    world.bodies[0]["velocity"], world.bodies[0]["omega"] = (0.3, 0.2, -0.7), (5.0, 0.0, 0.0)
    pair = world.pairs[0]
    pair["body_a"], pair["body_b"], pair["normal"] = 1, 0, (0.6, 0.0, 0.8)
    # their middle counts
    pair["point_a"], pair["point_b"] = (0.0, 0.01, 0.0), (0.0, -0.01, 0.0)
    # omega x r = (5, 0, 0) x (0, 0, -0.05) = (0, 0.25, 0)
    assert normal_velocity(world.bodies, pair) == pytest.approx(0.6 * 0.3 - 0.8 * 0.7, rel=1e-12)


def test_eqs_2_and_3_end_effector_and_goal(lab: SimpleNamespace) -> None:
    """ee = mean of the link's contact points, goal = ee + PD_g, from the pairs as detection leaves them."""
    world, forearm = forearm_in_a_table(lab, 0.005)
    stages = world.of_stages()
    end, _ = detect(stages, DRIVEN, 0)
    link = _closest_to_root(world.bodies, world.pairs, end, 0, CHAIN)
    assert world.joints[link]["child"] == forearm
    _set_end_effector_and_goal(stages, end, 0, CHAIN, link)
    points, numerator, denominator = [], np.zeros(3), 0.0
    for pair in world.pairs[:end]:
        if forearm in (pair["body_a"], pair["body_b"]) and pair["distance"] < 0:
            side, depth = (1, -pair["distance"]) if pair["body_b"] == forearm else (-1, -pair["distance"])
            points.append(pair["point_b" if side > 0 else "point_a"].copy())
            numerator += side * depth**2 * pair["normal"]
            denominator += depth
    assert len(points) > 0
    ee = sum(points) / len(points)
    np.testing.assert_allclose(world.state[0]["point"], ee, atol=1e-15)
    np.testing.assert_allclose(world.state[0]["goal"], ee + numerator / denominator, atol=1e-15)


def test_a_parallel_link_is_translated(lab: SimpleNamespace) -> None:
    """Raise a forearm that lies in a table with its orientation kept, by the joints inwards of its own."""
    world, forearm = forearm_in_a_table(lab, 0.005)
    before, angles = world.bodies[forearm].copy(), world.joints["angle"].copy()
    free_driven_objects(world.of_stages())
    assert world.drivers[0]["is_free"] == 1
    counted = lab.counters(world)
    assert counted["ik.rounds"] >= 1
    assert counted["gave_up"] == counted["way_back"] == counted["rounds"] == 0
    after = world.bodies[forearm]
    assert after["position"][2] - before["position"][2] == pytest.approx(0.005, abs=2e-5)
    # turned by its own contact it would tilt by 0.04
    assert abs(after["rotation"][2, 2] - before["rotation"][2, 2]) < 1e-3
    first, last = world.drivers[0]["chains"][CHAIN]
    turned = world.joints["angle"] - angles
    assert np.abs(turned[first : first + 4]).max() > 5e-3
    assert not turned[first + 4 : last + 1].any()


@pytest.mark.parametrize(("degrees", "is_translated"), [(9.0, True), (11.0, False)])
def test_parallel_means_within_ten_degrees(lab: SimpleNamespace, degrees: float, is_translated: bool) -> None:
    """Take the proximal joint as the end effector where the link is within 10 degrees of the surface."""
    world, forearm = forearm_in_a_table(lab, 0.005)
    body, state = world.bodies[forearm], world.state[0]
    first, along = world.drivers[0]["chains"][CHAIN, 0], body["rotation"] @ body["axis"]
    across = np.cross(along, (0.0, 1.0, 0.0))
    lean = np.radians(degrees)
    way_out = np.sin(lean) * along + np.cos(lean) * across / np.linalg.norm(across)
    touched = body["position"] + 0.1 * along
    state["point"], state["goal"] = touched, touched + 0.002 * way_out
    before = body["position"].copy()
    _bring_out(world.bodies, world.joints, first, int(body["hinge"]), state)
    np.testing.assert_array_equal(state["point"], before if is_translated else touched)


def arm_at(world: World, angles) -> tuple[int, int, np.ndarray]:
    """First and last joint of the left arm, at these angles, and its hand's origin."""
    first, last = map(int, world.drivers[0]["chains"][CHAIN])
    world.joints["angle"][first : last + 1] = angles
    pose_links(world.bodies, world.joints, world.drivers[0])
    return first, last, world.bodies[world.joints[last]["child"]]["position"].copy()


def test_ccd_reaches_goals_from_near(lab: SimpleNamespace) -> None:
    """Bring the hand to within 1e-5 m of 100 goals from 0.1 rad away, within limits."""
    world, rng = build(lab.person()), np.random.default_rng(3)
    state, bend = world.state[0], np.array((0.2, 0.1, 0.0, 0.8, 0.0, 0.0))
    for _ in range(100):
        _, _, goal = arm_at(world, bend + rng.uniform(-0.1, 0.1, 6))
        first, last, hand = arm_at(world, bend)
        state["point"], state["goal"] = hand, goal
        passes, left = ccd_ik(world.bodies, world.joints, first, last, state)
        assert left <= 1e-5
        assert left <= CCD_TOLERANCE or passes == CCD_PASSES
        rows = world.joints[first : last + 1]
        assert ((rows["lower"] <= rows["angle"]) & (rows["angle"] <= rows["upper"])).all()
        assert np.linalg.norm(world.bodies[rows["child"][-1]]["position"] - goal) == pytest.approx(
            left, abs=1e-12
        )


@pytest.mark.parametrize("goal", [(0.0, 0.2, -2.0), (0.0, 0.2, 0.529338), (1e9, 0.0, 0.0), (0.0, -3.0, 3.0)])
def test_ccd_stops_where_the_goal_cannot_be_reached(lab: SimpleNamespace, goal) -> None:
    """End finite and no farther away: a stretched arm, a goal in the shoulder, behind or very far."""
    world = build(lab.person())
    state = world.state[0]
    for angles in (np.zeros(6), np.full(6, 0.1)):
        first, last, hand = arm_at(world, angles)
        state["point"], state["goal"] = hand, goal
        _, left = ccd_ik(world.bodies, world.joints, first, last, state)
        assert np.isfinite(world.joints["angle"]).all()
        assert left <= np.linalg.norm(hand - goal) * (1 + 1e-12)


def test_chains_come_in_random_order(lab: SimpleNamespace) -> None:
    """Draw each of five chains first in some of 50 frames."""
    world = build(lab.person())
    first = set()
    for _ in range(50):
        frame.step(*world)
        first.add(int(world.drivers[0]["order"][0]))
    assert first == set(range(5))


def is_within(world: World, first: int, last: int) -> bool:
    """Whether hinges are within their limits, and ball joints among them within their reach cones."""
    rows, inside = world.joints[first : last + 1], True
    for k in np.flatnonzero(rows["cone_count"]):
        joint, (one, two, three) = rows[k].copy(), rows[k : k + 3].copy()
        for hinge in (one, two, three):
            hinge["cosine"], hinge["sine"] = np.cos(hinge["angle"]), np.sin(hinge["angle"])
        bone_and_mark(one, two, three, joint["bone"], joint["mark"])
        # as far out as rounding of the recovered angles
        joint["bone"] = (1 - 1e-9) * joint["bone"] + 1e-9 * joint["cone_center"]
        inside = inside and is_inside(joint, joint["bone"])
    return inside and bool(((rows["lower"] <= rows["angle"]) & (rows["angle"] <= rows["upper"])).all())


def test_ccd_keeps_limits_and_reach_cones(lab: SimpleNamespace) -> None:
    """Turn the arm towards goals all around the shoulder: no hinge and no bone leaves its limits."""
    world, rng = build(lab.person()), np.random.default_rng(5)
    for _ in range(30):
        first, last, hand = arm_at(world, (0.2, 0.1, 0.0, 0.8, 0.0, 0.0))
        shoulder = world.bodies[world.joints[first]["child"]]["position"]
        world.state[0]["point"], world.state[0]["goal"] = hand, shoulder + rng.normal(size=3)
        ccd_ik(world.bodies, world.joints, first, last, world.state[0])
        assert is_within(world, first, last)


def aimed(lab: SimpleNamespace, wanted: float) -> tuple[World, int, int]:
    """A standing person whose tracker has all hinges of the left arm at one angle; the arm's hinges."""
    world = build(lab.person())
    first, last = map(int, world.drivers[0]["chains"][CHAIN])
    world.joints["target_angle"][first : last + 1] = wanted
    return world, first, last


@pytest.mark.parametrize("frames", [1, 4])
def test_attraction_goes_by_equal_shares_in_equal_times(lab: SimpleNamespace, frames: int) -> None:
    """Leave 1 / e of the way to a tracker at rest after the time of attraction, in however many frames."""
    world, _, last = aimed(lab, 0.1)
    start, h = world.joints["angle"][last], ATTRACTION_TIME / frames
    for _ in range(frames):
        old = world.joints["angle"][last]
        attract(world.joints, world.drivers[0], h)
        assert world.joints["rate"][last] == pytest.approx((world.joints["angle"][last] - old) / h, rel=1e-9)
    assert 0.1 - world.joints["angle"][last] == pytest.approx((0.1 - start) / np.e, rel=1e-12)
    assert ATTRACTION_TIME == 0.1


@pytest.mark.parametrize("wanted", [-3.0, -1.5, 1.5, 3.0])
def test_attraction_keeps_limits_and_reach_cones(lab: SimpleNamespace, wanted: float) -> None:
    """Follow a tracker beyond the limits of all hinges: no hinge and no bone leaves its own."""
    world, first, last = aimed(lab, wanted)
    for _ in range(30):
        attract(world.joints, world.drivers[0], 1 / 60)
        assert is_within(world, first, last)


def test_joints_of_a_hand_take_the_glove_at_once(lab: SimpleNamespace) -> None:
    """Set hinges in no chain to the tracker's angle and rate."""
    world, first, last = aimed(lab, 0.3)
    world.joints["chain"], world.joints["target_rate"][first : last + 1] = -1, 0.7
    attract(world.joints, world.drivers[0], 1 / 60)
    assert (world.joints["angle"][first : last + 1] == 0.3).all()
    assert (world.joints["rate"][first : last + 1] == 0.7).all()

"""Chains under profile `paper`: end effector, goal, cyclic coordinate descent, parallel links, order."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core.conventions import DRIVEN, RANDOM_PRIME
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.paper import frame
from touchstone.reference_impl.paper.attraction import attract
from touchstone.reference_impl.paper.ccd_ik import CCD_PASSES, CCD_TOLERANCE, ccd_ik
from touchstone.reference_impl.paper.impulses import normal_velocity
from touchstone.reference_impl.paper.overlap_avoidance import (
    _closest_to_root,
    _set_end_effector_and_goal,
    _shuffle_chains,
    free_driven_objects,
)
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
    axes = world.joints[first]["cone_axes"]
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
    pair["point_a"] = pair["point_b"] = (0.0, 0.0, 0.0)
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
    """Draw each of five chains first in about a fifth of the frames; the generator is Park & Miller's."""
    world = build(lab.person())
    state, driver = world.state[0], world.drivers[0]
    state["random"] = 1
    first = np.zeros(5)
    for _ in range(2500):
        _shuffle_chains(driver, state)
        assert sorted(driver["order"][:5].tolist()) == [0, 1, 2, 3, 4]
        first[driver["order"][0]] += 1
    # four numbers a frame: the state after 10,000 that Park & Miller give
    assert state["random"] == 1043618065 < RANDOM_PRIME
    assert (abs(first / 2500 - 0.2) < 0.03).all()


def test_joints_are_attracted_to_their_tracker(lab: SimpleNamespace) -> None:
    """Go the share 1 - exp(-h / 0.1 s) of the way to the tracker's angles, within limits, at that rate."""
    world = build(lab.person())
    first, _ = world.drivers[0]["chains"][CHAIN]
    elbow = world.joints[first + 3]
    start = float(elbow["angle"])
    elbow["target_angle"] = start + 0.3
    attract(world.joints, world.drivers[0], 1 / 60)
    assert elbow["angle"] == pytest.approx(start + 0.3 * (1 - np.exp(-1 / 6)), rel=1e-12)
    assert elbow["rate"] == pytest.approx((elbow["angle"] - start) * 60, rel=1e-12)
    elbow["target_angle"] = 1e3
    attract(world.joints, world.drivers[0], 1 / 60)
    assert elbow["angle"] == elbow["upper"]

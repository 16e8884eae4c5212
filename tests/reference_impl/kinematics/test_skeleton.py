"""Kinematics of the hand against scipy and finite differences, its inertia against kinetic energy."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.kinematics.skeleton import (
    composite_inertia,
    joint_space_inertia,
    move_links,
    pose_links,
)
from touchstone.scenarios.catalogue import catalogue

STEP = 1e-6
"""Half width of central differences [s]: their error is about 1e-12 + 1e-16 / 1e-6."""


@pytest.fixture
def hand(lab: SimpleNamespace):
    """The world of `ball_snip` with a random posture and velocity of the hand."""
    world = lab.build(catalogue()["ball_snip"])
    rng = np.random.default_rng(7)
    driver = world.drivers[0]
    driver["position"], driver["velocity"], driver["omega"] = rng.normal(size=(3, 3))
    driver["orientation"] = Rotation.from_quat(rng.normal(size=4)).as_quat(scalar_first=True)
    world.joints["angle"], world.joints["rate"] = rng.normal(size=(2, len(world.joints)))
    pose_links(world.bodies, world.joints, driver)
    move_links(world.bodies, world.joints, driver)
    return world


def links(world) -> list[int]:
    """Indices of the hand's links, palm first."""
    return [int(world.drivers[0]["root"]), *map(int, world.joints["child"])]


def energy(world) -> float:
    """Kinetic energy of the links, one by one."""
    total = 0.0
    for body in world.bodies[links(world)]:
        spin = body["rotation"].T @ body["omega"]
        total += (body["mass"] * body["velocity"] @ body["velocity"] + spin @ body["inertia"] @ spin) / 2
    return total


def test_forward_kinematics_is_the_product_of_rotations(hand) -> None:
    """Pose every link as the product of scipy's rotations along its chain."""
    driver, poses = hand.drivers[0], {}
    root = Rotation.from_quat(driver["orientation"], scalar_first=True)
    poses[int(driver["root"])] = root, driver["position"]
    for joint in hand.joints:
        turned, origin = poses[int(joint["parent"])]
        hinge = Rotation.from_rotvec(joint["angle"] * joint["axis"]) * Rotation.from_matrix(joint["rest"])
        poses[int(joint["child"])] = turned * hinge, origin + turned.apply(joint["position"])
    for body, (turned, origin) in poses.items():
        row = hand.bodies[body]
        np.testing.assert_allclose(row["rotation"], turned.as_matrix(), atol=1e-14)
        quaternion = turned.as_quat(scalar_first=True)
        assert abs(row["orientation"] @ quaternion) == pytest.approx(1, abs=1e-14)
        np.testing.assert_allclose(row["position"], origin, atol=1e-14)
        np.testing.assert_allclose(row["center"], origin + turned.apply(row["center_of_mass"]), atol=1e-14)


def test_link_velocities_are_differences_of_poses(hand) -> None:
    """Match velocities of centres and angular velocities with central differences of the pose."""
    driver = hand.drivers[0]
    position, turned = driver["position"].copy(), Rotation.from_quat(driver["orientation"], scalar_first=True)
    velocity, omega = driver["velocity"].copy(), driver["omega"].copy()
    angle, rows = hand.joints["angle"].copy(), links(hand)
    reported = hand.bodies[rows].copy()
    seen = []
    for t in (-STEP, STEP):
        driver["position"] = position + velocity * t
        driver["orientation"] = (Rotation.from_rotvec(omega * t) * turned).as_quat(scalar_first=True)
        hand.joints["angle"] = angle + hand.joints["rate"] * t
        pose_links(hand.bodies, hand.joints, driver)
        seen.append(hand.bodies[rows].copy())
    moved = (seen[1]["center"] - seen[0]["center"]) / (2 * STEP)
    np.testing.assert_allclose(reported["velocity"], moved, atol=1e-8)
    change = Rotation.from_matrix(seen[1]["rotation"]) * Rotation.from_matrix(seen[0]["rotation"]).inv()
    np.testing.assert_allclose(reported["omega"], change.as_rotvec() / (2 * STEP), atol=1e-8)


def test_composite_inertia_carries_the_energy_of_the_frozen_hand(hand) -> None:
    """Give mass, centre and inertia that tell the energy of the hand moving as one piece."""
    driver = hand.drivers[0]
    hand.joints["rate"] = 0
    move_links(hand.bodies, hand.joints, driver)
    center, inertia = np.zeros(3), np.zeros((3, 3))
    mass = composite_inertia(hand.bodies, hand.joints, driver, center, inertia)
    assert mass == pytest.approx(0.4, rel=1e-14)
    rows = hand.bodies[links(hand)]
    np.testing.assert_allclose(center, rows["mass"] @ rows["center"] / mass, atol=1e-14)
    speed = driver["velocity"] + np.cross(driver["omega"], center - driver["position"])
    reported = (mass * speed @ speed + driver["omega"] @ inertia @ driver["omega"]) / 2
    assert reported == pytest.approx(energy(hand), rel=1e-13)
    np.testing.assert_allclose(inertia, inertia.T, atol=1e-18)


def test_joint_space_inertia_carries_the_energy_of_the_moving_hand(hand) -> None:
    """Give a matrix whose quadratic form is the energy for many velocities."""
    driver, rng = hand.drivers[0], np.random.default_rng(8)
    inertia = joint_space_inertia(hand.bodies, hand.joints, driver)
    np.testing.assert_allclose(inertia, inertia.T, atol=1e-16)
    for _ in range(20):
        rates = rng.normal(size=len(inertia))
        driver["velocity"], driver["omega"], hand.joints["rate"] = rates[:3], rates[3:6], rates[6:]
        move_links(hand.bodies, hand.joints, driver)
        assert rates @ inertia @ rates / 2 == pytest.approx(energy(hand), rel=1e-12)

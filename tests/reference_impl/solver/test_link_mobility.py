"""Effective mass of a link against finite differences of its posture, and the recoil of its chain."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.core.world import PAIR, World
from touchstone.reference_impl.kinematics.skeleton import composite_inertia, pose_links
from touchstone.reference_impl.posture.chain_servo import recoil
from touchstone.reference_impl.solver.link_mobility import chain_inertia, weigh_links
from touchstone.reference_impl.solver.mobility import apply_impulse, contact_mobility, place_contact

FRAME = 1 / 60
TURN = 1e-6
"""Turn of a hinge for finite differences [rad]."""
ARM = (0.3, -0.4, 0.2, 0.8, 0.1, -0.1)


@pytest.fixture
def world(lab: SimpleNamespace) -> World:
    """The person with both arms bent, beside a box that moves freely."""
    box = lab.block("box", (0.1, 0.1, 0.1), (5.0, 0.0, 0.0))
    person = lab.person()
    built = lab.build(lab.person(bodies=(*person.bodies, box)))
    for chain in (1, 2):
        first, last = built.drivers[0]["chains"][chain]
        built.joints["angle"][first : last + 1] = ARM
    pose_links(built.bodies, built.joints, built.drivers[0])
    return built


def touch(world: World, inward: int, point: tuple[float, ...], normal: tuple[float, ...]) -> np.ndarray:
    """The pair of a link of chain 1, counted from the tip, and the box, at a point of the link's frame."""
    link = int(world.joints[world.drivers[0]["chains"][1][1] - inward]["child"])
    pairs = np.zeros(1, PAIR)
    pairs[0]["body_a"], pairs[0]["body_b"] = link, len(world.bodies) - 1
    body = world.bodies[link]
    pairs[0]["point_a"] = pairs[0]["point_b"] = body["position"] + body["rotation"] @ np.array(point)
    pairs[0]["normal"] = np.array(normal) / np.linalg.norm(normal)
    pairs[0]["restitution"] = 0.2
    weigh_links(world.bodies, world.joints, world.drivers, pairs, 1, FRAME)
    return pairs


def slopes(world: World, pair: np.void) -> np.ndarray:
    """Motion of the link's contact point along the normal per turn of each hinge [m/rad]."""
    link, driver = world.bodies[pair["body_a"]], world.drivers[0]
    own = link["rotation"].T @ (pair["point_a"] - link["position"])
    found = np.zeros(len(world.joints))
    for k in range(len(world.joints)):
        places = []
        for side in (1, -1):
            world.joints[k]["angle"] += side * TURN
            pose_links(world.bodies, world.joints, driver)
            places.append(link["position"] + link["rotation"] @ own)
            world.joints[k]["angle"] -= side * TURN
        found[k] = pair["normal"] @ (places[0] - places[1]) / (2 * TURN)
    pose_links(world.bodies, world.joints, driver)
    return found


def test_a_chains_inertia_is_half_the_trace_about_its_first_hinge(world):
    """Add up the links' inertias about the shoulder by NumPy."""
    first, last = world.drivers[0]["chains"][1]
    shoulder = world.bodies[world.joints[first]["child"]]["position"]
    total = np.zeros((3, 3))
    for k in range(first, last + 1):
        link = world.bodies[world.joints[k]["child"]]
        r = link["center"] - shoulder
        total += link["rotation"] @ link["inertia"] @ link["rotation"].T
        total += link["mass"] * (r @ r * np.eye(3) - np.outer(r, r))
    found = chain_inertia(world.bodies, world.joints, world.drivers[0], 1)
    assert found == pytest.approx(np.trace(total) / 2, rel=1e-12)


CONTACTS = [
    (0, (0.02, 0.01, -0.08), (1.0, 0.3, -0.2)),
    (0, (0.0, 0.03, -0.05), (0.0, 1.0, 0.0)),
    (2, (0.03, 0.0, -0.2), (1.0, 0.0, 0.5)),
]


@pytest.mark.parametrize(("inward", "point", "normal"), CONTACTS)
def test_a_link_has_the_mass_of_its_chain_and_servo(world, inward, point, normal):
    """Divide the hinges' squared slopes by the chain's inertia with the servo's damping and stiffness."""
    pair, driver, found = touch(world, inward, point, normal)[0], world.drivers[0], np.zeros((3, 3))
    place_contact(pair, 0.0)
    contact_mobility(world.bodies, world.drivers, pair, found)
    # the box is one side of the contact
    box, r = world.bodies[-1], pair["point_a"] - world.bodies[-1]["center"]
    turned = np.cross(box["inverse_inertia"] @ np.cross(r, pair["normal"]), r)
    own = pair["normal"] @ found @ pair["normal"] - box["inverse_mass"] - turned @ pair["normal"]
    inertia = chain_inertia(world.bodies, world.joints, driver, 1)
    inertia *= (1 + driver["hinge_frequency"] * FRAME) ** 2
    wanted = 1 / driver["mass"] + (slopes(world, pair) ** 2).sum() / inertia
    # finite differences, and the cancellation of the box far away
    assert own == pytest.approx(wanted, rel=1e-7)


@pytest.mark.parametrize(("inward", "point", "normal"), CONTACTS)
def test_the_recoil_moves_the_contact_point_as_the_mass_says(world, inward, point, normal):
    """Pass an impulse on to hinges and root: the point's speed along the normal is the one in the contact."""
    pair, driver = touch(world, inward, point, normal)[0], world.drivers[0]
    size, rates, before = 0.7, world.joints["offset_rate"].copy(), driver["velocity"].copy()
    push = -size * pair["normal"]
    apply_impulse(
        world.bodies, world.joints, world.drivers, int(pair["body_a"]), pair["point_a"], *push.tolist()
    )
    link = world.bodies[pair["body_a"]]
    r = pair["point_a"] - link["center"]
    moved = link["velocity"] - link["wanted_velocity"]
    moved = moved + np.cross(link["omega"] - link["wanted_omega"], r)
    recoil(world.bodies, world.joints, driver)
    turned = slopes(world, pair) @ (world.joints["offset_rate"] - rates)
    turned += pair["normal"] @ (driver["velocity"] - before)
    assert pair["normal"] @ moved < 0
    assert turned == pytest.approx(pair["normal"] @ moved, rel=1e-7)


def test_an_impulse_recoils_with_the_persons_mass(world):
    """Change the coupling's momentum by the whole impulse."""
    pair, driver = touch(world, *CONTACTS[0])[0], world.drivers[0]
    before, push = driver["velocity"].copy(), np.array((0.3, -0.2, 0.5))
    apply_impulse(
        world.bodies, world.joints, world.drivers, int(pair["body_a"]), pair["point_a"], *push.tolist()
    )
    recoil(world.bodies, world.joints, driver)
    mass = composite_inertia(world.bodies, world.joints, driver, np.zeros(3), np.zeros((3, 3)))
    np.testing.assert_allclose(mass * (driver["velocity"] - before), push, rtol=1e-12)


def test_only_the_first_touch_bounces(world):
    """Take the restitution out of the contact of a link that was in contact in the last frame."""
    pairs = touch(world, *CONTACTS[0])
    assert pairs[0]["restitution"] == 0.2
    world.bodies[pairs[0]["body_a"]]["was_in_contact"] = 1
    weigh_links(world.bodies, world.joints, world.drivers, pairs, 1, FRAME)
    assert pairs[0]["restitution"] == 0.0

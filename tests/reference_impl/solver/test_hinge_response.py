"""Response of a person's links to impulses and forces, against its joint-space inertia."""

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.kinematics.skeleton import joint_space_inertia, move_links, pose_links
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.hinge_response import weigh_hinges
from touchstone.reference_impl.solver.mobility import apply_impulse, surface_velocity

ARM = (0.3, -0.4, 0.2, 0.8, 0.1, -0.1)
"""Angles of an arm's hinges [rad]."""
GRIP = 0.05
"""Lever of a contact point on a hand [m]."""


@pytest.fixture
def world(lab: SimpleNamespace) -> World:
    """The person with both arms bent, in the simulated loop, beside a box that moves freely."""
    box = lab.block("box", (0.1, 0.1, 0.1), (5.0, 0.0, 0.0))
    person = lab.person()
    built = lab.build(lab.person(bodies=(*person.bodies, box)))
    driver = built.drivers[0]
    for chain in (1, 2):
        first, last = driver["chains"][chain]
        built.joints["angle"][first : last + 1] = ARM
    driver["loops"], driver["inverse_mass"] = 1, 1 / driver["mass"]
    built.joints["touched"], built.joints["share"] = 1, 1.0
    pose_links(built.bodies, built.joints, driver)
    weigh_hinges(built.bodies, built.joints, driver)
    return built


def jacobian(world: World, link: int, point: np.ndarray) -> np.ndarray:
    """Velocity of a link's point per rate of the root (6) and of each hinge (3, 6 + j)."""
    driver, joints, bodies = world.drivers[0], world.joints, world.bodies
    x, y, z = point - driver["position"]
    found = np.zeros((3, 6 + len(joints)))
    found[:, :3] = np.eye(3)
    found[:, 3:6] = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
    k = int(bodies[link]["hinge"])
    while k >= 0:
        axis = bodies[joints[k]["parent"]]["rotation"] @ joints[k]["axis"]
        found[:, 6 + k] = np.cross(axis, point - bodies[joints[k]["child"]]["position"])
        k = int(joints[k]["inner"])
    return found


def parts(world: World) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint-space inertia (33, 33), that of the root (6, 6), that of hinges with the root free (27, 27)."""
    whole = joint_space_inertia(world.bodies, world.joints, world.drivers[0])
    root, across = whole[:6, :6], whole[:6, 6:]
    return whole, root, whole[6:, 6:] - across.T @ np.linalg.solve(root, across)


def hand(world: World, chain: int) -> tuple[int, np.ndarray]:
    """The last link of a chain, and a point on it."""
    link = int(world.joints[world.drivers[0]["chains"][chain][1]]["child"])
    body = world.bodies[link]
    return link, body["center"] + body["rotation"] @ np.array([GRIP, 0.3 * GRIP, -GRIP])


def change(world: World, link: int, point: np.ndarray) -> np.ndarray:
    """Velocity of a link's point."""
    out = np.zeros(3)
    surface_velocity(world.bodies[link], point, out)
    return out


def test_the_inertia_of_hinges_is_that_with_the_root_free(world):
    """Match the Schur complement of the joint-space inertia."""
    factor = np.tril(world.drivers[0]["hinge_factor"])[:27, :27]
    _, _, felt = parts(world)
    np.testing.assert_allclose(factor @ factor.T, felt, atol=1e-12 * felt.max())


@pytest.mark.parametrize("axis", range(3))
def test_an_impulse_moves_all_links_by_the_joint_space_inertia(world, axis):
    """Change the velocities of both hands by J M^-1 J' when one of them is hit."""
    whole, _, _ = parts(world)
    (left, at), (right, there) = hand(world, 1), hand(world, 2)
    impulse = np.eye(3)[axis]
    apply_impulse(world.bodies, world.joints, world.drivers, left, at, *impulse)
    moved = np.linalg.solve(whole, jacobian(world, left, at).T @ impulse)
    np.testing.assert_allclose(change(world, left, at), jacobian(world, left, at) @ moved, atol=1e-11)
    np.testing.assert_allclose(change(world, right, there), jacobian(world, right, there) @ moved, atol=1e-11)


@pytest.mark.parametrize("lasting", [False, True])
def test_the_solver_moves_a_hand_as_its_inertia_does(world, lasting):
    """Stop a box at a hand: an impulse meets M^-1, a force over a substep the parts of the root and of hinges
    whose root is held."""
    whole, root, _ = parts(world)
    held = whole[6:, 6:]
    bodies, joints, driver, state = world.bodies, world.joints, world.drivers[0], world.state[0]
    link, point = hand(world, 1)
    box, normal = len(bodies) - 1, np.array([0.6, 0.0, 0.8])
    bodies[box]["center"], bodies[box]["velocity"] = point, -2.0 * normal
    driver["lasting"], driver["turn_share"], state["lead"] = int(lasting), 1.0, 0.0
    untouched = joints["chain"] != 1  # their modes have no response
    joints["share"][untouched] = 0.0
    pairs = world.pairs[:1]
    pairs[0]["body_a"], pairs[0]["body_b"], pairs[0]["normal"] = link, box, normal
    pairs[0]["point"] = pairs[0]["lever_a"] = pairs[0]["lever_b"] = point
    pairs[0]["friction"] = 0.0
    move_links(bodies, joints, driver)
    begin_row(bodies, pairs[0], 0.0)
    assert solve_contacts(bodies, joints, world.drivers, pairs, 1, lasting, state)
    j = jacobian(world, link, point)
    mobility = j @ np.linalg.solve(whole, j.T)
    if lasting:
        mobility = j[:, :6] @ np.linalg.solve(root, j[:, :6].T) + j[:, 6:] @ np.linalg.solve(held, j[:, 6:].T)
    wanted = 2.0 / (normal @ mobility @ normal + 1 / bodies[box]["mass"])
    np.testing.assert_allclose(pairs[0]["resting_impulse"], wanted * normal, rtol=1e-9, atol=1e-12)
    if lasting:
        turned = np.linalg.solve(held, j[:, 6:].T @ (-wanted * normal))
        first, last = driver["chains"][1]
        chain = slice(first, last + 1)
        found = joints["modes"][chain, : last + 1 - first] @ joints["twist"][chain]
        np.testing.assert_allclose(found, turned[chain], atol=1e-9 * np.abs(turned).max())
        assert (joints["twist"][untouched] == 0).all()

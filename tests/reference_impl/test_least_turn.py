"""The least turn: by hand for one contact, against a quadratic program for several."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from reference_impl.conventions import TURN_CLEARANCE, TURN_LEVER, TURN_TOLERANCE
from reference_impl.least_turn import least_turn
from reference_impl.skeleton import pose_links
from reference_impl.world import PAIR

CHAIN = 1
"""The left arm."""


@pytest.fixture
def world(lab: SimpleNamespace):
    """The person with the left arm a little bent, beside a block whose contacts are made up."""
    block = lab.block("block", (0.1, 0.1, 0.1), (5.0, 0.0, 0.0), kind="fixed")
    person = lab.person()
    built = lab.build(lab.person(bodies=(*person.bodies, block)))
    first, last = built.drivers[0]["chains"][CHAIN]
    built.joints["angle"][first : last + 1] = (0.3, -0.4, 0.2, 0.8, 0.1, -0.1)
    pose_links(built.bodies, built.joints, built.drivers[0])
    return built


def contacts(world, rows) -> np.ndarray:
    """Pairs of the block (A) with links of the arm (B), by link counted from the last, point and normal."""
    _, last = world.drivers[0]["chains"][CHAIN]
    pairs = np.zeros(len(rows), PAIR)
    for pair, (inward, point, normal, depth) in zip(pairs, rows):
        body = int(world.joints[last - inward]["child"])
        pair["body_a"], pair["body_b"], pair["distance"] = len(world.bodies) - 1, body, -depth
        link = world.bodies[body]
        pair["point_b"] = link["position"] + link["rotation"] @ np.array(point)
        pair["normal"] = np.array(normal) / np.linalg.norm(normal)
    return pairs


def solve(world, pairs) -> tuple[float, np.ndarray]:
    """What is missed, and the turns of the arm's hinges."""
    first, last = world.drivers[0]["chains"][CHAIN]
    before = world.joints["angle"].copy()
    missed = least_turn(
        world.bodies, world.joints, pairs, len(pairs), world.drivers[0], 0, CHAIN, 0, world.state[0]
    )
    turned = world.joints["angle"] - before
    assert not np.delete(turned, range(first, last + 1)).any()
    return missed, turned[first : last + 1]


def slopes(world, pairs) -> np.ndarray:
    """Fall of each depth per turn of each hinge, by central differences."""
    first, last = world.drivers[0]["chains"][CHAIN]
    local = [
        world.bodies[p["body_b"]]["rotation"].T @ (p["point_b"] - world.bodies[p["body_b"]]["position"])
        for p in pairs
    ]

    def heights(k: int, change: float) -> list[float]:
        world.joints[k]["angle"] += change
        pose_links(world.bodies, world.joints, world.drivers[0])
        links = [world.bodies[p["body_b"]] for p in pairs]
        found = [p["normal"] @ (b["position"] + b["rotation"] @ x) for p, b, x in zip(pairs, links, local)]
        world.joints[k]["angle"] -= change
        pose_links(world.bodies, world.joints, world.drivers[0])
        return found

    step = 1e-5
    return np.transpose(
        [np.subtract(heights(k, step), heights(k, -step)) / (2 * step) for k in range(first, last + 1)]
    )


HAND = (0, (0.01, 0.02, -0.12), (0.3, -0.5, 0.8), 1e-4)
FOREARM = (2, (0.03, 0.0, -0.15), (-0.7, 0.1, 0.4), 5e-5)
UPPER_ARM = (3, (0.0, 0.04, -0.1), (0.0, -1.0, 0.2), 8e-5)


def test_one_contact_turns_along_its_slope(world) -> None:
    """Turn by g d / (g . g), damped: the shortest way to a plane."""
    pairs = contacts(world, [HAND])
    (g,) = slopes(world, pairs)
    missed, turned = solve(world, pairs)
    damped = g @ g + TURN_LEVER**2
    assert missed == pytest.approx(TURN_LEVER**2 / damped, rel=1e-7)
    # slopes by differences are good to 1e-10
    np.testing.assert_allclose(turned, g * (1e-4 + TURN_CLEARANCE) / damped, rtol=1e-7, atol=1e-13)


def test_hinges_beyond_the_link_stay(world) -> None:
    """Leave elbow and wrist alone where the upper arm is pushed."""
    _, turned = solve(world, contacts(world, [UPPER_ARM]))
    assert turned[:3].any()
    assert not turned[3:].any()


@pytest.mark.parametrize("bound", [False, True])
def test_several_contacts_solve_the_quadratic_program(world, bound: bool) -> None:
    """Agree with SLSQP on three contacts, also where a hinge may turn only half as far as it would."""
    pairs = contacts(world, [HAND, FOREARM, UPPER_ARM])
    first, last = world.drivers[0]["chains"][CHAIN]
    rows, g = world.joints[first : last + 1], slopes(world, pairs)
    truth = program(g, TURN_CLEARANCE - pairs["distance"], np.full((6, 2), (-np.inf, np.inf)))
    if bound:
        k = int(np.abs(truth).argmax())
        rows["upper" if truth[k] > 0 else "lower"][k] = rows["angle"][k] + truth[k] / 2
        room = np.transpose([rows["lower"] - rows["angle"], rows["upper"] - rows["angle"]])
        truth = program(g, TURN_CLEARANCE - pairs["distance"], room)
    _, turned = solve(world, pairs)
    # sweeps end when they change no depth by TURN_TOLERANCE; a twentieth of a metre is the least lever here
    np.testing.assert_allclose(turned, truth, atol=20 * TURN_TOLERANCE)
    assert np.abs(turned).max() > 1e-3


def program(g: np.ndarray, depths: np.ndarray, room: np.ndarray) -> np.ndarray:
    """The turns x that make |x|^2 + |s / TURN_LEVER|^2 least, with g x + s >= depths, by SLSQP."""
    # in units of 1e-4 rad and 1e-5 m, for SLSQP's absolute tolerances
    weights = np.r_[np.ones(6), np.full(3, 0.1 / TURN_LEVER)]
    rows = np.hstack((10 * g, np.eye(3)))
    return (
        1e-4
        * minimize(
            lambda y: 0.5 * (weights * y) @ (weights * y),
            np.zeros(9),
            jac=lambda y: weights**2 * y,
            bounds=[*(1e4 * room), *[(None, None)] * 3],
            constraints={"type": "ineq", "fun": lambda y: rows @ y - 1e5 * depths, "jac": lambda y: rows},
            method="SLSQP",
            options={"ftol": 1e-15, "maxiter": 1000},
        ).x[:6]
    )


def test_a_contact_that_is_met_pulls_nothing(world) -> None:
    """Leave pairs that part anyway out of the answer: pushes never pull."""
    start = world.joints["angle"].copy()
    _, alone = solve(world, contacts(world, [HAND]))
    world.joints["angle"] = start
    pose_links(world.bodies, world.joints, world.drivers[0])
    _, both = solve(world, contacts(world, [HAND, (*HAND[:3], -1e-5)]))
    assert np.abs(alone).max() > 1e-5
    np.testing.assert_allclose(both, alone, rtol=1e-9, atol=1e-15)


def test_a_stretched_arm_pushed_along_itself_is_told(world) -> None:
    """Miss all of a depth that no hinge has a lever for."""
    first, last = world.drivers[0]["chains"][CHAIN]
    world.joints["angle"][first : last + 1] = 0.0
    pose_links(world.bodies, world.joints, world.drivers[0])
    missed, turned = solve(world, contacts(world, [(0, (0.0, 0.0, -0.18), (0.0, 0.0, 1.0), 1e-3)]))
    assert missed == 1
    assert not turned.any()

"""The least turn: by hand for one contact, against a quadratic program for several."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.optimize import minimize

from touchstone.reference_impl.core.conventions import QP_TOLERANCE
from touchstone.reference_impl.core.counters import CAP_POSTURE_QP, COUNT_QP_SOLVES
from touchstone.reference_impl.core.world import PAIR
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.posture.chain_overlap_removal import QP_TURN_MAX
from touchstone.reference_impl.posture.posture_constraints import (
    QP_CLEARANCE,
    drop_constraints,
    gather_constraints,
)
from touchstone.reference_impl.posture.posture_qp import QP_LEVER, apply_turns, missed_share, solve_posture_qp

CHAIN, RIGHT = 1, 2
"""The left arm, and the other."""


@pytest.fixture
def world(lab: SimpleNamespace):
    """The person with both arms a little bent, beside a block whose contacts are made up."""
    block = lab.block("block", (0.1, 0.1, 0.1), (5.0, 0.0, 0.0), kind="fixed")
    person = lab.person()
    built = lab.build(lab.person(bodies=(*person.bodies, block)))
    for first, last in built.drivers[0]["chains"][[CHAIN, RIGHT]]:
        built.joints["angle"][first : last + 1] = (0.3, -0.4, 0.2, 0.8, 0.1, -0.1)
    pose_links(built.bodies, built.joints, built.drivers[0])
    return built


def contacts(world, rows) -> np.ndarray:
    """Pairs of the block (A) with links of the arm (B), by link counted from the last, point and normal."""
    _, last = world.drivers[0]["chains"][CHAIN]
    pairs = np.zeros(len(rows), PAIR)
    for k, (pair, (inward, point, normal, depth)) in enumerate(zip(pairs, rows)):
        body = int(world.joints[last - inward]["child"])
        pair["body_a"], pair["body_b"], pair["depth"] = len(world.bodies) - 1, body, depth
        pair["piece_a"] = k
        link = world.bodies[body]
        pair["point_b"] = link["position"] + link["rotation"] @ np.array(point)
        pair["normal"] = np.array(normal) / np.linalg.norm(normal)
        pair["point_a"] = pair["point_b"] + depth * pair["normal"]
    return pairs


def solve(world, pairs, pull=None) -> tuple[float, np.ndarray]:
    """What is missed, and the turns of all hinges, pulled by `pull` or by nothing."""
    driver, joints = world.drivers[0], world.joints
    before = joints["angle"].copy()
    driver["constraint_count"] = 0
    gather_constraints(world.bodies, pairs, len(pairs), driver, 0, world.state[0])
    joints["pass_turn"] = 0.0 if pull is None else pull
    solve_posture_qp(world.bodies, joints, driver, pull is not None, True, world.state[0])
    missed = missed_share(joints, *driver["chains"][CHAIN], driver)
    apply_turns(joints, driver, 1.0, QP_TURN_MAX)
    return missed, joints["angle"] - before


def solve_arm(world, pairs) -> tuple[float, np.ndarray]:
    """What is missed, and the turns of the left arm's hinges: no others turn."""
    first, last = world.drivers[0]["chains"][CHAIN]
    missed, turned = solve(world, pairs)
    assert not np.delete(turned, range(first, last + 1)).any()
    return missed, turned[first : last + 1]


def slopes(world, pairs, hinges=None) -> np.ndarray:
    """Fall of each depth per turn of hinges, the left arm's unless told, by central differences."""
    first, last = world.drivers[0]["chains"][CHAIN]
    sides = ("a", "b")
    local = [
        [
            world.bodies[p[f"body_{s}"]]["rotation"].T
            @ (p[f"point_{s}"] - world.bodies[p[f"body_{s}"]]["position"])
            for s in sides
        ]
        for p in pairs
    ]

    def gaps(k: int, change: float) -> list[float]:
        world.joints[k]["angle"] += change
        pose_links(world.bodies, world.joints, world.drivers[0])
        found = []
        for p, points in zip(pairs, local):
            a, b = (
                world.bodies[p[f"body_{s}"]]["position"] + world.bodies[p[f"body_{s}"]]["rotation"] @ x
                for s, x in zip(sides, points)
            )
            found.append(p["normal"] @ (b - a))
        world.joints[k]["angle"] -= change
        pose_links(world.bodies, world.joints, world.drivers[0])
        return found

    step = 1e-5
    hinges = range(first, last + 1) if hinges is None else hinges
    return np.transpose([np.subtract(gaps(k, step), gaps(k, -step)) / (2 * step) for k in hinges])


HAND = (0, (0.01, 0.02, -0.12), (0.3, -0.5, 0.8), 1e-4)
FOREARM = (2, (0.03, 0.0, -0.15), (-0.7, 0.1, 0.4), 5e-5)
UPPER_ARM = (3, (0.0, 0.04, -0.1), (0.0, -1.0, 0.2), 8e-5)


def test_opposing_contacts_are_solved_to_the_optimum(world) -> None:
    """Meet the Karush-Kuhn-Tucker conditions in 200 random wedges of contacts that nearly oppose each other;
    sweeps alone reach their cap in half of them."""
    rng = np.random.default_rng(5)
    driver, counters = world.drivers[0], world.state[0]["counters"]
    start = world.joints["angle"].copy()
    lower, upper = world.joints["lower"] - start, world.joints["upper"] - start
    for _ in range(200):
        axis = rng.normal(size=3)
        wedge = [
            (
                int(rng.integers(0, 4)),
                tuple(rng.normal(0, 0.05, 3)),
                tuple(rng.choice((-1, 1)) * axis + rng.normal(0, 0.05, 3)),
                float(10 ** rng.uniform(-6, -2.5)),
            )
            for _ in range(rng.integers(2, 9))
        ]
        solve(world, contacts(world, wedge))
        turns = np.clip(world.joints["pass_turn"], lower, upper)
        for row in driver["constraints"][: driver["constraint_count"]]:
            left = row["depth"] - QP_LEVER**2 * row["multiplier"]
            for first, last, slopes in zip(row["first"], row["last"], row["jacobian"]):
                left -= slopes[: last + 1 - first] @ turns[first : last + 1]
            assert left < 30 * QP_TOLERANCE
            assert row["multiplier"] == 0 or left > -30 * QP_TOLERANCE
        world.joints["angle"] = start
        pose_links(world.bodies, world.joints, driver)
    assert (counters[COUNT_QP_SOLVES], counters[CAP_POSTURE_QP]) == (200, 0)


def test_hinges_beyond_the_link_stay(world) -> None:
    """Leave elbow and wrist alone where the upper arm is pushed."""
    _, turned = solve_arm(world, contacts(world, [UPPER_ARM]))
    assert turned[:3].any()
    assert not turned[3:].any()


@pytest.mark.parametrize("bound", [False, True])
def test_several_contacts_solve_the_quadratic_program(world, bound: bool) -> None:
    """Agree with SLSQP on three contacts, also where a hinge may turn only half as far as it would."""
    pairs = contacts(world, [HAND, FOREARM, UPPER_ARM])
    first, last = world.drivers[0]["chains"][CHAIN]
    rows, g = world.joints[first : last + 1], slopes(world, pairs)
    truth = program(g, QP_CLEARANCE + pairs["depth"], np.full((6, 2), (-np.inf, np.inf)))
    if bound:
        k = int(np.abs(truth).argmax())
        rows["upper" if truth[k] > 0 else "lower"][k] = rows["angle"][k] + truth[k] / 2
        room = np.transpose([rows["lower"] - rows["angle"], rows["upper"] - rows["angle"]])
        truth = program(g, QP_CLEARANCE + pairs["depth"], room)
    _, turned = solve_arm(world, pairs)
    # sweeps end when they change no depth by QP_TOLERANCE; a twentieth of a metre is the least lever here
    np.testing.assert_allclose(turned, truth, atol=20 * QP_TOLERANCE)
    assert np.abs(turned).max() > 1e-3


def program(g: np.ndarray, depths: np.ndarray, room: np.ndarray) -> np.ndarray:
    """The turns x that make |x|^2 + |s / QP_LEVER|^2 least, with g x + s >= depths, by SLSQP."""
    # in units of 1e-4 rad and 1e-5 m, for SLSQP's absolute tolerances
    weights = np.r_[np.ones(6), np.full(3, 0.1 / QP_LEVER)]
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


def test_a_pull_is_projected(world) -> None:
    """Keep what of a pull goes along a touching surface, take out what goes into it, and no more of what goes
    off it than a clearance."""
    first, last = world.drivers[0]["chains"][CHAIN]
    pairs = contacts(world, [(*HAND[:3], 0.0)])
    g, rng = slopes(world, pairs, range(len(world.joints)))[0], np.random.default_rng(3)
    start = world.joints["angle"].copy()
    for sign in (1, -1):
        pull = np.where((np.arange(len(g)) >= first) & (np.arange(len(g)) <= last), 1e-3, 0.0)
        pull *= rng.normal(size=len(g))
        pull *= sign * np.sign(g @ pull)
        _, turned = solve(world, pairs, pull)
        short = max(QP_CLEARANCE - g @ pull, 0.0)
        np.testing.assert_allclose(turned, pull + g * short / (g @ g + QP_LEVER**2), rtol=1e-6, atol=1e-12)
        world.joints["angle"] = start
        pose_links(world.bodies, world.joints, world.drivers[0])


def test_points_are_kept_while_their_pair_touches(world) -> None:
    """Keep both ends of a sole; forget them once the pair is gone, or nothing pushes against them."""
    driver = world.drivers[0]
    pairs = contacts(world, [HAND, (0, (-0.02, 0.02, -0.12), *HAND[2:])])
    pairs["piece_a"] = 0
    driver["constraint_count"] = 0
    for pair in pairs:
        gather_constraints(world.bodies, np.array([pair]), 1, driver, 0, world.state[0])
    gather_constraints(world.bodies, pairs, 2, driver, 0, world.state[0])
    assert driver["constraint_count"] == 2
    gather_constraints(world.bodies, pairs, 0, driver, 0, world.state[0])
    driver["constraints"]["warm_multiplier"][0] = 1.0
    drop_constraints(driver, 0)
    assert driver["constraint_count"] == 1
    drop_constraints(driver, 1)
    assert driver["constraint_count"] == 0


def test_a_contact_that_is_met_pulls_nothing(world) -> None:
    """Leave pairs that part anyway out of the answer: pushes never pull."""
    start = world.joints["angle"].copy()
    _, alone = solve_arm(world, contacts(world, [HAND]))
    world.joints["angle"] = start
    pose_links(world.bodies, world.joints, world.drivers[0])
    _, both = solve_arm(world, contacts(world, [HAND, (*HAND[:3], -1e-5)]))
    assert np.abs(alone).max() > 1e-5
    np.testing.assert_allclose(both, alone, rtol=1e-9, atol=1e-15)


def test_a_stretched_arm_pushed_along_itself_is_told(world) -> None:
    """Miss all of a depth that no hinge has a lever for."""
    first, last = world.drivers[0]["chains"][CHAIN]
    world.joints["angle"][first : last + 1] = 0.0
    pose_links(world.bodies, world.joints, world.drivers[0])
    missed, turned = solve_arm(world, contacts(world, [(0, (0.0, 0.0, -0.18), (0.0, 0.0, 1.0), 1e-3)]))
    assert missed == 1
    assert not turned.any()

"""Motion of contacts within a substep, beside finite differences of exact distances."""

from collections import defaultdict
from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
from manifold_scenes import GAP, HALF, capsule, quaternion
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.broad_phase.detection import detect, place_pieces
from touchstone.reference_impl.continuous.contact_motion import move_to_middle
from touchstone.reference_impl.core.conventions import SIMULATED
from touchstone.reference_impl.geometry.contact_manifold import expand_manifolds
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.kinematics.skeleton import place
from touchstone.reference_impl.solver.mobility import place_contact
from touchstone.scenarios.scenario import Body
from touchstone.scenarios.solids import ellipsoid, hull

STEP = 1e-4
"""Of the finite differences [s]: they are exact to 1e-5 of the motions below."""
SHORT = 1e-6
"""Length of a substep whose second order in the motions is rounding [s]."""
LARGE_GAP = 1e-4
"""Gap of a row that may touch within a substep [m]."""
SECOND_ORDER = 1e-5
"""Of the motions below in half a STEP [1, m]; the first order is up to 3e-3."""
ENERGY = 2e-5
"""Of 1 kg that is 2e-6 m too high or too low [J]."""
BASE = (0.5, 0.4, 0.3)
"""Half extents of the body below, whose top is z = 0 [m]."""
EDGE, CORNER = (np.pi / 4, 0.0, 0.0), (0.6, 0.5, 0.2)
"""Rotation vectors of a body below whose edge, or corner, is on top."""
CASES = (
    "corner on a face",
    "capsule on a face",
    "edge on an edge",
    "capsule on an edge",
    "capsule on a capsule",
    "sphere on a face",
    "sphere on an edge",
    "sphere on a corner",
    "sphere on a capsule",
    "sphere on a sphere",
    "ellipsoid on a face",
    "ellipsoid on an edge",
    "ellipsoid on an edge of a hull",
    "ellipsoid on a corner",
    "ellipsoid on a capsule",
    "ellipsoid on an ellipsoid",
)
AXES, TILT = (0.08, 0.05, 0.03), (0.3, -0.4, 0.2)
"""Half axes of the ellipsoids [m], and rotation vector of the one above."""
ACROSS = quaternion(np.pi / 2, 0.0, 0.0)
"""A capsule's axis turned to the world's y."""


FOLLOWED = defaultdict(lambda: 0.5, {(2, 0): 1.0, (0, 2): 0.0})
"""Place of the contact point between the witnesses on A (0) and B (1), by how flat the two features are."""


def lifted(body: Body, height: float) -> Body:
    """The body, higher by `height` [m]."""
    x, y, z = body.position
    return replace(body, position=(x, y, z + height))


def below_of(lab: SimpleNamespace, case: str) -> tuple[Body, np.ndarray]:
    """The body below, and its point at which the one above touches it, where its normal may be vertical."""
    name = case.partition(" on a")[2].removeprefix("n").strip()
    if name == "capsule":
        return capsule((0.02, 0.0, -0.05)), np.zeros(3)
    if name == "sphere":
        return lab.ball("below", (0.01, 0.0, -0.05)), np.array((0.01, 0.0, 0.0))
    if name == "ellipsoid":
        body = ellipsoid("below", "wood", AXES, 1.0, (0.0, 0.0, 0.0), quaternion(0.2, 0.5, 0.0))
        top = lowest(body) * -1
        return lifted(body, -float(top[2])), top * (1, 1, 0)
    vector = EDGE if name.startswith("edge") else CORNER if name == "corner" else (0.0, 0.0, 0.0)
    turn = Rotation.from_rotvec(vector)
    corners = np.array([turn.apply(np.array(BASE) * signs) for signs in product((-1, 1), repeat=3)])
    height = float(corners[:, 2].max())
    body = lab.block("below", BASE, (0.0, 0.0, -height), orientation=quaternion(*vector))
    if name == "edge of a hull":
        own = [tuple(corner) for corner in turn.inv().apply(corners)]
        body = hull("below", "wood", own, 1.0, body.position, body.orientation)
    top = corners[corners[:, 2] > height - GAP].mean(axis=0)
    return body, top * (1, 1, 0)


def lowest(body: Body) -> np.ndarray:
    """The lowest point of an ellipsoid, from its centre."""
    turn, axes = Rotation.from_quat(body.orientation, scalar_first=True), np.array(AXES)
    along = axes**2 * turn.inv().apply((0.0, 0.0, -1.0))
    return turn.apply(along / np.linalg.norm(along / axes))


def above_of(lab: SimpleNamespace, case: str, top: np.ndarray) -> Body:
    """The body above, GAP higher than `top`."""
    x, y, _ = top
    name, _, under = case.partition(" on a")
    if name == "corner":
        lift = float(np.abs(Rotation.from_rotvec(CORNER).as_matrix()[2]) @ HALF)
        return lab.block("above", HALF, (0.05, 0.03, lift + GAP), orientation=quaternion(*CORNER))
    if name == "edge":
        tilt = Rotation.from_rotvec((0.0, 0.0, 1.1)) * Rotation.from_rotvec(EDGE)
        lift = float(np.abs(tilt.as_matrix()[2]) @ HALF)
        return lab.block("above", HALF, (0.03, 0.0, lift + GAP), orientation=quaternion(*tilt.as_rotvec()))
    if name == "sphere":
        return lab.ball("above", (x, y, 0.05 + GAP))
    if name == "ellipsoid":
        body = ellipsoid("above", "wood", AXES, 1.0, (0.0, 0.0, 0.0), quaternion(*TILT))
        a, b, c = lowest(body)
        return replace(body, position=(x - a, y - b, GAP - c))
    if under == " face":
        return capsule((0.02, 0.0, 0.05 + 0.15 * np.cos(0.7) + GAP), quaternion(0.0, 0.7, 0.0))
    return replace(capsule((0.02, 0.01, 0.05 + GAP), ACROSS), name="above")


def moving_pair(lab: SimpleNamespace, case: str, seed: int):
    """Two bodies in touch that move and rotate at random; returns their world."""
    rng = np.random.default_rng(seed)
    below, top = below_of(lab, case)
    world = lab.build(lab.scene(below, above_of(lab, case, top)))
    for body in world.bodies:
        body["velocity"], body["omega"] = rng.uniform(-1, 1, 3), rng.uniform(-3, 3, 3)
    return world


def row_of(world):
    """The only row of the pair, with its contact point."""
    touching, _ = detect(world.of_stages(), SIMULATED, 0)
    end = expand_manifolds(
        world.bodies, world.pieces, world.vertices, world.pairs, touching, False, world.state[0]
    )
    assert (touching, end) == (1, 1)
    pair = world.pairs[0]
    place_contact(pair, pair["level"])
    pair["start_normal"] = pair["normal"]
    return pair


def acceleration(world, pair) -> np.ndarray:
    """J' v of a row: `bias` is its change of velocity over half of a substep."""
    move_to_middle(world.bodies, world.pieces, pair, SHORT)
    return 2 * pair["bias"] / SHORT


def pair_after(world, pair, time: float) -> np.ndarray:
    """The pair's row when its bodies have moved for a time at constant velocities."""
    start = world.bodies.copy()
    for body, old in zip(world.bodies, start):
        turn = Rotation.from_rotvec(time * old["omega"]) * Rotation.from_quat(
            old["orientation"], scalar_first=True
        )
        body["position"] = old["position"] + time * old["velocity"]
        body["orientation"] = turn.as_quat(scalar_first=True)
        place(body)
    place_pieces(world.bodies, world.pieces, world.vertices, SIMULATED)
    found = pair.copy().reshape(1)
    convex_depth(
        world.pieces[pair["piece_a"]], world.pieces[pair["piece_b"]], world.vertices, world.state[0], found[0]
    )
    world.bodies[:] = start
    place_pieces(world.bodies, world.pieces, world.vertices, SIMULATED)
    return found[0]


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("case", CASES)
def test_gaps_accelerate_as_finite_differences_say(lab: SimpleNamespace, case: str, seed: int) -> None:
    """Equal the second difference of the exact distance, along the normal."""
    world = moving_pair(lab, case, seed)
    pair = row_of(world)
    early, now, late = (pair_after(world, pair, t)["distance"] for t in (-STEP, 0.0, STEP))
    found = pair["normal"] @ acceleration(world, pair)
    assert found == pytest.approx((early - 2 * now + late) / STEP**2, rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("case", CASES)
def test_levers_are_in_the_middle(lab: SimpleNamespace, case: str, seed: int) -> None:
    """Equal the exact normal in the middle of a substep, and the place of the vertex, to second order."""
    world = moving_pair(lab, case, seed)
    pair = row_of(world)
    middle = pair_after(world, pair, STEP / 2)
    move_to_middle(world.bodies, world.pieces, pair, STEP)
    np.testing.assert_allclose(pair["normal"], middle["normal"], atol=SECOND_ORDER)
    # the contact point follows what touches a face, and is between both witnesses elsewhere
    place_contact(middle, FOLLOWED[int(pair["flat_a"]), int(pair["flat_b"])])
    point = middle["point"]
    for body, lever in (("body_a", "lever_a"), ("body_b", "lever_b")):
        found = pair[lever] + STEP / 2 * world.bodies[pair[body]]["velocity"]
        np.testing.assert_allclose(found, point, atol=SECOND_ORDER)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("case", CASES)
def test_a_and_b_are_interchangeable(lab: SimpleNamespace, case: str, seed: int) -> None:
    """Give the same geometry and opposite velocities if A and B change places, even over a gap."""
    world = moving_pair(lab, case, seed)
    pair = row_of(world)
    pair["point_b"] += LARGE_GAP * pair["normal"]
    place_contact(pair, pair["level"])
    other = pair.copy().reshape(1)[0]
    for name in ("piece", "body", "point", "edge", "flat"):
        other[f"{name}_a"], other[f"{name}_b"] = pair[f"{name}_b"], pair[f"{name}_a"]
    other["level"], other["normal"], other["start_normal"] = (
        1 - pair["level"],
        -pair["normal"],
        -pair["normal"],
    )
    move_to_middle(world.bodies, world.pieces, pair, STEP)
    move_to_middle(world.bodies, world.pieces, other, STEP)
    np.testing.assert_allclose(other["lever_a"], pair["lever_b"], rtol=0, atol=1e-16)
    np.testing.assert_allclose(other["lever_b"], pair["lever_a"], rtol=0, atol=1e-16)
    np.testing.assert_allclose(other["normal"], -pair["normal"], rtol=0, atol=1e-16)
    np.testing.assert_allclose(other["bias"], -pair["bias"], rtol=0, atol=1e-16)


@pytest.mark.parametrize("seed", range(8))
def test_sliding_changes_as_finite_differences_say(lab: SimpleNamespace, seed: int) -> None:
    """Equal the change of the corner's velocity over the face below it, across the normal."""
    world = moving_pair(lab, "corner on a face", seed)
    pair = row_of(world)
    bias, n = acceleration(world, pair), pair["start_normal"]
    below, above = world.bodies[pair["body_a"]], world.bodies[pair["body_b"]]

    def sliding(time: float) -> np.ndarray:
        lever = Rotation.from_rotvec(time * above["omega"]).apply(pair["point"] - above["center"])
        corner = above["center"] + time * above["velocity"] + lever
        under = corner - below["center"] - time * below["velocity"]
        here = below["velocity"] + np.cross(below["omega"], under)
        return above["velocity"] + np.cross(above["omega"], lever) - here

    change = (sliding(STEP) - sliding(-STEP)) / (2 * STEP)
    np.testing.assert_allclose(bias - n * (n @ bias), change - n * (n @ change), atol=1e-4)


def test_a_box_that_pivots_keeps_its_edge_on_the_ground(lab: SimpleNamespace) -> None:
    """Turn about the edge, which stays on the ground to 2e-6 m, and keep the energy to 0.1 %."""
    half, start = (0.1, 0.05, 0.2), 0.55
    c = np.hypot(half[0], half[2])
    top = c * np.cos(np.arctan2(half[0], half[2]) - start)
    box = lab.block("box", half, (0.0, 0.0, top), orientation=quaternion(0.0, start, 0.0))
    world = lab.build(lab.scene(box, lab.ground(), mu=2.0))
    body = world.bodies[0]
    inertia = body["inertia"][1, 1] + c**2
    while body["rotation"][2, 2] > 0.6:
        lab.play(world, 1)
        edge = body["position"] + body["rotation"] @ (half[0], 0.0, -half[2])
        assert abs(edge[2]) < 2e-6
        lost = 9.81 * (top - body["position"][2])
        assert 0.999 * lost - ENERGY < inertia * body["omega"][1] ** 2 / 2 < lost + ENERGY
    assert body["omega"][1] > 2.5

"""Contact patches: their points by closed forms, and boxes that land, rest, slide and stack on them."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core.conventions import SIMULATED, TOUCH_DISTANCE
from touchstone.reference_impl.geometry.contact_manifold import expand_manifolds
from touchstone.scenarios.scenario import Body, Capsule, Hull, Piece, vector
from touchstone.scenarios.solids import box_inertia, capsule_inertia

HALF = (0.1, 0.08, 0.05)
G = 9.81
GAP = 2e-7
"""Between touching pieces of the unit tests [m]: inside TOUCH_DISTANCE."""
ROUNDING = 1e-12
"""Of points a metre away, through a frame and back [m]."""


def quaternion(*vector: float) -> tuple[float, ...]:
    """Of a rotation vector."""
    return tuple(Rotation.from_rotvec(vector).as_quat(scalar_first=True).tolist())


def rows_of(lab: SimpleNamespace, *bodies: Body, room: int = 8) -> np.ndarray:
    """The rows of the touching pairs of a scene."""
    world = lab.build(lab.scene(*bodies))
    pairs = world.pairs[:room]
    touching, _ = detect(world.of_stages()._replace(pairs=pairs), SIMULATED, 0)
    return pairs[: expand_manifolds(world.pieces, world.vertices, pairs, touching, world.state[0])].copy()


def table(lab: SimpleNamespace, half=(0.5, 0.4, 0.3)) -> Body:
    """A fixed box whose top is z = 0; it comes first: A."""
    return lab.block("table", half, (0.0, 0.0, -half[2]), kind="fixed")


def on_table(lab: SimpleNamespace, half, position=(0.0, 0.0), turn=(0.0, 0.0, 0.0)) -> Body:
    """A box whose lowest point hovers GAP over the table."""
    axes = np.abs(Rotation.from_rotvec(turn).as_matrix())
    height = float(axes[2] @ half) + GAP
    return lab.block("box", half, (*position, height), orientation=quaternion(*turn))


def assert_points(rows: np.ndarray, expected: list) -> None:
    """The rows' witnesses are these points of the table's top, in any order, with the gap above them."""
    assert len(rows) == len(expected)
    found = np.array(sorted(np.round(rows["point_a"], 9).tolist()))
    np.testing.assert_allclose(found, sorted((*p, 0.0) for p in np.round(expected, 9).tolist()), atol=2e-9)
    np.testing.assert_allclose(rows["point_b"] - rows["point_a"], [(0, 0, GAP)] * len(rows), atol=ROUNDING)
    np.testing.assert_allclose(rows["distance"], GAP, atol=ROUNDING)
    np.testing.assert_allclose(rows["normal"], [(0, 0, 1)] * len(rows), atol=ROUNDING)
    assert set(rows["manifold"].tolist()) == {0}


def test_aligned_faces_touch_at_the_corners(lab: SimpleNamespace) -> None:
    """Give the four corners of a box on a table, and of one on an equal one."""
    square = [(x, y) for x in (-0.1, 0.1) for y in (-0.08, 0.08)]
    assert_points(rows_of(lab, table(lab), on_table(lab, HALF)), square)
    assert_points(rows_of(lab, table(lab, HALF), on_table(lab, HALF)), square)


def test_shifted_faces_touch_where_they_overlap(lab: SimpleNamespace) -> None:
    """Give the corners of the rectangle that both faces cover."""
    rows = rows_of(lab, table(lab, HALF), on_table(lab, HALF, (0.15, -0.03)))
    assert_points(rows, [(x, y) for x in (0.05, 0.1) for y in (-0.08, 0.05)])


@pytest.mark.parametrize("tables", [0, 1])
def test_the_order_of_bodies_only_turns_the_normal(lab: SimpleNamespace, tables: int) -> None:
    """Give the same points whether the small face is A's or B's."""
    bodies = [on_table(lab, HALF, (0.02, 0.01), (0.0, 0.0, 0.5))]
    bodies.insert(tables, table(lab))
    rows = rows_of(lab, *bodies)
    np.testing.assert_allclose(rows["normal"][:, 2], 2 * (tables == 0) - 1, atol=ROUNDING)
    corners = Rotation.from_rotvec((0, 0, 0.5)).apply([(x, y, 0) for x in (-0.1, 0.1) for y in (-0.08, 0.08)])
    found = (rows["point_a"] + rows["point_b"])[:, :2] / 2
    for corner in corners[:, :2] + (0.02, 0.01):
        assert np.linalg.norm(found - corner, axis=1).min() < ROUNDING


def test_a_face_turned_by_45_degrees(lab: SimpleNamespace) -> None:
    """Keep four corners, far apart, of the octagon that two equal squares share."""
    half = (0.1, 0.1, 0.05)
    rows = rows_of(lab, table(lab, half), on_table(lab, half, turn=(0.0, 0.0, np.pi / 4)))
    assert len(rows) == 4
    cut = 0.1 * (np.sqrt(2) - 1)
    found = np.sort(np.abs(rows["point_a"][:, :2]), axis=1)
    np.testing.assert_allclose(found, [(cut, 0.1)] * 4, atol=ROUNDING)
    # a kite or a rectangle of an octagon's corners covers at least half the square around it
    assert ConvexHull(rows["point_a"][:, :2]).volume > 0.02


def test_an_edge_on_a_face_touches_at_its_ends(lab: SimpleNamespace) -> None:
    """Give both ends of an edge, cut off where the face ends."""
    turn = (np.pi / 4, 0.0, 0.0)
    assert_points(rows_of(lab, table(lab), on_table(lab, HALF, turn=turn)), edge(-0.1, 0.1))
    assert_points(rows_of(lab, table(lab), on_table(lab, HALF, (0.45, 0.0), turn)), edge(0.35, 0.5))


def edge(start: float, end: float) -> list:
    """Ends of the lowest edge of HALF turned by 45 degrees round x."""
    y = (HALF[2] - HALF[1]) / np.sqrt(2)
    return [(start, y), (end, y)]


def test_a_corner_on_a_face_is_one_point(lab: SimpleNamespace) -> None:
    """Give the corner alone, and the face's own normal."""
    turn = Rotation.from_rotvec((0.4, 0.3, 0.2))
    rows = rows_of(lab, table(lab), on_table(lab, HALF, turn=turn.as_rotvec()))
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    corners = turn.apply(signs * HALF)
    assert_points(rows, [tuple(corners[corners[:, 2].argmin(), :2])])


def test_a_prism_on_a_box(lab: SimpleNamespace) -> None:
    """Keep four corners of a hexagon: two opposite ones and one on either side."""
    angles = np.arange(6) * np.pi / 3 + 0.1
    ring = [(0.1 * np.cos(a), 0.1 * np.sin(a)) for a in angles]
    points = tuple((*map(float, p), z) for z in (-0.05, 0.05) for p in ring)
    shape = (Piece("prism", Hull(points)),)
    place, inertia = (0.0, 0.0, 0.05 + GAP), box_inertia(1.0, HALF)
    prism = Body("prism", "simulated", "wood", shape, mass=1.0, inertia=inertia, position=place)
    rows = rows_of(lab, table(lab), prism)
    assert len(rows) == 4
    found = np.round(angles_of(rows, 0.1), 6)
    assert set(found.tolist()) <= set(np.round(angles, 6).tolist())
    assert len(set(found.tolist())) == 4
    np.testing.assert_allclose(np.linalg.norm(rows["point_a"][0] + rows["point_a"][-1]), 0, atol=ROUNDING)


def angles_of(rows: np.ndarray, radius: float) -> np.ndarray:
    """Angles of points on a circle, in [0, 2 pi)."""
    x, y = rows["point_a"][:, 0], rows["point_a"][:, 1]
    np.testing.assert_allclose(np.hypot(x, y), radius, atol=ROUNDING)
    return np.arctan2(y, x) % (2 * np.pi)


def test_only_what_touches_is_in_the_patch(lab: SimpleNamespace) -> None:
    """Leave out the far edge of a box tilted by 1e-4, and keep it at 1e-6."""
    for tilt, count in ((1e-4, 2), (1e-6, 4)):
        rows = rows_of(lab, table(lab), on_table(lab, HALF, turn=(0.0, tilt, 0.0)))
        assert len(rows) == count
        assert rows["distance"].max() <= TOUCH_DISTANCE
        assert rows["distance"][0] == rows["distance"].min()


def test_balls_and_full_lists_keep_the_witness(lab: SimpleNamespace) -> None:
    """Leave a ball's row alone, and give a box no more rows than there is room for."""
    ball = lab.ball("ball", (0.0, 0.0, 0.05 + GAP))
    rows = rows_of(lab, table(lab), ball)
    assert rows["manifold"].tolist() == [-1]
    for room in (1, 2, 3):
        rows = rows_of(lab, table(lab), on_table(lab, HALF), room=room)
        assert len(rows) == room
        assert rows["distance"][0] == pytest.approx(GAP, abs=ROUNDING)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(x=st.floats(-0.12, 0.12), y=st.floats(-0.12, 0.12), yaw=st.floats(-3, 3), depth=st.floats(-1e-3, 5e-7))
def test_points_lie_on_both_faces(lab: SimpleNamespace, x: float, y: float, yaw: float, depth: float) -> None:
    """Put every point inside both faces, at the pair's distance."""
    low = table(lab, HALF)
    box = on_table(lab, HALF, (x, y), (0.0, 0.0, yaw))
    box = replace(box, position=(x, y, HALF[2] + depth))
    rows = rows_of(lab, low, box)
    assert 3 <= len(rows) <= 4
    turn = Rotation.from_rotvec((0, 0, yaw))
    for row in rows:
        assert row["distance"] == pytest.approx(depth, abs=ROUNDING)
        assert (np.abs(row["point_a"][:2]) <= np.array(HALF[:2]) + ROUNDING).all()
        local = turn.inv().apply(row["point_b"] - box.position)
        assert (np.abs(local) <= np.array(HALF) + ROUNDING).all()


def energy(world) -> float:
    """Of all simulated bodies in the scene's gravity [J]."""
    total, g = 0.0, world.state[0]["gravity"]
    for body in world.bodies[world.bodies["kind"] == SIMULATED]:
        spin = body["rotation"].T @ body["omega"]
        moving = body["mass"] * (body["velocity"] @ body["velocity"] / 2 - g @ body["center"])
        total += moving + spin @ body["inertia"] @ spin / 2
    return float(total)


def speed(world) -> float:
    """|v| + |w| of the fastest simulated body."""
    moving = world.bodies[world.bodies["kind"] == SIMULATED]
    return float((np.linalg.norm(moving["velocity"], axis=1) + np.linalg.norm(moving["omega"], axis=1)).max())


def tilt(body) -> float:
    """Angle between a body's z and the vertical [rad]."""
    return float(2 * np.linalg.norm(body["orientation"][1:3]))


def assert_energy_never_rises(energies: list[float], limit: float) -> None:
    """No frame ends with more than `limit` above the one before."""
    assert max(late - early for early, late in pairwise(energies)) < limit


@pytest.mark.parametrize("e", [0.0, 0.3])
def test_a_box_dropped_flat_rests_flat(lab: SimpleNamespace, e: float) -> None:
    """Bounce without spin, then lie for ten seconds without tilt, drift or gain of energy."""
    world = lab.build(lab.scene(lab.block("box", HALF, (0.0, 0.0, 0.3)), lab.ground(), e=e, mu=0.3))
    body, energies = world.bodies[0], []
    lab.play(world, 60, lambda w: energies.append(energy(w)))
    start = body["position"].copy()
    lab.play(world, 600, lambda w: energies.append(energy(w)))
    assert tilt(body) < 1e-9
    assert np.abs(body["position"] - start).max() < 1e-9
    assert np.abs(start - (0, 0, HALF[2])).max() < TOUCH_DISTANCE
    assert speed(world) < 1e-9
    assert_energy_never_rises(energies, 1e-9)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("e", [0.3, 1.0])
def test_a_flat_bounce_has_no_spin(lab: SimpleNamespace, e: float, mu: float) -> None:
    """Leave the ground at e times the speed of arrival at every corner."""
    box = lab.block("box", HALF, (0.0, 0.0, 0.06), linear_velocity=(0.0, 0.0, -2.0))
    world = lab.build(lab.scene(box, lab.ground(), e=e, mu=mu, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 2)
    # the sweeps end at a residual of 1e-12
    np.testing.assert_allclose(world.bodies[0]["velocity"], (0, 0, 2 * e), atol=1e-10)
    np.testing.assert_allclose(world.bodies[0]["omega"], 0, atol=1e-9)


@pytest.mark.parametrize("e", [0.0, 0.3])
@pytest.mark.parametrize("axis", [(0.6, 0.8, 0.0), (1.0, 0.0, 0.0), (0.3, 0.5, 0.8)])
def test_a_tilted_box_comes_to_rest(lab: SimpleNamespace, axis: tuple, e: float) -> None:
    """Lie still within three seconds of a fall at 0.3 rad, never with more energy than before."""
    turn = quaternion(*(0.3 * np.array(axis) / np.linalg.norm(axis)))
    box = lab.block("box", HALF, (0.0, 0.0, 0.3), orientation=turn)
    world = lab.build(lab.scene(box, lab.ground(), e=e, mu=0.3))
    energies, lows = [], []
    for _ in range(180):
        lab.play(world, 1)
        energies.append(energy(world))
        lows.append(float(lab.corners(lab.scene_piece(world, 0))[:, 2].min()))
    assert speed(world) < 1e-3
    # all corners touch: at most 2 TOUCH_DISTANCE apart in height
    assert tilt(world.bodies[0]) < 2 * TOUCH_DISTANCE / HALF[1]
    assert min(lows) > -2 * TOUCH_DISTANCE
    assert_energy_never_rises(energies, 1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_tumbling_box_comes_to_rest(lab: SimpleNamespace, seed: int) -> None:
    """Lie still within four seconds of a spinning fall, and gain no more energy than flight's own error."""
    rng = np.random.default_rng(seed)
    half = tuple(rng.uniform(0.03, 0.12, 3).tolist())
    spin, turn = tuple(rng.uniform(-8, 8, 3).tolist()), Rotation.random(rng=rng).as_rotvec()
    box = lab.block("box", half, (0.0, 0.0, 0.35), orientation=quaternion(*turn), angular_velocity=spin)
    world = lab.build(lab.scene(box, lab.ground(), e=(0.0, 0.3)[seed % 2], mu=0.3))
    energies = lab.play(world, 240, energy)
    assert speed(world) < 1e-3
    # the midpoint rule of free spin keeps the angular momentum, the energy only to some (w h)^3
    assert_energy_never_rises(energies, 5e-3)


def test_a_sliding_box_stops_where_coulomb_says(lab: SimpleNamespace) -> None:
    """Slide v^2 / (2 mu g) without lifting, tilting or turning."""
    v, mu = 2.0, 0.3
    box = lab.block("box", HALF, (0.0, 0.0, HALF[2]), linear_velocity=(v, 0.0, 0.0))
    world = lab.build(lab.scene(box, lab.ground(), e=0.3, mu=mu))
    body, heights, tilts = world.bodies[0], [], []
    for _ in range(90):
        lab.play(world, 1)
        heights.append(body["position"][2] - HALF[2])
        tilts.append(tilt(body))
    # the last frame brakes evenly to 0: off by at most mu g h^2 / 8
    assert body["position"][0] == pytest.approx(v * v / (2 * mu * G), rel=1e-3)
    assert np.abs(heights).max() < 1e-9
    assert max(tilts) < 1e-9
    assert abs(body["position"][1]) < 1e-9
    assert speed(world) < 1e-9


@pytest.mark.parametrize("over", [-0.01, 0.01])
def test_a_box_on_an_incline(lab: SimpleNamespace, over: float) -> None:
    """Hold just below the friction angle, and slide at g (sin a - mu cos a) just above."""
    mu = 0.3
    a = np.arctan(mu) + over
    gravity = (G * float(np.sin(a)), 0.0, -G * float(np.cos(a)))
    world = lab.build(
        lab.scene(lab.block("box", HALF, (0.0, 0.0, HALF[2])), lab.ground(), e=0.3, mu=mu, gravity=gravity)
    )
    lab.play(world, 120)
    way = 2 * G * max(0.0, np.sin(a) - mu * np.cos(a))
    assert world.bodies[0]["position"][0] == pytest.approx(way, rel=1e-6, abs=1e-9)
    assert tilt(world.bodies[0]) < 1e-9


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_stack_holds(lab: SimpleNamespace, mu: float) -> None:
    """Keep three boxes, each a little beside the other, for five seconds."""
    places = [(0.01 * k, 0.005 * k, HALF[2] * (1 + 2 * k)) for k in range(3)]
    boxes = [lab.block(f"box_{k}", HALF, place) for k, place in enumerate(places)]
    world = lab.build(lab.scene(*boxes, lab.ground(), e=0.3, mu=mu))
    energies = lab.play(world, 300, energy)
    # a cold start takes some frames to converge
    np.testing.assert_allclose(world.bodies["position"][:3], places, atol=1e-6)
    assert speed(world) < 1e-9
    assert_energy_never_rises(energies, 1e-9)


def test_a_cradle_of_boxes_passes_the_blow_on(lab: SimpleNamespace) -> None:
    """Resolve a patch as one but pairs one at a time: the last of three touching boxes takes it all."""
    half = (0.05, 0.05, 0.05)
    boxes = [lab.block(f"box_{k}", half, (0.1 * k, 0.0, 0.0)) for k in range(3)]
    striker = lab.block("striker", half, (-0.2, 0.0, 0.0), linear_velocity=(1.0, 0.0, 0.0))
    world = lab.build(lab.scene(*boxes, striker, e=1.0, mu=0.3, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 20)
    np.testing.assert_allclose(world.bodies["velocity"][:, 0], (0, 0, 1, 0), atol=1e-9)
    assert np.abs(world.bodies["omega"]).max() < 1e-9


LYING = quaternion(0.0, np.pi / 2, 0.0)
"""A capsule's axis, its own z, turned to the world's x."""


def capsule(position, orientation=LYING, **fields) -> Body:
    """A capsule of 1 kg, radius 5 cm and half length 15 cm."""
    shape, inertia = (Piece("capsule", Capsule(0.05, 0.15)),), capsule_inertia(1.0, 0.05, 0.15)
    return Body(
        "capsule",
        "simulated",
        "wood",
        shape,
        1.0,
        inertia=inertia,
        position=position,
        orientation=orientation,
        **fields,
    )


@pytest.mark.parametrize("tables", [0, 1])
def test_a_lying_capsule_touches_at_the_ends_of_its_side(lab: SimpleNamespace, tables: int) -> None:
    """Give both ends of the side, cut off where the table ends, whichever body comes first."""
    for x, ends in ((0.1, (-0.05, 0.25)), (0.45, (0.3, 0.5))):
        bodies = [capsule((x, 0.02, 0.05 + GAP))]
        bodies.insert(tables, table(lab))
        rows = rows_of(lab, *bodies)
        touching = (rows["point_a"] + rows["point_b"]) / 2
        np.testing.assert_allclose(np.sort(touching[:, 0]), ends, atol=ROUNDING)
        np.testing.assert_allclose(touching[:, 1:], [(0.02, GAP / 2)] * 2, atol=ROUNDING)
        np.testing.assert_allclose(rows["distance"], GAP, atol=ROUNDING)


def test_a_standing_capsule_touches_at_its_end(lab: SimpleNamespace) -> None:
    """Give one point under the axis."""
    rows = rows_of(lab, table(lab), capsule((0.1, 0.02, 0.2 + GAP), (1.0, 0.0, 0.0, 0.0)))
    assert_points(rows, [(0.1, 0.02)])


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2])
def test_a_dropped_capsule_comes_to_rest_on_its_side(lab: SimpleNamespace, turn: float) -> None:
    """Lie level and still two seconds after a fall at any tilt, on its side, without a gain of energy."""
    pill = capsule((0.0, 0.0, 0.25), quaternion(0.0, np.pi / 2 - turn, 0.0))
    world = lab.build(lab.scene(pill, lab.ground(), e=0.3, mu=0.3))
    energies = lab.play(world, 120, energy)
    axis = world.bodies[0]["rotation"][:, 2]
    # both ends touch: at most 2 TOUCH_DISTANCE apart in height
    assert abs(axis[2]) < 2 * TOUCH_DISTANCE / 0.3
    assert world.bodies[0]["position"][2] == pytest.approx(0.05, abs=2 * TOUCH_DISTANCE)
    assert speed(world) < 1e-6
    assert_energy_never_rises(energies, 1e-9)


def test_a_sliding_capsule_rolls_as_coulomb_says(lab: SimpleNamespace) -> None:
    """Turn sliding across the axis into rolling at v0 / (1 + I / m r^2), and keep it level and straight."""
    world = lab.build(
        lab.scene(capsule((0.0, 0.0, 0.05), linear_velocity=(0.0, 1.0, 0.0)), lab.ground(), mu=0.3)
    )
    lab.play(world, 60)
    body = world.bodies[0]
    # friction keeps the spin about the contact: m v0 r = (m r^2 + I) w
    rolling = 1 / (1 + body["inertia"][2, 2] / 0.05**2)
    np.testing.assert_allclose(body["velocity"], (0, rolling, 0), atol=1e-9)
    np.testing.assert_allclose(body["omega"], (-rolling / 0.05, 0, 0), atol=1e-7)
    assert abs(body["rotation"][2, 2]) < 1e-9


@pytest.mark.parametrize("turn", [0.0, 1.0])
@pytest.mark.parametrize(
    ("shift", "ends"), [(0.0, (-0.15, 0.15)), (0.2, (0.05, 0.15)), (-0.1, (-0.15, 0.05))]
)
def test_capsules_side_by_side_touch_at_the_ends_of_the_length_they_share(lab, turn, shift, ends) -> None:
    """Give both ends, whichever capsule comes first and wherever it points to along its axis."""
    apart = np.array((0.0, np.sin(turn), np.cos(turn)))
    above = vector((0.1 + GAP) * apart + (shift, 0.0, 0.0))
    for one, two in ((LYING, LYING), (LYING, quaternion(0.0, -np.pi / 2, 0.0))):
        bodies = [capsule((0.0, 0.0, 0.0), one), replace(capsule(above, two), name="other")]
        for ordered in (bodies, bodies[::-1]):
            rows = rows_of(lab, *ordered)
            touching = (rows["point_a"] + rows["point_b"]) / 2
            np.testing.assert_allclose(np.sort(touching[:, 0]), ends, atol=ROUNDING)
            np.testing.assert_allclose(rows["distance"], GAP, atol=ROUNDING)
            normal = apart if ordered is bodies else -apart
            np.testing.assert_allclose(rows["normal"], [normal] * 2, atol=ROUNDING)
            assert rows["manifold"].tolist() == [0, 0]


@pytest.mark.parametrize(("tilt", "count"), [(0.0, 2), (1e-6, 2), (1e-4, 1), (0.5, 1)])
def test_crossing_capsules_touch_in_one_point(lab: SimpleNamespace, tilt: float, count: int) -> None:
    """Give one point unless both ends are near enough to touch."""
    crossing = quaternion(0.0, np.pi / 2 + tilt, 0.0)
    other = replace(capsule((0.0, 0.0, 0.1 + GAP + 0.15 * np.sin(tilt)), crossing), name="other")
    assert len(rows_of(lab, capsule((0.0, 0.0, 0.0)), other)) == count


def test_a_rod_lies_still_on_two_others(lab: SimpleNamespace) -> None:
    """Rest in the groove between two rods on the ground, which friction keeps together."""
    rods = [capsule((0.0, y, 0.05)) for y in (-0.05, 0.05)]
    rods.append(capsule((0.02, 0.0, 0.05 + 0.1 * np.cos(np.pi / 6))))
    named = [replace(rod, name=f"rod_{k}") for k, rod in enumerate(rods)]
    world = lab.build(lab.scene(*named, lab.ground(), e=0.0, mu=0.5))
    energies = lab.play(world, 60, energy)
    assert speed(world) < 1e-9
    assert_energy_never_rises(energies, 1e-12)
    for rod, body in zip(named, world.bodies):
        np.testing.assert_allclose(body["position"], rod.position, atol=2 * TOUCH_DISTANCE)

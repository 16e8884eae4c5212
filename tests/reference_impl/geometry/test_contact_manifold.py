"""Contact manifolds of boxes and hulls: their points by closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold_scenes import GAP, HALF, ROUNDING, assert_points, on_table, quaternion, rows_of, table
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.support_table import distinct
from touchstone.reference_impl.core.conventions import TOUCH_DISTANCE
from touchstone.scenarios.scenario import Body, Hull, Piece
from touchstone.scenarios.solids import box_inertia, hull


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


@pytest.mark.parametrize("corners", [64, 127, 200])
def test_a_face_of_many_corners_spreads_its_points(lab: SimpleNamespace, corners: int) -> None:
    """Give four points about the centre of a disc of any number of corners."""
    angles = 2 * np.pi * np.arange(corners) / corners
    rim = [(0.1 * np.cos(t), 0.1 * np.sin(t), z) for t in angles for z in (-0.01, 0.01)]
    disc = hull("disc", "wood", [tuple(map(float, point)) for point in rim], 1.0, (0.0, 0.0, 0.01 + GAP))
    rows = rows_of(lab, table(lab), disc)
    assert len(rows) == 4
    assert np.linalg.norm(rows["point_a"][:, :2].mean(axis=0)) < 0.05


def test_corners_in_pairs_are_one() -> None:
    """Merge corners within the rounding of single precision, between which faces may be lost."""
    box = [(x, y, z) for x in (-0.1, 0.1) for y in (-0.08, 0.08) for z in (-0.05, 0.05)]
    twice = [*box, *((x + 3e-9, y - 3e-9, z) for x, y, z in box)]
    assert distinct(tuple(twice)) == tuple(box)


def test_only_what_touches_is_in_the_manifold(lab: SimpleNamespace) -> None:
    """Leave out the far edge of a box tilted by 1e-4, and keep it at 1e-6."""
    for tilt, count in ((1e-4, 2), (1e-6, 4)):
        rows = rows_of(lab, table(lab), on_table(lab, HALF, turn=(0.0, tilt, 0.0)))
        assert len(rows) == count
        assert rows["distance"].max() <= TOUCH_DISTANCE
        assert rows["distance"][0] == rows["distance"].min()


def test_what_touches_comes_before_what_is_near(lab: SimpleNamespace) -> None:
    """Keep both ends of the edge on which a disc of 16 corners stands, though all its corners are near."""
    angles = 2 * np.pi * (np.arange(16) + 0.5) / 16
    ring, tilt = [(0.1 * np.cos(a), 0.1 * np.sin(a)) for a in angles], 9e-5
    corners = [tuple(map(float, (*p, z))) for z in (-0.01, 0.01) for p in ring]
    turned = Rotation.from_rotvec((0.0, tilt, 0.0))
    height = GAP - turned.apply(corners)[:, 2].min()
    disc = hull("disc", "wood", corners, 1.0, (0.0, 0.0, height), quaternion(0.0, tilt, 0.0))
    rows = rows_of(lab, table(lab), disc, wide=True)
    assert (rows["distance"] <= TOUCH_DISTANCE).sum() == 2
    assert rows["distance"].max() > TOUCH_DISTANCE


def test_balls_and_full_lists_keep_the_witness(lab: SimpleNamespace) -> None:
    """Leave a ball's row alone, and give a box no more rows than the list has left."""
    ball = lab.ball("ball", (0.0, 0.0, 0.05 + GAP))
    rows = rows_of(lab, table(lab), ball)
    assert rows["manifold"].tolist() == [-1]
    for capacity in (1, 2, 3):
        rows = rows_of(lab, table(lab), on_table(lab, HALF), capacity=capacity)
        assert len(rows) == capacity
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

"""Contact manifolds of cylinders: caps, sides and rims, by closed forms."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from manifold_scenes import GAP, ROUNDING, quaternion, rows_of, table

from touchstone.reference_impl.core.conventions import TOUCH_DISTANCE
from touchstone.scenarios.scenario import Body
from touchstone.scenarios.solids import capsule, cylinder

RADIUS, HALF = 0.05, 0.04
LYING = quaternion(0.0, np.pi / 2, 0.0)


def drum(position, orientation=(1.0, 0.0, 0.0, 0.0), name="drum") -> Body:
    """A cylinder of RADIUS and HALF."""
    return cylinder(name, "wood", RADIUS, HALF, 1.0, position, orientation)


def points(rows: np.ndarray) -> np.ndarray:
    """Contact points in the order of their coordinates."""
    middle = (rows["point_a"] + rows["point_b"]) / 2
    return middle[np.lexsort(np.round(middle, 9).T)]


def on_rim(points: np.ndarray, center) -> np.ndarray:
    """Which points lie on a rim about a centre, in the x-y plane."""
    return np.abs(np.linalg.norm(points[:, :2] - center, axis=1) - RADIUS) < 2e-9


@pytest.mark.parametrize("turn", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("tables", [0, 1])
def test_a_standing_cylinder_touches_in_four_points_of_its_rim(lab, turn: float, tables: int) -> None:
    """Give four points a quarter of a turn apart, whichever body comes first and however it is turned."""
    bodies = [drum((0.1, 0.02, HALF + GAP), quaternion(0.0, 0.0, turn))]
    bodies.insert(tables, table(lab))
    rows = rows_of(lab, *bodies)
    found = points(rows)
    assert on_rim(found, (0.1, 0.02)).all()
    np.testing.assert_allclose(found.mean(axis=0), (0.1, 0.02, GAP / 2), atol=ROUNDING)
    apart = np.linalg.norm(found[:, None] - found, axis=2)
    np.testing.assert_allclose(np.sort(apart[0]), RADIUS * np.array([0, 2**0.5, 2**0.5, 2]), atol=1e-9)
    np.testing.assert_allclose(rows["distance"], GAP, atol=ROUNDING)


@pytest.mark.parametrize("over", [0.01, -0.02])
def test_a_cap_over_an_edge_touches_where_its_rim_crosses_it(lab, over: float) -> None:
    """Give both crossings of the rim and the table's edge, exactly, and points of the rim on the table."""
    rows = rows_of(lab, table(lab), drum((0.5 + over, 0.0, HALF + GAP)))
    found = points(rows)
    assert (found[:, 0] <= 0.5 + ROUNDING).all()
    across = np.sqrt(RADIUS**2 - over**2)
    for side in (-across, across):
        assert np.linalg.norm(found - (0.5, side, GAP / 2), axis=1).min() < 1e-9


def test_a_block_on_a_cap_touches_at_its_corners(lab: SimpleNamespace) -> None:
    """Give the corners of a face that lies within the cap."""
    block = lab.block("block", (0.03, 0.02, 0.01), (0.0, 0.0, HALF + 0.01 + GAP))
    found = points(rows_of(lab, drum((0.0, 0.0, 0.0)), block))
    np.testing.assert_allclose(np.abs(found[:, :2]), [(0.03, 0.02)] * 4, atol=ROUNDING)


@pytest.mark.parametrize("shift", [0.0, 1e-3, 0.03, 0.08])
def test_caps_on_each_other_touch_in_what_they_share(lab: SimpleNamespace, shift: float) -> None:
    """Give four points of the outline of what both caps share; of a narrow lens its corners and its ends."""
    along = np.array((0.6, 0.8))
    rows = rows_of(lab, drum((0.0, 0.0, 0.0)), drum((*(shift * along), 2 * HALF + GAP), name="other"))
    found = points(rows)
    assert len(rows) == 4
    ours, theirs = on_rim(found, (0.0, 0.0)), on_rim(found, shift * along)
    assert (ours | theirs).all()
    for center in ((0.0, 0.0), shift * along):
        assert np.linalg.norm(found[:, :2] - center, axis=1).max() < RADIUS + 2e-9
    if shift == 0.08:
        assert (ours & theirs).sum() == 2
        for end in (RADIUS * along, (shift - RADIUS) * along):
            assert np.linalg.norm(found[:, :2] - end, axis=1).min() < 1e-9


def test_a_lying_cylinder_touches_at_the_ends_of_its_side(lab: SimpleNamespace) -> None:
    """Give both ends of the side, cut off where the table ends."""
    for x, ends in ((0.1, (0.06, 0.14)), (0.49, (0.45, 0.5))):
        rows = rows_of(lab, table(lab), drum((x, 0.02, RADIUS + GAP), LYING))
        found = points(rows)
        np.testing.assert_allclose(np.sort(found[:, 0]), ends, atol=ROUNDING)
        np.testing.assert_allclose(found[:, 1:], [(0.02, GAP / 2)] * 2, atol=ROUNDING)
        assert set(rows["flat_a"].tolist()) == {2}


@pytest.mark.parametrize("tilt", [0.01, 0.5, 1.2])
def test_a_tilted_cylinder_touches_in_one_point_of_its_rim(lab: SimpleNamespace, tilt: float) -> None:
    """Give the lowest point of the rim, as a contact that is no manifold."""
    height = RADIUS * np.sin(tilt) + HALF * np.cos(tilt)
    rows = rows_of(lab, table(lab), drum((0.1, 0.02, height + GAP), quaternion(0.0, tilt, 0.0)))
    assert rows["manifold"].tolist() == [-1]
    x = 0.1 + RADIUS * np.cos(tilt) - HALF * np.sin(tilt)
    np.testing.assert_allclose(points(rows), [(x, 0.02, GAP / 2)], atol=ROUNDING)


@pytest.mark.parametrize("other", ["cylinder", "capsule"])
def test_sides_along_each_other_touch_in_two_points(lab: SimpleNamespace, other: str) -> None:
    """Give both ends of the length that they share, of two cylinders, and of a cylinder and a capsule."""
    above = (0.03, 0.0, 2 * RADIUS + GAP)
    second = (
        drum(above, LYING, "other")
        if other == "cylinder"
        else capsule("other", "wood", RADIUS, HALF, 1.0, above, LYING)
    )
    rows = rows_of(lab, drum((0.0, 0.0, 0.0), LYING), second)
    np.testing.assert_allclose(np.sort(points(rows)[:, 0]), (0.03 - HALF, HALF), atol=ROUNDING)
    np.testing.assert_allclose(rows["distance"], GAP, atol=ROUNDING)


def test_crossed_cylinders_touch_in_one_point(lab: SimpleNamespace) -> None:
    """Give the point over which both axes cross."""
    crossing = quaternion(np.pi / 2, 0.0, 0.0)
    rows = rows_of(lab, drum((0.0, 0.0, 0.0), LYING), drum((0.01, 0.02, 2 * RADIUS + GAP), crossing, "other"))
    np.testing.assert_allclose(points(rows)[:, :2], [(0.01, 0.0)], atol=1e-6)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    other=st.sampled_from(("cylinder", "capsule")),
    turns=st.tuples(*[st.floats(-3, 3)] * 6),
    toward=st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 0.1),
    apart=st.floats(0.2, 2.0),
)
def test_no_point_is_deeper_than_the_pieces(lab: SimpleNamespace, other, turns, toward, apart) -> None:
    """Give no point that overlaps by more than the pieces do, along any normal, whatever touches what."""
    place = (tuple(apart * RADIUS * np.array(toward) / np.linalg.norm(toward)), quaternion(*turns[3:]))
    first = drum((0.0, 0.0, 0.0), quaternion(*turns[:3]))
    second = (
        drum(*place, "other") if other == "cylinder" else capsule("other", "wood", RADIUS, HALF, 1.0, *place)
    )
    rows = rows_of(lab, first, second)
    if len(rows):
        assert rows["distance"].min() >= -rows["depth"].max() - TOUCH_DISTANCE

"""Contact manifolds of capsules: their points by closed forms."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from manifold_scenes import GAP, LYING, ROUNDING, assert_points, capsule, quaternion, rows_of, table

from touchstone.scenarios.scenario import vector


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


@pytest.mark.parametrize("turn", [0.0, 1.0])
@pytest.mark.parametrize(("shift", "ends"), [(0, (-0.15, 0.15)), (0.2, (0.05, 0.15)), (-0.1, (-0.15, 0.05))])
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

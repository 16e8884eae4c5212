"""The smallest translation out of several depths: by hand, by its conditions of optimality, and by scipy."""

from math import cos, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import nnls

from touchstone.reference_impl.core.conventions import MOVER_BODY
from touchstone.reference_impl.core.world import BODY, PAIR
from touchstone.reference_impl.posture.global_depth import Mover
from touchstone.reference_impl.posture.min_norm_translation import PLANE_TOLERANCE, min_norm_translation
from touchstone.reference_impl.posture.overlap_removal import LONGEST_SHIFT

X, Y, Z = np.eye(3)


def least(normals, depths):
    """(deepest, |x|, x) of body 1 among bodies 0 (as A) and 2 (as B, in every second plane)."""
    bodies, pairs = np.zeros(3, BODY), np.zeros(len(depths), PAIR)
    bodies["driver"] = -1
    for k, (pair, n, d) in enumerate(zip(pairs, normals, depths)):
        pair["body_a"], pair["body_b"] = (0, 1) if k % 2 == 0 else (1, 2)
        pair["normal"], pair["depth"] = n if k % 2 == 0 else -np.asarray(n), d
    x, mover = np.zeros(3), Mover(MOVER_BODY, 1)
    return *min_norm_translation(bodies, pairs, 0, len(pairs), mover, np.zeros((4, 4)), x), x


def distance_program(normals, depths) -> np.ndarray | None:
    """The same by scipy: least distance programming by non-negative least squares (Lawson & Hanson 1974)."""
    scale = depths.max()
    rows = np.vstack((normals.T, depths / scale))
    weights, _ = nnls(rows, np.array((0.0, 0.0, 0.0, 1.0)))
    rest = rows @ weights - (0.0, 0.0, 0.0, 1.0)
    # rest[3] is -1 / (1 + (|x| / scale)^2)
    return -scale * rest[:3] / rest[3] if rest[3] < -1e-8 else None


def assert_least(normals, depths, x) -> None:
    """x meets all depths, and is a sum of the normals it rests on with weights >= 0: nothing is smaller."""
    gaps, slack = normals @ x - depths, slack_of(depths, x)
    assert gaps.min() >= -slack
    # convex: these conditions (Karush, Kuhn, Tucker) suffice
    _, missing = nnls(normals[gaps <= slack].T, x)
    # weights of nearly parallel normals are large and cancel
    assert missing <= 1e-8 * np.linalg.norm(x)


def slack_of(depths, x) -> float:
    """Depth that may be left [m]: 1e-12 of the largest, unless x is 50 times as long (a narrow wedge)."""
    return 2 * PLANE_TOLERANCE * (depths.max() + np.linalg.norm(x))


@pytest.mark.parametrize(
    "normals",
    [
        (X, -X),
        (X, Z, -X),
        # three in a plane, and four round a point
        ((1, 0, 0), (cos(2.1), sin(2.1), 0), (cos(2.1), -sin(2.1), 0)),
        (-X, -Y, -Z, (1 / np.sqrt(3),) * 3),
    ],
)
def test_opposing_normals_have_no_answer(normals) -> None:
    """Report |x| = 0 at a depth, and leave x at 0, where the normals enclose the mover."""
    deepest, size, x = least(normals, np.linspace(0.02, 0.01, len(normals)))
    assert (deepest, size) == (0.02, 0.0)
    np.testing.assert_array_equal(x, 0)


def unit(vector) -> np.ndarray:
    return np.asarray(vector) / np.linalg.norm(vector)


@st.composite
def planes(draw):
    """Up to eight planes: fresh ones, copies, ones nearly parallel or opposed to another, redundant ones."""
    coordinate = st.integers(-1000, 1000)
    vector = st.tuples(coordinate, coordinate, coordinate).filter(any)
    normals, depths = [unit(draw(vector))], [10 ** draw(st.floats(-7, -1))]
    for _ in range(draw(st.integers(0, 7))):
        like = draw(st.integers(0, len(normals) - 1))
        n, d = normals[like], depths[like]
        match draw(st.sampled_from(("fresh", "fresh", "copy", "near", "opposed", "redundant"))):
            case "fresh":
                n, d = unit(draw(vector)), 10 ** draw(st.floats(-7, -1))
            case "copy":
                d *= draw(st.sampled_from((1.0, 1.0 + 1e-15, 1.0 - 1e-9, 2.0)))
            case "near":
                n = unit(n + 10.0 ** -draw(st.integers(1, 15)) * unit(draw(vector)))
                d *= draw(st.sampled_from((1.0, 1.0 + 1e-14, 1.0 - 1e-9, 1.1)))
            case "opposed":
                n = unit(-n + 10.0 ** -draw(st.integers(0, 2)) * unit(draw(vector)) * 0.9)
            case "redundant":
                total = n + normals[0]
                length = np.linalg.norm(total)
                if length > 0.1:
                    n, d = total / length, (d + depths[0]) / length
        normals.append(n)
        depths.append(d)
    return np.array(normals), np.array(depths)


@settings(max_examples=400, deadline=None)
@given(planes())
def test_nothing_smaller_meets_all_depths(instance) -> None:
    """Meet every depth with the smallest x, or find that scipy knows none either."""
    normals, depths = instance
    deepest, size, x = least(normals, depths)
    assert deepest == depths.max()
    assert size == np.linalg.norm(x) or size == pytest.approx(np.linalg.norm(x), rel=1e-15)
    other = distance_program(normals, depths)
    if 0 < size <= LONGEST_SHIFT * deepest:
        assert_least(normals, depths, x)
        # where normals are nearly parallel, nnls may end at a longer one
        assert np.linalg.norm(other - x) <= 1e-6 * size or size < np.linalg.norm(other)
    else:
        # no x, or only one so long that the removal takes the normals for opposing
        assert other is None or np.linalg.norm(other) > 0.99 * LONGEST_SHIFT * deepest


def test_order_decides_nothing_but_rounding() -> None:
    """Find the same x in any order of thirty planes, and the same bits twice."""
    generator = np.random.default_rng(5)
    normals = generator.normal(size=(30, 3)) + (0.0, 0.0, 3.0)
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    depths = generator.uniform(0, 0.05, 30)
    _, _, x = least(normals, depths)
    assert_least(normals, depths, x)
    np.testing.assert_array_equal(least(normals, depths)[2], x)
    for _ in range(10):
        order = generator.permutation(30)
        np.testing.assert_allclose(least(normals[order], depths[order])[2], x, rtol=1e-12)

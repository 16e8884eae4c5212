"""Capsules against capsules and boxes: a second opinion on any two."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reference_impl.core.conventions import TOUCHING_DISTANCE_SHARE
from touchstone.scenarios.scenario import Box, Capsule, Piece

ROUNDING = 1e-14
"""A few roundings of lengths of about 1 m [m]."""
LONG = Capsule(0.1, 0.5)
WHOLE = Rotation.from_rotvec((0.4, -0.3, 1.1))
"""Turns whole scenes, so that no axis of theirs is one of the world's."""


def core(piece: Piece) -> np.ndarray:
    """Both ends of the core of a capsule or a sphere, in the world."""
    half = piece.shape.half_length if isinstance(piece.shape, Capsule) else 0.0
    axis = Rotation.from_quat(piece.orientation, scalar_first=True).apply((0.0, 0.0, half))
    return np.array((piece.position - axis, piece.position + axis))


def assert_parts(found, one: Piece, two: Piece) -> None:
    """The normal is a unit vector, the gap along it is the distance, and the witnesses show both."""
    a, b, n = core(one), core(two), found.normal
    size = float(np.ptp(np.vstack([a, b]), axis=0).max()) + one.shape.radius + two.shape.radius
    assert found.converged
    assert np.linalg.norm(n) == pytest.approx(1, abs=ROUNDING)
    radii = one.shape.radius + two.shape.radius
    gap = (b @ n).min() - (a @ n).max() - radii
    # the normal is as good as rounding over the distance of the cores, and a share where they nearly meet
    slack = ROUNDING if found.distance + radii > 0.01 * size else 2 * TOUCHING_DISTANCE_SHARE * size
    assert gap == pytest.approx(found.distance, abs=slack)
    np.testing.assert_allclose(found.point_b - found.point_a, found.distance * n, atol=slack, rtol=0)


def test_parallel_capsules_touch_in_the_middle(lab: SimpleNamespace) -> None:
    """Put the witnesses in the middle of where the sides face each other, not at an end."""
    one, two = lab.piece(LONG), lab.piece(Capsule(0.2, 0.7), (0.5, 0.0, 0.9))
    found = lab.measure(one, two)
    np.testing.assert_allclose(found.point_a, (0.1, 0.0, 0.35), atol=ROUNDING)
    np.testing.assert_allclose(found.point_b, (0.3, 0.0, 0.35), atol=ROUNDING)


COORDINATE = st.floats(-1.0, 1.0, allow_subnormal=False)
TILT = st.sampled_from([0.0, 1e-15, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3, 0.5, np.pi / 2])


@settings(max_examples=300, deadline=None, derandomize=True)
@given(center=st.tuples(COORDINATE, COORDINATE, COORDINATE), tilt=TILT, half=st.floats(0.01, 1.0), flat=TILT)
@example(center=(0.3, 0.0, 0.4), tilt=np.pi / 2, half=0.7, flat=0.0)  # crossed, the cores meet
@example(center=(0.7, 0.0, 0.4), tilt=np.pi / 2, half=0.7, flat=0.0)  # an end on a core
@example(center=(0.0, 0.0, 0.0), tilt=0.0, half=0.5, flat=0.0)  # one in the other
@example(center=(0.0, 0.0, 0.3), tilt=0.0, half=0.5, flat=0.0)  # on one line
def test_any_two_capsules(lab: SimpleNamespace, center, tilt: float, half: float, flat: float) -> None:
    """Agree with a bounded least-squares problem, also where cores are nearly parallel or nearly meet."""
    shift = np.array(center) * (1.0, flat, 1.0)
    one = lab.piece(LONG, (0.0, 0.0, 0.0), WHOLE)
    two = lab.piece(Capsule(0.2, half), WHOLE.apply(shift), WHOLE * Rotation.from_rotvec((0.0, tilt, 0.0)))
    found = lab.measure(one, two)
    (a, a2), (b, b2) = core(one), core(two)
    axes = np.array((a2 - a, b - b2)).T
    best = lsq_linear(axes, b - a, bounds=(0, 1), tol=1e-15)
    least = float(np.linalg.norm(axes @ best.x - (b - a)))
    # its iterations end early where cores are nearly parallel: it may only be farther
    assert found.distance + 0.3 <= least + 1e-14
    assert found.distance + 0.3 == pytest.approx(least, abs=1e-5)
    assert_parts(found, one, two)


def test_random_capsules_and_boxes_equal_the_explicit_difference(lab: SimpleNamespace) -> None:
    """Agree with the Minkowski difference of the core's ends and the box's corners, less the radius."""
    rng = np.random.default_rng(7)
    inside = 0
    for _ in range(200):
        box = lab.piece(Box(tuple(rng.uniform(0.2, 1.0, 3))), (0.0, 0.0, 0.0), Rotation.random(rng=rng))
        capsule = lab.piece(
            Capsule(rng.uniform(0.05, 0.5), rng.uniform(0.05, 1.0)),
            rng.normal(size=3) * rng.choice([0.2, 1.0]),
            Rotation.random(rng=rng),
        )
        truth, _ = signed_distance(lab.corners(box), core(capsule))
        found = lab.measure(box, capsule)
        assert found.converged
        # the oracle's own rounding is about 1e-13
        assert found.distance == pytest.approx(truth - capsule.shape.radius, abs=1e-12)
        inside += truth < 0
    assert 40 < inside < 160

"""Convex depth against the explicit Minkowski difference, closed forms and symmetry."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.oracles.minkowski import signed_distance
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import PAIR
from touchstone.reference_impl.geometry.convex_depth import witnesses
from touchstone.scenarios.scenario import Box, Hull, Piece, Sphere
from touchstone.scenarios.solids import elliptic_hull

PAIRS = 250
"""Random pairs of a seed: ten seeds, nine of them slow, make 10,000."""
EXACT = 1e-11
"""Allowed error over max(depth, a thousandth of the size): the oracle's own rounding is about 1e-13."""
DEGENERATE = 1e-10
"""Allowed error over the size where faces are coplanar or a millionth wide: rounding times 1e6 [1]."""


def icosphere(rng: np.random.Generator) -> np.ndarray:
    """162 vertices, 320 triangles: the icosphere of 80, subdivided once more."""
    coarse = np.array(elliptic_hull((1.0, 1.0, 1.0)))
    hull = ConvexHull(coarse)
    edges = {tuple(sorted((s[i], s[j]))) for s in hull.simplices for i, j in ((0, 1), (1, 2), (2, 0))}
    fine = np.vstack([coarse, [coarse[i] + coarse[j] for i, j in sorted(edges)]])
    return fine / np.linalg.norm(fine, axis=1, keepdims=True) * np.exp(rng.normal(size=3) * 0.5)


def random_shape(rng: np.random.Generator) -> Hull | Box:
    """A box, an elliptic hull of 80 or 320 triangles or the hull of a few random points (8 triangles up)."""
    kind = rng.choice(["box", "elliptic", "fine", "points"], p=[0.3, 0.3, 0.05, 0.35])
    if kind == "box":
        return Box(tuple(np.exp(rng.normal(size=3) * 0.5)))
    if kind == "elliptic":
        return Hull(elliptic_hull(tuple(np.exp(rng.normal(size=3) * 0.5))))
    points = icosphere(rng) if kind == "fine" else rng.normal(size=(rng.integers(6, 50), 3))
    return Hull(tuple(map(tuple, points[ConvexHull(points).vertices])))


def random_turn(rng: np.random.Generator) -> Rotation:
    """A random rotation; none in a quarter of all cases, so that faces are parallel too."""
    return Rotation.from_quat(rng.normal(size=4)) if rng.random() < 0.75 else Rotation.identity()


def assert_consistent(depth, size: float) -> None:
    """Witnesses differ by the distance along a unit normal."""
    assert abs(np.linalg.norm(depth.normal) - 1) < 1e-14
    gap = depth.point_b - depth.point_a - depth.distance * depth.normal
    # the direction is known to rounding over APART = 1e-3 of the size
    assert np.linalg.norm(gap) <= 1e-11 * size


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.slow) for k in range(1, 40))])
def test_random_pairs_equal_the_explicit_minkowski_difference(lab: SimpleNamespace, seed: int) -> None:
    """Agree with the oracle on pairs of hulls and boxes of 8 to 320 triangles, overlapping and apart."""
    rng = np.random.default_rng((20041, seed))
    outside = 0
    for _ in range(PAIRS):
        a = lab.piece(random_shape(rng), rng.normal(size=3) * rng.choice([0.3, 1, 2]), random_turn(rng))
        b = lab.piece(random_shape(rng), (0, 0, 0), random_turn(rng))
        outside += assert_true(lab, a, b)
    assert 0.1 < outside / PAIRS < 0.9


def assert_true(lab: SimpleNamespace, a: Piece, b: Piece) -> bool:
    """Depth, normal and witnesses agree with the explicit Minkowski difference; returns whether apart."""
    points_a, points_b = lab.corners(a), lab.corners(b)
    truth, normal = signed_distance(points_a, points_b)
    found = lab.measure(a, b)
    size = float(np.ptp(np.vstack([points_a, points_b]), axis=0).max())
    assert found.converged
    assert abs(found.distance - truth) <= EXACT * max(-truth, 1e-3 * size)
    assert_consistent(found, size)
    for points, witness in ((points_a, found.point_a), (points_b, found.point_b)):
        beyond = ConvexHull(points).equations @ [*witness, 1]
        assert beyond.max() <= 1e-11 * size, "the witness does not lie on its piece"
    # normals may differ only where two faces are equally deep
    apart = (points_b @ found.normal).min() - (points_a @ found.normal).max()
    assert abs(apart - truth) <= EXACT * size
    if truth > 0:
        # the nearest point of a convex body is unique; its direction is good to rounding over distance
        assert found.normal @ normal > 1 - 1e-12 * (size / truth) ** 2
    return truth > 0


def boxes_apart(half_a, half_b, shift) -> float:
    """Signed distance of two boxes with common axes."""
    gap = np.abs(shift) - (np.array(half_a) + half_b)
    return float(np.linalg.norm(np.maximum(gap, 0)) if gap.max() > 0 else gap.max())


def parallel_boxes(lab, half_a, half_b, shift, turn, as_hulls) -> tuple[Piece, Piece]:
    """Two boxes with common axes, as boxes or as hulls of their corners."""
    shapes = [Box(tuple(map(float, half))) for half in (half_a, half_b)]
    if as_hulls:
        shapes = [Hull(tuple(map(tuple, lab.corners(lab.piece(shape)).tolist()))) for shape in shapes]
    return lab.piece(shapes[0], (0, 0, 0), turn), lab.piece(shapes[1], turn.apply(shift), turn)


COUNTEREXAMPLES = {
    # GJK ended 2e-15 m from an origin that lies 1 cm inside: reported as touching
    "sliver": (
        ((0.01, 1.0, 0.001), (0.01, 1.0, 0.1), (0.01, 0.0, 0.0)),
        (0.1687487853463431, -0.8895397612815367, -0.1947561892812019, 0.3772438035011115),
    ),
    # EPA added four vertices for ever, for an edge of a micrometre had no area; depth 1 m instead of 1e-6 m
    "corner": (
        ((1.0, 0.5, 0.5), (5e-7, 2e-6, 2e-6), (0.9999995, 0.499998, 0.500001)),
        (0.6888177461068713, 0.5009393730583447, -0.47337447054103476, -0.2247364407659725),
    ),
}


@pytest.mark.parametrize("name", COUNTEREXAMPLES)
def test_counterexamples(lab: SimpleNamespace, name: str) -> None:
    """Keep right what was once wrong."""
    (half_a, half_b, shift), quaternion = COUNTEREXAMPLES[name]
    turn = Rotation.from_quat(quaternion, scalar_first=True)
    found = lab.measure(*parallel_boxes(lab, half_a, half_b, np.array(shift), turn, False))
    assert abs(found.distance - boxes_apart(half_a, half_b, shift)) <= DEGENERATE * 2
    assert found.iterations < 32


def test_a_tiny_box_in_an_edge(lab: SimpleNamespace) -> None:
    """Measure 5e-6 m at an edge of a box 2e5 times the size: rounding once won, and gave 1e-5 m or 0.3 m."""
    half, small, shift = (1.0, 0.5, 0.5), (5e-6, 5e-6, 5e-6), np.array([0.999995, 5e-6, -0.5])
    found = lab.measure(*parallel_boxes(lab, half, small, shift, Rotation.identity(), True))
    truth = boxes_apart(half, small, shift)
    assert truth == pytest.approx(-5e-6)
    assert found.converged
    assert abs(found.distance - truth) <= 1e-15


def test_a_pose_that_is_no_number_is_told(lab: SimpleNamespace) -> None:
    """Answer in finite numbers that nothing converged where a pose is not finite."""
    for bad in (np.nan, np.inf):
        for shapes in ((Box((1.0, 1.0, 1.0)), Sphere(1.0)), (Hull(elliptic_hull((1.0, 0.5, 0.5))),) * 2):
            found = lab.measure(lab.piece(shapes[0]), lab.piece(shapes[1], (bad, 0.0, 0.0)))
            assert not found.converged
            assert np.isfinite([found.distance, *found.normal, *found.point_a, *found.point_b]).all()


def test_a_tetrahedron_writes_nothing_beyond_the_state() -> None:
    """Witnesses of a simplex of four vertices, which rounding can leave of an overlap, have no feature."""
    states = np.zeros(2, STATE)
    states[0]["corner"][:4] = 7
    states[0]["weights"] = 0.25
    witnesses(states[0], 4, np.zeros(1, PAIR)[0])
    assert states[0]["feature_count"] == 0
    assert not states[1:].view(np.uint8).any()

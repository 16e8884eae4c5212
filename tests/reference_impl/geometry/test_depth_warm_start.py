"""Walked depth: closed forms along coherent motions, and certificates that never differ from exact depth."""

from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.engines.reference.reference_world import piece_arrays
from touchstone.reference_impl.core import conventions
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.core.world import BODY, PAIR
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.geometry.depth_cache import steady_support
from touchstone.reference_impl.geometry.depth_warm_start import warm_started_depth
from touchstone.reference_impl.geometry.shapes import local_support, place_piece
from touchstone.scenarios.scenario import Box, Capsule, Ellipsoid, Hull, Piece, Shape, Sphere
from touchstone.scenarios.solids import elliptic_hull

AGREE = 1e-11
"""Allowed difference from exact depth over max(|distance|, size / 1000): as in test_convex_depth."""
FINGER = Hull(elliptic_hull((0.024, 0.008, 0.008)))
TABLE = Box((0.6, 0.4, 0.02))
STILL = Rotation.identity()


class Found(NamedTuple):
    """What `warm_started_depth` says, and `convex_depth` beside it."""

    iterations: int
    converged: bool
    certified: bool
    distance: float
    exact: float
    exact_converged: bool


class Walker:
    """Two pieces that move, what is remembered of them, and the exact depth beside it."""

    def __init__(self, a: Shape, b: Shape, depth: int = conventions.DEPTH_CERTIFIED) -> None:
        self.pieces, self.vertices = piece_arrays([(0, Piece("a", a)), (1, Piece("b", b))])
        self.bodies = np.zeros(2, BODY)
        self.state, self.fresh = np.zeros(1, STATE), np.zeros(1, STATE)
        self.state["depth"] = depth
        self.memory = self.state[0]["depth_cache"][0]
        self.pairs = np.zeros(2, PAIR)

    def at(self, position, turn=STILL, position_b=(0.0, 0.0, 0.0), turn_b=STILL) -> Found:
        """Pose both pieces and ask both methods."""
        poses = ((position, turn), (position_b, turn_b))
        for body, row, (place, rotation) in zip(self.bodies, self.pieces, poses):
            body["position"], body["rotation"] = place, rotation.as_matrix()
            place_piece(row, body, self.vertices, 0.0)
        one, two = self.pieces
        found = warm_started_depth(one, two, self.vertices, self.state[0], self.memory, self.pairs[0])
        _, converged = convex_depth(one, two, self.vertices, self.fresh[0], self.pairs[1])
        walked, exact = self.pairs["distance"].tolist()
        return Found(*found, walked, exact, converged)

    @property
    def size(self) -> float:
        """Longest side of both bounding boxes [m]."""
        return float((self.pieces["high"] - self.pieces["low"]).max())


def assert_exact(found: Found, walker: Walker) -> None:
    """What is certified is what `convex_depth` gives, with witnesses to match."""
    assert found.converged
    row = walker.pairs[0]
    if found.certified and found.exact_converged:
        tolerance = AGREE * max(abs(found.exact), 1e-3 * walker.size)
        assert abs(found.distance - found.exact) <= tolerance
        # GJK's normal is its nearest point over the cores' distance: good to rounding over that
        apart = abs(found.distance + walker.pieces["radius"].sum())
        assert abs(np.linalg.norm(row["normal"]) - 1) < 1e-14 + 1e-15 * walker.size / max(apart, 1e-15)
        gap = row["point_b"] - row["point_a"] - row["distance"] * row["normal"]
        # the direction is known to rounding over APART = 1e-3 of the size
        assert np.linalg.norm(gap) <= 1e-11 * walker.size


def random_hull(rng: np.random.Generator, count: int) -> Hull:
    """The hull of random points, about 1 m wide."""
    points = rng.normal(size=(count, 3)) * 0.3
    return Hull(tuple(map(tuple, points[ConvexHull(points).vertices].tolist())))


def random_shape(rng: np.random.Generator) -> Shape:
    """A hull of few or many points, a box, a ball or an elliptic hull, about 1 m wide."""
    half = tuple((0.3 * np.exp(rng.normal(size=3) * 0.4)).tolist())
    kinds = (random_hull(rng, 8), random_hull(rng, 60), Box(half), Sphere(half[0]), Hull(elliptic_hull(half)))
    return kinds[rng.integers(len(kinds))]


def test_an_ellipsoid_slides_over_a_table() -> None:
    """Give the height of a tilted ellipsoid over a face in one step: a box' face needs no corners."""
    half, turn = np.array((0.03, 0.02, 0.01)), Rotation.from_rotvec([0.3, 0.8, -0.1])
    walker = Walker(Ellipsoid(tuple(half.tolist())), TABLE)
    reach = np.linalg.norm(turn.as_matrix()[2] * half)
    for frame in range(60):
        height = 1e-4 * np.cos(0.3 * frame)
        found = walker.at((1e-3 * frame, 0.0, 0.02 + reach + height), turn)
        if frame > 0:
            assert (found.iterations, found.certified) == (1, True)
            assert found.distance == pytest.approx(height, abs=1e-16)


RNG = np.random.default_rng(2004)
COHERENT: dict[str, tuple[Shape, Shape]] = {
    "hull-hull": (random_hull(RNG, 30), random_hull(RNG, 60)),
    "finger-finger": (FINGER, FINGER),
    "hull-box": (random_hull(RNG, 40), Box((0.4, 0.3, 0.1))),
    "box-hull": (Box((0.2, 0.3, 0.4)), random_hull(RNG, 12)),
    "box-box": (Box((0.5, 0.4, 0.3)), Box((0.3, 0.2, 0.6))),
    "sphere-box": (Sphere(0.2), Box((0.3, 0.2, 0.1))),
    "sphere-hull": (Sphere(0.3), random_hull(RNG, 40)),
    "sphere-sphere": (Sphere(0.3), Sphere(0.2)),
    "capsule-box": (Capsule(0.1, 0.3), Box((0.3, 0.2, 0.1))),
    "hull-capsule": (random_hull(RNG, 40), Capsule(0.2, 0.2)),
}


def follow(walker: Walker, rng: np.random.Generator, frames: int):
    """A tumbling A on a path through overlap and separation; B turns too, away from the world's origin."""
    size = float(sum(np.linalg.norm(row["high"] - row["low"]) for row in placed(walker))) / 4
    turn, turn_b, origin = STILL, STILL, rng.normal(size=3) * size
    spin, rates = rng.normal(size=3) * 5e-3, rng.uniform(0.005, 0.02, size=3)
    for frame in range(frames):
        turn = Rotation.from_rotvec(spin + rng.normal(size=3) * 2e-3) * turn
        turn_b = Rotation.from_rotvec(-spin[::-1] / 3) * turn_b
        path = size * np.sin(frame * rates + (0.0, 0.5, 1.0))
        found = walker.at(origin + path, turn, origin, turn_b)
        assert_exact(found, walker)
        yield found


def placed(walker: Walker) -> np.ndarray:
    """The pieces with the boxes they have at the origin."""
    walker.at((0.0, 0.0, 0.0))
    return walker.pieces


@pytest.mark.parametrize("name", COHERENT)
def test_coherent_motion(name: str) -> None:
    """Equal exact depth in a thousand frames of tumbling through overlap and separation."""
    walker, frames = Walker(*COHERENT[name]), 1000
    seen = list(follow(walker, np.random.default_rng(7), frames))
    assert all(found.certified for found in seen)
    overlapping = sum(found.exact < 0 for found in seen)
    assert 0.05 * frames < overlapping < 0.95 * frames


@pytest.mark.parametrize("depth", [conventions.DEPTH_WALK, conventions.DEPTH_CERTIFIED])
@pytest.mark.parametrize("name", COHERENT)
def test_teleports(name: str, depth: int) -> None:
    """Certify nothing false when a pose has nothing to do with the last."""
    walker, rng = Walker(*COHERENT[name], depth), np.random.default_rng(11)
    for _ in range(300):
        turns = Rotation.from_quat(rng.normal(size=(2, 4)))
        assert_exact(walker.at(rng.normal(size=3) * walker.size / 4, turns[0], (0, 0, 0), turns[1]), walker)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    seed=st.integers(0, 10**6),
    moved=st.sampled_from([0.0, 1e-9, 1e-6, 1e-3, 0.03, 0.3]),
    turned=st.sampled_from([0.0, 1e-9, 1e-6, 1e-3, 0.03, 0.3]),
    aligned=st.booleans(),
    depth=st.sampled_from([conventions.DEPTH_WALK, conventions.DEPTH_CERTIFIED]),
)
def test_no_certificate_is_false(seed: int, moved: float, turned: float, aligned: bool, depth: int) -> None:
    """Hunt false certificates: steps of all sizes from any pose, faces parallel too."""
    rng = np.random.default_rng(seed)
    walker = Walker(random_shape(rng), random_shape(rng), depth)
    position, turn = rng.normal(size=3) * 0.3, STILL if aligned else Rotation.from_quat(rng.normal(size=4))
    if aligned:
        position = np.round(position, 1)
    for _ in range(8):
        found = walker.at(position, turn)
        assert_exact(found, walker)
        # without a certificate a depth is too large, never too small
        assert found.distance <= found.exact + AGREE * walker.size or not found.exact_converged
        assert found.certified or depth == conventions.DEPTH_WALK
        position = position + moved * rng.normal(size=3)
        turn = Rotation.from_rotvec(turned * rng.normal(size=3)) * turn


def test_the_papers_walk_overestimates() -> None:
    """Keep to the face it came through, without a certificate, when another has become nearer."""
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * (0.5, 0.5, 0.5)
    plate, tower = Hull(tuple(map(tuple, corners.tolist()))), Box((0.2, 0.2, 0.2))
    answers = {}
    for depth in (conventions.DEPTH_WALK, conventions.DEPTH_CERTIFIED):
        walker = Walker(plate, tower, depth)
        # down through the top, off the middle: the side is nearer once the depth passes 0.3
        seen = [walker.at((0.41, 0.03, 0.71 - 0.01 * frame)) for frame in range(60)]
        answers[depth] = seen
    walked, certified = answers[conventions.DEPTH_WALK][-1], answers[conventions.DEPTH_CERTIFIED][-1]
    assert not walked.certified
    assert walked.distance == pytest.approx(-0.58, abs=1e-12)
    assert certified.certified
    assert certified.distance == walked.exact == pytest.approx(-0.29, abs=1e-12)


@pytest.mark.parametrize("count", [42, 300])
def test_a_steady_corner_is_the_farthest(count: int) -> None:
    """Give the support point of every direction, by the cone in most frames of a slow turn."""
    rng = np.random.default_rng(1)
    hull = FINGER if count == 42 else random_hull(rng, count)
    walker = Walker(hull, hull)
    walker.at((0.0, 0.0, 0.0))
    walker.memory["cone"] = 0.0
    piece, kept = walker.pieces[0], 0
    direction, drift = np.array((0.1, -0.3, 0.9)), rng.normal(size=3)
    for _ in range(2000):
        direction = direction + 2e-4 * drift
        n = direction / np.linalg.norm(direction)
        away = np.linalg.norm(n - walker.memory["toward"][0])
        kept += int(away**2 < walker.memory["cone"][0])
        found = steady_support(piece, walker.vertices, walker.memory, 0, *n)
        _, *wanted = local_support(piece, walker.vertices, *n)
        # two corners may be equally far
        assert n @ found == pytest.approx(n @ wanted, abs=1e-16)
    assert kept > 1000

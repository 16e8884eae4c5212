"""Depth of cylinders, cones and rounded shapes: closed forms, and the least support value over directions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.scenarios.extents import extents
from touchstone.scenarios.random_scenes.bodies import random_shape
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    HalfSpace,
    Piece,
    RoundedBox,
    RoundedHull,
    Sphere,
)

EXACT = 1e-11
"""Of a distance of pieces of about 1 m [m]."""
UNBEATEN = 1e-9
"""By how much no searched direction has a larger gap than the one that is found [m]."""
KINDS = ("sphere", "box", "capsule", "ellipsoid", "hull", "cylinder", "cone", "rounded_box")
LYING = Rotation.from_rotvec((0.0, np.pi / 2, 0.0))


def support_of(piece: Piece, ways: np.ndarray) -> np.ndarray:
    """Extents of a piece from its origin along unit vectors of the world (n, 3) [m]."""
    local = Rotation.from_quat(piece.orientation, scalar_first=True).inv().apply(ways)
    return extents(piece.shape, np.broadcast_to(local[:, None], (len(ways), 3, 3)))[1][:, 0]


def gaps_along(a: Piece, b: Piece, ways: np.ndarray) -> np.ndarray:
    """Gaps of two pieces along unit vectors from A to B (n, 3): at most their signed distance."""
    return ways @ np.subtract(b.position, a.position) - support_of(a, ways) - support_of(b, -ways)


def largest_gap(a: Piece, b: Piece, rng: np.random.Generator) -> float:
    """Largest gap over random directions, the pieces' axes, and ever nearer ones about the best ten."""
    turns = [Rotation.from_quat(p.orientation, scalar_first=True).as_matrix().T for p in (a, b)]
    ways = np.vstack([rng.normal(size=(300, 3)), *turns, -np.vstack(turns)])
    for reach in 0.3 * 0.5 ** np.arange(12):
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        gaps = gaps_along(a, b, ways)
        best = ways[np.argsort(-gaps)[:10]]
        ways = np.vstack([best, *(best + reach * rng.normal(size=best.shape) for _ in range(4))])
    return float(gaps.max())


def random_turn(rng: np.random.Generator) -> Rotation:
    """Random, along the axes, or next to that."""
    kind = rng.integers(3)
    if kind == 0:
        return Rotation.from_quat(rng.normal(size=4))
    if kind == 1:
        return Rotation.from_rotvec(np.pi / 2 * np.eye(3)[rng.integers(3)] * rng.integers(4))
    return Rotation.from_rotvec(rng.normal(size=3) * 10 ** rng.uniform(-12, -3))


@pytest.mark.parametrize("pairs", [6, pytest.param(200, marks=pytest.mark.slow)])
@pytest.mark.parametrize("rimmed", [Cylinder, Cone])
@pytest.mark.parametrize("kind", KINDS)
def test_no_direction_has_a_larger_gap(lab: SimpleNamespace, kind: str, rimmed: type, pairs: int) -> None:
    """Find a normal along which pieces have the distance that is returned, and no direction with more."""
    rng = np.random.default_rng(KINDS.index(kind))
    for _ in range(pairs):
        shapes = [rimmed(*np.exp(0.5 * rng.normal(size=2)).tolist()) for _ in range(2)]
        if kind != "cylinder":
            shapes[1] = random_shape(rng, float(np.exp(0.5 * rng.normal())), (kind,))
        place = rng.normal(size=3) * rng.choice([0.3, 1.0, 2.0])
        a = lab.piece(shapes[0], (0, 0, 0), random_turn(rng))
        b = lab.piece(shapes[1], place * (1.0 if rng.random() < 0.8 else (0.0, 0.0, 1.0)), random_turn(rng))
        found = lab.measure(*((a, b) if rng.random() < 0.5 else (b, a)))
        both = gaps_along(a, b, np.array([found.normal, -found.normal]))
        assert found.converged
        assert np.abs(both - found.distance).min() <= EXACT
        assert largest_gap(a, b, rng) <= found.distance + UNBEATEN
        parted = found.point_b - found.point_a - found.distance * found.normal
        assert np.linalg.norm(parted) <= 1e-7


@pytest.mark.parametrize(
    ("shape", "place", "turn", "distance", "normal"),
    [
        # a ball over a cap, beside the side, off the rim, and inside
        (Sphere(0.2), (0.3, 0.1, 1.0), Rotation.identity(), 0.3, (0, 0, 1)),
        (Sphere(0.2), (0.6, 0.8, 0.1), Rotation.identity(), 0.3, (0.6, 0.8, 0)),
        (Sphere(0.2), (0.8, 0.0, 0.9), Rotation.identity(), 0.3, (0.6, 0, 0.8)),
        (Sphere(0.2), (0.0, 0.45, 0.0), Rotation.identity(), -0.25, (0, 1, 0)),
        # on each other, side by side, crossed, and a capsule along the side
        (Cylinder(0.3, 0.4), (0.1, 0.2, 0.8), Rotation.identity(), -0.1, (0, 0, 1)),
        (Cylinder(0.3, 0.4), (0.0, 0.9, 0.1), Rotation.identity(), 0.1, (0, 1, 0)),
        (Cylinder(0.3, 2.0), (0.1, 0.9, 0.2), LYING, 0.1, (0, 1, 0)),
        (Capsule(0.3, 0.4), (0.0, 0.9, 0.1), Rotation.identity(), 0.1, (0, 1, 0)),
        # a box over a cap, and a cylinder's side over a box's face
        (Box((0.1, 0.2, 0.3)), (0.4, 0.2, 0.9), Rotation.identity(), 0.1, (0, 0, 1)),
        (Box((2.0, 2.0, 0.3)), (0.0, 1.0, 0.0), Rotation.from_rotvec((np.pi / 2, 0, 0)), 0.2, (0, 1, 0)),
    ],
)
def test_closed_forms(lab: SimpleNamespace, shape, place, turn, distance, normal) -> None:
    """Measure a cylinder of radius and half length 0.5 against shapes at known distances, turned anyhow."""
    for about in (Rotation.identity(), Rotation.from_rotvec((0.3, -0.7, 0.4))):
        cylinder = lab.piece(Cylinder(0.5, 0.5), (0, 0, 0), about)
        found = lab.measure(cylinder, lab.piece(shape, about.apply(place), about * turn))
        assert found.converged
        assert found.distance == pytest.approx(distance, abs=1e-12)
        np.testing.assert_allclose(found.normal, about.apply(normal), atol=1e-6)


CORNER = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@pytest.mark.parametrize(
    ("a", "b", "place", "distance", "normal"),
    [
        # a ball over the apex, beside the side, off the base, and a plane under a cone on its side
        (Cone(0.3, 0.2), Sphere(0.1), (0, 0, 0.5), 0.2, (0, 0, 1)),
        (Cone(0.3, 0.2), Sphere(0.1), (0.55, 0, 0.3), 0.4, (0.8, 0, 0.6)),
        (Cone(0.3, 0.2), Sphere(0.1), (0.1, 0, -0.5), 0.2, (0, 0, -1)),
        (HalfSpace(), Cone(0.3, 0.2), (0.4, 0.1, 0.1), -0.1, (0, 0, 1)),
        (HalfSpace(), Sphere(0.3), (7.0, 1.0, 0.5), 0.2, (0, 0, 1)),
        (HalfSpace(), Box((0.1, 0.2, 0.3)), (7.0, 1.0, -5.0), -5.3, (0, 0, 1)),
        # faces, edges and corners of rounded boxes and hulls
        (RoundedBox((0.3, 0.3, 0.3), 0.1), Sphere(0.1), (0.1, 0.2, 0.7), 0.2, (0, 0, 1)),
        (RoundedBox((0.3, 0.3, 0.3), 0.1), Sphere(0.1), (0.0, 0.6, 0.7), 0.3, (0, 0.6, 0.8)),
        (RoundedBox((0.3, 0.3, 0.3), 0.1), Box((0.1, 0.1, 0.1)), (0.1, 0.0, -0.45), -0.05, (0, 0, -1)),
        (RoundedHull(CORNER, 0.2), Sphere(0.1), (0.2, 0.2, -0.4), 0.1, (0, 0, -1)),
        (HalfSpace(), RoundedHull(CORNER, 0.2), (0.2, 0.2, 0.25), 0.05, (0, 0, 1)),
    ],
)
def test_closed_forms_of_cones_planes_and_rounded_shapes(lab: SimpleNamespace, a, b, place, distance, normal):
    """Measure shapes at known distances, in either order, turned anyhow."""
    for about in (Rotation.identity(), Rotation.from_rotvec((0.3, -0.7, 0.4))):
        one, two = lab.piece(a, (0, 0, 0), about), lab.piece(b, about.apply(place), about)
        found, back = lab.measure(one, two), lab.measure(two, one)
        assert found.converged
        assert found.distance == pytest.approx(distance, abs=1e-12)
        assert back.distance == pytest.approx(distance, abs=1e-12)
        np.testing.assert_allclose(found.normal, about.apply(normal), atol=1e-6)
        np.testing.assert_allclose(back.normal, about.apply(normal) * -1, atol=1e-6)

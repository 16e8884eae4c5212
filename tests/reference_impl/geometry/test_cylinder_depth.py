"""Depth of cylinders and cones: the largest gap over directions."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.scenarios.extents import extents
from touchstone.scenarios.random_scenes.bodies import random_shape
from touchstone.scenarios.scenario import (
    Cone,
    Cylinder,
    Piece,
)

EXACT = 1e-11
"""Of a distance of pieces of about 1 m [m]."""
UNBEATEN = 1e-9
"""By how much no searched direction has a larger gap than the one that is found [m]."""
KINDS = ("sphere", "box", "capsule", "ellipsoid", "hull", "cylinder", "cone", "rounded_box")


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

"""Bounding boxes and support points against the vertices."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapters.translation import translate
from reference_impl.shapes import place_piece, support
from scenarios.scenario import Body, Box, Ellipsoid, Hull, Piece, Sphere
from scenarios.solids import elliptic_hull, sphere_inertia

SHAPES = {
    "sphere": Sphere(0.3),
    "box": Box((0.3, 0.2, 0.1)),
    "ellipsoid": Ellipsoid((0.3, 0.2, 0.1)),
    "hull": Hull(elliptic_hull((0.3, 0.2, 0.1))),
}
TURN = Rotation.from_rotvec([0.4, -1.1, 0.6])
OWN = Rotation.from_rotvec([-0.2, 0.3, 0.9])


def surface(shape) -> np.ndarray:
    """Points of the shape's surface (n, 3), dense where it is smooth."""
    match shape:
        case Box(half):
            return np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
        case Hull(vertices):
            return np.array(vertices)
    u = np.random.default_rng(0).normal(size=(200_000, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    return u * (shape.radius if isinstance(shape, Sphere) else shape.half_axes)


def placed(lab: SimpleNamespace, shape, margin: float):
    """(world, its only piece placed, the surface's points in the world)."""
    quaternions = [tuple(turn.as_quat(scalar_first=True).tolist()) for turn in (OWN, TURN)]
    piece = Piece("piece", shape, (0.5, 0.1, -0.2), quaternions[0])
    body = Body(
        "body",
        "simulated",
        "wood",
        (piece,),
        mass=1.0,
        inertia=sphere_inertia(1.0, 0.1),
        position=(1.0, 2.0, 3.0),
        orientation=quaternions[1],
    )
    world = translate(lab.scene(body))
    place_piece(world.pieces[0], world.bodies[0], world.vertices, margin)
    return world, TURN.apply(OWN.apply(surface(shape)) + piece.position) + body.position


@pytest.mark.parametrize("name", SHAPES)
def test_boxes_hold_the_piece_and_no_more(lab: SimpleNamespace, name: str) -> None:
    """Bound every point, by the margin and not farther."""
    world, points = placed(lab, SHAPES[name], 0.01)
    # random points miss the extremes of a smooth surface by about 1e-5 of its size
    slack = 1e-5 if name in ("sphere", "ellipsoid") else 1e-14
    np.testing.assert_allclose(world.pieces[0]["low"], points.min(axis=0) - 0.01, atol=slack)
    np.testing.assert_allclose(world.pieces[0]["high"], points.max(axis=0) + 0.01, atol=slack)


@pytest.mark.parametrize("name", SHAPES)
def test_support_is_the_farthest_point(lab: SimpleNamespace, name: str) -> None:
    """Reach as far as the farthest point of the surface, less the radius of a sphere."""
    world, points = placed(lab, SHAPES[name], 0.0)
    row, out = world.pieces[0], np.zeros(3)
    for direction in np.random.default_rng(1).normal(size=(20, 3)):
        support(row, world.vertices, *direction, out)
        length = np.linalg.norm(direction)
        reach = (row["world_position"] + out) @ direction / length + row["radius"]
        slack = 1e-4 if name in ("sphere", "ellipsoid") else 1e-14
        assert reach == pytest.approx((points @ direction).max() / length, abs=slack)


@pytest.mark.parametrize("name", SHAPES)
def test_support_names_its_corner(lab: SimpleNamespace, name: str) -> None:
    """Tell the hull's vertex or the box' octant; a point is corner 0, a smooth core has none."""
    world, _ = placed(lab, SHAPES[name], 0.0)
    row, out = world.pieces[0], np.zeros(3)
    bits = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)]) * 2 - 1
    corners = world.vertices if name == "hull" else bits * row["size"]
    for direction in np.random.default_rng(2).normal(size=(20, 3)):
        corner = support(row, world.vertices, *direction, out)
        if name == "ellipsoid":
            assert corner == -1
        else:
            np.testing.assert_allclose(out, row["world_rotation"] @ corners[corner], atol=1e-15)


def test_support_without_a_direction_is_finite(lab: SimpleNamespace) -> None:
    """Give a finite point of an ellipsoid along the zero vector."""
    world, _ = placed(lab, SHAPES["ellipsoid"], 0.0)
    out = np.full(3, np.nan)
    support(world.pieces[0], world.vertices, 0.0, 0.0, 0.0, out)
    assert np.isfinite(out).all()

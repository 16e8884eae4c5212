"""Bounding boxes and support points against the vertices."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from surface_points import surface_points

from touchstone.adapters.engines.reference.reference_world import piece_arrays, translate
from touchstone.adapters.engines.reference.support_table import BRUTE_FORCE_VERTEX_COUNT, hull_rows
from touchstone.reference_impl.geometry.shapes import corner_of_hull, local_support, place_piece
from touchstone.scenarios.scenario import Body, Box, Capsule, Cylinder, Ellipsoid, Hull, Piece, Sphere
from touchstone.scenarios.solids import elliptic_hull, sphere_inertia

SHAPES = {
    "sphere": Sphere(0.3),
    "box": Box((0.3, 0.2, 0.1)),
    "capsule": Capsule(0.2, 0.3),
    "cylinder": Cylinder(0.2, 0.3),
    "ellipsoid": Ellipsoid((0.3, 0.2, 0.1)),
    "hull": Hull(elliptic_hull((0.3, 0.2, 0.1))),
}
ROUND = ("sphere", "capsule", "cylinder", "ellipsoid")
TURN = Rotation.from_rotvec([0.4, -1.1, 0.6])
OWN = Rotation.from_rotvec([-0.2, 0.3, 0.9])


def placed(lab: SimpleNamespace, shape, margin: float):
    """(world, its only piece placed, the surface's points in the world)."""
    quaternions = [tuple(turn.as_quat(scalar_first=True).tolist()) for turn in (OWN, TURN)]
    piece = Piece("piece", shape, (0.5, 0.1, -0.2), quaternions[0])
    posed = {"position": (1.0, 2.0, 3.0), "orientation": quaternions[1]}
    body = Body("body", "simulated", "wood", (piece,), 1.0, inertia=sphere_inertia(1.0, 0.1), **posed)
    world = translate(lab.scene(body))
    place_piece(world.pieces[0], world.bodies[0], world.vertices, margin)
    return world, TURN.apply(OWN.apply(surface_points(shape)) + piece.position) + body.position


@pytest.mark.parametrize("name", SHAPES)
def test_boxes_hold_the_piece_and_no_more(lab: SimpleNamespace, name: str) -> None:
    """Bound every point, by the margin and not farther."""
    world, points = placed(lab, SHAPES[name], 0.01)
    # random points miss the extremes of a smooth surface by about 1e-5 of its size
    slack = 1e-5 if name in ROUND else 1e-14
    np.testing.assert_allclose(world.pieces[0]["low"], points.min(axis=0) - 0.01, atol=slack)
    np.testing.assert_allclose(world.pieces[0]["high"], points.max(axis=0) + 0.01, atol=slack)


@pytest.mark.parametrize("name", SHAPES)
def test_support_is_the_farthest_point(lab: SimpleNamespace, name: str) -> None:
    """Reach as far as the farthest point of the surface, with the radius round the core."""
    world, points = placed(lab, SHAPES[name], 0.0)
    row, turn = world.pieces[0], world.pieces[0]["world_rotation"]
    for direction in np.random.default_rng(1).normal(size=(20, 3)):
        _, *point = local_support(row, world.vertices, *direction @ turn)
        length = np.linalg.norm(direction)
        reach = (row["world_position"] + turn @ point) @ direction / length + row["radius"]
        slack = 1e-4 if name in ROUND else 1e-14
        assert reach == pytest.approx((points @ direction).max() / length, abs=slack)


@pytest.mark.parametrize("name", SHAPES)
def test_support_names_its_corner(lab: SimpleNamespace, name: str) -> None:
    """Tell the hull's vertex or the box' octant; a point is corner 0, a smooth core and a rim have none."""
    world, _ = placed(lab, SHAPES[name], 0.0)
    row = world.pieces[0]
    bits = np.array([[k & 1, k >> 1 & 1, k >> 2 & 1] for k in range(8)]) * 2 - 1
    corners = world.vertices["position"] if name == "hull" else bits * row["size"]
    for direction in np.random.default_rng(2).normal(size=(20, 3)):
        corner, *point = local_support(row, world.vertices, *direction)
        if name in ("cylinder", "ellipsoid"):
            assert corner == -1
        else:
            assert point == corners[corner].tolist()


@pytest.mark.parametrize("name", ["cylinder", "ellipsoid"])
def test_support_without_a_direction_is_finite(lab: SimpleNamespace, name: str) -> None:
    """Give a finite point along the zero vector."""
    world, _ = placed(lab, SHAPES[name], 0.0)
    assert np.isfinite(local_support(world.pieces[0], world.vertices, 0.0, 0.0, 0.0)).all()


def on_a_ball(count: int) -> np.ndarray:
    """Random points (count, 3) on the unit sphere: all are corners of their hull."""
    points = np.random.default_rng(count).normal(size=(count, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def prism(sides: int) -> np.ndarray:
    """A regular prism: all corners of an end are equally far along its axis."""
    turn = 2 * np.pi * np.arange(sides) / sides
    ring = np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([np.column_stack([ring, np.full(sides, z)]) for z in (-1.0, 1.0)])


CLOUDS = {
    **{
        f"ball {count}": on_a_ball(count)
        for count in (4, BRUTE_FORCE_VERTEX_COUNT, BRUTE_FORCE_VERTEX_COUNT + 1, 42, 162, 1000, 5000)
    },
    "icosphere": np.array(elliptic_hull((1.0, 1.0, 1.0))),
    "needle": on_a_ball(60) * (1.0, 1e-3, 1e-3),
    "flat": on_a_ball(60) * (1.0, 0.7, 1e-4),
    "clustered": np.vstack([on_a_ball(30), on_a_ball(31) * 1e-3 + (2.0, 0.0, 0.0)]),
    "off its origin": on_a_ball(60) + (100.0, -3.0, 7.0),
    "prism": prism(32),
}


def directions(points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Random directions, the axes, and face normals, their sums over edges, and edges themselves (n, 3)."""
    hull = ConvexHull(points)
    chosen = rng.permutation(len(hull.simplices))[:300]
    normals = hull.equations[chosen, :3]
    beside = hull.equations[hull.neighbors[chosen, 0], :3]
    edges = points[hull.simplices[chosen, 1]] - points[hull.simplices[chosen, 0]]
    signs = rng.integers(-1, 2, size=(100, 3)).astype(float)
    spread = rng.normal(size=(300, 3)) / np.ptp(points, axis=0)
    return np.vstack([rng.normal(size=(300, 3)), spread, signs, normals, normals + beside, edges])


@pytest.mark.parametrize("name", CLOUDS)
def test_the_table_finds_the_farthest_of_all_vertices(name: str) -> None:
    """Give the vertex that trying all gives, to the bit: the first of those equally far."""
    points = CLOUDS[name]
    pieces, vertices = piece_arrays([(0, Piece("hull", Hull(tuple(map(tuple, points.tolist())))))])
    assert (pieces[0]["cells"] > 0) == (len(points) > BRUTE_FORCE_VERTEX_COUNT)
    for u, v, w in directions(points, np.random.default_rng(3)):
        farthest = np.argmax(u * points[:, 0] + v * points[:, 1] + w * points[:, 2])
        assert corner_of_hull(pieces[0], vertices, u, v, w) == farthest


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_table_holds_at_any_scale(scale: float) -> None:
    """Give the same vertex of a hull and a direction of any size."""
    points = CLOUDS["ball 162"]
    shape = Hull(tuple(map(tuple, (points * scale).tolist())))
    pieces, vertices = piece_arrays([(0, Piece("hull", shape))])
    for direction in np.random.default_rng(4).normal(size=(100, 3)):
        farthest = np.argmax(points @ direction)
        for factor in (1e-200, 1.0, 1e200):
            assert corner_of_hull(pieces[0], vertices, *(direction * factor)) == farthest


@pytest.mark.parametrize("bad", [0.0, 5e-324, 1e-310, 1e308, np.inf, np.nan])
@pytest.mark.parametrize("axis", range(3))
def test_a_direction_that_is_none_stays_in_the_hull(bad: float, axis: int) -> None:
    """Give some vertex of the hull along zero, denormal, huge, infinite and undefined directions."""
    points = CLOUDS["ball 42"]
    pieces, vertices = piece_arrays([(0, Piece("hull", Hull(tuple(map(tuple, points.tolist())))))])
    for rest in (0.0, bad):
        direction = np.full(3, rest)
        direction[axis] = bad
        assert 0 <= corner_of_hull(pieces[0], vertices, *direction) < len(points)


def test_equal_hulls_share_their_rows() -> None:
    """Keep the rows of equal hulls once, and few candidates in most cells of the finest table."""
    shape = Hull(tuple(map(tuple, CLOUDS["ball 5000"].tolist())))
    pieces, vertices = piece_arrays([(0, Piece("one", shape)), (1, Piece("two", shape))])
    rows, cells, _ = hull_rows(shape.vertices)
    assert pieces["first_vertex"].tolist() == [0, 0]
    assert len(vertices) == len(rows) < 8 * cells**2 + 4 * len(shape.vertices)

"""Triangles in one plane: what moves over them moves as over the plane, turned as a whole in any way."""

from collections.abc import Callable
from functools import cache
from math import cos, sin

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from turned_floor import end_of

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.scenarios.height_field import HeightField
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import (
    GRAVITY,
    Body,
    Hull,
    PairCoefficients,
    Piece,
    Scenario,
    vector,
)
from touchstone.scenarios.solids import ball, block, capsule, cylinder, slab
from touchstone.scenarios.triangle_mesh import TriangleMesh, solid_below

LYING = (2**-0.5, 2**-0.5, 0.0, 0.0)
FLAT, ROUND = (-0.8, 0.1, 0.05), (0.05, 0.1, 1.0, (-0.8, 0.0, 0.05), LYING)
MOVING = {
    "ball rolls": ball("body", "wood", 0.1, 1.0, (-0.8, 0.03, 0.1), (1.0, 0.2, 0.0), (-2.0, 10.0, 0.0)),
    "ball slides": ball("body", "wood", 0.1, 1.0, (-0.8, 0.03, 0.1), (1.5, 0.2, 0.0), (0.0, 0.0, 20.0)),
    "box slides": block(
        "body", "wood", (0.1, 0.07, 0.05), 1.0, FLAT, velocity=(2.0, 0.3, 0.0), spin=(0, 0, 3.0)
    ),
    "capsule rolls": capsule("body", "wood", *ROUND, velocity=(1.0, 0.2, 0.0), spin=(0.0, 20.0, 3.0)),
    "cylinder rolls": cylinder("body", "wood", *ROUND, velocity=(1.0, 0.0, 0.0), spin=(0.0, 20.0, 0.0)),
}
"""Bodies on the plane z = 0."""
SEEDS = range(3)


def grid(rng: np.random.Generator) -> np.ndarray:
    """Points (n, n, 3) of a level square, moved within it [m]."""
    side = np.linspace(-2.0, 2.0, int(rng.integers(5, 14)))
    points = np.stack(np.meshgrid(side, side, [0.0], indexing="ij"), axis=-1)[:, :, 0]
    moved = rng.uniform(-0.3, 0.3, (2, len(side) - 2, len(side) - 2)) * (side[1] - side[0])
    points[1:-1, 1:-1, :2] += np.moveaxis(moved, 0, -1)
    return points


def columns(rng: np.random.Generator) -> tuple[Piece, ...]:
    """Triangular columns with a level top, of all sizes and angles."""
    points, pieces = grid(rng), []
    for i, j in np.ndindex(len(points) - 1, len(points) - 1):
        corners = [points[at][:2] for at in ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))]
        for side_of, chosen in (("a", (0, 1, 2)), ("b", (0, 2, 3))):
            column = tuple(vector((*corners[k], z)) for k in chosen for z in (0.0, -0.3))
            pieces.append(Piece(f"tile_{i}_{j}_{side_of}", Hull(column)))
    return tuple(pieces)


def mesh(rng: np.random.Generator) -> tuple[Piece, ...]:
    """Pieces of a closed mesh with a level top."""
    return solid_below(grid(rng), -0.3).pieces()


@cache
def on_a_slab(name: str) -> np.ndarray:
    """Positions over a level slab."""
    return end_of(slab("floor", "wood"), MOVING[name], Rotation.identity(), 1.2)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("triangles", [columns, mesh])
@pytest.mark.parametrize("name", MOVING)
def test_triangles_in_a_plane_are_the_plane(
    name: str, triangles: Callable[[np.random.Generator], tuple[Piece, ...]], seed: int
) -> None:
    """Positions are those over a slab to a nanometre: no seam stops, lifts or turns a body."""
    floor = Body("floor", "fixed", "wood", triangles(np.random.default_rng(seed)))
    turn = Rotation.identity() if seed == 0 else Rotation.random(random_state=seed)
    assert np.abs(end_of(floor, MOVING[name], turn, 1.2) - on_a_slab(name)).max() < 1e-9


RAMP, LENGTH, STANDING = 0.15, 2.0, (-0.5, 0.1, 0.1)
"""Angle [rad] and length [m] of a ramp whose foot is at x = 0, and the start of what slides to it [m]."""
AHEAD, TURNED = {"velocity": (2.0, 0.0, 0.0)}, (cos(0.2), 0.0, 0.0, sin(0.2))
CLIMBING = {
    "box": block("body", "wood", (0.1, 0.07, 0.1), 1.0, STANDING, **AHEAD),
    "turned box": block("body", "wood", (0.1, 0.07, 0.1), 1.0, STANDING, TURNED, **AHEAD),
    "cylinder": cylinder("body", "wood", 0.07, 0.1, 1.0, STANDING, **AHEAD),
}


def ramp(kind: str) -> Body:
    """A ramp on the plane z = 0, as a wedge or as a tilted box."""
    s, c, thick = sin(RAMP), cos(RAMP), 0.2
    if kind == "wedge":
        section = ((0.0, 0.0), (LENGTH * c, 0.0), (LENGTH * c, LENGTH * s))
        corners = tuple((x, y, z) for x, z in section for y in (-1.0, 1.0))
        return Body("ramp", "fixed", "wood", (Piece("ramp", Hull(corners)),))
    middle = (LENGTH / 2 * c + thick * s, 0.0, LENGTH / 2 * s - thick * c)
    turn = (cos(RAMP / 2), 0.0, -sin(RAMP / 2), 0.0)
    return block("ramp", "wood", (LENGTH / 2, 1.0, thick), 0.0, middle, turn, kind="fixed")


@pytest.mark.parametrize("kind", ["wedge", "box"])
@pytest.mark.parametrize("name", CLIMBING)
def test_what_slides_to_a_ramp_climbs_it(name: str, kind: str) -> None:
    """Without friction and restitution, the impacts at the foot take at most twice the energy that a point
    loses there, whose velocity along the ramp's normal ends."""
    bodies, smooth = (
        (slab("floor", "wood"), ramp(kind), CLIMBING[name]),
        PairCoefficients("wood", "wood", 0.0, 0.0),
    )
    scene = Scenario("test", "a test", (), bodies, 0.6, (smooth,))
    recording = record(load("reference"), scene, Settings("balanced", 1 / 60))
    v, height = recording.linear_velocity[-1, 2], recording.position[-1, 2, 2] - STANDING[2]
    lost = 2.0**2 / 2 - (v @ v / 2 + GRAVITY * height)
    assert height > 0.05
    assert 0 < lost < 2.0**2 * sin(RAMP) ** 2


def test_the_solid_of_a_field_is_below_its_heights() -> None:
    """Columns fill the field: their volumes add up to the mean height of each triangle times its area."""
    from scipy.spatial import ConvexHull

    rng = np.random.default_rng(1)
    heights = rng.uniform(-0.2, 0.4, (4, 5))
    field = HeightField(tuple(map(tuple, heights.tolist())), (0.3, 0.2), -1.0)
    volume = sum(ConvexHull(piece.shape.vertices).volume for piece in field.pieces())
    means = (
        (2 * heights[:-1, :-1] + 2 * heights[1:, 1:] + heights[1:, :-1] + heights[:-1, 1:]) / 6 + 1.0
    ) * 0.06
    assert volume == pytest.approx(means.sum(), rel=1e-12)
    assert len(field.pieces()) == 2 * 3 * 4


def test_the_pieces_of_a_mesh_are_within_it() -> None:
    """Random points of the pieces of a torus, whose hull would fill it, are within it but for chords of its
    inner circle, and the pieces have all of its surface."""
    n, m = 24, 12
    u, v = np.meshgrid(2 * np.pi * np.arange(n) / n, 2 * np.pi * np.arange(m) / m, indexing="ij")
    radius = 1 + 0.4 * np.cos(v)
    points = np.stack([radius * np.cos(u), radius * np.sin(u), 0.4 * np.sin(v)], axis=-1).reshape(-1, 3)
    index = np.arange(n * m).reshape(n, m)
    a, b = index.ravel(), np.roll(index, -1, axis=0).ravel()
    c, d = (np.roll(one.reshape(n, m), -1, axis=1).ravel() for one in (b, a))
    triangles = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]).tolist()
    pieces = TriangleMesh(tuple(map(tuple, points.tolist())), tuple(map(tuple, triangles))).pieces()
    weights = np.random.default_rng(0).dirichlet(np.ones(4), 20)
    inside = np.concatenate([weights @ np.array(piece.shape.vertices) for piece in pieces])
    ring = np.hypot(inside[:, 0], inside[:, 1]) - 1
    assert np.hypot(ring, inside[:, 2]).max() < 0.4 + 0.6 * (1 - cos(np.pi / n))
    found = {tuple(sorted(piece.shape.vertices[:3])) for piece in pieces}
    assert found == {tuple(sorted(tuple(points[k]) for k in corners)) for corners in triangles}


def test_what_falls_on_terrain_is_random_too() -> None:
    """The kind is drawn on request, over level and hilly fields."""
    levels = {"hills of 0 m" in random_scene(seed, "terrain").summary for seed in range(12)}
    assert levels == {True, False}

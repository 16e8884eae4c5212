"""Builders that several test files share: small scenes, their worlds, and the depth of two pieces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from adapters.reference_engine import BUNDLES
from adapters.translation import translate
from reference_impl import conventions
from reference_impl.convex_depth import convex_depth
from reference_impl.pipeline import prepare, step
from reference_impl.shapes import place_piece
from reference_impl.world import BODY, PAIR, PIECE, STATE, World
from scenarios.scenario import (
    Body,
    Box,
    Ellipsoid,
    Hull,
    PairCoefficients,
    Piece,
    Scenario,
    Shape,
    Sphere,
    Tracker,
    Vector,
)
from scenarios.solids import box_inertia, sphere_inertia

FRAME = 1 / 60


@dataclass(frozen=True)
class Depth:
    """What the kernel says of two pieces."""

    distance: float
    normal: np.ndarray
    point_a: np.ndarray
    point_b: np.ndarray
    iterations: int
    converged: bool


def piece(shape: Shape, position: object = (0.0, 0.0, 0.0), turn: Rotation | None = None) -> Piece:
    """A piece in the world, turned by a scipy Rotation."""
    quaternion = (turn or Rotation.identity()).as_quat(scalar_first=True)
    return Piece("piece", shape, tuple(map(float, position)), tuple(quaternion.tolist()))


def corners(one: Piece) -> np.ndarray:
    """World vertices (n, 3) of a box or a hull."""
    match one.shape:
        case Box(half):
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            local = signs * np.array(half)
        case Hull(vertices):
            local = np.array(vertices)
    return Rotation.from_quat(np.array(one.orientation), scalar_first=True).apply(local) + one.position


def measure(one: Piece, two: Piece) -> Depth:
    """Run `convex_depth` on two pieces."""
    bodies, pieces = np.zeros(2, BODY), np.zeros(2, PIECE)
    bodies["rotation"] = np.eye(3)
    vertices, first = [np.zeros((1, 3))], 1
    for k, (row, given) in enumerate(zip(pieces, (one, two))):
        row["body"], row["position"] = k, given.position
        row["rotation"] = Rotation.from_quat(np.array(given.orientation), scalar_first=True).as_matrix()
        match given.shape:
            case Sphere(radius):
                row["kind"], row["radius"] = conventions.SPHERE, radius
            case Box(half_extents):
                row["kind"], row["size"] = conventions.BOX, half_extents
            case Ellipsoid(half_axes):
                row["kind"], row["size"] = conventions.ELLIPSOID, half_axes
            case Hull(points):
                row["kind"], row["first_vertex"], row["vertex_count"] = conventions.HULL, first, len(points)
                vertices.append(np.array(points))
                first += len(points)
    table = np.ascontiguousarray(np.vstack(vertices))
    state, pairs = np.zeros(1, STATE), np.zeros(1, PAIR)
    for k in range(2):
        place_piece(pieces[k], bodies[k], table, 0.0)
    iterations, converged = convex_depth(pieces[0], pieces[1], table, state[0], pairs[0])
    row = pairs[0]
    return Depth(
        float(row["distance"]),
        row["normal"].copy(),
        row["point_a"].copy(),
        row["point_b"].copy(),
        iterations,
        bool(converged),
    )


def ball(name: str = "ball", position: Vector = (0.0, 0.0, 1.0), **fields: object) -> Body:
    """A wooden ball of 10 cm and 1 kg; `radius` and `mass` may be given."""
    radius, mass = float(fields.pop("radius", 0.05)), float(fields.pop("mass", 1.0))
    shape = Piece(name, Sphere(radius))
    inertia = sphere_inertia(mass, radius)
    return Body(name, "simulated", "wood", (shape,), mass=mass, inertia=inertia, position=position, **fields)


def block(name: str, half: Vector, position: Vector, kind: str = "simulated", **fields: object) -> Body:
    """A wooden box, of 1 kg unless it is fixed."""
    mass = 0.0 if kind == "fixed" else 1.0
    inertia = box_inertia(mass, half)
    return Body(
        name, kind, "wood", (Piece(name, Box(half)),), mass=mass, inertia=inertia, position=position, **fields
    )


def ground() -> Body:
    """A fixed slab whose surface is z = 0."""
    return block("ground", (20.0, 20.0, 0.5), (0.0, 0.0, -0.5), kind="fixed")


def still(root: str, position: Vector, end: Vector | None = None, duration: float = 1.0) -> Tracker:
    """A tracker that rests, or goes to `end`."""
    return Tracker(
        root,
        (),
        (0.0, duration),
        (position, end or position),
        ((1.0, 0.0, 0.0, 0.0),) * 2,
        ((), ()),
    )


def scene(*bodies: Body, e: float = 0.0, mu: float = 0.0, **fields: object) -> Scenario:
    """A scene of wood, one second long unless told otherwise."""
    return Scenario(
        name="test",
        summary="a test",
        tags=(),
        bodies=bodies,
        coefficients=(PairCoefficients("wood", "wood", e, mu),),
        duration=float(fields.pop("duration", 1.0)),
        **fields,
    )


def build(scenario: Scenario, profile: str = "balanced", dt: float = FRAME) -> World:
    """A world ready for its first step."""
    world = translate(scenario)
    world.state["dt"], world.state["gravity"] = dt, scenario.acting_gravity
    for name, value in BUNDLES[profile].items():
        world.state[name] = value
    prepare(*world)
    return world


def play(world: World, frames: int, watch: Callable[[World], object] | None = None) -> list:
    """Step a world whose trackers rest; returns what `watch` saw after each frame."""
    seen = []
    for _ in range(frames):
        step(*world)
        if watch is not None:
            seen.append(watch(world))
    return seen


def counters(world: World) -> dict[str, int]:
    """The counters of the last frame by name."""
    return dict(zip(conventions.COUNTERS, world.state[0]["counters"].tolist()))


@pytest.fixture(scope="session")
def lab() -> SimpleNamespace:
    """The builders of this file."""
    return SimpleNamespace(
        piece=piece,
        corners=corners,
        measure=measure,
        ball=ball,
        block=block,
        ground=ground,
        still=still,
        scene=scene,
        build=build,
        play=play,
        counters=counters,
        frame=FRAME,
    )

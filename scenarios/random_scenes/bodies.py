"""Random convex bodies, and the support functions that place them."""

from collections.abc import Sequence
from math import cos, pi, sin

import numpy as np
from numpy.random import Generator
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.scenarios import solids
from touchstone.scenarios.arrays import Array
from touchstone.scenarios.scenario import (
    IDENTITY,
    ORIGIN,
    Body,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Quaternion,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
    Vector,
    vector,
)
from touchstone.scenarios.solids import hull_mass_properties

MATERIAL = "wood"
SHAPES = ("sphere", "box", "capsule", "ellipsoid", "hull", "coin")
"""Shapes of most kinds of scenes; `cylinder`, `cone` and `rounded_box` are of those that name them."""
FLAT = ("box", "hull", "coin")
"""Shapes that rest on a face."""
ASPECT = (0.3, 1.0)
"""Range of the ratio of a random shape's smaller dimensions to the largest one [1]."""
COIN_CORNERS = 16
"""Number of corners of each face of a coin."""
COIN_ASPECT = 0.15
"""Half thickness of a coin relative to its radius [1]."""
HULL_POINTS = (6, 20)
"""Range of the number of points whose convex hull is a random hull."""
HEAVIEST = 10.0
"""Largest mass of a random body [kg]; the mass ratio determines the lightest."""


def random_shape(rng: Generator, reach: float, kinds: Sequence[str] = SHAPES) -> Shape:
    """Random shape of one of `kinds` (SHAPES or others by name) within `reach` [m] of its centre of mass."""
    a, b = rng.uniform(*ASPECT, 2)
    match str(rng.choice(kinds)):
        case "sphere":
            return Sphere(reach)
        case "box":
            half = rng.permutation([1.0, a, b])
            return Box(vector(reach / np.linalg.norm(half) * half))
        case "capsule":
            return Capsule(reach * a / 2, reach * (1 - a / 2))
        case "cylinder":
            sides = np.array((a, 1.0) if b < np.mean(ASPECT) else (1.0, a))
            radius, half_length = (reach / np.linalg.norm(sides) * sides).tolist()
            return Cylinder(radius, half_length)
        case "cone":
            radius, half_length = (a, 1.0) if b < np.mean(ASPECT) else (1.0, a)
            size = reach / max(1.5 * half_length, float(np.hypot(radius, half_length / 2)))
            return Cone(float(radius * size), float(half_length * size))
        case "rounded_box":
            half = rng.permutation([1.0, a, b])
            radius = float(rng.uniform(0.05, 0.5))
            return RoundedBox(vector(reach * (1 - radius) / np.linalg.norm(half) * half), reach * radius)
        case "ellipsoid":
            return Ellipsoid(vector(reach * rng.permutation([1.0, a, b])))
        case "coin":
            return coin(reach / np.hypot(1, COIN_ASPECT), reach / np.hypot(1 / COIN_ASPECT, 1))
        case _:
            return _random_hull(rng, reach)


def coin(radius: float, half_thickness: float) -> Hull:
    """A prism of 2 COIN_CORNERS vertices along z; along -x its lowest feature is an edge, not a corner."""
    angles = 2 * pi * (np.arange(COIN_CORNERS) + 0.5) / COIN_CORNERS
    return Hull(
        tuple(
            (radius * cos(t), radius * sin(t), z) for z in (-half_thickness, half_thickness) for t in angles
        )
    )


def _random_hull(rng: Generator, reach: float) -> Hull:
    """Hull of random points on a squeezed sphere, centred on its centre of mass."""
    points = rng.normal(size=(int(rng.integers(*HULL_POINTS)), 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points *= rng.uniform(ASPECT[0], 1.0, 3)
    points = points[ConvexHull(points).vertices]
    _, centre, _ = hull_mass_properties([vector(p) for p in points], mass=1.0)
    points -= centre
    return Hull(tuple(vector(p) for p in reach / np.linalg.norm(points, axis=1).max() * points))


def solid(
    name: str,
    shape: Shape,
    mass: float,
    position: Vector = ORIGIN,
    orientation: Quaternion = IDENTITY,
    velocity: Vector = ORIGIN,
    spin: Vector = ORIGIN,
) -> Body:
    """A simulated uniform body of one shape; mass in kg, then its state. Balls do not turn at the start."""
    orientation = IDENTITY if isinstance(shape, Sphere) else orientation
    return solids.solid(name, MATERIAL, shape, mass, position, orientation, velocity=velocity, spin=spin)


def support(shape: Shape, orientation: Quaternion, direction: Vector) -> float:
    """Extent of a shape from its centre of mass along a unit vector of the world [m]."""
    local = Rotation.from_quat(orientation, scalar_first=True).inv().apply(direction)
    match shape:
        case Sphere(radius):
            return radius
        case Box(half_extents):
            return float(np.abs(local) @ half_extents)
        case Capsule(radius, half_length):
            return float(radius + half_length * abs(local[2]))
        case Cylinder(radius, half_length):
            return float(radius * np.hypot(local[0], local[1]) + half_length * abs(local[2]))
        case Cone(radius, half_length):
            rim = radius * np.hypot(local[0], local[1]) - half_length / 2 * local[2]
            return float(max(rim, 1.5 * half_length * local[2]))
        case Ellipsoid(half_axes):
            return float(np.linalg.norm(local * half_axes))
        case Hull(vertices):
            return float((np.array(vertices) @ local).max())
        case RoundedBox(half_extents, radius):
            return float(np.abs(local) @ half_extents) + radius
        case RoundedHull(vertices, radius):
            return float((np.array(vertices) @ local).max()) + radius
        case HalfSpace():
            raise ValueError("a half-space has no centre of mass")


def masses(rng: Generator, count: int, ratio: float) -> list[float]:
    """Masses [kg] in random order: the heaviest is HEAVIEST, the lightest HEAVIEST / `ratio`."""
    exponents = np.concatenate([[0.0, 1.0], rng.uniform(0.0, 1.0, max(0, count - 2))])[:count]
    return [float(m) for m in rng.permutation(HEAVIEST * ratio**-exponents)]


def random_orientation(rng: Generator) -> Quaternion:
    """Uniformly random orientation, wxyz."""
    w, x, y, z = rng.normal(size=4)
    size = float(np.sqrt(w * w + x * x + y * y + z * z))
    return (float(w) / size, float(x) / size, float(y) / size, float(z) / size)


def turned(axis: Vector, angle: float) -> Quaternion:
    """Rotation by `angle` [rad] about a unit axis."""
    s = sin(angle / 2)
    return (cos(angle / 2), s * axis[0], s * axis[1], s * axis[2])


def random_direction(rng: Generator) -> Array:
    """Uniformly random unit vector (3,)."""
    found = rng.normal(size=3)
    return np.asarray(found / np.linalg.norm(found))


def scattered(rng: Generator, count: int, reach: float, across: int, bottom: float) -> Array:
    """Positions (count, 3) [m] of balls of radius `reach` that touch neither each other nor z = `bottom`.

    They fill layers of `across` by `across` cells about the z axis, from below, in random order within a
    layer and with random offsets from the centres of their cells.
    """
    slack = reach * rng.uniform(0.02, 0.3)
    cell = 2 * (reach + slack)
    layers = -(-count // across**2)
    grid = [np.argwhere(np.ones((across, across))) for _ in range(layers)]
    rows = [np.column_stack([rng.permutation(xy), np.full(len(xy), k)]) for k, xy in enumerate(grid)]
    places = cell * (np.concatenate(rows)[:count] - [(across - 1) / 2, (across - 1) / 2, -0.5])
    # Stay strictly inside the cell, so that neighbours are apart by more than rounding.
    places += rng.uniform(-0.99, 0.99, places.shape) * slack
    return np.asarray(places + [0.0, 0.0, bottom])

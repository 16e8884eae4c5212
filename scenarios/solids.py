"""Uniform solids: their inertia about the centre, bodies made of one, and the vertices of elliptic hulls."""

from __future__ import annotations

import numpy as np

from scenarios.scenario import (
    IDENTITY,
    ORIGIN,
    Body,
    Box,
    Kind,
    Matrix,
    Piece,
    Quaternion,
    Sphere,
    Vector,
)


def _diagonal(x: float, y: float, z: float) -> Matrix:
    return ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))


def ellipsoid_inertia(mass: float, half_axes: Vector) -> Matrix:
    """Inertia [kg m^2] of a uniform solid ellipsoid about its centre; half axes in m."""
    a2, b2, c2 = (axis * axis for axis in half_axes)
    return _diagonal(mass * (b2 + c2) / 5, mass * (a2 + c2) / 5, mass * (a2 + b2) / 5)


def sphere_inertia(mass: float, radius: float) -> Matrix:
    """Inertia [kg m^2] of a uniform solid sphere about its centre; radius in m."""
    return ellipsoid_inertia(mass, (radius, radius, radius))


def box_inertia(mass: float, half_extents: Vector) -> Matrix:
    """Inertia [kg m^2] of a uniform solid box about its centre; half extents in m."""
    a2, b2, c2 = (extent * extent for extent in half_extents)
    return _diagonal(mass * (b2 + c2) / 3, mass * (a2 + c2) / 3, mass * (a2 + b2) / 3)


def capsule_inertia(mass: float, radius: float, half_length: float) -> Matrix:
    """Inertia [kg m^2] of a uniform solid capsule along z about its centre; radius and half length in m."""
    r, h = radius, half_length
    ends = mass * 2 * r / (3 * h + 2 * r)
    middle = mass - ends
    across = middle * (r * r / 4 + h * h / 3) + ends * (2 * r * r / 5 + h * h + 3 * h * r / 4)
    return _diagonal(across, across, middle * r * r / 2 + ends * 2 * r * r / 5)


def ball(
    name: str,
    material: str,
    radius: float,
    mass: float,
    position: Vector = ORIGIN,
    velocity: Vector = ORIGIN,
    spin: Vector = ORIGIN,
) -> Body:
    """A simulated solid ball; radius in m, mass in kg, then its state."""
    return Body(
        name,
        "simulated",
        material,
        (Piece(name, Sphere(radius)),),
        mass=mass,
        inertia=sphere_inertia(mass, radius),
        position=position,
        linear_velocity=velocity,
        angular_velocity=spin,
    )


def block(
    name: str,
    material: str,
    half_extents: Vector,
    mass: float = 0.0,
    position: Vector = ORIGIN,
    orientation: Quaternion = IDENTITY,
    velocity: Vector = ORIGIN,
    spin: Vector = ORIGIN,
    kind: Kind = "simulated",
) -> Body:
    """A solid box of one body; half extents in m, mass in kg, then its state."""
    return Body(
        name,
        kind,
        material,
        (Piece(name, Box(half_extents)),),
        mass=mass,
        inertia=box_inertia(mass, half_extents),
        position=position,
        orientation=orientation,
        linear_velocity=velocity,
        angular_velocity=spin,
    )


def slab(
    name: str, material: str, normal: Vector = (0.0, 0.0, 1.0), orientation: Quaternion = IDENTITY
) -> Body:
    """A fixed slab of 20 m by 20 m by 1 m whose upper face passes through the origin.

    Its origin is the box' centre: an offset piece would be a compound to Bullet, which treats it otherwise.
    """
    x, y, z = normal
    return Body(
        name,
        "fixed",
        material,
        (Piece(name, Box((10.0, 10.0, 0.5))),),
        position=(-0.5 * x, -0.5 * y, -0.5 * z),
        orientation=orientation,
    )


def elliptic_hull(half_axes: Vector) -> tuple[Vector, ...]:
    """The 42 vertices (80 triangles) of an icosphere, subdivided once, on an ellipsoid.

    Args:
        half_axes: half axes along x, y, z [m]; the longest should be x, where the poles lie.
    Returns:
        Vertices in the frame of the ellipsoid [m]; all lie on it.
    """
    golden = (1 + 5**0.5) / 2
    corners = np.array(
        [(0.0, s, t * golden) for s in (-1, 1) for t in (-1, 1)]
        + [(s, t * golden, 0.0) for s in (-1, 1) for t in (-1, 1)]
        + [(t * golden, 0.0, s) for s in (-1, 1) for t in (-1, 1)]
    )
    # edges of the icosahedron are its shortest distances, 2
    first, second = np.triu_indices(12, k=1)
    edges = np.linalg.norm(corners[first] - corners[second], axis=1) < 2.1
    midpoints = (corners[first] + corners[second])[edges]
    sphere = np.vstack([corners, midpoints])
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    return tuple((float(x), float(y), float(z)) for x, y, z in sphere * np.array(half_axes))

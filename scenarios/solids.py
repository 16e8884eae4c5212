"""Uniform solids: mass properties, bodies of one solid, and vertices of elliptic hulls."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from math import cos, fsum, pi, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.plural import plural
from touchstone.scenarios.rounded_solid import rounded_mass_properties, surface_points
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
    Kind,
    Matrix,
    Piece,
    Quaternion,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
    Vector,
    vector,
)

SLAB = (10.0, 10.0, 0.5)
"""Half extents of a floor [m]."""


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


def cylinder_inertia(mass: float, radius: float, half_length: float) -> Matrix:
    """Inertia [kg m^2] of a uniform solid cylinder along z about its centre; radius and half length in m."""
    across = mass * (radius * radius / 4 + half_length * half_length / 3)
    return _diagonal(across, across, mass * radius * radius / 2)


def cone_inertia(mass: float, radius: float, half_length: float) -> Matrix:
    """Inertia [kg m^2] of a uniform solid cone along z about its centre of mass, which is `half_length` / 2
    above its base; radius and half length in m."""
    across = 3 / 20 * mass * (radius * radius + half_length * half_length)
    return _diagonal(across, across, 3 / 10 * mass * radius * radius)


def hull_mass_properties(
    vertices: Sequence[Vector], *, mass: float | None = None, density: float | None = None
) -> tuple[float, Vector, Matrix]:
    """Mass, centre of mass and inertia of a uniform convex hull, exact by a sum over tetrahedra.

    A tetrahedron with corners 0, a, b, c has the second moments V / 20 (sum x x^T + s s^T), s = a + b + c.

    Args:
        vertices: points [m] whose convex hull is the solid; interior points have no effect.
        mass: mass of the solid [kg].
        density: density of the solid [kg/m^3]; give either mass or density.
    Returns:
        Mass [kg], centre of mass [m, frame of the vertices], inertia about it along the axes of that frame
        [kg m^2].
    Raises:
        ValueError: both or none of mass and density are given, or the vertices span no volume.
    """
    if (mass is None) == (density is None):
        raise ValueError(f"mass {mass} and density {density}: expected exactly one of them")
    points = np.array(vertices, dtype=float).reshape(-1, 3)
    try:
        faces = ConvexHull(points)
    except (QhullError, ValueError) as error:
        reason = f"{error}".strip().partition("\n")[0]
        raise ValueError(f"{plural(len(points), 'vertex')} span no volume: {reason}") from error
    # Tetrahedra from a point inside to every triangle. Sums are exact: BLAS rounds by processor.
    inside = points.mean(axis=0)
    corners = points[faces.simplices] - inside
    volumes = np.abs((np.cross(corners[:, 0], corners[:, 1]) * corners[:, 2]).sum(axis=1)) / 6
    sums = corners.sum(axis=1)
    volume = fsum(volumes)
    centre = [fsum(volumes * along) / (4 * volume) for along in sums.T]
    moments = np.empty((3, 3))
    for m, n in product(range(3), repeat=2):
        squares = (corners[:, :, m] * corners[:, :, n]).sum(axis=1) + sums[:, m] * sums[:, n]
        moments[m, n] = fsum(volumes * squares) / 20 - volume * centre[m] * centre[n]
    total = float(mass if density is None else density * volume)  # type: ignore[arg-type]
    inertia = total / volume * (np.trace(moments) * np.eye(3) - moments)
    rows = [vector(row) for row in (inertia + inertia.T) / 2]
    return total, vector(inside + centre), (rows[0], rows[1], rows[2])


def solid_properties(shape: Shape, mass: float) -> tuple[Vector, Matrix]:
    """Centre of mass [m] and inertia about it [kg m^2] of a uniform solid, both in its own frame.

    Raises:
        ValueError: it is a half-space, or its vertices span no volume.
    """
    match shape:
        case Sphere(radius):
            return ORIGIN, sphere_inertia(mass, radius)
        case Box(half_extents):
            return ORIGIN, box_inertia(mass, half_extents)
        case Capsule(radius, half_length):
            return ORIGIN, capsule_inertia(mass, radius, half_length)
        case Cylinder(radius, half_length):
            return ORIGIN, cylinder_inertia(mass, radius, half_length)
        case Cone(radius, half_length):
            return (0.0, 0.0, -half_length / 2), cone_inertia(mass, radius, half_length)
        case Ellipsoid(half_axes):
            return ORIGIN, ellipsoid_inertia(mass, half_axes)
        case Hull(vertices):
            return hull_mass_properties(vertices, mass=mass)[1:]
        case RoundedBox() | RoundedHull():
            return rounded_mass_properties(core_vertices(shape), shape.radius, mass=mass)[1:]
        case HalfSpace():
            raise ValueError("a half-space has no mass")


def solid(
    name: str,
    material: str,
    shape: Shape,
    mass: float = 0.0,
    position: Vector = ORIGIN,
    orientation: Quaternion = IDENTITY,
    velocity: Vector = ORIGIN,
    spin: Vector = ORIGIN,
) -> Body:
    """A uniform simulated body of one shape whose origin is its centre of mass.

    Args:
        shape: its frame has the body's axes; the corners of a hull are shifted, other shapes are posed.
        mass: in kg.
        position, orientation, velocity, spin: pose [m, wxyz], velocity of the centre of mass [m/s] and
            angular velocity [rad/s] at the start, world.
    """
    center, inertia = solid_properties(shape, mass)
    if isinstance(shape, Hull):
        corners = tuple(vector(np.subtract(vertex, center)) for vertex in shape.vertices)
        shape, center = Hull(corners), ORIGIN
    place = vector(np.subtract(ORIGIN, center))
    return Body(
        name,
        "simulated",
        material,
        (Piece(name, shape, place),),
        mass=mass,
        inertia=inertia,
        position=position,
        orientation=orientation,
        linear_velocity=velocity,
        angular_velocity=spin,
    )


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
    return solid(name, material, Sphere(radius), mass, position, velocity=velocity, spin=spin)


def block(
    name: str, material: str, half_extents: Vector, *state: Any, kind: Kind = "simulated", **motion: Any
) -> Body:
    """A solid box of any kind; half extents in m, then mass and state as of `solid`."""
    return replace(solid(name, material, Box(half_extents), *state, **motion), kind=kind)


def capsule(name: str, material: str, radius: float, half_length: float, *state: Any, **motion: Any) -> Body:
    """A solid capsule along the body's z axis; sizes in m, then mass and state as of `solid`."""
    return solid(name, material, Capsule(radius, half_length), *state, **motion)


def cylinder(name: str, material: str, radius: float, half_length: float, *state: Any, **motion: Any) -> Body:
    """A solid cylinder along the body's z axis; sizes in m, then mass and state as of `solid`."""
    return solid(name, material, Cylinder(radius, half_length), *state, **motion)


def cone(name: str, material: str, radius: float, half_length: float, *state: Any, **motion: Any) -> Body:
    """A solid cone along the body's z axis, its centre of mass `half_length` / 2 above its base; sizes in m,
    then mass and state as of `solid`."""
    return solid(name, material, Cone(radius, half_length), *state, **motion)


def ellipsoid(name: str, material: str, half_axes: Vector, *state: Any, **motion: Any) -> Body:
    """A solid ellipsoid; half axes in m, then mass and state as of `solid`."""
    return solid(name, material, Ellipsoid(half_axes), *state, **motion)


def hull(name: str, material: str, vertices: Sequence[Vector], *state: Any, **motion: Any) -> Body:
    """A solid convex hull; its corners [m] in any frame with the body's axes, then mass and state as of
    `solid`."""
    return solid(name, material, Hull(tuple(vertices)), *state, **motion)


def box_corners(half_extents: Vector) -> tuple[Vector, ...]:
    """The eight corners of a box about the origin [m]."""
    x, y, z = half_extents
    return tuple((a * x, b * y, c * z) for a, b, c in product((-1, 1), repeat=3))


def core_vertices(shape: RoundedBox | RoundedHull) -> tuple[Vector, ...]:
    """Corners of the core of a rounded shape [m]."""
    return box_corners(shape.half_extents) if isinstance(shape, RoundedBox) else shape.vertices


def slab(
    name: str, material: str, normal: Vector = (0.0, 0.0, 1.0), orientation: Quaternion = IDENTITY
) -> Body:
    """A fixed slab of 20 m by 20 m by 1 m whose upper face passes through the origin.

    The body's origin is the box' centre: Bullet would treat an offset piece differently, as a compound.
    """
    x, y, z = normal
    return Body(
        name,
        "fixed",
        material,
        (Piece(name, Box(SLAB)),),
        position=(-0.5 * x, -0.5 * y, -0.5 * z),
        orientation=orientation,
    )


def outward_faces(points: Array) -> NDArray[np.int32]:
    """Triangles (t, 3) of the hull of `points` (n, 3), counter-clockwise seen from outside."""
    hull = ConvexHull(points)
    p, q, r = (points[hull.simplices[:, k]] for k in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(q - p, r - p), hull.equations[:, :3]) < 0
    return np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)


PYRAMID_SIDES = 32


def pyramid(shape: Cone) -> tuple[Vector, ...]:
    """Corners of the pyramid of PYRAMID_SIDES sides inside a cone [m], for formats without cones."""
    turns = [2 * pi * k / PYRAMID_SIDES for k in range(PYRAMID_SIDES)]
    rim = [(shape.radius * cos(turn), shape.radius * sin(turn), -shape.half_length) for turn in turns]
    return (*rim, (0.0, 0.0, shape.half_length))


def half_space(
    name: str, material: str, position: Vector = ORIGIN, orientation: Quaternion = IDENTITY
) -> Body:
    """A fixed half-space below the body's x-y plane, whose outward normal is the body's z axis."""
    piece = Piece(name, HalfSpace())
    return Body(name, "fixed", material, (piece,), position=position, orientation=orientation)


def shown_piece(piece: Piece) -> Piece:
    """What pictures show of a piece: the slab of `slab` for a half-space, a hull for a rounded shape."""
    if isinstance(piece.shape, RoundedBox | RoundedHull):
        return replace(piece, shape=Hull(surface_points(core_vertices(piece.shape), piece.shape.radius)))
    if not isinstance(piece.shape, HalfSpace):
        return piece
    below = Rotation.from_quat(piece.orientation, scalar_first=True).apply((0.0, 0.0, -SLAB[2]))
    return replace(piece, shape=Box(SLAB), position=vector(piece.position + below))


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
    # The edges of the icosahedron are its shortest distances, 2.
    first, second = np.triu_indices(12, k=1)
    edges = np.linalg.norm(corners[first] - corners[second], axis=1) < 2.1
    midpoints = (corners[first] + corners[second])[edges]
    sphere = np.vstack([corners, midpoints])
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    return tuple((float(x), float(y), float(z)) for x, y, z in sphere * np.array(half_axes))

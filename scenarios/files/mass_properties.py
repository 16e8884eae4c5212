"""Centre of mass and inertia of a body in a file that states a mass only: a uniform solid of its pieces."""

from math import pi

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.rounded_solid import rounded_mass_properties
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Matrix,
    Piece,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
    Vector,
    vector,
)
from touchstone.scenarios.solids import core_vertices, hull_mass_properties, solid_properties


def uniform(pieces: tuple[Piece, ...], mass: float) -> tuple[Vector, Matrix]:
    """Centre of mass [m, body frame] and inertia about it [kg m^2, body axes] of pieces of one density that
    together have a mass [kg]. Pieces must not overlap: each counts with its whole volume.

    Raises:
        ValueError: a hull spans no volume, or a size is not positive.
    """
    volumes = np.array([volume(piece.shape) for piece in pieces])
    if not (volumes > 0).all():
        raise ValueError("a piece has no volume")
    masses = mass * volumes / volumes.sum()
    centers, inertias = [], []
    for piece, own in zip(pieces, masses.tolist()):
        turn = Rotation.from_quat(piece.orientation, scalar_first=True)
        center, inertia = solid_properties(piece.shape, own)
        centers.append(np.array(piece.position) + turn.apply(center))
        axes = turn.as_matrix()
        inertias.append(axes @ np.array(inertia) @ axes.T)
    if len(pieces) == 1 and pieces[0].orientation == (1.0, 0.0, 0.0, 0.0):  # without rounding
        return vector(centers[0]), solid_properties(pieces[0].shape, mass)[1]
    center = masses @ np.array(centers) / mass
    total = np.zeros((3, 3))
    for own, place, inertia in zip(masses, centers, inertias):
        arm = place - center
        total += inertia + own * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    one, two, three = (vector(row) for row in (total + total.T) / 2)
    return vector(center), (one, two, three)


def volume(shape: Shape) -> float:
    """Volume of a shape [m^3]; 0 of a half-space, which has no mass."""
    match shape:
        case Sphere(r):
            return 4 / 3 * pi * r**3
        case Box(half):
            return 8 * half[0] * half[1] * half[2]
        case Capsule(r, half_length):
            return pi * r * r * (2 * half_length + 4 / 3 * r)
        case Cylinder(r, half_length):
            return pi * r * r * 2 * half_length
        case Cone(r, half_length):
            return pi * r * r * 2 / 3 * half_length
        case Ellipsoid(half):
            return 4 / 3 * pi * half[0] * half[1] * half[2]
        case Hull(vertices):
            return hull_mass_properties(vertices, density=1.0)[0]
        case RoundedBox() | RoundedHull():
            return rounded_mass_properties(core_vertices(shape), shape.radius)[0]
        case HalfSpace():
            return 0.0

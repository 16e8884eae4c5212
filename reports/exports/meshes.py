"""Triangle meshes of pieces, with a normal per corner."""

from __future__ import annotations

from math import pi

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.scenarios.scenario import Body, Box, Capsule, Ellipsoid, Hull, Piece, Sphere

RINGS, SIDES = 12, 24
"""Rings and sides of a ball [1]: the surface is within 1 % of the radius."""
Mesh = tuple[Array, Array]
"""Corners (3 t, 3) of t triangles, counterclockwise from outside [m], and their normals (3 t, 3)."""


def body_mesh(body: Body) -> Mesh:
    """All pieces of a body that has some, in the body's frame."""
    meshes = [_piece(piece) for piece in body.pieces]
    return np.concatenate([one for one, _ in meshes]), np.concatenate([one for _, one in meshes])


def _piece(piece: Piece) -> Mesh:
    corners, normals = _shape(piece)
    turned = Rotation.from_quat(piece.orientation, scalar_first=True)
    return turned.apply(corners) + np.array(piece.position), turned.apply(normals)


def _shape(piece: Piece) -> Mesh:
    match piece.shape:
        case Sphere(radius):
            return _ball(np.full(3, radius), 0.0)
        case Ellipsoid(half):
            return _ball(np.array(half), 0.0)
        case Capsule(radius, half_length):
            return _ball(np.full(3, radius), half_length)
        case Box(half):
            signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
            return _hull(signs * np.array(half))
        case Hull(vertices):
            return _hull(np.array(vertices))
    raise TypeError(f"no mesh of {type(piece.shape).__name__}")


def _hull(vertices: Array) -> Mesh:
    """Triangles of a hull, with flat normals."""
    hull = ConvexHull(vertices)
    faces, normals = vertices[hull.simplices], hull.equations[:, :3]
    across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    inward = np.einsum("ij,ij->i", across, normals) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces.reshape(-1, 3), np.repeat(normals, 3, axis=0)


def _ball(half: Array, half_length: float) -> Mesh:
    """Ellipsoid with half axes [m]; its halves are `half_length` away from the middle along z [m]."""
    polar = np.linspace(0, pi, RINGS + 1)
    upper = polar[: RINGS // 2 + 1]
    rings = np.r_[upper, polar[RINGS // 2 :]] if half_length else polar
    shift = np.where(np.arange(len(rings)) < len(upper), half_length, -half_length)
    round_ = np.linspace(0, 2 * pi, SIDES + 1)
    unit = np.stack(
        [np.outer(np.sin(rings), np.cos(round_)), np.outer(np.sin(rings), np.sin(round_)),
         np.outer(np.cos(rings), np.ones(SIDES + 1))], axis=-1,
    )  # fmt: skip
    points = unit * half
    points[..., 2] += shift[:, None]
    normals = unit / half
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    quads = [(slice(0, -1), slice(0, -1)), (slice(1, None), slice(0, -1)), (slice(1, None), slice(1, None)),
             (slice(0, -1), slice(1, None))]  # fmt: skip
    a, b, c, d = (points[k] for k in quads)
    na, nb, nc, nd = (normals[k] for k in quads)
    # The triangles at both poles have no area on one side.
    corners = np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 3, 3)
    upright = np.stack([na, nb, nc, na, nc, nd], axis=-2).reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    kept = area > 1e-9 * area.max()
    return corners[kept].reshape(-1, 3), upright[kept].reshape(-1, 3)

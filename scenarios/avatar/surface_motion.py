"""Motion of surfaces relative to their bodies: conveyor belts, rollers and turntables that stand still."""

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.kinematics import piece_box
from touchstone.scenarios.scenario import Body, Piece


def piece_moves(piece: Piece) -> bool:
    """Whether the material of a piece's surface moves."""
    return any((*piece.surface_velocity, *piece.surface_angular_velocity))


def surface_moves(body: Body) -> bool:
    """Whether the material of a body's surface moves."""
    return any(map(piece_moves, body.pieces))


def surface_motion(piece: Piece, point: Array) -> tuple[Array, Array]:
    """Velocity (n, 3) [m/s] of a piece's material at points (n, 3) [m], and its angular velocity (3,)
    [rad/s]; all in the body's frame."""
    turn = Rotation.from_quat(piece.orientation, scalar_first=True)
    spin = turn.apply(piece.surface_angular_velocity)
    velocity = turn.apply(piece.surface_velocity) + np.cross(spin, point - piece.position)
    return velocity, spin


def material_velocity(body: Body, orientation: Array, arm: Array, normal: Array) -> Array:
    """Velocity (n, 3) [m/s] along contact planes of a body's material relative to the body, world axes.

    Args:
        orientation: of the body (n, 4), wxyz.
        arm: from the body's origin to the contact points (n, 3) [m], world axes. Of several pieces the one
            with the nearest bounding box holds a point.
        normal: of the contact planes (n, 3).
    """
    turned = Rotation.from_quat(orientation, scalar_first=True)
    point = turned.inv().apply(arm)
    boxes = [piece_box(piece, np.zeros(3), np.eye(3)) for piece in body.pieces]
    apart = [
        np.linalg.norm(np.maximum(np.maximum(low - point, point - high), 0), axis=1) for low, high in boxes
    ]
    motions = np.array([surface_motion(piece, point)[0] for piece in body.pieces])
    world = turned.apply(motions[np.argmin(apart, axis=0), np.arange(len(point))])
    return np.asarray(world - np.einsum("ij,ij->i", world, normal)[:, None] * normal)

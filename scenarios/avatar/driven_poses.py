"""Initial world poses of the pieces of driven bodies."""

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.kinematics import link_poses
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.scenario import Piece, Scenario


def driven_pieces(scenario: Scenario) -> list[Piece]:
    """All pieces of driven bodies, posed in the world by their trackers at time 0."""
    placed = []
    for tracker in scenario.trackers:
        start = sample(tracker, np.zeros(1))
        place, turn = link_poses(scenario, tracker, start.position, start.orientation, start.angle)
        for link, origin, axes in zip(scenario.links(tracker), place[:, 0], turn[:, 0]):
            pieces = scenario.bodies[link].pieces
            placed += [moved(piece, Rotation.from_matrix(axes), origin) for piece in pieces]
    return placed


def moved(piece: Piece, turn: Rotation, shift: np.ndarray) -> Piece:
    """A piece rotated about the origin, then translated by (3,) [m]."""
    own = Rotation.from_quat(np.array(piece.orientation), scalar_first=True)
    x, y, z = (turn.apply(piece.position) + shift).tolist()
    qw, qx, qy, qz = (turn * own).as_quat(scalar_first=True).tolist()
    return Piece(piece.name, piece.shape, (x, y, z), (qw, qx, qy, qz))

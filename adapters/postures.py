"""Where the pieces of driven bodies are, by the reference's kinematics."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from adapters.translation import translate
from reference_impl.driven.skeleton import pose_links
from scenarios.scenario import Piece, Scenario


def driven_pieces(scenario: Scenario) -> list[Piece]:
    """All pieces of driven bodies, posed in the world as their trackers show them at time 0."""
    world = translate(scenario)
    for driver in world.drivers:
        pose_links(world.bodies, world.joints, driver)
    placed = []
    for body, row in zip(scenario.bodies, world.bodies):
        if body.kind == "driven":
            turn = Rotation.from_quat(row["orientation"], scalar_first=True)
            placed += [moved(piece, turn, row["position"]) for piece in body.pieces]
    return placed


def moved(piece: Piece, turn: Rotation, shift: np.ndarray) -> Piece:
    """A piece turned about the origin, then shifted (3,) [m]."""
    own = Rotation.from_quat(np.array(piece.orientation), scalar_first=True)
    x, y, z = (turn.apply(piece.position) + shift).tolist()
    qw, qx, qy, qz = (turn * own).as_quat(scalar_first=True).tolist()
    return Piece(piece.name, piece.shape, (x, y, z), (qw, qx, qy, qz))

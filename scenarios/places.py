"""Where bodies start: none in the very place of another."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from scenarios.scenario import Body, Hull, Piece, Scenario

COINCIDENT = 1e-9
"""Distance of the centres of two solids up to which they coincide [m]: no direction leads apart rather than
another."""


def check_places(scenario: Scenario, report: Callable[[str, str], None]) -> None:
    """No body starts where another one does; what overlaps otherwise is parted by contact. A driven body is
    where its tracker puts it: the engines see to that."""
    bodies = scenario.bodies
    owner = [i for i, body in enumerate(bodies) if body.kind != "driven" for _ in body.pieces]
    centers = [_center(body, piece) for body in bodies if body.kind != "driven" for piece in body.pieces]
    if len(centers) < 2:
        return
    met: set[tuple[int, int]] = set()
    for one, two in sorted(KDTree(np.array(centers)).query_pairs(COINCIDENT)):
        a, b = sorted((owner[one], owner[two]))
        if a == b or (a, b) in met or bodies[a].kind == bodies[b].kind == "fixed":
            continue
        met.add((a, b))
        place = ", ".join(f"{x:g}" for x in centers[one])
        report(
            f"bodies[{b}].position",
            f"{bodies[b].name!r} starts where {bodies[a].name!r} does: pieces of both have their centre at "
            f"({place}) m; move one of them",
        )


def _center(body: Body, piece: Piece) -> np.ndarray:
    """A point inside a piece [m, world]: its centre, or the mean of its vertices."""
    local = np.mean(piece.shape.vertices, axis=0) if isinstance(piece.shape, Hull) else np.zeros(3)
    for pose in (piece, body):
        local = Rotation.from_quat(pose.orientation, scalar_first=True).apply(local) + pose.position
    return np.asarray(local)

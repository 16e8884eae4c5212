"""Bodies that start in the same place."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial import KDTree
from scipy.spatial.transform import Rotation

from touchstone.scenarios.scenario import (
    ORIGIN,
    TRACKED,
    Body,
    Hull,
    Piece,
    Scenario,
    Vector,
    vector,
)

COINCIDENT = 1e-9
"""Distance of the centres of two solids up to which they coincide [m]: the direction of separation is then
undefined."""


def coinciding(scenario: Scenario) -> str | None:
    """One-line message on two bodies that start at the same place; None if there are none.

    Contact separates all other overlaps. Ignored are driven and prescribed bodies, which trackers place, and
    pairs that may not touch.
    """
    bodies = scenario.bodies
    owner = [i for i, body in enumerate(bodies) if body.kind not in TRACKED for _ in body.pieces]
    if len(owner) < 2:
        return None
    pieces = [piece for body in bodies if body.kind not in TRACKED for piece in body.pieces]
    centers = np.array([_center(piece) for piece in pieces])
    frames: tuple[Sequence[Piece | Body], ...] = (pieces, [bodies[k] for k in owner])
    for poses in frames:
        turn = Rotation.from_quat([pose.orientation for pose in poses], scalar_first=True)
        centers = turn.apply(centers) + [pose.position for pose in poses]
    touching: set[tuple[int, int]] = set()
    for one, two in sorted(KDTree(centers).query_pairs(COINCIDENT)):
        a, b = sorted((owner[one], owner[two]))
        touching = touching or set(scenario.touching_pairs())
        if (a, b) not in touching:
            continue
        place = ", ".join(f"{x:g}" for x in centers[one])
        return (
            f"bodies[{b}].position: {bodies[b].name!r} starts where {bodies[a].name!r} does: pieces of both "
            f"have their centre at ({place}) m; move one of them"
        )
    return None


def _center(piece: Piece) -> Vector:
    """Point inside a piece [m, its own frame]: its centre, or the mean of its vertices."""
    return vector(np.mean(piece.shape.vertices, axis=0)) if isinstance(piece.shape, Hull) else ORIGIN

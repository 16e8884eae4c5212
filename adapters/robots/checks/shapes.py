"""Shapes of a robot: hulls that fill hollows, and links that overlap where the robot starts."""

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.oracles.overlap import coal_shape, signed_distance
from touchstone.adapters.robots.checks.finding import Finding
from touchstone.adapters.robots.checks.posture import Posture, colliding, name_of
from touchstone.adapters.robots.pieces import TYPE, PieceMaker, may_touch, mesh_triangles
from touchstone.scenarios.avatar.kinematics import piece_box
from touchstone.scenarios.scenario import Piece

LEAST_VOLUME = 0.01
"""Volume of a closed mesh relative to its hull's [1] below which its faces are taken as badly oriented."""
DEPTH = 1e-4
"""Overlap at the start that is reported [m]: less comes from rounded numbers in files."""


def hulls(model: Any, maker: PieceMaker) -> Iterator[Finding]:
    """Meshes whose convex hull, which all engines play, fills hollows."""
    meshes = [geom for geom in colliding(model) if TYPE[int(model.geom_type[geom])] == "mesh"]
    used = sorted({int(model.geom_dataid[geom]) for geom in meshes})
    for mesh in used:
        subject = name_of(model, "mesh", mesh)
        found = maker.mesh(mesh, subject)
        if found.fills_hollows:
            more = _added_volume(model, mesh)
            volume = f" and adds {100 * more:.0f} % to its volume" if np.isfinite(more) else ""
            yield Finding(
                "hull",
                subject,
                f"its hull fills hollows of {found.filled * 1e3:.3g} mm at a size of "
                f"{found.size * 1e3:.3g} mm{volume}",
                "split it into convex parts, one collision shape each (CoACD, V-HACD), or use primitives",
            )


def _added_volume(model: Any, mesh: int) -> float:
    """Volume that the hull of a mesh adds, relative to the mesh's; NaN if the mesh is not closed, or faces
    have both orientations, so that parts cancel."""
    vertices, faces = mesh_triangles(model, mesh)
    edges = {(a, b) for face in faces.tolist() for a, b in zip(face, face[1:] + face[:1])}
    if any((b, a) not in edges for a, b in edges):
        return float("nan")
    one, two, three = vertices[faces].transpose(1, 0, 2)
    own = abs(float(np.einsum("ni,ni->", one, np.cross(two, three)))) / 6
    whole = ConvexHull(vertices).volume
    return whole / own - 1 if own > LEAST_VOLUME * whole else float("nan")


def overlaps(postures: list[Posture]) -> Iterator[Finding]:
    """Links that overlap in the reference posture or a keyframe, each pair at its deepest."""
    deepest: dict[tuple[str, str], tuple[float, str]] = {}
    for posture in postures:
        model = posture.model
        geoms = colliding(model)
        pieces = {geom: posture.piece(geom) for geom in geoms}
        for a, b in combinations(geoms, 2):
            if not may_touch(model, a, b) or not _near(pieces[a], pieces[b]):
                continue
            depth = -distance(pieces[a], pieces[b])[0]
            one, two = (name_of(model, "body", int(model.geom_bodyid[geom])) for geom in (a, b))
            if depth > max(DEPTH, deepest.get((one, two), (0.0, ""))[0]):
                deepest[one, two] = (depth, posture.name)
    for (one, two), (depth, name) in deepest.items():
        yield Finding(
            "overlap",
            f"{one} and {two}",
            f"overlap by {depth * 1e3:.3g} mm at {name}",
            "engines throw them apart in the first steps: exclude the pair, shrink one, or start elsewhere",
        )


def pose(piece: Piece) -> tuple[Array, Array]:
    """Axes as columns (3, 3) and position (3,) of a piece in the world."""
    turn = Rotation.from_quat(piece.orientation, scalar_first=True)
    return np.asarray(turn.as_matrix()), np.array(piece.position)


def distance(one: Piece, two: Piece) -> tuple[float, Array, Array]:
    """Signed distance [m] of two pieces in the world, normal from one to the other, and middle point."""
    return signed_distance(coal_shape(one.shape), pose(one), coal_shape(two.shape), pose(two))


def _near(one: Piece, two: Piece) -> bool:
    """Whether the boxes about two pieces meet."""
    (low, high), (other_low, other_high) = (piece_box(piece, np.zeros(3), np.eye(3)) for piece in (one, two))
    return bool((low <= other_high).all() and (other_low <= high).all())

"""Scenes whose boxes and hulls are cut in two: the bodies, their masses and their surfaces stay the same."""

from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.relations.changes import bare
from touchstone.scenarios.scenario import Body, Box, Hull, Piece, Scenario, vector

SHARES = (0.3, 0.7)
"""Range of the share of its size at which a piece is cut [1]: both parts are ordinary."""
COPLANAR = 1e-9
"""Difference of two faces' normals below which they are one face [1]: rounding of qhull."""


def is_divisible(body: Body) -> bool:
    """Whether a body that may move has a box or a hull."""
    return body.kind == "simulated" and any(isinstance(piece.shape, Box | Hull) for piece in body.pieces)


def decomposed(scenario: Scenario) -> Scenario:
    """Scene with every box and hull of simulated bodies cut in two, at random places of the scene's seed.

    Boxes are cut across an axis into boxes, hulls by a plane into hulls.
    """
    rng = np.random.default_rng(scenario.seed)
    bodies = tuple(
        replace(body, pieces=tuple(part for piece in body.pieces for part in _cut(piece, rng)))
        if is_divisible(body)
        else body
        for body in scenario.bodies
    )
    return bare(scenario, bodies=bodies)


def _cut(piece: Piece, rng: np.random.Generator) -> tuple[Piece, ...]:
    """The parts of a piece; a round one is its only part."""
    share = float(rng.uniform(*SHARES))
    match piece.shape:
        case Box(half_extents):
            axis, half = int(rng.integers(3)), np.array(half_extents)
            turn = Rotation.from_quat(piece.orientation, scalar_first=True)
            parts = []
            for number, (size, side) in enumerate(((share, -1), (1 - share, 1)), start=1):
                inner, middle = half.copy(), np.zeros(3)
                inner[axis] *= size
                middle[axis] = side * (half[axis] - inner[axis])
                place = vector(piece.position + turn.apply(middle))
                name = f"{piece.name} part {number}"
                parts.append(replace(piece, name=name, shape=Box(vector(inner)), position=place))
            return tuple(parts)
        case Hull(vertices):
            points, across = np.array(vertices), rng.normal(size=3)
            along = points @ across
            height = along - (along.min() + share * np.ptp(along))
            seam = _seam(points, height)
            return tuple(
                replace(piece, name=f"{piece.name} part {number}", shape=_hull(points[mine], seam))
                for number, mine in enumerate((height < 0, height > 0), start=1)
            )
    return (piece,)


def _seam(points: Array, height: Array) -> Array:
    """Where the edges of a hull cross the plane of height 0."""
    faces = ConvexHull(points)
    met: dict[tuple[int, int], list[int]] = {}
    for number, corners in enumerate(np.sort(faces.simplices, axis=1)):
        for edge in combinations(corners.tolist(), 2):
            met.setdefault(edge, []).append(number)
    normals = faces.equations[:, :3]
    crossed = [
        (a, b)
        for (a, b), (one, two) in met.items()
        # no diagonal of a face
        if height[a] * height[b] < 0 and np.linalg.norm(normals[one] - normals[two]) > COPLANAR
    ]
    a, b = np.array(crossed).T
    share = height[a] / (height[a] - height[b])
    return np.asarray(points[a] + share[:, None] * (points[b] - points[a]))


def _hull(corners: Array, seam: Array) -> Hull:
    return Hull(tuple(map(vector, np.concatenate([corners, seam]))))

"""Bullet's closest points through pybullet.

Conventions: quaternions are xyzw; a point's normal points from B to A; distance is negative in overlap. Hulls
have a margin of 1 mm, that of rounded ones is their radius. pybullet prints its build time on import: the
child's output is redirected.
"""

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any

import numpy as np
import pybullet

from touchstone.adapters.contract import Array, Scalar, Unsupported
from touchstone.adapters.detectors import Pair, PythonDetector, Query
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Hull,
    Piece,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
)
from touchstone.scenarios.solids import core_vertices

FAR = 100.0
"""Maximum distance of a query [m]: larger than that of any pair in the study."""
DISTANCE, NORMAL = 8, 7
"""Indices in the tuple of a closest point."""


class BulletDetector(PythonDetector):
    """`getClosestPoints` of two static bodies; reports the deepest point of the manifold. `tight` sets the
    collision margin to zero."""

    def __init__(self, tight: bool = False) -> None:
        self._tight = tight
        self._client = pybullet.connect(pybullet.DIRECT)

    def _release(self) -> None:
        pybullet.resetSimulation(physicsClientId=self._client)

    def describe(self) -> Mapping[str, Scalar]:
        return {
            "version": f"{version('pybullet')} (API {pybullet.getAPIVersion()})",
            "call": "getClosestPoints",
            "collisionMargin": 0.0 if self._tight else "default",
        }

    def _query(self, pair: Pair) -> Query:
        (a, b), client = map(self._body, pair), self._client

        def ask() -> Any:
            return pybullet.getClosestPoints(a, b, FAR, physicsClientId=client)

        return Query(ask, _deepest)

    def _body(self, piece: Piece) -> int:
        w, x, y, z = piece.orientation
        shape = _shape(piece.shape, self._client)
        body: int = pybullet.createMultiBody(
            0, shape, -1, piece.position, (x, y, z, w), physicsClientId=self._client
        )
        if isinstance(piece.shape, RoundedBox | RoundedHull):
            pybullet.changeDynamics(
                body, -1, collisionMargin=piece.shape.radius, physicsClientId=self._client
            )
        elif self._tight:
            pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=self._client)
        return body


def _deepest(points: Any) -> tuple[float, Array] | None:
    if not points:
        return None
    point = min(points, key=lambda p: p[DISTANCE])
    return point[DISTANCE], -np.array(point[NORMAL])


def _shape(shape: Shape, client: int) -> int:
    given: dict[str, Any]
    match shape:
        case Sphere(radius):
            kind, given = pybullet.GEOM_SPHERE, {"radius": radius}
        case Box(half):
            kind, given = pybullet.GEOM_BOX, {"halfExtents": half}
        case Capsule(radius, half_length):
            kind, given = pybullet.GEOM_CAPSULE, {"radius": radius, "height": 2 * half_length}
        case Cylinder(radius, half_length):
            kind, given = pybullet.GEOM_CYLINDER, {"radius": radius, "height": 2 * half_length}
        case HalfSpace():
            kind, given = pybullet.GEOM_PLANE, {"planeNormal": (0.0, 0.0, 1.0)}
        case Hull(vertices):
            kind, given = pybullet.GEOM_MESH, {"vertices": vertices}
        case RoundedBox() | RoundedHull():
            kind, given = pybullet.GEOM_MESH, {"vertices": core_vertices(shape)}
        case _:
            raise Unsupported(f"bullet: no shape {type(shape).__name__}")
    return int(pybullet.createCollisionShape(kind, physicsClientId=client, **given))

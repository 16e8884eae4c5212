"""python-fcl (FCL 0.7) with its default solver, libccd: contacts by `collide`, or `distance`.

Conventions: a contact's normal points from the first object to the second; depth is positive in overlap. Each
call uses a new result, because python-fcl's results have no `clear`.
"""

from collections.abc import Mapping
from functools import cache
from typing import Any

import fcl
import numpy as np

from touchstone.adapters.contract import Array, Scalar, Unsupported
from touchstone.adapters.detectors import APART, Pair, PythonDetector, Query, unit
from touchstone.adapters.engines.reference.reference_world import matrix
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    HalfSpace,
    Hull,
    Piece,
    Shape,
    Sphere,
)
from touchstone.scenarios.solids import outward_faces


class FclCollide(PythonDetector):
    """Contacts only, by default one, the deepest; reports no contact for separated pieces."""

    def describe(self) -> Mapping[str, Scalar]:
        request = fcl.CollisionRequest()
        return {"version": fcl.__version__, "call": "collide", "solver": str(request.gjk_solver_type)}

    def _query(self, pair: Pair) -> Query:
        a, b = map(_object, pair)
        request = fcl.CollisionRequest(enable_contact=True)

        def ask() -> Any:
            result = fcl.CollisionResult()
            fcl.collide(a, b, request, result)
            return result

        return Query(ask, _deepest)


class FclDistance(PythonDetector):
    """Signed distance with nearest points. (Overlapping spheres run the full EPA: 155 us.)"""

    crossings = (APART, APART)

    def describe(self) -> Mapping[str, Scalar]:
        request = fcl.DistanceRequest()
        return {"version": fcl.__version__, "call": "distance", "solver": str(request.gjk_solver_type)}

    def _query(self, pair: Pair) -> Query:
        a, b = map(_object, pair)
        request = fcl.DistanceRequest(enable_nearest_points=True, enable_signed_distance=True)

        def ask() -> Any:
            result = fcl.DistanceResult()
            return fcl.distance(a, b, request, result), result

        return Query(ask, _signed)


def _deepest(result: Any) -> tuple[float, Array] | None:
    if not result.contacts:
        return None
    contact = max(result.contacts, key=lambda c: c.penetration_depth)
    return -contact.penetration_depth, np.array(contact.normal)


def _signed(found: Any) -> tuple[float, Array]:
    distance, result = found
    p, q = map(np.array, result.nearest_points)
    return distance, unit((q - p) * np.sign(distance))


def _object(piece: Piece) -> Any:
    pose = fcl.Transform(matrix(piece.orientation), np.array(piece.position))
    return fcl.CollisionObject(_shape(piece.shape), pose)


@cache
def _shape(shape: Shape) -> Any:
    match shape:
        case Sphere(radius):
            return fcl.Sphere(radius)
        case Box(half_extents):
            return fcl.Box(*(2 * extent for extent in half_extents))
        case Capsule(radius, half_length):
            return fcl.Capsule(radius, 2 * half_length)
        case Cylinder(radius, half_length):
            return fcl.Cylinder(radius, 2 * half_length)
        case Cone(radius, half_length):
            return fcl.Cone(radius, 2 * half_length)
        case HalfSpace():
            return fcl.Halfspace(np.array((0.0, 0.0, 1.0)), 0.0)
        case Hull(vertices):
            points = np.array(vertices)
            faces = outward_faces(points)
            return fcl.Convex(points, len(faces), np.insert(faces, 0, 3, axis=1).ravel())
    raise Unsupported(f"python-fcl: no shape {type(shape).__name__}")

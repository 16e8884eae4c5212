"""DART's collision detectors through dartpy: fcl, bullet and dart.

Conventions: a contact's normal points from its object 2 to its object 1, in any order; depth is positive in
overlap. Hulls are triangle meshes, as in `engines/dart/model.py`: shells without an interior, in single
precision.
"""

from collections.abc import Mapping
from typing import Any

import dartpy
import numpy as np

from touchstone.adapters.contract import Array, Scalar
from touchstone.adapters.detectors import Pair, PythonDetector, Query
from touchstone.adapters.engines.dart.model import add_piece, isometry
from touchstone.scenarios.scenario import Piece, Shape

CONTACTS = 1000
"""Maximum number of contacts per pair: DART's default."""
KINDS = {
    "fcl": dartpy.collision.FCLCollisionDetector,
    "bullet": dartpy.collision.BulletCollisionDetector,
    "dart": dartpy.collision.DARTCollisionDetector,
}


class DartDetector(PythonDetector):
    """A collision group per pair; reports the deepest contact, and no contact for separated pieces."""

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._detector = KINDS[kind]()
        self._shapes: dict[Shape, Any] = {}
        self._skeletons: list[Any] = []

    def _release(self) -> None:
        self._skeletons.clear()

    def describe(self) -> Mapping[str, Scalar]:
        return {"version": str(dartpy.__version__), "call": f"collide ({self._kind})"}

    def _query(self, pair: Pair) -> Query:
        a, b = map(self._frame, pair)
        group = self._detector.createCollisionGroup()
        group.addShapeFrame(a)
        group.addShapeFrame(b)
        option = dartpy.collision.CollisionOption(True, CONTACTS)
        result = dartpy.collision.CollisionResult()

        def ask() -> Any:
            result.clear()
            group.collide(option, result)
            return result

        def read(result: Any) -> tuple[float, Array] | None:
            contacts = result.getContacts()
            if not contacts:
                return None
            contact = max(contacts, key=lambda c: c.penetrationDepth)
            turned = contact.collisionObject1.getShapeFrame() == a
            return -contact.penetrationDepth, np.array(contact.normal) * (-1.0 if turned else 1.0)

        return Query(ask, read)

    def _frame(self, piece: Piece) -> Any:
        """Put a piece on its own body; each shape is loaded once."""
        skeleton = dartpy.dynamics.Skeleton(f"skeleton {len(self._skeletons)}")
        self._skeletons.append(skeleton)
        _, node = skeleton.createWeldJointAndBodyNodePair()
        if piece.shape in self._shapes:
            frame = node.createShapeNode(self._shapes[piece.shape], "piece")
            frame.setRelativeTransform(isometry(piece.position, piece.orientation))
            frame.createCollisionAspect()
        else:
            add_piece(node, piece, "piece", 0.0, 0.0)
            frame = node.getShapeNode(0)
            self._shapes[piece.shape] = frame.getShape()
        return frame

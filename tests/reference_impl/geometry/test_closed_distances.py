"""Pairs of shapes with a known distance and normal, for the reference and for the judge of overlap."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.core.conventions import TOUCHING_DISTANCE_SHARE
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
    Vector,
)


class Known(NamedTuple):
    """Shape A at the origin, shape B at a place and a turn; distance, and normal unless several are right."""

    a: Shape
    b: Shape
    place: Vector
    distance: float
    normal: Vector | None
    turn: Rotation = Rotation.identity()


WHOLE = Rotation.from_rotvec((0.4, -0.3, 1.1))
"""Turns whole scenes, so that no axis of theirs is one of the world's."""
LONG, THICK = Capsule(0.1, 0.5), Capsule(0.2, 0.7)
DRUM, HAT = Cylinder(0.5, 0.5), Cone(0.3, 0.2)
CUBE, SOFT = Box((0.1, 0.1, 0.1)), RoundedBox((0.3, 0.3, 0.3), 0.1)
CORNER = RoundedHull(((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.2)
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ACROSS, UPRIGHT = Rotation.from_rotvec((0.0, np.pi / 2, 0.0)), Rotation.from_rotvec((np.pi / 2, 0.0, 0.0))
KNOWN = {
    "sphere beside a capsule": Known(LONG, Sphere(0.2), (0.4, 0.0, 0.3), 0.1, X),
    "sphere in a capsule's side": Known(LONG, Sphere(0.2), (0.0, 0.25, -0.3), -0.05, Y),
    "sphere before a capsule's end": Known(LONG, Sphere(0.2), (0.3, 0.0, 0.9), 0.2, (0.6, 0, 0.8)),
    "sphere on a capsule's core": Known(LONG, Sphere(0.2), (0.0, 0.0, 0.2), -0.3, None),
    "sphere round a capsule's end": Known(LONG, Sphere(0.2), (0.0, 0.0, 0.5), -0.3, None),
    "parallel capsules": Known(LONG, THICK, (0.0, 0.5, 0.4), 0.2, Y),
    "parallel capsules, overlapping": Known(LONG, THICK, (0.25, 0.0, 0.4), -0.05, X),
    "capsules end to end": Known(LONG, THICK, (0.0, 0.0, 1.7), 0.2, Z),
    "capsules' ends beside": Known(LONG, THICK, (0.0, 0.3, 1.6), 0.2, (0, 0.6, 0.8)),
    "crossed capsules": Known(LONG, THICK, (0.3, 0.5, 0.4), 0.2, Y, ACROSS),
    "crossed capsules, overlapping": Known(LONG, THICK, (0.3, -0.1, 0.4), -0.2, (0, -1, 0), ACROSS),
    "crossed capsules, the cores meet": Known(LONG, THICK, (0.3, 0.0, 0.4), -0.3, None, ACROSS),
    "a capsule's end on a core": Known(LONG, THICK, (0.7, 0.0, 0.4), -0.3, None, ACROSS),
    "a capsule's end before a side": Known(LONG, THICK, (1.2, 0.0, 0.4), 0.2, X, ACROSS),
    "one capsule in the other": Known(LONG, LONG, (0.0, 0.0, 0.0), -0.2, None),
    "capsules on one line": Known(LONG, LONG, (0.0, 0.0, 0.3), -0.2, None),
    "capsule over a box": Known(Box((1.0, 1.0, 0.2)), Capsule(0.2, 0.3), (0.1, 0.0, 0.45), 0.05, Z, ACROSS),
    "ball in a corner of a box": Known(
        *(Box((0.3, 0.2, 0.25)), Sphere(0.1), tuple((np.array((0.3, 0.2, 0.25)) + 0.09 / 3**0.5).tolist())),
        *(-0.01, (3**-0.5,) * 3),
    ),
    "ellipsoids end to side": Known(
        Ellipsoid((0.3, 0.2, 0.1)), Ellipsoid((0.2, 0.3, 0.1)), (0.52, 0.0, 0.0), 0.02, X
    ),
    "ball over a cap": Known(DRUM, Sphere(0.2), (0.3, 0.1, 1.0), 0.3, Z),
    "ball beside a cylinder": Known(DRUM, Sphere(0.2), (0.6, 0.8, 0.1), 0.3, (0.6, 0.8, 0)),
    "ball off a rim": Known(DRUM, Sphere(0.2), (0.8, 0.0, 0.9), 0.3, (0.6, 0, 0.8)),
    "ball in a cylinder": Known(DRUM, Sphere(0.2), (0.0, 0.45, 0.0), -0.25, Y),
    "cylinder on a cap": Known(DRUM, Cylinder(0.3, 0.4), (0.1, 0.2, 0.8), -0.1, Z),
    "cylinders side by side": Known(DRUM, Cylinder(0.3, 0.4), (0.0, 0.9, 0.1), 0.1, Y),
    "crossed cylinders": Known(DRUM, Cylinder(0.3, 2.0), (0.1, 0.9, 0.2), 0.1, Y, ACROSS),
    "capsule along a cylinder": Known(DRUM, Capsule(0.3, 0.4), (0.0, 0.9, 0.1), 0.1, Y),
    "box over a cap": Known(DRUM, Box((0.1, 0.2, 0.3)), (0.4, 0.2, 0.9), 0.1, Z),
    "cylinder on a face": Known(DRUM, Box((2.0, 2.0, 0.3)), (0.0, 1.0, 0.0), 0.2, Y, UPRIGHT),
    "ball over an apex": Known(HAT, Sphere(0.1), (0, 0, 0.5), 0.2, Z),
    "ball beside a cone": Known(HAT, Sphere(0.1), (0.55, 0, 0.3), 0.4, (0.8, 0, 0.6)),
    "ball under a cone": Known(HAT, Sphere(0.1), (0.1, 0, -0.5), 0.2, (0, 0, -1)),
    "cone in a plane": Known(HalfSpace(), HAT, (0.4, 0.1, 0.1), -0.1, Z),
    "ball over a plane": Known(HalfSpace(), Sphere(0.3), (7.0, 1.0, 0.5), 0.2, Z),
    "box deep in a plane": Known(HalfSpace(), Box((0.1, 0.2, 0.3)), (7.0, 1.0, -5.0), -5.3, Z),
    "ball on a rounded face": Known(SOFT, Sphere(0.1), (0.1, 0.2, 0.7), 0.2, Z),
    "ball on a rounded edge": Known(SOFT, Sphere(0.1), (0.0, 0.6, 0.7), 0.3, (0, 0.6, 0.8)),
    "box in a rounded face": Known(SOFT, CUBE, (0.1, 0.0, -0.45), -0.05, (0, 0, -1)),
    "ball under a rounded hull": Known(CORNER, Sphere(0.1), (0.2, 0.2, -0.4), 0.1, (0, 0, -1)),
    "rounded hull over a plane": Known(HalfSpace(), CORNER, (0.2, 0.2, 0.25), 0.05, Z),
}


@pytest.mark.parametrize("whole", [Rotation.identity(), WHOLE], ids=["upright", "turned"])
@pytest.mark.parametrize("row", KNOWN.values(), ids=KNOWN)
def test_the_reference_finds_it(lab: SimpleNamespace, row: Known, whole: Rotation) -> None:
    """Measure in both orders: distance, normal, and witnesses as far apart along it."""
    one = lab.piece(row.a, (0.0, 0.0, 0.0), whole)
    two = lab.piece(row.b, whole.apply(row.place), whole * row.turn)
    by_cores = all(isinstance(shape, Sphere | Capsule) for shape in (row.a, row.b))
    rounding, turned, parted = (1e-14, 1e-13, 1e-14) if by_cores else (1e-12, 1e-6, 1e-7)
    for a, b, sign in ((one, two, 1), (two, one, -1)):
        found = lab.measure(a, b)
        assert found.converged
        assert found.distance == pytest.approx(row.distance, abs=rounding)
        assert np.linalg.norm(found.normal) == pytest.approx(1, abs=1e-14)
        slack = parted if row.normal is not None else 2 * TOUCHING_DISTANCE_SHARE
        assert found.point_b - found.point_a == pytest.approx(found.distance * found.normal, abs=slack)
        if row.normal is not None:
            assert found.normal == pytest.approx(sign * whole.apply(row.normal), abs=turned)


@pytest.mark.parametrize("row", KNOWN.values(), ids=KNOWN)
def test_the_judge_finds_it(row: Known) -> None:
    """The judge of overlap agrees, in the normal as far as the sides of cylinders allow."""
    overlap = pytest.importorskip("touchstone.adapters.oracles.overlap", reason="coal is not installed")
    if HalfSpace in (type(row.a), type(row.b)):
        pytest.skip("coal's signed distance has no half-spaces")
    shapes = [overlap.coal_shape(shape) for shape in (row.a, row.b)]
    one = (np.eye(3), np.zeros(3))
    two = (row.turn.as_matrix(), np.array(row.place, dtype=float))
    distance, normal, _ = overlap.signed_distance(shapes[0], one, shapes[1], two)
    assert distance == pytest.approx(row.distance, abs=1e-7)
    if row.normal is not None:
        assert normal == pytest.approx(row.normal, abs=2e-4)

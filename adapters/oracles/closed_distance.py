"""Signed distances in closed form, for many poses at a time: of spheres, of shapes over a face of a box, and
of all shapes over a half-space.

Conventions as in `overlap.py`. A pose in which no closed form holds has the distance NaN.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.scenarios.extents import extents
from touchstone.scenarios.scenario import (
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    RoundedBox,
    RoundedHull,
    Shape,
    Sphere,
)

LEVEL = 1e-9
"""Difference in height of points of a shape that are equally low [m]: a tenth of the oracle's tolerance."""


@dataclass(frozen=True, slots=True)
class Placed:
    """A shape's rotation matrices (n, 3, 3) and origins (n, 3) [m], world."""

    shape: Shape
    turned: Array
    origin: Array


@dataclass(frozen=True, slots=True)
class Answers:
    """Signed distances (n,) [m], normals from the first to the second shape and midpoints (n, 3)."""

    distance: Array
    normal: Array
    point: Array

    def reversed(self) -> Answers:
        """The same with the shapes in the other order."""
        return Answers(self.distance, -self.normal, self.point)

    def or_else(self, other: Callable[[NDArray[np.int64]], Answers]) -> Answers:
        """These answers; where the distance is NaN, those of `other`, called with the indices of these."""
        missing = np.flatnonzero(np.isnan(self.distance))
        if len(missing):
            found = other(missing)
            self.distance[missing] = found.distance
            self.normal[missing], self.point[missing] = found.normal, found.point
        return self


def closed_distance(one: Placed, two: Placed) -> Answers | None:
    """Answers of all poses; None if there is no closed form for these two shapes."""
    match one.shape, two.shape:
        case HalfSpace(), HalfSpace():
            return None
        case HalfSpace(), _:
            return _over_plane(one, two)
        case _, HalfSpace():
            return _over_plane(two, one).reversed()
        case Sphere(), Sphere():
            return _spheres(one, two)
        case Box(), Sphere():
            return _box_sphere(one, two)
        case Sphere(), Box():
            return _box_sphere(two, one).reversed()
        case Box(), Box():
            return _over_face(one, two).or_else(lambda k: _over_face(at(two, k), at(one, k)).reversed())
        case Box(), _:
            return _over_face(one, two)
        case _, Box():
            return _over_face(two, one).reversed()
    return None


def at(placed: Placed, chosen: NDArray[np.int64]) -> Placed:
    """The shape in the chosen poses."""
    return Placed(placed.shape, placed.turned[chosen], placed.origin[chosen])


def _spheres(one: Placed, two: Placed) -> Answers:
    assert isinstance(one.shape, Sphere)
    assert isinstance(two.shape, Sphere)
    way = two.origin - one.origin
    far = np.sqrt(np.einsum("ni,ni->n", way, way))
    far[far == 0] = np.nan
    normal = way / far[:, None]
    distance = far - one.shape.radius - two.shape.radius
    return Answers(distance, normal, one.origin + (one.shape.radius + distance / 2)[:, None] * normal)


def _box_sphere(box: Placed, ball: Placed) -> Answers:
    """A ball is as far from a box as its centre, less the radius; a centre inside leaves by the nearest
    face."""
    assert isinstance(box.shape, Box)
    assert isinstance(ball.shape, Sphere)
    half, radius = np.array(box.shape.half_extents), ball.shape.radius
    center = _in_axes(box, ball.origin)
    way = center - np.clip(center, -half, half)
    far = np.sqrt(np.einsum("ni,ni->n", way, way))
    inside = np.flatnonzero(far == 0)
    far[inside] = 1.0
    normal = way / far[:, None]
    room = half - np.abs(center[inside])
    face = room.argmin(axis=1)
    normal[inside, face] = np.where(center[inside, face] < 0, -1.0, 1.0)
    far[inside] = -room[np.arange(len(inside)), face]
    distance = far - radius
    middle = center - (radius + distance / 2)[:, None] * normal
    return Answers(distance, *_in_world(box, normal, middle))


def _over_plane(plane: Placed, other: Placed) -> Answers:
    """Height of a shape's lowest point over a plane: no other way out of a half-space is shorter."""
    turned = plane.turned.swapaxes(1, 2) @ other.turned
    each = np.arange(len(turned))
    lowest = _in_axes(plane, other.origin) + _lowest(
        other.shape, turned, np.full(len(each), 2), np.ones(len(each))
    )
    normal = np.zeros_like(lowest)
    normal[:, 2] = 1.0
    distance = lowest[:, 2].copy()
    lowest[:, 2] /= 2
    return Answers(distance, *_in_world(plane, normal, lowest))


def _over_face(box: Placed, other: Placed) -> Answers:
    """Distance along the normal of a box's face, where the other shape's lowest point shows that no other
    way is shorter.

    A lowest point above the face itself is the nearest one. A lowest point in the box that is farther from
    all other faces stays in the box under every shorter translation, in any direction.
    """
    assert isinstance(box.shape, Box)
    half = np.array(box.shape.half_extents)
    turned = box.turned.swapaxes(1, 2) @ other.turned
    center = _in_axes(box, other.origin)
    low, high = extents(other.shape, turned)
    above, below = center + low - half, -center - high - half
    gap = np.maximum(above, below)
    axis = gap.argmax(axis=1)
    each = np.arange(len(axis))
    distance = gap[each, axis]
    sign = np.where(above[each, axis] >= below[each, axis], 1.0, -1.0)
    lowest = center + _lowest(other.shape, turned, axis, sign)
    room = half - np.abs(lowest)
    room[each, axis] = half[axis]
    distance[(room < np.maximum(0.0, -distance)[:, None]).any(axis=1)] = np.nan
    normal = np.zeros_like(center)
    normal[each, axis] = sign
    return Answers(distance, *_in_world(box, normal, lowest - distance[:, None] / 2 * normal))


def _lowest(shape: Shape, turned: Array, axis: NDArray[np.int64], sign: Array) -> Array:
    """The lowest point (n, 3) along `axis` times `sign`; the middle of an edge or a face that is lowest."""
    up = sign[:, None] * turned[np.arange(len(axis)), axis]
    match shape:
        case RoundedBox() | RoundedHull():
            core = Box(shape.half_extents) if isinstance(shape, RoundedBox) else Hull(shape.vertices)
            return _lowest(core, turned, axis, sign) - shape.radius * np.einsum("nij,nj->ni", turned, up)
        case Box(half):
            own = -_levelled(up * np.array(half))
            own = np.sign(own) * np.array(half)
        case Sphere(radius):
            own = -radius * up
        case Capsule(radius, half_length):
            own = -radius * up
            own[:, 2] -= half_length * np.sign(_levelled(up[:, 2] * half_length))
        case Cylinder(radius, half_length):
            own = _rim(radius, up)
            own[:, 2] = -half_length * np.sign(_levelled(up[:, 2] * half_length))
        case Cone(radius, half_length):
            own = _rim(radius, up)
            own[:, 2] = -half_length
            # the middle between rim and apex of a cone on its side
            rim, apex = np.einsum("ni,ni->n", up, own), half_length * up[:, 2]
            share = (1 - np.sign(_levelled(apex - rim))) / 2
            own = (1 - share)[:, None] * own
            own[:, 2] += share * half_length
        case Ellipsoid(axes):
            squares = np.square(axes)
            own = -up * squares / np.sqrt(np.square(up) @ squares)[:, None]
        case Hull(vertices):
            points = np.array(vertices)
            height = up @ points.T
            share = (height <= height.min(axis=1, keepdims=True) + LEVEL).astype(float)
            own = share @ points / share.sum(axis=1, keepdims=True)
        case _:
            raise TypeError(f"no lowest point of {type(shape).__name__}")
    return np.einsum("nij,nj->ni", turned, own)


def _rim(radius: float, up: Array) -> Array:
    """Lowest point (n, 3) of a disc of a radius [m] about z along directions `up`; its centre if it is
    level."""
    across = np.hypot(up[:, 0], up[:, 1])
    rim = np.where(_levelled(across * radius) > 0, radius / np.where(across > 0, across, 1.0), 0.0)
    return np.column_stack((-up[:, :2] * rim[:, None], np.zeros(len(up))))


def _levelled(heights: Array) -> Array:
    """Heights, those within LEVEL as 0."""
    return np.where(np.abs(heights) <= LEVEL, 0.0, heights)


def _in_axes(box: Placed, points: Array) -> Array:
    """World points (n, 3) in the axes of a box."""
    return np.einsum("nji,nj->ni", box.turned, points - box.origin)


def _in_world(box: Placed, normal: Array, point: Array) -> tuple[Array, Array]:
    """A normal and a point in the axes of a box, in the world's."""
    return (
        np.einsum("nij,nj->ni", box.turned, normal),
        np.einsum("nij,nj->ni", box.turned, point) + box.origin,
    )

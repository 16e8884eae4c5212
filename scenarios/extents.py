"""Bounding boxes of shapes: how far a turned shape reaches along the axes."""

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.scenario import (
    HALF_SPACE_REACH,
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


def extents(shape: Shape, turned: Array) -> tuple[Array, Array]:
    """Lowest and highest coordinates (n, 3) [m] of a shape about its origin after rotations (n, 3, 3); a
    half-space ends at HALF_SPACE_REACH."""
    up = turned[:, :, 2]
    match shape:
        case Sphere(radius):
            half = np.full((len(turned), 3), radius)
        case Box(sides):
            half = np.abs(turned) @ np.array(sides)
        case Capsule(radius, half_length):
            half = np.abs(up) * half_length + radius
        case Cylinder(radius, half_length):
            half = np.abs(up) * half_length + _across(turned) * radius
        case Cone(radius, half_length):
            apex, base = up * half_length, -up * half_length
            across = _across(turned) * radius
            return np.minimum(apex, base - across), np.maximum(apex, base + across)
        case Ellipsoid(axes):
            half = np.linalg.norm(turned * np.array(axes), axis=2)
        case Hull(vertices):
            points = np.einsum("nij,vj->nvi", turned, np.array(vertices))
            return points.min(axis=1), points.max(axis=1)
        case RoundedBox(sides, radius):
            half = np.abs(turned) @ np.array(sides) + radius
        case RoundedHull(vertices, radius):
            low, high = extents(Hull(vertices), turned)
            return low - radius, high + radius
        case HalfSpace():
            rise = _across(turned)
            low, high = -rise - np.maximum(0.0, up), rise + np.maximum(0.0, -up)
            return low * HALF_SPACE_REACH, high * HALF_SPACE_REACH
    return -half, half


def _across(turned: Array) -> Array:
    """Reach along each axis of a disc of radius 1 about the turned z axis (n, 3)."""
    return np.hypot(turned[:, :, 0], turned[:, :, 1])

"""Row-wise vector products and rotations, fast enough for every native step."""

from math import atan2, sin, sqrt

import numpy as np

from touchstone.adapters.contract import Array


def cross(a: Array, b: Array) -> Array:
    """Cross products along the last axis. numpy's takes 50 us for checks of axes, twice per native step."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    first = np.asarray(y * w - z * v)
    found = np.empty((*first.shape, 3), first.dtype)
    found[..., 0] = first
    found[..., 1] = z * u - x * w
    found[..., 2] = x * v - y * u
    return found


def turned(orientation: Array, vector: Array) -> Array:
    """Vectors (n, 3) rotated by unit quaternions (n, 4), wxyz."""
    w, v = orientation[..., :1], orientation[..., 1:]
    twice = 2 * cross(v, vector)
    return vector + w * twice + cross(v, twice)


def turned_back(orientation: Array, vector: Array) -> Array:
    """Vectors (n, 3) rotated by the inverse of unit quaternions (n, 4), wxyz."""
    return turned(orientation * (1.0, -1.0, -1.0, -1.0), vector)


SMALL_ANGLE = 1e-3
"""Angle below which the ratio of an angle to its half's sine is a Taylor series [rad], as in scipy."""


def rotation_matrix(orientation: Array) -> Array:
    """Rotation matrix (3, 3) of a quaternion (4,), wxyz; to the bit that of scipy's `Rotation`, at a tenth of
    its time."""
    w, x, y, z = _unit(*orientation.tolist())
    return np.array(
        (
            (x * x - y * y - z * z + w * w, 2 * (x * y - z * w), 2 * (x * z + y * w)),
            (2 * (x * y + z * w), -(x * x) + y * y - z * z + w * w, 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), -(x * x) - y * y + z * z + w * w),
        )
    )


def rotation_between(start: Array, end: Array) -> Array:
    """Rotation vector (3,) [rad] that turns the quaternion `start` (4,), wxyz, into `end`, of at most pi; to
    the bit that of scipy's `Rotation`."""
    w, x, y, z = _unit(*end.tolist())
    b, *axis = _unit(*start.tolist())
    u, v, t = (-one for one in axis)
    w, x, y, z = _unit(
        w * b - x * u - y * v - z * t,
        w * u + b * x + (y * t - z * v),
        w * v + b * y + (z * u - x * t),
        w * t + b * z + (x * v - y * u),
    )
    if w < 0:
        w, x, y, z = -w, -x, -y, -z
    angle = 2 * atan2(sqrt(x * x + y * y + z * z), w)
    if angle <= SMALL_ANGLE:
        scale = 2 + angle * angle / 12 + 7 * angle * angle * angle * angle / 2880
    else:
        scale = angle / sin(angle / 2)
    return np.array((scale * x, scale * y, scale * z))


def _unit(w: float, x: float, y: float, z: float) -> tuple[float, float, float, float]:
    """A quaternion of length 1; raises ValueError for one of length 0."""
    length = sqrt(x * x + y * y + z * z + w * w)
    if length == 0:
        raise ValueError("a quaternion of length 0 has no rotation")
    return w / length, x / length, y / length, z / length

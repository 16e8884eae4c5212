"""Row-wise vector products and rotations, fast enough for every native step."""

from __future__ import annotations

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

"""Signed distance of a convex piece and a half-space: the height of its lowest point over the plane."""

import numpy as np

from touchstone.reference_impl.core.conventions import HALF_SPACE
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.geometry.shapes import axis_of, local_support, turned

NORMAL_SINE = 1e-14
"""Sine of the angle to the normal of a plane below which a direction is the normal [1]: some roundings."""


@kernel
def has_plane(piece_a, piece_b):
    """Whether one of two pieces is a half-space."""
    return piece_a["kind"] == HALF_SPACE or piece_b["kind"] == HALF_SPACE


@kernel
def plane_distance(piece_a, piece_b, vertices, out_pair):
    """Compute signed distance [m], normal A to B, and a witness on each piece, of which one is a half-space;
    writes `out_pair` (PAIR)."""
    on_a = piece_a["kind"] == HALF_SPACE
    plane, other = (piece_a, piece_b) if on_a else (piece_b, piece_a)
    n = axis_of(plane)
    height, x, y, z = _lowest(plane, other, vertices, n)
    above, below = (
        (out_pair["point_b"], out_pair["point_a"]) if on_a else (out_pair["point_a"], out_pair["point_b"])
    )
    above[0], above[1], above[2] = x, y, z
    for i in range(3):
        below[i] = above[i] - height * n[i]
        out_pair["normal"][i] = n[i] if on_a else -n[i]
    out_pair["distance"] = height


@kernel
def plane_gap(piece_a, piece_b, vertices, x, y, z):
    """Gap [m] along a unit vector from A to B, of which one is a half-space: the distance along the normal of
    the plane, minus infinity along other directions."""
    on_a = piece_a["kind"] == HALF_SPACE
    plane, other, sign = (piece_a, piece_b, 1.0) if on_a else (piece_b, piece_a, -1.0)
    n = axis_of(plane)
    off = (sign * x - n[0]) ** 2 + (sign * y - n[1]) ** 2 + (sign * z - n[2]) ** 2
    if off > NORMAL_SINE * NORMAL_SINE:
        return -np.inf
    return _lowest(plane, other, vertices, n)[0]


@kernel
def _lowest(plane, other, vertices, n):
    """Height [m] of the lowest point of a piece over a plane with the normal n, and that point, world."""
    m, p, q, r = other["world_rotation"], other["world_position"], plane["world_position"], other["radius"]
    u = -(m[0, 0] * n[0] + m[1, 0] * n[1] + m[2, 0] * n[2])
    v = -(m[0, 1] * n[0] + m[1, 1] * n[1] + m[2, 1] * n[2])
    w = -(m[0, 2] * n[0] + m[1, 2] * n[1] + m[2, 2] * n[2])
    _, u, v, w = local_support(other, vertices, u, v, w)
    x, y, z = turned(m, u, v, w)
    x, y, z = p[0] + x - r * n[0], p[1] + y - r * n[1], p[2] + z - r * n[2]
    return n[0] * (x - q[0]) + n[1] * (y - q[1]) + n[2] * (z - q[2]), x, y, z

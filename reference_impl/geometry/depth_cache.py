"""Cache of `warm_started_depth`: what it keeps of each pair of pieces from frame to frame.

Keyed by the pair and found in constant time: a pair lives in one bucket of four records, and takes that
unused for longest. A record speaks of corners and of directions in the pieces' own frames alone, so it can
grow old, but never wrong: what it proposes is proved at the poses of the day.
"""

import numpy as np

from touchstone.reference_impl.core.conventions import (
    BOX,
    BOX_FACE_COSINE,
    DEPTH_CACHE_BUCKETS,
    DEPTH_CACHE_WAYS,
    HULL,
    STEADY_LOOKUPS,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.geometry.shapes import local_corner, local_support, turned

SHORT = 1e-290
"""Squared length below which an edge has none [m^2]: its corners are one."""
NO_FACE = 0
"""Memory without a face of a box."""


@kernel
def find_entry(state, a, b):
    """The record of pieces a and b; a pair that is new takes the longest unused of its bucket, emptied."""
    walks = state["depth_cache"]
    mixed = a * 0x9E3779B1 + b * 0x85EBCA77
    first = DEPTH_CACHE_WAYS * ((mixed ^ (mixed >> 16)) & (DEPTH_CACHE_BUCKETS - 1))
    state["depth_cache_clock"] += 1
    oldest = first
    for k in range(first, first + DEPTH_CACHE_WAYS):
        if walks[k]["used"] > 0 and walks[k]["piece_a"] == a and walks[k]["piece_b"] == b:
            oldest = k
            break
        if walks[k]["used"] < walks[oldest]["used"]:
            oldest = k
    memory = walks[oldest]
    if memory["used"] == 0 or memory["piece_a"] != a or memory["piece_b"] != b:
        memory["piece_a"], memory["piece_b"], memory["count"], memory["face"] = a, b, 0, NO_FACE
        memory["cone"][:] = 0.0
    memory["used"] = state["depth_cache_clock"]
    return memory


@kernel
def steady_support(piece, vertices, memory, side, u, v, w):
    """`local_support`, at once where the last corner is known to be the farthest for nearby directions.

    Args:
        side: 0 for piece A of the memory, 1 for B.
        u, v, w: unit direction, piece frame.
    Returns:
        (x, y, z): the point, piece frame [m].
    """
    if piece["kind"] != HULL:
        _, x, y, z = local_support(piece, vertices, u, v, w)
        return x, y, z
    toward = memory["toward"][side]
    memory["steady"][side] += 1
    if (u - toward[0]) ** 2 + (v - toward[1]) ** 2 + (w - toward[2]) ** 2 < memory["cone"][side]:
        return local_corner(piece, vertices, memory["best"][side])
    corner, x, y, z = local_support(piece, vertices, u, v, w)
    _watch(piece, vertices, memory, side, corner, u, v, w)
    return x, y, z


@kernel
def _watch(piece, vertices, memory, side, corner, u, v, w):
    """Find the cone of directions about (u, v, w) for which a hull's corner stays the farthest, once it has
    been that for so long that trying all others costs as little as one more look-up a frame."""
    if corner != memory["best"][side]:
        memory["best"][side], memory["steady"][side], memory["cone"][side] = corner, 0, 0.0
    if STEADY_LOOKUPS * memory["steady"][side] < piece["vertex_count"]:
        return
    x, y, z = local_corner(piece, vertices, corner)
    # squared sine of the angle that the direction may turn by: the least over all edges from the corner
    least = 1.0
    for k in range(np.int64(piece["vertex_count"])):
        p, q, r = local_corner(piece, vertices, k)
        p, q, r = x - p, y - q, z - r
        sine = max(u * p + v * q + w * r, 0.0) ** 2 / max(p * p + q * q + r * r, SHORT)
        if k != corner:
            least = min(least, sine)
    toward = memory["toward"][side]
    toward[0], toward[1], toward[2] = u, v, w
    memory["cone"][side], memory["steady"][side] = least, 0


@kernel
def pose_vertex(piece_a, piece_b, vertices, corner_a, corner_b, k, state):
    """Vertex k of the difference from corners of A and B, as `add_support` leaves it."""
    w, a, corner, gap = state["w"][k], state["a"][k], state["corner"][k], state["gap"]
    x, y, z = local_corner(piece_a, vertices, corner_a)
    x, y, z = turned(state["turn"], x, y, z)
    u, v, t = local_corner(piece_b, vertices, corner_b)
    a[0], a[1], a[2] = x + gap[0], y + gap[1], z + gap[2]
    w[0], w[1], w[2] = a[0] - u, a[1] - v, a[2] - t
    corner[0], corner[1] = corner_a, corner_b


@kernel
def store_entry_of_pair(piece_a, piece_b, vertices, state, memory, normal):
    """Keep the corners that carry the witnesses; three are turned counter-clockwise against the normal."""
    feature, kept, count = state["feature"], memory["corner"], state["feature_count"]
    for k in range(count):
        # a smooth core has no corners, nor has the point inside
        if feature[k, 0] < 0 or feature[k, 1] < 0:
            count = 0
            break
        kept[k, 0], kept[k, 1] = feature[k, 0], feature[k, 1]
        pose_vertex(piece_a, piece_b, vertices, feature[k, 0], feature[k, 1], k, state)
    memory["count"], memory["face"] = count, _box_face(piece_a, piece_b, normal)
    if count == 3:
        w, m, n = state["w"], piece_b["world_rotation"], normal
        x = m[0, 0] * n[0] + m[1, 0] * n[1] + m[2, 0] * n[2]
        y = m[0, 1] * n[0] + m[1, 1] * n[1] + m[2, 1] * n[2]
        z = m[0, 2] * n[0] + m[1, 2] * n[1] + m[2, 2] * n[2]
        if triple(x, y, z, w[0], w[1]) + triple(x, y, z, w[1], w[2]) + triple(x, y, z, w[2], w[0]) < 0:
            for i in range(2):
                kept[1, i], kept[2, i] = feature[2, i], feature[1, i]


@kernel
def triple(x, y, z, p, q):
    """(x, y, z) . (p x q)"""
    return x * (p[1] * q[2] - p[2] * q[1]) + y * (p[2] * q[0] - p[0] * q[2]) + z * (p[0] * q[1] - p[1] * q[0])


@kernel
def _box_face(piece_a, piece_b, normal):
    """The face of a box across `normal`: 1 (of B) or 7 (of A), + 2 axis + (1 for the negative side)."""
    for k in range(6):
        box, turn = (piece_b, -1.0) if k < 3 else (piece_a, 1.0)
        rotation, axis = box["world_rotation"], k % 3
        along = turn * (
            rotation[0, axis] * normal[0] + rotation[1, axis] * normal[1] + rotation[2, axis] * normal[2]
        )
        if box["kind"] == BOX and abs(along) > BOX_FACE_COSINE:
            return 1 + 2 * k + (1 if along < 0 else 0)
    return NO_FACE

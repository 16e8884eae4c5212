"""Set-associative cache of `warm_started_depth`: one entry per pair of pieces, kept across frames.

The pair is the key, and look-up takes constant time: a pair maps to one bucket of four entries, and a new
pair replaces the least recently used entry. An entry holds only corner indices and directions in the pieces'
own frames. It may be outdated but never wrong, because every use is verified at the present poses.
"""

import numpy as np

from touchstone.reference_impl.core.conventions import BOX, DEPTH_CACHE_BUCKETS, DEPTH_CACHE_WAYS, HULL
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.geometry.shapes import local_corner, local_support, turned

BOX_FACE_COSINE = 1 - 1e-9
"""Cosine between a normal and a box axis from which the depth cache tries the box face [1]: 5e-5 rad."""
STEADY_LOOKUPS = 16
"""Vertices scanned in the time by which a support table look-up is slower than a cached cone [1]."""

SHORT = 1e-290
"""Squared length below which an edge is degenerate [m^2]: its corners coincide."""
NO_FACE = 0
"""Value of `face` in an entry without a box face."""


@kernel
def find_entry(state, a, b):
    """Cache entry of pieces a and b; a new pair clears and takes its bucket's least recently used entry."""
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
    """`local_support`, or the cached corner if the direction lies in the corner's cone.

    Args:
        side: 0 for piece A of the entry, 1 for B.
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
    """Compute the cone of directions around (u, v, w) in which a hull's corner is the support point.

    The scan of all vertices waits until the corner has been the support point for so many look-ups that it
    costs at most one more look-up per frame.
    """
    if corner != memory["best"][side]:
        memory["best"][side], memory["steady"][side], memory["cone"][side] = corner, 0, 0.0
    if STEADY_LOOKUPS * memory["steady"][side] < piece["vertex_count"]:
        return
    x, y, z = local_corner(piece, vertices, corner)
    # squared sine of the cone's half angle: the minimum over all edges from the corner
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
    """Write vertex k of the difference from corners of A and B, in the format of `add_support`."""
    w, a, corner, gap = state["w"][k], state["a"][k], state["corner"][k], state["gap"]
    x, y, z = local_corner(piece_a, vertices, corner_a)
    x, y, z = turned(state["turn"], x, y, z)
    u, v, t = local_corner(piece_b, vertices, corner_b)
    a[0], a[1], a[2] = x + gap[0], y + gap[1], z + gap[2]
    w[0], w[1], w[2] = a[0] - u, a[1] - v, a[2] - t
    corner[0], corner[1] = corner_a, corner_b


@kernel
def store_entry_of_pair(piece_a, piece_b, vertices, state, memory, normal):
    """Store the corners of the witnesses' feature, triangles in counter-clockwise order about the normal."""
    feature, kept, count = state["feature"], memory["corner"], state["feature_count"]
    for k in range(count):
        # smooth cores and the interior point have no corners
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
    """Index of a sharp box's face across `normal`: 1 (B) or 7 (A), + 2 axis + (1 if negative side)."""
    for k in range(6):
        box, turn = (piece_b, -1.0) if k < 3 else (piece_a, 1.0)
        rotation, axis = box["world_rotation"], k % 3
        along = turn * (
            rotation[0, axis] * normal[0] + rotation[1, axis] * normal[1] + rotation[2, axis] * normal[2]
        )
        if box["kind"] == BOX and box["radius"] == 0 and abs(along) > BOX_FACE_COSINE:
            return 1 + 2 * k + (1 if along < 0 else 0)
    return NO_FACE

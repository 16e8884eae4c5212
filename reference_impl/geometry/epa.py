"""EPA: the nearest face of the Minkowski difference, by expanding a polytope inside it.

The polytope's nearest face bounds the depth from below; the difference's support value along any direction
bounds it from above. The search skips faces whose offset equals the least support value, to rounding; if no
nearer face is left, the bounds have met. The origin may start outside the polytope: a face with the origin in
front has a negative offset and is expanded first.

The frame is B's. Face f has the half-edges 4f, 4f + 1, 4f + 2, counter-clockwise from outside: `start` is a
half-edge's first vertex, `twin` the opposite half-edge. A normal's length is twice the face's area, and
comparisons use squares, so that no square root delays the next support query. `key` is the signed square of a
face's offset from the origin. `level` is the height along the normal from which a vertex sees the face.
"""

from math import inf, sqrt

import numpy as np

from touchstone.reference_impl.core.conventions import (
    DEGENERATE_HEIGHT,
    DEPTH_TOLERANCE,
    EPA_FACES,
    EPA_VERTICES,
    STAGNATION_GAP,
    TOUCHING_DISTANCE_SHARE,
)
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.geometry.epa_start import first_tetrahedron, flat_normal
from touchstone.reference_impl.geometry.gjk import (
    add_support,
    inline_support,
    inward,
    repeats,
    triangle_normal,
)

ROUND_TOLERANCE = 1e-13
"""The same for a round core [1]: there, a gap four times smaller takes about three more vertices."""

DEAD = inf
"""Key of a deleted face."""
NEVER = 1e300
"""Key of a face of zero area: it closes the surface but is never the nearest."""
NEXT, LAST = 9, 18
"""Two bits for each k in 0, 1, 2: the next and the previous half-edge of a face."""


@kernel
def deepest_face(piece_a, piece_b, vertices, known, scale, state):
    """Find the nearest face of the difference by expanding a tetrahedron.

    Args:
        known: vertices in `state` to start from: 1, the difference's support point towards B's origin, or 4
            of its points.
        scale: size of the pair [m], for tolerances.
        state: holds the frame. Receives the unit direction of least support value, `deepest`.
    Returns:
        (face, depth, iterations, converged): the face whose normal has the least support value, or -1 if no
        face's has, and that value [m]. A value below -TOUCHING_DISTANCE_SHARE of the scale ends the search.
    """
    w, n, key = state["w"], state["deepest"], state["key"]
    count, height = first_tetrahedron(piece_a, piece_b, vertices, known, scale, state)
    if count < 4:
        flat_normal(w, count, n)
        reach = add_support(piece_a, piece_b, vertices, n[0], n[1], n[2], count, state)
        return -1, reach, 0, abs(reach) <= STAGNATION_GAP * scale
    _close(state, height, scale)
    n[0], n[1], n[2] = inward(state)
    reach = n[0] * w[0, 0] + n[1] * w[0, 1] + n[2] * w[0, 2]
    if known == 4:
        reach = add_support(piece_a, piece_b, vertices, n[0], n[1], n[2], 4, state)
    best, upper = -1, _signed_square(reach)
    is_round = state["corner"][0, 0] < 0 or state["corner"][0, 1] < 0
    tolerance = (ROUND_TOLERANCE if is_round else DEPTH_TOLERANCE) * scale
    apart = _signed_square(-TOUCHING_DISTANCE_SHARE * scale)
    cut = _signed_square(_signed_root(upper) - tolerance)
    faces, waiting, vertex, stalled = 4, 4, 4, False
    while upper >= apart and vertex < EPA_VERTICES and faces < EPA_FACES:
        f, waiting = _nearest_open(state, waiting, cut)
        if waiting < 0:
            break
        x, y, z = state["normal"][f, 0], state["normal"][f, 1], state["normal"][f, 2]
        reach = inline_support(piece_a, piece_b, vertices, x, y, z, vertex, state)
        # every support value bounds the depth from above
        square = x * x + y * y + z * z
        if _signed_square(reach) < upper * square:
            upper, best = _signed_square(reach) / square, f
            n[0], n[1], n[2] = x, y, z
            cut = _signed_square(_signed_root(upper) - tolerance)
        if key[f] >= cut:
            continue
        # the remaining gap is rounding
        if reach <= state["level"][f] or repeats(w, vertex):
            stalled = True
            continue
        # the expansion deletes face f, because the support value lies beyond its plane
        best = -1 if best == f else best
        added = _expand(state, f, vertex, faces, waiting, scale)
        vertex += 1
        if added < 0:
            break
        faces, waiting = faces + added, waiting + added
    depth = _signed_root(upper)
    converged = waiting < 0
    inverse = 1 / sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
    n[0], n[1], n[2] = n[0] * inverse, n[1] * inverse, n[2] * inverse
    if converged and (stalled or best < 0):
        nearest, least = _nearest_face(state, faces)
        converged = depth - least <= STAGNATION_GAP * scale
        # the best direction may be the normal of a face that was never expanded
        if best < 0 and _reaches(state, nearest, depth - tolerance):
            best = nearest
    return best, depth, vertex - 4, converged


@inlined_kernel
def _signed_square(x):
    return x * abs(x)


@inlined_kernel
def _signed_root(x):
    return sqrt(x) if x > 0 else -sqrt(-x)


@inlined_kernel
def _nearest_open(state, waiting, cut):
    """Remove the nearest face, and all faces beyond the cut, from the list of open faces.

    Returns:
        (face, faces left), -1 if there was none.
    """
    key, listed = state["key"], state["open"]
    kept = place = nearest = 0
    least = cut
    # branch-free: later writes replace entries beyond `kept`
    for k in range(waiting):
        f = listed[k]
        offset = key[f]
        listed[kept] = f
        place = kept if offset < least else place
        nearest = f if offset < least else nearest
        least = min(least, offset)
        kept += 1 if offset < cut else 0
    kept -= 1
    if kept >= 0:
        listed[place] = listed[kept]
    return nearest, kept


@kernel
def _nearest_face(state, faces):
    """Nearest face of the polytope: (face, offset [m])."""
    nearest, least = 0, NEVER
    for f in range(faces):
        if state["key"][f] < least:
            nearest, least = f, state["key"][f]
    return nearest, _signed_root(least)


@kernel
def _reaches(state, face, least):
    """Whether all vertices of a face are at least at height `least` [m] along the direction `deepest`."""
    n, w = state["deepest"], state["w"]
    for k in range(3):
        v = w[state["start"][4 * face + k]]
        if n[0] * v[0] + n[1] * v[1] + n[2] * v[2] < least:
            return False
    return True


@kernel
def _expand(state, first, vertex, faces, waiting, scale):
    """Replace the faces visible from `vertex`, found by flood fill from face `first`, by faces that connect
    the horizon to it.

    Returns:
        Number of faces added, or -1 if the horizon is not a simple loop or the face buffer is full.
    """
    w, normal, level, key = state["w"], state["normal"], state["level"], state["key"]
    start, twin, stack, listed = state["start"], state["twin"], state["stack"], state["open"]
    x, y, z = w[vertex, 0], w[vertex, 1], w[vertex, 2]
    # depth-first flood fill: it meets the half-edges of the horizon in order
    key[first] = DEAD
    stack[0], stack[1], stack[2] = twin[4 * first + 2], twin[4 * first + 1], twin[4 * first]
    new, top, begin, end = faces, 3, -1, -1
    while top > 0:
        top -= 1
        h = np.int64(stack[top])
        g, k = h >> 2, 2 * (h & 3)
        if key[g] == DEAD:
            continue
        if normal[g, 0] * x + normal[g, 1] * y + normal[g, 2] * z > level[g]:
            key[g] = DEAD
            stack[top], stack[top + 1] = twin[4 * g + (LAST >> k & 3)], twin[4 * g + (NEXT >> k & 3)]
            top += 2
            continue
        # connect this horizon edge to the vertex; the new face adjoins the previous one
        i, j = np.int64(start[4 * g + (NEXT >> k & 3)]), np.int64(start[h])
        if new == faces:
            begin = i
        elif i != end or new == EPA_FACES:
            return -1
        _set_face(state, new, i, j, vertex, scale)
        twin[4 * new], twin[h] = h, 4 * new
        twin[4 * new + 1], twin[4 * new + 2] = 4 * new + 6, 4 * new - 3
        listed[waiting + new - faces] = new
        new, end = new + 1, j
    twin[4 * new - 3], twin[4 * faces + 2] = 4 * faces + 2, 4 * new - 3
    return new - faces if end == begin else -1


@inlined_kernel
def _set_face(state, f, i, j, k, scale):
    """Write face ijk, counter-clockwise from outside: its normal, level and key."""
    w, n, start = state["w"], state["normal"][f], state["start"]
    start[4 * f], start[4 * f + 1], start[4 * f + 2] = i, j, k
    x, y, z, square, longest = triangle_normal(w, i, j, k)
    n[0], n[1], n[2] = x, y, z
    offset = x * w[i, 0] + y * w[i, 1] + z * w[i, 2]
    if square > (DEGENERATE_HEIGHT * scale) ** 2 * longest:
        state["key"][f] = _signed_square(offset) / square
        state["level"][f] = offset + DEGENERATE_HEIGHT * scale * sqrt(square)
    else:
        state["key"][f], state["level"][f] = NEVER, inf


@kernel
def _close(state, height, scale):
    """Write the faces of the first tetrahedron, oriented by the sign of the fourth vertex's height."""
    twin = state["twin"]
    # the fourth vertex lies behind the face of the first three
    i, j = (0, 1) if height < 0 else (1, 0)
    _set_face(state, 0, i, j, 2, scale)
    _set_face(state, 1, j, i, 3, scale)
    _set_face(state, 2, i, 2, 3, scale)
    _set_face(state, 3, 2, j, 3, scale)
    twin[0], twin[4] = 4, 0
    twin[1], twin[12] = 12, 1
    twin[2], twin[8] = 8, 2
    twin[5], twin[10] = 10, 5
    twin[6], twin[13] = 13, 6
    twin[9], twin[14] = 14, 9
    for f in range(4):
        state["open"][f] = f

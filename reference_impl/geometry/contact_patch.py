"""Patches: contacts of one piece with several pieces of a body in one plane, which share a manifold.

A floor of tiles or triangles then touches what stands on it as a floor of one piece does: in the corners of
the body's own face, not in every point where that face crosses a seam.
"""

from touchstone.reference_impl.core.conventions import (
    BOX,
    CYLINDER,
    HULL,
    MANIFOLD_HEIGHT,
    MERGED_A,
    MERGED_B,
    MERGED_NOT,
    SIMULATED,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import cross, dot, plus, vector_of

COPLANAR_SINE = 1e-7
"""Sine of the angle between the normals of two contacts up to which they lie in one plane [1]."""


@kernel
def has_faces(piece):
    """Whether a piece has flat faces."""
    return piece["kind"] == BOX or piece["kind"] == HULL or piece["kind"] >= CYLINDER


@kernel
def group_patches(bodies, pieces, pairs, count):
    """Set `patch` and `merged` of `pairs[:count]`; returns whether any patch has several pairs."""
    found = False
    for k in range(count):
        pairs[k]["patch"], pairs[k]["merged"] = k, MERGED_NOT
        for j in range(k):
            if pairs[j]["patch"] == j:
                side = _shared_body(bodies, pieces, pairs[j], pairs[k])
                if side != MERGED_NOT:
                    pairs[k]["patch"], pairs[j]["merged"], found = j, side, True
                    break
    return found


@kernel
def _shared_body(bodies, pieces, pair, other):
    """MERGED_* of two pairs whose contacts lie in one plane, on faces of a body that is not simulated."""
    if pair["body_a"] != other["body_a"] or pair["body_b"] != other["body_b"]:
        return MERGED_NOT
    simulated_a = bodies[pair["body_a"]]["kind"] == SIMULATED
    simulated_b = bodies[pair["body_b"]]["kind"] == SIMULATED
    if simulated_a and not simulated_b and pair["piece_a"] == other["piece_a"]:
        side, one, two = MERGED_B, pieces[pair["piece_b"]], pieces[other["piece_b"]]
        p, q = vector_of(pair["point_b"]), vector_of(other["point_b"])
    elif simulated_b and not simulated_a and pair["piece_b"] == other["piece_b"]:
        side, one, two = MERGED_A, pieces[pair["piece_a"]], pieces[other["piece_a"]]
        p, q = vector_of(pair["point_a"]), vector_of(other["point_a"])
    else:
        return MERGED_NOT
    if not (has_faces(one) and has_faces(two)):
        return MERGED_NOT
    n = vector_of(pair["normal"])
    tilt = cross(n, vector_of(other["normal"]))
    height = dot(n, plus(q, -1.0, p))
    if dot(tilt, tilt) > COPLANAR_SINE * COPLANAR_SINE or abs(height) > MANIFOLD_HEIGHT:
        return MERGED_NOT
    for i in range(3):
        if one["surface_velocity"][i] != two["surface_velocity"][i]:
            return MERGED_NOT
        if one["surface_omega"][i] != two["surface_omega"][i]:
            return MERGED_NOT
    return side


@kernel
def take_deepest(pairs, k, count):
    """Exchange the contact of the first row of a patch among `pairs[:count]` with that of its deepest row."""
    deepest = k
    for j in range(k + 1, count):
        if pairs[j]["patch"] == k and pairs[j]["distance"] < pairs[deepest]["distance"]:
            deepest = j
    if deepest == k:
        return
    pair, other = pairs[k], pairs[deepest]
    pair["piece_a"], other["piece_a"] = other["piece_a"], pair["piece_a"]
    pair["piece_b"], other["piece_b"] = other["piece_b"], pair["piece_b"]
    pair["distance"], other["distance"] = other["distance"], pair["distance"]
    for i in range(3):
        pair["normal"][i], other["normal"][i] = other["normal"][i], pair["normal"][i]
        pair["point_a"][i], other["point_a"][i] = other["point_a"][i], pair["point_a"][i]
        pair["point_b"][i], other["point_b"][i] = other["point_b"][i], pair["point_b"][i]


@kernel
def without_merged(pairs, count, rows):
    """Remove those of `pairs[:count]` that are in another row's patch: rows from the end take their places.

    Returns:
        Index after the last of `pairs[:rows]` that remain.
    """
    hole = 0
    while hole < min(count, rows):
        if pairs[hole]["patch"] == hole:
            hole += 1
            continue
        last = rows = rows - 1
        if last < count and pairs[last]["patch"] != last:
            continue
        pairs[hole] = pairs[last]
        pairs[hole]["patch"] = hole
        # the links of the manifold
        head = pairs[hole]["manifold"]
        if head == last:
            k = hole
            while k >= 0:
                pairs[k]["manifold"] = hole
                k = pairs[k]["next_point"]
        elif head >= 0:
            while pairs[head]["next_point"] != last:
                head = pairs[head]["next_point"]
            pairs[head]["next_point"] = hole
        hole += 1
    return rows

"""Contacts at internal edges.

At a seam of two coplanar faces (an internal edge), a sliding body and the next piece touch along two normals
within rounding: that of the face, and that of the piece's side. Taken along the side, the contact would stop
the body: `align_internal_edges` takes the other normal. A ball that rolls over a seam is nearer to the next
piece's edge than to its face, along a normal that leans back: no face of the body allows that normal either.

At the foot of a ramp on a floor, the front of a sliding box and the ramp's edge are apart along the floor.
The normal of the ramp's face separates them as well: it is the one that they have a little later, and the box
climbs.
"""

from math import sqrt

from touchstone.reference_impl.continuous.time_of_impact import gap_along
from touchstone.reference_impl.core.conventions import APPROACH_MIN, MANIFOLD_HEIGHT, OVERLAP_TOLERANCE
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import dot, times, vector_of
from touchstone.reference_impl.geometry.contact_patch import has_faces
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.solver.mobility import surface_velocity

STEEP = 0.999
"""Share of the approach speed below which a pair takes the normal that its pieces have a little later [1]."""


@inlined_kernel
def align_internal_edges(bodies, pieces, vertices, pairs, count, state):
    """Give pairs the normal of another contact of one of their bodies, if that separates them: where they
    approach, or where a deeper contact of the same two bodies is across a seam.

    A pair keeps its normal unless its pieces overlap by at most OVERLAP_TOLERANCE along the other normal and,
    but for seams, approach more slowly along it. Across a seam it keeps its distance too.

    Args:
        pairs: `pairs[:count]` touch or are near, and their pieces are placed.
    """
    for k in range(count):
        speed = witness_approach(bodies, pairs[k], pairs[k]["normal"], state)
        approaches = speed > APPROACH_MIN and state["dense_substep"] == 0
        if not approaches and state["compound"] == 0:
            continue
        for j in range(count):
            seam = pairs[k]["body_a"] == pairs[j]["body_a"] and pairs[k]["body_b"] == pairs[j]["body_b"]
            seam = seam and pairs[j]["distance"] < pairs[k]["distance"]
            if j == k or not (seam or approaches):
                continue
            side = _shared_side(bodies, pairs[k], pairs[j])
            if side != 0:
                n = times(side, vector_of(pairs[j]["normal"]))
                if _align(bodies, pieces, vertices, pairs[k], n, speed, seam, state):
                    approaches = False
                    break
        one, two = pieces[pairs[k]["piece_a"]], pieces[pairs[k]["piece_b"]]
        if approaches and has_faces(one) and has_faces(two):
            n = _later_normal(one, two, vertices, pairs[k], state)
            _align(bodies, pieces, vertices, pairs[k], n, STEEP * speed, False, state)


@kernel
def witness_approach(bodies, pair, n, state):
    """Approach speed of a pair's witness points along n [m/s]."""
    a, b = state["velocity_a"], state["velocity_b"]
    surface_velocity(bodies[pair["body_a"]], pair["point_a"], a)
    surface_velocity(bodies[pair["body_b"]], pair["point_b"], b)
    return n[0] * (a[0] - b[0]) + n[1] * (a[1] - b[1]) + n[2] * (a[2] - b[2])


@kernel
def _shared_side(bodies, pair, other):
    """Sign of the normal of `other` for `pair`: 1 if they share body A or body B, -1 if one changes sides, 0
    if they share no body that moves."""
    a, b = pair["body_a"], pair["body_b"]
    if (a == other["body_a"] and bodies[a]["inverse_mass"] > 0) or (
        b == other["body_b"] and bodies[b]["inverse_mass"] > 0
    ):
        return 1.0
    if (a == other["body_b"] and bodies[a]["inverse_mass"] > 0) or (
        b == other["body_a"] and bodies[b]["inverse_mass"] > 0
    ):
        return -1.0
    return 0.0


@kernel
def _align(bodies, pieces, vertices, pair, n, speed, seam, state):
    """Take the normal n if the pair's pieces are apart along it and, unless a `seam` is between them,
    approach more slowly than at `speed`; returns whether they are."""
    along = witness_approach(bodies, pair, n, state)
    if along >= speed and not seam:
        return False
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    gap = gap_along(one, two, vertices, n[0], n[1], n[2], state)
    if gap < -OVERLAP_TOLERANCE:
        return False
    pair["key"] = along
    if not seam:
        pair["distance"] = gap
    for i in range(3):
        middle = (pair["point_a"][i] + pair["point_b"][i]) / 2
        pair["normal"][i] = n[i]
        pair["point_a"][i] = middle - n[i] * gap / 2
        pair["point_b"][i] = middle + n[i] * gap / 2
    return True


@kernel
def _later_normal(piece_a, piece_b, vertices, pair, state):
    """Normal of a pair of pieces that go on at the surface velocities in `state` by MANIFOLD_HEIGHT."""
    a, b, place = state["velocity_a"], state["velocity_b"], piece_b["world_position"]
    u = (b[0] - a[0], b[1] - a[1], b[2] - a[2])
    x, y, z = times(MANIFOLD_HEIGHT / sqrt(dot(u, u)), u)
    n, p, q = vector_of(pair["normal"]), vector_of(pair["point_a"]), vector_of(pair["point_b"])
    distance, here = pair["distance"], vector_of(place)
    place[0], place[1], place[2] = here[0] + x, here[1] + y, here[2] + z
    convex_depth(piece_a, piece_b, vertices, state, pair)
    place[0], place[1], place[2] = here
    m, pair["distance"] = vector_of(pair["normal"]), distance
    for i in range(3):
        pair["normal"][i], pair["point_a"][i], pair["point_b"][i] = n[i], p[i], q[i]
    return m

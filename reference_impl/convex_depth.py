"""Signed distance of two convex pieces, with its normal and witness points: GJK outside, EPA inside."""

from reference_impl.conventions import APART, NEAR
from reference_impl.kernel import kernel
from reference_impl.polytope import deepest_face
from reference_impl.simplex import nearest_on_simplex


@kernel
def convex_depth(piece_a, piece_b, vertices, state, out_pair):
    """Signed distance [m], normal A to B, and a witness on each piece, written to `out_pair` (PAIR).

    The distance is exact to rounding: outside it is that of the cores less their radii, in overlap minus
    the length of the shortest translation that parts the pieces (van den Bergen 2001).

    Returns:
        (iterations, converged)
    """
    count, distance, x, y, z, iterations, converged = nearest_on_simplex(piece_a, piece_b, vertices, state)
    scale = _size(piece_a) + _size(piece_b)
    normal = out_pair["normal"]
    if distance > NEAR * scale:
        normal[0], normal[1], normal[2] = -x / distance, -y / distance, -z / distance
        _witnesses(state, count, out_pair)
    else:
        has_volume, depth, expansions, converged = deepest_face(
            piece_a, piece_b, vertices, count, scale, state, normal
        )
        iterations += expansions
        if not has_volume:
            # the pieces are flat or points: any normal parts them
            _witnesses(state, 1, out_pair)
        else:
            _witnesses_in_overlap(piece_a, piece_b, vertices, depth + APART * scale, state, out_pair)
            # GJK may end a rounding away from an origin that lies inside
            if distance == 0.0 or depth > 0.0:
                distance = -depth
    # from the cores to the surfaces
    distance -= piece_a["radius"] + piece_b["radius"]
    for i in range(3):
        out_pair["point_a"][i] += piece_a["radius"] * normal[i] + piece_b["world_position"][i]
        out_pair["point_b"][i] += -piece_b["radius"] * normal[i] + piece_b["world_position"][i]
    out_pair["distance"] = distance
    return iterations, converged


@kernel
def _size(piece):
    size = 0.0
    for i in range(3):
        size = max(size, piece["high"][i] - piece["low"][i])
    return size


@kernel
def _witnesses(state, count, out_pair):
    """Points of A and B from the barycentric weights of GJK's simplex, relative to B's origin."""
    w, a, weights = state["w"], state["a"], state["offset"]
    for i in range(3):
        on_a = on_difference = 0.0
        for k in range(count):
            on_a += weights[k] * a[k, i]
            on_difference += weights[k] * w[k, i]
        out_pair["point_a"][i] = on_a
        out_pair["point_b"][i] = on_a - on_difference


@kernel
def _witnesses_in_overlap(piece_a, piece_b, vertices, shift, state, out_pair):
    """Witnesses on the deepest face: B is parted from A along the normal, where the nearest points of both
    are the witnesses. (The face's own triangle need not hold the origin's projection: faces of a Minkowski
    difference are polygons.)"""
    normal, position = out_pair["normal"], piece_b["world_position"]
    x, y, z = position[0], position[1], position[2]
    for i in range(3):
        position[i] += shift * normal[i]
    count, _, _, _, _, _, _ = nearest_on_simplex(piece_a, piece_b, vertices, state)
    _witnesses(state, count, out_pair)
    for i in range(3):
        out_pair["point_a"][i] += shift * normal[i]
    position[0], position[1], position[2] = x, y, z

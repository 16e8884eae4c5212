"""Exit of a round surface over the outline of the face on which it rests.

Within a substep, the law of contact takes the face as a plane without end, so a ball that rolls or slides off
a table would be held until the substep ends. It ends where the ball has passed the outline: there it rests on
the edge, from which it flies off or about which it rolls.
"""

from touchstone.reference_impl.contact.end_correction import mean_velocity
from touchstone.reference_impl.continuous.contact_kinematics import is_round
from touchstone.reference_impl.core.conventions import BOX, HALF_SPACE, MANIFOLD_HEIGHT, NEVER, NO_FLOOR
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import column, cross, dot, plus, times, vector_of
from touchstone.reference_impl.geometry.depth_warm_start import pair_depth
from touchstone.reference_impl.geometry.shapes import place_piece

EXIT_STEPS = 32
"""Bisections for the time at which a round surface passes the outline of a face."""
EXIT_LEAST = 1e-4
"""Share of a substep within which it does not end: there the surface has all but passed the outline [1]."""
EXIT_TILT = 4.0
"""Height of the face over its edge at which a round surface has passed it, over MANIFOLD_HEIGHT [1]: a
manifold then shows the edge alone."""


@kernel
def first_exit(world, count, h):
    """Fraction of a substep of length h [s] at which the first round surface passes the outline of the face
    on which it rests, so far that it rests on its edge; NEVER if none does."""
    first = NEVER
    if count < len(world.pairs):
        for k in range(count):
            pair = world.pairs[k]
            first_row = pair["manifold"] < 0 or pair["manifold"] == k
            if first_row and pair["crowded"] == 0 and pair["floor"] != NO_FLOOR:
                first = min(first, _exit(world, pair, world.pairs[count], h))
    return first


@kernel
def _exit(world, pair, found, h):
    """`first_exit` of one pair; `found` is scratch."""
    bodies, pieces, on_a = world.bodies, world.pieces, pair["flat_a"] == 2
    face, piece = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    if not on_a:
        face, piece = piece, face
    n, support, body = vector_of(pair["start_normal"]), bodies[face["body"]], bodies[piece["body"]]
    if not (on_a or pair["flat_b"] == 2) or not is_round(piece) or dot(n, pair["resting_impulse"]) <= 0:
        return NEVER
    # a neighbour may take over from a piece of several
    if face["kind"] == HALF_SPACE or support["piece_count"] > 1:
        return NEVER
    # the correction of its end left it there
    place_piece(piece, body, world.vertices, 0.0)
    place, point = piece["world_position"], pair["point"]
    way = plus(mean_velocity(body, place), -1.0, mean_velocity(support, point))
    way = times(h, plus(way, -dot(n, way), n))
    x, y, z = vector_of(place)
    if face["kind"] == BOX and _stays_on(face, plus(vector_of(point), 1.0, way)):
        return NEVER
    found["piece_a"], found["piece_b"] = pair["piece_a"], pair["piece_b"]
    early, late, share = -1.0, NEVER, 0.0
    for _ in range(EXIT_STEPS):
        place[0], place[1], place[2] = x + share * way[0], y + share * way[1], z + share * way[2]
        pair_depth(pieces, world.vertices, world.state, found)
        tilt = cross(n, vector_of(found["normal"]))
        if dot(tilt, tilt) > (EXIT_TILT * MANIFOLD_HEIGHT / face["width"]) ** 2:
            late = share
        else:
            early = share
        # it is on the face at the start, and past it at the end
        if early < 0 or early == 1:
            break
        share = (early + late) / 2 if late < NEVER else 1.0
    place[0], place[1], place[2] = x, y, z
    return late if late > EXIT_LEAST else NEVER


@kernel
def _stays_on(box, point):
    """Whether a point on the face of a box is within its outline; along the normal, a rounded box is larger
    than its core."""
    m, arm = box["world_rotation"], plus(point, -1.0, vector_of(box["world_position"]))
    outside = -1 if box["radius"] > 0 else 0
    for i in range(3):
        outside += 1 if abs(column(m, i, arm)) > box["size"][i] + MANIFOLD_HEIGHT else 0
    return outside <= 0

"""Collision detection of one instant: boxes, pairs, depths."""

from reference_impl.broad_phase import find_pairs
from reference_impl.conventions import (
    COUNT_CONTACTS,
    COUNT_LOST,
    COUNT_PAIRS,
    COUNT_UNCONVERGED,
    MARK_TABLE,
    OVERLAP_TOLERANCE,
    STAGE_COLLISION,
    TOUCH_DISTANCE,
)
from reference_impl.kernel import clock, kernel
from reference_impl.motion import swept_box
from reference_impl.shapes import place_piece
from reference_impl.walk import pair_depth


@kernel
def place_pieces(bodies, pieces, vertices, kind):
    """World poses and boxes of the pieces of all bodies of `kind`; boxes hold TOUCH_DISTANCE to spare."""
    for k in range(len(pieces)):
        body = bodies[pieces[k]["body"]]
        if body["kind"] == kind:
            place_piece(pieces[k], body, vertices, TOUCH_DISTANCE)


@kernel
def detect(bodies, pieces, vertices, pairs, state, kind, first):
    """Pairs that touch or overlap and in which a body of `kind` takes part, from `pairs[first]` on.

    Places the pieces of `kind` first.

    Returns:
        (end, deepest): index after the last of them, and the largest depth [m].
    """
    since = clock(state["clock"])
    place_pieces(bodies, pieces, vertices, kind)
    found, lost = find_pairs(pieces, kind, first, pairs, state)
    state["counters"][COUNT_LOST] += lost
    state["counters"][COUNT_PAIRS] += found - first
    end, deepest = first, 0.0
    for k in range(first, found):
        pair = pairs[k]
        if not pair_depth(pieces, vertices, state, pair):
            state["counters"][COUNT_UNCONVERGED] += 1
        if pair["distance"] > TOUCH_DISTANCE:
            continue
        set_coefficients(bodies, pair, state)
        deepest = max(deepest, -pair["distance"])
        # touching pairs move to the front; what lies between is forgotten
        if k != end:
            pairs[end] = pair
        end += 1
    state["counters"][COUNT_CONTACTS] += end - first
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return end, deepest


@kernel
def set_coefficients(bodies, pair, state):
    """Restitution and friction of a pair's materials."""
    a, b = bodies[pair["body_a"]]["material"], bodies[pair["body_b"]]["material"]
    pair["restitution"] = state["restitution"][a, b]
    pair["friction"] = state["friction_coefficient"][a, b]


@kernel
def find_swept_pairs(bodies, pieces, vertices, pairs, state, kind, first):
    """Pairs whose boxes meet somewhere on the ways of bodies of `kind`, from `pairs[first]` on.

    Leaves the pieces of `kind` at the start, in their swept boxes; returns the index after the last pair.
    """
    for k in range(len(pieces)):
        body = bodies[pieces[k]["body"]]
        if body["kind"] == kind:
            swept_box(pieces[k], body, vertices, TOUCH_DISTANCE)
    end, lost = find_pairs(pieces, kind, first, pairs, state)
    state["counters"][COUNT_LOST] += lost
    state["counters"][COUNT_PAIRS] += end - first
    return end


@kernel
def mark_pairs(pairs, count, state):
    """Mark `pairs[:count]`, and no others, for `is_marked`."""
    state["mark"] += 1
    for k in range(count):
        place = _place_of(state, pairs[k])
        state["marked"][place, 0], state["marked"][place, 1] = pairs[k]["piece_a"], pairs[k]["piece_b"]
        state["marked"][place, 2] = state["mark"]


@kernel
def is_marked(state, pair):
    """Whether `mark_pairs` was last given a pair of the same two pieces."""
    return state["marked"][_place_of(state, pair), 2] == state["mark"]


@kernel
def _place_of(state, pair):
    """Place of a pair in the table, or the free one where it belongs (Knuth 1973: linear probing)."""
    a, b, table = pair["piece_a"], pair["piece_b"], state["marked"]
    place = (a * 7919 + b) % MARK_TABLE
    while table[place, 2] == state["mark"] and (table[place, 0] != a or table[place, 1] != b):
        place = (place + 1) % MARK_TABLE
    return place


@kernel
def is_free(deepest):
    """Whether the largest depth counts as no overlap."""
    return deepest <= OVERLAP_TOLERANCE

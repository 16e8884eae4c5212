"""Collision detection at one instant: bounding boxes, broad-phase pairs and penetration depths."""

from touchstone.reference_impl.broad_phase.fat_bounds import drop_fat_bounds, inside_fat_bounds
from touchstone.reference_impl.broad_phase.sweep_and_prune import find_pairs
from touchstone.reference_impl.core.conventions import (
    DRIVEN,
    GRIP_NONE,
    MERGED_A,
    MERGED_B,
    MERGED_NOT,
    NEWLY_PRESSED,
    OVERLAP_TOLERANCE,
    PRESSED,
    SIMULATED,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.counters import (
    COUNT_CONTACTING,
    COUNT_CONTACTS,
    COUNT_LOST,
    COUNT_PAIRS,
    COUNT_UNCONVERGED,
    STAGE_COLLISION,
)
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.geometry.depth_warm_start import pair_depth
from touchstone.reference_impl.geometry.shapes import place_piece
from touchstone.reference_impl.kinematics.skeleton import are_adjacent


@kernel
def place_pieces(bodies, pieces, vertices, kind):
    """World poses and AABBs of all pieces of bodies of `kind`; boxes are enlarged by TOUCH_DISTANCE."""
    for k in range(len(pieces)):
        body = bodies[pieces[k]["body"]]
        if body["kind"] == kind:
            place_piece(pieces[k], body, vertices, TOUCH_DISTANCE)


@kernel
def place_listed(bodies, pieces, vertices, kind, state):
    """`place_pieces` for the listed pieces of one group; it does not iterate over the fixed pieces."""
    group = state["groups"][kind]
    for k in range(group["first"], group["end"]):
        piece = pieces[pieces[k]["order"]]
        place_piece(piece, bodies[piece["body"]], vertices, TOUCH_DISTANCE)


@kernel
def detect(world, kind, first):
    """Find the pairs that touch or overlap and contain a body of `kind`, and write them from `pairs[first]`;
    those of a driver with a simulated body only where `kind` is SIMULATED.

    Updates the poses and boxes of the pieces of `kind` first, and of drivers that move in the simulated loop.

    Returns:
        (end, deepest): index after the last pair, and the largest depth [m].
    """
    bodies, pieces, vertices = world.bodies, world.pieces, world.vertices
    pairs, state = world.pairs, world.state
    since = clock(state["clock"])
    place_listed(bodies, pieces, vertices, kind, state)
    if kind == SIMULATED and state["driven_loop"] == 1:
        place_listed(bodies, pieces, vertices, DRIVEN, state)
    if state["has_fat_bounds"] == 1 and not inside_fat_bounds(bodies, pieces, state):
        drop_fat_bounds(bodies, pieces, state)
        place_listed(bodies, pieces, vertices, DRIVEN, state)
    found, lost = find_pairs(pieces, kind, first, pairs, state)
    state["counters"][COUNT_LOST] += lost
    state["counters"][COUNT_PAIRS] += found - first
    if kind == SIMULATED:
        found = find_stops(world, without_joined(world, first, found), PRESSED)
    elif kind == DRIVEN:
        found = _without_simulated(bodies, pairs, first, found)
    end, deepest = _measure(world, first, found)
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return end, deepest


@kernel
def without_joined(world, first, found):
    """Remove the pairs of `pairs[first:found]` whose bodies a joint connects; returns the index after the
    last."""
    bodies, pairs, end = world.bodies, world.pairs, first
    if world.state["mechanisms"] == 0:
        return found
    for k in range(first, found):
        a, b, joined = pairs[k]["body_a"], pairs[k]["body_b"], False
        for i in range(3):
            joined = joined or bodies[a]["beside"][i] == b or bodies[b]["beside"][i] == a
        if not joined:
            if k != end:
                pairs[end] = pairs[k]
            end += 1
    return end


@kernel
def _without_simulated(bodies, pairs, first, found):
    """Remove the pairs of `pairs[first:found]` with a simulated body, which meets a driver in the simulated
    loop. Returns the index after the last pair."""
    end = first
    for k in range(first, found):
        a, b = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]]
        if a["kind"] != SIMULATED and b["kind"] != SIMULATED:
            if k != end:
                pairs[end] = pairs[k]
            end += 1
    return end


@kernel
def _measure(world, first, found):
    """Compute the depths of `pairs[first:found]`, and move those that touch to the front; as `detect`."""
    bodies, pieces, vertices = world.bodies, world.pieces, world.vertices
    pairs, state = world.pairs, world.state
    end, deepest = first, 0.0
    for k in range(first, found):
        pair = pairs[k]
        if state["self_collision"] == 1 and are_adjacent(bodies, pair["body_a"], pair["body_b"]):
            continue
        if not pair_depth(pieces, vertices, state, pair):
            state["counters"][COUNT_UNCONVERGED] += 1
        if pair["distance"] > TOUCH_DISTANCE:
            continue
        set_coefficients(bodies, pair, state)
        pair["depth"] = -pair["distance"]
        pair["merged"] = MERGED_NOT
        deepest = max(deepest, pair["depth"])
        # compact: touching pairs move to the front and overwrite the others
        if k != end:
            pairs[end] = pair
        end += 1
    state["counters"][COUNT_CONTACTS] += end - first
    return end, deepest


@kernel
def detect_new_stops(world, first):
    """`detect` for the pairs of newly pressed drivers, whose pieces are placed; they count as pressed then,
    and so do drivers that these touch.

    Returns:
        Index after the last pair.
    """
    bodies, drivers, pairs = world.bodies, world.drivers, world.pairs
    for _ in range(len(drivers)):
        end, _ = _measure(world, first, find_stops(world, first, NEWLY_PRESSED))
        for d in range(len(drivers)):
            if drivers[d]["pressed"] == NEWLY_PRESSED:
                drivers[d]["pressed"] = PRESSED
        mark_pressed(bodies, drivers, pairs, first, end)
        if end == first:
            break
        first = end
    return first


@kernel
def mark_pressed(bodies, drivers, pairs, first, end):
    """Mark the drivers in the loop that `pairs[first:end]` touch for the first time in the frame as
    NEWLY_PRESSED."""
    for k in range(first, end):
        for side in range(2):
            d = bodies[pairs[k]["body_a"] if side == 0 else pairs[k]["body_b"]]["driver"]
            if (
                d >= 0
                and drivers[d]["loops"] == 1
                and drivers[d]["prescribed"] + drivers[d]["mechanism"] == 0
            ):
                if drivers[d]["pressed"] == 0:
                    drivers[d]["pressed"] = NEWLY_PRESSED


@kernel
def find_stops(world, first, kind):
    """Find the pairs of pressed drivers with fixed and driven bodies, own links too, whose boxes overlap,
    and write them from `pairs[first]`: forces in the simulated loop may not push a driver into these.

    Args:
        kind: PRESSED, or NEWLY_PRESSED for the pairs in which no driver was pressed before.
    Returns:
        Index after the last pair.
    """
    bodies, drivers, pairs, state = world.bodies, world.drivers, world.pairs, world.state
    pressed = False
    for d in range(len(drivers)):
        pressed = pressed or drivers[d]["pressed"] == kind
    if not pressed:
        return first
    found, lost = find_pairs(world.pieces, DRIVEN, first, pairs, state)
    state["counters"][COUNT_LOST] += lost
    end = first
    for k in range(first, found):
        a, b = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]]
        if a["kind"] == SIMULATED or b["kind"] == SIMULATED:
            continue
        if state["self_collision"] == 1 and are_adjacent(bodies, pairs[k]["body_a"], pairs[k]["body_b"]):
            continue
        one, two = _pressed(drivers, a), _pressed(drivers, b)
        if (one == kind or two == kind) and (kind == PRESSED or (one != PRESSED and two != PRESSED)):
            if k != end:
                pairs[end] = pairs[k]
            end += 1
    return end


@kernel
def _pressed(drivers, body):
    return drivers[body["driver"]]["pressed"] if body["driver"] >= 0 else 0


@kernel
def detect_for(world, d, later):
    """Detect pairs of driven bodies with fixed and driven ones; driver d resolves a share `later` of its
    overlap with later drivers. Simulated bodies meet it in the simulated loop.

    Returns:
        Index after the last pair.
    """
    bodies, pairs, state = world.bodies, world.pairs, world.state
    end, _ = detect(world, DRIVEN, 0)
    state["counters"][COUNT_CONTACTING] = max(state["counters"][COUNT_CONTACTING], end)
    for k in range(end):
        one, two = bodies[pairs[k]["body_a"]]["driver"], bodies[pairs[k]["body_b"]]["driver"]
        if min(one, two) == d and max(one, two) > d and world.drivers[max(one, two)]["prescribed"] == 0:
            pairs[k]["depth"] *= later
    return end


@kernel
def set_coefficients(bodies, pair, state):
    """Set a pair's coefficients of restitution and friction from its two materials; 0 if neither body is
    simulated: as in the paper, geometry alone moves driven bodies along others."""
    if state["statics"] == 1:
        pair["static"], pair["grip"], pair["stuck"] = 0.0, GRIP_NONE, 0
    if state["moments"] == 1:
        pair["rolling"] = pair["torsion"] = 0.0
        pair["moment"][:] = 0.0
    if bodies[pair["body_a"]]["kind"] != SIMULATED and bodies[pair["body_b"]]["kind"] != SIMULATED:
        pair["restitution"] = pair["friction"] = 0.0
        return
    a, b = bodies[pair["body_a"]]["material"], bodies[pair["body_b"]]["material"]
    pair["restitution"] = state["restitution"][a, b]
    pair["friction"] = state["friction_coefficient"][a, b]
    if state["statics"] == 1:
        pair["static"], pair["sliding_friction"] = state["static_friction"][a, b], pair["friction"]
    if state["moments"] == 1:
        pair["rolling"], pair["torsion"] = state["rolling"][a, b], state["torsion"][a, b]


@kernel
def mark_pairs(bodies, pieces, pairs, count):
    """Mark exactly `pairs[:count]` for `is_marked`; one piece of each pair holds a linked list of pairs."""
    for k in range(len(pieces)):
        pieces[k]["marked"] = -1
    for k in range(count):
        piece = pieces[_listing_piece(bodies, pairs[k])]
        pairs[k]["next_marked"] = piece["marked"]
        piece["marked"] = k


@kernel
def is_marked(bodies, pieces, pairs, pair):
    """Whether the last call of `mark_pairs` marked a pair of the same two pieces, or of one of them and the
    other's body, whose pieces share a manifold."""
    k = pieces[_listing_piece(bodies, pair)]["marked"]
    while k >= 0:
        row = pairs[k]
        same_a = row["piece_a"] == pair["piece_a"]
        same_a = same_a or (row["merged"] == MERGED_A and row["body_a"] == pair["body_a"])
        same_b = row["piece_b"] == pair["piece_b"]
        same_b = same_b or (row["merged"] == MERGED_B and row["body_b"] == pair["body_b"])
        if same_a and same_b:
            return True
        k = row["next_marked"]
    return False


@kernel
def _listing_piece(bodies, pair):
    """The piece whose list holds the pair: piece B if its body is simulated, else piece A.

    Few pairs share a simulated piece, while all pairs may share a floor.
    """
    return pair["piece_b"] if bodies[pair["body_b"]]["kind"] == SIMULATED else pair["piece_a"]


@kernel
def is_free(deepest):
    """Whether the largest depth is within OVERLAP_TOLERANCE."""
    return deepest <= OVERLAP_TOLERANCE

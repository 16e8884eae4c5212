"""Contacts of a crowded substep: pairs that may meet within it count as contacts ahead of their time.

A heap of bodies has more impacts a frame than can be resolved one moment after the other. Where a frame has
used up its `event_rows`, or DENSE_EVENTS, what is left of it goes in a few substeps. A near pair then is a
row like any other, but may still close its gap within the substep: `close` is the speed that takes. Impacts
come a little early, at a gap that they would have closed within the substep. None is missed: what meets
unforeseen is an event as ever. And nothing overlaps for it: the distance of convex pieces is no less than
their gap along a normal (speculative contacts: Anitescu & Potra 1997; Catto 2013).
"""

from math import ceil, sqrt

from touchstone.reference_impl.broad_phase.detection import detect, find_swept_pairs, set_coefficients
from touchstone.reference_impl.continuous.swept_motion import lever_of
from touchstone.reference_impl.continuous.time_of_impact import gap_along, place_pair, time_of_impact
from touchstone.reference_impl.core.conventions import (
    APPROACH_MIN,
    COUNT_DENSE,
    COUNT_EVENTS,
    COUNT_UNCONVERGED,
    DENSE_EVENTS,
    DENSE_PARTS,
    DENSE_SINKING,
    DENSE_SPEED,
    DENSE_SUBSTEPS,
    IMPACT_SHARE,
    IMPACT_SLACK,
    IMPACT_TARGET,
    SIMULATED,
    SPECULATIVE_SLACK,
    STAGE_COLLISION,
    TOUCH_CLOSED,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector
from touchstone.reference_impl.geometry.contact_manifold import expand_manifolds, is_polyhedral
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.simulated.contact import surface_velocity
from touchstone.reference_impl.simulated.impact import rest_speed


@kernel
def gather_contacts(bodies, pieces, vertices, pairs, state, left):
    """Contacts of the next substep, and its length: near pairs too where the frame is crowded.

    Args:
        left: what is left of the frame [s].
    Returns:
        (end, h): `pairs[:end]` are the contacts, a row for every point of a patch, with the speeds at which
        they may `close`; length of the substep [s].
    """
    # as many rows are expected as there were last, where those were crowded for another substep too; and
    # events run out, too, before the frame's time does
    expected = (1 + state["dense_substep"]) * state["last_rows"]
    crowded = state["rows"] + expected > state["event_rows"]
    crowded = crowded or state["counters"][COUNT_EVENTS] >= DENSE_EVENTS
    end, h = 0, left
    if not crowded:
        end, _ = detect(bodies, pieces, vertices, pairs, state, SIMULATED, 0)
        crowded = state["rows"] + end > state["event_rows"]
    state["dense_substep"] = 1 if crowded else 0
    if crowded:
        end, h = _gather_speculative(bodies, pieces, vertices, pairs, state, left)
        state["counters"][COUNT_DENSE] += 1
    else:
        end = _drop_impacts_ahead(bodies, pairs, end, state, rest_speed(state))
    end = expand_manifolds(pieces, vertices, pairs, end, state)
    for k in range(end):
        gap = pairs[k]["distance"]
        pairs[k]["speculative_speed"] = 0.0
        # what passes by as it goes now may go on so
        if gap > TOUCH_DISTANCE:
            pairs[k]["speculative_speed"] = max((gap - TOUCH_CLOSED) / h, pairs[k]["key"])
    state["rows"] += end
    state["last_rows"] = end
    return end, h


@kernel
def _drop_impacts_ahead(bodies, pairs, count, state, v_rest):
    """Leave out touching pairs that will bounce, and are not yet as near as impacts are found: they are free
    until then. Returns the count of the others, brought to the front."""
    kept, ahead = 0, state["impact_gap"] * (1 + 2 * IMPACT_SHARE)
    for k in range(count):
        if pairs[k]["distance"] > ahead and _approach(bodies, pairs[k], state) > max(v_rest, APPROACH_MIN):
            continue
        if k != kept:
            pairs[kept] = pairs[k]
        kept += 1
    return kept


@kernel
def _gather_speculative(bodies, pieces, vertices, pairs, state, left):
    """Pairs that touch or may meet within a substep, at the front of `pairs`; returns (end, h)."""
    since = clock(state["clock"])
    g, v_rest = state["gravity"], rest_speed(state)
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            _coast(bodies[b], g, left)
    found = find_swept_pairs(bodies, pieces, vertices, pairs, state, SIMULATED, 0)
    # substeps so short that no impact with restitution comes much too early
    fastest, reach, bend, shifting = v_rest, v_rest * state["dt"], 0.0, False
    for k in range(found):
        pair = pairs[k]
        _measure(bodies, pieces, vertices, pair, state)
        if pair["distance"] < pair["key"] * left:
            fastest = max(fastest, pair["key"])
        if pair["distance"] < max(TOUCH_DISTANCE, pair["key"] * left):
            a, b = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
            bend = max(bend, _centripetal(bodies[pair["body_a"]], pieces[pair["piece_a"]], vertices))
            bend = max(bend, _centripetal(bodies[pair["body_b"]], pieces[pair["piece_b"]], vertices))
            shifting = shifting or (is_polyhedral(a, b) and _meeting_speed(state) > DENSE_SPEED)
    parts = DENSE_SUBSTEPS if fastest > 0 else 1
    if reach > 0 and fastest * left <= DENSE_SUBSTEPS * reach:
        parts = ceil(fastest * left / reach)
    # and so short that points stay where their contacts hold them: of what turns, and of faces that slide
    most = DENSE_PARTS * left / state["dt"]
    parts = max(parts, ceil(most / 2 if shifting else 0.0))
    parts = max(parts, ceil(min(left * sqrt(bend / (2 * DENSE_SINKING)), most)))
    h, end = left / parts, 0
    for k in range(found):
        pair = pairs[k]
        # what will meet by all that is known, and what is so near that it may come to be pushed there
        gap = pair["distance"]
        if TOUCH_DISTANCE < gap < pair["key"] * h and _meets(
            bodies, pieces, vertices, pair, state, 1 / parts
        ):
            pair["key"] = 0.0
        elif gap > max(TOUCH_DISTANCE, SPECULATIVE_SLACK * v_rest * h):
            continue
        set_coefficients(bodies, pair, state)
        if k != end:
            pairs[end] = pair
        end += 1
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return end, h


@kernel
def _meeting_speed(state):
    """Speed of B's witness against A's, of the pair measured last [m/s]."""
    a, b = state["velocity_a"], state["velocity_b"]
    return sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@kernel
def _centripetal(body, piece, vertices):
    """Largest acceleration of a piece's core about its body's axis of rotation [m/s^2]."""
    _, lever = lever_of(body, piece, vertices)
    w = body["omega"]
    return lever * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) if body["kind"] == SIMULATED else 0.0


@kernel
def _meets(bodies, pieces, vertices, pair, state, until):
    """Whether a pair meets on its way up to a fraction. It then has the normal found there, its present gap
    along that, and the witnesses found there, moved back with what moves."""
    fraction, _, _ = time_of_impact(
        bodies, pieces, vertices, pair, state, 0.0, until, IMPACT_TARGET, IMPACT_SLACK
    )
    a, b, n = bodies[pair["body_a"]], bodies[pair["body_b"]], pair["normal"]
    place_pair(bodies, pieces, vertices, pair, 0.0)
    if fraction == until:
        _measure(bodies, pieces, vertices, pair, state)
        return False
    s, moving = fraction, a["moves"] + b["moves"]
    for i in range(3):
        way = a["moves"] * (a["travel"][i] + s * a["travel_bend"][i])
        way += b["moves"] * (b["travel"][i] + s * b["travel_bend"][i])
        pair["point_a"][i] -= s * way / moving
        pair["point_b"][i] -= s * way / moving
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    pair["distance"] = gap_along(one, two, vertices, n[0], n[1], n[2], state)
    return True


@kernel
def _coast(body, gravity, h):
    """The way a body would go without contacts."""
    copy_vector(body["center"], body["old_center"])
    copy_quaternion(body["orientation"], body["old_orientation"])
    body["moves"], body["spin_steps"] = 1, 0
    for i in range(3):
        body["travel"][i], body["travel_bend"][i] = h * body["velocity"][i], h * h * gravity[i] / 2
        body["turn"][i], body["turn_bend"][i] = h * body["omega"][i], 0.0


@kernel
def _measure(bodies, pieces, vertices, pair, state):
    """Distance of a pair where it is, and its approach speed, to `key` [m/s]."""
    _, converged = convex_depth(pieces[pair["piece_a"]], pieces[pair["piece_b"]], vertices, state, pair)
    if not converged:
        state["counters"][COUNT_UNCONVERGED] += 1
    pair["key"] = _approach(bodies, pair, state)


@kernel
def _approach(bodies, pair, state):
    """Approach speed of a pair's witnesses [m/s]."""
    n, a, b = pair["normal"], state["velocity_a"], state["velocity_b"]
    surface_velocity(bodies[pair["body_a"]], pair["point_a"], a)
    surface_velocity(bodies[pair["body_b"]], pair["point_b"], b)
    return n[0] * (a[0] - b[0]) + n[1] * (a[1] - b[1]) + n[2] * (a[2] - b[2])

"""Contacts of a crowded substep: pairs that may meet within it count as contacts ahead of their time.

A heap of bodies has more impacts a frame than can be resolved one moment after the other. Where a frame has
used up its `event_rows`, what is left of it goes in a few substeps. A near pair then is a row like any other,
but may still close its gap within the substep: `close` is the speed that takes. Impacts of such rows come a
little early, at a gap below CROWD_REACH; none is missed, and nothing overlaps for it: the distance of convex
pieces is no less than their gap along a normal (speculative contacts: Catto 2013; Anitescu & Potra 1997).
"""

from math import ceil, sqrt

from reference_impl.contact import surface_velocity
from reference_impl.contact_patch import expand_patches
from reference_impl.conventions import (
    COUNT_CROWDED,
    COUNT_UNCONVERGED,
    CROWD_SLACK,
    CROWD_SUBSTEPS,
    SIMULATED,
    STAGE_COLLISION,
    TOUCH_CLOSED,
    TOUCH_DISTANCE,
)
from reference_impl.convex_depth import convex_depth
from reference_impl.detection import detect, find_swept_pairs, set_coefficients
from reference_impl.kernel import clock, kernel
from reference_impl.rotation import copy_quaternion, copy_vector


@kernel
def gather_contacts(bodies, pieces, vertices, pairs, state, rows, left):
    """Contacts of the next substep, and its length.

    Args:
        rows: contacts of the frame's substeps so far; beyond `event_rows` near pairs are gathered too.
        left: what is left of the frame [s].
    Returns:
        (end, h): `pairs[:end]` are the contacts, a row for every point of a patch, with the speeds at which
        they may `close`; length of the substep [s].
    """
    end, _ = detect(bodies, pieces, vertices, pairs, state, SIMULATED, 0)
    h = left
    if rows + end > state["event_rows"]:
        end, h = _gather_near(bodies, pieces, vertices, pairs, state, left)
        state["counters"][COUNT_CROWDED] += 1
    end = expand_patches(pieces, vertices, pairs, end, state)
    for k in range(end):
        gap = pairs[k]["distance"]
        pairs[k]["close"] = (gap - TOUCH_CLOSED) / h if gap > TOUCH_DISTANCE else 0.0
    return end, h


@kernel
def _gather_near(bodies, pieces, vertices, pairs, state, left):
    """Pairs that touch or may meet within a substep, at the front of `pairs`; returns (end, h)."""
    since = clock(state["clock"])
    g = state["gravity"]
    v_rest = 2 * state["dt"] * sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            _coast(bodies[b], g, left)
    found = find_swept_pairs(bodies, pieces, vertices, pairs, state, SIMULATED, 0)
    # substeps so short that no impact with restitution comes much too early
    fastest = v_rest
    for k in range(found):
        _measure(bodies, pieces, vertices, pairs[k], state)
        if pairs[k]["distance"] < pairs[k]["key"] * left:
            fastest = max(fastest, pairs[k]["key"])
    parts = CROWD_SUBSTEPS
    if fastest * left <= CROWD_SUBSTEPS * v_rest * state["dt"]:
        parts = max(1, ceil(fastest * left / (v_rest * state["dt"])))
    h = left / parts if v_rest > 0 else left
    end = 0
    for k in range(found):
        pair = pairs[k]
        reach = h * (max(0.0, pair["key"]) + CROWD_SLACK * v_rest)
        if pair["distance"] > max(reach, TOUCH_DISTANCE):
            continue
        set_coefficients(bodies, pair, state)
        if k != end:
            pairs[end] = pair
        end += 1
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return end, h


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
    n, a, b = pair["normal"], state["velocity_a"], state["velocity_b"]
    surface_velocity(bodies[pair["body_a"]], pair["point_a"], a)
    surface_velocity(bodies[pair["body_b"]], pair["point_b"], b)
    pair["key"] = n[0] * (a[0] - b[0]) + n[1] * (a[1] - b[1]) + n[2] * (a[2] - b[2])

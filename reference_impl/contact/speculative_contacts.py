"""Speculative contacts of a dense substep: pairs that may touch within the substep become contacts early.

A pile of bodies can have more impacts per frame than the loop can resolve one event at a time. Once a frame
has used up its `event_rows`, its `frame_work`, or DENSE_EVENTS, a few dense substeps cover the rest of the
frame. A near pair then gets a row, but may still close its gap within the substep: `speculative_speed` is the
speed that this takes. An impact happens slightly early, at a gap that the bodies would have closed within the
substep. No impact is missed: a pair that meets unexpectedly causes an event as usual. Speculative contacts
cause no overlap: the distance of convex pieces is at least their gap along any normal (Anitescu & Potra 1997;
Catto 2013).
"""

from math import ceil, sqrt

from touchstone.reference_impl.broad_phase.detection import (
    detect,
    detect_new_stops,
    mark_pressed,
    set_coefficients,
)
from touchstone.reference_impl.contact.impact import rest_speed
from touchstone.reference_impl.contact.internal_edges import align_internal_edges, witness_approach
from touchstone.reference_impl.continuous.swept_motion import lever_of
from touchstone.reference_impl.continuous.swept_pairs import find_swept_pairs
from touchstone.reference_impl.continuous.time_of_impact import (
    MovingPair,
    gap_along,
    place_pair,
    time_of_impact,
)
from touchstone.reference_impl.core.conventions import (
    APPROACH_MIN,
    IMPACT_SHARE,
    IMPACT_SLACK,
    IMPACT_TARGET,
    KEEPS_NOTHING,
    SIMULATED,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.counters import (
    COUNT_DENSE,
    COUNT_EVENTS,
    COUNT_UNCONVERGED,
    STAGE_COLLISION,
)
from touchstone.reference_impl.core.kernel import clock, inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector, dot
from touchstone.reference_impl.geometry.contact_manifold import expand_manifolds, is_polyhedral
from touchstone.reference_impl.geometry.convex_depth import convex_depth
from touchstone.reference_impl.solver.islands import loops
from touchstone.reference_impl.solver.mobility import place_surfaces

DENSE_SUBSTEPS = 8
"""Most dense substeps for the rest of a frame, unless rotation or sliding requires more."""
DENSE_EVENTS = 32
"""Events of a frame after which dense substeps simulate the rest."""
SPECULATIVE_SLACK = 0.25
"""Speed over the resting speed 2 g h at which near pairs close their gap within a substep [1]: a larger value
adds more of them as rows, and leaves fewer unforeseen impacts."""
SPECULATIVE_COSINE = 0.995
"""Cosine of the angle between the normals of a speculative contact now and at its impact, over which it keeps
the present one [1]."""
TOUCH_CLOSED = 9e-7
"""Gap to which a speculative contact may close [m]: touching, but not yet an impact (IMPACT_TARGET)."""
STILL = 1e-6
"""Speed of a body [m/s, rad/s] below which its contacts are not counted in `event_rows`."""
DENSE_PARTS = 32
"""Most dense substeps per frame that rotation may require."""
DENSE_SPEED = 0.01
"""Relative speed of touching polyhedra from which DENSE_PARTS / 8 is the least division of a frame [m/s]:
their contact points move."""
DENSE_SINKING = 2e-7
"""Sinking of a rotating body that the length of a dense substep allows [m]: a fifth of OVERLAP_TOLERANCE."""


@inlined_kernel
def gather_contacts(world, left):
    """Gather the contacts of the next substep, with near pairs if it is dense, and compute its length.

    Args:
        left: remaining time of the frame [s].
    Returns:
        (end, h): `pairs[:end]` are the contacts, one row per manifold point, with their `speculative_speed`;
        h is the length of the substep [s].
    """
    bodies, pieces, drivers = world.bodies, world.pieces, world.drivers
    vertices, pairs, state = world.vertices, world.pairs, world.state
    # expect as many rows as in the last substep, and twice as many after a dense one; the number of events
    # per frame is limited too
    expected = (1 + state["dense_substep"]) * state["last_rows"]
    crowded = state["rows"] + expected > state["event_rows"]
    crowded = crowded or state["counters"][COUNT_EVENTS] - state["calm_events"] >= DENSE_EVENTS
    crowded = crowded or state["work_left"] < 0
    end, h = 0, left
    if not crowded:
        end, _ = detect(world, SIMULATED, 0)
        crowded = state["rows"] + end > state["event_rows"]
        crowded = crowded and state["rows"] + _moving_rows(bodies, pairs, end) > state["event_rows"]
    state["dense_substep"] = 1 if crowded else 0
    if crowded:
        end, h = _gather_speculative(world, left)
        state["counters"][COUNT_DENSE] += 1
    align_internal_edges(bodies, pieces, vertices, pairs, end, state)
    if not crowded:
        end = _drop_impacts_ahead(bodies, pairs, end, state, rest_speed(state))
    pressed = False
    if state["driven_loop"] == 1:
        mark_pressed(bodies, drivers, pairs, 0, end)
        pressed = _is_pressed(drivers)
    if pressed:
        end = detect_new_stops(world, end)
    for k in range(end):
        # a pair that touches does not pass by: its other points may close their gap at most
        if pairs[k]["distance"] <= TOUCH_DISTANCE:
            pairs[k]["key"] = 0.0
    # points that may land within a dense substep, or that a driver presses, are speculative contacts
    end = expand_manifolds(bodies, pieces, vertices, pairs, end, crowded or pressed, state)
    for k in range(end):
        gap = pairs[k]["distance"]
        pairs[k]["speculative_speed"] = 0.0
        # a pair that passes by without contact may keep its present approach speed
        if gap > TOUCH_DISTANCE:
            pairs[k]["speculative_speed"] = max((gap - TOUCH_CLOSED) / h, pairs[k]["key"])
    if state["moving_surfaces"] == 1:
        place_surfaces(bodies, pieces, pairs, end)
    state["last_rows"] = _moving_rows(bodies, pairs, end)
    state["rows"] += state["last_rows"]
    return end, h


@kernel
def _moving_rows(bodies, pairs, count):
    """Number of the rows `pairs[:count]` on a simulated body that moves: what rests takes one look."""
    moving = 0
    for k in range(count):
        for side in range(2):
            body = bodies[pairs[k]["body_b"] if side else pairs[k]["body_a"]]
            v, w = body["velocity"], body["omega"]
            if body["kind"] == SIMULATED and dot(v, v) + dot(w, w) > STILL * STILL:
                moving += 1
                break
    return moving


@kernel
def _drop_impacts_ahead(bodies, pairs, count, state, v_rest):
    """Remove touching pairs that will bounce but are farther apart than the impact gap.

    They move freely until their impact. Returns the number of remaining pairs, moved to the front.
    """
    kept, ahead = 0, state["impact_gap"] * (1 + 2 * IMPACT_SHARE)
    for k in range(count):
        n, fast = pairs[k]["normal"], max(v_rest, APPROACH_MIN)
        if pairs[k]["distance"] > ahead and witness_approach(bodies, pairs[k], n, state) > fast:
            continue
        if k != kept:
            pairs[kept] = pairs[k]
        kept += 1
    return kept


@kernel
def _is_pressed(drivers):
    """Whether any driver is pressed."""
    for d in range(len(drivers)):
        if drivers[d]["pressed"] > 0:
            return True
    return False


@kernel
def _gather_speculative(world, left):
    """Gather the pairs that touch or may meet within a dense substep, at the front of `pairs`.

    Returns:
        (end, h) of `gather_contacts`.
    """
    bodies, drivers, pieces, vertices = world.bodies, world.drivers, world.pieces, world.vertices
    pairs, state = world.pairs, world.state
    since = clock(state["clock"])
    g, v_rest = state["gravity"], rest_speed(state)
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            _coast(bodies[b], g, 1.0, left)
        elif loops(bodies, drivers, b):
            _coast(bodies[b], g, 0.0, left)
    found = find_swept_pairs(world, SIMULATED, 0)
    # limit the substep so that no impact with restitution happens much too early
    fastest, reach, rate, least = v_rest, v_rest * state["dt"], 0.0, 0.0
    most = DENSE_PARTS * left / state["dt"]
    for k in range(found):
        pair = pairs[k]
        _measure(bodies, pieces, vertices, pair, state)
        if pair["distance"] < pair["key"] * left:
            fastest = max(fastest, pair["key"])
        # a coupling may bring its driver back, against its velocity
        driven = loops(bodies, drivers, pair["body_a"]) or loops(bodies, drivers, pair["body_b"])
        near = SPECULATIVE_SLACK * v_rest * left if driven else TOUCH_DISTANCE
        if pair["distance"] < max(TOUCH_DISTANCE, near, pair["key"] * left):
            a, b = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
            flat = is_polyhedral(a, b)
            rate = max(rate, _sinking_rate(bodies[pair["body_a"]], a, vertices, flat))
            rate = max(rate, _sinking_rate(bodies[pair["body_b"]], b, vertices, flat))
            if flat and _meeting_speed(state) > DENSE_SPEED:
                least = max(least, most / 8)
    parts = DENSE_SUBSTEPS if fastest > 0 else 1
    if reach > 0 and fastest * left <= DENSE_SUBSTEPS * reach:
        parts = ceil(fastest * left / reach)
    # limit the substep so that contact points of rotating bodies and of sliding faces move little within it
    parts = max(parts, ceil(least), ceil(min(left * rate, most)))
    h, end = left / parts, 0
    for k in range(found):
        pair = pairs[k]
        # keep pairs whose predicted paths meet, and pairs so near that an impulse may bring them into contact
        gap = pair["distance"]
        if TOUCH_DISTANCE < gap < pair["key"] * h and _meets(world, pair, 1 / parts):
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
    """Speed of B's witness point relative to A's, for the last pair measured [m/s]."""
    a, b = state["velocity_a"], state["velocity_b"]
    return sqrt((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2)


@kernel
def _sinking_rate(body, piece, vertices, exact):
    """Inverse of the time in which rotation moves a point of a piece's core by DENSE_SINKING [1/s], beyond
    the straight line of its velocity or, if `exact`, the parabola of its acceleration."""
    if body["kind"] != SIMULATED:
        return 0.0
    _, lever = lever_of(body, piece, vertices)
    w = body["omega"]
    spin = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    if exact:
        return spin * (lever / (6 * DENSE_SINKING)) ** (1 / 3)
    return spin * sqrt(lever / (2 * DENSE_SINKING))


@kernel
def _meets(world, pair, until):
    """Whether a pair meets before the fraction `until` of its predicted path.

    If so, and if the normal turns until then, the pair gets the normal at the time of impact, its present gap
    along that normal, and the witness points at the time of impact, moved back by the mean motion of the
    moving bodies. Otherwise it keeps its present normal, along which all points of its manifold are found.
    """
    bodies, pieces, vertices, state = world.bodies, world.pieces, world.vertices, world.state
    a, b, n = bodies[pair["body_a"]], bodies[pair["body_b"]], pair["normal"]
    one, two = pieces[pair["piece_a"]], pieces[pair["piece_b"]]
    moving = MovingPair(a, b, one, two, vertices, pair, state)
    x, y, z = n[0], n[1], n[2]
    fraction, _, _ = time_of_impact(moving, 0.0, until, IMPACT_TARGET, IMPACT_SLACK)
    place_pair(moving, 0.0)
    if fraction == until or n[0] * x + n[1] * y + n[2] * z > SPECULATIVE_COSINE:
        _measure(bodies, pieces, vertices, pair, state)
        return fraction < until
    s, moving = fraction, a["moves"] + b["moves"]
    for i in range(3):
        way = a["moves"] * (a["travel"][i] + s * a["travel_bend"][i])
        way += b["moves"] * (b["travel"][i] + s * b["travel_bend"][i])
        pair["point_a"][i] -= s * way / moving
        pair["point_b"][i] -= s * way / moving
    pair["distance"] = gap_along(one, two, vertices, n[0], n[1], n[2], state)
    return True


@kernel
def _coast(body, gravity, falls, h):
    """Set the motion of a body over a time h without contacts, under a share `falls` of gravity."""
    copy_vector(body["center"], body["old_center"])
    copy_quaternion(body["orientation"], body["old_orientation"])
    body["moves"], body["spin_steps"], body["spin_keeps"] = 1, 0, KEEPS_NOTHING
    for i in range(3):
        body["travel"][i], body["travel_bend"][i] = h * body["velocity"][i], falls * h * h * gravity[i] / 2
        body["turn"][i], body["turn_bend"][i] = h * body["omega"][i], 0.0


@kernel
def _measure(bodies, pieces, vertices, pair, state):
    """Compute the distance of a pair at its present pose, and its approach speed in `key` [m/s]."""
    _, converged = convex_depth(pieces[pair["piece_a"]], pieces[pair["piece_b"]], vertices, state, pair)
    if not converged:
        state["counters"][COUNT_UNCONVERGED] += 1
    pair["key"] = witness_approach(bodies, pair, pair["normal"], state)

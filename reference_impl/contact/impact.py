"""Impacts: all approaching contacts simultaneously, or one at a time from a priority queue (section 5).

Simultaneous impacts are generalized reflections (Smith, Kaufman, Vouga, Tamstorf & Grinspun 2012): all
approaching contacts get impulses together, each by Newton's law for its own velocity before the impact; this
repeats until none approaches. Contacts that touch without approaching get no impulse. So a Newton's cradle
passes its impulse from ball to ball, and a break of equal balls stays symmetric. The result does not depend
on the order of bodies or contacts.

A body that friction wedges between two others can pass an impulse to and fro with hardly any loss. After
REFLECTION_ROUNDS, or a solve that stayed open, contacts that touch without approaching take part (Moreau
1988), and none approaches afterwards.
"""

from math import sqrt

from touchstone.reference_impl.contact.contact_log import close_row, log_contact, log_held
from touchstone.reference_impl.contact.impulse import contact_impulse, resting_restitution
from touchstone.reference_impl.contact.island_impact import strike_together, to_middle
from touchstone.reference_impl.core.conventions import (
    APPROACH_MIN,
    DENSE_SETTLE,
    IMPULSE_CAP,
    IMPULSES_TOGETHER,
    NO_FLOOR,
    REFLECTION_FAILURES,
    REFLECTION_ROUNDS,
    SETTLE_DEPTH,
)
from touchstone.reference_impl.core.counters import COUNT_GUARDED, COUNT_IMPULSES, COUNT_OPEN_SOLVES
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.islands import mover_of
from touchstone.reference_impl.solver.mobility import (
    apply_to_both,
    approach_speed,
    contact_mobility,
    relative_velocity,
)


@kernel
def weight_speed(state, time):
    """Speed that a body gains by gravity in a time [m/s]."""
    g = state["gravity"]
    return time * sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)


@kernel
def rest_speed(state):
    """Approach speed up to which no contact bounces [m/s].

    It is the smaller of `v_rest` and 2 g h of the frame, or 2 g h in a dense substep.
    """
    coarse = weight_speed(state, 2 * state["dt"])
    return coarse if state["dense_substep"] == 1 else min(state["v_rest"], coarse)


@inlined_kernel
def resolve_impacts(world, count, time, h):
    """Resolve impacts of the touching pairs `pairs[:count]` until none approaches.

    Under IMPULSES_TOGETHER a final solve stops all contacts that are too slow to bounce, if they would sink
    by SETTLE_DEPTH within the substep of length h [s]. Before a dense substep, large islands are solved until
    they would not: the resting contacts stop the rest.

    Returns:
        Whether fewer than IMPULSE_CAP rounds or impulses sufficed.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, contacts, state = world.pairs, world.contacts, world.state
    if state["impulses"] != IMPULSES_TOGETHER:
        return _resolve_in_turn(world, count, time)
    v_rest, unsolved = rest_speed(state), state["counters"][COUNT_OPEN_SOLVES]
    done = False
    for k in range(IMPULSE_CAP):
        failures = state["counters"][COUNT_OPEN_SOLVES] - unsolved
        if failures > REFLECTION_FAILURES:
            break
        together = k >= REFLECTION_ROUNDS or failures > 0
        if not _find_impacts(bodies, pairs, count, v_rest, together, state):
            done = True
            break
        strike_together(bodies, joints, drivers, pairs, count, state)
        log_held(bodies, pairs, count, contacts, state, time)
    k = fastest_row(bodies, drivers, pairs, count, -1, state)
    if k >= 0 and pairs[k]["key"] * h > SETTLE_DEPTH:
        for row in range(count):
            begin_row(bodies, pairs[row], -pairs[row]["speculative_speed"])
        state["settling"] = DENSE_SETTLE / h if state["dense_substep"] == 1 else 0.0
        solve_contacts(bodies, joints, drivers, pairs, count, False, state)
        state["settling"] = 0.0
        log_held(bodies, pairs, count, contacts, state, time)
    return done


@inlined_kernel
def _find_impacts(bodies, pairs, count, v_rest, together, state):
    """Initialise the rows; returns whether any bounces.

    A row that approaches too fast to rest gets its rebound speed as its floor. The others may close their gap
    at most, if all contacts act together, or get NO_FLOOR.
    """
    slow, found = max(v_rest, APPROACH_MIN), False
    for k in range(count):
        pair = pairs[k]
        approach_speed(bodies, pair, state)
        if pair["key"] > slow:
            speed = pair["key"] + pair["speculative_speed"]
            e = resting_restitution(pair["restitution"], speed, v_rest)
            begin_row(bodies, pair, e * speed)
            found = True
        else:
            begin_row(bodies, pair, -pair["speculative_speed"] if together else NO_FLOOR)
    return found


@kernel
def fastest_row(bodies, drivers, pairs, count, struck, state):
    """Find the first row with the fastest approach, or -1 if there are no rows.

    Updates the approach speeds of rows that share a mover with row `struck`, or of all rows if that is -1.
    """
    one = mover_of(bodies, drivers, pairs[struck]["body_a"]) if struck >= 0 else -1
    two = mover_of(bodies, drivers, pairs[struck]["body_b"]) if struck >= 0 else -1
    fastest = -1
    for k in range(count):
        pair = pairs[k]
        if struck >= 0:
            a, b = mover_of(bodies, drivers, pair["body_a"]), mover_of(bodies, drivers, pair["body_b"])
            renewed = (a >= 0 and (a == one or a == two)) or (b >= 0 and (b == one or b == two))
        else:
            renewed = True
        if renewed:
            approach_speed(bodies, pair, state)
        if fastest < 0 or pair["key"] > pairs[fastest]["key"]:
            fastest = k
    return fastest


@inlined_kernel
def _resolve_in_turn(world, count, time):
    """Resolve impacts one at a time, the fastest approach first, until none approaches.

    Returns:
        Whether IMPULSE_CAP impulses sufficed.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    v_rest, k = rest_speed(state), -1
    for _ in range(IMPULSE_CAP):
        k = fastest_row(bodies, drivers, pairs, count, k, state)
        if k < 0 or pairs[k]["key"] <= APPROACH_MIN:
            return True
        pair = pairs[k]
        e = resting_restitution(pair["restitution"], pair["key"] + pair["speculative_speed"], v_rest)
        if pair["manifold"] >= 0:
            to_middle(pairs, pair)
        strike(bodies, joints, drivers, pair, e, state)
        _log_strike(bodies, pair, world.contacts, state, time)
    return False


@kernel
def strike(bodies, joints, drivers, pair, e, state):
    """Apply one impact at one point; leaves its impulse in `state["impulse"]`."""
    v, p, mobility = state["velocity"], state["impulse"], state["mobility"]
    relative_velocity(bodies, pair, state)
    contact_mobility(bodies, drivers, pair, mobility)
    mu, friction, law = pair["friction"], state["friction"], state["restitution_law"]
    guarded = contact_impulse(v, pair["normal"], mobility, e, mu, friction, law, p)
    apply_to_both(bodies, joints, drivers, pair, pair["point"], p)
    state["counters"][COUNT_IMPULSES] += 1
    state["counters"][COUNT_GUARDED] += guarded


@kernel
def _log_strike(bodies, pair, contacts, state, time):
    """Log the impact that `strike` has just applied."""
    row = log_contact(contacts, state, pair, pair["point"], time)
    if row >= 0:
        copy_vector(state["velocity_a"], contacts[row]["velocity_a_before"])
        copy_vector(state["velocity_b"], contacts[row]["velocity_b_before"])
        close_row(bodies, pair, contacts[row], state["impulse"])

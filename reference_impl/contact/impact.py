"""Impacts: all approaching contacts simultaneously.

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

from touchstone.reference_impl.contact.contact_log import log_held, note_moment_work
from touchstone.reference_impl.contact.island_impact import stop_at_limits, strike_together
from touchstone.reference_impl.core.conventions import APPROACH_MIN, NO_FLOOR
from touchstone.reference_impl.core.counters import COUNT_OPEN_SOLVES
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.mobility import approach_speed

SETTLE_DEPTH, DENSE_SETTLE = 1.7e-8, 1e-7
"""Depth by which an approaching pair would sink in a substep, from which it stops before the contact solve;
and depth that this leaves in large islands of dense substeps [m]."""
IMPULSE_CAP = 200
"""Rounds of simultaneous impacts of an event."""
REFLECTION_ROUNDS = 64
"""Rounds of simultaneous impacts of an event after which all touching contacts act together: a row of as many
balls passes an impulse on in so many rounds."""
REFLECTION_FAILURES = 2
"""Open solves of an event's impacts after which no round follows: a jammed island leaves each open."""


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

    A final solve stops all contacts that are too slow to bounce, if they would sink by SETTLE_DEPTH within
    the substep of length h [s]. Before a dense substep, large islands are solved until they would not: the
    resting contacts stop the rest.

    Returns:
        Whether fewer than IMPULSE_CAP rounds sufficed.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, contacts, state = world.pairs, world.contacts, world.state
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
        if state["moments"] == 1:
            note_moment_work(bodies, pairs, count, 1.0, state)
        log_held(bodies, pairs, count, contacts, state, time)
    k = _fastest_row(bodies, pairs, count, state)
    if k >= 0 and pairs[k]["key"] * h > SETTLE_DEPTH:
        for row in range(count):
            begin_row(bodies, pairs[row], -pairs[row]["speculative_speed"])
        state["settling"] = DENSE_SETTLE / h if state["dense_substep"] == 1 else 0.0
        if state["mechanisms"] == 1:
            # held joints could give energy to these, too
            strike_together(bodies, joints, drivers, pairs, count, state)
        else:
            solve_contacts(bodies, joints, drivers, pairs, count, 0.0, state)
        state["settling"] = 0.0
        if state["moments"] == 1:
            note_moment_work(bodies, pairs, count, 1.0, state)
        log_held(bodies, pairs, count, contacts, state, time)
    if state["mechanisms"] == 1:
        stop_at_limits(bodies, joints, drivers, pairs, state)
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
def _fastest_row(bodies, pairs, count, state):
    """Compute all approach speeds; return the first row with the fastest approach, or -1 without rows."""
    fastest = -1
    for k in range(count):
        approach_speed(bodies, pairs[k], state)
        if fastest < 0 or pairs[k]["key"] > pairs[fastest]["key"]:
            fastest = k
    return fastest


@kernel
def resting_restitution(e, approach, v_rest):
    """Restitution that falls linearly from e at 2 v_rest to 0 at v_rest; speeds in m/s."""
    if v_rest <= 0:
        return e
    return e * min(1.0, max(0.0, approach / v_rest - 1))

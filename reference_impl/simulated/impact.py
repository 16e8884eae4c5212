"""Impacts: all that approach at once, or a priority queue, one contact at a time (section 5).

All at once (generalized reflections: Smith, Kaufman, Vouga, Tamstorf & Grinspun 2012): the contacts that
approach get impulses together, each by Newton's law against its own velocity before; this repeats until none
approaches. What touches without approaching takes no part: so a cradle passes its impulse on ball by ball,
and a break of equal balls stays symmetric. The answer does not depend on the order of bodies or contacts.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    APPROACH_MIN,
    COUNT_GUARDED,
    COUNT_IMPULSES,
    IMPULSE_CAP,
    IMPULSES_TOGETHER,
    NO_FLOOR,
    SETTLE_MIN,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.simulated.contact import (
    apply_to_both,
    approach_speed,
    contact_mobility,
    relative_velocity,
)
from touchstone.reference_impl.simulated.contact_log import close_row, log_contact, log_held
from touchstone.reference_impl.simulated.impulse import contact_impulse, resting_restitution
from touchstone.reference_impl.simulated.island_impact import strike_together, to_middle
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.islands import mover_of


@kernel
def weight_speed(state, time):
    """What gravity adds to a speed in a time [m/s]."""
    g = state["gravity"]
    return time * sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)


@kernel
def rest_speed(state):
    """Approach speed up to which nothing bounces [m/s]: 2 g h of the frame, or `v_rest` where that is less
    and the substep is not crowded."""
    coarse = weight_speed(state, 2 * state["dt"])
    return coarse if state["dense_substep"] == 1 else min(state["v_rest"], coarse)


@kernel
def resolve_impacts(bodies, joints, drivers, pairs, count, contacts, state, time):
    """Impacts of the touching pairs `pairs[:count]`, until none approaches.

    Under IMPULSES_TOGETHER contacts too slow to bounce hold, and stop together at the end.

    Returns:
        Whether fewer than IMPULSE_CAP rounds or impulses sufficed.
    """
    if state["impulses"] != IMPULSES_TOGETHER:
        return _resolve_in_turn(bodies, joints, drivers, pairs, count, contacts, state, time)
    v_rest = rest_speed(state)
    done = False
    for _ in range(IMPULSE_CAP):
        if not _find_impacts(bodies, pairs, count, v_rest, state):
            done = True
            break
        strike_together(bodies, joints, drivers, pairs, count, state)
        log_held(bodies, pairs, count, contacts, state, time)
    k = fastest_row(bodies, drivers, pairs, count, -1, state)
    if k >= 0 and pairs[k]["key"] > SETTLE_MIN:
        for row in range(count):
            begin_row(bodies, pairs[row], -pairs[row]["speculative_speed"])
        solve_contacts(bodies, joints, drivers, pairs, count, False, state)
        log_held(bodies, pairs, count, contacts, state, time)
    return done


@kernel
def _find_impacts(bodies, pairs, count, v_rest, state):
    """Begin the rows that approach too fast to rest, with the speed at which each leaves as its floor; the
    others have NO_FLOOR. Returns whether there are any."""
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
            begin_row(bodies, pair, NO_FLOOR)
    return found


@kernel
def fastest_row(bodies, drivers, pairs, count, struck, state):
    """The first row with the fastest approach, or -1 where there is none.

    Renews the approach speeds of rows that share a moving body with row `struck`, or of all where that is -1.
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


@kernel
def _resolve_in_turn(bodies, joints, drivers, pairs, count, contacts, state, time):
    """One impact after the other, the fastest approach first, until none approaches; returns whether
    IMPULSE_CAP of them sufficed."""
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
        _log_strike(bodies, pair, contacts, state, time)
    return False


@kernel
def strike(bodies, joints, drivers, pair, e, state):
    """One impact at one point; its impulse is left in `state["impulse"]`."""
    v, p, mobility = state["velocity"], state["impulse"], state["mobility"]
    relative_velocity(bodies, pair, state)
    contact_mobility(bodies, drivers, pair, pair["point"], mobility)
    mu, friction, law = pair["friction"], state["friction"], state["restitution_law"]
    guarded = contact_impulse(v, pair["normal"], mobility, e, mu, friction, law, p)
    apply_to_both(bodies, joints, drivers, pair, pair["point"], p)
    state["counters"][COUNT_IMPULSES] += 1
    state["counters"][COUNT_GUARDED] += guarded


@kernel
def _log_strike(bodies, pair, contacts, state, time):
    """Log the impact that `strike` just did."""
    row = log_contact(contacts, state, pair, pair["point"], time)
    if row >= 0:
        copy_vector(state["velocity_a"], contacts[row]["velocity_a_before"])
        copy_vector(state["velocity_b"], contacts[row]["velocity_b_before"])
        close_row(bodies, contacts[row], state["impulse"])

"""Impacts: a priority queue, one contact at a time, the points of a patch as one (section 5)."""

from math import sqrt

from reference_impl.contact import apply_to_both, approach_speed, contact_mobility, relative_velocity
from reference_impl.contact_log import close_row, log_contact, log_held
from reference_impl.contact_patch import ALL
from reference_impl.contact_solver import begin_row, settle
from reference_impl.conventions import (
    APPROACH_MIN,
    COUNT_GUARDED,
    COUNT_IMPULSES,
    COUNT_UNCONVERGED,
    FRICTION_PAPER,
    IMPULSE_CAP,
    IMPULSES_TOGETHER,
    SETTLE_MIN,
)
from reference_impl.impulse import contact_impulse, resting_restitution
from reference_impl.kernel import inlined_kernel, kernel
from reference_impl.patch_impact import strike_patch, to_middle
from reference_impl.rotation import copy_vector


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
    return coarse if state["crowded"] == 1 else min(state["v_rest"], coarse)


@kernel
def resolve_impacts(bodies, joints, drivers, pairs, count, contacts, state, time):
    """Impacts of the touching pairs `pairs[:count]`: the fastest approach first, until none is left.

    Under IMPULSES_TOGETHER those too slow to bounce are contacts that hold, and stop together at the end.

    Returns:
        Whether fewer than IMPULSE_CAP impulses sufficed.
    """
    v_rest = rest_speed(state)
    together = state["impulses"] == IMPULSES_TOGETHER
    slow = max(v_rest, APPROACH_MIN) if together else APPROACH_MIN
    done = _resolve_in_turn(bodies, joints, drivers, pairs, count, contacts, state, time, v_rest, slow)
    k = fastest_row(bodies, pairs, count, -1, state) if together else -1
    if k >= 0 and pairs[k]["key"] > SETTLE_MIN:
        for row in range(count):
            begin_row(bodies, pairs[row], -pairs[row]["close"])
        if not settle(bodies, joints, drivers, pairs, count, ALL, state):
            state["counters"][COUNT_UNCONVERGED] += 1
        log_held(bodies, pairs, count, ALL, contacts, state, time)
    return done


@inlined_kernel
def fastest_row(bodies, pairs, count, struck, state):
    """The first row with the fastest approach, or -1 where there is none.

    Renews the approach speeds of rows that share a moving body with row `struck`, or of all where that is -1.
    """
    one = _mover(bodies, pairs[struck]["body_a"]) if struck >= 0 else -1
    two = _mover(bodies, pairs[struck]["body_b"]) if struck >= 0 else -1
    fastest = -1
    for k in range(count):
        pair = pairs[k]
        if struck >= 0:
            a, b = _mover(bodies, pair["body_a"]), _mover(bodies, pair["body_b"])
            renewed = (a >= 0 and (a == one or a == two)) or (b >= 0 and (b == one or b == two))
        else:
            renewed = True
        if renewed:
            approach_speed(bodies, pair, state)
        if fastest < 0 or pair["key"] > pairs[fastest]["key"]:
            fastest = k
    return fastest


@kernel
def _mover(bodies, b):
    """What an impulse on body b moves: the body, or all links of its driver; -1 for nothing."""
    body = bodies[b]
    if body["driver"] >= 0:
        return len(bodies) + body["driver"]
    return b if body["inverse_mass"] > 0 else -1


@kernel
def _resolve_in_turn(bodies, joints, drivers, pairs, count, contacts, state, time, v_rest, slow):
    """One impact after the other until none approaches faster than `slow`; returns whether IMPULSE_CAP of
    them sufficed."""
    k = -1
    for _ in range(IMPULSE_CAP):
        k = fastest_row(bodies, pairs, count, k, state)
        if k < 0 or pairs[k]["key"] <= slow:
            return True
        pair = pairs[k]
        e = resting_restitution(pair["restitution"], pair["key"] + pair["close"], v_rest)
        several = pair["patch"] >= 0 and pairs[pair["patch"]]["sibling"] >= 0
        if several and state["friction"] != FRICTION_PAPER:
            strike_patch(bodies, joints, drivers, pairs, count, pair["patch"], e, state)
            log_held(bodies, pairs, count, pair["patch"], contacts, state, time)
            state["counters"][COUNT_IMPULSES] += 1
        else:
            if several:
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

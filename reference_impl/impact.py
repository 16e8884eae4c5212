"""Impacts: a priority queue, one contact at a time, the points of a patch as one (section 5)."""

from math import sqrt

from reference_impl.contact import apply_to_both, approach_speed, contact_mobility, relative_velocity
from reference_impl.contact_log import close_row, log_contact, log_held
from reference_impl.conventions import APPROACH_MIN, COUNT_GUARDED, COUNT_IMPULSES, IMPULSE_CAP
from reference_impl.impulse import contact_impulse, resting_restitution
from reference_impl.kernel import kernel
from reference_impl.patch_impact import strike_patch
from reference_impl.rotation import copy_vector


@kernel
def resolve_impacts(bodies, joints, drivers, pairs, count, contacts, state, time):
    """Impacts of the touching pairs `pairs[:count]`: the fastest approach first, until none is left.

    Returns:
        Whether fewer than IMPULSE_CAP impulses sufficed.
    """
    v, p, mobility = state["velocity"], state["impulse"], state["mobility"]
    g = state["gravity"]
    v_rest = 2 * state["dt"] * sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    for k in range(count):
        approach_speed(bodies, pairs[k], state)
    for _ in range(IMPULSE_CAP):
        fastest = -1
        for k in range(count):
            if pairs[k]["key"] > (APPROACH_MIN if fastest < 0 else pairs[fastest]["key"]):
                fastest = k
        if fastest < 0:
            return True
        pair = pairs[fastest]
        point = pair["point"]
        v_n = relative_velocity(bodies, pair, state)
        e = resting_restitution(pair["restitution"], -v_n, v_rest)
        if pair["patch"] >= 0 and pairs[pair["patch"]]["sibling"] >= 0:
            strike_patch(bodies, joints, drivers, pairs, count, pair["patch"], e, state)
            log_held(bodies, pairs, count, pair["patch"], contacts, state, time)
            state["counters"][COUNT_IMPULSES] += 1
            _refresh_keys(bodies, pairs, count, pair, state)
            continue
        contact_mobility(bodies, drivers, pair, point, mobility)
        mu, friction, law = pair["friction"], state["friction"], state["restitution_law"]
        guarded = contact_impulse(v, pair["normal"], mobility, e, mu, friction, law, p)
        state["counters"][COUNT_GUARDED] += guarded
        apply_to_both(bodies, joints, drivers, pair, point, p)
        state["counters"][COUNT_IMPULSES] += 1
        row = log_contact(contacts, state, pair, point, time)
        if row >= 0:
            copy_vector(state["velocity_a"], contacts[row]["velocity_a_before"])
            copy_vector(state["velocity_b"], contacts[row]["velocity_b_before"])
            close_row(bodies, contacts[row], p)
        _refresh_keys(bodies, pairs, count, pair, state)
    return False


@kernel
def _refresh_keys(bodies, pairs, count, pair, state):
    """Approach speeds after an impulse on `pair`."""
    for k in range(count):
        if _share_body(bodies, pairs[k], pair):
            approach_speed(bodies, pairs[k], state)


@kernel
def _share_body(bodies, pair, other):
    """Whether an impulse on `other` changes a velocity of `pair`."""
    for s in range(2):
        one = pair["body_a"] if s == 0 else pair["body_b"]
        for t in range(2):
            two = other["body_a"] if t == 0 else other["body_b"]
            if one == two or (bodies[one]["driver"] >= 0 and bodies[one]["driver"] == bodies[two]["driver"]):
                return True
    return False

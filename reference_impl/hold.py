"""Contacts that hold: impulses over a substep that keep touching pairs from approaching (section 5)."""

from reference_impl.contact import apply_to_both, approach_speed
from reference_impl.contact_log import log_held
from reference_impl.contact_solver import ALL, begin_row, settle
from reference_impl.conventions import FLIGHT_BALLISTIC, HOLD_MEMORY
from reference_impl.kernel import kernel


@kernel
def begin_hold(bodies, pairs, count, state):
    """Before forces act: surface velocities of the touching pairs, and no impulse yet.

    A polyhedron's contact that separates may come back as fast as it left: its mean velocity over the substep
    is 0 then, and so is the work of its impulse. (Not under FLIGHT_EULER, which takes the last for the mean.)
    """
    for k in range(count):
        approach_speed(bodies, pairs[k], state)
        keeps = pairs[k]["patch"] >= 0 and state["flight"] == FLIGHT_BALLISTIC
        floor = min(0.0, pairs[k]["key"]) if keeps else 0.0
        # a near pair closes its gap at most: with the mean of its velocities, or with the last
        if pairs[k]["close"] > 0:
            ballistic = state["flight"] == FLIGHT_BALLISTIC
            floor = pairs[k]["key"] - pairs[k]["close"] if ballistic else -pairs[k]["close"]
        begin_row(bodies, pairs[k], floor)


@kernel
def hold_contacts(bodies, joints, drivers, pairs, count, contacts, state, time, h):
    """After forces acted: impulses that keep touching pairs from approaching, within the friction cone.

    Args:
        time, h: start of the substep in the frame, and its length [s].
    Returns:
        Whether the sweeps converged.
    """
    for k in range(count):
        if _recall(pairs[k], state, h):
            apply_to_both(bodies, joints, drivers, pairs[k], pairs[k]["point"], pairs[k]["held"])
    converged = settle(bodies, joints, drivers, pairs, count, ALL, state)
    log_held(bodies, pairs, count, ALL, contacts, state, time)
    _remember(pairs, count, state, h)
    return converged


@kernel
def _recall(pair, state, h):
    """Start a point of a patch from the force that held the nearest one of its pair; whether any did."""
    nearest, least = -1, 0.0
    for m in range(state["held_count"] if pair["patch"] >= 0 else 0):
        if state["held_pieces"][m, 0] == pair["piece_a"] and state["held_pieces"][m, 1] == pair["piece_b"]:
            distance = 0.0
            for i in range(3):
                distance += (state["held_point"][m, i] - pair["point"][i]) ** 2
            if nearest < 0 or distance < least:
                nearest, least = m, distance
    if nearest >= 0:
        for i in range(3):
            pair["held"][i] = h * state["held_force"][nearest, i]
    return nearest >= 0


@kernel
def _remember(pairs, count, state, h):
    """Forces at the points of patches, for the next hold."""
    kept = 0
    for k in range(count):
        pair = pairs[k]
        if pair["patch"] >= 0 and kept < HOLD_MEMORY:
            state["held_pieces"][kept, 0], state["held_pieces"][kept, 1] = pair["piece_a"], pair["piece_b"]
            for i in range(3):
                state["held_point"][kept, i] = pair["point"][i]
                state["held_force"][kept, i] = pair["held"][i] / h
            kept += 1
    state["held_count"] = kept

"""Contacts that hold: impulses over a substep that keep touching pairs from approaching (section 5)."""

from reference_impl.contact import apply_to_both, approach_speed
from reference_impl.contact_log import log_held
from reference_impl.contact_memory import recall, remember
from reference_impl.contact_patch import ALL
from reference_impl.contact_solver import begin_row, settle
from reference_impl.conventions import FLIGHT_BALLISTIC
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
        if recall(bodies, pairs[k], state, h):
            apply_to_both(bodies, joints, drivers, pairs[k], pairs[k]["point"], pairs[k]["held"])
    converged = settle(bodies, joints, drivers, pairs, count, ALL, state)
    log_held(bodies, pairs, count, ALL, contacts, state, time)
    remember(bodies, pairs, count, state, h)
    return converged

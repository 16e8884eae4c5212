"""Resting contacts: impulses over a substep that keep touching pairs from approaching."""

from touchstone.reference_impl.contact.contact_events import first_stop, note_free_slip
from touchstone.reference_impl.contact.contact_log import log_held
from touchstone.reference_impl.contact.impact import rest_speed
from touchstone.reference_impl.contact.integrate import apply_forces, begin_again
from touchstone.reference_impl.continuous.contact_motion import (
    bias_share,
    move_to_middle,
    restore_normals,
)
from touchstone.reference_impl.core.conventions import APPROACH_MIN, NEVER, NO_FLOOR
from touchstone.reference_impl.core.counters import CAP_HOLD_ROUNDS
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.mobility import approach_speed
from touchstone.reference_impl.solver.warm_start import load_impulse, store_impulses

SEPARATION_MIN = 1e-8
"""Speed of a touching pair that is no separation [m/s]: a weight of 10 N does 1e-9 J of work per frame."""
STOP_SHARE, STOP_SHORT = 1 - 1e-9, 1 - 1e-6
"""Fraction of a substep from which the end of sliding counts as its end, and fraction of the time to an
earlier one that the substep takes [1]: exactly there, on the cone without sliding, sweeps converge slowly."""
STOP_LATER = 1.0001
"""Ratio of the time to a stop and a shortened substep from which the substep is solved again, longer [1]."""
RESTING_CONTACT_ROUNDS = 10
"""Attempts at a substep in which sliding contacts stop or bodies rotate; 1 or 2 are usual."""


@inlined_kernel
def solve_resting_contacts(world, count, time, h):
    """Apply forces over a substep, and impulses in the friction cone that let no touching pair approach.

    Args:
        count: `pairs[:count]` touch.
        time, h: start of the substep in the frame, and its length [s].
    Returns:
        The length for which the impulses are valid [s], shorter if a sliding contact stops earlier, or if
        bodies rotate more than their contacts allow for.
    """
    bodies, pairs, state = world.bodies, world.pairs, world.state
    most, extended = h, False
    for k in range(RESTING_CONTACT_ROUNDS):
        _prepare_resting_contacts(world, count, h)
        apply_forces(bodies, state["gravity"], h)
        converged = _solve_together(world, count, h)
        # a stop time is meaningful only if the impulses converged
        share = first_stop(bodies, pairs, count, h, state) if converged else NEVER
        if state["dense_substep"] == 0:
            share = min(share, bias_share(bodies, world.pieces, pairs, count, h, state))
        later = min(most, STOP_SHORT * share * h)
        if share >= STOP_SHARE:
            # other contacts brake as well: the stop was predicted too early, so solve up to it once more
            if extended or later < STOP_LATER * h:
                break
            extended = True
        if k == RESTING_CONTACT_ROUNDS - 1:
            state["counters"][CAP_HOLD_ROUNDS] += 1
            break
        begin_again(bodies, world.joints, world.drivers)
        restore_normals(pairs, count)
        h = later
    # a repeated solve must not start from the one before it: where a slide stops within the substep, friction
    # may have any direction, and it keeps that one if the slip at the end is small
    store_impulses(bodies, pairs, count, state, h)
    log_held(bodies, pairs, count, world.contacts, state, time)
    return h


@inlined_kernel
def _prepare_resting_contacts(world, count, h):
    """Initialise the rows before forces act: contact points, surface velocities, floors and zero impulses."""
    bodies, pairs, state = world.bodies, world.pairs, world.state
    patch_flight = max(APPROACH_MIN, rest_speed(state))
    for k in range(count):
        pair = pairs[k]
        copy_vector(pair["normal"], pair["start_normal"])
        approach_speed(bodies, pair, state)
        begin_row(bodies, pair, _floor(pair, state, APPROACH_MIN if pair["manifold"] < 0 else patch_flight))
        move_to_middle(bodies, world.pieces, pair, h)


@kernel
def _floor(pair, state, flight):
    """Lower bound of a row's normal velocity after the contact solve [m/s].

    A pair that separates faster than `flight` gets NO_FLOOR (`first_return` finds its return). A slower pair
    may return as fast as it left: its mean velocity over the substep is then 0, and so is the work of its
    impulse. A near pair may close its gap at most.
    """
    if pair["speculative_speed"] > 0:
        return pair["key"] - pair["speculative_speed"]
    separation = -pair["key"]
    if separation <= SEPARATION_MIN:
        return 0.0
    return NO_FLOOR if separation > flight and state["dense_substep"] == 0 else -separation


@inlined_kernel
def _solve_together(world, count, h):
    """Solve all rows together with a warm start; returns whether the impulses converged."""
    bodies, pairs, state = world.bodies, world.pairs, world.state
    note_free_slip(bodies, pairs, count, state)
    for k in range(count):
        load_impulse(bodies, pairs[k], state, h)
    return solve_contacts(bodies, world.joints, world.drivers, pairs, count, True, state)

"""Contacts that resolve together: accelerated projected Gauss-Seidel over their rows.

A sweep visits every row and sets its accumulated impulse so that its own law holds: no approach below its
floor, friction within the cone and against the sliding that is left. Sweeps alone take thousands to pass a
weight down a stack of five boxes, whose points share the load in more ways than one; Anderson's acceleration
takes tens. What settled ends with a sweep: every row then obeys its law.
"""

from math import sqrt

from reference_impl.anderson import begin_acceleration, extrapolate
from reference_impl.contact import apply_to_both, contact_mobility, relative_velocity, surface_velocity
from reference_impl.contact_patch import first_row, next_row
from reference_impl.conventions import (
    COUNT_SWEEPS,
    CROWD_RESIDUAL,
    CROWD_SWEEPS,
    FRICTION_PAPER,
    HOLD_RESIDUAL,
    HOLD_SWEEPS,
    HOLD_VISITS,
    SLIP_MIN,
)
from reference_impl.impulse import normal_response, respond
from reference_impl.kernel import kernel
from reference_impl.rotation import copy_vector


@kernel
def begin_row(bodies, pair, floor):
    """A row without impulse yet: its floor and surface velocities."""
    pair["held"][:] = 0.0
    pair["floor"] = floor
    surface_velocity(bodies[pair["body_a"]], pair["point"], pair["before_a"])
    surface_velocity(bodies[pair["body_b"]], pair["point"], pair["before_b"])


@kernel
def settle(bodies, joints, drivers, pairs, count, patch, state):
    """Impulses that keep the rows of a patch, or ALL, at their floor, from those they have.

    Exact after one sweep where a ball has one contact. Returns whether the sweeps converged.
    """
    if count == 0:
        return True
    k = first_row(patch, count)
    while k >= 0:
        contact_mobility(bodies, drivers, pairs[k], pairs[k]["point"], pairs[k]["mobility"])
        k = next_row(pairs, k, patch, count)
    begin_acceleration(state, count)
    residual = CROWD_RESIDUAL if state["crowded"] == 1 else HOLD_RESIDUAL
    sweeps = CROWD_SWEEPS if state["crowded"] == 1 else max(HOLD_SWEEPS, HOLD_VISITS // count)
    for sweep in range(sweeps):
        if sweep > 0:
            extrapolate(bodies, joints, drivers, pairs, count, patch, state)
        change = 0.0
        k = first_row(patch, count)
        while k >= 0:
            copy_vector(pairs[k]["held"], pairs[k]["kept"])
            change = max(change, _relax(bodies, joints, drivers, pairs[k], state))
            k = next_row(pairs, k, patch, count)
        state["counters"][COUNT_SWEEPS] += 1
        if change <= residual:
            return True
    return False


@kernel
def _relax(bodies, joints, drivers, pair, state):
    """One row's share of a sweep; returns the change of its velocity [m/s]."""
    v, p, tangent, mobility = state["velocity"], state["impulse"], state["tangent"], pair["mobility"]
    n, held = pair["normal"], pair["held"]
    v_n = relative_velocity(bodies, pair, state)
    if v_n >= pair["floor"] and held[0] == 0 and held[1] == 0 and held[2] == 0:
        return 0.0
    normal_mobility = normal_response(mobility, n, n[0], n[1], n[2])
    # the mean mobility across the normal: exact for spheres, a relaxation for the rest
    across = (mobility[0, 0] + mobility[1, 1] + mobility[2, 2] - normal_mobility) / 2
    j_old = held[0] * n[0] + held[1] * n[1] + held[2] * n[2]
    j = max(0.0, j_old - (v_n - pair["floor"]) / normal_mobility)
    # what would stop the sliding that j leaves, cut off at the cone (or always the whole cone, Eq. 10)
    step = j - j_old
    x, y, z = respond(mobility, step * n[0], step * n[1], step * n[2])
    tangent[0], tangent[1], tangent[2] = v[0] + x, v[1] + y, v[2] + z
    for i in range(3):
        tangent[i] = held[i] - tangent[i] / across
    off = tangent[0] * n[0] + tangent[1] * n[1] + tangent[2] * n[2]
    sliding = 0.0
    for i in range(3):
        tangent[i] -= off * n[i]
        sliding += tangent[i] ** 2
    sliding = sqrt(sliding)
    limit = pair["friction"] * j
    scale = 1.0
    if sliding > limit or (state["friction"] == FRICTION_PAPER and sliding * across > SLIP_MIN):
        scale = limit / sliding if sliding > 0 else 0.0
    change = 0.0
    for i in range(3):
        new = j * n[i] + scale * tangent[i]
        p[i] = new - held[i]
        held[i] = new
        change += p[i] * p[i]
    apply_to_both(bodies, joints, drivers, pair, pair["point"], p)
    return sqrt(change) * max(normal_mobility, across)

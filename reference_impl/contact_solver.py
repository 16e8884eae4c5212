"""Contacts that resolve together: accelerated projected Gauss-Seidel over their rows.

A sweep visits every row and sets its accumulated impulse so that its own law holds: no approach below its
floor, friction within the cone and against the sliding that is left. Sweeps alone take thousands to pass a
weight down a stack of five boxes, whose points share the load in more ways than one; Anderson's acceleration
takes tens. What settled ends with a sweep: every row then obeys its law.
"""

from math import sqrt

from reference_impl.anderson import begin_acceleration, extrapolate
from reference_impl.contact import apply_to_both, contact_mobility, meeting_velocity, surface_velocity
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
from reference_impl.impulse import respond
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
        _weigh_row(bodies, drivers, pairs[k], state)
        k = next_row(pairs, k, patch, count)
    begin_acceleration(state, count)
    residual = CROWD_RESIDUAL if state["crowded"] == 1 else HOLD_RESIDUAL
    sweeps = CROWD_SWEEPS if state["crowded"] == 1 else max(HOLD_SWEEPS, HOLD_VISITS // count)
    for sweep in range(sweeps):
        if sweep > 0:
            extrapolate(bodies, joints, drivers, pairs, count, patch, state)
        change, worst = 0.0, -1
        k = first_row(patch, count)
        while k >= 0:
            copy_vector(pairs[k]["held"], pairs[k]["kept"])
            moved = _relax(bodies, joints, drivers, pairs[k], state)
            if moved > change:
                change, worst = moved, k
            k = next_row(pairs, k, patch, count)
        state["counters"][COUNT_SWEEPS] += 1
        if change <= residual:
            break
    if change > state["residual"]:
        state["residual"] = change
        state["residual_body_a"], state["residual_body_b"] = pairs[worst]["body_a"], pairs[worst]["body_b"]
    return change <= residual


@kernel
def _weigh_row(bodies, drivers, pair, state):
    """How a row's impulse changes its velocity: exactly along the normal, by the mean across it."""
    m, n, response = state["mobility"], pair["normal"], pair["response"]
    contact_mobility(bodies, drivers, pair, pair["point"], m)
    response[0], response[1], response[2] = respond(m, n[0], n[1], n[2])
    along = n[0] * response[0] + n[1] * response[1] + n[2] * response[2]
    # the mean mobility across the normal: exact for spheres, a relaxation for the rest
    pair["along"], pair["across"] = 1 / along, 2 / (m[0, 0] + m[1, 1] + m[2, 2] - along)


@kernel
def _relax(bodies, joints, drivers, pair, state):
    """One row's share of a sweep; returns the change of its velocity [m/s]."""
    n, held, p, response = pair["normal"], pair["held"], state["impulse"], pair["response"]
    x, y, z = meeting_velocity(bodies, pair)
    v_n = n[0] * x + n[1] * y + n[2] * z
    if v_n >= pair["floor"] and held[0] == 0 and held[1] == 0 and held[2] == 0:
        return 0.0
    along, across = pair["along"], pair["across"]
    j_old = held[0] * n[0] + held[1] * n[1] + held[2] * n[2]
    j = max(0.0, j_old - (v_n - pair["floor"]) * along)
    # what would stop the sliding that j leaves, cut off at the cone (or always the whole cone, Eq. 10)
    step = j - j_old
    x = held[0] - across * (x + step * response[0])
    y = held[1] - across * (y + step * response[1])
    z = held[2] - across * (z + step * response[2])
    off = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - off * n[0], y - off * n[1], z - off * n[2]
    sliding, limit, scale = sqrt(x * x + y * y + z * z), pair["friction"] * j, 1.0
    if sliding > limit or (state["friction"] == FRICTION_PAPER and sliding > SLIP_MIN * across):
        scale = limit / sliding if sliding > 0 else 0.0
    p[0], p[1], p[2] = j * n[0] + scale * x, j * n[1] + scale * y, j * n[2] + scale * z
    change = 0.0
    for i in range(3):
        p[i], held[i] = p[i] - held[i], p[i]
        change += p[i] * p[i]
    apply_to_both(bodies, joints, drivers, pair, pair["point"], p)
    return sqrt(change) / min(along, across)

"""Contacts that resolve together: projected Gauss-Seidel over their rows, with accumulated impulses."""

from math import sqrt

from reference_impl.contact import apply_to_both, contact_mobility, relative_velocity, surface_velocity
from reference_impl.conventions import FRICTION_PAPER, HOLD_RESIDUAL, HOLD_SWEEPS, SLIP_MIN
from reference_impl.impulse import normal_response
from reference_impl.kernel import kernel

ALL = -2
"""In place of a patch: every row, also those without one (-1)."""


@kernel
def begin_row(bodies, pair, floor):
    pair["held"][:] = 0.0
    pair["floor"] = floor
    surface_velocity(bodies[pair["body_a"]], pair["point"], pair["before_a"])
    surface_velocity(bodies[pair["body_b"]], pair["point"], pair["before_b"])


@kernel
def settle(bodies, joints, drivers, pairs, count, patch, state):
    """Impulses that keep the rows of a patch, or ALL, at their floor: projected Gauss-Seidel with accumulated
    impulses; exact after one sweep where a body has one contact. Returns whether the sweeps converged."""
    for _ in range(HOLD_SWEEPS):
        change = 0.0
        for k in range(count):
            if patch == ALL or pairs[k]["patch"] == patch:
                change = max(change, _hold(bodies, joints, drivers, pairs[k], state))
        if change <= HOLD_RESIDUAL:
            return True
    return False


@kernel
def _hold(bodies, joints, drivers, pair, state):
    """One contact's share of a sweep; returns the change of its velocity [m/s]."""
    v, p, tangent, mobility = state["velocity"], state["impulse"], state["tangent"], state["mobility"]
    n, held, point = pair["normal"], pair["held"], pair["point"]
    v_n = relative_velocity(bodies, pair, state)
    if v_n >= pair["floor"] and held[0] == 0 and held[1] == 0 and held[2] == 0:
        return 0.0
    contact_mobility(bodies, drivers, pair, point, mobility)
    normal_mobility = normal_response(mobility, n, n[0], n[1], n[2])
    # the mean mobility across the normal: exact for spheres, a relaxation for the rest
    across = (mobility[0, 0] + mobility[1, 1] + mobility[2, 2] - normal_mobility) / 2
    j_old = held[0] * n[0] + held[1] * n[1] + held[2] * n[2]
    j = max(0.0, j_old - (v_n - pair["floor"]) / normal_mobility)
    # what would stop the sliding, cut off at the cone (or always the whole cone, Eq. 10)
    sliding = 0.0
    for i in range(3):
        tangent[i] = held[i] - j_old * n[i] - (v[i] - v_n * n[i]) / across
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
    apply_to_both(bodies, joints, drivers, pair, point, p)
    return sqrt(change) * max(normal_mobility, across)

"""Anderson's acceleration of the sweeps over contacts (Anderson 1965; Walker & Ni 2011, type II).

A sweep takes the impulses x to s(x); f = s(x) - x is its step. Of the last sweeps the differences dS of s and
dF of f are kept. The next sweep starts from s - dS g, with g the least squares of |f - dF g|: where sweeps
act linearly, as they do once it is settled which contacts slide and which lift off, that is as good as GMRES.
A step that grew means that this changed: what was kept is forgotten.
"""

from math import sqrt

from reference_impl.contact import apply_to_both
from reference_impl.contact_patch import first_row, next_row
from reference_impl.conventions import (
    ANDERSON_FEW,
    ANDERSON_GROWTH,
    ANDERSON_ROWS,
    ANDERSON_SHORT,
    ANDERSON_SPAN,
    ANDERSON_WEIGHT,
)
from reference_impl.kernel import kernel


@kernel
def begin_acceleration(state, count):
    """Before the first sweep over so many rows: nothing is kept."""
    state["span"] = ANDERSON_SPAN if count <= ANDERSON_FEW else ANDERSON_SHORT
    state["steps"] = 0
    state["step_size"] = 0.0


@kernel
def extrapolate(bodies, joints, drivers, pairs, count, patch, state):
    """After a sweep from `kept` to `held`: take the rows of a patch, or ALL, to where the next one starts.

    More rows than ANDERSON_ROWS are left as the sweep left them.
    """
    if count > ANDERSON_ROWS:
        return
    size = _keep_step(pairs, count, patch, state)
    if size > ANDERSON_GROWTH * state["step_size"] and state["steps"] > 1:
        # this step alone is the start of a new row of differences
        state["steps"] = 1
    state["step_size"] = size
    span = min(state["steps"] - 1, state["span"])
    if span < 1 or not _solve_weights(state, span):
        return
    g, p, changes = state["weight"], state["impulse"], state["answer_change"]
    row, k = 0, first_row(patch, count)
    while k >= 0:
        x = y = z = 0.0
        for t in range(span):
            x -= g[t] * changes[t, row, 0]
            y -= g[t] * changes[t, row, 1]
            z -= g[t] * changes[t, row, 2]
        if x != 0 or y != 0 or z != 0:
            p[0], p[1], p[2] = x, y, z
            for i in range(3):
                pairs[k]["held"][i] += p[i]
            apply_to_both(bodies, joints, drivers, pairs[k], pairs[k]["point"], p)
        row, k = row + 1, next_row(pairs, k, patch, count)


@kernel
def _keep_step(pairs, count, patch, state):
    """Keep the differences from the last sweep to this one, and their products; returns |f|."""
    span = min(state["steps"], state["span"])
    slot = (state["steps"] - 1) % state["span"]
    step, answer = state["last_step"], state["last_answer"]
    size, row, k = 0.0, 0, first_row(patch, count)
    while k >= 0:
        held, kept = pairs[k]["held"], pairs[k]["kept"]
        for i in range(3):
            change = held[i] - kept[i]
            size += change * change
            if span > 0:
                state["step_change"][slot, row, i] = change - step[row, i]
                state["answer_change"][slot, row, i] = held[i] - answer[row, i]
            step[row, i], answer[row, i] = change, held[i]
        row, k = row + 1, next_row(pairs, k, patch, count)
    products, changes = state["step_product"], state["step_change"]
    for t in range(span):
        # sums along x, y and z, which do not wait for each other
        a0 = a1 = a2 = b0 = b1 = b2 = 0.0
        for r in range(row):
            x, y, z = changes[t, r, 0], changes[t, r, 1], changes[t, r, 2]
            a0, b0 = a0 + x * changes[slot, r, 0], b0 + x * step[r, 0]
            a1, b1 = a1 + y * changes[slot, r, 1], b1 + y * step[r, 1]
            a2, b2 = a2 + z * changes[slot, r, 2], b2 + z * step[r, 2]
        products[slot, t] = products[t, slot] = a0 + a1 + a2
        state["step_slope"][t] = b0 + b1 + b2
    state["steps"] += 1
    return sqrt(size)


@kernel
def _solve_weights(state, span):
    """Weights g of the normal equations, by Cholesky's factors in place; whether they exist."""
    products, factor, g = state["step_product"], state["step_factor"], state["weight"]
    trace = 0.0
    for t in range(span):
        trace += products[t, t]
    if trace <= 0:
        return False
    for i in range(span):
        total = state["step_slope"][i]
        for j in range(i + 1):
            entry = products[i, j] + (ANDERSON_WEIGHT * trace if i == j else 0.0)
            for k in range(j):
                entry -= factor[i, k] * factor[j, k]
            if i == j:
                if entry <= 0:
                    return False
                factor[i, i] = sqrt(entry)
            else:
                factor[i, j] = entry / factor[j, j]
                total -= factor[i, j] * g[j]
        g[i] = total / factor[i, i]
    for i in range(span - 1, -1, -1):
        for k in range(i + 1, span):
            g[i] -= factor[k, i] * g[k]
        g[i] /= factor[i, i]
    return True

"""Matrix with six unknowns per mover in a symmetric envelope: ordering, LU factorisation and solution.

Row i of the lower half and column i of the upper half store their entries from `begin[i]` to the diagonal;
the factorisation causes no fill-in outside (Jennings 1966). Movers are ordered breadth first from an end of
the island (Cuthill & McKee 1969), which keeps rows short.
"""

import numpy as np

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.solver_conventions import NEWTON_INNER, NEWTON_WORK
from touchstone.reference_impl.core.solver_dtypes import NEWTON_ENTRIES, NEWTON_MOVERS, NEWTON_ROWS

ONE, TWO, THREE, FOUR, FIVE = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5)
"""Unsigned: with a signed literal, an unsigned index would become a floating-point number."""


@kernel
def lay_out(solver):
    """Order the movers, lay out the envelope and set the solver's `work`, once per solve: it is 0 before.
    Returns whether the island fits."""
    movers, count = solver["movers"], solver["mover_count"]
    if solver["work"] != 0:
        return solver["work"] > 0
    solver["work"] = -1.0
    if count > NEWTON_MOVERS or solver["row_count"] > NEWTON_ROWS:
        return False
    # the last mover of a first ordering is an end of the island
    end = _order_from(solver, 0)
    _order_from(solver, end)
    for m in range(count):
        movers[m]["first_place"] = movers[m]["place"]
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        if row["a"] >= 0 and row["b"] >= 0:
            a, b = movers[row["a"]], movers[row["b"]]
            a["first_place"] = min(a["first_place"], b["place"])
            b["first_place"] = min(b["first_place"], a["place"])
    used, work = 0, 0.0
    for place in range(count):
        begin = 6 * movers[solver["order"][place]]["first_place"]
        for i in range(6 * place, 6 * place + 6):
            length = i - begin + 1
            if used + length > NEWTON_ENTRIES:
                return False
            solver["begin"][i], solver["offset"][i] = begin, used - begin
            used += length
            work += length * length
    # an outer iteration of Newton's method would exceed the frame's budget
    if NEWTON_INNER * work > NEWTON_WORK:
        return False
    solver["work"] = work
    return True


@kernel
def _order_from(solver, first):
    """Order the movers breadth first from one of them; returns the last."""
    movers, order, count = solver["movers"], solver["order"], solver["mover_count"]
    for m in range(count):
        movers[m]["place"] = -1
    order[0], movers[first]["place"], listed = first, 0, 1
    for place in range(count):
        m = order[place]
        for k in range(solver["row_count"]):
            a, b = solver["rows"][k]["a"], solver["rows"][k]["b"]
            other = b if a == m else (a if b == m else -1)
            if other >= 0 and movers[other]["place"] < 0:
                order[listed], movers[other]["place"] = other, listed
                listed += 1
    return order[count - 1]


@kernel
def add_block(solver, entries, transposed, p, q, r_p, r_q, sign):
    """Add sign J_p^T K J_q of one row, where K is `kernel`, to the block of places p >= q.

    For the upper half, which is stored by columns, K is transposed.
    """
    matrix, block, offset = solver["kernel"], solver["block"], solver["offset"]
    for j in range(3):
        if transposed:
            x, y, z = matrix[j, 0], matrix[j, 1], matrix[j, 2]
        else:
            x, y, z = matrix[0, j], matrix[1, j], matrix[2, j]
        x, y, z = sign * x, sign * y, sign * z
        block[0, j], block[1, j], block[2, j] = x, y, z
        block[3, j] = r_p[1] * z - r_p[2] * y
        block[4, j] = r_p[2] * x - r_p[0] * z
        block[5, j] = r_p[0] * y - r_p[1] * x
    for i in range(6):
        x, y, z = block[i, 0], block[i, 1], block[i, 2]
        at = np.uint64(offset[6 * p + i] + 6 * q)
        # only half of a diagonal block is stored
        stop = i if p == q else 5
        entries[at] += x
        if stop >= 1:
            entries[at + ONE] += y
        if stop >= 2:
            entries[at + TWO] += z
        if stop >= 3:
            entries[at + THREE] += r_q[1] * z - r_q[2] * y
        if stop >= 4:
            entries[at + FOUR] += r_q[2] * x - r_q[0] * z
        if stop >= 5:
            entries[at + FIVE] += r_q[0] * y - r_q[1] * x


@inlined_kernel
def _dot(one, p, two, q, count):
    """Sum of one[p + k] two[q + k], as four independent sums for instruction-level parallelism.

    The arrays are slices: fields of different lengths have different types, slices have one.
    Indices are unsigned: Numba tests signed ones for negative values, which doubles the time.
    """
    a = b = c = d = 0.0
    i, j = np.uint64(p), np.uint64(q)
    end = i + np.uint64(count)
    while i + FOUR <= end:
        a += one[i] * two[j]
        b += one[i + ONE] * two[j + ONE]
        c += one[i + TWO] * two[j + TWO]
        d += one[i + THREE] * two[j + THREE]
        i, j = i + FOUR, j + FOUR
    while i < end:
        a += one[i] * two[j]
        i, j = i + ONE, j + ONE
    return (a + b) + (c + d)


@inlined_kernel
def _subtract_product(one, p, two, q, count, factor):
    """Subtract factor two[q + k] from one[p + k]; indices are unsigned, as in `_dot`."""
    i, j = np.uint64(p), np.uint64(q)
    end = i + np.uint64(count)
    while i < end:
        one[i] -= factor * two[j]
        i, j = i + ONE, j + ONE


@kernel
def factorise(solver):
    """Factorise into L U in place without pivoting; L has a unit diagonal."""
    lower, upper, offset, begin = solver["lower"][:], solver["upper"][:], solver["offset"], solver["begin"]
    for i in range(6 * solver["mover_count"]):
        row, first = offset[i], begin[i]
        for j in range(first, i):
            low, other = max(first, begin[j]), offset[j]
            upper[row + j] -= _dot(lower, other + low, upper, row + low, j - low)
            value = lower[row + j] - _dot(lower, row + low, upper, other + low, j - low)
            lower[row + j] = value / lower[other + j]
        whole = lower[row + i]
        pivot = whole - _dot(lower, row + first, upper, row + first, i - first)
        # replace a pivot that rounding has cancelled
        lower[row + i] = pivot if abs(pivot) > 1e-16 * whole else 1e-16 * whole


@kernel
def solve_factors(solver):
    """Solve for the step: minus the inverse of the matrix times the gradient."""
    lower, upper, x = solver["lower"][:], solver["upper"][:], solver["step"][:]
    offset, begin = solver["offset"], solver["begin"]
    size = 6 * solver["mover_count"]
    for i in range(size):
        first = begin[i]
        x[i] = -solver["gradient"][i] - _dot(lower, offset[i] + first, x, first, i - first)
    for i in range(size - 1, -1, -1):
        x[i] /= lower[offset[i] + i]
        first = begin[i]
        _subtract_product(x, first, upper, offset[i] + first, i - first, x[i])


@kernel
def begin_matrix(solver):
    """Set the matrix to the masses and inertias M of the movers."""
    movers, lower, upper, offset = solver["movers"], solver["lower"], solver["upper"], solver["offset"]
    last = 6 * solver["mover_count"] - 1
    for i in range(offset[last] + last + 1):
        lower[i] = upper[i] = 0.0
    for m in range(solver["mover_count"]):
        base, inertia = 6 * movers[m]["place"], movers[m]["inertia"]
        for i in range(3):
            lower[offset[base + i] + base + i] = 1 / movers[m]["inverse_mass"]
            row = offset[base + 3 + i] + base + 3
            for j in range(i + 1):
                lower[row + j] = upper[row + j] = inertia[i, j]


@kernel
def add_row(solver, row):
    """Add J^T K J of one row to the matrix, where K is `kernel`."""
    movers, lower, upper = solver["movers"], solver["lower"], solver["upper"]
    p = movers[row["b"]]["place"] if row["b"] >= 0 else -1
    q = movers[row["a"]]["place"] if row["a"] >= 0 else -1
    for transposed in (False, True):
        half = upper if transposed else lower
        if p >= 0:
            add_block(solver, half, transposed, p, p, row["r_b"], row["r_b"], 1.0)
        if q >= 0:
            add_block(solver, half, transposed, q, q, row["r_a"], row["r_a"], 1.0)
        if p >= 0 and q >= 0:
            if p > q:
                add_block(solver, half, transposed, p, q, row["r_b"], row["r_a"], -1.0)
            else:
                add_block(solver, half, transposed, q, p, row["r_a"], row["r_b"], -1.0)


@kernel
def subtract_impulse(solver, row, px, py, pz):
    """Subtract J^T p of a row from the gradient."""
    g, movers = solver["gradient"], solver["movers"]
    if row["b"] >= 0:
        _subtract(g, 6 * movers[row["b"]]["place"], row["r_b"], px, py, pz)
    if row["a"] >= 0:
        _subtract(g, 6 * movers[row["a"]]["place"], row["r_a"], -px, -py, -pz)


@kernel
def _subtract(g, base, r, px, py, pz):
    """Subtract J^T p of one mover of a row from g."""
    g[base] -= px
    g[base + 1] -= py
    g[base + 2] -= pz
    g[base + 3] -= r[1] * pz - r[2] * py
    g[base + 4] -= r[2] * px - r[0] * pz
    g[base + 5] -= r[0] * py - r[1] * px


@kernel
def set_rates(solver):
    """Compute the change of the rows' velocities along the step."""
    step, movers = solver["step"], solver["movers"]
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        d = row["rate"]
        d[:] = 0.0
        if row["b"] >= 0:
            _add_rate(step, 6 * movers[row["b"]]["place"], row["r_b"], 1.0, d)
        if row["a"] >= 0:
            _add_rate(step, 6 * movers[row["a"]]["place"], row["r_a"], -1.0, d)


@kernel
def _add_rate(step, base, r, sign, out_rate):
    """Add the change of a row's velocity by the step of one of its movers."""
    x, y, z = step[base + 3], step[base + 4], step[base + 5]
    out_rate[0] += sign * (step[base] + y * r[2] - z * r[1])
    out_rate[1] += sign * (step[base + 1] + z * r[0] - x * r[2])
    out_rate[2] += sign * (step[base + 2] + x * r[1] - y * r[0])

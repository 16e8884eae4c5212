"""Matrix with six unknowns per mover in sparse blocks: LU factorisation and solution.

The matrix consists of blocks of 6 x 6, one per pair of movers that `elimination_order` joins, in its slots. A
slot stores two blocks from entry 36 s of their half: the upper one (k, p) by rows, the lower one (p, k)
transposed. So all loops of the factorisation run along rows of six contiguous entries.
"""

import numpy as np

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel, vectorised_kernel
from touchstone.reference_impl.core.solver_dtypes import NEWTON_BLOCKS, NEWTON_MOVERS, NEWTON_ROWS
from touchstone.reference_impl.solver.elimination_order import is_near, order_movers, slot
from touchstone.reference_impl.solver.link_rows import add_blocks, add_link_rate, subtract_from_link

ONE, TWO, THREE, FOUR, FIVE = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5)
"""Unsigned: with a signed literal, an unsigned index would become a floating-point number. Numba tests signed
indices for negative values, which doubles the time."""


@kernel
def lay_out(solver, state):
    """Order the movers, lay out the matrix and set the solver's `work`, once per solve: it is 0 before, and
    -1 for an island that is too large, or in a frame that has used twice its `frame_work`. Returns whether
    the matrix may be factorised."""
    count = solver["mover_count"]
    if state["work_left"] < -state["frame_work"]:
        solver["work"] = -1.0
    if solver["work"] != 0:
        return solver["work"] > 0
    solver["work"] = -1.0
    if count > NEWTON_MOVERS or solver["row_count"] > NEWTON_ROWS:
        return False
    order_movers(solver)
    used, work = 0, 0.0
    for k in range(count):
        m = solver["order"][k]
        solver["begin"][k], wide = used, 1 + solver["degree"][m]
        if used + wide > NEWTON_BLOCKS:
            return False
        for p in range(k, count):
            if p == k or is_near(solver, m, solver["order"][p]):
                solver["slot_row"][used] = p
                used += 1
        work += 216.0 * wide * wide
    solver["begin"][count] = used
    if work > state["factor_work"]:
        return False
    solver["work"] = work
    return True


@inlined_kernel
def _own(solver, p):
    """First entry of the diagonal block of a place."""
    return np.uint64(36 * solver["begin"][p])


@kernel
def begin_matrix(solver):
    """Set the matrix to the masses and inertias M of the movers."""
    movers, lower, upper, count = solver["movers"], solver["lower"], solver["upper"], solver["mover_count"]
    for i in range(_own(solver, count)):
        lower[i] = upper[i] = 0.0
    for m in range(count):
        at, inertia = _own(solver, movers[m]["place"]), movers[m]["inertia"]
        for i in range(3):
            lower[at + np.uint64(7 * i)] = 1 / movers[m]["inverse_mass"]
            for j in range(3):
                lower[at + np.uint64(6 * i + j + 21)] = inertia[i, j]


@vectorised_kernel
def add_row(solver, row):
    """Add J^T K J of one row to the matrix, where K is `kernel`."""
    movers, lower, upper = solver["movers"], solver["lower"], solver["upper"]
    if row["link_a"] >= 0 or row["link_b"] >= 0:
        add_blocks(solver, row)
        return
    p = movers[row["b"]]["place"] if row["b"] >= 0 else -1
    q = movers[row["a"]]["place"] if row["a"] >= 0 else -1
    if p >= 0:
        _add_block(lower, _own(solver, p), row["r_b"], 1.0, _times_jacobian(solver, row["r_b"], False))
    if q >= 0:
        _add_block(lower, _own(solver, q), row["r_a"], 1.0, _times_jacobian(solver, row["r_a"], False))
    if p >= 0 and q >= 0:
        at = slot(solver, max(p, q), min(p, q))
        first, second = (row["r_a"], row["r_b"]) if p > q else (row["r_b"], row["r_a"])
        _add_block(upper, at, first, -1.0, _times_jacobian(solver, second, False))
        _add_block(lower, at, first, -1.0, _times_jacobian(solver, second, True))


@inlined_kernel
def _times_jacobian(solver, r, transposed):
    """Three rows of K J for the lever r, where K is `kernel` or its transpose."""
    k = solver["kernel"]
    if transposed:
        return (
            _with_moment(k[0, 0], k[1, 0], k[2, 0], r),
            _with_moment(k[0, 1], k[1, 1], k[2, 1], r),
            _with_moment(k[0, 2], k[1, 2], k[2, 2], r),
        )
    return (
        _with_moment(k[0, 0], k[0, 1], k[0, 2], r),
        _with_moment(k[1, 0], k[1, 1], k[1, 2], r),
        _with_moment(k[2, 0], k[2, 1], k[2, 2], r),
    )


@inlined_kernel
def _with_moment(x, y, z, r):
    """A vector and its moment at the lever r."""
    return x, y, z, r[1] * z - r[2] * y, r[2] * x - r[0] * z, r[0] * y - r[1] * x


@inlined_kernel
def _add_block(entries, at, r, sign, rows):
    """Add sign J^T times three rows of six entries, for the lever r, to the block at an entry."""
    one, two, three = rows
    x, y, z = sign * r[0], sign * r[1], sign * r[2]
    _add_six(entries, at, sign, one)
    _add_six(entries, at + np.uint64(6), sign, two)
    _add_six(entries, at + np.uint64(12), sign, three)
    _add_moment(entries, at + np.uint64(18), y, three, z, two)
    _add_moment(entries, at + np.uint64(24), z, one, x, three)
    _add_moment(entries, at + np.uint64(30), x, two, y, one)


@inlined_kernel
def _add_six(entries, at, x, row):
    """Add a row times a factor to six contiguous entries."""
    entries[at] += x * row[0]
    entries[at + ONE] += x * row[1]
    entries[at + TWO] += x * row[2]
    entries[at + THREE] += x * row[3]
    entries[at + FOUR] += x * row[4]
    entries[at + FIVE] += x * row[5]


@inlined_kernel
def _add_moment(entries, at, x, one, y, two):
    """Add x times one row and subtract y times another at six contiguous entries."""
    entries[at] += x * one[0] - y * two[0]
    entries[at + ONE] += x * one[1] - y * two[1]
    entries[at + TWO] += x * one[2] - y * two[2]
    entries[at + THREE] += x * one[3] - y * two[3]
    entries[at + FOUR] += x * one[4] - y * two[4]
    entries[at + FIVE] += x * one[5] - y * two[5]


@vectorised_kernel
def factorise(solver):
    """Factorise into L U in place without pivoting; L has a unit diagonal, that of U is stored inverted."""
    lower, upper, begin, row = solver["lower"], solver["upper"], solver["begin"], solver["slot_row"]
    # the upper half has no diagonal blocks: it stores the diagonal
    for k in range(solver["mover_count"]):
        own = _own(solver, k)
        for i in range(6):
            upper[own + np.uint64(i)] = lower[own + np.uint64(7 * i)]
    for k in range(solver["mover_count"]):
        own, first, end = _own(solver, k), begin[k] + 1, begin[k + 1]
        _factorise_block(lower, own, upper)
        for s in range(first, end):
            _divide(upper, np.uint64(36 * s), lower, own, True)
            _divide(lower, np.uint64(36 * s), lower, own, False)
        for s in range(first, end):
            one, target = np.uint64(36 * s), begin[row[s]]
            _subtract_product(lower, np.uint64(36 * target), lower, one, upper, one)
            for t in range(s + 1, end):
                # column row[s] has all later rows of column k
                while row[target] != row[t]:
                    target += 1
                at, two = np.uint64(36 * target), np.uint64(36 * t)
                _subtract_product(upper, at, lower, one, upper, two)
                _subtract_product(lower, at, upper, one, lower, two)


@inlined_kernel
def _six(entries, at):
    """Six contiguous entries."""
    return (
        entries[at],
        entries[at + ONE],
        entries[at + TWO],
        entries[at + THREE],
        entries[at + FOUR],
        entries[at + FIVE],
    )


@inlined_kernel
def _set_six(out, at, row, factor):
    """Set six contiguous entries to a row times a factor."""
    out[at], out[at + ONE], out[at + TWO] = factor * row[0], factor * row[1], factor * row[2]
    out[at + THREE], out[at + FOUR], out[at + FIVE] = factor * row[3], factor * row[4], factor * row[5]


@inlined_kernel
def _minus(row, factor, entries, at):
    """A row minus a factor times six contiguous entries."""
    a, b, c, d, e, f = _six(entries, at)
    return (
        row[0] - factor * a,
        row[1] - factor * b,
        row[2] - factor * c,
        row[3] - factor * d,
        row[4] - factor * e,
        row[5] - factor * f,
    )


@inlined_kernel
def _subtract_product(out, at, one, p, two, q):
    """Subtract A^T B of the blocks A at one[p] and B at two[q] from the block at out[at]."""
    for i in range(6):
        row = _six(out, at + np.uint64(6 * i))
        for k in range(6):
            row = _minus(row, one[p + np.uint64(6 * k + i)], two, q + np.uint64(6 * k))
        _set_six(out, at + np.uint64(6 * i), row, 1.0)


@inlined_kernel
def _divide(out, at, factors, diagonal, by_lower):
    """Multiply the block at out[at] by L^-1 or, otherwise, by U^-T of the factorised block at a diagonal."""
    for i in range(6):
        row = _six(out, at + np.uint64(6 * i))
        for k in range(i):
            factor = factors[diagonal + np.uint64(6 * i + k if by_lower else 6 * k + i)]
            row = _minus(row, factor, out, at + np.uint64(6 * k))
        _set_six(out, at + np.uint64(6 * i), row, 1.0 if by_lower else factors[diagonal + np.uint64(7 * i)])


@inlined_kernel
def _factorise_block(lower, at, upper):
    """Factorise a diagonal block, whose diagonal before the factorisation is stored at upper[at]."""
    for i in range(6):
        row = at + np.uint64(6 * i)
        for k in range(i):
            other = at + np.uint64(6 * k)
            factor = lower[row + np.uint64(k)] * lower[other + np.uint64(k)]
            lower[row + np.uint64(k)] = factor
            for j in range(k + 1, 6):
                lower[row + np.uint64(j)] -= factor * lower[other + np.uint64(j)]
        # replace a pivot that rounding has cancelled
        pivot, least = lower[row + np.uint64(i)], 1e-16 * upper[at + np.uint64(i)]
        lower[row + np.uint64(i)] = 1 / (pivot if abs(pivot) > least else least)


@vectorised_kernel
def solve_factors(solver):
    """Solve for the step: minus the inverse of the matrix times the gradient."""
    lower, upper, begin, x = solver["lower"], solver["upper"], solver["begin"], solver["step"]
    row, count = solver["slot_row"], solver["mover_count"]
    for i in range(6 * count):
        x[i] = -solver["gradient"][i]
    for k in range(count):
        own, base = _own(solver, k), np.uint64(6 * k)
        for i in range(6):
            for j in range(i):
                x[base + np.uint64(i)] -= lower[own + np.uint64(6 * i + j)] * x[base + np.uint64(j)]
        for s in range(begin[k] + 1, begin[k + 1]):
            _subtract_transposed(x, np.uint64(6 * row[s]), lower, np.uint64(36 * s), base)
    for k in range(count - 1, -1, -1):
        own, base = _own(solver, k), np.uint64(6 * k)
        for s in range(begin[k] + 1, begin[k + 1]):
            _subtract_rows(x, base, upper, np.uint64(36 * s), np.uint64(6 * row[s]))
        for i in range(5, -1, -1):
            for j in range(i + 1, 6):
                x[base + np.uint64(i)] -= lower[own + np.uint64(6 * i + j)] * x[base + np.uint64(j)]
            x[base + np.uint64(i)] *= lower[own + np.uint64(7 * i)]


@inlined_kernel
def _subtract_transposed(x, base, entries, at, other):
    """Subtract a transposed block times x[other:] from x[base:]."""
    for k in range(6):
        factor, row = x[other + np.uint64(k)], at + np.uint64(6 * k)
        for i in range(6):
            x[base + np.uint64(i)] -= factor * entries[row + np.uint64(i)]


@inlined_kernel
def _subtract_rows(x, base, entries, at, other):
    """Subtract a block times x[other:] from x[base:]."""
    a, b, c = x[other], x[other + ONE], x[other + TWO]
    d, e, f = x[other + THREE], x[other + FOUR], x[other + FIVE]
    for i in range(6):
        row = at + np.uint64(6 * i)
        early = a * entries[row] + b * entries[row + ONE] + c * entries[row + TWO]
        late = d * entries[row + THREE] + e * entries[row + FOUR] + f * entries[row + FIVE]
        x[base + np.uint64(i)] -= early + late


@kernel
def subtract_impulse(solver, row, px, py, pz):
    """Subtract J^T p of a row from the gradient."""
    g, movers = solver["gradient"], solver["movers"]
    if row["b"] >= 0:
        _subtract(g, 6 * movers[row["b"]]["place"], row["r_b"], px, py, pz)
    if row["a"] >= 0:
        _subtract(g, 6 * movers[row["a"]]["place"], row["r_a"], -px, -py, -pz)
    if row["link_b"] >= 0:
        subtract_from_link(solver, row["link_b"], row["r_b"], px, py, pz)
    if row["link_a"] >= 0:
        subtract_from_link(solver, row["link_a"], row["r_a"], -px, -py, -pz)


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
        if row["link_b"] >= 0:
            add_link_rate(solver, row["link_b"], row["r_b"], 1.0, d)
        if row["link_a"] >= 0:
            add_link_rate(solver, row["link_a"], row["r_a"], -1.0, d)


@kernel
def _add_rate(step, base, r, sign, out_rate):
    """Add the change of a row's velocity by the step of one of its movers."""
    x, y, z = step[base + 3], step[base + 4], step[base + 5]
    out_rate[0] += sign * (step[base] + y * r[2] - z * r[1])
    out_rate[1] += sign * (step[base + 1] + z * r[0] - x * r[2])
    out_rate[2] += sign * (step[base + 2] + x * r[1] - y * r[0])

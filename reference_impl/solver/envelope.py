"""Matrix with six unknowns per mover in a symmetric envelope: ordering, LU factorisation and solution.

The matrix consists of blocks of 6 x 6, one per pair of movers. Mover p has the blocks (p, q) of the lower
half and (q, p) of the upper half for q from `begin[p]` to p; the factorisation causes no fill-in outside
(Jennings 1966). Movers are ordered breadth first from an end of the island (Cuthill & McKee 1969): the
envelope stays narrow.

Both blocks are stored from entry 36 (offset[p] + q) of their half: those of the upper half by rows, those of
the lower half transposed. So all loops of the factorisation run along rows of six contiguous entries.
"""

import numpy as np

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel, vectorised_kernel
from touchstone.reference_impl.core.solver_dtypes import NEWTON_BLOCKS, NEWTON_MOVERS, NEWTON_ROWS
from touchstone.reference_impl.solver.link_rows import (
    add_blocks,
    add_link_rate,
    lower_first_places,
    order_all,
    order_next,
    subtract_from_link,
    touches,
)
from touchstone.reference_impl.solver.tolerances import NEWTON_INNER, NEWTON_WORK

ONE, TWO, THREE, FOUR, FIVE = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5)
"""Unsigned: with a signed literal, an unsigned index would become a floating-point number. Numba tests signed
indices for negative values, which doubles the time."""


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
        if row["link_a"] >= 0 or row["link_b"] >= 0:
            lower_first_places(solver, row)
    used, work = 0, 0.0
    for place in range(count):
        begin = movers[solver["order"][place]]["first_place"]
        if used + place - begin + 1 > NEWTON_BLOCKS:
            return False
        solver["begin"][place], solver["offset"][place] = begin, used - begin
        used += place - begin + 1
        for i in range(6 * (place - begin) + 1, 6 * (place - begin) + 7):
            work += i * i
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
        # links of one driver that touch move apart by its hinges alone: no row moves its root
        if place == listed:
            listed = order_next(solver, listed)
        m = order[place]
        for k in range(solver["row_count"]):
            a, b = solver["rows"][k]["a"], solver["rows"][k]["b"]
            other = b if a == m else (a if b == m else -1)
            if other >= 0 and movers[other]["place"] < 0:
                order[listed], movers[other]["place"] = other, listed
                listed += 1
            if solver["link_count"] > 0 and touches(solver, solver["rows"][k], m):
                listed = order_all(solver, solver["rows"][k], listed)
    return order[count - 1]


@inlined_kernel
def _entry(solver, p, q):
    """First entry of the blocks (p, q) and (q, p), p >= q, in their halves."""
    return np.uint64(36 * (solver["offset"][p] + q))


@kernel
def begin_matrix(solver):
    """Set the matrix to the masses and inertias M of the movers."""
    movers, lower, upper, count = solver["movers"], solver["lower"], solver["upper"], solver["mover_count"]
    for i in range(_entry(solver, count - 1, count)):
        lower[i] = upper[i] = 0.0
    for m in range(count):
        at, inertia = _entry(solver, movers[m]["place"], movers[m]["place"]), movers[m]["inertia"]
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
        _add_block(lower, _entry(solver, p, p), row["r_b"], 1.0, _times_jacobian(solver, row["r_b"], False))
    if q >= 0:
        _add_block(lower, _entry(solver, q, q), row["r_a"], 1.0, _times_jacobian(solver, row["r_a"], False))
    if p >= 0 and q >= 0:
        at = _entry(solver, max(p, q), min(p, q))
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
    lower, upper, begin = solver["lower"], solver["upper"], solver["begin"]
    for p in range(solver["mover_count"]):
        own = _entry(solver, p, p)
        # the upper half has no diagonal blocks: it stores the diagonal
        for i in range(6):
            upper[own + np.uint64(i)] = lower[own + np.uint64(7 * i)]
        for q in range(begin[p], p):
            at = _entry(solver, p, q)
            for k in range(max(begin[p], begin[q]), q):
                _subtract_product(upper, at, lower, _entry(solver, q, k), upper, _entry(solver, p, k))
                _subtract_product(lower, at, upper, _entry(solver, q, k), lower, _entry(solver, p, k))
            _divide(upper, at, lower, _entry(solver, q, q), True)
            _divide(lower, at, lower, _entry(solver, q, q), False)
        for q in range(begin[p], p):
            at = _entry(solver, p, q)
            _subtract_product(lower, own, lower, at, upper, at)
        _factorise_block(lower, own, upper)


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
    count = solver["mover_count"]
    for p in range(count):
        own, base = _entry(solver, p, p), np.uint64(6 * p)
        for i in range(6):
            x[base + np.uint64(i)] = -solver["gradient"][base + np.uint64(i)]
        for q in range(begin[p], p):
            _subtract_transposed(x, base, lower, _entry(solver, p, q), np.uint64(6 * q))
        for i in range(6):
            for k in range(i):
                x[base + np.uint64(i)] -= lower[own + np.uint64(6 * i + k)] * x[base + np.uint64(k)]
    for p in range(count - 1, -1, -1):
        own, base = _entry(solver, p, p), np.uint64(6 * p)
        for i in range(5, -1, -1):
            for k in range(i + 1, 6):
                x[base + np.uint64(i)] -= lower[own + np.uint64(6 * i + k)] * x[base + np.uint64(k)]
            x[base + np.uint64(i)] *= lower[own + np.uint64(7 * i)]
        for q in range(begin[p], p):
            _subtract_rows(x, np.uint64(6 * q), upper, _entry(solver, p, q), base)


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

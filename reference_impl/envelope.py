"""Symmetric matrix of six unknowns a mover, in the envelope of its rows: order, L D L^T, and solution.

Row i holds its entries from column `begin[i]` to the diagonal; factors fill nothing outside (Jennings 1966).
Movers are ordered breadth first from an end of the island (Cuthill & McKee 1969), which keeps rows short.
"""

from reference_impl.kernel import inlined_kernel, kernel
from reference_impl.solver_records import NEWTON_ENTRIES, NEWTON_MOVERS, NEWTON_ROWS


@kernel
def lay_out(solver):
    """Order the movers and lay out the envelope; returns the multiplications of a factorisation, or -1 where
    the island is too large."""
    movers, count = solver["movers"], solver["mover_count"]
    if count > NEWTON_MOVERS or solver["row_count"] > NEWTON_ROWS:
        return -1.0
    # the last of a first pass is an end of the island
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
                return -1.0
            solver["begin"][i], solver["offset"][i] = begin, used - begin
            used += length
            work += length * length / 2
    return work


@kernel
def _order_from(solver, first):
    """Breadth-first order of the movers from one of them; returns the last."""
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
def add_block(solver, p, q, r_p, r_q, sign):
    """Add sign J_p^T K J_q of one row, K being `kernel`, to the block of places p >= q."""
    kernel_matrix, block, entries, offset = (
        solver["kernel"],
        solver["block"],
        solver["entries"],
        solver["offset"],
    )
    for j in range(3):
        x, y, z = sign * kernel_matrix[0, j], sign * kernel_matrix[1, j], sign * kernel_matrix[2, j]
        block[0, j], block[1, j], block[2, j] = x, y, z
        block[3, j] = r_p[1] * z - r_p[2] * y
        block[4, j] = r_p[2] * x - r_p[0] * z
        block[5, j] = r_p[0] * y - r_p[1] * x
    for i in range(6):
        x, y, z = block[i, 0], block[i, 1], block[i, 2]
        start = offset[6 * p + i] + 6 * q
        # of a diagonal block the lower half
        stop = i + 1 if p == q else 6
        for j in range(stop):
            if j == 0:
                value = x
            elif j == 1:
                value = y
            elif j == 2:
                value = z
            elif j == 3:
                value = r_q[1] * z - r_q[2] * y
            elif j == 4:
                value = r_q[2] * x - r_q[0] * z
            else:
                value = r_q[0] * y - r_q[1] * x
            entries[start + j] += value


@inlined_kernel
def _dot(entries, p, q, count):
    """Sum of entries[p + k] entries[q + k]; four sums that do not wait for each other."""
    a = b = c = d = 0.0
    k = 0
    while k + 4 <= count:
        a += entries[p + k] * entries[q + k]
        b += entries[p + k + 1] * entries[q + k + 1]
        c += entries[p + k + 2] * entries[q + k + 2]
        d += entries[p + k + 3] * entries[q + k + 3]
        k += 4
    while k < count:
        a += entries[p + k] * entries[q + k]
        k += 1
    return (a + b) + (c + d)


@kernel
def factorise(solver):
    """L D L^T in place: D on the diagonal, L below it."""
    entries, offset, begin = solver["entries"], solver["offset"], solver["begin"]
    for i in range(6 * solver["mover_count"]):
        row, first = offset[i], begin[i]
        for j in range(first, i):
            low = max(first, begin[j])
            entries[row + j] -= _dot(entries, row + low, offset[j] + low, j - low)
        diagonal = entries[row + i]
        for k in range(first, i):
            scaled = entries[row + k] / entries[offset[k] + k]
            diagonal -= scaled * entries[row + k]
            entries[row + k] = scaled
        # the matrix is no less than the masses: what rounding takes below that is put back
        entries[row + i] = max(diagonal, 1e-16 * entries[row + i])


@kernel
def solve_factors(solver):
    """The step: minus the inverse times the gradient."""
    entries, offset, begin, x = solver["entries"], solver["offset"], solver["begin"], solver["step"]
    size = 6 * solver["mover_count"]
    for i in range(size):
        total = -solver["gradient"][i]
        for k in range(begin[i], i):
            total -= entries[offset[i] + k] * x[k]
        x[i] = total
    for i in range(size):
        x[i] /= entries[offset[i] + i]
    for i in range(size - 1, -1, -1):
        for k in range(begin[i], i):
            x[k] -= entries[offset[i] + k] * x[i]

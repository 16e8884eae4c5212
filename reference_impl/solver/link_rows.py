"""Rows of the contact solver on links that hinges move: their part of velocities, impulses and the matrix.

The hinges of a driver's chains are blocks of six coordinates of unit mass (`hinge_response`), which the
solver treats as further movers: three as a velocity, three as an angular velocity.
"""

import numpy as np

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel, vectorised_kernel
from touchstone.reference_impl.solver.elimination_order import slot

ONE, TWO, THREE, FOUR, FIVE = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4), np.uint64(5)
"""Unsigned, as in `block_matrix`."""


@kernel
def link_velocity(solver, link, r):
    """Velocity of a link's point, at r from the driver's centre of mass, by the coordinates of its hinges."""
    first, z = solver["links"][link]["mover"], solver["links"][link]["response"]
    v0 = v1 = v2 = w0 = w1 = w2 = 0.0
    for b in range(solver["links"][link]["blocks"]):
        mover = solver["movers"][first + b]
        for c in range(6):
            y = mover["velocity"][c] if c < 3 else mover["omega"][c - 3]
            v0, v1, v2 = v0 + y * z[b, c, 0], v1 + y * z[b, c, 1], v2 + y * z[b, c, 2]
            w0, w1, w2 = w0 + y * z[b, c, 3], w1 + y * z[b, c, 4], w2 + y * z[b, c, 5]
    return v0 + w1 * r[2] - w2 * r[1], v1 + w2 * r[0] - w0 * r[2], v2 + w0 * r[1] - w1 * r[0]


@kernel
def push_link(solver, link, r, px, py, pz):
    """Apply an impulse (px, py, pz) [N s] at r on a link to the coordinates of its hinges."""
    first, z = solver["links"][link]["mover"], solver["links"][link]["response"]
    tx, ty, tz = r[1] * pz - r[2] * py, r[2] * px - r[0] * pz, r[0] * py - r[1] * px
    for b in range(solver["links"][link]["blocks"]):
        mover = solver["movers"][first + b]
        for c in range(6):
            y = z[b, c, 0] * px + z[b, c, 1] * py + z[b, c, 2] * pz
            y += z[b, c, 3] * tx + z[b, c, 4] * ty + z[b, c, 5] * tz
            if c < 3:
                mover["velocity"][c] += y
            else:
                mover["omega"][c - 3] += y


@kernel
def link_turn(solver, link):
    """Angular velocity of a link by the coordinates of its hinges [rad/s]."""
    first, z = solver["links"][link]["mover"], solver["links"][link]["response"]
    x = y = s = 0.0
    for b in range(solver["links"][link]["blocks"]):
        mover = solver["movers"][first + b]
        for c in range(6):
            q = mover["velocity"][c] if c < 3 else mover["omega"][c - 3]
            x, y, s = x + q * z[b, c, 3], y + q * z[b, c, 4], s + q * z[b, c, 5]
    return x, y, s


@kernel
def turn_link(solver, link, x, y, z):
    """Apply an angular impulse (x, y, z) [N m s] on a link to the coordinates of its hinges."""
    first, response = solver["links"][link]["mover"], solver["links"][link]["response"]
    for b in range(solver["links"][link]["blocks"]):
        mover = solver["movers"][first + b]
        for c in range(6):
            q = response[b, c, 3] * x + response[b, c, 4] * y + response[b, c, 5] * z
            if c < 3:
                mover["velocity"][c] += q
            else:
                mover["omega"][c - 3] += q


@kernel
def list_turns(solver, moment):
    """Set `block_place` and `block` of the solver to the movers of a moment and its Jacobian: bodies
    first."""
    row, arm = solver["rows"][moment["row"]], moment["arm"]
    solver["block_count"] = 0
    for side in range(2):
        m, sign = (row["b"], arm) if side else (row["a"], -arm)
        if m >= 0:
            j = solver["block"][_new_block(solver, solver["movers"][m]["place"])]
            j[0, 3] = j[1, 4] = j[2, 5] = sign
    first = solver["block_count"]
    for side in range(2):
        link, sign = (row["link_b"], arm) if side else (row["link_a"], -arm)
        if link < 0:
            continue
        z, start = solver["links"][link]["response"], first
        # both links of one driver have the same blocks
        if side == 0 or row["link_a"] < 0 or solver["links"][row["link_a"]]["mover"] != _first(solver, link):
            start = solver["block_count"]
            for b in range(solver["links"][link]["blocks"]):
                _new_block(solver, solver["movers"][_first(solver, link) + b]["place"])
        for b in range(solver["links"][link]["blocks"]):
            j = solver["block"][start + b]
            for c in range(6):
                for i in range(3):
                    j[i, c] += sign * z[b, c, 3 + i]


@kernel
def add_link_mobility(solver, row, out_mobility):
    """Add to a row's mobility that of the hinges of its links [1/kg]."""
    list_blocks(solver, row)
    rigid = (1 if row["a"] >= 0 else 0) + (1 if row["b"] >= 0 else 0)
    for k in range(rigid, solver["block_count"]):
        j = solver["block"][k]
        for r in range(3):
            for c in range(3):
                for i in range(6):
                    out_mobility[r, c] += j[r, i] * j[c, i]


@kernel
def list_blocks(solver, row):
    """Set `block_place` and `block` of the solver to the movers of a row and its Jacobian: bodies first."""
    solver["block_count"] = 0
    for side in range(2):
        m, r, sign = (row["b"], row["r_b"], 1.0) if side else (row["a"], row["r_a"], -1.0)
        if m >= 0:
            j = solver["block"][_new_block(solver, solver["movers"][m]["place"])]
            for i in range(3):
                j[i, i] = sign
            j[0, 4], j[0, 5] = sign * r[2], -sign * r[1]
            j[1, 3], j[1, 5] = -sign * r[2], sign * r[0]
            j[2, 3], j[2, 4] = sign * r[1], -sign * r[0]
    first = solver["block_count"]
    for side in range(2):
        link, r, sign = (row["link_b"], row["r_b"], 1.0) if side else (row["link_a"], row["r_a"], -1.0)
        if link < 0:
            continue
        z, start = solver["links"][link]["response"], first
        # both links of one driver have the same blocks
        if side == 0 or row["link_a"] < 0 or solver["links"][row["link_a"]]["mover"] != _first(solver, link):
            start = solver["block_count"]
            for b in range(solver["links"][link]["blocks"]):
                _new_block(solver, solver["movers"][_first(solver, link) + b]["place"])
        for b in range(solver["links"][link]["blocks"]):
            j = solver["block"][start + b]
            for c in range(6):
                w0, w1, w2 = z[b, c, 3], z[b, c, 4], z[b, c, 5]
                j[0, c] += sign * (z[b, c, 0] + w1 * r[2] - w2 * r[1])
                j[1, c] += sign * (z[b, c, 1] + w2 * r[0] - w0 * r[2])
                j[2, c] += sign * (z[b, c, 2] + w0 * r[1] - w1 * r[0])


@kernel
def _first(solver, link):
    return solver["links"][link]["mover"]


@kernel
def _new_block(solver, place):
    """Add a zero block of a row's Jacobian at a place; returns its index."""
    k = solver["block_count"]
    solver["block_place"][k] = place
    solver["block"][k, :, :] = 0.0
    solver["block_count"] = k + 1
    return k


@kernel
def subtract_from_link(solver, link, r, px, py, pz):
    """Subtract J^T p of a link's hinges from the gradient."""
    first, z = _first(solver, link), solver["links"][link]["response"]
    tx, ty, tz = r[1] * pz - r[2] * py, r[2] * px - r[0] * pz, r[0] * py - r[1] * px
    for b in range(solver["links"][link]["blocks"]):
        base = 6 * solver["movers"][first + b]["place"]
        for c in range(6):
            y = z[b, c, 0] * px + z[b, c, 1] * py + z[b, c, 2] * pz
            y += z[b, c, 3] * tx + z[b, c, 4] * ty + z[b, c, 5] * tz
            solver["gradient"][base + c] -= y


@kernel
def add_link_rate(solver, link, r, sign, out_rate):
    """Add the change of a row's velocity by the step of a link's hinges."""
    first, z = _first(solver, link), solver["links"][link]["response"]
    for b in range(solver["links"][link]["blocks"]):
        base = 6 * solver["movers"][first + b]["place"]
        for c in range(6):
            y = sign * solver["step"][base + c]
            w0, w1, w2 = z[b, c, 3], z[b, c, 4], z[b, c, 5]
            out_rate[0] += y * (z[b, c, 0] + w1 * r[2] - w2 * r[1])
            out_rate[1] += y * (z[b, c, 1] + w2 * r[0] - w0 * r[2])
            out_rate[2] += y * (z[b, c, 2] + w0 * r[1] - w1 * r[0])


@vectorised_kernel
def add_blocks(solver, row):
    """Add J^T K J of a row with links of chains."""
    list_blocks(solver, row)
    add_listed(solver)


@vectorised_kernel
def add_listed(solver):
    """Add J^T K J of the listed blocks: a block for each two of their movers."""
    k, lower, upper = solver["kernel"], solver["lower"], solver["upper"]
    for i in range(solver["block_count"]):
        p, j = solver["block_place"][i], solver["block"][i]
        x, y, z = _times(k, j, 0), _times(k, j, 1), _times(k, j, 2)
        for other in range(solver["block_count"]):
            q, j = solver["block_place"][other], solver["block"][other]
            at = slot(solver, max(p, q), min(p, q))
            # the block (q, p) of J^T K J: its rows are contiguous above the diagonal, its columns below it
            for r in range(6):
                if q <= p:
                    out = upper if q < p else lower
                    _add_row(out, at + np.uint64(6 * r), j[0, r], x, j[1, r], y, j[2, r], z)
                else:
                    a, b, c = x[r], y[r], z[r]
                    _add_row(lower, at + np.uint64(6 * r), a, _six(j, 0), b, _six(j, 1), c, _six(j, 2))


@kernel
def add_product(solver):
    """Add a b' to the matrix, with a and b the vectors `outer` of the listed blocks."""
    lower, upper = solver["lower"], solver["upper"]
    for i in range(solver["block_count"]):
        p, b = solver["block_place"][i], solver["outer"][1, i]
        for other in range(solver["block_count"]):
            q, a = solver["block_place"][other], solver["outer"][0, other]
            at = slot(solver, max(p, q), min(p, q))
            # stored as in `add_listed`
            for r in range(6):
                for c in range(6):
                    if q < p:
                        upper[at + np.uint64(6 * r + c)] += a[r] * b[c]
                    elif q == p:
                        lower[at + np.uint64(6 * r + c)] += a[r] * b[c]
                    else:
                        lower[at + np.uint64(6 * r + c)] += b[r] * a[c]


@inlined_kernel
def _six(j, i):
    """Row i of a 3 x 6 block."""
    return j[i, 0], j[i, 1], j[i, 2], j[i, 3], j[i, 4], j[i, 5]


@inlined_kernel
def _times(k, j, i):
    """Row i of K J."""
    x, y, z = k[i, 0], k[i, 1], k[i, 2]
    return (
        x * j[0, 0] + y * j[1, 0] + z * j[2, 0],
        x * j[0, 1] + y * j[1, 1] + z * j[2, 1],
        x * j[0, 2] + y * j[1, 2] + z * j[2, 2],
        x * j[0, 3] + y * j[1, 3] + z * j[2, 3],
        x * j[0, 4] + y * j[1, 4] + z * j[2, 4],
        x * j[0, 5] + y * j[1, 5] + z * j[2, 5],
    )


@inlined_kernel
def _add_row(out, at, a, x, b, y, c, z):
    """Add a x + b y + c z to six contiguous entries."""
    out[at] += a * x[0] + b * y[0] + c * z[0]
    out[at + ONE] += a * x[1] + b * y[1] + c * z[1]
    out[at + TWO] += a * x[2] + b * y[2] + c * z[2]
    out[at + THREE] += a * x[3] + b * y[3] + c * z[3]
    out[at + FOUR] += a * x[4] + b * y[4] + c * z[4]
    out[at + FIVE] += a * x[5] + b * y[5] + c * z[5]

"""Order in which the movers of an island are eliminated, and the blocks of its matrix that this fills.

The mover with the fewest neighbours comes first, and its elimination joins these to each other (Tinney &
Walker 1967): a heap of 216 balls takes a fifth of the multiplications of the narrowest envelope. Column k of
the matrix has its diagonal block in slot `begin[k]`, then a slot for each later place that it is joined to,
in order: slot s has the blocks (`slot_row[s]`, k) and (k, `slot_row[s]`).
"""

import numpy as np

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel

NONE, ONE = np.uint64(0), np.uint64(1)


@kernel
def order_movers(solver):
    """Order the movers by least degree, the last of equal ones first, and join what an elimination joins."""
    movers, order, degree, count = solver["movers"], solver["order"], solver["degree"], solver["mover_count"]
    words = (count + 63) // 64
    for m in range(count):
        movers[m]["place"] = -1
        for w in range(words):
            solver["near"][m, w] = NONE
    for k in range(solver["row_count"]):
        _join_movers(solver, solver["rows"][k])
    for m in range(count):
        degree[m] = _count_near(solver, m, words)
    for k in range(count):
        least = -1
        for m in range(count):
            if movers[m]["place"] < 0 and (least < 0 or degree[m] <= degree[least]):
                least = m
        order[k], movers[least]["place"] = least, k
        for m in range(count):
            if movers[m]["place"] < 0 and is_near(solver, least, m):
                for w in range(words):
                    solver["near"][m, w] |= solver["near"][least, w]
                _part(solver, m, m)
                _part(solver, m, least)
                degree[m] = _count_near(solver, m, words)


@inlined_kernel
def is_near(solver, m, other):
    """Whether the blocks of two movers differ from zero."""
    return solver["near"][m, other // 64] & (ONE << np.uint64(other % 64)) != NONE


@kernel
def _count_near(solver, m, words):
    """Number of the neighbours of a mover."""
    found = 0
    for w in range(words):
        bits = solver["near"][m, w]
        while bits != NONE:
            bits &= bits - ONE
            found += 1
    return found


@kernel
def _join_movers(solver, row):
    """Note that the movers of a row are neighbours: its bodies, and the hinges of its links."""
    listed, count = solver["block_place"], 0
    for side in range(2):
        m, link = (row["b"], row["link_b"]) if side else (row["a"], row["link_a"])
        if m >= 0:
            listed[count] = m
            count += 1
        blocks = solver["links"][link]["blocks"] if link >= 0 else 0
        for k in range(blocks):
            listed[count] = solver["links"][link]["mover"] + k
            count += 1
    for i in range(count):
        for j in range(i):
            # both links of one driver have the same hinges
            if listed[i] != listed[j]:
                _join(solver, listed[i], listed[j])


@inlined_kernel
def _join(solver, m, other):
    """Note that two movers are neighbours."""
    solver["near"][m, other // 64] |= ONE << np.uint64(other % 64)
    solver["near"][other, m // 64] |= ONE << np.uint64(m % 64)


@inlined_kernel
def _part(solver, m, other):
    """Note that a mover is not the neighbour of another."""
    solver["near"][m, other // 64] &= ~(ONE << np.uint64(other % 64))


@inlined_kernel
def slot(solver, p, q):
    """First entry of the blocks (p, q) and (q, p), p >= q, in their halves."""
    s = solver["begin"][q]
    while solver["slot_row"][s] != p:
        s += 1
    return np.uint64(36 * s)

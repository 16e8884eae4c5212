"""Global penetration depth: one translation of a mover for all its obstacles (Eq. 1, algorithm 1)."""

from math import sqrt
from typing import NamedTuple

from touchstone.reference_impl.core.conventions import MOVER_BODY, MOVER_DRIVER
from touchstone.reference_impl.core.kernel import kernel


class Mover(NamedTuple):
    """What one translation moves."""

    kind: int  # MOVER_BODY, MOVER_DRIVER or MOVER_TRUNK
    index: int  # of the body, or of the driver


@kernel
def is_mover(bodies, body, mover):
    """Whether a body belongs to `mover`."""
    if mover.kind == MOVER_BODY:
        return body == mover.index
    return bodies[body]["driver"] == mover.index and (mover.kind == MOVER_DRIVER or bodies[body]["chain"] < 0)


@kernel
def side_of(bodies, pair, mover):
    """Side of a pair that `mover` is on: 1.0 for B, -1.0 for A, 0.0 for neither; 0.0 also for two links of
    one driver."""
    a, b = pair["body_a"], pair["body_b"]
    if mover.kind != MOVER_BODY and bodies[a]["driver"] == bodies[b]["driver"]:
        return 0.0
    if is_mover(bodies, b, mover):
        return 1.0
    return -1.0 if is_mover(bodies, a, mover) else 0.0


@kernel
def largest_depth(bodies, pairs, end, d):
    """Largest depth of `pairs[:end]` that involve driver d, self-collision included [m]."""
    deepest = 0.0
    for k in range(end):
        if bodies[pairs[k]["body_a"]]["driver"] == d or bodies[pairs[k]["body_b"]]["driver"] == d:
            deepest = max(deepest, pairs[k]["depth"])
    return deepest


@kernel
def global_depth(bodies, pairs, first, end, mover, out_shift):
    """Eq. 1: PD = sum(d_i^2 n_i) / sum(d_i) over the mover's overlapping pairs, normals towards the mover.

    Args:
        pairs: `pairs[first:end]` are used.
        mover: Mover.
        out_shift: PD, the translation of the mover (3,) [m].
    Returns:
        (deepest, size): the mover's largest depth and |PD| [m].
    """
    deepest = total = 0.0
    out_shift[0] = out_shift[1] = out_shift[2] = 0.0
    for k in range(first, end):
        pair = pairs[k]
        depth = pair["depth"]
        sign = side_of(bodies, pair, mover)
        if depth <= 0 or sign == 0.0:
            continue
        deepest = max(deepest, depth)
        total += depth
        for i in range(3):
            out_shift[i] += sign * depth * depth * pair["normal"][i]
    if total == 0.0:
        return 0.0, 0.0
    for i in range(3):
        out_shift[i] /= total
    return deepest, sqrt(out_shift[0] ** 2 + out_shift[1] ** 2 + out_shift[2] ** 2)

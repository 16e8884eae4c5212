"""Global penetration depth: one translation of a mover for all its obstacles (Eq. 1, algorithm 1)."""

from math import sqrt

from touchstone.reference_impl.core.conventions import TRUNK_OFFSET
from touchstone.reference_impl.core.kernel import kernel


@kernel
def is_mover(bodies, body, mover):
    """Whether a body belongs to `mover`: b for body b, -1 - d for all links of driver d, or
    -1 - TRUNK_OFFSET - d for its links outside chains."""
    if mover >= 0:
        return body == mover
    if mover < -TRUNK_OFFSET:
        return bodies[body]["driver"] == -1 - TRUNK_OFFSET - mover and bodies[body]["chain"] < 0
    return bodies[body]["driver"] == -1 - mover


@kernel
def side_of(bodies, pair, mover):
    """Side of a pair that `mover` is on: 1.0 for B, -1.0 for A, 0.0 for neither; 0.0 also for two links of
    one driver."""
    a, b = pair["body_a"], pair["body_b"]
    if mover < 0 and bodies[a]["driver"] == bodies[b]["driver"]:
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
            deepest = max(deepest, -pairs[k]["distance"])
    return deepest


@kernel
def global_depth(bodies, pairs, first, end, mover, out_shift):
    """Eq. 1: PD = sum(d_i^2 n_i) / sum(d_i) over the mover's overlapping pairs, normals towards the mover.

    Args:
        pairs: `pairs[first:end]` are used.
        mover: as in `is_mover`.
        out_shift: PD, the translation of the mover (3,) [m].
    Returns:
        (deepest, size): the mover's largest depth and |PD| [m].
    """
    deepest = total = 0.0
    out_shift[0] = out_shift[1] = out_shift[2] = 0.0
    for k in range(first, end):
        pair = pairs[k]
        depth = -pair["distance"]
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

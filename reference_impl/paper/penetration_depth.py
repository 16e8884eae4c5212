"""Estimate of the global penetration depth (section "Estimating the Global Penetration Depth", algorithm 1).

    Input: convex decomposition of all objects. Output: global PD per pair of general objects.
    1. Cull non-overlapping pairs.                            `find_overlap` (sweep and prune)
    2. Determine the PD per convex pair.                      `find_overlap` (`geometry/depth_warm_start.py`)
    3. Compute PD_g with equation 1.                          `add_depth`, `global_depth`
    4. If needed, interpolate between current and last state. `return_to_free_state`

The depth of a convex pair is found "by walking on the surface of the Minkowski sums", from the feature of the
frame before: it is locally optimal.
"""

from touchstone.reference_impl.broad_phase.detection import find_touching, place_listed
from touchstone.reference_impl.core.conventions import DRIVEN, OVERLAP_TOLERANCE, PART_WHOLE
from touchstone.reference_impl.core.counters import COUNT_CONTACTING, STAGE_COLLISION
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.kinematics.driver_poses import interpolate
from touchstone.reference_impl.paper.vectors import scaled, vector

INTERPOLATION_STEPS = 24
"""Bisections between the last free state and the present one: 6e-8 of their distance."""


@kernel
def find_overlap(world, kind):
    """Steps 1 and 2: find the pairs that touch or overlap and contain a body of `kind`, with their depths.

    Returns:
        (end, deepest): `world.pairs[:end]` are the pairs; the largest depth [m].
    """
    state = world.state
    since = clock(state["clock"])
    place_listed(world.bodies, world.pieces, world.vertices, kind, state)
    end, deepest = find_touching(world, kind, 0)
    if kind == DRIVEN:
        state["counters"][COUNT_CONTACTING] = max(state["counters"][COUNT_CONTACTING], end)
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return end, deepest


@kernel
def add_depth(sums, side, pd, n, share):
    """Add a convex pair to the sums of Eq. 1 of one object.

    Args:
        sums: of the object (3, 3): the numerator in row 0, the denominator and the largest depth in row 1.
        side: 1.0 if the object is B of the pair, -1.0 if it is A; n points from A to B.
        pd: penetration depth of the pair [m].
        n: normal of the pair, a triple.
        share: of the depth that this object resolves [1].
    """
    d = share * pd
    for i in range(3):
        sums[0, i] += side * d * d * n[i]
    sums[1, 0] += d
    sums[1, 1] = max(sums[1, 1], pd)


@kernel
def global_depth(sums):
    """Eq. 1: PD_g = sum_i(pd_i^2 n_i) / sum_i(pd_i), the translation of the object out of its overlap [m]."""
    return scaled(1 / sums[1, 0], vector(sums[0]))


@kernel
def is_overlapping(bodies, pairs, end, d):
    """Whether a link of driven object d overlaps anything, other links of its own included."""
    for k in range(end):
        pair = pairs[k]
        mine = bodies[pair["body_a"]]["driver"] == d or bodies[pair["body_b"]]["driver"] == d
        if mine and pair["depth"] > OVERLAP_TOLERANCE:
            return True
    return False


@kernel
def return_to_free_state(world, d):
    """Step 4: move driven object d "back towards where it came from until the overlap is diminished".

    The paper leaves open when this is needed, and how far back: where translation and inverse kinematics
    leave overlap, to the state nearest to the present one that bisection finds free.

    Returns:
        Whether it is free: if not, it is in its last free state, where another object is by now.
    """
    if not _is_free_at(world, d, 0.0):
        return False
    free, blocked = 0.0, 1.0
    for _ in range(INTERPOLATION_STEPS):
        middle = (free + blocked) / 2
        if _is_free_at(world, d, middle):
            free = middle
        else:
            blocked = middle
    interpolate(world.bodies, world.joints, world.drivers[d], PART_WHOLE, free)
    return True


@kernel
def _is_free_at(world, d, t):
    """Whether driven object d is free at t between its last free state (0) and that at entry (1)."""
    interpolate(world.bodies, world.joints, world.drivers[d], PART_WHOLE, t)
    end, _ = find_overlap(world, DRIVEN)
    return not is_overlapping(world.bodies, world.pairs, end, d)

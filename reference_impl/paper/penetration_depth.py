"""Estimate of the global penetration depth (section "Estimating the Global Penetration Depth", algorithm 1).

    Input: convex decomposition of all objects. Output: global PD per pair of general objects.
    1. Cull non-overlapping pairs.                            `find_overlap` (sweep and prune)
    2. Determine the PD per convex pair.                      `find_overlap` (`geometry/depth_warm_start.py`)
    3. Compute PD_g with equation 1.                          `add_depth`, `global_depth`
    4. If needed, interpolate between current and last state. `return_to_free_state`

The depth of a convex pair is found "by walking on the surface of the Minkowski sums", from the feature of the
frame before: it is locally optimal.
"""

from touchstone.reference_impl.broad_phase.detection import place_listed, set_coefficients
from touchstone.reference_impl.broad_phase.sweep_and_prune import find_pairs
from touchstone.reference_impl.core.conventions import DRIVEN, OVERLAP_TOLERANCE, PART_WHOLE, TOUCH_DISTANCE
from touchstone.reference_impl.core.counters import (
    COUNT_CONTACTING,
    COUNT_CONTACTS,
    COUNT_LOST,
    COUNT_PAIRS,
    STAGE_COLLISION,
)
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.geometry.depth_warm_start import pair_depth
from touchstone.reference_impl.kinematics.driver_poses import interpolate
from touchstone.reference_impl.kinematics.skeleton import are_adjacent
from touchstone.reference_impl.paper.vectors import scaled

INTERPOLATION_STEPS = 24
"""Bisections between the last free state and the present one: 6e-8 of their distance."""


@kernel
def find_overlap(world, kind):
    """Steps 1 and 2: find the pairs that overlap or touch and contain a body of `kind`, with their depths.

    Returns:
        (end, deepest): `world.pairs[:end]` are the pairs; the largest depth [m].
    """
    bodies, pieces, pairs, state = world.bodies, world.pieces, world.pairs, world.state
    since = clock(state["clock"])
    place_listed(bodies, pieces, world.vertices, kind, state)
    found, lost = find_pairs(pieces, kind, 0, pairs, state)
    end, deepest = 0, 0.0
    for k in range(found):
        pair = pairs[k]
        if state["self_collision"] == 1 and are_adjacent(bodies, pair["body_a"], pair["body_b"]):
            continue
        pair_depth(pieces, world.vertices, state, pair)
        if pair["distance"] > TOUCH_DISTANCE:
            continue
        pair["depth"] = -pair["distance"]
        deepest = max(deepest, pair["depth"])
        set_coefficients(bodies, pair, state)
        if k != end:
            pairs[end] = pair
        end += 1
    state["counters"][COUNT_LOST] += lost
    state["counters"][COUNT_PAIRS] += found
    state["counters"][COUNT_CONTACTS] += end
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
    return scaled(1 / sums[1, 0], (sums[0, 0], sums[0, 1], sums[0, 2]))


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
    leave overlap, from the state before both to the nearest one that bisection finds free.

    Returns:
        Whether it is free: if not, it is in its last free state, where another object is by now.
    """
    free, blocked, t = 0.0, 1.0, 0.0
    for k in range(INTERPOLATION_STEPS + 1):
        interpolate(world.bodies, world.joints, world.drivers[d], PART_WHOLE, t)
        end, _ = find_overlap(world, DRIVEN)
        if is_overlapping(world.bodies, world.pairs, end, d):
            if k == 0:
                return False
            blocked = t
        else:
            free = t
        t = (free + blocked) / 2
    interpolate(world.bodies, world.joints, world.drivers[d], PART_WHOLE, free)
    return True

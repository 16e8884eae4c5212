"""Estimate of the global penetration depth (section "Estimating the Global Penetration Depth", algorithm 1).

    Input: convex decomposition of all objects. Output: global PD per pair of general objects.
    1. Cull non-overlapping pairs.                            `broad_phase/detection.py`, `detect`
    2. Determine the PD per convex pair.                      `geometry/depth_warm_start.py`, `pair_depth`
    3. Compute PD_g with equation 1.                          `add_depth`, `global_depth`
    4. If needed, interpolate between current and last state. `return_to_free_state`

The depth of a convex pair is found "by walking on the surface of the Minkowski sums", from the feature of the
frame before: it is locally optimal.
"""

from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core.conventions import DRIVEN, OVERLAP_TOLERANCE
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_quaternion, copy_vector, rotation_between, turn
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.paper.reach_cones import keep_in_reach_cones
from touchstone.reference_impl.paper.vectors import add, scaled, store, vector

INTERPOLATION_STEPS = 24
"""Bisections between the last free state and the present one: 6e-8 of their distance."""


@kernel
def clear_sums(sums):
    """Begin the sums of Eq. 1 of one object: an array (3, 3) with the numerator in row 0, the denominator and
    the largest depth in row 1."""
    sums[:] = 0.0


@kernel
def add_depth(sums, side, pd, n, share):
    """Add a convex pair to the sums of Eq. 1 of one object.

    Args:
        sums: of the object.
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
def overlaps(sums):
    """Whether an object's largest depth is over the tolerance."""
    return sums[1, 1] > OVERLAP_TOLERANCE


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
    driver = world.drivers[d]
    if not _is_free_at(world, d, 0.0):
        return False
    free, blocked = 0.0, 1.0
    for _ in range(INTERPOLATION_STEPS):
        middle = (free + blocked) / 2
        if _is_free_at(world, d, middle):
            free = middle
        else:
            blocked = middle
    _interpolate(world.bodies, world.joints, driver, free)
    return True


@kernel
def _is_free_at(world, d, t):
    _interpolate(world.bodies, world.joints, world.drivers[d], t)
    end, _ = detect(world, DRIVEN, 0)
    return not is_overlapping(world.bodies, world.pairs, end, d)


@kernel
def _interpolate(bodies, joints, driver, t):
    """Pose a driven object between its last free state (t = 0) and that at entry to overlap avoidance (1).

    Positions and angles are linear in t, orientations turn about a fixed axis.
    """
    store(
        add(scaled(1 - t, vector(driver["free_position"])), scaled(t, vector(driver["entry_position"]))),
        driver["position"],
    )
    turned = driver["scratch"][0]
    rotation_between(driver["free_orientation"], driver["entry_orientation"], turned)
    turn(driver["free_orientation"], t * turned[0], t * turned[1], t * turned[2], driver["orientation"])
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    for k in range(first, end):
        joints[k]["last_angle"] = joints[k]["free_angle"]
        joints[k]["angle"] = (1 - t) * joints[k]["free_angle"] + t * joints[k]["entry_angle"]
    keep_in_reach_cones(joints, first, end - 1)
    pose_links(bodies, joints, driver)


@kernel
def store_entry_state(joints, driver):
    """Remember a driven object's state before overlap avoidance."""
    copy_vector(driver["position"], driver["entry_position"])
    copy_quaternion(driver["orientation"], driver["entry_orientation"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["entry_angle"] = joints[k]["angle"]


@kernel
def store_free_state(joints, driver):
    """Cache a driven object's state as the last one without overlap."""
    copy_vector(driver["position"], driver["free_position"])
    copy_quaternion(driver["orientation"], driver["free_orientation"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["free_angle"] = joints[k]["angle"]

"""Contact constraints of the posture QP, cached from round to round and from frame to frame.

A constraint stores a point of a link and a point of the other body, each in its body's frame, and a lower
bound on their separation along the normal. Collision detection reports one point per pair, even where a whole
face or edge rests on an obstacle. Earlier points therefore persist while their pair touches; otherwise a sole
on the ground would rock about the ankle from toe to heel and back.
"""

from touchstone.reference_impl.core.conventions import POSTURE_CONSTRAINTS
from touchstone.reference_impl.core.counters import CAP_CONSTRAINTS
from touchstone.reference_impl.core.kernel import kernel

CONSTRAINT_ALIKE = 1e-3
"""Distance below which two points of a pair count as one [m]."""
QP_CLEARANCE = 5e-7
"""Gap that the QP aims at [m]: its linearisation error then leaves no overlap, and the links still touch."""


@kernel
def gather_constraints(bodies, pairs, end, driver, d, state):
    """Add a constraint for each pair of a driver's chains; it replaces a cached one at nearly the same point.
    Where the pairs could overflow the cache, clear it first; pairs that do not fit then are counted."""
    added = 0
    for k in range(end):
        mine, _ = _sides(bodies, pairs[k], d)
        added += 1 if mine >= 0 else 0
    if driver["constraint_count"] + added > POSTURE_CONSTRAINTS:
        driver["constraint_count"] = 0
    for r in range(driver["constraint_count"]):
        driver["constraints"][r]["is_touching"] = 0
    for k in range(end):
        pair = pairs[k]
        mine, other = _sides(bodies, pair, d)
        if mine >= 0:
            place = _row_of(bodies, pair, mine, driver)
            if place < POSTURE_CONSTRAINTS:
                _set_row(bodies, pair, mine, other, driver, d, driver["constraints"][place])
                if place == driver["constraint_count"]:
                    driver["constraints"][place]["warm_multiplier"] = 0.0
                    driver["constraint_count"] += 1
            else:
                state["counters"][CAP_CONSTRAINTS] += 1


@kernel
def chains_depth(bodies, pairs, end, d):
    """Largest depth of the pairs in which a link of driver d's chains takes part [m]."""
    deepest = 0.0
    for k in range(end):
        mine, _ = _sides(bodies, pairs[k], d)
        if mine >= 0:
            deepest = max(deepest, pairs[k]["depth"])
    return deepest


@kernel
def drop_constraints(driver, only_seen):
    """Remove constraints whose pair no longer touches; without `only_seen`, only those with multiplier 0."""
    kept = 0
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        if row["is_touching"] == 1 or (not only_seen and row["warm_multiplier"] > 0):
            if kept != r:
                driver["constraints"][kept] = row
            kept += 1
    driver["constraint_count"] = kept


@kernel
def _sides(bodies, pair, d):
    """Body of a pair that is a chain link of driver d, and the other body; (-1, -1) if neither is one. If
    both are, the one with the higher hinge index comes first: in one chain, the outer link."""
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    at_a, at_b = a["driver"] == d and a["chain"] >= 0, b["driver"] == d and b["chain"] >= 0
    if at_b and (not at_a or b["hinge"] > a["hinge"]):
        return pair["body_b"], pair["body_a"]
    if at_a:
        return pair["body_a"], pair["body_b"]
    return -1, -1


@kernel
def _row_of(bodies, pair, mine, driver):
    """Index of the cached constraint within CONSTRAINT_ALIKE of the pair's point, or of the first free slot;
    marks all cached constraints of the pair as touching."""
    place = driver["constraint_count"]
    p = pair["point_b"] if mine == pair["body_b"] else pair["point_a"]
    m, o = bodies[mine]["rotation"], bodies[mine]["position"]
    for r in range(driver["constraint_count"]):
        row = driver["constraints"][r]
        if row["piece_a"] != pair["piece_a"] or row["piece_b"] != pair["piece_b"]:
            continue
        row["is_touching"] = 1
        x = row["point"]
        square = 0.0
        for i in range(3):
            away = o[i] + m[i, 0] * x[0] + m[i, 1] * x[1] + m[i, 2] * x[2] - p[i]
            square += away * away
        if square < CONSTRAINT_ALIKE * CONSTRAINT_ALIKE:
            place = r
    return place


@kernel
def _set_row(bodies, pair, mine, other, driver, d, row):
    """Fill a constraint that separates the pair's points on the link `mine` and on the body `other`."""
    side = 1.0 if mine == pair["body_b"] else -1.0
    p, q = pair["point_b"] if side > 0 else pair["point_a"], pair["point_a"] if side > 0 else pair["point_b"]
    row["piece_a"], row["piece_b"], row["is_touching"] = pair["piece_a"], pair["piece_b"], 1
    row["body"], row["other"] = mine, other
    one, two = bodies[mine], bodies[other]
    row["first"][0], row["last"][0] = driver["chains"][one["chain"], 0], one["hinge"]
    row["first"][1], row["last"][1] = 0, -1
    if two["driver"] == d and two["chain"] == one["chain"]:
        # hinges inward of both links move both and do not change their separation
        row["first"][0] = two["hinge"] + 1
    elif two["driver"] == d and two["chain"] >= 0:
        row["first"][1], row["last"][1] = driver["chains"][two["chain"], 0], two["hinge"]
    _to_local(one, p, row["point"])
    _to_local(two, q, row["other_point"])
    row["bound"] = QP_CLEARANCE + pair["depth"]
    for i in range(3):
        row["normal"][i] = side * pair["normal"][i]
        row["bound"] += row["normal"][i] * (p[i] - q[i])


@kernel
def _to_local(body, point, out_point):
    m, o = body["rotation"], body["position"]
    for i in range(3):
        out_point[i] = m[0, i] * (point[0] - o[0]) + m[1, i] * (point[1] - o[1]) + m[2, i] * (point[2] - o[2])

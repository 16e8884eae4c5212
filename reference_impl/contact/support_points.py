"""Supports of a face that its manifold lacks.

A manifold has at most four points, so a round cap, a face of many corners or a part of a disc on another one
would tip over the line through two of them, within the region in which it touches. After a solve that turns a
body about such points, the point of that region that sinks most takes the place of one that bears nothing,
and the substep is solved again: a cutting-plane method, whose last support polygon holds the load.
"""

from touchstone.reference_impl.core.conventions import NO_FLOOR
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, cross, dot, plus, vector_of
from touchstone.reference_impl.geometry.contact_manifold import lowest_point
from touchstone.reference_impl.solver.mobility import relative_turn, relative_velocity

SUPPORT_SLACK = 1e-9
"""Sinking within a substep of a point that a manifold lacks, below which it supports nothing [m]: less than
that at which a point has landed."""
IDLE_SHARE = 1e-6
"""Share of a manifold's load below which a point bears nothing [1]."""


@kernel
def move_supports(world, count, h):
    """Exchange idle points of manifolds for points of the same faces that sink within a substep of length
    h [s], at the velocities after a solve; returns whether any was."""
    pairs, moved = world.pairs, False
    if count < len(pairs):
        for k in range(count):
            pair = pairs[k]
            if pair["reduced"] == 1 and pair["manifold"] == k and pair["floor"] != NO_FLOOR:
                moved = _move_support(world, k, count, h) or moved
    return moved


@kernel
def _move_support(world, k, count, h):
    """`move_supports` of the manifold of row k."""
    bodies, pieces, pairs, state = world.bodies, world.pieces, world.pairs, world.state
    pair, turn = pairs[k], state["impulse"]
    a, b, n = pieces[pair["piece_a"]], pieces[pair["piece_b"]], vector_of(pair["start_normal"])
    relative_turn(bodies, pair, turn)
    rate = cross(n, turn)
    width = 2 * min(a["reach"], b["reach"])
    if h * h * dot(rate, rate) * width * width <= SUPPORT_SLACK * SUPPORT_SLACK:
        return False
    load, lowest, highest, idle, row = 0.0, 0.0, 0.0, -1, k
    while row >= 0:
        load += dot(vector_of(pairs[row]["normal"]), pairs[row]["resting_impulse"])
        row = pairs[row]["next_point"]
    row = k
    while row >= 0:
        gap = pairs[row]["distance"] + h * relative_velocity(bodies, pairs[row], state)
        lowest = min(lowest, gap)
        bears = dot(vector_of(pairs[row]["normal"]), pairs[row]["resting_impulse"]) > IDLE_SHARE * load
        if not bears and (idle < 0 or gap > highest):
            idle, highest = row, gap
        row = pairs[row]["next_point"]
    if load <= 0 or idle < 0:
        return False
    pairs[count] = pair
    found = pairs[count]
    copy_vector(pair["start_normal"], found["normal"])
    way = plus(vector_of(pair["point_a"]), -1.0, vector_of(pair["lever_a"]))
    speed = relative_velocity(bodies, pair, state) + dot(rate, way)
    if lowest_point(a, b, world.vertices, rate, speed, h, state, found) >= lowest - SUPPORT_SLACK:
        return False
    row = pairs[idle]
    row["distance"], row["level"], row["speculative_speed"] = found["distance"], found["level"], 0.0
    copy_vector(found["normal"], row["start_normal"])
    copy_vector(found["point_a"], row["point_a"])
    copy_vector(found["point_b"], row["point_b"])
    return True

"""Broad phase of moving pieces: pairs whose boxes, swept over the motion of a substep, overlap."""

from math import inf, sqrt

from touchstone.reference_impl.broad_phase.detection import find_stops, place_listed, without_joined
from touchstone.reference_impl.broad_phase.fat_bounds import drop_fat_bounds, inside_fat_bounds
from touchstone.reference_impl.broad_phase.sweep_and_prune import find_pairs
from touchstone.reference_impl.continuous.swept_motion import swept_box
from touchstone.reference_impl.core.conventions import DRIVEN, PRESSED, SIMULATED, TOUCH_DISTANCE
from touchstone.reference_impl.core.counters import COUNT_LOST, COUNT_PAIRS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.skeleton import link_of

MEETING_MARGIN = 0.01
"""Distance beyond the ways of a link and a body that they may still meet [m]: 2 g h^2 at 1/60 s, and more."""


@kernel
def find_swept_pairs(world, kind, first):
    """Find the pairs whose swept boxes overlap and contain a body of `kind`, written from `pairs[first]`.

    Leaves the pieces of `kind` at the start pose with swept boxes; returns the index after the last pair.
    """
    bodies, pieces, vertices = world.bodies, world.pieces, world.vertices
    pairs, state = world.pairs, world.state
    moving = kind == SIMULATED and state["driven_loop"] == 1
    _enclose_ways(bodies, pieces, vertices, kind, state)
    if moving:
        _enclose_ways(bodies, pieces, vertices, DRIVEN, state)
    if state["has_fat_bounds"] == 1 and not inside_fat_bounds(bodies, pieces, state):
        drop_fat_bounds(bodies, pieces, state)
        place_listed(bodies, pieces, vertices, DRIVEN, state)
        _enclose_ways(bodies, pieces, vertices, kind, state)
        if moving:
            _enclose_ways(bodies, pieces, vertices, DRIVEN, state)
    end, lost = find_pairs(pieces, kind, first, pairs, state)
    state["counters"][COUNT_LOST] += lost
    state["counters"][COUNT_PAIRS] += end - first
    return find_stops(world, without_joined(world, first, end), PRESSED) if kind == SIMULATED else end


@kernel
def _enclose_ways(bodies, pieces, vertices, kind, state):
    """Swept AABBs of the listed pieces of a kind over the motion of the substep."""
    group = state["groups"][kind]
    for k in range(group["first"], group["end"]):
        piece = pieces[pieces[k]["order"]]
        swept_box(piece, bodies[piece["body"]], vertices, TOUCH_DISTANCE)


@kernel
def may_touch(bodies, joints, driver, dt):
    """Whether a link of a driver with chains may meet a simulated body in the frame of length dt, after the
    driven loop: whether the balls around their ways overlap, at twice the speed of the fastest body."""
    fastest = 0.0
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            v = bodies[b]["velocity"]
            fastest = max(fastest, v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        if link["width"] == inf:
            continue
        way = 0.0
        for i in range(3):
            way += (link["center"][i] - link["shown_center"][i]) ** 2
        span = link["reach"] + link["width"] + sqrt(way) + 2 * dt * sqrt(fastest) + MEETING_MARGIN
        for b in range(len(bodies)):
            if bodies[b]["kind"] == SIMULATED:
                apart, most = 0.0, span + bodies[b]["reach"] + bodies[b]["width"]
                for i in range(3):
                    apart += (link["center"][i] - bodies[b]["center"][i]) ** 2
                if apart <= most * most:
                    return True
    return False

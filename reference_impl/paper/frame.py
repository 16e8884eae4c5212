"""One frame (section "System Architecture", figure 3): driven objects first, then simulated objects."""

from touchstone.reference_impl.broad_phase.detection import place_pieces
from touchstone.reference_impl.broad_phase.spatial_hash import list_pieces
from touchstone.reference_impl.core.conventions import DEPTH_WALK, DRIVEN, FIXED, OVERLAP_TOLERANCE, SIMULATED
from touchstone.reference_impl.core.counters import (
    COUNT_EVENTS,
    COUNT_GAVE_UP,
    STAGE_COLLISION,
    STAGE_DRIVE,
    STAGE_IMPULSES,
    STAGE_INTEGRATION,
    STAGE_REMOVAL,
)
from touchstone.reference_impl.core.kernel import clock, kernel
from touchstone.reference_impl.core.world import World
from touchstone.reference_impl.geometry.depth_warm_start import pair_depth
from touchstone.reference_impl.geometry.shapes import place_piece
from touchstone.reference_impl.kinematics.driver_poses import store_free_pose
from touchstone.reference_impl.kinematics.skeleton import move_links, place, pose_links
from touchstone.reference_impl.paper.attraction import attract
from touchstone.reference_impl.paper.impulses import resolve_collisions
from touchstone.reference_impl.paper.integration import (
    accelerate,
    begin_motion,
    end_motion,
    move,
    move_all,
    refresh_inverse_inertia,
)
from touchstone.reference_impl.paper.overlap_avoidance import free_driven_objects, translate_out
from touchstone.reference_impl.paper.penetration_depth import find_overlap, is_overlapping
from touchstone.reference_impl.paper.virtual_coupling import follow_tracker

COLLISION_TIMES = 64
"""Most times in a frame at which motion stops for collisions; the rest of the frame then passes without."""
TIME_STEPS = 24
"""Bisections for the time of a collision: 6e-8 of the motion."""


@kernel
def prepare(bodies, pieces, joints, drivers, vertices, pairs, contacts, state):
    """Initialise a newly filled world for its first step."""
    world = World(bodies, pieces, joints, drivers, vertices, pairs, contacts, state[0])
    state[0]["depth"] = DEPTH_WALK
    for b in range(len(bodies)):
        place(bodies[b])
        if bodies[b]["kind"] == SIMULATED:
            refresh_inverse_inertia(bodies[b])
    for d in range(len(drivers)):
        pose_links(bodies, joints, drivers[d])
        move_links(bodies, joints, drivers[d])
    place_pieces(bodies, pieces, vertices, FIXED)
    place_pieces(bodies, pieces, vertices, SIMULATED)
    list_pieces(bodies, pieces, state[0])
    end, _ = find_overlap(world, DRIVEN)
    for d in range(len(drivers)):
        store_free_pose(bodies, joints, drivers[d])
        drivers[d]["has_free"] = 0 if is_overlapping(bodies, pairs, end, d) else 1
    state[0]["counters"][:] = 0


@kernel
def step(bodies, pieces, joints, drivers, vertices, pairs, contacts, state):
    """Advance a world by one frame of `state["dt"]`.

    `target_*` of a driven object is its tracker at the frame's end, `old_target_*` that at its start. Both
    loops read all positions; each updates one type of object.
    """
    world = World(bodies, pieces, joints, drivers, vertices, pairs, contacts, state[0])
    state[0]["counters"][:] = 0
    state[0]["stage_seconds"][:] = 0.0
    state[0]["contact_count"] = 0
    update_driven_objects(world)
    update_simulated_objects(world)


@kernel
def update_driven_objects(world):
    """Lower loop: virtual coupling, attraction of joints, then positions without overlap."""
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    start, collision = clock(state["clock"]), state["stage_seconds"][STAGE_COLLISION]
    for d in range(len(drivers)):
        follow_tracker(drivers[d], state["dt"])
        attract(joints, drivers[d], state["dt"])
    coupled = clock(state["clock"])
    free_driven_objects(world)
    removed = clock(state["clock"])
    for d in range(len(drivers)):
        # The paper leaves open a link's velocity in contacts: that of the coupling and of the joints'
        # attraction, as if nothing stood in the way; else a hand in contact could push nothing
        move_links(bodies, joints, drivers[d])
    collision = state["stage_seconds"][STAGE_COLLISION] - collision
    state["stage_seconds"][STAGE_REMOVAL] += removed - coupled - collision
    state["stage_seconds"][STAGE_DRIVE] += coupled - start + clock(state["clock"]) - removed


@kernel
def update_simulated_objects(world):
    """Upper loop: "dynamic objects move forward in time until the next collision occurs, the collision is
    resolved by updating velocities, and motion continues". Driven objects stand still.

    The paper leaves open how objects rest: contacts that gravity alone closes within the frame do not bounce.
    """
    bodies, state = world.bodies, world.state
    start, collision = clock(state["clock"]), state["stage_seconds"][STAGE_COLLISION]
    impulses, left, deepest = 0.0, state["dt"], 0.0
    for stop in range(COLLISION_TIMES + 1):
        end, _ = find_overlap(world, SIMULATED)
        since, time = clock(state["clock"]), state["dt"] - left
        resolved = resolve_collisions(world, end, time, 1.0)
        accelerate(bodies, state["gravity"], left)
        resolved = resolve_collisions(world, end, time, 0.0) and resolved
        impulses += clock(state["clock"]) - since
        begin_motion(bodies, left)
        move_all(bodies, left)
        t = left
        found, deepest = find_overlap(world, SIMULATED)
        if deepest > OVERLAP_TOLERANCE and stop < COLLISION_TIMES:
            t = _first_collision(world, found, left)
            move_all(bodies, t)
        end_motion(bodies)
        if not resolved or stop == COLLISION_TIMES:
            state["counters"][COUNT_GAVE_UP] += 1
        left -= t
        if left <= 0:
            break
        # gravity has acted for the time t only; what resting contacts did against it stays
        accelerate(bodies, state["gravity"], -left)
        state["counters"][COUNT_EVENTS] += 1
    if deepest > OVERLAP_TOLERANCE:
        translate_out(world, SIMULATED)
    state["stage_seconds"][STAGE_IMPULSES] += impulses
    collision = state["stage_seconds"][STAGE_COLLISION] - collision
    state["stage_seconds"][STAGE_INTEGRATION] += clock(state["clock"]) - start - collision - impulses


@kernel
def _first_collision(world, found, h):
    """Time at which the first of `pairs[:found]`, found after a motion of h [s], begins to overlap, or h.

    The paper leaves open what a collision is under discrete tests: a pair that overlaps at the end, and
    deeper than at the start, collides when its depth passes the tolerance. What overlaps only in between is
    missed: "it cannot be excluded that collisions are missed due to discreet collision testing".
    """
    state = world.state
    since, first = clock(state["clock"]), h
    for k in range(found):
        pair = world.pairs[k]
        if pair["depth"] <= OVERLAP_TOLERANCE:
            continue
        accepted = max(_depth_at(world, pair, 0.0), 0.0) + OVERLAP_TOLERANCE
        if _depth_at(world, pair, first) <= accepted:
            continue
        free, blocked = 0.0, first
        for _ in range(TIME_STEPS):
            middle = (free + blocked) / 2
            if _depth_at(world, pair, middle) <= accepted:
                free = middle
            else:
                blocked = middle
        first = free
    state["stage_seconds"][STAGE_COLLISION] += clock(state["clock"]) - since
    return first


@kernel
def _depth_at(world, pair, t):
    """Depth of a pair a time t after the start of the motion [m]; negative where it is apart."""
    bodies, pieces, vertices = world.bodies, world.pieces, world.vertices
    for piece in (pair["piece_a"], pair["piece_b"]):
        move(bodies[pieces[piece]["body"]], t)
        place_piece(pieces[piece], bodies[pieces[piece]["body"]], vertices, 0.0)
    pair_depth(pieces, vertices, world.state, pair)
    return -pair["distance"]

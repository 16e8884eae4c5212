"""The record of settings, clocks, counters and scratch."""

from touchstone.reference_impl.core.conventions import (
    COLUMN_LEVELS,
    COUNTERS,
    DEPTH_CACHE_SIZE,
    EPA_FACES,
    EPA_VERTICES,
    STAGES,
    WARM_START_CAPACITY,
)
from touchstone.reference_impl.core.dtypes import MATRIX, VECTOR, record
from touchstone.reference_impl.core.solver_dtypes import SOLVER

MATERIAL_CAPACITY = 8
"""Materials a world may hold: the two tables of `STATE` have this many rows."""
GROUP = record(
    first="i8",  # slots, and room for strips, first to end - 1
    end="i8",
    single_column="i8",  # 1: all in one strip
    filter_groups="i8",  # changes of owner along the list, and 1
    columns="i8",
    levels="i8",  # highest one in use, and 1
    width="f8",  # of the squares of level 0 [m]
    tally=("i8", (COLUMN_LEVELS,)),  # strips of each level
    widest=("f8", (COLUMN_LEVELS,)),  # scratch
)
DEPTH_CACHE_ENTRY = record(
    used="i8",  # the last look-up, 0 for never
    piece_a="i8",
    piece_b="i8",
    face="i8",  # of a box that carried the last answer: see walk_memory.remember
    count="i8",  # vertices of the difference that carried it, as corners of A and B
    corner=("i8", (3, 2)),
    # by side: the corner that is the farthest for directions within `cone` (squared, 1) of `toward`
    best=("i8", (2,)),
    steady=("i8", (2,)),  # look-ups for which it was
    toward=("f8", (2, 3)),  # piece frame
    cone=("f8", (2,)),
)
STATE = record(
    dt="f8",
    gravity=VECTOR,
    friction="i8",
    restitution_law="i8",
    impulses="i8",
    flight="i8",
    detection="i8",
    least_width="f8",  # of the pieces of fixed and simulated bodies [m]
    impact_gap="f8",  # at which an impact is found [m]
    v_rest="f8",  # most of the approach speed up to which nothing bounces [m/s]
    event_rows="i8",  # contacts that the substeps of a frame may hold in total while each ends at an impact
    rows="i8",  # of the frame's substeps so far
    last_rows="i8",  # of the last substep
    dense_substep="i8",  # whether the substep is
    # what a frame leaves inexact: each is 0 where all of it was resolved
    residual="f8",  # largest of the contact solves [m/s]
    residual_body_a="i8",  # its bodies, or -1
    residual_body_b="i8",
    dropped_time="f8",  # part of the frame that was not simulated [s]
    guarded_energy="f8",  # energy that substeps and parting added to islands [J]
    unpaid_energy="f8",  # what of a substep's the guard could not take out of their motion [J]
    parted_energy="f8",  # the sum of a frame [J]
    removal="i8",
    depth="i8",
    angle="i8",
    passes="i8",
    posture="i8",
    attraction_time="f8",  # in which what parts a chain from the tracker falls to 1 / e [s]
    attraction_parts="i8",  # of a frame, at most
    self_collision="i8",  # 1: links of one driver meet
    # stages that the plan leaves out where 1: the driven loop; removal of its overlap; everything that
    # contacts of simulated bodies ask for; and their rotation, where they meet nothing
    skip_drive="i8",
    skip_removal="i8",
    skip_contact="i8",
    skip_rotation="i8",
    # rooms that pieces keep to for some frames (`rooms`)
    update_fat_bounds="i8",  # 1: they are sought
    has_fat_bounds="i8",  # 1: there are some
    simulated_isolated="i8",  # 1: no simulated body can meet anything
    driven_isolated="i8",  # 1: no driven body can
    fat_bounds_wait="i8",  # frames until new ones are sought
    flight_horizon="i8",  # frames for which simulated bodies have room
    restitution=("f8", (8, 8)),  # per pair of materials
    friction_coefficient=("f8", (8, 8)),
    random="i8",  # state of the generator
    pair_count="i8",
    contact_count="i8",
    stage_seconds=("f8", (len(STAGES),)),
    counters=("i8", (len(COUNTERS),)),
    clock=("i8", (2,)),
    groups=(GROUP, (3,)),  # of the broad phase: pieces of fixed, simulated and driven bodies
    # points that were held last, relative to the body that remembers them: the next hold starts from their
    # forces [N]
    warm_start_next=("i8", (WARM_START_CAPACITY,)),  # next one of the body, counted from 1, or 0
    warm_start_pieces=("i8", (WARM_START_CAPACITY, 2)),
    warm_start_point=("f8", (WARM_START_CAPACITY, 3)),
    warm_start_force=("f8", (WARM_START_CAPACITY, 3)),
    depth_cache=(DEPTH_CACHE_ENTRY, (DEPTH_CACHE_SIZE,)),
    depth_cache_clock="i8",  # look-ups in `walks` so far
    solver=SOLVER,
    newton_work="f8",  # multiplications that Newton's method may still take in this frame
    # scratch of overlap removal, and of impulses: B against A, both surfaces, across the normal
    shift=VECTOR,
    planes=("f8", (4, 4)),
    velocity=VECTOR,
    velocity_a=VECTOR,
    velocity_b=VECTOR,
    tangent=VECTOR,
    impulse=VECTOR,
    mobility=MATRIX,
    # end effector and goal of inverse kinematics, and scratch of damped least squares
    point=VECTOR,
    goal=VECTOR,
    square=MATRIX,
    inverse=MATRIX,
    away=VECTOR,
    pull=VECTOR,
    # scratch of convex depth: A's pose in B's frame, vertices of the Minkowski difference, and the points and
    # corners they come from
    turn=MATRIX,
    gap=VECTOR,
    deepest=VECTOR,  # EPA's direction of least reach
    weights=("f8", (4,)),  # barycentric, of the nearest point
    w=("f8", (EPA_VERTICES, 3)),
    a=("f8", (EPA_VERTICES, 3)),
    corner=("i8", (EPA_VERTICES, 2)),
    # of EPA's polytope: see polytope.py. 16 bits without a sign spare Numba's check for negative indices
    start=("u2", (4 * EPA_FACES,)),
    twin=("u2", (4 * EPA_FACES,)),
    normal=("f8", (EPA_FACES, 3)),
    level=("f8", (EPA_FACES,)),
    key=("f8", (EPA_FACES,)),
    open=("u2", (EPA_FACES,)),  # faces to be looked at
    stack=("u2", (EPA_FACES,)),  # half-edges of the flood
    feature=("i8", (3, 2)),  # corners of A and B that carry the witnesses
    feature_count="i8",
)

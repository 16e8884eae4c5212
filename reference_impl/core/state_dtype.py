"""The state record: settings, clocks, counters and scratch."""

from touchstone.reference_impl.core.conventions import (
    COLUMN_LEVELS,
    DEPTH_CACHE_SIZE,
    EPA_FACES,
    EPA_VERTICES,
    FACE_CORNERS,
    WARM_START_CAPACITY,
)
from touchstone.reference_impl.core.counters import COUNTERS, STAGES
from touchstone.reference_impl.core.dtypes import MATRIX, VECTOR, record
from touchstone.reference_impl.core.solver_dtypes import SOLVER

MATERIAL_CAPACITY = 8
"""Most materials in a world: the number of rows of the two tables of `STATE`."""
GROUP = record(
    first="i8",  # its slots, and the capacity for columns, are first to end - 1
    end="i8",
    single_column="i8",  # 1: one column holds all pieces
    filter_groups="i8",  # 1 + changes of filter group along the list
    columns="i8",
    levels="i8",  # 1 + highest level in use
    width="f8",  # cell width of level 0 [m]
    tally=("i8", (COLUMN_LEVELS,)),  # columns of each level
    widest=("f8", (COLUMN_LEVELS,)),  # scratch
)
DEPTH_CACHE_ENTRY = record(
    used="i8",  # time stamp of the last look-up, 0 for never
    piece_a="i8",
    piece_b="i8",
    face="i8",  # box face of the last result, or 0: see `depth_cache.store_entry_of_pair`
    count="i8",  # number of difference vertices of the last feature, stored as corners of A and B
    corner=("i8", (3, 2)),
    # by side: corner that is the support point for directions within `cone` (squared, 1) of `toward`
    best=("i8", (2,)),
    steady=("i8", (2,)),  # look-ups since the corner or its cone changed
    toward=("f8", (2, 3)),  # piece frame
    cone=("f8", (2,)),
)
STATE = record(
    dt="f8",
    gravity=VECTOR,
    detection="i8",
    least_width="f8",  # least width of the pieces that a link may meet, those of other drivers apart [m]
    impact_gap="f8",  # gap at which an impact is found [m]
    v_rest="f8",  # upper limit of the approach speed without bounce [m/s]
    contact_turn="f8",  # largest turn of a curved contact within half a substep [rad]
    joint_error="f8",  # error of a step of mechanisms [m or rad]
    event_rows="i8",  # contact rows of moving bodies in a frame beyond which its substeps are dense
    factor_work="f8",  # most multiplications of a factorisation; larger islands are solved by sweeps alone
    frame_work="f8",  # multiplications of a frame after which solves end after their first methods
    jams="i8",  # 1: a contact jammed in the last substep, of JAM_SHARE of a frame
    halvings="i8",  # halvings of substeps of the frame so far, whose curved contacts did not close
    calm_events="i8",  # substeps of the frame so far that ended early for the accuracy of curved contacts
    rows="i8",  # contact rows of the frame's substeps so far
    last_rows="i8",  # contact rows of the last substep
    dense_frame="i8",  # 1: the last frame had dense substeps, and events
    dense_substep="i8",  # 1: the substep is dense
    settling="f8",  # residual left to the substep by a solve before it [m/s]; 0 in other solves
    driven_loop="i8",  # 1: drivers move in the simulated loop now
    led_loop="i8",  # 1: one of them leads contacts by the law of positions
    coupled_loop="i8",  # 1: one of those that lead is on a coupling
    curved="i8",  # 1: a row of the substep is curved
    may_halve="i8",  # 1: a contact that agrees at the end of a substep alone, and sinks there, may halve it
    halves="i8",  # 1: one does
    led="i8",  # 1: islands obey the law of positions
    slack="f8",  # gap left to contacts on mechanisms at the end of a substep, where no load changes it [m]
    lead="f8",  # of the law that the rows of drivers ask (`driver_motion`) [1]; 0 in impacts
    separates="i8",  # 1 while separation solves for the least motion
    mechanisms="i8",  # 1: joints connect bodies
    driven_count="i8",  # rows of `drivers` that follow trackers; mechanisms come after them
    compound="i8",  # 1: a body has several pieces
    moving_surfaces="i8",  # 1: the material of a piece's surface moves
    # errors of a frame: each is 0 if the frame was resolved exactly
    missed="i8",  # 1: a warm start of this frame missed its target
    missed_before="i8",  # 1: one of the previous frame did
    residual="f8",  # largest residual of the contact solves whose impulses act [m/s]
    residual_body_a="i8",  # its bodies, or -1
    residual_body_b="i8",
    past_residual="f8",  # the same without the resting contacts of the present substep
    past_body_a="i8",
    past_body_b="i8",
    other_residual="f8",  # the same with those of islands that are not `led`
    other_body_a="i8",
    other_body_b="i8",
    only_led="i8",  # 1: contacts are solved in islands that are `led` only
    dropped_time="f8",  # part of the frame that was not simulated [s]
    guarded_energy="f8",  # energy that substeps and separation added to islands [J]
    unpaid_energy="f8",  # part of a substep's added energy that the guard could not remove [J]
    parted_energy="f8",  # sum of `unpaid_energy` over the frame [J]
    removal="i8",
    depth="i8",
    attraction_parts="i8",  # most parts of the attraction in a frame
    self_collision="i8",  # 1: links of one driver may collide
    # stages that the plan skips if 1: the driven loop; its overlap removal; all contact stages of simulated
    # bodies; and the rotation of bodies that never collide
    skip_drive="i8",
    skip_removal="i8",
    skip_contact="i8",
    skip_rotation="i8",
    # fat AABBs over several frames (`fat_bounds`)
    update_fat_bounds="i8",  # 1: enabled
    has_fat_bounds="i8",  # 1: at least one body is isolated
    simulated_isolated="i8",  # 1: no simulated body can collide
    driven_isolated="i8",  # 1: no driven body can collide
    fat_bounds_wait="i8",  # frames until the next update
    flight_horizon="i8",  # frames of flight that the fat bounds of simulated bodies enclose
    restitution=("f8", (8, 8)),  # per pair of materials
    friction_coefficient=("f8", (8, 8)),
    statics="i8",  # 1: a pair has static friction
    static_friction=("f8", (8, 8)),  # 0: that of sliding
    moments="i8",  # 1: a pair has rolling or torsional friction
    rolling=("f8", (8, 8)),  # their lengths [m]
    torsion=("f8", (8, 8)),
    moment_work="f8",  # of these frictions in the frame [J]
    random="i8",  # state of the random generator
    contact_count="i8",
    stage_seconds=("f8", (len(STAGES),)),
    counters=("i8", (len(COUNTERS),)),
    clock=("i8", (2,)),
    groups=(GROUP, (3,)),  # broad-phase groups: pieces of fixed, simulated and driven bodies
    # contact points of the last solve, relative to the body that stores them, and their forces [N], which
    # warm-start the next solve
    warm_start_next=("i8", (WARM_START_CAPACITY,)),  # 1-based index of the body's next point, or 0
    warm_start_pieces=("i8", (WARM_START_CAPACITY, 2)),
    warm_start_point=("f8", (WARM_START_CAPACITY, 3)),
    warm_start_force=("f8", (WARM_START_CAPACITY, 3)),
    warm_start_normal=("f8", (WARM_START_CAPACITY, 3)),
    warm_start_stuck=("i8", (WARM_START_CAPACITY,)),
    warm_start_moment=("f8", (WARM_START_CAPACITY, 3)),
    # time from the substep's start to an earlier solve's end, negative of the substep before; 0: unknown [s]
    last_time="f8",
    depth_cache=(DEPTH_CACHE_ENTRY, (DEPTH_CACHE_SIZE,)),
    depth_cache_clock="i8",  # look-ups in `depth_cache` so far
    solver=SOLVER,
    work_left="f8",  # multiplications of factorisations left in this frame
    # scratch of overlap removal, and of impulses: velocity of B relative to A, of both surfaces; tangent
    shift=VECTOR,
    planes=("f8", (4, 4)),
    velocity=VECTOR,
    velocity_a=VECTOR,
    velocity_b=VECTOR,
    tangent=VECTOR,
    impulse=VECTOR,
    mobility=MATRIX,
    # inverse kinematics: end effector and goal
    point=VECTOR,
    goal=VECTOR,
    # scratch of convex depth: A's pose in B's frame, vertices of the Minkowski difference, the support points
    # of A, and the corners of A and B
    turn=MATRIX,
    gap=VECTOR,
    deepest=VECTOR,  # EPA's direction of least support value
    weights=("f8", (4,)),  # barycentric weights of the nearest point
    w=("f8", (EPA_VERTICES, 3)),
    a=("f8", (EPA_VERTICES, 3)),
    corner=("i8", (EPA_VERTICES, 2)),
    # corners of the features of A and B, clipped by each other, in the contact frame (`contact_manifold`)
    lower=("f8", (2 * FACE_CORNERS, 3)),
    upper=("f8", (2 * FACE_CORNERS, 3)),
    patch=("f8", (2 * FACE_CORNERS, 3)),  # points of a manifold with several pieces
    toward=VECTOR,  # direction in which a cap shows a point of its rim, or 0
    # EPA's polytope (`epa.py`); unsigned 16-bit indices spare Numba's check for negative indices
    start=("u2", (4 * EPA_FACES,)),
    twin=("u2", (4 * EPA_FACES,)),
    normal=("f8", (EPA_FACES, 3)),
    level=("f8", (EPA_FACES,)),
    key=("f8", (EPA_FACES,)),
    open=("u2", (EPA_FACES,)),  # open faces
    stack=("u2", (EPA_FACES,)),  # half-edges of the flood fill
    feature=("i8", (3, 2)),  # corners of A and B whose feature holds the witnesses
    feature_count="i8",
)

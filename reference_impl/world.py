"""The structured arrays a scene lives in: the border between Python and the compiled step.

Eight arrays hold everything: bodies, pieces, joints, drivers, vertices, pairs, contacts (the log of a
frame) and one record of `state` with settings, clocks, counters and scratch. Units as in `conventions.py`.
"""

from typing import NamedTuple

import numpy as np

from reference_impl.conventions import (
    ANDERSON_ROWS,
    ANDERSON_SPAN,
    CHAIN_JOINTS,
    COUNTERS,
    EPA_FACES,
    EPA_VERTICES,
    HOLD_MEMORY,
    SPIN_TERMS,
    STAGES,
    STRIP_LEVELS,
    TURN_ROWS,
    WALK_MEMORY,
)

CONE_CORNERS = 12
"""Corners a reach cone may have."""
CHAIN_CAPACITY = 8
"""Chains a driver may have."""
_VECTOR = ("f8", (3,))
_QUATERNION = ("f8", (4,))
_MATRIX = ("f8", (3, 3))


def _record(**fields):
    return np.dtype(
        [(name, *(kind if isinstance(kind, tuple) else (kind,))) for name, kind in fields.items()]
    )


BODY = _record(
    # first, and in few cache lines, what sweeps over contacts read
    kind="i8",
    driver="i8",  # index of the driver that moves it, or -1
    inverse_mass="f8",  # zero where impulses do not move it by itself
    velocity=_VECTOR,  # of the centre of mass, world
    omega=_VECTOR,
    center=_VECTOR,  # centre of mass, world
    inverse_inertia=_MATRIX,  # world axes
    chain="i8",  # of its driver's chains the one that moves it, or -1
    hinge="i8",  # of that chain the joint that it is fixed beyond, or -1
    above="i8",  # the nearest link with pieces that it hangs on, or -1: they never meet
    material="i8",
    mass="f8",
    center_of_mass=_VECTOR,  # body frame
    axis=_VECTOR,  # of the least moment of inertia, body frame
    inertia=_MATRIX,  # about the centre of mass, body axes
    position=_VECTOR,  # of the origin, world
    orientation=_QUATERNION,
    rotation=_MATRIX,  # of `orientation`
    old_center=_VECTOR,  # at the start of a substep
    old_orientation=_QUATERNION,
    old_velocity=_VECTOR,
    old_omega=_VECTOR,
    moved="i8",  # of a link: whether it was posed anew
    shown_center=_VECTOR,  # of a link, at the start of a frame
    shown_orientation=_QUATERNION,
    # its way over a substep (`motion`)
    moves="i8",  # 0: it stays, whatever is written below
    travel=_VECTOR,  # of the centre of mass: at fraction s, s travel + s^2 travel_bend [m]
    travel_bend=_VECTOR,
    turn=_VECTOR,  # world rotation vector [rad]
    turn_bend=_VECTOR,
    spin_steps="i8",  # of the free rotation; 0: by the rotation vector; -1: that too, with momentum kept
    spin_step="i8",  # the one that is expanded
    spin_span="f8",  # of a step [s]
    spin_start=_QUATERNION,  # orientation at its start
    spin_terms="i8",
    turn_series=("f8", (SPIN_TERMS, 4)),  # quaternion turned since then
    momentum_series=("f8", (SPIN_TERMS, 3)),  # body axes
    omega_series=("f8", (SPIN_TERMS, 3)),
    spin_rate=_VECTOR,  # angular velocity where it was last posed [rad/s]
    spin_most="f8",  # bound on |omega| [rad per substep]
    spin_bend="f8",  # bound on |omega'| [rad per substep^2]
    memory="i8",  # first contact point it remembers, counted from 1, or 0
    momentum=_VECTOR,  # angular, about the centre of mass, world
    # its room (`rooms`): of a simulated body's centre; of a link, where it was, and how far it may go
    # from there and turn
    clear="i8",  # of a link: 1 while it can meet nothing
    room_low=_VECTOR,
    room_high=_VECTOR,
    room_position=_VECTOR,
    room_rotation=_MATRIX,
    room_reach="f8",
    room_margin="f8",
    scratch=_MATRIX,
)
SLOT = _record(
    low=_VECTOR,  # bounding box of the piece
    high=_VECTOR,
    piece="i8",
    owner="i8",
)
STRIP = _record(
    y="i8",  # its square of the y-z plane, in units of its level's width
    z="i8",
    level="i8",
    first="i8",  # slots first to end - 1
    end="i8",
    next="i8",  # strip with the same hash, or -1
    bucket="i8",  # first strip with the hash of this place, or -1
    low=("f8", (2,)),  # bounds of its boxes along y and z
    high=("f8", (2,)),
)
GROUP = _record(
    first="i8",  # slots, and room for strips, first to end - 1
    end="i8",
    few="i8",  # 1: all in one strip
    owners="i8",  # changes of owner along the list, and 1
    strips="i8",
    levels="i8",  # highest one in use, and 1
    width="f8",  # of the squares of level 0 [m]
    tally=("i8", (STRIP_LEVELS,)),  # strips of each level
    widest=("f8", (STRIP_LEVELS,)),  # scratch
)
PIECE = _record(
    body="i8",
    kind="i8",
    first_vertex="u4",
    vertex_count="u4",
    cells="u4",  # a hull's table of directions has so many along a side; 0: none
    size=_VECTOR,  # half extents, half axes, or (0, 0, half length)
    radius="f8",  # round a core: of a sphere its centre, of a capsule a segment
    center=_VECTOR,  # a point well inside the core, piece frame
    position=_VECTOR,  # body frame
    rotation=_MATRIX,
    world_position=_VECTOR,
    world_rotation=_MATRIX,
    low=_VECTOR,  # bounding box, world
    high=_VECTOR,
    room_low=_VECTOR,  # what it keeps to while its body's `clear`, and those of all others, hold
    room_high=_VECTOR,
    marked="i8",  # first marked row of `pairs` at it, counted from 1, or 0
    owner="i8",  # pieces of one owner never meet: its body, or -1 - its driver
    # scratch of the broad phase: row k holds slot k and strip k, whatever piece k is
    slot=SLOT,
    order="i8",  # piece that this slot is to hold
    strip_of="i8",  # strip of the piece that this slot held
    strip=STRIP,
)
VERTEX = np.dtype(
    {"names": ["position", "lists"], "formats": [_VECTOR, ("u2", (4, 4))], "offsets": [0, 0], "itemsize": 32}
)
"""A row is either a vertex of a hull by its position, piece frame, or four lists of the hull's table of
directions: see shapes.corner_of_hull. So dense, the tables of a scene's hulls stay in cache."""
JOINT = _record(
    parent="i8",
    child="i8",
    chain="i8",  # of its driver's chains the one it is in, or -1
    position=_VECTOR,  # of the hinge, parent frame
    axis=_VECTOR,  # parent frame
    rest=_MATRIX,  # child in parent at angle 0
    lower="f8",
    upper="f8",
    angle="f8",
    posed_angle="f8",  # at which its child is posed, cosine and sine included; NaN where it may not be
    rate="f8",
    shown_angle="f8",  # at the start of a frame
    free_angle="f8",  # in the last free pose
    entry_angle="f8",  # when removal began
    target_angle="f8",  # at the end of the frame
    goal_angle="f8",  # of the frame's attraction
    last_target_angle="f8",  # at its start
    target_rate="f8",
    # first of a ball joint's three hinges: its reach cone, in the hinges' axes at angles 0
    cone_count="i8",  # corners; 0 where no ball joint starts
    cone_axes=_MATRIX,  # as columns, in the frame of the parent
    cone_center=_VECTOR,
    cone_mark=_VECTOR,  # direction of twist 0 where the bone points to the centre
    cone=("f8", (CONE_CORNERS, 3)),
    cone_cap="f8",  # cosine of the angle round the centre within which the bone is inside
    twist_lower="f8",
    twist_upper="f8",
    # scratch of inverse kinematics: the hinge's, then the ball joint's
    world_axis=_VECTOR,
    end_effector=_VECTOR,  # in the child's frame
    cosine="f8",  # of the angle
    sine="f8",
    last_angle="f8",  # before the hinge was turned
    pass_angle="f8",  # before the pass
    pass_turn="f8",
    best_angle="f8",
    column=_VECTOR,  # velocity of the end effector at rate 1
    bone=_VECTOR,
    mark=_VECTOR,
    outward=_VECTOR,  # across the edge of the cone that the bone was put on; zero on none
    nearest=_VECTOR,
    corner=_VECTOR,
    next_corner=_VECTOR,
    normal=_VECTOR,  # of the plane through both
    foot=_VECTOR,
    zero=_VECTOR,  # the mark of twist 0
)
TURN = _record(
    piece_a="i8",  # of the pair
    piece_b="i8",
    seen="i8",  # whether that touched when pairs were last looked at
    body="i8",  # a link of a chain
    other="i8",  # the body it meets
    first=("i8", (2,)),  # hinges that move the one and the other
    last=("i8", (2,)),
    point=_VECTOR,  # of the link, its frame
    other_point=_VECTOR,  # of the other, its frame
    normal=_VECTOR,  # out of the other
    height="f8",  # that the one point is to be at above the other, along the normal [m]
    world_point=_VECTOR,
    depth="f8",
    fall=("f8", (2, CHAIN_JOINTS)),  # of the depth per turn of these hinges [m]
    push="f8",  # multiplier [1/m]
    kept="f8",  # that of the last pulled turn
)
DRIVER = _record(
    root="i8",
    first_joint="i8",
    joint_count="i8",
    chain_count="i8",
    chains=("i8", (CHAIN_CAPACITY, 2)),  # first and last joint of each, root to tip
    order=("i8", (CHAIN_CAPACITY,)),  # in which this frame frees the chains
    rank=("i8", (CHAIN_CAPACITY,)),  # of each chain in that order
    mass="f8",
    inverse_mass="f8",  # in contacts; zero where it has chains
    stiffness="f8",
    damping="f8",
    position=_VECTOR,  # coupling state: the root's origin
    orientation=_QUATERNION,
    velocity=_VECTOR,
    omega=_VECTOR,
    old_velocity=_VECTOR,  # at the start of a substep
    old_omega=_VECTOR,
    center=_VECTOR,  # centre of mass of the whole, world
    inertia=_MATRIX,  # of the whole about `center`, world axes
    inverse_inertia=_MATRIX,
    # tracker at the frame's start and end; side by side, as they are handed over in one copy
    old_target_position=_VECTOR,
    old_target_orientation=_QUATERNION,
    target_position=_VECTOR,
    target_orientation=_QUATERNION,
    free_position=_VECTOR,  # last free pose
    free_orientation=_QUATERNION,
    has_free="i8",
    is_free="i8",  # of overlap, after this frame's removal
    stride="f8",  # by which attraction turns a hinge in this frame at most [rad]
    turn_count="i8",  # what its chains touch: rows of the least turn
    turns=(TURN, (TURN_ROWS,)),
    entry_position=_VECTOR,  # pose when removal began
    entry_orientation=_QUATERNION,
    scratch=("f8", (3, 3)),
)
PAIR = _record(
    # first what sweeps over contacts read
    body_a="i8",
    body_b="i8",
    friction="f8",
    normal=_VECTOR,
    point=_VECTOR,  # contact point of its impulses
    floor="f8",  # speed along the normal that a hold or a patch's impact leaves at least [m/s]
    response=_VECTOR,  # velocity of B against A per impulse on B along the normal at `point` [1/kg]
    along="f8",  # impulse per speed along the normal [kg], the effective mass of Eq. 9
    across="f8",  # and across it, the mean
    held=_VECTOR,  # impulse on B while the contact holds [N s]
    kept=_VECTOR,  # `held` before the sweep
    sibling="i8",  # next row of the patch, or -1
    key="f8",  # approach speed in the priority queue [m/s]
    close="f8",  # speed at which a near pair may still close its gap [m/s]
    piece_a="i8",
    piece_b="i8",
    restitution="f8",
    distance="f8",
    point_a=_VECTOR,  # witnesses, world
    point_b=_VECTOR,
    next_marked="i8",  # next marked row at the same piece, counted from 1, or 0
    patch="i8",  # first row of the pair's patch, or -1
    free_slip="f8",  # speed of sliding after forces alone, along the direction before them [m/s]
    spare=_VECTOR,  # another answer, while the energy guard compares the two [N s]
    before_a=_VECTOR,  # surface velocities at the start of the hold [m/s]
    before_b=_VECTOR,
)
CONTACT = _record(
    time="f8",  # since the start of the frame
    body_a="i8",
    body_b="i8",
    position=_VECTOR,
    normal=_VECTOR,
    distance="f8",
    impulse=_VECTOR,
    velocity_a_before=_VECTOR,
    velocity_b_before=_VECTOR,
    velocity_a_after=_VECTOR,
    velocity_b_after=_VECTOR,
)
WALK = _record(
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
STATE = _record(
    dt="f8",
    gravity=_VECTOR,
    friction="i8",
    restitution_law="i8",
    impulses="i8",
    flight="i8",
    detection="i8",
    impact_gap="f8",  # at which an impact is found [m]
    v_rest="f8",  # most of the approach speed up to which nothing bounces [m/s]
    event_rows="i8",  # contacts that the substeps of a frame may hold in total while each ends at an impact
    rows="i8",  # of the frame's substeps so far
    last_rows="i8",  # of the last substep
    crowded="i8",  # whether the substep is
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
    seek_rooms="i8",  # 1: they are sought
    rooms="i8",  # 1: there are some
    flight_clear="i8",  # 1: no simulated body can meet anything
    drive_clear="i8",  # 1: no driven body can
    room_wait="i8",  # frames until new ones are sought
    room_flight="i8",  # frames for which simulated bodies have room
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
    held_next=("i8", (HOLD_MEMORY,)),  # next one of the body, counted from 1, or 0
    held_pieces=("i8", (HOLD_MEMORY, 2)),
    held_point=("f8", (HOLD_MEMORY, 3)),
    held_force=("f8", (HOLD_MEMORY, 3)),
    # scratch of Anderson's acceleration: sweeps kept, size of the last one's step, changes of steps and
    # answers from sweep to sweep, normal equations of their weights
    span="i8",  # most sweeps kept
    steps="i8",
    step_size="f8",
    last_step=("f8", (ANDERSON_ROWS, 3)),
    last_answer=("f8", (ANDERSON_ROWS, 3)),
    step_change=("f8", (ANDERSON_SPAN, ANDERSON_ROWS, 3)),
    answer_change=("f8", (ANDERSON_SPAN, ANDERSON_ROWS, 3)),
    step_product=("f8", (ANDERSON_SPAN, ANDERSON_SPAN)),
    step_factor=("f8", (ANDERSON_SPAN, ANDERSON_SPAN)),
    step_slope=("f8", (ANDERSON_SPAN,)),
    weight=("f8", (ANDERSON_SPAN,)),
    walks=(WALK, (WALK_MEMORY,)),
    recalls="i8",  # look-ups in `walks` so far
    # scratch of overlap removal, and of impulses: B against A, both surfaces, across the normal
    shift=_VECTOR,
    planes=("f8", (4, 4)),
    velocity=_VECTOR,
    velocity_a=_VECTOR,
    velocity_b=_VECTOR,
    tangent=_VECTOR,
    impulse=_VECTOR,
    mobility=_MATRIX,
    # end effector and goal of inverse kinematics, and scratch of damped least squares
    point=_VECTOR,
    goal=_VECTOR,
    square=_MATRIX,
    inverse=_MATRIX,
    away=_VECTOR,
    pull=_VECTOR,
    # scratch of convex depth: A's pose in B's frame, vertices of the Minkowski difference, and the points and
    # corners they come from
    turn=_MATRIX,
    gap=_VECTOR,
    deepest=_VECTOR,  # EPA's direction of least reach
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
MATERIAL_CAPACITY = 8
"""Materials a world may hold: the two tables of `STATE` have this many rows."""


class World(NamedTuple):
    """All arrays of a scene, in the order the compiled step takes them."""

    bodies: np.ndarray  # BODY
    pieces: np.ndarray  # PIECE
    joints: np.ndarray  # JOINT
    drivers: np.ndarray  # DRIVER
    vertices: np.ndarray  # VERTEX, rows of all hulls
    pairs: np.ndarray  # PAIR, capacity
    contacts: np.ndarray  # CONTACT, capacity
    state: np.ndarray  # STATE, one record

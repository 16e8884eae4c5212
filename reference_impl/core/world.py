"""The structured arrays of a scene: the interface between Python and the compiled step.

Eight arrays hold all data: bodies, pieces, joints, drivers, vertices, pairs, contacts (the log of a frame)
and one `state` record with settings, clocks, counters and scratch. For units see `conventions.py`.
"""

from typing import NamedTuple

import numpy as np

from touchstone.reference_impl.core.conventions import SPIN_TERMS
from touchstone.reference_impl.core.dtypes import MATRIX, QUATERNION, VECTOR, record

GUARD = record(
    state="i8",  # of a body while the guard runs: GUARD_UNVISITED, GUARD_SUMMED or GUARD_SLOWED
    before="f8",  # kinetic and potential energy at the start of a substep [J]
    # island totals, stored at the island's root mover
    rise="f8",  # energy increase over the substep [J]
    motion="f8",  # kinetic energy [J]
    scale="f8",  # sum of energies, for the rounding tolerance [J]
    mass="f8",
    momentum=VECTOR,
    grounded="i8",  # 1: it touches a body that impulses do not move
    carrier=VECTOR,  # velocity of that body
    old_carrier=VECTOR,  # that at the start of the substep
    carrier_way=VECTOR,  # its way
    old_momentum=VECTOR,  # of the island at the start of the substep
    moment=VECTOR,  # sum of its bodies' masses times their ways [kg m]
    driven="i8",  # 1: it contains a driver
    alone="i8",  # 1: a mechanism without contacts, which limits hold
    counted="i8",  # 1: the energy removed from it is counted
    curved="i8",  # 1: it has a curved contact
    limited="i8",  # 1: limits of joints may take energy from it
    work="f8",  # of friction over the substep, where it has one [J]
    # a free island (`island_motion`), before and after the substep
    old_center=VECTOR,
    old_spin=VECTOR,  # angular momentum about its centre of mass
    center=VECTOR,
    spin=VECTOR,
    inertia=MATRIX,
    turning=VECTOR,  # angular velocity as one rigid body [rad/s]
    turn=VECTOR,  # missing part of that angular velocity
)
BODY = record(
    # the fields that sweeps over contacts read come first, in few cache lines
    kind="i8",
    driver="i8",  # index of the driver or the mechanism that moves it, or -1
    inverse_mass="f8",  # zero if impulses do not move this body by itself
    velocity=VECTOR,  # of the centre of mass, world
    omega=VECTOR,
    center=VECTOR,  # centre of mass, world
    inverse_inertia=MATRIX,  # world axes
    chain="i8",  # index of the driver's chain that moves it, or -1
    hinge="i8",  # joint of that chain after which it is rigidly attached, or -1
    first_piece="i8",
    piece_count="i8",
    above="i8",  # nearest ancestor link with pieces, or -1: the two never collide
    beside=("i8", (3,)),  # bodies to which joints connect it, or -1: they never collide either
    material="i8",
    mass="f8",
    center_of_mass=VECTOR,  # body frame
    axis=VECTOR,  # principal axis of the least moment of inertia, body frame
    inertia=MATRIX,  # about the centre of mass, body axes
    position=VECTOR,  # of the body's origin, world
    orientation=QUATERNION,
    rotation=MATRIX,  # of `orientation`
    old_center=VECTOR,  # at the start of a substep
    old_orientation=QUATERNION,
    old_velocity=VECTOR,
    old_omega=VECTOR,
    moved="i8",  # of a link: whether its pose was updated
    # of rows with a driver that moves in the loop (`driver_motion`)
    lead_velocity=VECTOR,  # of a link: the solver's velocity less that at the end of the substep
    lead_omega=VECTOR,
    led="i8",  # 1: its island contains such a driver, and its path ends at these velocities
    path_velocity=VECTOR,
    path_omega=VECTOR,
    end_velocity=VECTOR,  # of a mechanism's body: velocities at the end of its substep
    end_omega=VECTOR,  # scratch of `end_correction` for others
    curve=VECTOR,  # of a link: way of its centre over the substep beyond its mean velocity's [m]
    curve_turn=VECTOR,  # the same of its rotation vector [rad]
    shown_center=VECTOR,  # of a link, at the start of a frame
    shown_orientation=QUATERNION,
    # motion over a substep (`swept_motion`)
    prescribed="i8",  # 1: it moves in the loop along a prescribed path
    moves="i8",  # 0: it does not move, and the fields below are ignored
    travel=VECTOR,  # of the centre of mass: at fraction s, s travel + s^2 travel_bend [m]
    travel_bend=VECTOR,
    turn=VECTOR,  # world rotation vector [rad]
    turn_bend=VECTOR,
    spin_steps="i8",  # steps of the free rotation's series; 0: the rotation is `turn` and `turn_bend`
    spin_keeps="i8",  # KEEPS_*; a fixed axis counts as KEEPS_NOTHING
    spin_step="i8",  # step whose series is stored
    spin_span="f8",  # length of a step [s]
    spin_start=QUATERNION,  # orientation at the start of the step
    spin_terms="i8",
    turn_series=("f8", (SPIN_TERMS, 4)),  # quaternion of the rotation since then
    momentum_series=("f8", (SPIN_TERMS, 3)),  # body axes
    omega_series=("f8", (SPIN_TERMS, 3)),
    spin_rate=VECTOR,  # angular velocity at the last evaluated pose [rad/s]
    spin_most="f8",  # bound on |omega| [rad per substep]
    spin_bend="f8",  # bound on |omega'| [rad per substep^2]
    # of a mover (`islands`): root mover of its island, first row of the island, index in the solver
    island="i8",
    first_row="i8",
    row_count="i8",  # rows of its island, if it is the root
    mover="i8",
    guard=GUARD,
    memory="i8",  # 1-based index of its first warm-start point, or 0
    momentum=VECTOR,  # angular, about the centre of mass, world
    # data that decides whether discrete tests may miss a collision (`swept_motion.set_path`)
    width="f8",  # least width of its pieces [m]
    reach="f8",  # largest distance of its pieces' cores from its centre of mass [m]
    path="f8",  # bound on the path of its points in a substep; 0 if impulses do not move it [m]
    free_center=VECTOR,  # of a link, in the last free pose
    # fat bounds (`fat_bounds`): of a simulated body's centre; or a link's reference pose, and its margins of
    # translation and rotation
    isolated="i8",  # of a link: 1 while it cannot collide
    fat_low=VECTOR,
    fat_high=VECTOR,
    fat_position=VECTOR,
    fat_rotation=MATRIX,
    fat_reach="f8",
    fat_margin="f8",
    scratch=MATRIX,
    sums=MATRIX,  # sums of Eq. 1 in profile `paper` (`paper/penetration_depth.py`)
)
SLOT = record(
    low=VECTOR,  # bounding box of the piece
    high=VECTOR,
    piece="i8",
    filter_group="i8",
)
COLUMN = record(
    y="i8",  # its cell in the y-z plane, in units of the level's cell width
    z="i8",
    level="i8",
    first="i8",  # slots first to end - 1
    end="i8",
    next="i8",  # next column with the same hash, or -1
    bucket="i8",  # first column in the hash bucket of this index, or -1
    low=("f8", (2,)),  # bounds of the column's boxes along y and z
    high=("f8", (2,)),
)
PIECE = record(
    body="i8",
    kind="i8",
    first_vertex="u4",
    vertex_count="u4",
    cells="u4",  # cells along a side of the hull's support table; 0: no table
    size=VECTOR,  # half extents, half axes, (radius, radius, half length), or (0, 0, half length)
    radius="f8",  # around the core: a sphere's centre or a capsule's segment
    center=VECTOR,  # a point well inside the core, piece frame
    width="f8",  # lower bound on the distance between two parallel planes that enclose it [m]
    reach="f8",  # largest distance of its core from its origin [m]
    position=VECTOR,  # body frame
    rotation=MATRIX,
    # motion of its surface's material relative to the body: velocity at the centre of mass, body axes
    surface_velocity=VECTOR,
    surface_omega=VECTOR,
    world_position=VECTOR,
    world_rotation=MATRIX,
    low=VECTOR,  # bounding box, world
    high=VECTOR,
    fat_low=VECTOR,  # fat AABB: `isolated` flags are valid while every piece stays inside its own
    fat_high=VECTOR,
    marked="i8",  # its first marked row of `pairs`, or -1
    filter_group="i8",  # pieces of one group never collide: those of one body or of one driver
    # scratch of the broad phase: row k holds slot k and column k, independent of piece k
    slot=SLOT,
    order="i8",  # piece to be written to this slot
    column_of="i8",  # column of the piece that this slot held
    column=COLUMN,
)
VERTEX = np.dtype(
    {"names": ["position", "lists"], "formats": [VECTOR, ("u2", (4, 4))], "offsets": [0, 0], "itemsize": 32}
)
"""A row holds either the position of a hull's vertex (piece frame) or four lists of the hull's support table
(see `shapes.corner_of_hull`). This dense layout keeps the tables of a scene's hulls in cache."""
PAIR = record(
    # the fields that sweeps over contacts read come first
    body_a="i8",
    body_b="i8",
    friction="f8",
    normal=VECTOR,
    lever_a=VECTOR,  # point of A on which impulses act, in A's place at the start of a substep
    lever_b=VECTOR,
    level="f8",  # its place between the witness on A (0) and on B (1); on the reference face if clipped [1]
    flat_a="i8",  # dimensions of A's touching feature: 2 of a face, 1 of an edge, 0 of a corner or curve
    flat_b="i8",
    edge_a=VECTOR,  # direction of A's feature if it is an edge [1]
    edge_b=VECTOR,
    floor="f8",  # least speed along the normal after a contact solve [m/s]
    curved="i8",  # 1: its velocity changes by rotation within the substep: corrected at its end; -1: hardly
    late_bias="f8",  # that change over half a substep at the velocities that an attempt led to [m/s]
    slides="i8",  # 1: it slides over the whole substep, and friction opposes the mean sliding
    bias=VECTOR,  # change of the relative velocity by rotation, from the middle of a substep to its end [m/s]
    predicted_bias=VECTOR,  # its part by the velocities of the bodies, without drifts and moving surfaces
    bent="i8",  # 1: the path of one of its bodies is bent by a coupling
    resting_impulse=VECTOR,  # impulse on B of the resting contact [N s]
    island="i8",  # root mover of its island, or -1
    next_row="i8",  # next row of its island, or -1
    crowded="i8",  # 1: its island has too many rows to follow their curves
    solver_row="i8",  # its row in the solver while its island is loaded
    next_point="i8",  # next row of the manifold, or -1
    reduced="i8",  # 1: its faces touch in more points than the manifold has
    key="f8",  # approach speed in the priority queue [m/s]
    speculative_speed="f8",  # approach speed allowed to a near pair, which closes its gap [m/s]
    piece_a="i8",
    piece_b="i8",
    restitution="f8",
    distance="f8",
    depth="f8",  # that overlap removal resolves [m]: the whole depth of `distance`, or a share of it
    point_a=VECTOR,  # witnesses, world
    point_b=VECTOR,
    next_marked="i8",  # next marked row at the same piece, or -1
    manifold="i8",  # first row of the pair's manifold, or -1
    patch="i8",  # first row of pairs whose contacts are one manifold (`contact_patch`)
    merged="i8",  # MERGED_*: the body whose other pieces share the row's manifold
    free_slip="f8",  # sliding speed after forces without impulses, along the direction before them [m/s]
    last_force=VECTOR,  # mean contact force from the substep's start to `last_time`, or back to it [N]
    last_normal=VECTOR,  # its normal
    spare=VECTOR,  # alternative impulse: that of the law of positions, or of an impact without rebound [N s]
    before_a=VECTOR,  # surface velocities before the solve [m/s]
    before_b=VECTOR,
    surface_a=VECTOR,  # velocity of A's material relative to A, along the contact plane [m/s]
    surface_b=VECTOR,
    point=VECTOR,  # contact point at the start of a substep
    work="f8",  # of its friction over a substep [J]
    # static friction (`grip`): coefficient of what sticks, 0 if it is no other; of what slides; GRIP_*; and
    # whether it stuck at the end of the last substep
    static="f8",
    sliding_friction="f8",
    grip="i8",
    stuck="i8",
    # rolling and torsional friction: lengths [m], moment on B [N m s], length of the solver's row [m], and
    # angular velocity of B relative to A before the solve, and after forces without impulses [rad/s]
    rolling="f8",
    torsion="f8",
    moment=VECTOR,
    arm="f8",
    turn_before=VECTOR,
    free_turn=VECTOR,
    spare_moment=VECTOR,  # `spare` of the moment [N m s]
    start_normal=VECTOR,  # `normal` then, while the row is moved to the middle
    leaves="f8",  # fraction of the substep at which a contact that ends it without a force leaves, or NEVER
    gap_error="f8",  # change of the gap over a substep beyond that of the mean velocity [m]
    # 1: normal and levers follow parabolas over the substep (`end_correction`); those by which impulses move
    # the bodies, and twice the mean velocity less that there [m/s]
    followed="i8",
    path_normal=VECTOR,
    path_lever_a=VECTOR,
    path_lever_b=VECTOR,
    path_bias=VECTOR,
    normal_way=VECTOR,  # change of the normal over the substep [1]
    predicted_normal=VECTOR,  # of the middle
    predicted_a=VECTOR,
    predicted_b=VECTOR,
    held_floor="f8",  # `floor` while the law of positions is solved
)
CONTACT = record(
    time="f8",  # since the start of the frame
    body_a="i8",
    body_b="i8",
    position=VECTOR,
    normal=VECTOR,
    distance="f8",
    impulse=VECTOR,
    velocity_a_before=VECTOR,
    velocity_b_before=VECTOR,
    velocity_a_after=VECTOR,
    velocity_b_after=VECTOR,
)


class World(NamedTuple):
    """All arrays of a scene, in the argument order of the compiled step.

    `step` passes it to its stages, with the record of `state` in place of the array; a stage passes those
    arrays on that its parts use.
    """

    bodies: np.ndarray  # BODY
    pieces: np.ndarray  # PIECE
    joints: np.ndarray  # JOINT
    drivers: np.ndarray  # DRIVER
    vertices: np.ndarray  # VERTEX, rows of all hulls
    pairs: np.ndarray  # PAIR, capacity
    contacts: np.ndarray  # CONTACT, capacity
    state: np.ndarray  # STATE, one record

    def of_stages(self):
        """The world as `step` passes it to its stages."""
        return self._replace(state=self.state[0])

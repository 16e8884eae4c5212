"""Structured types of the contact solver: an island's rows and movers, and the matrix of Newton steps."""

from touchstone.reference_impl.core.conventions import HINGE_BLOCKS
from touchstone.reference_impl.core.dtypes import MATRIX, VECTOR, record

ROW_CAPACITY = 16_384
"""Most contact points of one island; the solver drops further ones and counts them as lost."""
MOVER_CAPACITY = 8_192
"""Most movers of one island."""
NEWTON_ROWS, NEWTON_MOVERS, NEWTON_BLOCKS = 8_192, 1_024, 60_000
"""Largest island for Newton's method: contact points, movers, and slots of blocks."""

LINK_CAPACITY = 256
"""Most links of chains in contact in one island."""

MOMENT_CAPACITY = 4_096
"""Most contact points of one island with rolling or torsional friction; that of further ones is dropped, and
they count as lost."""
EVEN_ROWS = 48
"""Most contact points of an island with a mechanism whose loads are evened out."""

ROW = record(
    pair="i8",  # its row of `pairs`
    a="i8",  # index of the mover on each side, or -1 if that side does not move
    b="i8",
    link_a="i8",  # index of the link on each side that hinges move, or -1
    link_b="i8",
    r_a=VECTOR,  # from the mover's centre of mass to the contact point
    r_b=VECTOR,
    normal=VECTOR,
    friction="f8",
    kept_friction="f8",  # while a solve leaves it out
    asked="f8",  # floor before what no load changes is left out of it [m/s]
    floor="f8",  # least speed along the normal after the solve [m/s]
    mobility=MATRIX,  # W: change of velocity of B relative to A per impulse on B [1/kg]
    mass="f8",  # effective mass: 3 / trace of W [kg]
    across_1=VECTOR,  # tangent axes t
    across_2=VECTOR,
    along="f8",  # n.W n [1/kg]
    share_1="f8",  # n.W t over n.W n [1]
    share_2="f8",
    across_11="f8",  # tangential W at constant normal velocity [1/kg]
    across_12="f8",
    across_22="f8",
    spread="f8",  # change of its load on a face that leaves the total and its moment as they are
    free=VECTOR,  # velocity of B relative to A without impulses, minus the slip at which it sticks [m/s]
    impulse=VECTOR,  # on B [N s]
    # sweeps: change of the impulse in the last one, and conjugate direction
    swept=VECTOR,
    direction=VECTOR,
    before=VECTOR,  # velocity of B relative to A before forces act, plus that slip [m/s]
    start=VECTOR,  # warm-start impulse
    best=VECTOR,  # impulse of the least residual so far
    # Newton's method: proximal centre, velocity, and change of velocity along a step
    centre=VECTOR,
    velocity=VECTOR,
    rate=VECTOR,
    stiffness="f8",  # [kg]
    first_cone="i8",  # interior-point method: its cones, that of friction first
    cone_count="i8",
)
MOMENT = record(
    row="i8",  # of its contact
    arm="f8",  # angular velocity times `arm` is the row's velocity [m]
    rolling="f8",  # bounds of its impulse across and along the normal, over the contact's normal impulse [1]
    torsion="f8",
    mobility=MATRIX,  # change of its velocity per impulse on B [1/kg]
    mass="f8",  # 3 / trace of that [kg]
    free=VECTOR,  # as of a row [m/s]
    before=VECTOR,
    impulse=VECTOR,  # on B [N s]: the moment over `arm`
    swept=VECTOR,
    direction=VECTOR,
    start=VECTOR,
    best=VECTOR,
    # Newton's method: normal impulse that sets the bounds, and as of a row
    load="f8",
    centre=VECTOR,
    velocity=VECTOR,
    rate=VECTOR,
    stiffness="f8",
)
CONE = record(
    moment="i8",  # the moment that it bounds, or -1: friction
    bound="f8",  # over the normal impulse [1]
    axes=MATRIX,  # of its vectors, times the root of the mass, and those across times the bound
    unit="f8",  # of mass [kg]
    speed=VECTOR,  # v
    load=VECTOR,  # q
    speed_step=VECTOR,
    load_step=VECTOR,
    scaling=VECTOR,  # point W
    stretch="f8",  # size of W
    bend="f8",  # 1 / (1 + first component of W)
    determinant="f8",  # of the scaled vectors
    gap=VECTOR,  # error of v
    slope=("f8", (2,)),  # derivative of the shift of v
    side=("f8", (2,)),  # direction of W across the axis
    kernel=VECTOR,  # eigenvalues of U: along the axis plus and minus that direction, and across both
    lean=("f8", (2,)),  # change of q across per change along the axis, at a fixed v across
    centred=VECTOR,  # q that a step aims at while v stays, and the same of a proximal step
    aim=VECTOR,
    shared="f8",  # of a row's first cone: change of the normal impulse per v, with all its cones
)
MOVER = record(
    body="i8",  # its row of `bodies`: a simulated body, or the root of a driver
    block="i8",  # number of a block of six hinges of a driver's chains, from 1; 0 of a body
    inverse_mass="f8",
    inverse_inertia=MATRIX,
    center=VECTOR,
    velocity=VECTOR,  # change of the centre of mass's velocity by the impulses [m/s]
    omega=VECTOR,
    # sweeps: both before the sweep, and their conjugate directions
    velocity_before=VECTOR,
    omega_before=VECTOR,
    velocity_direction=VECTOR,
    omega_direction=VECTOR,
    inertia=MATRIX,
    place="i8",  # index of its block of six unknowns in the matrix
)
LINK = record(
    mover="i8",  # index of its driver's first block of hinges
    blocks="i8",
    # velocity at the driver's centre of mass and angular velocity per coordinate of a block
    response=("f8", (HINGE_BLOCKS, 6, 6)),
)
SOLVER = record(
    row_count="i8",
    mover_count="i8",
    link_count="i8",
    led="i8",  # 1: a driver in the loop is among the movers, and the rows ask the law of `driver_motion`
    best_residual="f8",  # [m/s]
    target="f8",  # residual at which a solve ends [m/s]
    accepted="f8",  # residual at which a solve counts as converged [m/s]
    work="f8",  # multiplications of a factorisation; 0 before `lay_out`, -1 if the island is too large for it
    rows=(ROW, (ROW_CAPACITY,)),
    face_count="i8",
    faces=("i8", (ROW_CAPACITY // 4, 4)),  # rows of the corners of each face (`face_load`)
    joined="i8",  # 1: a mechanism is among the movers
    evens="i8",  # 1: loads of such an island are evened out together
    even_count="i8",  # rows of such an island whose loads are evened out together, and rank of their motions
    even_rank="i8",
    slack="f8",  # most that is left out of its floors [m/s]
    even_rows=("i8", (EVEN_ROWS,)),
    even_basis=("f8", (EVEN_ROWS, EVEN_ROWS)),  # orthonormal: loads that change velocities
    even_load=("f8", (EVEN_ROWS,)),
    stick_basis=("f8", (3 * EVEN_ROWS, 3 * EVEN_ROWS)),  # the same of impulses where all contacts stick
    stick_load=("f8", (3 * EVEN_ROWS,)),
    movers=(MOVER, (MOVER_CAPACITY,)),
    moment_count="i8",
    moments=(MOMENT, (MOMENT_CAPACITY,)),
    cone_count="i8",
    softness="f8",  # of the proximal steps of the interior-point method [1]
    cones=(CONE, (3 * NEWTON_ROWS,)),
    links=(LINK, (LINK_CAPACITY,)),
    # a row's Jacobian: places of its blocks, and their 3 x 6 entries
    block_count="i8",
    block_place=("i8", (2 + 2 * HINGE_BLOCKS,)),
    block=("f8", (2 + 2 * HINGE_BLOCKS, 3, 6)),
    outer=("f8", (2, 2 + 2 * HINGE_BLOCKS, 6)),  # two vectors over the blocks, whose product is added
    order=("i8", (NEWTON_MOVERS,)),  # mover of each block
    near=("u8", (NEWTON_MOVERS, NEWTON_MOVERS // 64)),  # a bit for each neighbour of each mover
    degree=("i8", (NEWTON_MOVERS,)),
    begin=("i8", (NEWTON_MOVERS + 1,)),  # first slot of each column
    slot_row=("i8", (NEWTON_BLOCKS,)),  # row of each slot
    lower=("f8", (36 * NEWTON_BLOCKS,)),
    upper=("f8", (36 * NEWTON_BLOCKS,)),
    gradient=("f8", (6 * NEWTON_MOVERS,)),
    step=("f8", (6 * NEWTON_MOVERS,)),
    kernel=MATRIX,  # negative derivative of a row's impulse with respect to its velocity [kg]
)

"""Records of the contact solver: one island's rows and movers, and the matrix of its Newton steps."""

from touchstone.reference_impl.core.dtypes import MATRIX, VECTOR, record

ROW_CAPACITY = 16_384
"""Contact points of one island; more are dropped and counted as lost."""
MOVER_CAPACITY = 8_192
"""Movers of one island."""
NEWTON_ROWS, NEWTON_MOVERS, NEWTON_ENTRIES = 2_048, 192, 180_000
"""Largest island that Newton's method takes: contact points, movers, and entries of its matrix's envelope."""

ROW = record(
    pair="i8",  # its row of `pairs`
    a="i8",  # its movers, or -1 where that side does not move
    b="i8",
    r_a=VECTOR,  # from a mover's centre of mass to the contact point
    r_b=VECTOR,
    normal=VECTOR,
    friction="f8",
    floor="f8",  # least speed along the normal after the solve [m/s]
    mobility=MATRIX,  # W: velocity of B against A per impulse on B [1/kg]
    mass="f8",  # 3 / trace of W [kg]
    across_1=VECTOR,  # axes across the normal
    across_2=VECTOR,
    along="f8",  # n.W n [1/kg]
    share_1="f8",  # n.W t over that [1]
    share_2="f8",
    across_11="f8",  # W across the normal while the velocity along it is kept [1/kg]
    across_12="f8",
    across_22="f8",
    free=VECTOR,  # velocity of B against A without impulses, less the slip at which friction holds [m/s]
    before=VECTOR,  # at the start of the hold, and that slip
    impulse=VECTOR,  # on B [N s]
    start=VECTOR,  # the impulse that the solve starts from
    best=VECTOR,  # that of the least residual so far
    # sweeps: the impulse before the sweep, and the conjugate direction
    swept=VECTOR,
    direction=VECTOR,
    # Newton's method: proximal centre, velocity, and its change along a step
    centre=VECTOR,
    velocity=VECTOR,
    rate=VECTOR,
    stiffness="f8",  # [kg]
)
MOVER = record(
    body="i8",  # its row of `bodies`: a simulated body, or the root of a driver
    inverse_mass="f8",
    inverse_inertia=MATRIX,
    center=VECTOR,
    velocity=VECTOR,  # change by the impulses, of the centre of mass [m/s]
    omega=VECTOR,
    inertia=MATRIX,
    place="i8",  # of its block of six unknowns in the matrix
    first_place="i8",  # least place of a mover that it touches, itself included
)
SOLVER = record(
    row_count="i8",
    mover_count="i8",
    best_residual="f8",  # [m/s]
    rows=(ROW, (ROW_CAPACITY,)),
    movers=(MOVER, (MOVER_CAPACITY,)),
    order=("i8", (NEWTON_MOVERS,)),  # mover at each place
    offset=("i8", (6 * NEWTON_MOVERS,)),  # entries (i, j) and (j, i), i >= j: lower and upper[offset[i] + j]
    begin=("i8", (6 * NEWTON_MOVERS,)),  # first column of row i
    lower=("f8", (NEWTON_ENTRIES,)),
    upper=("f8", (NEWTON_ENTRIES,)),
    gradient=("f8", (6 * NEWTON_MOVERS,)),
    step=("f8", (6 * NEWTON_MOVERS,)),
    block=("f8", (6, 3)),
    kernel=MATRIX,  # derivative of a row's impulse by its velocity, negative [kg]
)

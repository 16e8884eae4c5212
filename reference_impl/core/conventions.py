"""Frames, units, signs, enumerations, and numbers that several modules use, each with its unit and reason.

SI, radians, float64, C-contiguous, right-handed, z up, unit quaternions wxyz. A contact normal points from
A to B. Signed distance is negative in overlap; depth = max(0, -distance). Impulse +j n acts on B, -j n on A.
"""

FIXED, SIMULATED, DRIVEN = 0, 1, 2
"""Kinds of body."""
SPHERE, BOX, ELLIPSOID, HULL, CAPSULE, CYLINDER, CONE, HALF_SPACE = 0, 1, 2, 3, 4, 5, 6, 7
"""Kinds of convex piece."""
DETECTION_DISCRETE, DETECTION_FAST, DETECTION_SWEEP = 0, 1, 2
"""Overlap tests at the end of a substep; time of impact too for pairs that move farther than both are thick;
or time of impact for all pairs."""
REMOVAL_EQ1, REMOVAL_LEAST_MOTION = 0, 1
"""Translation out of overlap by Eq. 1, or the minimum-norm translation that resolves all depths."""
DEPTH_WALK, DEPTH_CERTIFIED, DEPTH_EXACT = 0, 1, 2
"""Convex depth: warm-started and locally optimal, warm-started with a certificate, or from scratch."""

# broad phase
COLUMN_LEVELS = 64
"""Number of cell widths, each twice the previous one: from the least to beyond any scene."""

# convex depth
DEPTH_TOLERANCE = 1e-15
"""Gap between EPA's bounds, over the pair's size, at which EPA ends [1]: a few roundings."""
DISTANCE_TOLERANCE = 1e-15
"""Gap of GJK's distance over the simplex' size at which GJK ends [1]: a few roundings."""
DEGENERATE_HEIGHT = 2e-15
"""Height over the pair's size below which a face has no area, or a vertex does not see it [1]: roundings."""
STAGNATION_GAP = 1e-12
"""Gap between proven bounds, over the pair's size, up to which a depth or distance has converged [1]."""
TOUCHING_DISTANCE_SHARE = 1e-8
"""Distance over the pair's size below which EPA gives the normal if GJK's bounds do not meet [1]."""
SHARPENING_SHIFT = 1e-3
"""Gap over the pair's size at which the witnesses of overlapping pieces are computed [1]."""
EPA_VERTICES = 256
EPA_FACES = 8 * EPA_VERTICES
"""Capacity of EPA's polytope, which limits the iterations: about 10 are usual for hulls of 80 triangles, with
6 new faces each; slots of deleted faces are not reused."""
WARM_START_GAP = 4e-15
"""Gap of a face's bounds over the pair's size at which it is locally the nearest [1]: some 20 roundings."""
DEPTH_CACHE_WAYS = 4
DEPTH_CACHE_BUCKETS = 512
DEPTH_CACHE_SIZE = DEPTH_CACHE_WAYS * DEPTH_CACHE_BUCKETS
"""Entries of the depth cache: a new pair replaces the least recently used entry of its bucket of four."""

# overlap removal
OVERLAP_TOLERANCE = 1e-6
"""Depth left after removal [m]."""
REMOVAL_ROUNDS = 32
"""Rounds of translation before the way back."""
PARALLEL_SINE = 1e-15
"""Sine of an angle below which directions are parallel [1]: a few roundings, less than PLANE_TOLERANCE."""

# contact
TOUCH_DISTANCE = 1e-6
"""Distance below which pieces touch [m]."""
IMPACT_TARGET = 5e-7
"""Gap at which impacts of driven links, and impacts in dense substeps, are found [m]: within TOUCH_DISTANCE,
free of overlap. Other impacts are found at the setting `impact_gap`."""
IMPACT_SLACK = 2e-7
"""Accepted deviation from IMPACT_TARGET [m]."""
IMPACT_SHARE = 0.4
"""Accepted deviation from `impact_gap`, relative to it [1]."""
GAP_LEFT = 1e-9
"""Largest gap to which the law of positions closes contacts [m]."""
APPROACH_MIN = 1e-4
"""Approach speed below which a contact is not an impact [m/s]."""
NO_MOTION = -0.0
"""Component of the motion of a surface that does not move [m/s]: adding it keeps every number to the bit."""
NO_FLOOR = -1e300
"""Floor of an open contact, which gets no impulse: below any speed [m/s]."""
NEVER = 1e300
"""Longer than any substep, as a share of it [1]."""
ENERGY_ROUNDING = 1e-13
"""Energy gain, over the impulse's work against the approach, that is rounding [1]: conditioning of M."""
GUARD_UNVISITED, GUARD_SUMMED, GUARD_SLOWED = 0, 1, 2
"""State of a body in the energy guard: in no island yet, in its island's sums, or with the energy removed."""
SINKING_SHARE, SINKING_DEPTH = 0.1, 1e-5
"""Fraction of the thinner piece's width that a touching pair may sink before separation [1], and the depth
that it may sink where no driver squeezes it [m]."""
FACE_CORNERS = 512
"""Most corners of a face that touches another [1]."""
MANIFOLD_HEIGHT = 4e-6
"""Height over the support plane below which a vertex belongs to the touching feature, and least extent of a
manifold [m]: some TOUCH_DISTANCE, because a slightly tilted face still touches at its far end."""
HALF_SPACE_REACH = 1e9
"""Distance from its origin at which the bounding box of a half-space ends [m]: beyond any scene."""
MERGED_NOT, MERGED_A, MERGED_B = 0, 1, 2
"""Body of which several pieces share a manifold."""
EVENT_CAP = 192
"""Substeps of one frame: DENSE_EVENTS, DENSE_PARTS, and the rest for impacts within dense substeps."""
GRIP_NONE, GRIPS, SLIDES, RELEASED = 0, 1, 2, 3
"""Grip of a contact with static friction: not known yet; it sticks at the start of a substep; it slides then;
or it would leave its static cone within the substep, and slides."""
WARM_START_CAPACITY = 4096
"""Contact points whose forces warm-start the next resting contact solve."""

# free rotation
KEEPS_NOTHING, KEEPS_MOMENTUM, KEEPS_OMEGA = 0, 1, 2
"""What is constant over a body's substep: neither (contacts turn it), angular momentum, or omega."""
SPIN_TERMS = 28
"""Capacity for the coefficients of a step."""

# drivers and chains
PRESSED, NEWLY_PRESSED = 1, 2
"""State of a driver in the loop that has touched a simulated body in this frame; first in this substep."""
CHAIN_JOINTS = 16
"""Most hinges of a chain."""
HINGE_BLOCKS = 20
HINGE_CAPACITY = 6 * HINGE_BLOCKS
"""Most hinges in the chains of a driver, and most degrees of freedom of a mechanism: blocks of six unknowns
of the contact solver."""
CONFIGURATION = 2 * HINGE_CAPACITY
"""Capacity for the positions of a mechanism's joints: of a ball joint 4 for 3 degrees of freedom."""
POSTURE_CONSTRAINTS = 32
"""Constraints of one posture QP; the next QP takes the remaining points."""
QP_TOLERANCE = 1e-8
"""Change of a depth in a sweep at which the QP has converged [m]: a hundredth of OVERLAP_TOLERANCE."""
JOINT_HINGE, JOINT_SLIDER, JOINT_BALL, JOINT_FIXED, JOINT_FREE = 0, 1, 2, 3, 4
"""Types of joints between bodies; a free one joins the first body of a mechanism to the world."""
UNBOUNDED = 1e30
"""Force or limit of a joint that it never reaches [N, N m, m or rad]."""
PART_WHOLE, PART_ROOT = -2, -1
"""Parts of a driver: all of it, or the links in no chain; its chains count from 0."""
MOVER_BODY, MOVER_DRIVER, MOVER_TRUNK = 0, 1, 2
"""What a translation moves: a body, all links of a driver, or its links in no chain."""

RANDOM_PRIME = 2147483647
"""Modulus of the generator of Park and Miller; its states are 1 to 2^31 - 2."""

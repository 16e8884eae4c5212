"""Frames, units, signs, and every numeric constant with its unit and reason.

SI, radians, float64, C-contiguous, right-handed, z up, unit quaternions wxyz. A contact normal points from
A to B. Signed distance is negative in overlap; depth = max(0, -distance). Impulse +j n acts on B, -j n on A.
"""

FIXED, SIMULATED, DRIVEN = 0, 1, 2
"""Kinds of body."""
SPHERE, BOX, ELLIPSOID, HULL, CAPSULE = 0, 1, 2, 3, 4
"""Kinds of convex piece."""
DETECTION_DISCRETE, DETECTION_FAST, DETECTION_SWEEP = 0, 1, 2
"""Overlap tests at the end of a substep; time of impact too for pairs that move farther than both are thick;
or time of impact for all pairs."""
REMOVAL_EQ1, REMOVAL_LEAST_MOTION = 0, 1
"""Translation out of overlap by Eq. 1, or the minimum-norm translation that resolves all depths."""
DEPTH_WALK, DEPTH_CERTIFIED, DEPTH_EXACT = 0, 1, 2
"""Convex depth: warm-started and locally optimal, warm-started with a certificate, or from scratch."""

# broad phase
SPATIAL_HASH_PIECE_COUNT = 64
"""Largest group of pieces that forms a single column: sweeping a larger one along x costs more."""
COLUMN_SHARE = 0.9
"""Fraction of the pieces that fit the smallest cells [1]: smaller cells would hold less than one piece."""
COLUMN_SLACK = 1.05
"""Width of the smallest cells over the widest box that must fit [1]: allows pieces to rotate a little."""
COLUMN_WIDTH = 2.0**-16
"""Least width of a cell [m]: far below any piece."""
COLUMN_LEVELS = 64
"""Number of cell widths, each twice the previous one: from the least to beyond any scene."""
COLUMN_FAR = 2.0**30
"""Largest cell index, on either side of the origin; cells beyond it share one index."""

# fat bounds
FAT_BOUNDS_FRAMES = 10
"""Frames of motion at the present velocity that the fat bounds of driven links cover."""
FAT_BOUNDS_MARGIN, FAT_BOUNDS_SPEED_SHARE = 2e-3, 0.1
"""Margin of driven links' fat bounds in translation and rotation [m], and margin over the predicted motion
[1]: velocities change."""
FLIGHT_HORIZONS = (2, 16)
"""Least and most frames of flight in simulated bodies' fat bounds: halved after an overlap, else doubled."""
FAT_BOUNDS_WAITS = (3, 12)
"""Frames until fat bounds are computed again, without and with drivers."""
FLIGHT_BOUNDS_PAD = 1e-4
"""Margin of a simulated body's centre beyond its predicted flight [m]: far above rounding."""

# convex depth
DEPTH_TOLERANCE = 1e-15
"""Gap between EPA's bounds, over the pair's size, at which EPA ends [1]: a few roundings."""
ROUND_TOLERANCE = 1e-13
"""The same for a round core [1]: there, a gap four times smaller takes about three more vertices."""
DISTANCE_TOLERANCE = 1e-15
"""Gap of GJK's distance over the simplex' size at which GJK ends [1]: a few roundings."""
DEGENERATE_HEIGHT = 2e-15
"""Height over the pair's size below which a face has no area, or a vertex does not see it [1]: roundings."""
STAGNATION_GAP = 1e-12
"""Gap between proven bounds, over the pair's size, up to which a depth or distance has converged [1]."""
SLIVER_SINE = 1e-2
"""Squared sine between two edges of a face below which its normal comes from its two shorter edges [1]."""
FLAT_HEIGHT = 1e-12
"""Height of a tetrahedron over its edge below which rounding decides the sides of its faces [1]."""
SIMPLEX_GROWTH = 1e-9
"""Distance of a new vertex over the pair's size from which it adds a dimension to a simplex [1]."""
TOUCHING_DISTANCE_SHARE = 1e-8
"""Distance over the pair's size below which EPA gives the normal if GJK's bounds do not meet [1]."""
SHARPENING_SHIFT = 1e-3
"""Gap over the pair's size at which the witnesses of overlapping pieces are computed [1]."""
GJK_CAP = 64
"""Iterations of GJK; about 6 are usual."""
EPA_VERTICES = 256
EPA_FACES = 8 * EPA_VERTICES
"""Capacity of EPA's polytope, which limits the iterations: about 10 are usual for hulls of 80 triangles, with
6 new faces each; slots of deleted faces are not reused."""
WARM_START_GAP = 4e-15
"""Gap of a face's bounds over the pair's size at which it is locally the nearest [1]: some 20 roundings."""
WARM_START_SLACK = 1e-8
"""Slack of a certificate, and least height of its triangles, over the pair's size [1]: 1e8 roundings."""
BOX_FACE_COSINE = 1 - 1e-9
"""Cosine between a normal and a box axis from which the depth cache tries the box face [1]: 5e-5 rad."""
STEADY_LOOKUPS = 16
"""Vertices scanned in the time by which a support table look-up is slower than a cached cone [1]."""
DEPTH_CACHE_WAYS = 4
DEPTH_CACHE_BUCKETS = 512
DEPTH_CACHE_SIZE = DEPTH_CACHE_WAYS * DEPTH_CACHE_BUCKETS
"""Entries of the depth cache: a new pair replaces the least recently used entry of its bucket of four."""

# overlap removal (method, section 3)
OVERLAP_TOLERANCE = 1e-6
"""Depth left after removal [m]."""
REMOVAL_ROUNDS = 32
"""Rounds of translation before the way back."""
VANISHING_SHIFT = 1e-3
"""|PD| over the largest depth below which opposing normals cancel [1]."""
DETOUR = 2.0
"""Translation of a driver beyond its way back, over the largest depth at entry, from which it may lead
through other bodies [1]."""
LONGEST_SHIFT = 100.0
"""|x| over the largest depth above which normals count as opposing [1]: within 1.1 degrees of opposition."""
STALL_ROUNDS = 8
STALL_FALL = 0.9
"""The largest depth must fall below 0.9 of itself in 8 rounds."""
SEPARATION_DEPTH = 0.75 * OVERLAP_TOLERANCE
"""Depth that separation leaves [m]: a short lift adds little energy."""
UNPAID_DEPTH = 0.99975 * OVERLAP_TOLERANCE
"""Depth that it leaves in a substep repeated because no motion paid for the lift [m]."""
SEPARATION_SWEEPS = 100
"""Sweeps over the pairs of simulated bodies in one round of separation; a heap takes tens."""
PLAIN_SWEEPS = 20
OVER_RELAXATION = 1.8
"""Factor by which separation moves two simulated bodies further than their depth after PLAIN_SWEEPS [1]."""
LEVERAGE = 8.0
"""Most translation of a body over the deepest overlap when separation moves jammed bodies together [1]."""
RETURN_ROUNDS = 8
"""Rounds of separation after which bodies that still overlap a driver return to where their substep began."""
YIELD_ROUNDS = REMOVAL_ROUNDS // 2
"""Rounds of separation after which drivers yield to simulated bodies."""
WAY_BACK_STEPS = 24
"""Bisections between the last free pose and the pose at entry: 6e-8 of their distance."""

# minimum-norm translation
MIN_NORM_PLANES = 100
"""Planes tried before normals count as opposing; about 3 are usual."""
PLANE_TOLERANCE = 1e-14
"""Depth left, over the sum of the largest depth and |x|, that counts as resolved [1]: some 50 roundings."""
PARALLEL_SINE = 1e-15
"""Sine of an angle below which directions are parallel [1]: a few roundings, less than PLANE_TOLERANCE."""

# impulses (method, section 5)
TOUCH_DISTANCE = 1e-6
"""Distance below which pieces touch [m]."""
IMPACT_TARGET = 5e-7
"""Gap at which impacts of driven links, and impacts in dense substeps, are found [m]: within TOUCH_DISTANCE,
free of overlap. Other impacts are found at the setting `impact_gap`."""
IMPACT_SLACK = 2e-7
"""Accepted deviation from IMPACT_TARGET [m]."""
CLOSING_EXTRA = 8
"""Most steps of the search for a time of impact after its slack is reached."""
CLOSING_SHARE = 1e-3
"""Share of the slack at which the search for a time of impact ends [1]."""
IMPACT_SHARE = 0.4
"""Accepted deviation from `impact_gap`, relative to it [1]."""
IMPACT_STEPS = 90
"""Bracketing steps for the time of an impact; about 6 are usual."""
SECANT_STEPS = 60
"""Those of them before bisection, by secants: where a nearly constant distance begins to fall steeply, as
when the other end of a tilting box lands, a secant shortens the bracket by a ten-thousandth."""
APPROACH_MIN = 1e-4
"""Approach speed below which a contact is not an impact [m/s]."""
SETTLE_DEPTH, DENSE_SETTLE = 1.7e-8, 1e-7
"""Depth by which an approaching pair would sink in a substep, from which it stops before the contact solve;
and depth that this leaves in large islands of dense substeps [m]."""
SEPARATION_MIN = 1e-8
"""Speed of a touching pair that is no separation [m/s]: a weight of 10 N does 1e-9 J of work per frame."""
NO_FLOOR = -1e300
"""Floor of an open contact, which gets no impulse: below any speed [m/s]."""
SLIDE_MIN = 1e-4
"""Sliding speed from which the end of sliding is an event [m/s]: below it, the position error is some 1e-7
m."""
STOP_SHARE, STOP_SHORT = 1 - 1e-9, 1 - 1e-6
"""Fraction of a substep from which the end of sliding counts as its end, and fraction of the time to an
earlier one that the substep takes [1]: exactly there, on the cone without sliding, sweeps converge slowly."""
STOP_ERROR = 1e-11
"""Error in the position of a sliding contact below which its stop within a substep is no event [m]."""
STOP_LATER = 1.0001
"""Ratio of the time to a stop and a shortened substep from which the substep is solved again, longer [1]."""
BIAS_DEPTH, BIAS_SHARE = OVERLAP_TOLERANCE, 0.8
"""Motion along a normal by which the rotation of bodies may part a resting pair within a substep [m], and
share of it that a shortened substep allows [1]."""
NEVER = 1e300
"""Longer than any substep, as a share of it [1]."""
RESTING_CONTACT_ROUNDS = 10
"""Attempts at a substep in which sliding contacts stop or bodies rotate; 1 or 2 are usual."""
SLIP_MIN = 1e-9
"""Sliding speed below which the direction of sliding is undefined [m/s]."""
ENERGY_ROUNDING = 1e-13
"""Energy gain, over the impulse's work against the approach, that is rounding [1]: conditioning of M."""
GUARD_UNVISITED, GUARD_SUMMED, GUARD_SLOWED = 0, 1, 2
"""State of a body in the energy guard: in no island yet, in its island's sums, or with the energy removed."""
UNPAID_ROUNDING = 1e-12
"""Energy rise of an island that the guard cannot remove, over its energies, that is rounding [1]."""
IMPULSE_CAP = 200
"""Impulses of one event."""
REFLECTION_ROUNDS = 64
"""Rounds of simultaneous impacts of an event after which all touching contacts act together: a row of as many
balls passes an impulse on in so many rounds."""
REFLECTION_FAILURES = 2
"""Open solves of an event's impacts after which no round follows: a jammed island leaves each open."""
LANDING_DEPTH, DENSE_LANDING = 1e-7, 4e-7
"""Sinking of a touching pair at which another of its points has landed [m]: a tenth of OVERLAP_TOLERANCE; and
in dense substeps: there, leaning bodies sink by 3e-7 m without landing."""
LANDING_EVENTS = 128
"""Events of a frame after which touching pairs of polyhedra may sink by SINKING_DEPTH."""
LANDING_MIN = 1e-9
"""Fraction of a substep within which a landing is ignored: the next substep would find the same one [1]."""
SINKING_SHARE, SINKING_DEPTH = 0.1, 1e-5
"""Fraction of the thinner piece's width that a touching pair may sink before separation [1], and the depth
that it may sink where no driver squeezes it [m]."""
SINKING_SLACK = 2.5e-7
"""Accepted deviation from OVERLAP_TOLERANCE in the time-of-impact search for a sinking pair [m]."""
MANIFOLD_HEIGHT = 4e-6
"""Height over the support plane below which a vertex belongs to the touching feature, and least extent of a
manifold [m]: some TOUCH_DISTANCE, because a slightly tilted face still touches at its far end."""
DENSE_HEIGHT = 2e-5
"""The same height in a dense substep and where separation moves bodies together, and the largest gap of
manifold points there [m]: what may land."""
MANIFOLD_VERTICES = 64
"""Most vertices of a face that manifold clipping uses."""
DENSE_SUBSTEPS = 8
"""Most dense substeps for the rest of a frame, unless rotation or sliding requires more."""
DENSE_EVENTS = 32
"""Events of a frame after which dense substeps simulate the rest."""
SPECULATIVE_SLACK = 0.25
"""Speed over the resting speed 2 g h at which near pairs close their gap within a substep [1]: a larger value
adds more of them as rows, and leaves fewer unforeseen impacts."""
SPECULATIVE_COSINE = 0.995
"""Cosine of the angle between the normals of a speculative contact now and at its impact, over which it keeps
the present one [1]."""
TOUCH_CLOSED = 9e-7
"""Gap to which a speculative contact may close [m]: touching, but not yet an impact (IMPACT_TARGET)."""
EVENT_CAP = 192
"""Substeps of one frame: DENSE_EVENTS, DENSE_PARTS, and the rest for impacts within dense substeps."""
DENSE_CALM = 4
"""Events of a crowded frame from which the next one is crowded from its start."""
DENSE_PARTS = 32
"""Most dense substeps per frame that rotation may require."""
DENSE_SPEED = 0.01
"""Relative speed of touching polyhedra from which DENSE_PARTS / 8 is the least division of a frame [m/s]:
their contact points move."""
DENSE_SINKING = 2e-7
"""Sinking of a rotating body that the length of a dense substep allows [m]: a fifth of OVERLAP_TOLERANCE."""
WARM_START_CAPACITY = 4096
"""Contact points whose forces warm-start the next resting contact solve."""
UNPAID_ATTEMPTS, UNPAID_SHARE = 4, 0.25
"""Most repetitions of a substep whose separation adds energy that no motion pays, and the share of its length
that each takes [1]."""
TIME_MIN = 1e-12
"""Remainder of a frame that is not simulated [s]."""

# free rotation
KEEPS_NOTHING, KEEPS_MOMENTUM, KEEPS_OMEGA = 0, 1, 2
"""What is constant over a body's substep: neither (contacts turn it), angular momentum, or omega."""
SPIN_STEP = 0.4
"""Rotation that one step of the series covers [rad]: 13 to 25 terms; the cost hardly depends on it."""
SPIN_TERMS = 28
"""Capacity for the coefficients of a step."""
SPIN_ROUNDING = 1e-17
"""Size of a term over the whole at which the series ends [1]: a tenth of a rounding."""
STEADY_SPIN = 1e-15
"""Sine between angular momentum and velocity below which the axis is fixed [1]: a few roundings."""
SPIN_STEPS = 10_000
"""Steps of one substep beyond which a body keeps its omega: 240,000 rad/s at 60 frames per second."""

# time of impact
TIME_OF_IMPACT_STEPS = 500
"""Steps of conservative advancement; 3 are usual for a bullet, 6 to 50 for a spin of several radians."""
LEAP_CUT = 0.5
"""Factor between trial leaps [1]; a trial takes one support query per piece, not a distance query."""
PAST_MIDDLE = 0.5
"""Fraction of the widths of link and obstacle beyond which the way out may lead to the far side [1]."""
DRIVEN_DEPTH_SHARE = 0.2
"""Depth that a driven link may reach in an obstacle, over both least widths [1]; half is past the middle."""
DRIVEN_DEPTH_SLACK = 0.025
"""Accepted deviation from DRIVEN_DEPTH_SHARE [1]."""
SEGMENT_TURN = 0.5
"""Rotation of a link per straight segment of its swept arc [rad]: the error is 1/32 of the link's length."""

# virtual coupling (method, section 5)
COUPLING_REACH = 0.5
"""Distance of a driver with chains from its tracker beyond which the coupling pulls no stronger [m]."""
NEAR_CRITICAL = 1e-5
"""(w h)^2 below which three terms give a nearly critical spring to rounding: the next is 1e-15 / 720 [1]."""

# chains (method, section 4)
ATTRACTION_TIME = 0.1
"""Lag of an attraction whose turns are the least stride for a slow tracker [s]."""
ATTRACTION_TURN = 0.02
"""Rotation of all hinges of a chain in one part of the attraction [rad]: 14 mm at the end of an arm, half the
thickness of two hands."""
ATTRACTION_MOST = 0.04
"""Upper limit of that rotation, however few parts are left [rad]: the thickness of a hand."""
ATTRACTION_SETTLED = 1e-3
"""Rotation of all hinges in a part at which attraction ends [rad]: linearisation error 0.5e-6 m."""
OFFSET_SETTLED = 1e-9
"""Deviation of a hinge from its tracker, and its change in a frame, that count as none [rad]: 1e-9 m."""
LINK_GYRATION = 0.3
"""Radius of gyration of a link in contact with a simulated body [m]: the length of a forearm."""
PUSH_PAIRS = 32
"""Pairs of pushing links that stay in contact within a frame; further ones lose it at the first event."""
PUSH_SLACK = 5e-4
"""Gap beyond a link's way within a frame up to which its contact stays [m]: both turn, to second order."""
CHAIN_ROUNDS = 16
"""Rounds of chain overlap removal: links of one chain, or posture QPs of all chains."""
STRETCHED_SHARE = 0.5
"""Fraction of the distance to its goal that an end effector may miss before the chain is bent [1]."""
BEND_SHARE = 0.05
"""Fraction of the angle to the middle of its range by which a hinge is bent [1]: 4 degrees for an elbow."""
BEND_ROUNDS = 4
"""Rounds in which a chain is bent: a straight leg is 3 mm too long after one, 20 mm after four."""
CHAIN_JOINTS = 16
"""Most hinges of a chain."""
POSTURE_CONSTRAINTS = 32
"""Constraints of one posture QP; the next QP takes the remaining points."""
CONSTRAINT_ALIKE = 1e-3
"""Distance below which two points of a pair count as one [m]."""
QP_SWEEPS = 96
"""Sweeps of Hildreth's method; one pair takes 1, a corner about 5."""
QP_NEWTON_EVERY = 4
"""Sweeps between two Newton steps: sweeps find which constraints push, Newton's method their multipliers."""
QP_NEWTON_STEPS = 4
"""Most Newton steps before the next sweep; one is enough where the same constraints push before and after."""
QP_LINE_SEARCH = 8
"""Steps back of a Newton step that goes too far."""
QP_TOLERANCE = 1e-8
"""Change of a depth in a sweep at which the QP has converged [m]: a hundredth of OVERLAP_TOLERANCE."""
QP_ROUGH_TOLERANCE = 1e-6
"""The same with the tracker's pull [m]: overlap removal follows it."""
QP_CLEARANCE = 5e-7
"""Gap that the QP aims at [m]: its linearisation error then leaves no overlap, and the links still touch."""
QP_LEVER = 5e-3
"""Lever below which the QP leaves depth instead of turning hinges [m]: of a stretched limb, or between
opposing planes."""
QP_TURN_MAX = 0.2
"""Largest rotation of a hinge in one round [rad]: the linearisation error is 2 % of it."""
PART_WHOLE, PART_ROOT = -2, -1
"""Parts of a driver: all of it, or the links in no chain; its chains count from 0."""
MOVER_BODY, MOVER_DRIVER, MOVER_TRUNK = 0, 1, 2
"""What a translation moves: a body, all links of a driver, or its links in no chain."""

# order of chains
RANDOM_PRIME = 2147483647
"""Modulus of the generator of Park and Miller; its states are 1 to 2^31 - 2."""

# reach cones
CONE_SLACK = 1e-12
"""Height over an edge's plane, times the edge's length, that counts as inside [1]: some thousand roundings,
so that a projected direction is not projected again."""
HALF_TURN = 1e-14
"""1 + cosine below which the shortest rotation between two directions has no axis [1]: some 50 roundings."""
GIMBAL_COSINE = 1e-9
"""Cosine of the second angle below which only the sum of the first and third is determined [1]: the accuracy
of their directions is 1e-16 over it."""
LIMIT_SLACK = 1e-9
"""Excess over a hinge's limit that rounding of recovered angles explains [rad]; it is clamped."""

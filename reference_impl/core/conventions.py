"""Frames, units, signs, and every numeric constant with its unit and reason.

SI, radians, float64, C-contiguous, right-handed, z up, unit quaternions wxyz. A contact normal points from
A to B. Signed distance is negative in overlap; depth = max(0, -distance). Impulse +j n acts on B, -j n on A.
"""

FIXED, SIMULATED, DRIVEN = 0, 1, 2
"""Kinds of body."""
SPHERE, BOX, ELLIPSOID, HULL, CAPSULE = 0, 1, 2, 3, 4
"""Kinds of convex piece."""
FRICTION_PAPER, FRICTION_COULOMB = 0, 1
"""Eq. 10 as printed (always mu j), or at most what stops the sliding."""
RESTITUTION_NEWTON, RESTITUTION_GUARDED = 0, 1
"""Eq. 8 whatever it does to the energy, or less e for an impact where the kinetic energy would rise."""
IMPULSES_SEQUENTIAL, IMPULSES_TOGETHER = 0, 1
"""Contacts that hold one after the other from the queue, or all together by sweeps to a residual. Impacts are
one after the other in both."""
FLIGHT_EULER, FLIGHT_BALLISTIC = 0, 1
"""Semi-implicit Euler, or exact: for constant forces, and for free rotation."""
DETECTION_DISCRETE, DETECTION_FAST, DETECTION_SWEEP = 0, 1, 2
"""Tests for overlap at the end of a substep; sweeps too, of pairs that move farther than both are thick; or
sweeps of all pairs."""
REMOVAL_EQ1, REMOVAL_LEAST_MOTION = 0, 1
"""Translation out of overlap by Eq. 1, or the smallest that meets all depths."""
DEPTH_WALK, DEPTH_CERTIFIED, DEPTH_EXACT = 0, 1, 2
"""Convex depth from last frame's answer: as found (locally optimal), or only with a certificate; or anew."""
ANGLE_ACOS, ANGLE_ATAN2 = 0, 1
"""Turn of a joint in `ccd_ik` (Eq. 5): arc cosine with the axis' sign, or both sine and cosine."""
PASSES_PLAIN, PASSES_EXTRAPOLATED = 0, 1
"""Passes of `ccd_ik` as they are, or carried on to where their geometric series would end."""
POSTURE_CCD, POSTURE_LEAST_TURN = 0, 1
"""Chains come out of overlap link by link by `ccd_ik`, or by the least turn that frees all their links."""
STAGES = ("drive", "collision", "removal", "impulses", "integration")
"""What the stage clocks of a step tell apart."""
STAGE_DRIVE, STAGE_COLLISION, STAGE_REMOVAL, STAGE_IMPULSES, STAGE_INTEGRATION = range(5)
COUNTERS = (
    "pairs",
    "contacts",
    "rounds",
    "way_back",
    "gave_up",
    "events",
    "impulses",
    "unconverged",
    "lost",
    "walked",
    "certified",
    "exact",
    "dense_substeps",
    "guarded",
    "ik.rounds",
    "ik.iterations",
    "ik.joints",
    "pairs.contacting",
    "sweeps",
    "factorisations",
)
"""What a step counts; depths by how they were found: walked without a certificate, with one, or anew. Of
inverse kinematics: links that were brought out, passes over their joints, and joints that these took part
with. Contacting pairs: the most that touched or overlapped in one detection of the driven loop."""
(
    COUNT_PAIRS,
    COUNT_CONTACTS,
    COUNT_ROUNDS,
    COUNT_WAY_BACK,
    COUNT_GAVE_UP,
    COUNT_EVENTS,
    COUNT_IMPULSES,
    COUNT_UNCONVERGED,
    COUNT_LOST,
    COUNT_WALKED,
    COUNT_CERTIFIED,
    COUNT_EXACT,
    COUNT_DENSE,
    COUNT_GUARDED,
    COUNT_IK_ROUNDS,
    COUNT_IK_ITERATIONS,
    COUNT_IK_JOINTS,
    COUNT_CONTACTING,
    COUNT_SWEEPS,
    COUNT_FACTORS,
) = range(len(COUNTERS))

# broad phase
SPATIAL_HASH_PIECE_COUNT = 64
"""Pieces of a kind that make one strip: with more, sweeping each past all others along x costs more."""
COLUMN_SHARE = 0.9
"""Share of the pieces that fit the smallest squares [1]: smaller ones would hold less than a piece each."""
COLUMN_SLACK = 1.05
"""Width of the smallest squares over the widest box that is to fit [1]: kept while pieces turn a little."""
COLUMN_WIDTH = 2.0**-16
"""Least width of a square [m]: far below any piece."""
COLUMN_LEVELS = 64
"""Widths of squares, each twice the one before: from the least to beyond any scene."""
COLUMN_FAR = 2.0**30
"""Rows of squares that are told apart, on either side of the origin."""

# rooms
FAT_BOUNDS_FRAMES = 10
"""Frames for which driven links have room as they go now."""
FAT_BOUNDS_MARGIN, FAT_BOUNDS_SPEED_SHARE = 2e-3, 0.1
"""Room of driven links beyond that, to either side and in turning [m], and that over their way [1]: their
speed changes."""
FLIGHT_HORIZONS = (2, 16)
"""Frames for which simulated bodies have room: half as many where they meet something, then twice as many."""
FAT_BOUNDS_WAITS = (3, 12)
"""Frames after which more room is sought, without drivers and with some."""
FLIGHT_BOUNDS_PAD = 1e-4
"""Room of a simulated body's centre beyond its flight [m]: far above rounding."""

# convex depth
DEPTH_TOLERANCE = 1e-15
"""Gap between EPA's bounds, over the pair's size, that ends it [1]: a few roundings."""
ROUND_TOLERANCE = 1e-13
"""The same where a core is round [1]: there every fourth part of the gap takes some three vertices more."""
DISTANCE_TOLERANCE = 1e-15
"""Gap of GJK's distance over the simplex' size that ends it [1]: a few roundings."""
DEGENERATE_HEIGHT = 2e-15
"""Height over the pair's size below which a face has no area, or does not see a vertex [1]: roundings."""
STAGNATION_GAP = 1e-12
"""Gap between proven bounds, over the pair's size, up to which a depth or a distance has converged [1]."""
SLIVER_SINE = 1e-2
"""Squared sine between two edges of a face below which its normal is taken from its shorter ones [1]."""
FLAT_HEIGHT = 1e-12
"""Height of a tetrahedron over its edge below which the sides of its faces are rounding [1]."""
SIMPLEX_GROWTH = 1e-9
"""Reach of a new vertex over the pair's size by which a simplex gains a dimension [1]."""
TOUCHING_DISTANCE_SHARE = 1e-8
"""Distance over the pair's size below which EPA gives the normal where GJK's bounds do not meet [1]."""
SHARPENING_SHIFT = 1e-3
"""Gap over the pair's size at which witnesses of overlapping pieces are read off [1]."""
GJK_CAP = 64
"""Iterations of GJK; about 6 are usual."""
EPA_VERTICES = 256
EPA_FACES = 8 * EPA_VERTICES
"""Room for EPA's polytope: iterations are capped by it; about 10 are usual for hulls of 80 triangles, and 6
new faces for each, whose slots are not used again."""
WARM_START_GAP = 4e-15
"""Gap of a face's bounds over the pair's size at which it is locally the nearest [1]: some 20 roundings."""
WARM_START_SLACK = 1e-8
"""Slack of a certificate, and least height of its triangles, over the pair's size [1]: 1e8 roundings."""
BOX_FACE_COSINE = 1 - 1e-9
"""Cosine with a box' axis from which a normal is worth trying as that of its face [1]: 5e-5 rad."""
STEADY_LOOKUPS = 16
"""Corners tried in the time that a table of directions takes more than a remembered cone [1]."""
DEPTH_CACHE_WAYS = 4
DEPTH_CACHE_BUCKETS = 512
DEPTH_CACHE_SIZE = DEPTH_CACHE_WAYS * DEPTH_CACHE_BUCKETS
"""Pairs that `walk` remembers: a pair finds room in one bucket of four, in place of the longest unused."""

# overlap removal (method, section 3)
OVERLAP_TOLERANCE = 1e-6
"""Depth left after removal [m]."""
REMOVAL_ROUNDS = 32
"""Rounds of translation before the way back."""
VANISHING_SHIFT = 1e-3
"""|PD| over the largest depth below which opposing normals cancel [1]."""
LONGEST_SHIFT = 100.0
"""|x| over the largest depth beyond which normals count as opposing [1]: within 1.1 degrees of it."""
STALL_ROUNDS = 8
STALL_FALL = 0.9
"""The largest depth must fall below 0.9 of itself in 8 rounds."""
SEPARATION_DEPTH = 0.75 * OVERLAP_TOLERANCE
"""Depth that separation leaves where the energy guard acts [m]: a short way up adds little energy."""
SEPARATION_SWEEPS = 100
"""Sweeps over the pairs of simulated bodies in one round of parting them; a heap takes tens."""
WAY_BACK_STEPS = 24
"""Bisections between the last free pose and the pose at entry: 6e-8 of their distance."""

# least motion
MIN_NORM_PLANES = 100
"""Planes tried before normals count as opposing; about 3 are usual."""
PLANE_TOLERANCE = 1e-14
"""Depth left over the sum of the largest depth and |x| that counts as met [1]: some 50 roundings."""
PARALLEL_SINE = 1e-15
"""Sine of an angle below which directions are one [1]: a few roundings, less than PLANE_TOLERANCE sees."""

# impulses (method, section 5)
TOUCH_DISTANCE = 1e-6
"""Pieces nearer than this touch [m]."""
IMPACT_TARGET = 5e-7
"""Gap at which a driven link is stopped, and an impact in a crowd found [m]: inside TOUCH_DISTANCE, free of
overlap. Other impacts are found at `impact_gap`, a setting."""
IMPACT_SLACK = 2e-7
"""Accepted deviation from IMPACT_TARGET [m]."""
IMPACT_SHARE = 0.4
"""Accepted deviation from `impact_gap`, over it [1]."""
IMPACT_STEPS = 60
"""Bracketing steps for the time of an impact; about 6 are usual."""
APPROACH_MIN = 1e-4
"""Approach speed below which a contact is no impact [m/s]."""
SETTLE_MIN = 1e-6
"""Approach speed from which touching pairs are stopped before they hold [m/s]: else they sink by 1e-8 m."""
SEPARATION_MIN = 1e-8
"""Speed of a touching pair that counts as no separation [m/s]: a weight of 10 N does 1e-9 J in a frame."""
NO_FLOOR = -1e300
"""Floor of a contact that is not held: below any speed [m/s]."""
SLIDE_MIN = 1e-4
"""Sliding speed from which the moment of its stop is an event [m/s]: a body is off by some 1e-7 m."""
STOP_SHARE, STOP_SHORT = 1 - 1e-9, 1 - 1e-6
"""Share of a substep beyond which the moment of a stop is its end, and the share of the time up to a stop
that is taken [1]: just at the end, on the cone with nothing that slides, sweeps converge slowly."""
RESTING_CONTACT_ROUNDS = 6
"""Times a substep is begun for sliding contacts that stop in it; 1 or 2 are usual."""
SLIP_MIN = 1e-9
"""Sliding speed without a direction [m/s]."""
ENERGY_ROUNDING = 1e-13
"""Gain of energy over the work of the impulse against the approach that is rounding [1]: M's condition."""
UNPAID_ROUNDING = 1e-12
"""Rise of an island's energy that its motion cannot pay, over its energies, that is rounding [1]."""
IMPULSE_CAP = 200
"""Impulses of one event."""
LANDING_DEPTH = 1e-7
"""Sinking of a touching pair at which one more of its points has landed [m]: a tenth of OVERLAP_TOLERANCE."""
LANDING_EVENTS = 128
"""Events of a frame after which touching pairs are left to sink until the end of their substep."""
LANDING_MIN = 1e-9
"""Fraction of a substep within which no touching pair lands: it would land again and again [1]."""
SINKING_SHARE = 0.1
"""Share of the thinner piece's width by which two that touch may sink in before they part [1]."""
SINKING_SLACK = 2.5e-7
"""Accepted deviation from OVERLAP_TOLERANCE where a sweep looks for a touching pair that sinks [m]."""
MANIFOLD_HEIGHT = 4e-6
"""Height over the supporting plane below which a vertex belongs to the touching face, edge or corner, and
least extent of a patch [m]: some TOUCH_DISTANCE, for the tilt that leaves a face's far end touching."""
MANIFOLD_VERTICES = 64
"""Vertices of a face that count in a patch."""
DENSE_SUBSTEPS = 8
"""Parts into which a crowded rest of a frame is divided at most."""
DENSE_EVENTS = 32
"""Events after which the rest of a frame goes in dense substeps."""
SPECULATIVE_SLACK = 0.25
"""Approach, over the resting speed 2 g h, that near pairs may gain within a substep [1]: more of them are
rows, or fewer meet unforeseen."""
TOUCH_CLOSED = 9e-7
"""Gap that a near pair may close to [m]: it touches then, and is not yet an impact (IMPACT_TARGET)."""
EVENT_CAP = 192
"""Substeps of one frame: DENSE_EVENTS, DENSE_PARTS, and as many again for impacts that dense parts find."""
DENSE_PARTS = 32
"""Parts of a frame into which dense substeps divide it at most for what turns."""
DENSE_SPEED = 0.01
"""Speed of polyhedra that touch, from which half as many parts are the least [m/s]: their points move."""
DENSE_SINKING = 2e-7
"""Sinking of a turning body over a dense substep that its length allows [m]: a fifth of OVERLAP_TOLERANCE."""
WARM_START_CAPACITY = 4096
"""Contact points whose forces the next hold starts from."""
RESIDUAL_TARGET, RESIDUAL_ACCEPTED = 4e-13, 1e-9
"""Residual at which a contact solve ends, and at which it has converged [m/s]: bodies sink by that times a
frame."""
RESIDUAL_ROUNDING = 1e-14
"""Change of velocity below which a minimum is found, however small the residual is to be [m/s]."""
FIRST_SWEEPS = 8
"""Sweeps before Newton's method: they tell which contacts slide and which are open."""
MOST_SWEEPS, MOST_VISITS = 200, 20_000
"""Sweeps where Newton's method is not used or failed, or visits to a row where those are more: about 2 ms."""
DENSE_SWEEPS, DENSE_VISITS = 40, 4_000
"""The same in a dense substep: a frame has tens of them, and each starts from the forces of the last."""
SLIDE_STEPS = 40
"""Steps for the friction of one row that slides; about 5 are usual."""
SLIDE_ROUNDING = 1e-15
"""Deviation from the cone, over it, at which that friction is found [1]: some roundings."""
COMPLIANCE_FIRST, COMPLIANCE_LAST, COMPLIANCE_LEAST = 0.03, 1e-5, 1e-10
"""Compliance of the proximal problem over the row's own mobility [1]: first, with which its answer is unique,
or the square root of the residual [m/s] if that is less; last; and least, for towers and what jams."""
COMPLIANCE_ROUNDING = 1e-17
"""Compliance times the residual [m/s] below which rounding is more than what is left."""
COMPLIANCE_FALL, COMPLIANCE_RISE = 0.3, 5.0
"""Its factors where the residual falls slowly, and where Newton's method fails [1]."""
RESIDUAL_FALL = 0.1
"""Share of the residual that an outer iteration may leave before the compliance falls [1]."""
INNER_SHARE = 1e-2
"""Change of velocity over the residual, times the compliance, at which an outer iteration ends [1]."""
NEWTON_INNER, NEWTON_FACTORS = 15, 300
"""Factorisations of one outer iteration, and of all of an island."""
NEWTON_WORK, NEWTON_ALLOWANCE = 3e7, 3e6
"""Multiplications of all factorisations of a frame, where they are fewer: some 30 ms; and of an island
when these are used up. What is larger then goes by sweeps."""
NEWTON_STALLS = 4
"""Outer iterations with little progress after which a converged answer is taken."""
LINE_SHARE, LINE_HALVES = 0.1, 10
"""Least decrease of g.M^-1 g over that of a full Newton step [1], and how often the step is halved for it."""
EXTRAPOLATION_MOST, EXTRAPOLATION_RISE = 1e6, 1.1
"""Longest extrapolation of impulses, over their last change, and the residual after it over before [1]."""
TIME_MIN = 1e-12
"""Remainder of a frame that is not simulated [s]."""

# free rotation
SPIN_STEP = 0.4
"""Turn that one step of the series covers [rad]: 13 to 25 terms; the cost hardly depends on it."""
SPIN_TERMS = 28
"""Room for the coefficients of a step."""
SPIN_ROUNDING = 1e-17
"""Size of a term, over the whole, that ends the series [1]: a tenth of a rounding."""
STEADY_SPIN = 1e-15
"""Sine of the angle between angular momentum and velocity below which the axis stays [1]: a few roundings."""
SPIN_STEPS = 10_000
"""Steps of one substep beyond which a spin is left about its axis: 240,000 rad/s at 60 frames per second."""

# sweep (time of impact)
TIME_OF_IMPACT_STEPS = 500
"""Advances of one sweep; 3 are usual for a bullet, 6 to 50 for a spin of several radians."""
LEAP_CUT = 0.5
"""Factor between the leaps tried [1]; a trial takes one support of each piece, not a whole distance."""

PAST_MIDDLE = 0.5
"""Share of the widths of a link and an obstacle past which the way out may lead to the far side [1]."""
DRIVEN_DEPTH_SHARE = 0.25
"""Share of the width of a driven link and an obstacle that the link may go into it [1]: half way to where the
far side is nearer."""
DRIVEN_DEPTH_SLACK = 0.025
"""Accepted deviation from DRIVEN_DEPTH_SHARE [1]."""
SEGMENT_TURN = 0.5
"""Turn of a link [rad] in one segment of its sweep: straight ways leave its arc by 1/32 of its length."""

# virtual coupling (method, section 5)
NEAR_CRITICAL = 1e-5
"""(w h)^2 below which three terms give a nearly critical spring to rounding: the next is 1e-15 / 720 [1]."""

# chains (method, section 4)
ATTRACTION_TIME = 0.1
"""Lag at which no tracker is too slow for the attraction [s]: of `paper`, and of what its stride allows."""
ATTRACTION_TURN = 0.02
"""Turn of all hinges of a chain in one part of the attraction [rad]: 14 mm at the end of an arm, half of what
two hands are thick."""
ATTRACTION_MOST = 0.04
"""And at most, however few parts are left [rad]: what a hand is thick."""
ATTRACTION_SETTLED = 1e-3
"""Turn of all hinges in a part after which none is needed [rad]: first order leaves 0.5e-6 m of it."""
CHAIN_ROUNDS = 16
"""Links of one chain, or turns of all chains, that bring a body out of overlap."""
CHAIN_TOLERANCE = 2e-7
"""Distance of end effector and goal at which a link is out [m]: well within OVERLAP_TOLERANCE."""
CHAIN_PASSES = 64
"""Passes of one reach; a shallow overlap takes about 10."""
STRETCHED_SHARE = 0.5
"""Share of the way to its goal that an end effector may miss before the chain is bent [1]."""
BEND_SHARE = 0.05
"""Share of the way to the middle of its range by which a hinge is bent then [1]: 4 degrees of an elbow."""
BEND_ROUNDS = 4
"""Rounds in which a chain is bent: a straight leg is 3 mm too long after one, 20 mm after four."""
ALONG_COSINE = 0.17364817766693033
"""Cosine between a link and the way out below which it lies along the obstacle [1]: sin 10 degrees."""
CHAIN_JOINTS = 16
"""Hinges a chain may have."""
POSTURE_CONSTRAINTS = 32
"""Points of a body's chains that one turn looks at; the next one sees the rest."""
CONSTRAINT_ALIKE = 1e-3
"""Distance at which two points of a pair count as one [m]."""
QP_SWEEPS = 96
"""Sweeps of Hildreth's method; one pair takes 1, a corner about 10, almost opposing ones tens."""
QP_PLAIN_SWEEPS = 8
QP_RELAXATION = 1.7
"""Plain sweeps, and the factor of the corrections after them [1]: hundreds of sweeps become tens."""
QP_TOLERANCE = 1e-8
"""Change of a depth in a sweep that ends it [m]: a hundredth of OVERLAP_TOLERANCE."""
QP_ROUGH_TOLERANCE = 1e-6
"""The same where a turn is pulled [m]: what is left is taken out after it."""
QP_CLEARANCE = 5e-7
"""Gap that a turn aims at [m]: what its linearisation leaves then is no depth, and the links still touch."""
QP_LEVER = 5e-3
"""Lever up to which a depth is not worth its turns [m]: of a stretched limb, or between opposing planes."""
QP_TURN_MAX = 0.2
"""Largest turn of a hinge in one round [rad]: first order leaves 2 % of it."""
PART_WHOLE, PART_ROOT = -2, -1
"""Of a driver: all of it, or what no chain moves; its chains count from 0."""
TRUNK_OFFSET = 1 << 20
"""Added to a driver's index where a mover is its links in no chain: more drivers than a scene holds."""

# inverse kinematics (method, section 4)
IK_LEVER = 1e-9
"""Distance from a joint's axis below which end effector or goal has no direction round it [m]."""
IK_TOLERANCE = 1e-5
"""Distance of end effector and goal at which a chain has arrived [m]."""
IK_STALL_PASSES = 16
IK_STALL_FALL = 0.98
"""The distance must fall below 0.98 of itself in 16 passes."""
IK_STRIDE = 3
"""Passes between extrapolations: two to tell the share, one to let the fast parts settle."""
IK_RATIO_MAX = 0.98
"""Largest share of a pass in the one before that is believed [1]: 49 passes more at most."""
IK_CAP = 256
"""Passes over a chain; about 6 are usual."""
IK_RESTARTS = 8
"""Random postures that `accurate_ik` starts from after the present one."""
IK_FINISH_CAP = 64
"""Steps of its damped least squares; about 5 are usual."""
IK_DAMPING_START, IK_DAMPING_MIN, IK_DAMPING_MAX = 0.03, 1e-5, 10.0
"""Damping of a step, and where its fall stops and its rise gives up [m]: a tenth of a limb's length, what a
stretched arm's columns are good to, and many lengths."""
IK_DAMPING_FALL = 4.0
"""Factor of the damping after a step that came nearer, and the inverse after one that did not [1]."""
RANDOM_PRIME = 2147483647
"""Of the generator of Park and Miller; its states are 1 to 2^31 - 2."""

# reach cones
CONE_SLACK = 1e-12
"""Height over an edge's plane, times the edge's length, that counts as inside [1]: some thousand roundings,
so that a projected direction is not projected again."""
HALF_TURN = 1e-14
"""1 + cosine below which the shortest rotation between two directions has no axis [1]: some 50 roundings."""
GIMBAL_COSINE = 1e-9
"""Cosine of the second angle below which only the sum of the first and third is told [1]: their directions
are good to 1e-16 over it."""
LIMIT_SLACK = 1e-9
"""Excess over a hinge's limit that rounding of recovered angles explains [rad]; it is cut off."""

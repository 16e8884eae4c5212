"""What a step reports: seconds by stage, and counters of its work."""

STAGES = ("drive", "collision", "removal", "impulses", "integration")
"""Stages that the clocks of a step measure."""
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
"""Counters of a step. Depths without a certificate (`walked`), with one, or from scratch (`exact`). Inverse
kinematics (`ik`): links freed of overlap, passes over their joints, and joints in these passes.
`pairs.contacting`: most pairs that touched or overlapped in one detection of the driven loop."""
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

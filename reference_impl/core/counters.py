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
    "posture_qp.solves",
    "ccd.passes",
    "ik.joints",
    "pairs.contacting",
    "sweeps",
    "factorisations",
    "solves",
    "solves.open",
    "cap.closing",
    "cap.hold_rounds",
    "cap.separation_sweeps",
    "cap.translation_rounds",
    "cap.chain_rounds",
    "cap.posture_qp",
    "cap.constraints",
    "cap.ccd",
)
"""Counters of a step. Depths without a certificate (`walked`), with one, or from scratch (`exact`).

Chains: `ik.rounds` counts rounds of overlap removal, of one link by CCD or of all chains by a posture QP;
`posture_qp.solves` and `ccd.passes` the work of either; `ik.joints` the joints in these solves and passes.
`solves`: islands whose contacts were solved; `solves.open`: those with a residual over RESIDUAL_OPEN.
`pairs.contacting`: most pairs that touched or overlapped in one detection of the driven loop.

Caps reached (`cap`), by the loop that ended early: bracketing of an impact (`_closing`), attempts at a
substep in which sliding stops, sweeps of separation, rounds of translation and of chain overlap removal,
sweeps of the posture QP, its constraints, and passes of CCD."""
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
    COUNT_QP_SOLVES,
    COUNT_CCD_PASSES,
    COUNT_IK_JOINTS,
    COUNT_CONTACTING,
    COUNT_SWEEPS,
    COUNT_FACTORS,
    COUNT_SOLVES,
    COUNT_OPEN_SOLVES,
    CAP_CLOSING,
    CAP_HOLD_ROUNDS,
    CAP_SEPARATION_SWEEPS,
    CAP_TRANSLATION_ROUNDS,
    CAP_CHAIN_ROUNDS,
    CAP_POSTURE_QP,
    CAP_CONSTRAINTS,
    CAP_CCD,
) = range(len(COUNTERS))

"""Documented failings of the reference: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause

ALWAYS_MU = (
    "Eq. 10 as printed applies mu j to any sliding, however slow, and reverses it: a rolling ball every frame"
)
CUT_SHORT = (
    "a hold in which hands stop sliding along a box by its end is cut short where the box lands: its "
    "friction is a share of what stops them then, less than mu j; 2 of 186 such rows of `push_box`"
)
EULER = "semi-implicit Euler in steps of 1/60 s meets the floor up to v h deep"
HEAP = (
    "islands hold more bodies than Newton's method takes, and 40 sweeps a dense substep leave "
    "wedged balls a residual; they creep on"
)
HOVERS = (
    "while an arm slides along what its tracker presses it into, the least turn is linear in a frame and "
    "leaves the hand up to 0.19 mm off; where the tracker stays it is 5e-7 m"
)
LAGS = (
    "a chain follows its tracker with a lag of 0.1 s and comes free link by link: for much of the time in "
    "which the tracker is in the wall, the hand is not at it yet, or no longer"
)
PILES = (
    "impulses one after the other, each down to an approach of 1e-4 m/s, carry only part of a pile's load in "
    "a frame: its pieces creep, and separation lifts them; impulses=together: tower_10 gains 2e-11 J, not 0.2"
)
SLIDING = (
    "several contacts slide at once between bodies that lean on each other: some solves end at 1e-9 "
    "to 1e-8 m/s, over what counts as converged; a row of dominoes multiplies that, or rounding, to its sides"
)
STOPS = (
    "sliding contacts stop one shortly after the other: after ten attempts at a substep it goes on with one "
    "more stop inside"
)
TOP = (
    "semi-implicit Euler in steps of 1/60 s keeps a top's momentum, but its energy falls by an "
    "error of first order: it drifts towards the axis of its largest moment"
)
TURNS = (
    "contacts hold one after the other, each down to an approach of 1e-4 m/s, and takes mu j of "
    "its own: a patch creeps, and its points share their load differently in every frame"
)
END_TEST = (
    "overlap is tested at the end of a frame only: what moves farther in it than both bodies are thick "
    "passes, a hand of 2.5 m/s through its table and a ball of 30 m/s through a plate"
)

CAUSES: tuple[Cause, ...] = (
    Cause(
        "reference",
        ALWAYS_MU,
        {
            "paper": {
                "energy.injected": (
                    "ball_snip collide_sticks rod_e03 rod_e1 slip slip_seed0 slip_seed1 slip_seed2 "
                    "table_slide volley"
                ),
                "truth.velocity": "collide_sticks",
            },
            "paper+noisy": {
                "friction.direction": "table_slide:table-ball",
            },
        },
        never={
            "paper": {
                "events.roll": "ball_snip",
            },
        },
    ),
    Cause(
        "reference",
        CUT_SHORT,
        {
            "balanced": {
                "friction.deficit": "push_box:torso-box",
            },
        },
    ),
    Cause(
        "reference",
        END_TEST,
        {
            "paper": {
                "overlap.tunnelled": "shot_30 shot_300 slap_2.5 slap_3 slap_6",
                "restitution.error": "shot_30 shot_300",
            },
        },
    ),
    Cause(
        "reference",
        EULER,
        {
            "paper": {
                "energy.loss": "bounce_e1",
                "restitution.error": "bounce_e05 bounce_e08 bounce_e1",
            },
            "paper+noisy": {
                "restitution.error": "volley",
            },
        },
    ),
    Cause(
        "reference",
        HEAP,
        {
            "balanced accurate": {
                "solver.caps": "balls_box",
                "solver.residual": "balls_box",
            },
        },
    ),
    Cause(
        "reference",
        HOVERS,
        {
            "balanced accurate": {
                "contact.gap": "two_arms:east_wall-torso",
            },
        },
    ),
    Cause(
        "reference",
        LAGS,
        {
            "paper": {
                "contact.gap": "corner_slide:north_wall-torso",
            },
        },
        never={
            "paper": {
                "events.meet": "volley:ball_2-right_hand",
            },
        },
    ),
    Cause(
        "reference",
        PILES,
        {
            "paper": {
                "contact.impulse_balance": "break_15",
                "energy.injected": (
                    "arch_slides arch_stands arch_thin balls_box brick_wall coin_falls coin_rolls coin_spins "
                    "dominoes load_1e4 load_1e6 pyramid tall_holds tip_falls tip_holds tower_10 tower_20 "
                    "tower_20_jittered tower_40"
                ),
                "friction.creep": (
                    "arch_stands brick_wall load_1e4 load_1e6 pyramid tall_holds tip_holds tower_10 tower_20 "
                    "tower_20_jittered tower_40"
                ),
                "friction.deficit": (
                    "arch_stands brick_wall load_1e4 load_1e6 pyramid tall_holds tip_falls tip_holds "
                    "tower_10 tower_20 tower_20_jittered tower_40"
                ),
                "friction.lift": "arch_stands load_1e4 load_1e6 pyramid tall_holds tip_holds tower_40",
                "friction.tilt": "load_1e4 load_1e6 tall_holds tip_holds tower_40",
                "overlap.max": "tower_40",
                "rest.moved": (
                    "arch_stands brick_wall load_1e4 load_1e6 pyramid tall_holds tip_holds tower_10 tower_20 "
                    "tower_20_jittered tower_40"
                ),
                "symmetry.mirror": "arch_stands break_15 brick_wall dominoes pyramid",
            },
        },
    ),
    Cause(
        "reference",
        SLIDING,
        {
            "balanced accurate": {
                "symmetry.mirror": "dominoes",
                "solver.caps": "arch_thin",
            },
            "accurate": {
                "solver.caps": "arch_slides dominoes",
            },
        },
    ),
    Cause(
        "reference",
        STOPS,
        {
            "balanced": {
                "solver.caps": "arch_slides",
            },
        },
    ),
    Cause(
        "reference",
        TOP,
        {
            "paper": {
                "energy.loss": "tumble_unstable",
                "rotation.flip": "tumble_stable tumble_unstable",
            },
        },
    ),
    Cause(
        "reference",
        TURNS,
        {
            "paper": {
                "contact.gap": "push_box:floor-box",
                "energy.injected": (
                    "incline_holds incline_slides push_box slide slide_seed0 slide_seed1 slide_seed2 stack"
                ),
                "friction.creep": "incline_holds slide stack",
                "friction.deficit": (
                    "incline_holds incline_slides push_box:torso-box slide slide_seed0 slide_seed1 "
                    "slide_seed2 stack:box_1-box_2 stack:box_2-box_3 stack:box_4-box_5 stack:floor-box_1"
                ),
                "rest.moved": "incline_holds stack",
            },
            "paper+noisy": {
                "friction.deficit": "volley:floor-ball_1",
            },
        },
    ),
)

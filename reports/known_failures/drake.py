"""Documented failings of Drake: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied. "With corner
balls": eight balls of 0.1 mm in the corners of each box and the box inset by 0.02 mm, as the documentation
of Drake advises for point contact; a box then has a point per corner.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause

ONE_POINT = (
    "point contact gives one point for each pair of pieces: what stands on faces rocks, creeps and falls, "
    "and what slides on them tumbles. With corner balls alone tower_10 moves by 0.23 mm under point and "
    "tamsi and by 1.2 mm under sap in place of 0.4 m, incline_holds under sap by 0.1 mm (balls of 1 mm) in "
    "place of 153, and slide does not lift under point; for faces Drake's documentation recommends "
    "hydroelastic contact"
)
LAGGED = (
    "the default approximation bounds friction by mu times the normal force of the step before: slip leaves "
    "the cone by 6.4 % at 1/1020 s, by 3.7 % at 1/4080 s, under sap and tamsi by nothing"
)
DISCRETE = (
    "contact is found only once it overlaps, and drives out what moves by some millimetres a step: "
    "ball_snip 3.4 mm under sap, 0.5 mm at 1/4080 s; slap_6 9.3 and 1.4 mm, under point 7.9 and 1.6 mm; the "
    "falling stones of arch_slides 17 and 2.5 mm under tamsi"
)
STIFFNESS = (
    "a contact has 5e5 N/m whatever it bears, 1e6 N/m of both geometries in series: under load_1e4 boxes "
    "sink by 100 mm with corner balls under point, by 0.4 mm with 1e8 N/m and balls of 1 mm; of load_1e6 by "
    "320 mm and 1 mm with 1e10 N/m. sap caps the stiffness (its near-rigid regime)"
)
RELAXES = (
    "sap drives overlap out within its relaxation time, 0.1 s by default: a ball at rest lies 0.40 mm deep "
    "in bounce_e0, 0.020 mm with 10 ms"
)
GLIDES = (
    "sap lets what slides glide on a gap of mu times its slip times step and relaxation time, which Drake's "
    "documentation names for kSap and kSimilar: slip rolls 8.1 % late, 0.18 % with a relaxation time of 1 "
    "ms; slide lifts by 138 mm, with corner balls of 1 mm too, but under lagged with these by nothing"
)
NOT_CONVERGED = (
    "the TAMSI solver finds no solution where bodies rock on single points, and Drake ends the run; its "
    "documentation says of kTamsi that it can fail and is deprecated. With corner balls tower_10, stack, "
    "pyramid and brick_wall play to their end"
)
AMPLIFIES = (
    "dominoes that lie on each other amplify what lagged and similar leave of the symmetry: 0.036, 0.040 "
    "with corner balls, 0.062 with these under similar, but 0.0019 under sap"
)

CAUSES: tuple[Cause, ...] = (
    Cause(
        "drake",
        ONE_POINT,
        {
            "point sap": {
                "rest.moved": "arch_stands brick_wall incline_holds pyramid stack tall_holds tip_holds "
                "tower_10 tower_20 tower_20_jittered tower_40",
                "friction.creep": "arch_stands brick_wall incline_holds pyramid stack tall_holds tip_holds "
                "tower_10 tower_20 tower_20_jittered tower_40",
                "overlap.max": "arch_stands brick_wall pyramid stack tower_10 tower_20 tower_20_jittered "
                "tower_40",
                "symmetry.mirror": "arch_stands brick_wall pyramid",
                "friction.lift": "arch_stands",
                "friction.tilt": "arch_stands",
            },
            "point": {
                "overlap.max": "slide",
                "contact.gap": "brick_wall:floor-brick_1_1",
                "friction.lift": "slide",
                "friction.tilt": "slide",
                "friction.stop": "slide",
            },
            "sap": {
                "symmetry.mirror": "dominoes",
                "contact.gap": "pyramid:floor-box_1_1 pyramid:floor-box_1_2 pyramid:floor-box_1_8 "
                "slide:plane-box_0 slide:plane-box_22.5 slide:plane-box_45",
                "friction.creep": "slide",
                "friction.lift": "incline_slides tip_holds",
                "friction.stop": "slide",
                "friction.tilt": "incline_slides tip_holds",
            },
            "tamsi": {
                "rest.moved": "incline_holds tall_holds tip_holds",
                "friction.creep": "incline_holds tall_holds tip_holds",
            },
        },
        never={"point": {"events.meet": "dominoes:domino_20-domino_19"}},
    ),
    Cause(
        "drake",
        LAGGED,
        {
            "point": {
                "friction.cone": "arch_slides arch_stands arch_thin ball_snip brick_wall coin_falls "
                "coin_rolls coin_spins dominoes incline_holds incline_slides load_1e4 load_1e6 pyramid "
                "rod_e03 slap_2.5 slap_3 slap_6 slide slip stack tall_holds tip_falls tip_holds tower_10 "
                "tower_20 tower_20_jittered tower_40",
            },
        },
    ),
    Cause(
        "drake",
        DISCRETE,
        {
            "point": {"overlap.max": "arch_slides arch_thin ball_snip slap_2.5 slap_6"},
            "sap": {"overlap.max": "arch_thin ball_snip slap_2.5 slap_3 slap_6"},
            "tamsi": {"overlap.max": "arch_slides"},
        },
    ),
    Cause(
        "drake",
        STIFFNESS,
        {
            "point sap": {
                "overlap.max": "load_1e4 load_1e6",
                "rest.moved": "load_1e4 load_1e6",
                "friction.creep": "load_1e4 load_1e6",
                "overlap.tunnelled": "load_1e6",
            },
            "sap": {"overlap.tunnelled": "load_1e4"},
            "tamsi": {
                "overlap.max": "load_1e6",
                "rest.moved": "load_1e6",
                "friction.creep": "load_1e6",
                "overlap.tunnelled": "load_1e6",
            },
        },
    ),
    Cause("drake", RELAXES, {"sap": {"contact.gap": "bounce_e0 bounce_e03 tip_falls:box-stop"}}),
    Cause(
        "drake",
        GLIDES,
        {"sap": {"friction.lift": "slide", "friction.tilt": "slide", "rolling.time": "slip"}},
    ),
    Cause(
        "drake",
        NOT_CONVERGED,
        {
            "tamsi": {
                "run": "arch_stands arch_thin brick_wall dominoes load_1e4 pyramid stack tower_10 tower_20 "
                "tower_20_jittered tower_40",
            },
        },
    ),
    Cause("drake", AMPLIFIES, {"point": {"symmetry.mirror": "dominoes"}}),
)

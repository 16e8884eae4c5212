"""Documented failings of Drake: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause

ONE_POINT = (
    "point contact gives one point for each pair of pieces: tip_holds stands on one corner at a time, and "
    "what stands on faces rocks, creeps and falls; for faces Drake's documentation recommends hydroelastic "
    "contact"
)
LAGGED = (
    "the default approximation bounds friction by mu times the normal force of the step before: slip leaves "
    "the cone by 6.4 % at 1/1020 s, by 3.7 % at 1/4080 s, under sap and tamsi by nothing"
)
DISCRETE = (
    "contact is found only once it overlaps: in ball_snip the ball meets the floor at 3.8 m/s, 3.8 mm a "
    "step; in slap_2.5 and slap_6 the hand comes down by 2.5 and 5.9 mm a step, where the step was not varied"
)

CAUSES: tuple[Cause, ...] = (
    Cause(
        "drake",
        ONE_POINT,
        {
            "point": {
                "rest.moved": "arch_stands brick_wall incline_holds load_1e4 load_1e6 pyramid stack "
                "tall_holds tip_holds tower_10 tower_20 tower_20_jittered tower_40",
                "friction.creep": "arch_stands brick_wall incline_holds load_1e4 load_1e6 pyramid stack "
                "tall_holds tip_holds tower_10 tower_20 tower_20_jittered tower_40",
                "overlap.max": "arch_slides arch_stands arch_thin brick_wall load_1e4 load_1e6 pyramid slide "
                "stack tower_10 tower_20 tower_20_jittered tower_40",
                "overlap.tunnelled": "load_1e6",
                "symmetry.mirror": "arch_stands brick_wall dominoes pyramid",
                "contact.gap": "brick_wall:floor-brick_1_1",
                "friction.lift": "arch_stands slide",
                "friction.tilt": "arch_stands slide",
                "friction.stop": "slide",
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
    Cause("drake", DISCRETE, {"point": {"overlap.max": "ball_snip slap_2.5 slap_6"}}),
)

"""Documented failings of DART: one entry per cause.

Figures are those of the scene that a reason names, with what was varied and nothing else.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause
from touchstone.reports.known_failures.shared import COARSE_SERVO, NEWTON, TOGETHER

ARCH = (
    "the boxed LCP bounds friction by normal impulses found without it, and joints slip: "
    "arch_stands moves by 0.19 m at 1/1020 s, 0.46 m at 1/240 s, 45 mm with the NSGS solver "
    "(accurate)"
)
BOUNDS = (
    "the boxed LCP bounds friction by normal impulses found without it: what friction unloads "
    "keeps its bound, corners of a sliding box as points of a pressed hull; with the NSGS solver "
    "(accurate) none of a hand leaves the cone"
)
BOX = (
    "friction is bounded along two fixed directions, each by mu: sqrt 2 mu at 45 degrees, where a"
    " cube stops after 0.707 of the way, and a path that curves between"
)
DETECTOR = (
    "DART's Bullet detector, advised for primitives, lets an edge of a sliding cube sink by 3 mm (20 mm "
    "at 1/240 s), and the box that tips against its stop by 1.1 mm; with FCL alone, as in `default`, "
    "none of it is there"
)
DISCRETE = (
    "contact is found only once it overlaps: a ball meets the floor at 3.8 m/s, 16 mm a native "
    "step, hands that meet or reach a wall move 4 to 5 mm in one, and the step in which they are "
    "found is the deepest"
)
LATE_LIMITS = (
    "a joint limit is found only once it is exceeded: by up to 0.063 rad, what the hinge turns in"
    " a step, and all of it is undone in the next"
)
LATE_MESH = (
    "DART's Bullet detector, which balls on hulls need, finds a fingertip's triangles in a table "
    "only from 2 mm on in 20 of 30 orientations (FCL: from 0.1 mm on), and depth is undone by 2 "
    "to 4 mm/s"
)
LOAD = (
    "no solution beyond some mass ratio: load_1e4 moves by less than 1 mm at 1/1020 s and by 6.7 "
    "mm at 1/240 s, load_1e6 by 0.1 m at either"
)
NSGS_ROUNDS = (
    "the NSGS solver (accurate) stops after its rounds: tower_20 moves by 23 mm and load_1e4 by 0.1 "
    "m, less than 1 mm by the pivoting one (recommended)"
)
ONE_STEP_OF_GRAVITY = (
    "restitution reverses a velocity that holds one more step of gravity: a bounce g h too fast"
)
PRESSED_BACK = (
    "a pressed limb that was lifted out is pushed back in by its servo until contact is found again, by "
    "F h^2 / m in a step: wall_push 3.7, 1.1 and 0.3 mm at 1/240, 1/480 and 1/1020 s, 2.2 mm at 1/240 s "
    "with servos half as fast; `accurate` 1.2 mm at 1/1020 s and 0.1 mm at half of it"
)
RACK = (
    "which balls of a rack are found touching in one step depends on the step: 6.6 % of the "
    "energy are gained at 1/1020 s, none at 1/240 s"
)
SINKS = "a body at rest sinks by about g h^2 = 0.17 mm before contact is found"
SLOW_PUSH = (
    "an inelastic impact is found up to v h deep and undone at 1 mm/s (contact_error_reduction_velocity_max)"
)
TIP = (
    "the boxed LCP bounds friction by normal impulses found without it: a box that should tip "
    "slides, with a friction of 0.5 = w / h in place of 0.6, at 1/240, 1/1020 and 1/4080 s"
)
TOWER = (
    "stacks hold the less the larger the step: tower_20 moves by less than 1 mm at 1/1020 s and "
    "by 9.2 mm at 1/240 s, tower_40 by 2.8 and 59 mm"
)
FASTEST_BOUNCE = (
    "a bounce leaves at 100 m/s at most: 0.333 of 300 m/s for 0.5, the same at 1/1020, 1/4080 and 1/12240 s"
)
PASSES = (
    "contact is found only where a step ends: at 30 m/s a ball of 10 cm goes 12.5 cm in 1/240 s, past a "
    "plate of 1 mm; at 1/1020 s it comes back"
)
SLAP = (
    "contact is found only once it overlaps, and what a hand goes in a step it sinks: slap_6 6.1 mm at "
    "1/1020 s, 12.8 mm at 1/480 s; at 1/240 s it diverges, with servos half as fast and with explicit "
    "torques too"
)
JERKED = (
    "a tracker that jumps by 1 mm and 0.5 degrees sixty times a second jerks the links by their servos: "
    "fingertips meet what they touch faster and slip to and fro; with the ideal tracker none of it is "
    "there"
)

CAUSES: tuple[Cause, ...] = (
    Cause(
        "dart",
        ARCH,
        {
            "recommended equal-step default accurate": {
                "friction.creep": "arch_stands",
                "friction.lift": "arch_stands",
                "friction.tilt": "arch_stands",
                "rest.moved": "arch_stands",
                "symmetry.mirror": "arch_stands",
            },
            "recommended default accurate": {
                "energy.injected": "arch_stands",
            },
            "equal-step": {
                "contact.gap": "arch_stands:floor-stone_10 arch_stands:floor-stone_8",
                "overlap.max": "arch_stands",
            },
        },
    ),
    Cause(
        "dart",
        BOUNDS,
        {
            "recommended equal-step default": {
                "friction.cone": (
                    "arch_slides arch_stands arch_thin arms_cross ball_snip brick_wall coin_falls "
                    "coin_rolls coin_spins corner_slide dominoes push_box pyramid slap_2.5 slap_3 slide "
                    "table_slide two_arms volley wall_push"
                ),
            },
            "recommended equal-step": {
                "friction.cone": "tower_20_jittered",
            },
            "equal-step": {
                "friction.cone": "tip_falls",
                "friction.deficit": "ball_snip:table-ball",
            },
            "default": {
                "friction.cone": "stack tower_10",
            },
            "recommended default": {
                "friction.cone": "slap_6",
            },
        },
    ),
    Cause(
        "dart",
        BOX,
        {
            "recommended equal-step default": {
                "friction.cone": "slide_seed0 slide_seed1 slide_seed2 slip slip_seed0 slip_seed1 slip_seed2",
                "friction.stop": "slide:box_22.5 slide:box_45",
                "rolling.time": "slip:ball_22.5 slip:ball_45",
            },
            "accurate": {
                "friction.cone": "arch_slides arch_stands arch_thin load_1e4 load_1e6",
            },
        },
    ),
    Cause(
        "dart",
        COARSE_SERVO,
        {
            "equal-step": {
                "energy.injected": "corner_slide",
                "overlap.max": "corner_slide",
            },
        },
    ),
    Cause(
        "dart",
        DETECTOR,
        {
            "recommended equal-step accurate": {
                "overlap.max": "slide slide_seed1",
            },
            "recommended equal-step": {
                "friction.stop": "slide:box_0",
                "friction.tilt": "slide",
            },
            "recommended": {
                "contact.gap": (
                    "slide:plane-box_0 slide:plane-box_22.5 slide_seed1:plane-box_13 "
                    "slide_seed1:plane-box_85.4"
                ),
            },
            "equal-step": {
                "contact.gap": (
                    "slide:plane-box_45 slide_seed0:plane-box_3.69 slide_seed0:plane-box_73.2 "
                    "slide_seed1:plane-box_28.1 slide_seed2:plane-box_54"
                ),
                "overlap.max": "slide_seed0 slide_seed2",
                "rest.moved": "incline_holds",
                "symmetry.mirror": "dominoes",
            },
            "accurate": {
                "contact.gap": "load_1e4:floor-box_2 slide tip_falls:box-stop tower_40:floor-box_1",
            },
        },
    ),
    Cause(
        "dart",
        DISCRETE,
        {
            "equal-step": {
                "contact.gap": "arms_cross:torso-torso two_arms:east_wall-torso",
                "overlap.max": "arms_cross ball_snip push_box table_slide two_arms volley",
            },
        },
    ),
    Cause(
        "dart",
        FASTEST_BOUNCE,
        {
            "recommended default accurate": {
                "restitution.error": "shot_300",
            },
        },
    ),
    Cause(
        "dart",
        JERKED,
        {
            "recommended+noisy": {
                "friction.deficit": "ball_snip:table-ball",
                "friction.direction": "ball_snip:table-ball table_slide:table-ball",
                "overlap.max": "ball_snip",
            },
            "equal-step+noisy": {
                "friction.direction": "table_slide:table-ball",
                "restitution.error": "ball_snip",
            },
        },
    ),
    Cause(
        "dart",
        LATE_LIMITS,
        {
            "equal-step": {
                "joint.limit": "wall_push",
            },
        },
    ),
    Cause(
        "dart",
        LATE_MESH,
        {
            "recommended equal-step default accurate": {
                "contact.gap": "table_slide:table-palm",
            },
            "recommended default accurate": {
                "overlap.max": "table_slide",
            },
        },
    ),
    Cause(
        "dart",
        LOAD,
        {
            "recommended equal-step default": {
                "overlap.max": "load_1e6",
                "rest.moved": "load_1e6",
            },
            "recommended default": {
                "friction.creep": "load_1e6",
            },
            "equal-step": {
                "contact.gap": "load_1e4:floor-box_1 load_1e6:floor-box_2",
                "friction.creep": "load_1e4",
                "overlap.max": "load_1e4",
                "rest.moved": "load_1e4",
            },
        },
    ),
    Cause(
        "dart",
        NEWTON,
        {
            "recommended equal-step default accurate": {
                "energy.injected": "rod_e1",
            },
        },
    ),
    Cause(
        "dart",
        NSGS_ROUNDS,
        {
            "accurate": {
                "contact.gap": "load_1e6:floor-box_2",
                "friction.creep": "tower_20 tower_20_jittered tower_40",
                "friction.tilt": "load_1e4 load_1e6",
                "overlap.max": "load_1e4 load_1e6",
                "rest.moved": "load_1e4 load_1e6 tower_20 tower_20_jittered tower_40",
                "symmetry.mirror": "dominoes",
            },
        },
    ),
    Cause(
        "dart",
        ONE_STEP_OF_GRAVITY,
        {
            "equal-step": {
                "energy.gain": "bounce_e1",
                "energy.injected": "bounce_e1",
                "restitution.error": "bounce_e08",
            },
        },
    ),
    Cause(
        "dart",
        PASSES,
        {
            "equal-step": {
                "overlap.tunnelled": "shot_30 shot_300",
                "restitution.error": "shot_30 shot_300",
            },
        },
    ),
    Cause(
        "dart",
        PRESSED_BACK,
        {
            "equal-step accurate": {
                "contact.gap": "wall_push:east_wall-torso",
                "overlap.max": "wall_push",
            },
            "equal-step": {
                "contact.gap": "corner_slide:north_wall-torso volley:north_wall-torso",
            },
        },
    ),
    Cause(
        "dart",
        RACK,
        {
            "recommended default accurate": {
                "energy.gain": "break_15",
            },
        },
    ),
    Cause(
        "dart",
        SINKS,
        {
            "equal-step": {
                "contact.gap": "ball_snip",
            },
        },
    ),
    Cause(
        "dart",
        SLAP,
        {
            "recommended equal-step default accurate": {
                "overlap.max": "slap_2.5 slap_3",
            },
            "recommended default accurate": {
                "overlap.max": "slap_6",
            },
            "equal-step": {
                "run": "slap_6",
            },
        },
    ),
    Cause(
        "dart",
        SLOW_PUSH,
        {
            "recommended equal-step default accurate": {
                "contact.gap": "bounce_e0",
            },
        },
    ),
    Cause(
        "dart",
        TIP,
        {},
        never={
            "recommended equal-step default": {
                "events.meet": "tip_falls:box-stop",
            },
        },
    ),
    Cause(
        "dart",
        TOGETHER,
        {
            "recommended equal-step default accurate": {
                "momentum.withheld": "cradle",
                "rest.moved": "cradle",
                "truth.velocity": "cradle",
            },
        },
    ),
    Cause(
        "dart",
        TOWER,
        {
            "recommended equal-step default": {
                "rest.moved": "tower_40",
            },
            "recommended default": {
                "energy.injected": "tower_40",
            },
            "equal-step": {
                "friction.creep": "pyramid tower_20 tower_20_jittered tower_40",
                "overlap.max": "tower_20 tower_20_jittered tower_40",
                "rest.moved": "pyramid tower_10 tower_20 tower_20_jittered",
                "symmetry.mirror": "pyramid",
            },
        },
    ),
)

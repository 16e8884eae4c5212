"""Documented failings of DART: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause
from touchstone.reports.known_failures.dart_reasons import (
    ARCH,
    BOUNDS,
    BOX,
    DETECTOR,
    DISCRETE,
    FASTEST_BOUNCE,
    JERKED,
    LATE_LIMITS,
    LATE_MESH,
    LOAD,
    NSGS_ROUNDS,
    ONE_STEP_OF_GRAVITY,
    PASSES,
    PRESSED_BACK,
    RACK,
    SINKS,
    SLAP,
    SLOW_PUSH,
    TIP,
    TOWER,
)
from touchstone.reports.known_failures.shared import COARSE_SERVO, NEWTON, TOGETHER

CAUSES: tuple[Cause, ...] = (
    Cause(
        "dart",
        ARCH,
        {
            "recommended equal-step default accurate": {
                "friction.creep": "arch_stands",
                "friction.lift": "arch_stands",
                "friction.tilt": "arch_stands",
                "overlap.max": "arch_stands",
                "rest.moved": "arch_stands",
                "symmetry.mirror": "arch_stands",
            },
            "recommended default accurate": {
                "energy.injected": "arch_stands",
            },
            "recommended default": {
                "contact.gap": "arch_stands:floor-stone_10 arch_stands:floor-stone_11",
                "energy.injected": "arch_slides",
            },
            "equal-step": {
                "contact.gap": (
                    "arch_stands:floor-stone_10 arch_stands:floor-stone_11 arch_stands:floor-stone_4 "
                    "arch_stands:floor-stone_5 arch_stands:floor-stone_6"
                ),
            },
        },
        chaotic="arch_slides arch_stands",
    ),
    Cause(
        "dart",
        BOUNDS,
        {
            "recommended equal-step default": {
                "friction.cone": (
                    "arch_slides arch_stands arch_thin arms_cross ball_snip brick_wall carry coin_falls "
                    "coin_rolls coin_spins corner_slide dominoes hold push_box pyramid slap_2.5 slap_3 "
                    "slap_6 slide table_slide two_arms volley wall_push"
                ),
            },
            "recommended equal-step": {
                "friction.cone": "tower_20_jittered",
            },
            "equal-step": {
                "friction.cone": "belt belt_ramp drag tip_falls",
                "friction.deficit": "ball_snip:table-ball",
            },
            "default": {
                "friction.cone": "stack tower_10",
            },
        },
    ),
    Cause(
        "dart",
        BOX,
        {
            "recommended equal-step default": {
                "friction.cone": (
                    "belt_across slide_seed0 slide_seed1 slide_seed2 slip slip_seed0 slip_seed1 slip_seed2"
                ),
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
        harness=True,
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
                    "belt:belt-against belt:belt-set belt_ramp slide:plane-box_45 "
                    "slide_seed0:plane-box_3.69 slide_seed0:plane-box_73.2 slide_seed1:plane-box_28.1 "
                    "slide_seed2:plane-box_54"
                ),
                "overlap.max": "belt belt_ramp slide_seed0 slide_seed2",
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
                "contact.gap": "arms_cross:torso-torso table_slide:palm-ball two_arms:east_wall-torso",
                "overlap.max": (
                    "arch_slides arch_thin arms_cross ball_snip push_box table_slide two_arms volley"
                ),
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
                "overlap.max": "ball_snip volley",
            },
            "equal-step+noisy": {
                "friction.direction": "table_slide:table-ball",
                "joint.limit": "two_arms",
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
                "contact.gap": (
                    "corner_slide:east_wall-torso corner_slide:north_wall-torso push_box:torso-box "
                    "volley:north_wall-torso"
                ),
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
                "overlap.max": "slap_2.5 slap_3 slap_6",
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

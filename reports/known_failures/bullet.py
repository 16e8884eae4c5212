"""Documented failings of Bullet: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause
from touchstone.reports.known_failures.shared import NEWTON, TOGETHER

AHEAD = (
    "a contact found d apart, up to 0.02 sqrt 3 r = 1.7 mm, bounces with e v - d / h: ever less "
    "with h, until none is left"
)
APART = "friction acts on each ball at its own witness, d = v h apart: a torque d j_t from nowhere"
BULLET_BOX = (
    "in maximal coordinates Bullet's friction is a box of two directions, each within mu of the normal "
    "force: at most 0.414 beyond the cone; in reduced coordinates none"
)
CORNERS = "the rear corners of a sliding cube are missed until they sink: 1.2 mm, 0.3 mm at half the step"
DEPTH = (
    "a contact found d deep bounces with e v + 0.08 d / h (contactERP): up to 0.08 too much, at "
    "any step, ball after ball"
)
DISCRETE = (
    "contact is found only once it overlaps: a ball meets the floor at 3.8 m/s, 16 mm a native "
    "step, stones fall at 3 m/s, 12 mm a step; stones are within the limit at 1/960 s"
)
JAMMED = (
    "wall_push: where the left foot comes down too it jams between wall and floor, 3.9 mm at 1/240 s and "
    "1.9 mm at 1/720 s; the right one stands alone at 1/960 s. With explicit forces it jams at 1/180 s, "
    "not at 1/240 s"
)
LATE_LIMITS = (
    "a joint limit is found only once it is exceeded: by up to 0.035 rad, what the hinge turns in"
    " a step, and a fifth is undone in the next"
)
LOAD = (
    "sequential impulses need thousands of rounds for a mass ratio of 1e4: load_1e4 moves by 370 "
    "mm with 50 rounds, by 4 mm with 5,000"
)
MARGIN = (
    "hulls carry a margin of 1 mm, by which what touches is held or pushed apart: arch_stands moves by "
    "14 mm, by 1.6 mm with a margin of 0.1 mm; links keep theirs whatever is asked for, a limb hovers "
    "by 1.0 mm and two arms by 2.0 mm"
)
SQUEEZED = (
    "a cube that two plates squeeze with 20 N each sinks into the ground by 0.16 mm, at 1/60 and 1/240 s; "
    "neither rounds nor friction were varied"
)
ROUNDS = (
    "50 rounds of sequential impulses a step leave the lowest contacts of a stack unsolved: "
    "tower_20 moves by 78 mm, by 24 and 8 mm with 200 and 1,000 rounds"
)
ROW = (
    "dominoes leave their mirror plane, by 0.031, 0.083 and 0.059 m/s at 1/240, 1/480 and 1/960 s, and "
    "in maximal coordinates by 0.046 m/s, by 0.29 m/s with 1,000 rounds; that contacts are solved one "
    "after the other is the likely cause, but the order was not varied"
)
TALL = (
    "stacks sink in steps of 1/240 s whatever the rounds: tower_40 overlaps by 5.2 mm, by 7.8 mm with "
    "10,000 rounds in place of 50, by 0.3 mm at 1/960 s, and moves by 60, 51 and 23 mm; "
    "tower_20_jittered overlaps by 1.8, 1.9 (1,000 rounds) and 0.1 mm"
)
UNANNOUNCED = (
    "`accurate` drops contacts ahead of a collision (contactProcessingThreshold 0): corner_slide gains "
    "38 mJ, but 1.2 mJ with the default's threshold, 15 mJ with contactERP 0.08 and 6.4 mJ with servos "
    "half as fast; joint limits, their erp and more rounds change less than 2 mJ"
)
UNLOADED = (
    "in maximal coordinates a contact whose normal impulse falls to 0 keeps the friction of the rounds "
    "before: a pair of brick_wall has 1.1 mN s of friction under no load; 1,000 rounds and no warm "
    "start leave it, in reduced coordinates it is not there"
)
YAW = "friction at the corners, one after the other, turns a cube that slides along no axis"
PASSES = (
    "contact is found only where a step ends: at 30 m/s a ball of 10 cm goes 12.5 cm in 1/240 s, past a "
    "plate of 1 mm; at 1/960 s it comes back"
)
JERKED = (
    "a tracker that jumps by 1 mm and 0.5 degrees sixty times a second jerks the links by their servos: "
    "they meet what they touch faster, and hinges run into their limits; with the ideal tracker none of "
    "it is there"
)

CAUSES: tuple[Cause, ...] = (
    Cause(
        "bullet",
        AHEAD,
        {
            "recommended equal-step default": {
                "contact.at_distance": "bounce_e08",
                "restitution.error": "bounce_e08",
            },
        },
    ),
    Cause(
        "bullet",
        APART,
        {
            "recommended equal-step default accurate maximal": {
                "momentum.angular": "collide_slips collide_sticks",
            },
        },
    ),
    Cause(
        "bullet",
        BULLET_BOX,
        {
            "maximal": {
                "friction.cone": (
                    "ball_snip incline_holds incline_slides load_1e6 push_box pyramid slide slide_seed0 "
                    "slide_seed1 slide_seed2 table_slide tip_holds"
                ),
                "friction.deficit": "push_box:floor-box",
            },
        },
    ),
    Cause(
        "bullet",
        CORNERS,
        {
            "recommended equal-step default": {
                "overlap.max": "slide slide_seed1 slide_seed2",
            },
        },
    ),
    Cause(
        "bullet",
        DEPTH,
        {
            "recommended equal-step default accurate maximal": {
                "energy.gain": "bounce_e1",
                "energy.injected": "bounce_e1",
            },
            "recommended equal-step default maximal": {
                "energy.gain": "break_15",
                "restitution.error": "bounce_e1 volley",
            },
            "maximal": {
                "restitution.error": "bounce_e08",
            },
        },
    ),
    Cause(
        "bullet",
        DISCRETE,
        {
            "recommended equal-step default maximal": {
                "overlap.max": "arch_slides arch_thin ball_snip slap_2.5 slap_3 slap_6 volley",
            },
            "accurate": {
                "overlap.max": "slap_3 slap_6",
            },
        },
    ),
    Cause(
        "bullet",
        JAMMED,
        {
            "recommended equal-step default maximal": {
                "contact.gap": "wall_push:east_wall-torso",
                "overlap.max": "wall_push",
            },
        },
    ),
    Cause(
        "bullet",
        LATE_LIMITS,
        {
            "recommended equal-step default maximal": {
                "joint.limit": "two_arms wall_push",
            },
        },
    ),
    Cause(
        "bullet",
        LOAD,
        {
            "recommended equal-step default accurate maximal": {
                "energy.injected": "load_1e6",
                "friction.creep": "load_1e6",
                "friction.tilt": "load_1e4 load_1e6",
                "overlap.max": "load_1e4 load_1e6",
                "rest.moved": "load_1e4 load_1e6",
            },
            "recommended equal-step default accurate": {
                "friction.creep": "load_1e4",
            },
            "maximal": {
                "energy.injected": "load_1e4",
                "friction.lift": "load_1e4",
                "overlap.tunnelled": "load_1e4",
            },
        },
    ),
    Cause(
        "bullet",
        MARGIN,
        {
            "recommended equal-step default accurate maximal": {
                "contact.gap": (
                    "arms_cross:torso-torso carry:torso-box corner_slide:east_wall-torso "
                    "corner_slide:north_wall-torso hold:torso-box push_box:torso-box "
                    "table_slide:table-palm two_arms:east_wall-torso volley:north_wall-torso"
                ),
            },
            "recommended equal-step default maximal": {
                "contact.at_distance": "arch_slides arch_stands arch_thin coin_falls coin_rolls coin_spins",
                "contact.gap": "arch_stands:floor-stone_1 arch_stands:floor-stone_11",
                "energy.injected": "arch_stands",
                "friction.creep": "arch_stands",
                "friction.lift": "arch_stands",
                "friction.tilt": "arch_stands",
                "overlap.max": "arch_stands",
                "rest.moved": "arch_stands",
                "symmetry.mirror": "arch_stands",
            },
        },
        chaotic="arch_stands",
    ),
    Cause(
        "bullet",
        NEWTON,
        {
            "recommended equal-step default accurate maximal": {
                "energy.injected": "rod_e1",
            },
        },
    ),
    Cause(
        "bullet",
        PASSES,
        {
            "recommended equal-step default maximal": {
                "overlap.tunnelled": "shot_30",
                "restitution.error": "shot_30",
            },
            "recommended equal-step default maximal accurate": {
                "overlap.tunnelled": "shot_300",
                "restitution.error": "shot_300",
            },
        },
    ),
    Cause(
        "bullet",
        SQUEEZED,
        {
            "recommended equal-step default": {
                "contact.gap": "lift:ground-cube",
                "overlap.max": "hold",
            },
        },
    ),
    Cause(
        "bullet",
        ROUNDS,
        {
            "recommended equal-step default accurate maximal": {
                "contact.gap": "tower_20:floor-box_1 tower_20_jittered:floor-box_1",
                "friction.creep": "tower_20 tower_20_jittered tower_40",
                "rest.moved": "tower_10 tower_20 tower_20_jittered",
            },
            "recommended equal-step default maximal": {
                "friction.creep": "tower_10",
            },
            "recommended equal-step default": {
                "contact.gap": "tower_40:floor-box_1",
            },
            "accurate": {
                "overlap.max": "tower_40",
                "rest.moved": "tower_40",
            },
        },
    ),
    Cause(
        "bullet",
        ROW,
        {
            "recommended equal-step default accurate maximal": {
                "symmetry.mirror": "dominoes",
            },
        },
    ),
    Cause(
        "bullet",
        TALL,
        {
            "recommended equal-step default maximal": {
                "overlap.max": "tower_20 tower_20_jittered tower_40",
                "rest.moved": "tower_40",
            },
        },
    ),
    Cause(
        "bullet",
        TOGETHER,
        {
            "recommended equal-step default accurate maximal": {
                "momentum.withheld": "cradle",
                "rest.moved": "cradle",
                "truth.velocity": "cradle",
            },
        },
    ),
    Cause(
        "bullet",
        UNANNOUNCED,
        {
            "accurate": {
                "energy.injected": "corner_slide",
            },
        },
    ),
    Cause(
        "bullet",
        UNLOADED,
        {
            "maximal": {
                "friction.cone": "balls_box brick_wall dominoes drag load_1e4 slip_seed0 tip_falls volley",
            },
        },
    ),
    Cause(
        "bullet",
        YAW,
        {
            "recommended equal-step default": {
                "friction.stop": "slide:box_45",
            },
        },
    ),
    Cause(
        "bullet",
        JERKED,
        {
            "recommended+noisy equal-step+noisy": {
                "overlap.max": "ball_snip wall_push",
                "joint.limit": "table_slide",
            },
        },
    ),
)

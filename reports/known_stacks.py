"""Documented failings of DART, Bullet and MuJoCo in stacks, arches, tips, dominoes, coins and breaks.

Figures are those of the scene that a reason names, with what was varied and nothing else.
"""

from __future__ import annotations

from reports.known_record import EVERY, Cause, Known

BULLET_ROUNDS = (
    "50 rounds of sequential impulses a step leave the lowest contacts of a stack unsolved: tower_20 "
    "moves by 78 mm, by 24 and 8 mm with 200 and 1,000 rounds"
)
BULLET_LOAD = (
    "sequential impulses need thousands of rounds for a mass ratio of 1e4: load_1e4 moves by 370 mm "
    "with 50 rounds, by 4 mm with 5,000"
)
BULLET_MARGIN = (
    "hulls carry a margin of 1 mm, by which what touches is pushed apart: arch_stands moves by 14 mm, "
    "by 1.6 mm with a margin of 0.1 mm"
)
BULLET_STONES = (
    "stones fall at 3 m/s, 12 mm a native step, and contact is found only once it overlaps: within "
    "the limit at 1/960 s"
)
BULLET_ROW = (
    "contacts are solved one after the other: dominoes leave their mirror plane, by 0.015 m/s at "
    "1/240 s and by 0.065 m/s at 1/960 s"
)
BULLET_DEPTH = (
    "a contact found d deep bounces with e v + 0.08 d / h (contactERP): up to 0.08 too much, ball after ball"
)
MUJOCO_SINKS = (
    "a contact's spring is scaled by the masses of its two bodies, whatever load they bear: tower_20 "
    "sinks by 6.2 mm, by 1.8 and 0.45 mm with time constants of 10 and 5 ms in place of 20"
)
MUJOCO_LOAD = (
    "a contact's spring is scaled by the masses of its two bodies, whatever load they bear: load_1e4 "
    "moves by 110 mm, by 62 and 15 mm with time constants of 10 and 5 ms in place of 20"
)
MUJOCO_YIELDS = (
    "friction is soft and creeps: tip_holds by 5.5 mm in a second, 2.8 and 1.4 mm with time constants "
    "of 10 and 5 ms in place of 20; arch_stands by 17, 9.0 and 4.1 mm"
)
MUJOCO_LANDS = (
    "contact is a damped spring: v 0.02 s / 2.72 deep, 20 mm at 2.8 m/s; centres of bodies that are "
    "thinner than that sink below a surface"
)
MUJOCO_SOFT = "contact is a damped spring: v 0.02 s / 2.72 = 15 mm deep at 2 m/s"
MUJOCO_SAMPLED = (
    "balls in a row are springs in a row, at e = 1 of 2 pi steps of a first-order integrator each"
)
DART_BOUNDS = (
    "the boxed LCP bounds friction by normal impulses found without it: corners that friction unloads "
    "keep their bound"
)
DART_ARCH = (
    "the boxed LCP bounds friction by normal impulses found without it, and joints slip: arch_stands "
    "moves by 0.19 m at 1/1020 s, 0.46 m at 1/240 s, 45 mm with the NSGS solver (accurate)"
)
DART_LOAD = (
    "no solution beyond some mass ratio: load_1e4 moves by less than 1 mm at 1/1020 s and by 6.7 mm "
    "at 1/240 s, load_1e6 by 0.1 m at either"
)
DART_TOWER = (
    "stacks hold the less the larger the step: tower_20 moves by less than 1 mm at 1/1020 s and by "
    "9.2 mm at 1/240 s, tower_40 by 2.8 and 59 mm"
)
DART_RACK = (
    "which balls of a rack are found touching in one step depends on the step: 6.6 % of the energy "
    "are gained at 1/1020 s, none at 1/240 s"
)
DART_TIP = (
    "the boxed LCP bounds friction by normal impulses found without it: a box that should tip slides, "
    "with a friction of 0.5 = w / h in place of 0.6, at 1/240, 1/1020 and 1/4080 s"
)
DART_BOX = "friction is bounded along two fixed directions, each by mu: up to sqrt 2 mu between them"
DART_SEIDEL = (
    "the NSGS solver (accurate) stops after its rounds: tower_20 moves by 23 mm and load_1e4 by 0.1 m, less "
    "than 1 mm by the pivoting one (recommended)"
)
TIPS = tuple(
    Known(
        "events.meet",
        "dart",
        f"{DART_TIP}: touchstone run tip_falls --engine dart --profile {profile} --metric events.meet",
        "tip_falls",
        profile,
        "box-stop",
        never=True,
    )
    for profile in ("recommended", "equal-step")
)
STACKS: tuple[Cause, ...] = (
    Cause(
        "bullet",
        BULLET_DEPTH,
        {
            "energy.gain": "break_15",
        },
    ),
    Cause(
        "bullet",
        BULLET_LOAD,
        {
            "energy.injected": "load_1e6",
            "friction.creep": "load_1e4 load_1e6",
            "friction.tilt": "load_1e4 load_1e6",
            "overlap.max": "load_1e4 load_1e6",
            "rest.moved": "load_1e4 load_1e6",
        },
        EVERY,
    ),
    Cause(
        "bullet",
        BULLET_MARGIN,
        {
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
    ),
    Cause(
        "bullet",
        BULLET_ROUNDS,
        {
            "contact.gap": "tower_40:floor-box_1",
            "friction.creep": "tower_10",
            "overlap.max": "tower_20 tower_20_jittered",
        },
    ),
    Cause(
        "bullet",
        BULLET_ROUNDS,
        {
            "contact.gap": "tower_20:floor-box_1 tower_20_jittered:floor-box_1",
            "friction.creep": "tower_20 tower_20_jittered tower_40",
            "overlap.max": "tower_40",
            "rest.moved": "tower_10 tower_20 tower_20_jittered tower_40",
        },
        EVERY,
    ),
    Cause(
        "bullet",
        BULLET_ROW,
        {
            "symmetry.mirror": "dominoes",
        },
        EVERY,
    ),
    Cause(
        "bullet",
        BULLET_STONES,
        {
            "overlap.max": "arch_slides arch_thin",
        },
    ),
    Cause(
        "dart",
        DART_ARCH,
        {
            "contact.gap": "arch_stands:floor-stone_10 arch_stands:floor-stone_8",
            "overlap.max": "arch_stands",
        },
        "equal-step",
    ),
    Cause(
        "dart",
        DART_ARCH,
        {
            "friction.creep": "arch_stands",
            "friction.lift": "arch_stands",
            "friction.tilt": "arch_stands",
            "rest.moved": "arch_stands",
            "symmetry.mirror": "arch_stands",
        },
        EVERY,
    ),
    Cause(
        "dart",
        DART_ARCH,
        {
            "energy.injected": "arch_stands",
        },
        "recommended default accurate",
    ),
    Cause(
        "dart",
        DART_BOUNDS,
        {
            "friction.cone": "tower_20_jittered",
        },
        "recommended equal-step",
    ),
    Cause(
        "dart",
        DART_BOUNDS,
        {
            "friction.cone": "tower_10",
        },
    ),
    Cause(
        "dart",
        DART_BOUNDS,
        {
            "friction.cone": "arch_slides arch_stands arch_thin brick_wall coin_falls coin_rolls coin_spins "
            "dominoes pyramid tall_holds tip_falls tip_holds tower_20 tower_40",
        },
    ),
    Cause(
        "dart",
        DART_BOX,
        {
            "friction.cone": "arch_slides arch_stands arch_thin load_1e4 load_1e6 tower_40",
        },
        "accurate",
    ),
    Cause(
        "dart",
        DART_LOAD,
        {
            "contact.gap": "load_1e4:floor-box_1 load_1e6:floor-box_2",
            "friction.creep": "load_1e4",
            "overlap.max": "load_1e4",
            "rest.moved": "load_1e4",
        },
        "equal-step",
    ),
    Cause(
        "dart",
        DART_LOAD,
        {
            "friction.creep": "load_1e6",
        },
        "recommended default",
    ),
    Cause(
        "dart",
        DART_LOAD,
        {
            "overlap.max": "load_1e6",
            "overlap.tunnelled": "load_1e6",
            "rest.moved": "load_1e6",
        },
    ),
    Cause(
        "dart",
        DART_RACK,
        {
            "energy.gain": "break_15",
        },
        "recommended default accurate",
    ),
    Cause(
        "dart",
        DART_SEIDEL,
        {
            "contact.gap": "load_1e6:floor-box_2",
            "friction.creep": "load_1e6 tower_20 tower_20_jittered tower_40",
            "friction.tilt": "load_1e4 load_1e6",
            "overlap.max": "load_1e4 load_1e6",
            "overlap.tunnelled": "load_1e4 load_1e6",
            "rest.moved": "load_1e4 load_1e6 tower_10 tower_20 tower_20_jittered tower_40",
            "symmetry.mirror": "dominoes",
        },
        "accurate",
    ),
    Cause(
        "dart",
        DART_TOWER,
        {
            "friction.creep": "pyramid tower_20 tower_20_jittered tower_40",
            "overlap.max": "tower_20 tower_20_jittered tower_40",
            "rest.moved": "pyramid tower_10 tower_20 tower_20_jittered",
            "symmetry.mirror": "pyramid",
        },
        "equal-step",
    ),
    Cause(
        "dart",
        DART_TOWER,
        {
            "energy.injected": "tower_40",
        },
        "recommended default",
    ),
    Cause(
        "dart",
        DART_TOWER,
        {
            "rest.moved": "tower_40",
        },
    ),
    Cause(
        "mujoco",
        MUJOCO_LANDS,
        {
            "overlap.tunnelled": "coin_falls",
        },
        "recommended default",
    ),
    Cause(
        "mujoco",
        MUJOCO_LANDS,
        {
            "overlap.max": "arch_slides arch_thin dominoes",
            "overlap.tunnelled": "arch_thin dominoes",
        },
    ),
    Cause(
        "mujoco",
        MUJOCO_LOAD,
        {
            "friction.creep": "load_1e4",
        },
        "accurate",
    ),
    Cause(
        "mujoco",
        MUJOCO_LOAD,
        {
            "contact.impulse_balance": "load_1e6:box_1",
        },
        "default",
    ),
    Cause(
        "mujoco",
        MUJOCO_LOAD,
        {
            "overlap.tunnelled": "load_1e4",
        },
    ),
    Cause(
        "mujoco",
        MUJOCO_LOAD,
        {
            "overlap.max": "load_1e4 load_1e6",
            "overlap.tunnelled": "load_1e6",
            "rest.moved": "load_1e4 load_1e6",
        },
        EVERY,
    ),
    Cause(
        "mujoco",
        MUJOCO_SAMPLED,
        {
            "energy.gain": "break_15",
        },
    ),
    Cause(
        "mujoco",
        MUJOCO_SINKS,
        {
            "overlap.max": "tower_20 tower_20_jittered tower_40",
            "rest.moved": "pyramid",
        },
        "equal-step",
    ),
    Cause(
        "mujoco",
        MUJOCO_SINKS,
        {
            "contact.gap": "tower_20:floor-box_1 tower_20_jittered:floor-box_1 tower_40:floor-box_1",
            "rest.moved": "brick_wall tower_10 tower_20 tower_20_jittered",
        },
    ),
    Cause(
        "mujoco",
        MUJOCO_SINKS,
        {
            "rest.moved": "tower_40",
        },
        EVERY,
    ),
    Cause(
        "mujoco",
        MUJOCO_SOFT,
        {
            "overlap.max": "break_15",
        },
        "equal-step",
    ),
    Cause(
        "mujoco",
        MUJOCO_YIELDS,
        {
            "contact.gap": "arch_stands:floor-stone_1 arch_stands:floor-stone_11",
            "friction.creep": "arch_stands tip_holds tower_20_jittered",
            "rest.moved": "arch_stands tip_holds",
        },
    ),
)

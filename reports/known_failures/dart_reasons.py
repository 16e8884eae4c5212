"""Mechanisms behind the documented failings of DART."""

from __future__ import annotations

ARCH = (
    "the boxed LCP bounds friction by normal impulses found without it, and joints slip: "
    "arch_stands moves by 0.46 m at 1/1020 s and at 1/240 s, and by 0.44 m with the NSGS solver "
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
    "contact is found only once it overlaps, and what a hand goes in a step it sinks: slap_6 4.5 mm at "
    "1/1020 s, 9.1 mm at 1/480 s, 42 mm at 1/240 s, beyond the table's 4 cm"
)
JERKED = (
    "a tracker that jumps by 1 mm and 0.5 degrees sixty times a second jerks the links by their servos: "
    "fingertips meet what they touch faster and slip to and fro; with the ideal tracker none of it is "
    "there"
)

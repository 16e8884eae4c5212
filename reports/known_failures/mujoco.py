"""Documented failings of MuJoCo: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause
from touchstone.reports.known_failures.shared import COARSE_SERVO

CREEPS = (
    "friction is soft and creeps: 1.8 mm/s on 20 degrees in closed form, more near the edge of the cone; "
    "tip_holds by 5.5 mm in a second, 2.8 and 1.4 mm with time constants of 10 and 5 ms in place of 20; "
    "arch_stands by 17, 9.0 and 4.1 mm; a cube that is gripped at 2/3 of the cone slides back to the "
    "ground in 2 s, but by 7 mm under the elliptic cone"
)
DAMPED = "friction shares the contact's damping, and a contact of several steps turns with the bodies"
ELLIPTIC = (
    "a contact of the elliptic cone rests four times as deep as one of the pyramid, whose four edges share "
    "its load: stack 0.56 mm, with the pyramid alone 0.13 mm, whatever integrator and impratio"
)
LETS_GO = (
    "a damped spring that may not pull lets go while compressed: e = 0 returns exp(-2) = 0.135 in closed "
    "form (Schwager and Poeschel 2007), bounce_e0 0.126; `default` and `equal-step` do not allow for it, "
    "0.397 for 0.3. A bounce lasts some eight steps: what it returns depends on where within one it begins"
)
LIFT = (
    "an edge of the pyramid brakes the slip through its own normal: with b = 2 / (0.95 0.02 s) it lifts a "
    "sliding cube at b mu v h / (1 + mu^2) - 2 g h, 0.47 m/s at 2 ms; the cube hops and lands on an edge. "
    "What slides hops under the elliptic cone too, the higher the stiffer its contact: slide 37 mm at 20 "
    "ms, 176 mm at 2.6 steps, 299 mm at two, 2.9 and 0.9 mm there with a `solreffriction` of 0.05 and 0.1 "
    "s"
)
PYRAMID = (
    "the pyramid has mu along two fixed directions and 0.707 mu at 45 degrees, where a cube goes 1.4 times "
    "as far; its friction is not along the slip off its axes: 0.040 rad, but 0.002 with the elliptic cone"
)
ROUNDING = (
    "dominoes that lie on each other amplify where the solver stops: 0.18 at the manual's tolerance of "
    "1e-10, 0.074 at 1e-8, 2e-5 at 1e-12, and 0.002 with Euler"
)
ROW = "balls in a row are springs in a row: they part together, at any step"
RUBS = (
    "arms that slide along each other under the pyramid gain 8.0 mJ, but 0.7 mJ with the elliptic cone "
    "alone and 0.8 mJ with servos half as fast, 2.1 and 0.7 mJ at 1/1080 and 1/2160 s; integrator, joint "
    "limits and contact's time constant change less than 0.1 mJ"
)
SAMPLED = (
    "at e = 1 a contact lasts 2 pi steps of a first-order integrator, whatever the step, and balls in a "
    "row are springs in a row"
)
SINKS = (
    "a contact's spring is scaled by the masses of its two bodies, whatever load they bear: load_1e4 moves "
    "by 110 mm with a time constant of 20 ms (`default`), by 62 and 15 mm with 10 and 5, and by 18 mm with "
    "2.6 steps of 1/540 s; tower_20 by 6.2 and 1.2 mm"
)
SOFT = (
    "contact is a damped spring, of 20 ms in `default` and `equal-step`, else 2.6 steps; where it bounces, "
    "its frequency times the step is 0.4 at most: what lands sinks, and it gives way while a glove or "
    "servo presses: wall_push 6.3 mm at 20 ms, 4.7 mm at 2.6 steps of 1/540 s"
)
SOFT_LIMITS = (
    "joint limits are springs of 20 ms, which give way where a hand is bent back: wall_push 0.157 rad, but "
    "0.062 at 10 ms and 0.018 at 5 ms"
)
STARTS_APART = (
    "a contact that touches without load pushes in the first step: drag moves 0.10 mm off its post, 0.046 "
    "and 0.013 mm at 1/540 and 1/1920 s, 0.052 mm with a time constant of 10 ms in place of 20"
)
STIFFEST = "contact is a damped spring as stiff as the step allows (w h = 0.2), into which 3.8 m/s sink"
TIPS = (
    "a tall box that should hold tips on its front edge: it moves by 0.21 m, with the pyramid instead of "
    "the elliptic cone alone by 0.75 mm, whatever integrator and impratio"
)
PASSES = (
    "contact is a damped spring of 20 ms, through which what is fast and thin passes whatever the step: a "
    "ball of 30 m/s a plate of 1 mm, at 1/540 and at 1/4320 s, and fingers at 6 m/s a table of 4 cm; in "
    "`accurate`, where the spring is as stiff as the step allows, no finger does"
)
JERKED = (
    "a tracker that jumps by 1 mm and 0.5 degrees sixty times a second jerks the links by their servos: "
    "they bend hinges farther into their springs, and turn a box as they let it go; with the ideal tracker "
    "none of it is there"
)
STIFF_SLIDE = "a hand that slides over a table under contacts of 2.6 steps gains 0.5 mJ; nothing was varied"

CAUSES: tuple[Cause, ...] = (
    Cause(
        "mujoco",
        COARSE_SERVO,
        {
            "equal-step": {
                "energy.injected": "corner_slide",
            },
        },
        harness=True,
    ),
    Cause(
        "mujoco",
        CREEPS,
        {
            "equal-step default": {
                "contact.gap": "arch_stands:floor-stone_1 arch_stands:floor-stone_11",
                "friction.creep": "arch_stands incline_holds tip_holds tower_20_jittered",
                "rest.moved": "arch_stands incline_holds tip_holds",
            },
        },
        never={
            "default": {
                "events.leave": "grip:cube-ground",
            },
        },
    ),
    Cause(
        "mujoco",
        DAMPED,
        {
            "recommended equal-step default accurate": {
                "truth.velocity": "collide_sticks",
            },
            "recommended equal-step default": {
                "truth.velocity": "collide_oblique collide_slips",
            },
        },
    ),
    Cause(
        "mujoco",
        ELLIPTIC,
        {
            "equal-step": {
                "contact.gap": (
                    "belt belt_across belt_ramp bounce_e0 brick_wall:floor-brick_1_1 "
                    "brick_wall:floor-brick_1_2 brick_wall:floor-brick_1_3 brick_wall:floor-brick_1_4 "
                    "drag:ground-box grip:cube-left grip:cube-right grip:ground-cube lift:ground-cube "
                    "platform_lift platform_slip platform_stick press:ground-box pyramid:floor-box_1_1 "
                    "pyramid:floor-box_1_2 pyramid:floor-box_1_3 pyramid:floor-box_1_4 "
                    "pyramid:floor-box_1_5 pyramid:floor-box_1_6 pyramid:floor-box_1_7 "
                    "pyramid:floor-box_1_8 shaker_along slide_seed0 slide_seed1 slide_seed2 "
                    "stack:floor-box_1 tower_10:floor-box_1"
                ),
                "friction.creep": "brick_wall tower_40",
                "overlap.max": "arch_stands coin_falls tower_10",
                "rest.moved": "stack",
                "symmetry.mirror": "brick_wall",
            },
        },
    ),
    Cause(
        "mujoco",
        JERKED,
        {
            "equal-step+noisy": {
                "friction.coast": "push_box",
                "joint.limit": "arms_cross volley",
            },
        },
    ),
    Cause(
        "mujoco",
        LETS_GO,
        {
            "recommended equal-step default": {
                "force.error": "bounce_e03 bounce_e05",
                "restitution.error": "ball_snip volley",
            },
            "recommended default": {
                "force.error": "bounce_e08",
            },
            "equal-step default": {
                "restitution.error": "bounce_e05 shot_6",
            },
            "recommended": {
                "restitution.error": "bounce_e0",
            },
            "equal-step+noisy": {
                "restitution.error": "table_slide",
            },
            "equal-step": {
                "restitution.error": "collide_central",
            },
            "default": {
                "restitution.error": "bounce_e03 bounce_e08",
            },
            "accurate": {
                "restitution.error": "shot_30",
            },
        },
    ),
    Cause(
        "mujoco",
        LIFT,
        {
            "recommended equal-step default accurate": {
                "friction.lift": "slide",
            },
            "recommended equal-step default": {
                "friction.tilt": "slide",
                "overlap.max": "slide",
            },
            "recommended": {
                "contact.at_distance": "slide",
                "force.error": "belt belt_across",
                "overlap.max": "sliders",
            },
            "equal-step": {
                "force.error": "belt:belt-against",
                "overlap.max": "belt belt_across slide_seed0 slip_seed1",
            },
        },
    ),
    Cause(
        "mujoco",
        PASSES,
        {
            "recommended equal-step default accurate": {
                "overlap.tunnelled": "shot_30 shot_300",
                "restitution.error": "shot_300",
            },
            "recommended equal-step default": {
                "restitution.error": "shot_30",
            },
            "equal-step default": {
                "overlap.tunnelled": "slap_6",
            },
        },
    ),
    Cause(
        "mujoco",
        PYRAMID,
        {
            "default": {
                "friction.direction": "table_slide:table-ball",
                "friction.stop": "slide:box_22.5 slide:box_45",
                "rolling.time": "slip:ball_22.5 slip:ball_45",
            },
        },
    ),
    Cause(
        "mujoco",
        ROUNDING,
        {
            "accurate": {
                "symmetry.mirror": "dominoes",
            },
        },
    ),
    Cause(
        "mujoco",
        ROW,
        {
            "recommended equal-step default accurate": {
                "momentum.withheld": "cradle",
                "rest.moved": "cradle",
                "truth.velocity": "cradle",
            },
            "recommended equal-step default": {
                "energy.gain": "cradle",
            },
        },
    ),
    Cause(
        "mujoco",
        RUBS,
        {
            "default": {
                "energy.injected": "arms_cross",
            },
        },
    ),
    Cause(
        "mujoco",
        SAMPLED,
        {
            "recommended equal-step default accurate": {
                "energy.injected": "rod_e1",
            },
            "recommended equal-step default": {
                "energy.gain": "break_15",
                "energy.injected": "bounce_e1",
            },
            "equal-step default": {
                "energy.gain": "bounce_e1",
            },
        },
    ),
    Cause(
        "mujoco",
        SINKS,
        {
            "recommended equal-step default accurate": {
                "overlap.max": "load_1e4 load_1e6",
                "rest.moved": "load_1e4 load_1e6 tower_40",
            },
            "recommended equal-step default": {
                "rest.moved": "tower_20 tower_20_jittered",
            },
            "equal-step default": {
                "contact.gap": (
                    "shaker_across tower_20:floor-box_1 tower_20_jittered:floor-box_1 tower_40:floor-box_1"
                ),
                "rest.moved": "brick_wall tower_10",
            },
            "recommended": {
                "friction.creep": "load_1e6",
            },
            "equal-step": {
                "overlap.max": "tower_20 tower_20_jittered tower_40",
                "rest.moved": "pyramid",
            },
            "default": {
                "contact.impulse_balance": "load_1e6:box_1",
            },
            "accurate": {
                "friction.creep": "load_1e4",
            },
        },
    ),
    Cause(
        "mujoco",
        SOFT,
        {
            "recommended equal-step default": {
                "contact.gap": (
                    "corner_slide:north_wall-torso push_box:torso-box two_arms:east_wall-torso "
                    "wall_push:east_wall-torso"
                ),
                "overlap.max": (
                    "arms_cross ball_snip corner_slide slap_2.5 slap_3 slap_6 table_slide volley wall_push"
                ),
            },
            "recommended equal-step": {
                "overlap.max": "bounce_e1 shot_6",
            },
            "equal-step default": {
                "contact.gap": (
                    "arms_cross:torso-torso corner_slide:east_wall-torso drag:plate-box lift:cube-left "
                    "lift:cube-right press:plate-box table_slide:table-palm"
                ),
                "force.error": "press:ground-box press:plate-box",
                "overlap.max": "arch_slides arch_thin balls_box bounce_e0 dominoes hold push_box two_arms",
            },
            "equal-step": {
                "contact.gap": "hold:torso-box",
                "overlap.max": (
                    "bounce_e08 break_15 collide_central collide_oblique collide_ratio_1e3 "
                    "collide_ratio_1e6 collide_slips collide_sticks drag lift rod_e1"
                ),
            },
        },
    ),
    Cause(
        "mujoco",
        SOFT_LIMITS,
        {
            "recommended equal-step default accurate": {
                "joint.limit": "corner_slide push_box two_arms wall_push",
            },
        },
    ),
    Cause(
        "mujoco",
        STARTS_APART,
        {
            "equal-step": {
                "contact.gap": "drag:post-box",
            },
        },
    ),
    Cause(
        "mujoco",
        STIFFEST,
        {
            "accurate": {
                "overlap.max": "slap_2.5 slap_3 slap_6 volley wall_push",
            },
        },
    ),
    Cause(
        "mujoco",
        STIFF_SLIDE,
        {
            "recommended": {
                "energy.injected": "table_slide",
            },
        },
    ),
    Cause(
        "mujoco",
        TIPS,
        {
            "equal-step": {
                "friction.creep": "tall_holds",
                "friction.tilt": "tall_holds",
                "rest.moved": "tall_holds",
            },
        },
    ),
)

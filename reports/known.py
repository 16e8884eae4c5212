"""Documented failings as data, each with its reason and a line that shows it. They are strict."""

from __future__ import annotations

from reports.known_record import EVERY, Cause, Known
from reports.known_solver import SOLVER
from reports.known_stacks import STACKS, TIPS

LANDING = "touchstone run ball_snip --engine {} --metric overlap.max"
DISCRETE = (
    "the ball meets the floor at 3.8 m/s, 16 mm a native step, and contact is found only once it overlaps: "
    + LANDING
)
SINKS = (
    "a body at rest sinks by about g h^2 = 0.17 mm before contact is found: "
    "touchstone run ball_snip --engine dart --profile equal-step --metric contact.gap"
)
COMPLIANT = "contact is a damped spring with a time constant of 20 ms, into which 3.8 m/s sink: " + LANDING
BOXED = (
    "the boxed LCP bounds friction by normal impulses found without it, as when the finger lifts the ball "
    "off the table: touchstone run ball_snip --engine dart --metric friction.cone"
)
LETS_GO = (
    "a damped spring that may not pull lets go while compressed: 0.397 for 0.3 in closed form (Schwager and "
    "Poeschel 2007): touchstone run ball_snip --engine mujoco --metric restitution.error"
)
ALWAYS_MU = (
    "Eq. 10 as printed applies mu j to any sliding, however slow: a rolling ball is reversed every frame: "
    "touchstone run ball_snip --engine reference --profile paper --metric events.roll"
)
GALLERY: tuple[Known, ...] = (
    Known("events.roll", "reference", ALWAYS_MU, scenario="ball_snip", profile="paper", never=True),
    Known("energy.injected", "reference", ALWAYS_MU, scenario="ball_snip", profile="paper"),
    Known("energy.injected", "reference", ALWAYS_MU, scenario="table_slide", profile="paper"),
    Known("overlap.max", "dart", DISCRETE.format("dart"), scenario="ball_snip", profile="equal-step"),
    Known("contact.gap", "dart", SINKS, scenario="ball_snip", profile="equal-step"),
    Known("friction.deficit", "dart", BOXED, "ball_snip", "equal-step", "table-ball"),
    *(
        known
        # the accurate profiles mend these
        for profile in ("recommended", "equal-step", "default")
        for known in (
            Known("overlap.max", "mujoco", COMPLIANT.format("mujoco"), "ball_snip", profile),
            Known("friction.cone", "dart", BOXED, "ball_snip", profile),
        )
    ),
    *(
        Known("restitution.error", "mujoco", LETS_GO, "ball_snip", profile)
        for profile in ("recommended", "equal-step", "default")
    ),
)


DART_BOX = (
    "friction is bounded along two fixed directions, each by mu: sqrt 2 mu at 45 degrees, where a cube stops "
    "after 0.707 of the way, and a path that curves between"
)
DART_BOUNDS = (
    "the boxed LCP bounds friction by normal impulses found without it: corners that friction unloads keep "
    "their bound"
)
DART_DETECTOR = (
    "DART's Bullet detector, advised for primitives, lets an edge of a sliding cube sink by 3 mm (20 mm at "
    "1/240 s); under FCL alone, `default`, none of this is there"
)
DART_PUSH = (
    "an inelastic impact is found up to v h deep and undone at 1 mm/s (contact_error_reduction_velocity_max)"
)
DART_FIRST = "restitution reverses a velocity that holds one more step of gravity: a bounce g h too fast"
NEWTON = (
    "Newton's restitution with a friction that sticks at an eccentric contact gains 18 % of the energy in "
    "closed form, 0.46 J, and nothing guards it"
)
TOGETHER = (
    "impacts are solved together: one ball into three leaves -1/2, 1/2, 1/2, 1/2, then these three into the "
    "last 1/4, 1/4, 1/4, 3/4"
)
BULLET_DEPTH = (
    "a contact found d deep bounces with e v + 0.08 d / h (contactERP): up to 0.08 too much, at any step"
)
BULLET_AHEAD = (
    "a contact found d apart, up to 0.02 sqrt 3 r = 1.7 mm, bounces with e v - d / h: ever less with h, "
    "until none is left"
)
BULLET_APART = "friction acts on each ball at its own witness, d = v h apart: a torque d j_t from nowhere"
BULLET_CORNERS = (
    "the rear corners of a sliding cube are missed until they sink: 1.2 mm, 0.3 mm at half the step"
)
BULLET_YAW = "friction at the corners, one after the other, turns a cube that slides along no axis"
MUJOCO_PYRAMID = (
    "the pyramid has mu along two fixed directions and 0.707 mu at 45 degrees, where a cube goes 1.4 times "
    "as far"
)
MUJOCO_LIFT = (
    "an edge of the pyramid brakes the slip through its own normal: with b = 2 / (0.95 0.02 s) it lifts a "
    "sliding cube at b mu v h / (1 + mu^2) - 2 g h, 0.47 m/s at 2 ms; the cube hops and lands on an edge"
)
MUJOCO_ELLIPTIC = (
    "a contact of the elliptic cone rests four times as deep as one of the pyramid, whose four edges share "
    "its load: stack 0.56 mm, with the pyramid alone 0.13 mm, whatever integrator and impratio"
)
MUJOCO_TIPS = (
    "a tall box that should hold tips on its front edge: it moves by 0.21 m, with the pyramid instead of the "
    "elliptic cone alone by 0.75 mm, whatever integrator and impratio"
)
MUJOCO_ROUNDING = (
    "dominoes that lie on each other amplify where the solver stops: 0.18 at the manual's tolerance of "
    "1e-10, 0.074 at 1e-8, 2e-5 at 1e-12, and 0.002 with Euler"
)
MUJOCO_CREEP = "friction is soft and creeps: 1.8 mm/s on 20 degrees in closed form, more near the cone's edge"
MUJOCO_SOFT = (
    "contact is a damped spring: v 0.02 s / 2.72 = 18 mm deep at e = 0, 2 v h = 20 mm at e = 1 and 1/240 s"
)
MUJOCO_LETS_GO = (
    "a damped spring that may not pull lets go while compressed (0.55 for 0.5 in closed form), and it is "
    "sampled some ten times"
)
MUJOCO_DAMPED = "friction shares the contact's damping, and a contact of several steps turns with the bodies"
MUJOCO_SAMPLED = "at e = 1 a contact lasts 2 pi steps of a first-order integrator, whatever the step"
MUJOCO_ROW = "balls in a row are springs in a row: they part together, at any step"
PAPER_EULER = "semi-implicit Euler in steps of 1/60 s meets the floor up to v h deep"
PAPER_TOP = (
    "semi-implicit Euler in steps of 1/60 s keeps a top's momentum, but its energy falls by an error of "
    "first order: it drifts towards the axis of its largest moment"
)
PAPER_MU = "Eq. 10 as printed applies mu j to any sliding, however slow, and reverses it"
PAPER_TURNS = (
    "contacts hold one after the other, each down to an approach of 1e-4 m/s, and takes mu j of its own: "
    "a patch creeps, and its points share their load anew in every frame"
)
PAPER_ASIDE = (
    "corners hold one after the other: they bear the weight, but each impulse turns the body, the next slips "
    "aside, and Eq. 10 follows it: 3.8 % of mu m g are lost, 0.26 % at 1/240 s, none held together"
)
FADES = "restitution fades from 0.65 m/s on and is gone at 0.33 m/s (2 g h of a frame): method, section 5"

LIFTED = (
    "in crowded substeps balls sink by some 1e-5 J a frame, and what overlaps by over 1e-6 m is lifted: 5e-5 "
    "J in one frame, the only one whose energy rises, of the 300 J of the fall (correction in energy.ledger)"
)

CRADLE = ("momentum.withheld", "truth.velocity", "rest.moved")
FACES = "incline_holds incline_slides slide slide_seed0 slide_seed1 slide_seed2"
PROBES: tuple[Cause, ...] = (
    Cause("reference", LIFTED, {"energy.injected": "balls_box"}, "balanced"),
    Cause(
        "reference",
        FADES,
        {"truth.position": "bounce_e03 bounce_e05", "bounce.height": "bounce_e05:#3"},
        "balanced",
    ),
    Cause(
        "dart",
        DART_BOX,
        {"friction.stop": "slide:box_22.5 slide:box_45", "rolling.time": "slip:ball_22.5 slip:ball_45"},
    ),
    Cause("dart", DART_BOX, {"friction.cone": "slip"}),
    Cause("dart", DART_BOUNDS, {"friction.cone": "slide incline_holds incline_slides"}),
    Cause("dart", DART_BOUNDS, {"friction.cone": "stack"}),
    Cause(
        "dart",
        DART_DETECTOR,
        {
            "contact.gap": "slide:plane-box_0 slide:plane-box_22.5",
            "friction.stop": "slide:box_0",
            "friction.tilt": "slide",
            "overlap.max": "slide",
        },
        "recommended",
    ),
    Cause(
        "dart",
        DART_DETECTOR,
        {
            "contact.gap": "slide:plane-box_45",
            "friction.stop": "slide:box_0",
            "friction.tilt": "slide",
            "overlap.max": "slide",
            "rest.moved": "incline_holds",
            "symmetry.mirror": "dominoes",
        },
        "equal-step",
    ),
    Cause(
        "dart",
        DART_BOX,
        {"friction.cone": "slip_seed0 slip_seed1 slip_seed2 slide_seed0 slide_seed1 slide_seed2"},
    ),
    Cause("dart", DART_PUSH, {"contact.gap": "bounce_e0"}, EVERY),
    Cause(
        "dart",
        DART_FIRST,
        {"energy.gain": "bounce_e1", "energy.injected": "bounce_e1", "restitution.error": "bounce_e08"},
        "equal-step",
    ),
    Cause("dart", NEWTON, {"energy.injected": "rod_e1"}, EVERY),
    Cause("dart", TOGETHER, dict.fromkeys(CRADLE, "cradle"), EVERY),
    Cause("bullet", TOGETHER, dict.fromkeys(CRADLE, "cradle"), EVERY),
    Cause("bullet", NEWTON, {"energy.injected": "rod_e1"}, EVERY),
    Cause("bullet", BULLET_APART, {"momentum.angular": "collide_slips collide_sticks"}, EVERY),
    Cause(
        "bullet",
        BULLET_DEPTH,
        {"energy.gain": "bounce_e1", "energy.injected": "bounce_e1", "restitution.error": "bounce_e1"},
    ),
    Cause("bullet", BULLET_DEPTH, {"energy.gain": "bounce_e1", "energy.injected": "bounce_e1"}, "accurate"),
    Cause("bullet", BULLET_AHEAD, {"contact.at_distance": "bounce_e08", "restitution.error": "bounce_e08"}),
    Cause("bullet", BULLET_CORNERS, {"overlap.max": "slide slide_seed1 slide_seed2"}),
    Cause("bullet", BULLET_YAW, {"friction.stop": "slide:box_45"}),
    Cause(
        "mujoco",
        MUJOCO_PYRAMID,
        {
            "friction.stop": "slide:box_22.5 slide:box_45",
            "friction.creep": "slide",
            "rolling.time": "slip:ball_22.5 slip:ball_45",
        },
        "default",
    ),
    Cause(
        "mujoco",
        MUJOCO_ELLIPTIC,
        {
            "contact.gap": "bounce_e0 stack:floor-box_1 tower_10:floor-box_1 "
            + " ".join(f"pyramid:floor-box_1_{k}" for k in range(1, 9))
            + " "
            + " ".join(f"brick_wall:floor-brick_1_{k}" for k in range(1, 5)),
            "rest.moved": "stack",
            "overlap.max": "arch_stands coin_falls tower_10",
            "friction.creep": "tower_40",
        },
        "recommended equal-step",
    ),
    Cause(
        "mujoco",
        MUJOCO_ELLIPTIC,
        {"rest.moved": "pyramid", "overlap.max": "tower_20 tower_20_jittered tower_40"},
        "recommended",
    ),
    Cause(
        "mujoco",
        MUJOCO_ELLIPTIC,
        {
            "symmetry.mirror": "brick_wall",
            "friction.creep": "brick_wall",
            "overlap.tunnelled": "coin_falls",
        },
        "equal-step",
    ),
    Cause(
        "mujoco",
        MUJOCO_TIPS,
        dict.fromkeys(("rest.moved", "friction.tilt", "friction.creep"), "tall_holds"),
        "recommended equal-step",
    ),
    Cause(
        "mujoco",
        MUJOCO_LIFT,
        {"friction.lift": "slide", "friction.tilt": "slide", "overlap.max": "slide"},
    ),
    Cause("mujoco", MUJOCO_LIFT, {"friction.lift": "slide"}, "accurate"),
    Cause("mujoco", MUJOCO_ROUNDING, {"symmetry.mirror": "dominoes"}, "accurate"),
    Cause("mujoco", MUJOCO_CREEP, dict.fromkeys(("friction.creep", "rest.moved"), "incline_holds")),
    Cause("mujoco", MUJOCO_SOFT, {"overlap.max": "bounce_e0 balls_box"}),
    Cause(
        "mujoco",
        MUJOCO_SOFT,
        {
            "overlap.max": "bounce_e08 bounce_e1 collide_central collide_oblique collide_slips "
            "collide_sticks collide_ratio_1e3 collide_ratio_1e6 rod_e1"
        },
        "equal-step",
    ),
    Cause("mujoco", MUJOCO_LETS_GO, {"restitution.error": "bounce_e05"}),
    Cause("mujoco", MUJOCO_LETS_GO, {"restitution.error": "bounce_e08"}, "default"),
    Cause("mujoco", MUJOCO_LETS_GO, {"restitution.error": "bounce_e03"}, "recommended default"),
    Cause("mujoco", MUJOCO_LETS_GO, {"restitution.error": "collide_central"}, "equal-step"),
    Cause("mujoco", MUJOCO_DAMPED, {"truth.velocity": "collide_oblique collide_slips collide_sticks"}),
    Cause("mujoco", MUJOCO_SAMPLED, {"energy.gain": "bounce_e1", "energy.injected": "bounce_e1 rod_e1"}),
    Cause("mujoco", MUJOCO_SAMPLED, {"energy.injected": "rod_e1"}, "accurate"),
    Cause("mujoco", MUJOCO_DAMPED, {"truth.velocity": "collide_sticks"}, "accurate"),
    Cause("mujoco", MUJOCO_ROW, dict.fromkeys(CRADLE, "cradle"), "accurate"),
    Cause(
        "mujoco",
        MUJOCO_ROW,
        {
            **dict.fromkeys(CRADLE, "cradle"),
            "energy.gain": "cradle",
        },
    ),
    Cause(
        "reference",
        PAPER_EULER,
        {"restitution.error": "bounce_e05 bounce_e08 bounce_e1", "energy.loss": "bounce_e1"},
        "paper",
    ),
    Cause(
        "reference",
        PAPER_TOP,
        {"rotation.flip": "tumble_stable tumble_unstable", "energy.loss": "tumble_unstable"},
        "paper",
    ),
    Cause(
        "reference",
        PAPER_MU,
        {
            "truth.velocity": "collide_sticks",
            "energy.injected": "collide_sticks rod_e03 rod_e1 slip slip_seed0 slip_seed1 slip_seed2",
        },
        "paper",
    ),
    Cause(
        "reference",
        PAPER_TURNS,
        {
            "energy.injected": f"{FACES} stack",
            "friction.deficit": f"{FACES} stack:box_1-box_2 stack:box_2-box_3 stack:box_4-box_5 "
            "stack:floor-box_1",
            "friction.creep": "incline_holds slide stack",
            "rest.moved": "incline_holds stack",
        },
        "paper",
    ),
)
PRESSED_BOXED = (
    "the boxed LCP bounds friction by normal impulses found without it: points of a pressed hull that "
    "friction unloads keep their bound; with the NSGS solver (accurate) none leaves the cone"
)
PRESSED_DISCRETE = (
    "contact is found only once it overlaps: hands that meet or reach a wall move 4 to 5 mm in a step, and "
    "the step in which they are found is the deepest"
)
PRESSED_BACK = (
    "a pressed limb that was lifted out is pushed back in by its servo until contact is found again, F h^2 "
    "/ m in a step: {} mm at 1/240, 1/480 and {} s"
)
LANDS = "the ball falls to the floor, and contact is found only once it overlaps: 10 mm deep in one frame"
LATE_MESH = (
    "DART's Bullet detector, which balls on hulls need, finds a fingertip's triangles in a table only from "
    "2 mm on in 20 of 30 orientations (FCL: from 0.1 mm on), and depth is undone by 2 to 4 mm/s"
)
PRESSED_SOFT = (
    "contact is a damped spring of 20 ms, which gives way while a glove or servo presses: wall_push 6.2 mm,"
    " but 1.0 mm at 10 ms and 0.4 mm at 5 ms"
)
SOFT_LIMITS = (
    "joint limits are springs of 20 ms, which give way where a hand is bent back: wall_push 0.145 rad, but "
    "0.036 at 10 ms and 0.009 at 5 ms"
)
LATE_LIMITS = (
    "a joint limit is found only once it is exceeded: by up to {} rad, what the hinge turns in a step, and "
    "{} is undone in the next"
)
COARSE_SERVO = (
    "hinges that follow at 40 rad/s gain energy in pressed limbs at 1/240 s: dart's corner_slide 1.5 J, "
    "mujoco's wall_push 1.5 J and corner_slide 82 mJ; at the engines' own steps 0.5, 14 and 0.9 mJ"
)
PYRAMID = (
    "the pyramid's friction is not along the slip off its axes: 0.040 rad, but 0.002 with the elliptic cone"
)
LETS_GO_SLOWLY = "a damped spring that may not pull lets go while compressed (Schwager and Poeschel 2007)"
BULLET_BOX = (
    "in maximal coordinates Bullet's friction is a box of two directions, each within mu of the normal force"
)
STIFFEST = "contact is a damped spring as stiff as the step allows (w h = 0.2), into which 3.8 m/s sink"
PERSON: tuple[Cause, ...] = (
    # the gallery's scenes beside ball_snip
    Cause("dart", PRESSED_BOXED, {"friction.cone": "table_slide wall_push corner_slide two_arms arms_cross"}),
    Cause("dart", LATE_MESH, {"overlap.max": "table_slide"}, "recommended"),
    Cause("dart", LANDS, {"overlap.max": "table_slide"}, "equal-step"),
    Cause("dart", PRESSED_DISCRETE, {"overlap.max": "two_arms arms_cross"}, "equal-step"),
    Cause(
        "dart", PRESSED_BACK.format("5.6, 1.6 and 0.2", "1/1020"), {"overlap.max": "wall_push"}, "equal-step"
    ),
    Cause(
        "dart",
        COARSE_SERVO,
        {
            "energy.injected": "corner_slide",
            "overlap.max": "corner_slide",
        },
        "equal-step",
    ),
    Cause("dart", LATE_LIMITS.format("0.063", "all of it"), {"joint.limit": "wall_push"}, "equal-step"),
    Cause("bullet", LANDS, {"overlap.max": "table_slide"}),
    Cause("bullet", LANDS, {"overlap.max": "ball_snip table_slide"}, "maximal"),
    Cause("bullet", BULLET_BOX, {"friction.cone": "ball_snip table_slide"}, "maximal"),
    Cause("bullet", LATE_LIMITS.format("0.035", "a fifth"), {"joint.limit": "two_arms wall_push"}),
    Cause("mujoco", PRESSED_SOFT, {"overlap.max": "table_slide wall_push corner_slide two_arms arms_cross"}),
    Cause("mujoco", SOFT_LIMITS, {"joint.limit": "wall_push corner_slide two_arms"}),
    Cause("mujoco", PYRAMID, {"friction.direction": "table_slide:table-ball"}, "default"),
    Cause("mujoco", LETS_GO_SLOWLY, {"restitution.error": "table_slide"}, "recommended equal-step"),
    Cause("mujoco", COARSE_SERVO, {"energy.injected": "wall_push corner_slide"}, "equal-step"),
    Cause("mujoco", STIFFEST, {"overlap.max": "ball_snip"}, "accurate"),
)
CALIBRATION = tuple(
    Known(
        "friction.bias.max",
        "reference",
        f"{PAPER_ASIDE}: touchstone study calibration --engine reference",
        pair,
        "paper",
    )
    for pair in ("all", "box-box", "hull-box")
)
KNOWN = (
    *GALLERY,
    *TIPS,
    *CALIBRATION,
    *(known for cause in (*PERSON, *PROBES, *STACKS, *SOLVER) for known in cause.known()),
)

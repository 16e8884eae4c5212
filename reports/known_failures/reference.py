"""Documented failings of the reference: one entry per cause.

Figures are from the scene that a reason names; only the quantity that it names was varied.
"""

from __future__ import annotations

from touchstone.reports.known_failures.cause import Cause

ALWAYS_MU = (
    'Eq. 10, "the magnitude is set to mu times the magnitude of the normal impulse": any sliding, however '
    "slow, gets mu j and reverses"
)
AMPLIFIES = (
    "the scene multiplies an error of second order in the substep: a tip that turns back, a rattleback that "
    "reverses, a top that turns over; 0.093 of the size of `rattleback` with `contact_turn` 0.03 rad, 0.0099 "
    "with 0.005"
)
ATTRACTED = (
    '"The joints try to move to the desired angles": a chain follows its tracker with a lag of 0.1 s, and '
    "for much of the time in which the tracker is in the wall the hand is not at it yet, or no longer"
)
DISCRETE = (
    '"It cannot be excluded that collisions are missed due to discreet collision testing": what moves '
    "farther in a frame than both objects are thick passes, a ball of 30 m/s through a plate of 1 mm"
)
DRIVEN_FIRST = (
    '"First the driven objects, then the simulated objects" are updated: what a hand pushes moves on by v h '
    "in the same frame, and ends it that far ahead of the hand"
)
EVEN_FORCE = (
    "the force of a driver is even over a substep, and what it carries keeps its place by a law of "
    "positions: work and force err to second order in the step, 6.6e-4 J of `shaker_along` at 1/60 s, 4.2e-5 "
    "J at 1/240 s"
)
HEAP = (
    "islands hold more bodies than Newton's method takes, and 40 sweeps a dense substep leave "
    "wedged balls a residual; they creep on"
)
HOVERS = (
    "while an arm slides along what its tracker presses it into, the least turn is linear in a frame and "
    "leaves the hand up to 0.19 mm off; where the tracker stays it is 5e-7 m"
)
NO_INTEGRATOR = (
    '"Dynamic objects move forward in time" by no integrator that the paper names: semi-implicit Euler in '
    "steps of 1/60 s errs by g h / 2 in a speed, and the midpoint rule in a spin"
)
SEQUENTIAL = (
    '"Collisions are treated by application of impulses sequentially in a priority queue", at one point a '
    "pair of convex pieces: a face rests on one corner after the other, and a pile takes more than the 64 "
    "times at which motion stops in a frame; what overlaps then is translated apart"
)
SLIDING = (
    "several contacts slide at once between bodies that lean on each other: some solves end at 1e-9 "
    "to 1e-8 m/s, over what counts as converged; a row of dominoes multiplies that, or rounding, to its sides"
)
STOPS = (
    "sliding contacts stop one shortly after the other: after ten attempts at a substep it goes on with one "
    "more stop inside"
)

CAUSES: tuple[Cause, ...] = (
    Cause(
        "reference",
        AMPLIFIES,
        {
            "balanced": {
                "truth.position": "ellipsoid_rocks",
            },
            "balanced accurate": {
                "truth.position": "rattleback tippe_top",
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
        EVEN_FORCE,
        {
            "balanced accurate equal-step": {
                "energy.injected": (
                    "carry:driven carry:simulated grip:simulated hold:driven hold:simulated "
                    "platform_lift:driven platform_lift:simulated platform_slip:driven "
                    "platform_slip:simulated platform_stick:driven platform_stick:simulated "
                    "shaker_across:simulated shaker_along:driven shaker_along:simulated turntable:driven"
                ),
            },
            "balanced accurate": {
                "energy.injected": "grip:driven lift:driven lift:simulated shaker_across:driven",
                "force.error": "shaker_along:platform-load",
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
        SLIDING,
        {
            "balanced accurate equal-step": {
                "symmetry.mirror": "dominoes",
            },
            "accurate": {
                "solver.caps": "arch_slides dominoes",
            },
        },
        chaotic="dominoes",
    ),
    Cause(
        "reference",
        STOPS,
        {
            "balanced": {
                "solver.caps": "arch_slides",
            },
            "balanced accurate": {
                "solver.caps": "sliders_seed1",
            },
        },
    ),
    Cause(
        "reference",
        ALWAYS_MU,
        {
            "paper": {
                "contact.at_distance": "rod_e03",
                "energy.injected": (
                    "ball_off_sphere_rough ball_snip bowl bowl_of_balls collide_sticks disc_rolls "
                    "ellipsoid_rocks ellipsoid_rolls prism_rolls rattleback rod_e03 slip slip_seed0 "
                    "slip_seed1 slip_seed2 table_slide volley"
                ),
                "friction.direction": "ball_snip:table-ball",
                "restitution.error": "volley",
                "truth.velocity": "collide_sticks",
                "run": "rod_e1",
            },
        },
        never={
            "paper": {
                "events.roll": "ball_snip",
            },
        },
        chaotic="ball_snip rod_e03 rod_e1 table_slide volley",
    ),
    Cause(
        "reference",
        ATTRACTED,
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
        DISCRETE,
        {
            "paper": {
                "overlap.tunnelled": "dominoes shot_30 shot_300 slap_2.5 slap_3 slap_6",
                "restitution.error": "shot_30 shot_300",
            },
        },
        chaotic="dominoes",
    ),
    Cause(
        "reference",
        DRIVEN_FIRST,
        {
            "paper": {
                "contact.gap": "carry:torso-box hold:torso-box push_box:torso-box",
                "energy.injected": "carry hold",
                "overlap.max": "hold",
            },
        },
        never={
            "paper": {
                "events.part": "push_box:box-left_hand push_box:box-right_hand",
            },
        },
    ),
    Cause(
        "reference",
        NO_INTEGRATOR,
        {
            "paper": {
                "energy.injected": "tumble_stable tumble_unstable",
                "energy.loss": "bounce_e1",
                "restitution.error": "bounce_e05 bounce_e08 bounce_e1",
                "rotation.flip": "tumble_unstable",
            },
            "paper+noisy": {"restitution.error": "volley"},
        },
    ),
    Cause(
        "reference",
        SEQUENTIAL,
        {
            "paper": {
                "contact.gap": "pyramid stack tower_10",
                "contact.impulse_balance": "break_15",
                "energy.injected": (
                    "arch_slides arch_thin coin_falls coin_rolls coin_spins dominoes incline_holds "
                    "load_1e4 push_box pyramid slide slide_seed0 slide_seed1 slide_seed2 sliders "
                    "sliders_seed0 sliders_seed1 sliders_seed2 stack tall_holds tip_falls tip_holds "
                    "top_precesses tower_10"
                ),
                "friction.creep": (
                    "arch_stands brick_wall incline_holds load_1e4 pyramid slide stack tall_holds "
                    "tip_holds tower_10 tower_20 tower_20_jittered tower_40"
                ),
                "friction.lift": (
                    "arch_stands brick_wall load_1e4 pyramid tall_holds tip_holds tower_10 tower_20 "
                    "tower_20_jittered tower_40"
                ),
                "friction.tilt": (
                    "arch_stands brick_wall load_1e4 pyramid tall_holds tip_holds tower_10 tower_20 "
                    "tower_20_jittered tower_40"
                ),
                "overlap.max": (
                    "arch_slides arch_stands arch_thin balls_box brick_wall dominoes pyramid stack "
                    "tower_10 tower_20 tower_20_jittered tower_40"
                ),
                "rest.moved": (
                    "arch_stands brick_wall incline_holds load_1e4 pyramid stack tall_holds tip_holds "
                    "tower_10 tower_20 tower_20_jittered tower_40"
                ),
                "rest.speed": "balls_box",
                "symmetry.mirror": "arch_stands break_15 brick_wall dominoes pyramid",
                "run": "load_1e6",
            },
        },
        chaotic=(
            "arch_slides arch_stands arch_thin balls_box brick_wall coin_falls coin_rolls "
            "coin_spins dominoes break_15 incline_holds load_1e4 load_1e6 push_box pyramid stack "
            "tall_holds tip_falls tip_holds tower_10 tower_20 tower_20_jittered tower_40"
        ),
    ),
)

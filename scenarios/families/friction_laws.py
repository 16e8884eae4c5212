"""Friction beyond mu: balls that roll and spin to rest, balls and blocks that a slope holds or lets go, and a
block that sticks to a belt and slips on it in turn.

A ball of radius r under rolling friction of length c slows down by c g / r / (1 + 2/5), since its moment
c m g has to turn it as well; a slope holds it up to the angle whose tangent is c / r. Torsional friction of
length c takes c m g from its spin. A block on a slope starts at the angle of static friction and then
accelerates by that of sliding.
"""

from math import cos, radians, sin

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.orientations import slope
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    BodyJoint,
    Box,
    PairCoefficients,
    Piece,
    Scenario,
    Truth,
    vector,
)
from touchstone.scenarios.solids import ball, block, slab

TAGS = ("friction_laws",)
RADIUS, HALF, LANE, INERTIA = 0.05, 0.1, 0.5, 2 / 5
"""Radius of a ball, half an edge of a block, distance of neighbours [m]; inertia of a ball over m r^2 [1]."""
MU = 0.5
ROLLING, SPINNING = 2e-3, 1e-3
"""Lengths of rolling and torsional friction [m]."""
SPEED, SPIN = 1.0, 15.0
"""Speed of rolling balls [m/s], and spin of spinning ones about the vertical [rad/s]."""
SLOPE = 10.0
"""Slope under the balls [degrees], of tangent 0.176."""


@scene
def rolls_to_rest() -> Scenario:
    """Balls roll to rest at three headings."""
    pull = ROLLING / RADIUS * GRAVITY / (1 + INERTIA)
    bodies, truths = [], []
    for k, heading in enumerate((0.0, 30.0, 90.0)):
        turn = radians(heading)
        along, axis = np.array((cos(turn), sin(turn), 0.0)), np.array((-sin(turn), cos(turn), 0.0))
        start = np.array((0.0, -LANE * k, RADIUS))
        name, end = f"ball_{heading:g}", SPEED / pull
        arcs = (
            Arc(
                0.0,
                vector(start),
                vector(SPEED * along),
                vector(-pull * along),
                vector(SPEED / RADIUS * axis),
                vector(-pull / RADIUS * axis),
            ),
            Arc(end, vector(start + SPEED * end / 2 * along)),
        )
        first = arcs[0]
        bodies.append(ball(name, "wood", RADIUS, 1.0, first.position, first.velocity, first.angular_velocity))
        truths.append(Truth(name, "arcs", arcs))
    return Scenario(
        name="rolls_to_rest",
        summary=f"balls roll to rest by rolling friction of {1e3 * ROLLING:g} mm",
        tags=TAGS,
        bodies=(slab("table", "wood"), *bodies),
        coefficients=(PairCoefficients("wood", "wood", 0.0, MU, rolling_friction=ROLLING),),
        duration=5.0,
        truths=tuple(truths),
    )


@scene
def spins_to_rest() -> Scenario:
    """Balls of two masses spin to rest about the vertical."""
    bodies, truths = [], []
    for k, (name, mass) in enumerate((("light", 0.1), ("heavy", 10.0))):
        start = (0.0, LANE * k, RADIUS)
        slows = SPINNING * GRAVITY / (INERTIA * RADIUS**2)
        arcs = (
            Arc(0.0, start, angular_velocity=(0.0, 0.0, SPIN), angular_acceleration=(0.0, 0.0, -slows)),
            Arc(SPIN / slows, start),
        )
        bodies.append(ball(name, "wood", RADIUS, mass, start, spin=(0.0, 0.0, SPIN)))
        truths.append(Truth(name, "arcs", arcs))
    return Scenario(
        name="spins_to_rest",
        summary=f"balls spin to rest by torsional friction of {1e3 * SPINNING:g} mm",
        tags=TAGS,
        bodies=(slab("table", "wood"), *bodies),
        coefficients=(PairCoefficients("wood", "wood", 0.0, MU, torsional_friction=SPINNING),),
        duration=2.0,
        truths=tuple(truths),
    )


@scene
def slope_of_balls() -> Scenario:
    """Balls of three materials on a slope: one that rolling friction holds, and two that roll down."""
    lengths = {"held": 0.01, "slow": 0.005, "free": 0.0}
    turn, downhill, up = slope(radians(SLOPE))
    bodies, truths, pairs = [], [], []
    for k, (name, length) in enumerate(lengths.items()):
        start = vector(RADIUS * up + (0.0, LANE * k, 0.0))
        share = max(0.0, sin(radians(SLOPE)) - length / RADIUS * cos(radians(SLOPE)))
        pull = GRAVITY * share / (1 + INERTIA)
        arc = Arc(
            0.0, start, acceleration=vector(pull * downhill), angular_acceleration=(0.0, pull / RADIUS, 0.0)
        )
        bodies.append(ball(name, name, RADIUS, 1.0, start))
        truths.append(Truth(name, "arcs", (arc,)))
        pairs.append(PairCoefficients("slope", name, 0.0, MU, rolling_friction=length))
    pairs += [PairCoefficients(a, b, 0.0, MU) for a in lengths for b in lengths if a < b]
    return Scenario(
        name="slope_of_balls",
        summary=f"rolling friction holds a ball on a slope of {SLOPE:g} degrees, and slows another down",
        tags=TAGS,
        bodies=(slab("slope", "slope", vector(up), turn), *bodies),
        coefficients=tuple(pairs),
        contact_exclusions=(tuple(lengths),),
        duration=1.5,
        truths=tuple(truths),
    )


@scene
def slope_of_blocks() -> Scenario:
    """Blocks on a slope of 24 degrees with mu = 0.3: two with 0.5 of static friction hold, one of them
    where its way up ends; two with 0.4 slide."""
    degrees, mu = 24.0, 0.3
    turn, downhill, up = slope(radians(degrees))
    pull, load = GRAVITY * sin(radians(degrees)), GRAVITY * cos(radians(degrees))
    bodies, truths = [], []
    for k, (name, static, speed) in enumerate(
        (("holds", 0.5, 0.0), ("starts", 0.4, 0.0), ("stops", 0.5, 2.0), ("returns", 0.4, 2.0))
    ):
        start = HALF * up + (0.0, LANE * k, 0.0)
        time = speed / (pull + mu * load)
        top = start - speed * time / 2 * downhill
        slides = max(0.0, pull - mu * load) if pull > static * load else 0.0
        arcs = [Arc(time, vector(top), acceleration=vector(slides * downhill))]
        if speed > 0:
            arcs.insert(
                0,
                Arc(0.0, vector(start), vector(-speed * downhill), vector((pull + mu * load) * downhill)),
            )
        material = f"static_{static:g}"
        edges = (HALF, HALF, HALF)
        bodies.append(block(name, material, edges, 1.0, vector(start), turn, velocity=arcs[0].velocity))
        truths.append(Truth(name, "arcs", tuple(arcs)))
    pairs = [
        PairCoefficients("slope", f"static_{static:g}", 0.0, mu, static_friction=static)
        for static in (0.4, 0.5)
    ]
    kinds = ("static_0.4", "static_0.5")
    pairs += [PairCoefficients(a, b, 0.0, mu) for a in kinds for b in kinds if a <= b]
    return Scenario(
        name="slope_of_blocks",
        summary=f"blocks hold, start, stop and return on a slope of {degrees:g} degrees by static friction",
        tags=TAGS,
        bodies=(slab("slope", "slope", vector(up), turn), *bodies),
        coefficients=tuple(pairs),
        duration=1.5,
        truths=tuple(truths),
    )


@scene
def stick_slip() -> Scenario:
    """A block on a belt: static friction pulls its spring until it slips back, and it sticks again."""
    mass, stiffness, speed = 0.5, 50.0, 0.2
    low, high, velocity = (0.0, 0.0, HALF), (0.0, 0.0, 4 * HALF), (speed, 0.0, 0.0)
    piece = Piece("belt", Box((2.0, 0.5, 0.05)), surface_velocity=velocity)
    slide = block("slide", "wood", (HALF, HALF, HALF), mass, high, velocity=velocity)
    return Scenario(
        name="stick_slip",
        summary=f"a block on a spring sticks to a belt of {speed:g} m/s and slips",
        tags=TAGS,
        bodies=(
            Body("belt", "fixed", "wood", (piece,), position=(0.0, 0.0, -0.05)),
            block("block", "wood", (HALF, HALF, HALF), mass, low, velocity=velocity),
            Body(
                "slide",
                "simulated",
                "wood",
                (),
                mass=slide.mass,
                inertia=slide.inertia,
                position=high,
                linear_velocity=velocity,
            ),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.3, static_friction=0.5),),
        duration=5.0,
        body_joints=(
            BodyJoint("spring", "slider", "", "slide", high, (1.0, 0.0, 0.0), stiffness=stiffness),
            BodyJoint("guide", "slider", "slide", "block", low, (0.0, 0.0, 1.0)),
        ),
        truths=(Truth("block", "stick_slip"),),
    )

"""Hard motion: fast bodies and thin plates, fast spin, slender inertia, and bounces that never end."""

from math import cos, pi, sin, sqrt

from touchstone.scenarios.difficulty.checks import Case, Checks, Wall
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.orientations import about_y
from touchstone.scenarios.scenario import GRAVITY, Arc, Body, Quaternion, Truth, Vector
from touchstone.scenarios.solids import ball, block, hull, slab

RADIUS, THICKNESS = 0.05, 0.02
"""Radius of a shot ball, and thickness of the plate [m]."""
FRAME = 1 / 60
"""Time in which a body moves by its level, times the thickness [s]."""
ARRIVAL = 0.31
"""Time at which a shot arrives [s]: within a step of every engine."""
DROP = 0.1
"""Height of the first fall of a bouncing ball [m]."""
SETTLED = 0.3
"""Time that a ball has to come to rest after its last bounce, and for which it must then rest [s]."""


@family("thicknesses of a plate per 1/60 s", "1", (0.1, 1.0, 10.0, 100.0, 1e3))
def shot_plate(level: float) -> Case:
    """A ball is shot at a thin plate."""
    speed = level * THICKNESS / FRAME
    start = (0.0, 0.0, RADIUS + speed * ARRIVAL)
    return Case(
        f"a ball at {speed:g} m/s on a plate of 2 cm",
        (
            block("plate", "wood", (1.0, 1.0, THICKNESS / 2), 0.0, (0.0, 0.0, -THICKNESS / 2), kind="fixed"),
            ball("ball", "wood", RADIUS, 1.0, start, (0.0, 0.0, -speed)),
        ),
        Checks(overlap=0.02, walls=(Wall((0.0, 0.0, 0.0)),)),
        duration=0.8,
        restitution=0.5,
        fields={"effects": ("restitution", "friction")},
    )


@family("spin", "rad/s", (1.0, 10.0, 50.0, 200.0, 1e3))
def spin_plate(level: float) -> Case:
    """A thin plate spins freely, nearly about its middle axis."""
    spin = (0.05 * level, level, 0.02 * level)
    body = block("plate", "wood", (0.1, 0.05, 0.002), 1.0, spin=spin)
    return Case(
        f"a thin plate spins at {level:g} rad/s",
        (body,),
        Checks(energy_loss=0.05),
        truths=(Truth("plate", "torque_free"),) if level <= 50 else (),
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("length over width", "1", (2.0, 10.0, 100.0, 1e3, 1e4))
def spin_needle(level: float) -> Case:
    """A slender rod spins and tumbles freely: its inertia is nearly singular."""
    half = (0.25, 0.25 / level, 0.25 / level)
    body = block("rod", "wood", half, 1.0, spin=(20.0, 10.0, 0.0))
    return Case(
        f"a rod {level:g} times as long as wide tumbles",
        (body,),
        Checks(energy_loss=0.05),
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("spin", "rad/s", (1.0, 10.0, 100.0, 1e3))
def spin_floor(level: float) -> Case:
    """A box spins on a floor without friction."""
    place, spin = (0.0, 0.0, 0.02), (0.0, 0.0, level)
    return Case(
        f"a flat box spins on a floor at {level:g} rad/s",
        (slab("floor", "wood"), block("box", "wood", (0.1, 0.1, 0.02), 1.0, place, spin=spin)),
        Checks(energy_loss=0.05),
        friction=0.0,
        truths=(Truth("box", "arcs", (Arc(0.0, place, angular_velocity=spin),)),),
    )


@family("restitution", "1", (0.3, 0.5, 0.7, 0.8, 0.9, 0.95))
def zeno(level: float) -> Case:
    """A ball bounces infinitely often in a finite time, and then rests."""
    last = sqrt(2 * DROP / GRAVITY) * (1 + level) / (1 - level)
    duration = round((last + 2 * SETTLED) * 30) / 30
    return Case(
        f"a ball with e = {level:g} bounces until it rests",
        (slab("floor", "wood"), ball("ball", "wood", RADIUS, 1.0, (0.0, 0.0, RADIUS + DROP))),
        Checks(rest_from=duration - SETTLED, jitter=0.02, creep=2e-3),
        duration=duration,
        restitution=level,
    )


@family("tilt of the disc", "rad", (0.5, 0.2, 0.1, 0.05, 0.02))
def euler_disc(level: float) -> Case:
    """A disc rolls on its edge, ever flatter and faster: Euler's disc without dissipation."""
    radius, half = 0.05, 0.002
    rate = sqrt(4 * GRAVITY / (radius * sin(level)))
    # The disc's axis is tilted towards +x, and so its lowest point is at +x.
    turn = about_y(level)
    # Steady rolling with a centre at rest: the angular velocity is along the diameter through the contact.
    spin = (rate * sin(level) * cos(level), 0.0, -rate * sin(level) * sin(level))
    height = radius * sin(level) + half * cos(level)
    return Case(
        f"a disc at {level:g} rad rolls on its edge",
        (slab("floor", "wood"), _disc(radius, half, (0.0, 0.0, height), turn, spin)),
        Checks(overlap=1e-3, energy=0.1, walls=(Wall((0.0, 0.0, 0.0)),)),
    )


def _disc(radius: float, half: float, place: Vector, turn: Quaternion, spin: Vector) -> Body:
    """Disc of 32 corners per face whose axis is the body's z axis."""
    rim = [(radius * cos(2 * pi * k / 32), radius * sin(2 * pi * k / 32)) for k in range(32)]
    corners = [(x, y, z) for z in (-half, half) for x, y in rim]
    return hull("disc", "wood", corners, 0.1, place, turn, spin=spin)

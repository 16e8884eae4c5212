"""Scenes in which an adapter's conventions show: who is A, what is a half extent, where velocities are
taken."""

from dataclasses import replace
from math import cos, sin

from touchstone.scenarios.scenario import (
    Body,
    Joint,
    PairCoefficients,
    Scenario,
    Tracker,
    Vector,
)
from touchstone.scenarios.solids import ball, block, box_inertia

RADIUS, MASS = 0.1, 1.2
"""Of the balls [m, kg]."""
HALF: Vector = (0.3, 0.2, 0.1)
"""Half extents of the boxes [m]."""
DEPTH = 1e-3
"""Overlap at the start [m]: deeper than a margin, less than a step's motion resolves."""
SPEED = 1.0
"""Approach speed [m/s]."""
TURN = 0.6
"""Turn of a body at the start about x [rad]."""
FLOOR_HALF: Vector = (5.0, 5.0, 0.5)
PALM_MASS, LINK_MASS = 0.38, 0.01
"""Of a driven body that is critically damped under the default coupling [kg]."""
WOOD, STEEL = "wood", "steel"
COEFFICIENTS = (
    PairCoefficients(WOOD, WOOD, 0.0, 0.5),
    PairCoefficients(WOOD, STEEL, 0.0, 0.2),
    PairCoefficients(STEEL, STEEL, 0.0, 0.1),
)


def scene(
    name: str, *bodies: Body, gravity: float = 0.0, duration: float = 1.0, **fields: object
) -> Scenario:
    """A scene of wood and steel; gravity is along -z [m/s^2]."""
    fields = {"coefficients": COEFFICIENTS, "effects": ("gravity", "restitution", "friction")} | fields
    return Scenario(
        name=name,
        summary="a convention",
        tags=(),
        bodies=bodies,
        duration=duration,
        gravity=(0.0, 0.0, -gravity),
        **fields,  # type: ignore[arg-type]
    )


def floor(material: str = WOOD) -> Body:
    """A fixed box whose upper face is z = 0."""
    return block("floor", material, FLOOR_HALF, 0.0, (0.0, 0.0, -FLOOR_HALF[2]), kind="fixed")


def spinning_ball() -> Scenario:
    """A turned ball that moves and spins without gravity."""
    body = ball("ball", WOOD, RADIUS, MASS, (0.5, -0.25, 2.0), (0.3, 0.2, -0.1), (1.0, 2.0, 3.0))
    return scene("spinning_ball", replace(body, orientation=(cos(TURN / 2), sin(TURN / 2), 0.0, 0.0)))


def offset_box() -> Scenario:
    """A turned box whose mass centre is off its origin, with three moments of inertia; it moves and spins."""
    turned = (cos(TURN / 2), sin(TURN / 2), 0.0, 0.0)
    body = block("box", WOOD, HALF, 2.5, (0.5, -0.25, 2.0), turned, (0.3, 0.2, -0.1), (0.1, 0.2, 0.3))
    return scene("offset_box", replace(body, center_of_mass=(0.05, 0.02, -0.03)))


def falling_ball() -> Scenario:
    """A ball that falls freely."""
    return scene("falling_ball", ball("ball", WOOD, RADIUS, MASS, (0.0, 0.0, 9.0)), gravity=9.81)


def landing_ball(first: bool = False) -> Scenario:
    """A ball that meets the floor, DEPTH deep; `first`: it comes before the floor in the scene."""
    body = ball("ball", WOOD, RADIUS, MASS, (0.2, 0.1, RADIUS - DEPTH), (0.0, 0.0, -SPEED))
    bodies = (body, floor()) if first else (floor(), body)
    return scene("landing_ball", *bodies)


def landing_box() -> Scenario:
    """A box that meets the floor flatly, DEPTH deep."""
    body = block("box", WOOD, HALF, MASS, (0.0, 0.0, HALF[2] - DEPTH), velocity=(0.0, 0.0, -SPEED))
    return scene("landing_box", floor(), body)


def meeting_balls() -> Scenario:
    """Two balls that meet along x, DEPTH deep; the second is the lighter."""
    gap = RADIUS - DEPTH / 2
    one = ball("one", WOOD, RADIUS, MASS, (-gap, 0.0, 3.0), (SPEED, 0.0, 0.0))
    two = ball("two", WOOD, RADIUS, MASS / 2, (gap, 0.0, 3.0), (-SPEED, 0.0, 0.0))
    return scene("meeting_balls", one, two)


def sliding_balls() -> Scenario:
    """A ball of wood and a ball of steel that start to slide over a wooden floor."""
    wood = ball("wooden", WOOD, RADIUS, MASS, (0.0, 1.0, RADIUS), (2.0, 0.0, 0.0))
    steel = ball("steel", STEEL, RADIUS, MASS, (0.0, -1.0, RADIUS), (2.0, 0.0, 0.0))
    return scene("sliding_balls", floor(), wood, steel, gravity=9.81)


def bouncing_ball(restitution: float = 0.8) -> Scenario:
    """A ball that falls on a floor that returns this share of its speed."""
    body = ball("ball", WOOD, RADIUS, MASS, (0.0, 0.0, RADIUS + 0.3))
    return scene(
        "bouncing_ball",
        floor(),
        body,
        gravity=9.81,
        coefficients=(PairCoefficients(WOOD, WOOD, restitution, 0.5),),
    )


def finger(moving: bool = True) -> Scenario:
    """A driven palm with two hinges; the palm moves along x, the hinges turn to 0.4 and -0.2 rad."""
    reach = 0.5 if moving else 0.0
    inertia = box_inertia(LINK_MASS, (0.05, 0.01, 0.01))

    def link(name: str) -> Body:
        return Body(
            name, "driven", WOOD, (), mass=LINK_MASS, center_of_mass=(0.05, 0.0, 0.0), inertia=inertia
        )

    inertia_of_palm = box_inertia(PALM_MASS, (0.05, 0.05, 0.02))
    palm = Body("palm", "driven", WOOD, (), mass=PALM_MASS, inertia=inertia_of_palm)
    hinges = (
        Joint("near", "palm", "proximal", (0.05, 0.0, 0.0), (0.0, 1.0, 0.0), lower=-1.0, upper=1.0),
        Joint("far", "proximal", "distal", (0.1, 0.0, 0.0), (0.0, 1.0, 0.0), lower=-1.0, upper=1.0),
    )
    tracker = Tracker(
        "palm",
        ("near", "far"),
        (0.0, 0.5, 1.0),
        ((0.0, 0.0, 1.0), (reach, 0.0, 1.0), (reach, 0.0, 1.0)),
        ((1.0, 0.0, 0.0, 0.0),) * 3,
        ((0.0, 0.0), (0.4, -0.2), (0.4, -0.2)),
        interpolation="cubic",
    )
    return scene(
        "finger", palm, link("proximal"), link("distal"), joints=hinges, trackers=(tracker,), gravity=9.81
    )

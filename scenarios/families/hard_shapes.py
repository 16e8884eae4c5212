"""Hard shapes: wedges, needles, plates, tiles, edges and corners, sizes and places of any magnitude."""

from math import acos, cos, pi, radians, sin, sqrt

from touchstone.scenarios.difficulty.checks import Case, Checks, Wall
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.families.hard_mass import resting
from touchstone.scenarios.orientations import about_y
from touchstone.scenarios.scenario import Arc, Body, Quaternion, Truth, Vector, vector
from touchstone.scenarios.solids import ball, block, slab
from touchstone.scenarios.transforms import mapped

RADIUS = 0.05


@family("angle of the groove", "degrees", (170.0, 90.0, 45.0, 20.0, 5.0, 1.0))
def wedge(level: float) -> Case:
    """A ball rests between two planes without friction."""
    half = radians(level) / 2
    walls: list[Body] = []
    for name, sign in (("left", 1.0), ("right", -1.0)):
        tilt = sign * (pi / 2 - half)
        normal = (sign * cos(half), 0.0, sin(half))
        place = vector(-(RADIUS + 0.5) * value for value in normal)
        walls.append(block(name, "wood", (10.0, 10.0, 0.5), 0.0, place, about_y(tilt), kind="fixed"))
    return Case(
        f"a ball rests in a groove of {level:g} degrees",
        (*walls, ball("ball", "wood", RADIUS, 1.0)),
        Checks(rest_from=0.5),
        friction=0.0,
        truths=(Truth("ball", "arcs", (Arc(0.0, (0.0, 0.0, 0.0)),)),),
    )


@family("length over width", "1", (5.0, 20.0, 100.0, 500.0, 2e3))
def needle(level: float) -> Case:
    """A thin rod falls on one end and comes to lie."""
    half = (0.25, 0.25 / level, 0.25 / level)
    slope = 0.5
    height = half[0] * sin(slope) + half[2] * cos(slope) + 0.05
    return Case(
        f"a rod {level:g} times as long as wide falls on its end",
        (slab("floor", "wood"), block("rod", "wood", half, 0.2, (0.0, 0.0, height), about_y(slope))),
        Checks(walls=(Wall((0.0, 0.0, 0.0)),), overlap=2e-3),
        duration=1.5,
    )


@family("width over thickness", "1", (5.0, 50.0, 500.0, 5e3, 5e4))
def plate(level: float) -> Case:
    """A thin plate rests on the floor."""
    half = (0.1, 0.1, 0.1 / level)
    place = (0.0, 0.0, half[2])
    return Case(
        f"a plate {level:g} times as wide as thick rests",
        (slab("floor", "wood"), block("plate", "wood", half, 0.2, place)),
        Checks(rest_from=0.5, overlap=1e-3, walls=(Wall((0.0, 0.0, -half[2])),)),
        truths=(Truth("plate", "arcs", (Arc(0.0, place),)),),
    )


@family("number of tiles", "1", (1.0, 4.0, 16.0, 64.0))
def tiles(level: float) -> Case:
    """A box slides over coplanar tiles without friction: inner edges do not stop it."""
    count, length, speed = int(level), 4.0, 2.0
    size = length / count
    floor = tuple(
        block(
            f"tile_{k + 1}",
            "wood",
            (size / 2, 0.5, 0.1),
            0.0,
            (-0.5 + size * (k + 0.5), 0.0, -0.1),
            kind="fixed",
        )
        for k in range(count)
    )
    start, velocity = (0.0, 0.0, RADIUS), (speed, 0.0, 0.0)
    return Case(
        f"a box slides over {count} tiles",
        (*floor, block("box", "wood", (RADIUS,) * 3, 1.0, start, velocity=velocity)),
        Checks(position=0.02, energy_loss=0.05),
        friction=0.0,
        truths=(Truth("box", "arcs", (Arc(0.0, start, velocity),)),),
    )


@family("angle of the edges", "degrees", (90.0, 45.0, 10.0, 1.0, 0.1))
def edge_edge(level: float) -> Case:
    """A bar falls on another, edge on edge, at an angle between both."""
    half, yaw = (0.2, 0.02, 0.02), radians(level)
    roll: Quaternion = (cos(pi / 8), sin(pi / 8), 0.0, 0.0)
    w, x = roll[:2]
    turned: Quaternion = (w * cos(yaw / 2), x * cos(yaw / 2), x * sin(yaw / 2), w * sin(yaw / 2))
    height = 2 * sqrt(2) * half[1] + 0.1
    return Case(
        f"a bar falls on the edge of another at {level:g} degrees",
        (
            block("fixed", "wood", half, 0.0, orientation=roll, kind="fixed"),
            block("bar", "wood", half, 0.5, (0.0, 0.0, height), turned),
        ),
        Checks(overlap=2e-3),
        duration=0.6,
    )


@family("offset of the corners", "m", (1e-2, 1e-4, 1e-8, 1e-15, 0.0))
def corner_corner(level: float) -> Case:
    """A cube on its corner falls on the corner of another."""
    tilt = acos(1 / sqrt(3))
    turn = _unit((cos(tilt / 2), sin(tilt / 2) / sqrt(2), -sin(tilt / 2) / sqrt(2), 0.0))
    height = 2 * sqrt(3) * RADIUS + 0.1
    return Case(
        f"a cube falls corner on corner, {level:g} m off",
        (
            block("fixed", "wood", (RADIUS,) * 3, 0.0, orientation=turn, kind="fixed"),
            block("box", "wood", (RADIUS,) * 3, 1.0, (level, 0.0, height), turn),
        ),
        Checks(overlap=2e-3),
        duration=0.6,
    )


def _unit(turn: Quaternion) -> Quaternion:
    """Quaternion of length 1 to rounding."""
    size = sqrt(sum(value * value for value in turn))
    w, x, y, z = (value / size for value in turn)
    return (w, x, y, z)


@family("size of the floor over the ball's", "1", (1e2, 1e3, 1e4, 1e5, 1e6))
def size_ratio(level: float) -> Case:
    """A small ball rests on a floor of 20 m."""
    radius = 10.0 / level
    place = (0.0, 0.0, radius)
    return Case(
        f"a ball of {radius:g} m rests on a floor of 20 m",
        (slab("floor", "wood"), ball("ball", "wood", radius, 1e3 * radius**3, place)),
        Checks(position=radius / 2, overlap=radius / 4, rest_from=0.5, creep=radius / 2, jitter=0.01),
        truths=(Truth("ball", "arcs", (Arc(0.0, place),)),),
    )


@family("distance from the origin", "m", (1.0, 1e2, 1e3, 1e4, 1e5, 1e6))
def far_away(level: float) -> Case:
    """Three cubes rest on each other, far from the origin."""
    case = resting([1.0] * 3, f"three cubes rest {level:g} m from the origin")

    def there(place: Vector) -> Vector:
        return (place[0] + level, place[1], place[2])

    found: Case = mapped(case, {"position": there, "pieces": tuple, "checks": lambda checks: checks})
    return found

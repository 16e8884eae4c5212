"""Mechanisms without contact: pendulums, chains, linkages, gyroscopes, springs and motors.

Axes of plane mechanisms are along y; links lie in planes of their own so that they never meet.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import atan, cos, hypot, pi, radians, sin, sqrt
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import ellipk

from touchstone.scenarios.body_joints import mass_center
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.families.tower import at_rest
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.scenario import (
    GRAVITY,
    Arc,
    Body,
    BodyJoint,
    PairCoefficients,
    Quaternion,
    Scenario,
    Truth,
    Vector,
    vector,
)
from touchstone.scenarios.solids import ball, block, capsule, cylinder
from touchstone.scenarios.truths.published import Published

TAG = "joints"
ACROSS: Vector = (0.0, 1.0, 0.0)
"""Axis of the hinges of plane mechanisms."""
SMOOTH = (PairCoefficients("steel", "steel", 0.0, 0.0),)
THICK = 0.02
"""Radius of a link [m]."""


def direction(start: Vector, end: Vector) -> Quaternion:
    """Orientation whose z axis points from one place to another."""
    along = np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
    across = np.cross((0.0, 0.0, 1.0), along)
    turn = np.arctan2(np.linalg.norm(across), along[2])
    size = np.linalg.norm(across)
    return quaternion(Rotation.from_rotvec(turn * across / size if size else (turn, 0.0, 0.0)))


def rod(name: str, start: Vector, end: Vector, mass: float = 1.0, radius: float = THICK) -> Body:
    """A uniform thin rod between two places, at rest; its capsule ends a radius before them."""
    length = float(np.linalg.norm(np.subtract(end, start)))
    place = vector(np.add(start, end) / 2)
    body = capsule(name, "steel", radius, length / 2 - radius, mass, place, direction(start, end))
    moment = mass * length**2 / 12
    return replace(body, inertia=((moment, 0.0, 0.0), (0.0, moment, 0.0), (0.0, 0.0, mass * radius**2 / 2)))


def turning(body: Body, anchor: Vector, spin: Vector) -> Body:
    """The body turning about an anchor."""
    pace = np.cross(spin, mass_center(body) - np.array(anchor))
    return replace(body, linear_velocity=vector(pace), angular_velocity=spin)


def mechanism(
    name: str,
    summary: str,
    bodies: Sequence[Body],
    joints: Sequence[BodyJoint],
    duration: float,
    tags: tuple[str, ...] = (),
    **fields: Any,
) -> Scenario:
    """A scene of joined bodies, whose truth is the law of mechanisms unless another is given."""
    truths = tuple(Truth(body.name, "mechanism") for body in bodies if body.kind == "simulated")
    return Scenario(
        name=name,
        summary=summary,
        tags=(TAG, *tags),
        bodies=tuple(bodies),
        body_joints=tuple(joints),
        duration=duration,
        **({"coefficients": SMOOTH, "truths": truths} | fields),
    )


PERIOD = 2.0
"""Period of each pendulum [s]."""
BOB = 0.05
"""Radius of a pendulum's bob [m]."""
LIMA = "Lima & Arun (2006), Am. J. Phys. 74, 892: T = 4 sqrt(l / g) K(sin(A / 2)); its tolerance is ours"


def pendulum_length(amplitude: float, period: float = PERIOD) -> float:
    """Length of a simple pendulum of an amplitude [rad] with a period [s], by the elliptic integral [m]."""
    return GRAVITY * (period / (4 * float(ellipk(sin(amplitude / 2) ** 2)))) ** 2


@scene
def pendulums() -> Scenario:
    """Three pendulums of one period: of 30, 90 and 150 degrees, at rest at the start."""
    bodies, joints, published = [], [], []
    for k, degrees in enumerate((30, 90, 150)):
        angle = radians(degrees)
        length = pendulum_length(angle)
        # distance of a ball's centre whose length of oscillation is that of a simple pendulum
        arm = (length + sqrt(length**2 - 8 / 5 * BOB**2)) / 2
        name, anchor = f"bob_{degrees}", (0.0, 0.5 * k, 0.0)
        bodies.append(ball(name, "steel", BOB, 1.0, (arm * sin(angle), anchor[1], -arm * cos(angle))))
        joints.append(BodyJoint(f"hinge_{degrees}", "hinge", "", name, anchor, ACROSS))
        chord = 2 * arm * sin(angle / 2)
        published.append(
            Published(f"{degrees}° period", name, "distance", chord, 0.01 * chord, LIMA, 0.0, 1.25 * PERIOD)
        )
    return mechanism(
        "pendulums",
        "pendulums of 30, 90 and 150 degrees with one period",
        bodies,
        joints,
        1.5 * PERIOD,
        ("conservative", "literature"),
        published=tuple(published),
    )


@scene
def double_pendulum() -> Scenario:
    """Two rods released from the horizontal and 60 degrees above; errors grow about tenfold in 0.5 s."""
    places = ((0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (0.5 + 0.5 * cos(pi / 3), 0.0, 0.5 * sin(pi / 3)))
    summary = "a double pendulum of two rods"
    return mechanism("double_pendulum", summary, *chain(places, "hinge"), 2.0, ("conservative",))


GEAR = -2.0
"""Ratio of the gears of two pendulums [1]."""


@scene
def geared_pendulums() -> Scenario:
    """A rod swings down from the horizontal, and gears turn a shorter one backwards by twice its angle."""
    aside = (0.0, 6 * THICK, 0.0)
    long = rod("long", (0.0, 0.0, 0.0), (0.8, 0.0, 0.0))
    short = rod("short", aside, vector(np.add(aside, (0.3, 0.0, 0.3))), 2.0)
    joints = [
        BodyJoint("shaft_long", "hinge", "", "long", (0.0, 0.0, 0.0), ACROSS),
        BodyJoint("shaft_short", "hinge", "", "short", aside, ACROSS, mimics="shaft_long", ratio=GEAR),
    ]
    summary = "gears couple two pendulums: one turns back by twice the angle of the other"
    return mechanism("geared_pendulums", summary, [long, short], joints, 2.0, ("conservative",))


@scene
def chain_swings() -> Scenario:
    """Four rods on ball joints swing from one end, each released 30 degrees off to another side."""
    places = [np.zeros(3)]
    for k in range(4):
        tilt = Rotation.from_rotvec((0.0, 0.0, k * pi / 2)) * Rotation.from_rotvec((0.0, radians(30.0), 0.0))
        places.append(places[-1] - 0.3 * tilt.apply((0.0, 0.0, 1.0)))
    links, joints = chain(tuple(map(vector, places)), "ball")
    summary = "a chain of four rods swings from one end"
    return mechanism("chain_swings", summary, links, joints, 2.0, ("conservative",))


def chain(
    places: Sequence[Vector], kind: Literal["hinge", "ball"], radius: float = THICK
) -> tuple[list[Body], list[BodyJoint]]:
    """Rods of 1 kg between places, and their joints; the first is held by the world."""
    links = [rod(f"link_{k + 1}", *ends, radius=radius) for k, ends in enumerate(pairwise(places))]
    names = ["", *(link.name for link in links)]
    joints = [
        BodyJoint(f"joint_{k + 1}", kind, names[k], link.name, places[k], ACROSS)
        for k, link in enumerate(links)
    ]
    return links, joints


LINKS, LINK = 10, 0.2
"""Number of links of the hanging chains, and length of one [m]."""
TAUT = 3.0
"""Horizontal pull on the ends of the catenary over the weight of a link [1]."""


def catenary() -> list[Vector]:
    """Ends of the links of a chain that hangs between two anchors of one height, from its own equilibrium.

    At link k the vertical pull changes by its weight, from V to V + w, and the moments about its middle
    balance where its slope is (2 V + w) / (2 H): (k - (n - 1) / 2) w / H.
    """
    slopes = [atan((k - (LINKS - 1) / 2) / TAUT) for k in range(LINKS)]
    x, z = np.cumsum([(0.0, 0.0), *((LINK * cos(a), LINK * sin(a)) for a in slopes)], axis=0).T
    return [(a, 0.0, b) for a, b in zip(x.tolist(), z.tolist())]


@scene
def chain_10() -> Scenario:
    """Ten rods on ball joints hang as a catenary between two anchors: nothing moves."""
    return _at_rest("chain_10", "ten rods hang between two anchors as a catenary", catenary(), 2, 1.0)


@scene
def chain_heavy() -> Scenario:
    """Ten rods hang from one anchor and hold ten thousand times the mass of one: nothing moves."""
    places = [(0.0, 0.0, -LINK * k) for k in range(LINKS + 1)]
    return _at_rest("chain_heavy", "ten rods hold a ball 10,000 times as heavy as one", places, 1, 1e4)


def _at_rest(name: str, summary: str, places: list[Vector], anchors: int, last: float) -> Scenario:
    links = [rod(f"link_{k + 1}", *ends) for k, ends in enumerate(pairwise(places))]
    if anchors == 1:
        x, y, z = places[-1]
        links.append(ball("load", "steel", 0.2, last, (x, y, z - 0.2)))
    names = ["", *(link.name for link in links), ""]
    joints = [
        BodyJoint(f"joint_{k + 1}", "ball", *(pair if pair[1] else pair[::-1]), place)
        for k, (pair, place) in enumerate(zip(pairwise(names), places))
    ]
    return mechanism(name, summary, links, joints, 4.0, truths=at_rest(links))


@scene
def spherical_pendulum() -> Scenario:
    """A ball on a ball joint swings on a cone that opens and closes; it turns as its arm does."""
    angle, arm = radians(60.0), 1.0
    place = (arm * sin(angle), 0.0, -arm * cos(angle))
    body = turning(ball("bob", "steel", BOB, 1.0, place), (0.0, 0.0, 0.0), (0.0, 0.0, 2.0))
    joint = BodyJoint("joint", "ball", "", "bob", (0.0, 0.0, 0.0))
    summary = "a spherical pendulum of 1 m started 60 degrees from the vertical"
    return mechanism("spherical_pendulum", summary, [body], [joint], 4.0, ("conservative",))


SLOPE = radians(30.0)
"""Inclination of wires [rad]."""
DOWN: Vector = (cos(SLOPE), 0.0, -sin(SLOPE))


@scene
def slider_spring() -> Scenario:
    """A block on an inclined slider with a spring and a damper: m q'' = m g sin - k q - c q'."""
    body = block("block", "steel", (0.1, 0.1, 0.1), 2.0, orientation=direction((0.0, 0.0, 0.0), DOWN))
    joint = BodyJoint("slider", "slider", "", "block", (0.0, 0.0, 0.0), DOWN, stiffness=200.0, damping=4.0)
    summary = "a block on an inclined slider swings on a spring with a damper"
    return mechanism("slider_spring", summary, [body], [joint], 3.0)


@scene
def bead_on_wire() -> Scenario:
    """A bead slides down an inclined wire at g sin, first up and then down."""
    speed = -1.0
    bead = replace(ball("bead", "steel", BOB, 0.5), linear_velocity=vector(speed * np.array(DOWN)))
    joint = BodyJoint("wire", "slider", "", "bead", (0.0, 0.0, 0.0), DOWN)
    pull = vector(GRAVITY * sin(SLOPE) * np.array(DOWN))
    truth = Truth("bead", "arcs", (Arc(0.0, (0.0, 0.0, 0.0), bead.linear_velocity, pull),))
    return mechanism(
        "bead_on_wire", "a bead on an inclined wire", [bead], [joint], 2.0, ("conservative",), truths=(truth,)
    )


FLYWHEEL = (0.2, 0.02)
"""Radius and half length of a flywheel [m]."""


@scene
def motor_hinge() -> Scenario:
    """A motor of 1 N m at most brings a flywheel to 10 rad/s: its rate grows evenly, then approaches."""
    wheel = cylinder("wheel", "steel", *FLYWHEEL, 5.0, orientation=direction((0.0, 0.0, 0.0), ACROSS))
    joint = BodyJoint(
        "motor",
        "hinge",
        "",
        "wheel",
        (0.0, 0.0, 0.0),
        ACROSS,
        damping=1.0,
        target_rate=10.0,
        largest_force=1.0,
    )
    summary = "a motor with a largest torque brings a flywheel to 10 rad/s"
    return mechanism("motor_hinge", summary, [wheel], [joint], 3.0)


def linkage(
    places: dict[str, Vector], bars: dict[str, str], spins: dict[str, float]
) -> tuple[list[Body], list[BodyJoint]]:
    """Rods and hinges of a plane mechanism that turns at the start.

    Args:
        places: of the hinges, by letters.
        bars: letters of the two ends of each rod by its name, each in a plane of its own; a letter in upper
            case is an anchor.
        spins: angular velocity of each rod about y [rad/s].
    Returns:
        Rods whose ends are hinged to what shares their letters.
    """
    bodies, joints = [], []
    ends: dict[str, str] = {}
    speeds = {letter: np.zeros(3) for letter in places if letter.isupper()}
    for k, (name, letters) in enumerate(bars.items()):
        first, last = letters[0], letters[1]
        plane = np.array((0.0, 3 * THICK * k, 0.0))
        spin = (0.0, spins[name], 0.0)
        body = rod(name, vector(places[first] + plane), vector(places[last] + plane))
        arm = np.subtract(places[last], places[first])
        speeds.setdefault(last, speeds[first] + np.cross(spin, arm))
        pace = vector(speeds[first] + np.cross(spin, arm / 2))
        bodies.append(replace(body, linear_velocity=pace, angular_velocity=spin))
        for letter in (first, last):
            if letter.isupper() or letter in ends:
                pair = ends.get(letter, ""), name
                joints.append(BodyJoint(f"{letter}_{name}", "hinge", *pair, places[letter], ACROSS))
            else:
                ends[letter] = name
    return bodies, joints


def rates(places: dict[str, Vector], loop: Sequence[str], driven: float) -> list[float]:
    """Angular velocities about y of the bars of a loop of four hinges, of which the first is given."""
    arms = [np.subtract(places[b], places[a]) for a, b in pairwise(loop)]
    turned = np.array([np.cross(ACROSS, arm)[[0, 2]] for arm in arms])
    others = np.linalg.solve(turned[1:].T, -driven * turned[0])
    return [driven, *others.tolist()]


@scene
def four_bar() -> Scenario:
    """A crank turns a rocker by a coupler; three hinge rows of the plane loop follow from the others."""
    ground, crank, coupler, rocker, angle = 0.8, 0.3, 0.9, 0.7, radians(60.0)
    b = np.array((crank * cos(angle), crank * sin(angle)))
    way = np.array((ground, 0.0)) - b
    apart = hypot(*way)
    side = (coupler**2 - rocker**2 + apart**2) / (2 * apart)
    c = b + side * way / apart + sqrt(coupler**2 - side**2) * np.array((-way[1], way[0])) / apart
    places = {
        "A": (0.0, 0.0, 0.0),
        "b": (b[0], 0.0, b[1]),
        "c": (c[0], 0.0, c[1]),
        "D": (ground, 0.0, 0.0),
    }
    spins = rates(places, "AbcD", 10.0)
    bars = {"crank": "Ab", "coupler": "bc", "rocker": "cD"}
    bodies, joints = linkage(places, bars, dict(zip(bars, spins)))
    return mechanism("four_bar", "a crank and a rocker", bodies, joints, 2.0, ("conservative",))


@scene
def slider_crank() -> Scenario:
    """A crank drives a piston on a slider."""
    crank, rod_length, angle = 0.2, 0.6, radians(30.0)
    pin = (crank * cos(angle), 0.0, crank * sin(angle))
    end = (pin[0] + sqrt(rod_length**2 - pin[2] ** 2), 0.0, 0.0)
    spin = 8.0
    pace = np.cross((0.0, spin, 0.0), pin)
    swing = float(pace[2] / (end[0] - pin[0]))
    places = {"A": (0.0, 0.0, 0.0), "b": pin, "c": end}
    bodies, joints = linkage(places, {"crank": "Ab", "coupler": "bc"}, {"crank": spin, "coupler": swing})
    far = vector(np.add(end, (0.0, 6 * THICK, 0.0)))
    slides = (float(pace[0] + swing * (end[2] - pin[2])), 0.0, 0.0)
    piston = block("piston", "steel", (0.05, 0.02, 0.05), 1.0, far, velocity=slides)
    joints += [
        BodyJoint("pin", "hinge", "coupler", "piston", end, ACROSS),
        BodyJoint("bore", "slider", "", "piston", end, (1.0, 0.0, 0.0)),
    ]
    summary = "a crank drives a piston"
    return mechanism("slider_crank", summary, [*bodies, piston], joints, 2.0, ("conservative",))


WINDOWS, SIDE = 3, 0.5
"""Number of loops of the chain of parallelograms, and length of their rods [m]."""


@scene
def n_bar() -> Scenario:
    """Four rods that hang side by side, joined at their ends by three more, swing as a simple pendulum of
    length L (4 / 3 + 3) / (4 / 2 + 3)."""
    places: dict[str, Vector] = {}
    bars, spins = {}, {}
    for k in range(WINDOWS + 1):
        upper, lower = "ABCD"[k], "abcd"[k]
        places |= {upper: (SIDE * k, 0.0, 0.0), lower: (SIDE * k, 0.0, -SIDE)}
        bars[f"arm_{k + 1}"], spins[f"arm_{k + 1}"] = upper + lower, 6.0
    for k in range(WINDOWS):
        bars[f"bar_{k + 1}"], spins[f"bar_{k + 1}"] = "abcd"[k : k + 2], 0.0
    bodies, joints = linkage(places, bars, spins)
    return mechanism("n_bar", "seven rods in three loops swing", bodies, joints, 2.0, ("conservative",))


@scene
def bricard() -> Scenario:
    """Five rods along the edges of a cube, each hinge across both of its rods: six hinges in a closed loop
    that moves although 30 equations bind its 30 coordinates."""
    corners = [(0, 0, 0), (1, 0, 0), (1, -1, 0), (1, -1, 1), (0, -1, 1), (0, 0, 1)]
    places = [vector(0.5 * np.array(corner, dtype=float)) for corner in corners]
    links = [rod(f"link_{k + 1}", *ends) for k, ends in enumerate(pairwise(places))]
    names = ["", *(link.name for link in links), ""]
    joints = []
    for k, pair in enumerate(pairwise(names)):
        before, after = np.subtract(places[k], places[k - 1]), np.subtract(places[(k + 1) % 6], places[k])
        axis = vector(np.cross(before, after) / np.linalg.norm(np.cross(before, after)))
        joints.append(
            BodyJoint(f"hinge_{k + 1}", "hinge", *(pair if pair[1] else pair[::-1]), places[k], axis)
        )
    summary = "Bricard's loop of six hinges, overconstrained, swings under gravity"
    return mechanism("bricard", summary, links, joints, 2.0, ("conservative",))


@scene
def governor() -> Scenario:
    """Balls on two arms of a spinning shaft swing out and pull up a sleeve on a spring with a damper."""
    top, reach, tilt, spin = (0.0, 0.0, 0.0), 0.3, radians(30.0), (0.0, 0.0, 8.0)
    low = (0.0, 0.0, -2 * reach * cos(tilt))
    bodies = [
        capsule("shaft", "steel", 0.015, 0.1, 1.0, (0.0, 0.0, 0.15)),
        cylinder("sleeve", "steel", 0.03, 0.02, 1.0, low),
    ]
    along = (0.0, 0.0, 1.0)
    joints = [
        BodyJoint("bearing", "hinge", "", "shaft", top, along),
        BodyJoint("guide", "slider", "shaft", "sleeve", low, along, stiffness=200.0, damping=5.0),
    ]
    for side, name in ((0.05, "right"), (-0.05, "left")):
        pivot, foot = (side, 0.0, 0.0), (side, 0.0, low[2])
        out = np.array((np.sign(side) * sin(tilt), 0.0, -cos(tilt)))
        end = vector(pivot + reach * out)
        arm, link = rod(f"arm_{name}", pivot, end, 0.2), rod(f"link_{name}", end, foot, 0.2)
        weight = ball(f"ball_{name}", "steel", 0.04, 1.0, vector(end + 0.08 * out))
        bodies += [arm, link, weight]
        joints += [
            BodyJoint(f"pivot_{name}", "hinge", "shaft", arm.name, pivot, ACROSS),
            BodyJoint(f"elbow_{name}", "hinge", arm.name, link.name, end, ACROSS),
            BodyJoint(f"foot_{name}", "hinge", "sleeve", link.name, foot, ACROSS),
            BodyJoint(f"weld_{name}", "fixed", arm.name, weight.name, weight.position),
        ]
    spun = [turning(body, top, spin) for body in bodies]
    return mechanism("governor", "a flyball governor", spun, joints, 2.0)


@scene
def gyroscope() -> Scenario:
    """A spinning rotor in two gimbals with a weight on the inner one: it precesses and nods."""
    spin, origin = 60.0, (0.0, 0.0, 0.0)
    outer = capsule("outer", "steel", THICK, 0.1, 0.5, (0.3, 0.0, 0.0))
    inner = ball("weight", "steel", 0.03, 0.3, (0.0, 0.2, 0.0))
    rotor = cylinder(
        "rotor", "steel", 0.1, 0.02, 2.0, origin, direction(origin, ACROSS), spin=(0.0, spin, 0.0)
    )
    joints = [
        BodyJoint("base", "hinge", "", "outer", origin, (0.0, 0.0, 1.0)),
        BodyJoint("gimbal", "hinge", "outer", "weight", origin, (1.0, 0.0, 0.0)),
        BodyJoint("axle", "hinge", "weight", "rotor", origin, ACROSS),
    ]
    summary = "a gyroscope in gimbals precesses"
    return mechanism("gyroscope", summary, [outer, inner, rotor], joints, 2.0, ("conservative",))


@scene
def hinged_pair() -> Scenario:
    """Two rods joined by a hinge tumble without gravity and outer forces."""
    spin = (1.0, 3.0, 2.0)
    one, two = (
        rod("one", (-0.5, 0.0, 0.0), (0.0, 0.0, 0.0)),
        rod("two", (0.0, 0.0, 0.0), (0.3, 0.0, 0.4), 2.0),
    )
    bodies = [turning(one, (0.0, 0.0, 0.0), spin), turning(two, (0.0, 0.0, 0.0), (1.0, -1.0, 2.0))]
    joint = BodyJoint("hinge", "hinge", "one", "two", (0.0, 0.0, 0.0), ACROSS)
    summary = "two rods on one hinge tumble freely"
    tags = ("isolated", "conservative")
    return mechanism("hinged_pair", summary, bodies, [joint], 3.0, tags, gravity=(0.0, 0.0, 0.0))

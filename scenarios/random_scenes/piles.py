"""Random scenes whose bodies fall, wedge, spin, slide, fly or are pressed."""

from dataclasses import replace
from math import atan2, cos, pi, sin

import numpy as np
from numpy.random import Generator

from touchstone.scenarios.height_field import HeightField
from touchstone.scenarios.random_scenes.bodies import (
    FLAT,
    MATERIAL,
    SHAPES,
    coin,
    masses,
    random_direction,
    random_orientation,
    random_shape,
    scattered,
    solid,
    support,
    turned,
)
from touchstone.scenarios.random_scenes.hands import pressing
from touchstone.scenarios.random_scenes.setup import (
    DOWN,
    RATIOS,
    SPIN,
    Setup,
    Y,
    Z,
    mass_ratio,
    random_gap,
    random_size,
)
from touchstone.scenarios.scenario import IDENTITY, Body, Vector, vector
from touchstone.scenarios.solids import block, half_space, slab


def heaps(rng: Generator) -> Setup:
    """Bodies of all shapes dropped from above each other on a floor or into a bin."""
    count, reach = int(rng.integers(4, 31)), float(rng.uniform(0.03, 0.05))
    across = int(rng.integers(1, 4))
    places = scattered(rng, count, reach, across, random_gap(rng))
    kinds = SHAPES if rng.random() < 0.7 else [str(rng.choice(SHAPES))]
    loads = masses(rng, count, mass_ratio(rng))
    bodies = [
        solid(f"body_{k + 1}", random_shape(rng, reach, kinds), loads[k], vector(p), random_orientation(rng))
        for k, p in enumerate(places)
    ]
    inner = float(np.abs(places[:, :2]).max()) + reach + random_gap(rng, 0.05)
    walls = _bin(inner, float(places[:, 2].max()) + reach) if rng.random() < 0.5 else []
    where = "in a bin" if walls else "on a floor"
    return Setup(f"{count} bodies fall {where}", [slab("floor", MATERIAL), *walls, *bodies])


def resisting(rng: Generator) -> Setup:
    """A heap with static, rolling and torsional friction, or some of them."""
    static = float(rng.choice([0.0, rng.uniform(1.0, 2.0)]))
    rolling, torsional = (float(rng.choice([0.0, rng.uniform(0.0, 0.02)])) for _ in range(2))
    heap = heaps(rng)
    return replace(
        heap,
        summary=f"{heap.summary}, with friction beyond mu",
        static=static,
        rolling=rolling,
        torsional=torsional,
    )


def _bin(inner: float, height: float) -> list[Body]:
    """Four walls around the z axis, `inner` [m] from it."""
    thick = 0.05
    out, half = inner + thick, height / 2
    walls: dict[str, tuple[Vector, Vector]] = {
        "west": ((-out, 0.0, half), (thick, out + thick, half)),
        "east": ((out, 0.0, half), (thick, out + thick, half)),
        "south": ((0.0, -out, half), (out + thick, thick, half)),
        "north": ((0.0, out, half), (out + thick, thick, half)),
    }
    return [block(name, MATERIAL, size, 0.0, at, kind="fixed") for name, (at, size) in walls.items()]


def wedges(rng: Generator) -> Setup:
    """Bodies in a V of two inclined slabs."""
    count, slope = int(rng.integers(2, 13)), float(rng.uniform(0.35, 1.3))
    lanes = int(rng.integers(1, 3))
    left = slab("left", MATERIAL, (sin(slope), 0.0, cos(slope)), turned(Y, slope))
    right = slab("right", MATERIAL, (-sin(slope), 0.0, cos(slope)), turned(Y, -slope))
    size = random_size(rng)
    loads = masses(rng, count, mass_ratio(rng))
    bodies: list[Body] = []
    tops = [0.0] * lanes
    for k in range(count):
        shape = random_shape(rng, size)
        upright = rng.random() < 0.5
        turn = IDENTITY if upright else random_orientation(rng)
        lane = k % lanes
        lowest = max(
            support(shape, turn, (-side * sin(slope), 0.0, -cos(slope))) / cos(slope) for side in (-1, 1)
        )
        height = max(lowest, tops[lane] + support(shape, turn, DOWN)) + random_gap(rng)
        tops[lane] = height + support(shape, turn, Z)
        place = (0.0, 2.05 * size * (lane - (lanes - 1) / 2), height)
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], place, turn))
    return Setup(f"{count} bodies in a V of {np.degrees(slope):.3g} degrees", [left, right, *bodies])


def spinning(rng: Generator) -> Setup:
    """Balls, capsules, coins and boxes that spin at up to 50 rad/s on a floor, some moving towards each
    other."""
    count, reach = int(rng.integers(2, 11)), random_size(rng)
    places = scattered(rng, count, reach, 4, 0.0)
    loads = masses(rng, count, mass_ratio(rng))
    bodies: list[Body] = []
    for k, (x, y, _) in enumerate(places):
        shape, turn = random_shape(rng, reach, ("sphere", "capsule", "coin", "box", "ellipsoid")), IDENTITY
        if rng.random() < 0.3:
            shape = coin(reach / 1.1, reach / 1.1 * 0.15)
        if rng.random() < 0.6:
            # A capsule lies on its side, a coin stands on its edge.
            turn = turned(Y, -pi / 2)
        elif rng.random() < 0.3:
            turn = random_orientation(rng)
        low = support(shape, turn, DOWN) + random_gap(rng, 0.02)
        rolls = rng.random() < 0.3
        heading = -np.array([x, y]) / max(float(np.hypot(x, y)), reach)
        speed = float(rng.uniform(0, 2)) if rng.random() < 0.6 else 0.0
        spin = float(rng.uniform(0, SPIN)) * (np.array(Z) if rng.random() < 0.4 else random_direction(rng))
        if rolls:
            spin = speed / low * np.array([-heading[1], heading[0], 0.0])
        velocity = (float(speed * heading[0]), float(speed * heading[1]), 0.0)
        place = (float(x), float(y), low)
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], place, turn, velocity, vector(spin)))
    return Setup(f"{count} bodies spin and roll", [slab("floor", MATERIAL), *bodies])


def cylinders(rng: Generator) -> Setup:
    """Cylinders, half the time among all shapes, on a slab."""
    return _standing(rng, "cylinder", "cylinders", slab("floor", MATERIAL))


def cones(rng: Generator) -> Setup:
    """Cones, half the time among all shapes, on a half-space."""
    return _standing(rng, "cone", "cones", half_space("floor", MATERIAL))


def rounded_boxes(rng: Generator) -> Setup:
    """Rounded boxes, half the time among all shapes, on a half-space."""
    return _standing(rng, "rounded_box", "rounded boxes", half_space("floor", MATERIAL))


def _standing(rng: Generator, kind: str, plural: str, floor: Body) -> Setup:
    """Bodies of one kind, half the time among all shapes, that fall on each other, or stand, lie, lean, spin
    and roll on a floor."""
    count, reach = int(rng.integers(2, 13)), random_size(rng)
    falls = bool(rng.random() < 0.4)
    places = scattered(rng, count, reach, int(rng.integers(1, 4)) if falls else 4, random_gap(rng))
    kinds = (kind,) if rng.random() < 0.5 else (*len(SHAPES) * (kind,), *SHAPES)
    loads = masses(rng, count, mass_ratio(rng))
    bodies: list[Body] = []
    for k, place in enumerate(places):
        shape, turn = random_shape(rng, reach, kinds), IDENTITY
        velocity, spin = np.zeros(3), np.zeros(3)
        if falls:
            turn = random_orientation(rng)
        else:
            # on the cap, on the side, or on a rim
            turn = turned(Y, float(rng.choice([0.0, pi / 2, rng.uniform(0.0, pi / 2)])))
            place[2] = support(shape, turn, DOWN) + random_gap(rng, 0.02)
            if rng.random() < 0.7:
                velocity = rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.0)
                spin = float(rng.uniform(0, SPIN)) * random_direction(rng)
        name = f"body_{k + 1}"
        bodies.append(solid(name, shape, loads[k], vector(place), turn, vector(velocity), vector(spin)))
    does = "fall" if falls else "stand, lie, lean and roll"
    return Setup(f"{count} bodies with {plural} {does}", [floor, *bodies])


def terrain(rng: Generator) -> Setup:
    """Bodies of all shapes that fall, spin and roll on a field of triangles, level or with hills."""
    count, reach = int(rng.integers(2, 10)), random_size(rng)
    places = scattered(rng, count, reach, int(rng.integers(1, 4)), random_gap(rng))
    kinds = SHAPES if rng.random() < 0.7 else [str(rng.choice(SHAPES))]
    loads = masses(rng, count, mass_ratio(rng))
    spacing = float(rng.uniform(1.0, 4.0)) * reach
    points = int(2 * (float(np.abs(places[:, :2]).max()) + 0.5) / spacing) + 2
    hills = float(rng.choice([0.0, rng.uniform(0.0, 0.5)])) * spacing
    heights = tuple(tuple(map(float, row)) for row in -hills * rng.uniform(size=(points, points)))
    field = HeightField(heights, (spacing, spacing), -hills - 0.2)
    bodies = [Body("field", "fixed", MATERIAL, field.pieces())]
    for k, place in enumerate(places):
        shape, turn = random_shape(rng, reach, kinds), random_orientation(rng)
        velocity, spin = np.zeros(3), np.zeros(3)
        if rng.random() < 0.5:
            velocity = rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 0.0)
            spin = float(rng.uniform(0, SPIN)) * random_direction(rng)
        name = f"body_{k + 1}"
        bodies.append(solid(name, shape, loads[k], vector(place), turn, vector(velocity), vector(spin)))
    return Setup(f"{count} bodies fall on a field with hills of {hills:.3g} m", bodies)


def sliding(rng: Generator) -> Setup:
    """Bodies that rest or slide on a slope, sometimes with a wall at its foot."""
    count, size = int(rng.integers(2, 9)), random_size(rng)
    slope = float(rng.choice([0.0, rng.uniform(0, 0.8)]))
    tilt, up = turned(Y, slope), np.array([sin(slope), 0.0, cos(slope)])
    down = np.array([cos(slope), 0.0, -sin(slope)])
    places = scattered(rng, count, size, 3, 0.0)
    loads = masses(rng, count, mass_ratio(rng))
    bodies: list[Body] = [slab("slope", MATERIAL, vector(up), tilt)]
    if rng.random() < 0.5:
        end = float(places[:, 0].max()) + size + 0.05 + float(rng.uniform(0, 0.1))
        at = end * down + 0.1 * up
        bodies.append(block("stop", MATERIAL, (0.05, 1.0, 0.1), 0.0, vector(at), tilt, kind="fixed"))
    for k, (x, y, _) in enumerate(places):
        shape = random_shape(rng, size, (*FLAT, "sphere"))
        speed = float(rng.uniform(0, 2)) if rng.random() < 0.5 else 0.0
        heading = float(rng.uniform(-pi, pi))
        # Place upright on a level floor, then tilt everything: flat contacts stay flat on the slope.
        height = support(shape, IDENTITY, DOWN) + (0.0 if rng.random() < 0.8 else random_gap(rng, 0.01))
        at = x * down + y * np.array(Y) + height * up
        move = speed * (cos(heading) * down + sin(heading) * np.array(Y))
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], vector(at), tilt, vector(move)))
    return Setup(f"{count} bodies slide on a slope of {np.degrees(slope):.3g} degrees", bodies)


def free(rng: Generator) -> Setup:
    """Bodies that fly and spin towards each other, without gravity or floor."""
    count, reach = int(rng.integers(2, 9)), random_size(rng)
    places = scattered(rng, count, reach, 2, 0.0)
    kinds = SHAPES if rng.random() < 0.7 else ("sphere",)
    places -= places.mean(axis=0)
    loads = masses(rng, count, mass_ratio(rng))
    fastest = float(rng.choice([5.0, SPIN])) if kinds is SHAPES else 0.0
    bodies = []
    for k, place in enumerate(places):
        velocity = -place / np.linalg.norm(place) * rng.uniform(0, 2) + 0.2 * rng.normal(size=3)
        spin = vector(fastest * rng.uniform() * random_direction(rng))
        shape = random_shape(rng, reach, kinds)
        turn = random_orientation(rng)
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], vector(place), turn, vector(velocity), spin))
    return Setup(f"{count} bodies fly at each other", bodies, ("isolated",), gravity=False)


def pressed(rng: Generator) -> Setup:
    """Loose bodies on a floor that a driven hand or a driven box presses down or pushes sideways."""
    count, size = int(rng.integers(2, 9)), float(rng.uniform(0.012, 0.03))
    shapes = [random_shape(rng, size) for _ in range(count)]
    turns = [IDENTITY if rng.random() < 0.7 else random_orientation(rng) for _ in shapes]
    places = scattered(rng, count, size, 2, 0.0)
    loads = [0.02 * m for m in masses(rng, count, float(rng.choice(RATIOS[:3])))]
    bodies = []
    for k, place in enumerate(places):
        if k < 4:
            place[2] = support(shapes[k], turns[k], DOWN)
        bodies.append(solid(f"body_{k + 1}", shapes[k], loads[k], vector(place), turns[k]))
    reach = float(np.hypot(places[:, 0], places[:, 1]).max()) + size
    hand = pressing(rng, reach, float(places[:, 2].max()) + size)
    fixed = [slab("floor", MATERIAL)]
    if hand.sideways and rng.random() < 0.5:
        side = (0.05, 1.0, 0.1)
        at = hand.heading * (reach + 0.05 + random_gap(rng, 0.02))
        yaw = turned(Z, atan2(hand.heading[1], hand.heading[0]))
        fixed.append(block("wall", MATERIAL, side, 0.0, (float(at[0]), float(at[1]), 0.1), yaw, kind="fixed"))
    return Setup(f"{hand.summary} {count} bodies", [*fixed, *bodies], hand=hand)

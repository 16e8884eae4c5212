"""Random scenes in which drivers hold, drag, lift, shake and sweep through bodies, belts that carry them, and
persons who jump."""

from collections.abc import Sequence
from dataclasses import replace
from math import log10, pi

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.avatar import avatar_parts
from touchstone.scenarios.avatar.postures import person_tracker
from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.random_scenes.bodies import (
    FLAT,
    MATERIAL,
    masses,
    random_direction,
    random_orientation,
    random_shape,
    scattered,
    solid,
    support,
)
from touchstone.scenarios.random_scenes.hands import HAND_MATERIAL
from touchstone.scenarios.random_scenes.piles import heaps
from touchstone.scenarios.random_scenes.setup import (
    DOWN,
    Driven,
    Setup,
    Z,
    mass_ratio,
    random_gap,
    random_size,
    random_yaw,
)
from touchstone.scenarios.scenario import (
    GRAVITY,
    IDENTITY,
    Body,
    Box,
    Capsule,
    Interpolation,
    Piece,
    Quaternion,
    Shape,
    Sphere,
    vector,
)
from touchstone.scenarios.solids import block, slab

END = 1.25
"""Time of the last keyframe [s]: no random scene is longer."""
TIMES: Array = np.arange(round(END * 120) + 1) / 120
"""Keyframes of all but persons [s]."""
STIFFNESS, DAMPING = (1.0, 5.0), (0.2, 1.5)
"""Ranges of the decimal logarithm of a coupling's stiffness [N/m], and of its damping ratio [1]."""
WEIGHT, PLATE_WEIGHT = (-2.0, 1.0), (-2.0, 1.0)
"""Ranges of the decimal logarithm of the mass of a body and of a plate [kg]."""
DEEPEST = 0.1
"""Most by which a tracker is inside what its plate presses [m]."""
SAG = 0.01
"""Most by which a tray's coupling yields to its load [m]."""
SWEEP_SPEED = (0.0, log10(20.0))
"""Range of the decimal logarithm of the mean speed of a sweep [m/s]."""
SHAKES, FREQUENCY = (1, 4), (0.5, 6.0)
"""Numbers of sines of a shaken platform's path, and range of their frequencies [1/s]."""
ACCELERATION, SWING = 2 * GRAVITY, 0.3
"""Largest acceleration of a sine [m/s^2], and largest angle of a platform [rad]."""
BELT_SPEED, DISC_RATE = (-1.0, 0.7), 5.0
"""Range of the decimal logarithm of a surface's speed [m/s], and its largest angular velocity [rad/s]."""
JUMP = 1.0
"""Largest jump of a person's tracker along each axis [m]."""


def grips(rng: Generator) -> Setup:
    """Two plates squeeze a body that lies on a floor, and lift, carry or turn away with it."""
    shape, turn, mass = _body(rng)
    height = support(shape, turn, DOWN)
    yaw = Rotation.from_rotvec((0.0, 0.0, rng.uniform(-pi, pi)))
    along, width = yaw.apply((1.0, 0.0, 0.0)), 0.8 * height
    half, force = (float(rng.uniform(0.005, 0.02)), width, width), mass * GRAVITY * _log(rng, (-0.5, 1.0))
    rise = np.outer(
        ease(TIMES, 0.45, 0.4), (*rng.uniform(-0.1, 0.1, 2), rng.choice([0.0, rng.uniform(0, 0.2)]))
    )
    coupling, close, drivers = _coupling(rng), ease(TIMES, 0.05, float(rng.uniform(0.1, 0.3))), []
    for side, name in ((-1.0, "left"), (1.0, "right")):
        reach, gap = support(shape, turn, vector(side * along)), float(rng.uniform(0.002, 0.03))
        start = side * along * (reach + gap + half[0]) + (0.0, 0.0, height)
        inwards = gap + min(force / coupling[1], DEEPEST)
        path = start - np.outer(close, side * along * inwards) + rise
        drivers.append(_driver(name, Box(half), path, coupling, quaternion(yaw)))
    bodies = [slab("floor", MATERIAL), solid("body", shape, mass, (0.0, 0.0, height), turn)]
    return Setup(f"plates squeeze {mass:.2g} kg with {force:.2g} N", bodies, driven=drivers)


def drags(rng: Generator) -> Setup:
    """A plate presses one body or two, one on the other, and moves away over the floor."""
    count, yaw = int(rng.integers(1, 3)), rng.uniform(-pi, pi)
    bodies, top = [slab("floor", MATERIAL)], 0.0
    for k in range(count):
        shape, _, mass = _body(rng, FLAT)
        bodies.append(solid(f"body_{k + 1}", shape, mass, (0.0, 0.0, top + support(shape, IDENTITY, DOWN))))
        top += support(shape, IDENTITY, DOWN) + support(shape, IDENTITY, Z)
    coupling, half, gap = _coupling(rng), (0.05, 0.05, 0.01), float(rng.uniform(0.002, 0.03))
    force = sum(body.mass for body in bodies) * GRAVITY * _log(rng, (-1.0, 1.5))
    inwards = gap + min(force / coupling[1], DEEPEST)
    away = float(rng.uniform(0.05, 0.4)) * np.array((np.cos(yaw), np.sin(yaw), 0.0))
    path = np.outer(ease(TIMES, 0.05, 0.2), (0.0, 0.0, -inwards)) + (0.0, 0.0, top + gap + half[2])
    path += np.outer(ease(TIMES, 0.3, float(rng.uniform(0.2, 0.8))), away)
    plate = _driver("plate", Box(half), path, coupling)
    return Setup(f"a plate drags {count} bodies with {force:.2g} N", bodies, driven=[plate])


def lifts(rng: Generator) -> Setup:
    """A tray on its coupling lifts loose bodies, carries them aside, stops, and may go back."""
    count, size = int(rng.integers(1, 7)), random_size(rng) / 2
    places, half = scattered(rng, count, size, 2, 0.11), (0.15, 0.15, 0.01)
    loads = [float(m) * _log(rng, WEIGHT) / 10 for m in masses(rng, count, mass_ratio(rng))]
    bodies = [slab("floor", MATERIAL)]
    for k, place in enumerate(places):
        shape, turn = random_shape(rng, size), IDENTITY if rng.random() < 0.7 else random_orientation(rng)
        if k < 4:
            place[2] = 0.11 + support(shape, turn, DOWN)
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], vector(place), turn))
    mass, stiffness, damping = _coupling(rng)
    stiffer = max(1.0, sum(loads) * GRAVITY / SAG / stiffness)
    way = np.array((*rng.uniform(-0.2, 0.2, 2), rng.uniform(0.0, 0.5)))
    there = ease(TIMES, 0.1, float(rng.uniform(0.2, 0.6)))
    path = np.outer(there - rng.choice([0.0, 1.0]) * ease(TIMES, 0.7, 0.4), way) + (0.0, 0.0, 0.1)
    tray = _driver("tray", Box(half), path, (mass, stiffness * stiffer, damping * stiffer**0.5))
    return Setup(f"a tray lifts {count} bodies", bodies, driven=[tray])


def shakes(rng: Generator) -> Setup:
    """A prescribed platform, sometimes with walls, shakes and swings under a heap."""
    count, size, across = int(rng.integers(1, 21)), random_size(rng) / 2, int(rng.integers(1, 4))
    places, loads = scattered(rng, count, size, across, random_gap(rng)), masses(rng, count, mass_ratio(rng))
    bodies = [
        solid(f"body_{k + 1}", random_shape(rng, size), loads[k], vector(place), random_orientation(rng))
        for k, place in enumerate(places)
    ]
    inner, thick = float(np.abs(places[:, :2]).max()) + size + random_gap(rng), 0.02
    out = inner + 2 * thick if rng.random() < 0.5 else 0.5
    pieces = [Piece("deck", Box((out, out, thick)), (0.0, 0.0, -thick))]
    if out != 0.5:
        wall = Box((thick, out, 0.1))
        for k in range(4):
            quarter = Rotation.from_rotvec((0.0, 0.0, k * pi / 2))
            place = quarter.apply((inner + thick, 0.0, 0.1))
            pieces.append(Piece(f"wall_{k + 1}", wall, vector(place), quaternion(quarter)))
    path, angles = np.zeros((len(TIMES), 3)), np.zeros((len(TIMES), 3))
    for _ in range(int(rng.integers(*SHAKES))):
        rate, wave = 2 * pi * float(rng.uniform(*FREQUENCY)), rng.normal(size=(2, 3))
        sine = 1 - np.cos(rate * TIMES)
        path += np.outer(sine, wave[0] / np.linalg.norm(wave[0]) * rng.uniform(0, ACCELERATION) / rate**2)
        tilt = rng.choice([0.0, 1.0]) * wave[1] / np.linalg.norm(wave[1])
        angles += np.outer(sine, tilt * rng.uniform(0, min(SWING / 2, ACCELERATION / rate**2)))
    tracker = keyframed("platform", TIMES, path, Rotation.from_rotvec(angles).as_quat(scalar_first=True))
    platform = Body("platform", "prescribed", MATERIAL, tuple(pieces))
    return Setup(f"a platform shakes {count} bodies", bodies, driven=[Driven((platform,), (), tracker)])


def belts(rng: Generator) -> Setup:
    """A heap falls on a conveyor belt or a turning disc, which may be the floor of a bin."""
    heap = heaps(rng)
    floor, *others = heap.bodies
    velocity = _log(rng, BELT_SPEED) * random_direction(rng)
    spin = rng.choice([0.0, rng.uniform(0, DISC_RATE)]) * random_direction(rng)
    piece = replace(floor.pieces[0], surface_velocity=vector(velocity), surface_angular_velocity=vector(spin))
    bodies = [replace(floor, pieces=(piece,)), *others]
    return replace(heap, summary=f"{heap.summary} that moves", bodies=bodies)


def sweeps(rng: Generator) -> Setup:
    """A fast plate, rod or ball sweeps through a heap or slams on it."""
    count, size, across = int(rng.integers(2, 21)), random_size(rng) / 2, int(rng.integers(1, 4))
    places, loads = scattered(rng, count, size, across, 0.0), masses(rng, count, mass_ratio(rng))
    bodies = [slab("floor", MATERIAL)]
    for k, place in enumerate(places):
        shape, lies = random_shape(rng, size), random_orientation(rng)
        if k < across**2:
            place[2] = support(shape, lies, DOWN)
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], vector(place), lies))
    shapes = (Box((0.02, 0.1, 0.04)), Capsule(0.02, 0.1), Sphere(0.04))
    shape, own = shapes[int(rng.integers(3))], 0.13
    turn = Rotation.from_rotvec((0.0, 0.0, rng.uniform(-pi, pi)))
    heading = turn.apply((1.0, 0.0, 0.0))
    reach, top = float(np.hypot(*places[:, :2].T).max()) + size, float(places[:, 2].max()) + size
    start, end = -heading * (reach + own), heading * (reach + own)
    start[2] = end[2] = float(rng.uniform(0.05, 0.1))
    if rng.random() < 0.3:
        start, end = np.array((0.0, 0.0, top + own)), np.array((0.0, 0.0, float(rng.uniform(-0.05, 0.05))))
    speed = _log(rng, SWEEP_SPEED)
    length = float(np.linalg.norm(end - start))
    path = start + np.outer(ease(TIMES, 0.05, length / speed), end - start)
    lying = turn * Rotation.from_rotvec((pi / 2, 0.0, 0.0)) if isinstance(shape, Capsule) else turn
    sweeper = _driver("sweeper", shape, path, _coupling(rng, (3.0, 5.0)), quaternion(lying))
    return Setup(f"a driver sweeps {count} bodies at {speed:.2g} m/s", bodies, driven=[sweeper])


def persons(rng: Generator) -> Setup:
    """A person among blocks and loose bodies, whose tracker wanders or jumps to random poses and postures."""
    parts, joints, chains = avatar_parts()
    count, jumps = int(rng.integers(2, 7)), bool(rng.random() < 0.5)
    times = np.linspace(0.0, END, count)
    standing = person_tracker(times, np.zeros((count, 2)), 0.0)
    places, turns = np.array(standing.positions), Rotation.identity(count)
    far = rng.choice([0.1, 1.0]) * JUMP
    places[1:] += rng.uniform(-far, far, (count - 1, 3)) * (1.0, 1.0, 0.3)
    if rng.random() < 0.5:
        angles = rng.uniform(-pi, pi, count) * rng.choice([0.1, 1.0])
        turns = Rotation.from_rotvec(np.outer(angles - angles[0], Z))
    size, moved = rng.uniform(0.1, 1.0), [chain.joints for chain in chains if rng.random() < 0.6]
    low, high = [joint.lower for joint in joints], [joint.upper for joint in joints]
    bent = size * rng.uniform(low, high, (count, len(joints)))
    bent[0] = 0.0
    bent *= np.isin([joint.name for joint in joints], [name for names in moved for name in names])
    turned = turns.as_quat(scalar_first=True)
    kind: Interpolation = "held" if jumps else "cubic"
    gains = {name: getattr(standing, name) for name in ("stiffness", "damping", "hinge_frequency")}
    tracker = keyframed(standing.root, times, places, turned, standing.joints, bent, kind, **gains)
    bodies = [slab("floor", MATERIAL)]
    for k in range(int(rng.integers(0, 5))):
        # each in its own fifth of the circle
        heading, reach = 0.4 * pi * (k + rng.uniform(0.2, 0.8)), random_size(rng) * 2
        at = rng.uniform(0.9, 1.5) * np.array((np.cos(heading), np.sin(heading), 0.0))
        if rng.random() < 0.4:
            half = vector(rng.uniform(0.05, 0.15, 3))
            bodies.append(
                block(f"block_{k + 1}", MATERIAL, half, 0.0, vector(at + (0, 0, 0.8)), kind="fixed")
            )
            continue
        shape = random_shape(rng, reach)
        place = (float(at[0]), float(at[1]), support(shape, IDENTITY, DOWN) + 2 * reach * k)
        bodies.append(solid(f"body_{k + 1}", shape, _log(rng, (-1.0, 1.0)), place))
    what = "jumps" if jumps else "wanders"
    return Setup(
        f"a person {what} among {len(bodies) - 1} bodies",
        bodies,
        driven=[Driven(parts, joints, tracker, chains)],
    )


def _body(rng: Generator, kinds: Sequence[str] | None = None) -> tuple[Shape, Quaternion, float]:
    """A random shape, its orientation, upright in seven of ten cases, and a mass [kg]."""
    shape = random_shape(rng, random_size(rng), kinds) if kinds else random_shape(rng, random_size(rng))
    turn = random_yaw(rng) if rng.random() < 0.7 else random_orientation(rng)
    return shape, turn, _log(rng, WEIGHT)


def _coupling(rng: Generator, stiffness: tuple[float, float] = STIFFNESS) -> tuple[float, float, float]:
    """Mass [kg], stiffness [N/m] and damping [N s/m] of a driver."""
    mass, k = _log(rng, PLATE_WEIGHT), _log(rng, stiffness)
    return mass, k, float(2 * rng.uniform(*DAMPING) * np.sqrt(mass * k))


def _driver(
    name: str,
    shape: Shape,
    path: Array,
    coupling: tuple[float, float, float],
    orientation: Quaternion = IDENTITY,
) -> Driven:
    """A driven body of one shape that follows `path` at TIMES."""
    mass, stiffness, damping = coupling
    own = replace(solid(name, shape, mass), kind="driven", material=HAND_MATERIAL)
    tracker = keyframed(name, TIMES, path, orientation, stiffness=stiffness, damping=damping)
    return Driven((own,), (), tracker)


def _log(rng: Generator, exponents: tuple[float, float]) -> float:
    """A number whose decimal logarithm is uniform."""
    return float(10 ** rng.uniform(*exponents))

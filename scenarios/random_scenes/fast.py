"""Random scenes of bodies that move farther per frame than their thickness: shots at plates, slaps."""

from math import log10, pi

import numpy as np
from numpy.random import Generator
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.orientations import quaternion
from touchstone.scenarios.random_scenes.bodies import (
    MATERIAL,
    random_direction,
    random_orientation,
    random_shape,
    solid,
    support,
)
from touchstone.scenarios.random_scenes.hands import FLEXED, HAND_REACH, Pressing
from touchstone.scenarios.random_scenes.setup import DOWN, Setup, random_gap, random_size
from touchstone.scenarios.scenario import Body, Box, Piece, vector

SHOT_SPEED = (3.0, 3000.0)
"""Range of the speed of a shot, log-uniform [m/s]."""
SLAP_SPEED = (1.0, 20.0)
"""Range of the mean speed of a slapping hand, log-uniform [m/s]."""
HALF_THICKNESS = (5e-4, 5e-3, 0.02)
"""Half thicknesses of plates and tables [m]."""
PLATE_SIZE = 0.4
"""Half width of a plate or table [m]."""
BULLET_SIZE = (0.005, 0.05)
"""Range of the bounding radius of a shot body [m]."""
FLIGHT_FRAMES = (0.1, 2.5)
"""Range of the flight time of a shot before it arrives [frames]."""
BULLET_SPIN = 20.0
"""Largest angular velocity of a shot body [rad/s]."""
SLAP_DEPTH = 0.4
"""Final depth of a tracker below the table's top [m]."""


def shots(rng: Generator) -> Setup:
    """One or two bodies shot from one side at a plate that is fixed or free."""
    half, free = float(rng.choice(HALF_THICKNESS)), bool(rng.random() < 0.3)
    shape = Box((PLATE_SIZE, PLATE_SIZE, half))
    plate = (
        solid("plate", shape, mass=5.0)
        if free
        else Body("plate", "fixed", MATERIAL, (Piece("plate", shape),))
    )
    bodies = [_shot(rng, f"shot_{k + 1}", half, k) for k in range(int(rng.integers(1, 3)))]
    what = "a free plate" if free else "a plate"
    return Setup(f"{len(bodies)} bodies are shot at {what}", [plate, *bodies], gravity=False)


def _shot(rng: Generator, name: str, half: float, k: int) -> Body:
    """A body that flies at the upper face of a plate at z = 0, left (k = 0) or right of x = 0."""
    reach, speed = float(rng.uniform(*BULLET_SIZE)), _speed(rng, SHOT_SPEED)
    direction = random_direction(rng)
    direction[2] = -abs(direction[2]) - 0.3
    # A shot stays on its own side.
    direction[0] = abs(direction[0]) if k == 0 else -abs(direction[0])
    direction /= np.linalg.norm(direction)
    aim = rng.uniform(-0.9, 0.9, 3) * PLATE_SIZE
    aim[0] = -abs(aim[0]) if k == 0 else abs(aim[0])
    aim[2] = half
    clearance = 1.5 * reach / -direction[2]
    start = aim - direction * (clearance + speed * rng.uniform(*FLIGHT_FRAMES) / 60)
    spin = random_direction(rng) * rng.choice([0.0, BULLET_SPIN])
    shape = random_shape(rng, reach)
    velocity = vector(speed * direction)
    return solid(name, shape, 1.0, vector(start), random_orientation(rng), velocity, vector(spin))


def slaps(rng: Generator) -> Setup:
    """A hand in a random posture slaps a table with a loose body on it."""
    half = float(rng.choice(HALF_THICKNESS))
    top = Piece("top", Box((1.5 * PLATE_SIZE, 1.5 * PLATE_SIZE, half)), position=(0.0, 0.0, -half))
    bodies = [Body("table", "fixed", MATERIAL, (top,))]
    reach, place = random_size(rng) / 2, rng.uniform(-0.3, 0.3, 2)
    loose, lies = random_shape(rng, reach), random_orientation(rng)
    height = support(loose, lies, DOWN) + random_gap(rng, reach)
    bodies.append(solid("loose", loose, 0.2, (float(place[0]), float(place[1]), height), lies))
    links, joints = hand_parts()
    tilt = Rotation.from_rotvec(random_direction(rng) * rng.choice([0.1, 0.6, 1.5]))
    turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-pi, pi)]) * tilt
    heading = np.array((*rng.normal(scale=0.4, size=2), -1.0))
    heading /= np.linalg.norm(heading)
    start = np.array((*rng.uniform(-0.1, 0.1, 2), HAND_REACH + 4 * reach + random_gap(rng)))
    end = start + heading * (start[2] + SLAP_DEPTH)
    hand = Pressing(
        summary="a hand slaps a table",
        bodies=links,
        joints=joints,
        start=start,
        end=end,
        times=(0.05, float(np.linalg.norm(end - start)) / _speed(rng, SLAP_SPEED)),
        orientation=quaternion(turn),
        flexion=rng.uniform(0.0, 1.0) * np.tile(FLEXED, len(joints) // 3),
        heading=heading,
        sideways=False,
    )
    return Setup(hand.summary, bodies, hand=hand)


def _speed(rng: Generator, bounds: tuple[float, float]) -> float:
    return float(10 ** rng.uniform(log10(bounds[0]), log10(bounds[1])))

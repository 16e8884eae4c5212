"""Shared parts of the random scenes: their record, ranges of sizes, and random draws."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import pi

from numpy.random import Generator

from touchstone.scenarios.body_joints import BodyJoint
from touchstone.scenarios.random_scenes.bodies import support, turned
from touchstone.scenarios.random_scenes.hands import Pressing
from touchstone.scenarios.scenario import (
    IDENTITY,
    Body,
    Box,
    Chain,
    Joint,
    Quaternion,
    Shape,
    Tracker,
    Vector,
    vector,
)

Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
DOWN: Vector = (0.0, 0.0, -1.0)
SIZE = (0.03, 0.08)
"""Range of the distance of a body's surface from its centre [m]."""
DROP = 0.05
"""Largest height from which a body falls [m]."""
SPIN = 50.0
"""Maximum spin [rad/s]: a body turns by 48 degrees per frame, a ball of 5 cm rolls at 2.5 m/s."""
JITTER = 2e-3
"""Maximum offset of a tower's bodies [m]."""
RATIOS = (1.0, 10.0, 1e2, 1e4)
"""Mass ratios of a scene, largest over smallest mass [1]."""


@dataclass(frozen=True, slots=True)
class Driven:
    """A driven or prescribed body and its path, which covers any random scene."""

    bodies: tuple[Body, ...]
    joints: tuple[Joint, ...]
    tracker: Tracker
    chains: tuple[Chain, ...] = ()


@dataclass(frozen=True, slots=True)
class Setup:
    """Contents of a scene of some kind, without the bodies of `hand`, which is set if a driven body presses,
    and those of its other drivers. `static` is the coefficient of static friction over mu [1], the others
    are lengths [m]."""

    summary: str
    bodies: Sequence[Body]
    tags: tuple[str, ...] = ()
    hand: Pressing | None = None
    gravity: bool = True
    driven: Sequence[Driven] = ()
    joints: Sequence[BodyJoint] = ()
    static: float = 0.0
    rolling: float = 0.0
    torsional: float = 0.0


def random_gap(rng: Generator, largest: float = DROP) -> float:
    """Random initial gap [m]: exactly 0 in two of five cases."""
    return float(rng.choice([0.0, rng.uniform(0.0, largest)], p=[0.4, 0.6]))


def mass_ratio(rng: Generator) -> float:
    """Random element of RATIOS: equal masses in half of the scenes, 1e4 in a tenth."""
    return float(rng.choice(RATIOS, p=[0.5, 0.2, 0.2, 0.1]))


def random_size(rng: Generator) -> float:
    """Random size within SIZE [m]."""
    return float(rng.uniform(*SIZE))


def random_yaw(rng: Generator, largest: float = pi) -> Quaternion:
    """Random rotation about the vertical by up to `largest` [rad], or none."""
    return turned(Z, float(rng.uniform(-largest, largest))) if rng.random() < 0.5 else IDENTITY


def random_box(rng: Generator, size: float) -> Box:
    """Random box with half extents from 0.4 to 1 of `size` [m]."""
    return Box(vector(size * rng.uniform(0.4, 1.0, 3)))


def stacked(
    shapes: Sequence[Shape], turns: Sequence[Quaternion], gaps: Sequence[float], bottom: float
) -> list[float]:
    """Heights of the origins of stacked shapes, `gaps[k]` [m] below shape k, above `bottom` [m]."""
    heights: list[float] = []
    for shape, turn, gap in zip(shapes, turns, gaps):
        heights.append(bottom + gap + support(shape, turn, DOWN))
        bottom = heights[-1] + support(shape, turn, Z)
    return heights

"""Hard mass ratios: stacks, alternating stacks, collisions, and links on hinges."""

from dataclasses import replace
from math import pi

import numpy as np

from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.families.tower import at_rest, stacked
from touchstone.scenarios.scenario import (
    Arc,
    Body,
    Box,
    Joint,
    Piece,
    Truth,
    Vector,
)
from touchstone.scenarios.solids import ball, block, box_inertia, slab

HALF = 0.05
"""Radius of a ball [m]."""
RATIOS = (1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
LAYERS = 6
"""Number of cubes of an alternating stack."""
GAP, SPEED = 0.29, 1.0
"""Distance of the surfaces of two balls [m], and speed of the first [m/s]."""
ROOT_MASS, ROOT_FREQUENCY = 20.0, 15.0
"""Mass of a driven root [kg], and frequency of its critically damped coupling [rad/s]."""
LINK: Vector = (0.02, 0.02, 0.1)
"""Half extents of a link [m]."""


def standing(summary: str, bodies: tuple[Body, ...], friction: float = 0.5, duration: float = 1.0) -> Case:
    """Bodies on a floor that do not move."""
    return Case(
        summary,
        (slab("floor", "wood"), *bodies),
        Checks(rest_from=0.5 * duration),
        duration=duration,
        friction=friction,
        truths=at_rest(bodies),
    )


def resting(masses: list[float], summary: str, duration: float = 1.0) -> Case:
    """Stacked cubes of these masses [kg] from the bottom up, in exact contact: none moves."""
    return standing(summary, stacked(masses), duration=duration)


@family("mass ratio", "1", RATIOS)
def mass_stack(level: float) -> Case:
    """A heavy cube rests on one of 1 kg."""
    return resting([1.0, level], f"a cube of {level:g} kg rests on one of 1 kg")


@family("mass ratio", "1", RATIOS)
def mass_layers(level: float) -> Case:
    """Cubes of 1 kg and heavy ones alternate in a stack of six."""
    masses = [level if k % 2 else 1.0 for k in range(LAYERS)]
    return resting(masses, f"six cubes, 1 kg and {level:g} kg in alternation")


@family("mass ratio", "1", RATIOS)
def mass_collision(level: float) -> Case:
    """A heavy ball hits one of 1 kg centrally, e = 1."""
    met, start = (0.0, 0.0, 0.0), (-GAP, 0.0, 0.0)
    heavy = ball("heavy", "wood", HALF, level, start, (SPEED, 0.0, 0.0))
    light = ball("light", "wood", HALF, 1.0, (2 * HALF, 0.0, 0.0))
    left, right = SPEED * (level - 1) / (level + 1), SPEED * 2 * level / (level + 1)
    at = GAP / SPEED
    paths = {
        "heavy": (Arc(0.0, start, (SPEED, 0.0, 0.0)), Arc(at, met, (left, 0.0, 0.0))),
        "light": (Arc(0.0, light.position), Arc(at, light.position, (right, 0.0, 0.0))),
    }
    return Case(
        f"a ball of {level:g} kg hits one of 1 kg",
        (heavy, light),
        Checks(position=2 * HALF, energy=0.1, energy_loss=0.5),
        restitution=1.0,
        friction=0.0,
        truths=tuple(Truth(name, "arcs", arcs) for name, arcs in paths.items()),
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("mass ratio", "1", RATIOS)
def mass_links(level: float) -> Case:
    """A tracked root swings three links on hinges, the last one heavy."""
    masses = (ROOT_MASS, 1.0, 1.0, level)
    names = ("root", "link_1", "link_2", "link_3")
    links = tuple(_link(name, mass) for name, mass in zip(names, masses))
    heavy = box_inertia(ROOT_MASS, (0.3, 0.3, 0.3))
    links = (replace(links[0], center_of_mass=(0.0, 0.0, 0.0), inertia=heavy), *links[1:])
    joints = tuple(
        Joint(f"hinge_{k}", names[k - 1], names[k], (0.0, 0.0, -2 * LINK[2]), (0.0, 1.0, 0.0))
        for k in (1, 2, 3)
    )
    times = np.arange(31) / 30
    swing = 0.5 * np.sin(2 * pi * times) * ease(times, 0.0, 0.3) * (1 - ease(times, 0.6, 0.2))
    tracker = keyframed(
        "root",
        times,
        (0.0, 0.0, 1.0),
        joints=[joint.name for joint in joints],
        angles=np.column_stack([swing] * 3),
        stiffness=ROOT_MASS * ROOT_FREQUENCY**2,
        damping=2 * ROOT_MASS * ROOT_FREQUENCY,
        hinge_frequency=30.0,
    )
    return Case(
        f"three links on hinges, the last of {level:g} kg",
        links,
        Checks(tracked=0.05, speed=20.0),
        friction=0.0,
        fields={"joints": joints, "trackers": (tracker,)},
    )


def _link(name: str, mass: float) -> Body:
    piece, body = Piece(name, Box(LINK), (0.0, 0.0, -LINK[2])), block(name, "wood", LINK, mass, kind="driven")
    return replace(body, pieces=(piece,), center_of_mass=piece.position)

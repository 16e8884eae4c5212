"""Scenes that start in overlap, and places where the normals of several overlaps cancel."""

import numpy as np

from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.difficulty.checks import Case, Checks
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.scenario import vector
from touchstone.scenarios.solids import ball, block, slab

HALF = 0.05
SHARES = (0.01, 0.1, 0.3, 0.6, 0.9)
"""Depth over half of the body's height [1]."""
PARTED = 0.8
"""Time by which an overlap must be gone [s]."""


@family("depth over half the height", "1", SHARES)
def overlap_floor(level: float) -> Case:
    """A cube starts inside of the floor."""
    place = (0.0, 0.0, HALF * (1 - level))
    return Case(
        f"a cube starts {level * HALF:g} m deep in the floor",
        (slab("floor", "wood"), block("box", "wood", (HALF,) * 3, 1.0, place)),
        Checks(energy=0.999, parted_by=PARTED, rest_from=PARTED, creep=2e-3, jitter=0.05),
        duration=1.2,
    )


@family("depth over the edge", "1", (0.01, 0.1, 0.5, 0.9, 0.999, 1.0))
def overlap_boxes(level: float) -> Case:
    """Two free cubes that fly side by side start in overlap, up to coincidence."""
    drift = (0.0, 1.0, 0.0)
    return Case(
        f"two free cubes overlap by {level:g} of their edge",
        (
            block("box_1", "wood", (HALF,) * 3, 1.0, velocity=drift),
            block("box_2", "wood", (HALF,) * 3, 1.0, (2 * HALF * (1 - level), 0.0, 0.0), velocity=drift),
        ),
        Checks(energy=0.999, speed=4.0, parted_by=PARTED, momentum=1.0),
        duration=1.2,
        tags=("isolated",),
        fields={"effects": ("restitution", "friction")},
    )


@family("depth over the radius", "1", (0.01, 0.1, 0.5, 1.0))
def overlap_pile(level: float) -> Case:
    """Eight balls start in overlap with each other."""
    radius = 0.05
    spacing = 2 * radius - level * radius
    balls = tuple(
        ball(
            f"ball_{k + 1}",
            "wood",
            radius,
            1.0,
            vector(spacing * (np.array([k % 2, k // 2 % 2, k // 4]) - 0.5) + np.array([0.0, 0.0, 0.3])),
        )
        for k in range(8)
    )
    return Case(
        f"eight balls overlap by {level:g} of their radius",
        (slab("floor", "wood"), *balls),
        Checks(speed=6.0, energy=0.999, parted_by=PARTED, overlap=0.01),
        duration=1.2,
    )


@family("width of the slot over the hand's", "1", (1.2, 1.0, 0.9, 0.5, 0.1))
def opposing_normals(level: float) -> Case:
    """A driven box is led into a slot that is too narrow: the normals of both sides cancel (figure 4b)."""
    half, deep = (0.06, 0.03, 0.02), 0.2
    gap = level * half[1]
    walls = tuple(
        block(name, "wood", (deep, 0.1, 0.1), 0.0, (0.3 + deep, sign * (gap + 0.1), 0.0), kind="fixed")
        for name, sign in (("left", 1.0), ("right", -1.0))
    )
    times = np.arange(37) / 30
    path = np.outer(ease(times, 0.1, 0.6), (0.4, 0.0, 0.0))
    hand = block("hand", "wood", half, 0.4, kind="driven")
    tracker = keyframed("hand", times, path)
    return Case(
        f"a driven box is led into a slot of {level:g} of its width",
        (*walls, hand),
        Checks(overlap=0.01, speed=20.0),
        duration=1.2,
        friction=0.3,
        fields={"trackers": (tracker,)},
    )

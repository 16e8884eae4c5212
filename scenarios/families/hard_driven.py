"""Hard trackers and arms: slots, jumps, jitter, lost samples, stiff couplings, stretched and limited arms."""

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.avatar.tracking import ease, keyframed
from touchstone.scenarios.difficulty.checks import Case, Checks, Wall
from touchstone.scenarios.difficulty.family import family
from touchstone.scenarios.scenario import (
    Body,
    Box,
    Chain,
    Joint,
    PairCoefficients,
    Piece,
    Tracker,
    Truth,
    Vector,
)
from touchstone.scenarios.solids import block, box_inertia, slab

HAND: Vector = (0.06, 0.04, 0.02)
"""Half extents of a driven box [m]."""
MASS = 0.4
"""Its mass [kg]: critically damped by the default coupling."""
ARM, FREQUENCY = 20.0, 15.0
"""Mass of an arm's root [kg], heavier than what it moves, and frequency of its critically damped coupling
[rad/s]."""
LIMB: Vector = (0.15, 0.03, 0.03)
"""Half extents of a link of an arm [m]."""
RATE = 60
"""Keyframes per second."""


def _driven(name: str, half: Vector, mass: float, center: Vector = (0.0, 0.0, 0.0)) -> Body:
    body = block(name, "wood", half, mass, kind="driven")
    return replace(body, pieces=(Piece(name, Box(half), center),), center_of_mass=center)


def _tracker(
    root: str,
    path: Array,
    joints: tuple[str, ...] = (),
    angles: Array | None = None,
    stiffness: float = 1000.0,
    damping: float = 40.0,
    hinge_frequency: float = 70.0,
) -> Tracker:
    bent = np.zeros(len(joints)) if angles is None else angles
    gains: dict[str, Any] = {"stiffness": stiffness, "damping": damping, "hinge_frequency": hinge_frequency}
    return keyframed(root, np.arange(len(path)) / RATE, path, joints=joints, angles=bent, **gains)


def _times(duration: float) -> Array:
    return np.arange(round(duration * RATE) + 1) / RATE


@family("width of the slot over the hand's", "1", (1.5, 1.0, 0.7, 0.4, 0.1))
def hand_slot(level: float) -> Case:
    """A hand is led into a slot between two walls that is too narrow for it."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    times = _times(1.0)
    gap = 0.045 * level
    walls = tuple(
        block(name, "wood", (0.15, 0.1, 0.15), 0.0, (0.32, sign * (gap + 0.1), 0.0), kind="fixed")
        for name, sign in (("left", 1.0), ("right", -1.0))
    )
    angles = np.tile((0.1, 0.15, 0.1), (len(times), len(names) // 3))
    tracker = _tracker("palm", np.outer(ease(times, 0.1, 0.6), (0.2, 0.0, 0.0)), names, angles)
    pairs = tuple(
        PairCoefficients(a, b, 0.0, 0.4) for a, b in (("wood", "wood"), ("wood", "human"), ("human", "human"))
    )
    return Case(
        f"a hand is led into a slot of {level:g} of its width",
        (*walls, *links),
        Checks(overlap=8e-3, speed=20.0),
        fields={"joints": joints, "trackers": (tracker,), "coefficients": pairs},
    )


@family("jump", "m", (0.05, 0.2, 1.0, 5.0))
def tracker_jump(level: float) -> Case:
    """A tracker jumps within one sample to a place under a table; its hand stays above it."""
    times = _times(1.0)
    path = np.zeros((len(times), 3))
    path[:, 2] = np.where(times < 0.3, 0.1, 0.1 - level)
    return Case(
        f"a tracker jumps {level:g} m down, through a table",
        (
            block("table", "wood", (0.5, 0.5, 0.02), 0.0, (0.0, 0.0, -0.02), kind="fixed"),
            _driven("hand", HAND, MASS),
        ),
        Checks(overlap=0.01, walls=(Wall((0.0, 0.0, 0.0), bodies=("hand",)),) if level < 1.5 else ()),
        friction=0.5,
        fields={"trackers": (_tracker("hand", path),)},
    )


@family("jitter", "m", (1e-4, 1e-3, 1e-2, 0.05))
def tracker_jitter(level: float) -> Case:
    """A driven box that jitters presses a cube on the floor; the cube stays."""
    times = _times(1.2)
    noise = np.random.default_rng(0).normal(size=(len(times), 3)) * level
    path = np.array((0.0, 0.0, 0.13)) + np.outer(ease(times, 0.1, 0.4), (0.0, 0.0, -0.03)) + noise
    path[0] = (0.0, 0.0, 0.13)
    return Case(
        f"a driven box with {level:g} m of jitter presses a cube",
        (
            slab("floor", "wood"),
            block("box", "wood", (0.05, 0.05, 0.025), 1.0, (0.0, 0.0, 0.025)),
            _driven("hand", HAND, MASS),
        ),
        # a free hand reaches 10.3 m/s by Eq. 6
        Checks(overlap=0.01, speed=12.0, walls=(Wall((0.0, 0.0, 0.0)),)),
        duration=1.2,
        fields={"trackers": (_tracker("hand", path),)},
    )


@family("share of lost samples", "1", (0.0, 0.2, 0.5, 0.9))
def tracker_loss(level: float) -> Case:
    """A driven box pushes a cube along the floor, and most samples of its tracker are lost."""
    times = _times(1.2)
    way = np.outer(ease(times, 0.1, 0.8), (0.3, 0.0, 0.0)) + np.array((-0.2, 0.0, 0.05))
    lost = np.random.default_rng(1).random(len(times)) < level
    lost[[0, -1]] = False
    source = np.maximum.accumulate(np.where(lost, 0, np.arange(len(times))))
    return Case(
        f"a tracker loses {level:g} of its samples while it pushes a cube",
        (
            slab("floor", "wood"),
            block("box", "wood", (0.05, 0.05, 0.05), 1.0, (0.0, 0.0, 0.05)),
            _driven("hand", (0.04, 0.04, 0.02), MASS),
        ),
        Checks(overlap=0.01, speed=20.0, walls=(Wall((0.0, 0.0, 0.0)),)),
        duration=1.2,
        friction=0.3,
        fields={"trackers": (_tracker("hand", way[source]),)},
    )


@family("stiffness", "N/m", (1e2, 1e4, 1e6, 1e8, 1e10))
def coupling(level: float) -> Case:
    """A box on a critically damped coupling follows its tracker by the law of Eq. 6."""
    times = _times(0.6)
    path = np.outer(ease(times, 0.1, 0.3), (0.3, 0.0, 0.0))
    stiff = _tracker("hand", path, stiffness=level, damping=2 * (level * MASS) ** 0.5)
    return Case(
        f"a coupling of {level:g} N/m",
        (_driven("hand", HAND, MASS),),
        Checks(position=0.01),
        duration=0.6,
        friction=0.0,
        truths=(Truth("hand", "coupling"),),
        fields={"trackers": (stiff,)},
    )


def _arm(axis: Vector, limits: tuple[float, float]) -> tuple[tuple[Body, ...], tuple[Joint, ...], Chain]:
    """Root and three links along x, on hinges about `axis`."""
    names = ("root", "upper", "lower", "palm")
    bodies = (
        replace(_driven("root", (0.03, 0.03, 0.03), ARM), inertia=box_inertia(ARM, (0.3, 0.3, 0.3))),
        *(_driven(name, LIMB, 0.5, (LIMB[0], 0.0, 0.0)) for name in names[1:]),
    )
    joints = tuple(
        Joint(
            f"hinge_{k}",
            names[k - 1],
            names[k],
            (2 * LIMB[0] if k > 1 else 0.05, 0.0, 0.0),
            axis,
            lower=limits[0],
            upper=limits[1],
        )
        for k in (1, 2, 3)
    )
    return bodies, joints, Chain("arm", tuple(joint.name for joint in joints))


def _arm_case(
    summary: str, angles: tuple[float, float, float], axis: Vector, limits: tuple[float, float]
) -> Case:
    """An arm whose root moves along x for 0.3 m, towards a wall that its links reach on the way."""
    bodies, joints, chain = _arm(axis, limits)
    times = _times(1.2)
    path = np.outer(ease(times, 0.1, 0.8), (0.3, 0.0, 0.0))
    names = tuple(joint.name for joint in joints)
    bent = np.tile(angles, (len(times), 1))
    tracker = _tracker("root", path, names, bent, ARM * FREQUENCY**2, 2 * ARM * FREQUENCY, 30.0)
    # The arm's tip when it starts, and 5 cm to spare.
    heading = np.cumsum(angles) if axis[1] or axis[2] else np.zeros(3)
    reach = 0.05 + float((2 * LIMB[0] * np.cos(heading)).sum())
    wall = block("wall", "wood", (0.1, 2.0, 2.0), 0.0, (reach + 0.1 + 0.1, 0.0, 0.0), kind="fixed")
    return Case(
        summary,
        (wall, *bodies),
        Checks(overlap=0.01, speed=20.0),
        duration=1.2,
        friction=0.3,
        fields={"joints": joints, "trackers": (tracker,), "chains": (chain,)},
    )


@family("bend of the joints", "rad", (0.5, 0.1, 1e-2, 1e-6, 0.0))
def arm_stretched(level: float) -> Case:
    """A stretched arm is pushed against a wall along itself: it must fold from a singular posture."""
    angles = (level, -2 * level, level)
    return _arm_case(f"an arm bent by {level:g} rad against a wall", angles, (0.0, 1.0, 0.0), (-2.5, 2.5))


@family("range of the joints", "rad", (2.0, 0.5, 0.1, 0.01, 1e-3))
def arm_limits(level: float) -> Case:
    """An arm whose joint limits exclude every posture before the wall is pushed against it."""
    angles = (min(0.1, level / 2), -min(0.2, level / 2), min(0.1, level / 2))
    return _arm_case(f"an arm with {level:g} rad of freedom", angles, (0.0, 1.0, 0.0), (-level, level))


@family("angle of the hinges' axes to the push", "rad", (pi / 2, 0.3, 0.03, 1e-3, 0.0))
def arm_axis(level: float) -> Case:
    """A wall pushes an arm along the axes of its hinges, about which nothing gives way."""
    axis = (float(np.cos(level)), float(np.sin(level)), 0.0)
    angles = (0.1, -0.2, 0.1)
    return _arm_case(f"hinges whose axes are {level:g} rad off the push", angles, axis, (-2.5, 2.5))

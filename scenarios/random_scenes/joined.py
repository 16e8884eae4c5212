"""Random mechanisms in contact: trees of bodies that joints connect, with free bodies around them."""

from dataclasses import replace

import numpy as np
from numpy.random import Generator

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.body_joints import ALONG_AXIS, BodyJoint
from touchstone.scenarios.random_scenes.bodies import (
    MATERIAL,
    SHAPES,
    masses,
    random_direction,
    random_orientation,
    random_shape,
    scattered,
    solid,
)
from touchstone.scenarios.random_scenes.setup import SPIN, Setup, mass_ratio, random_gap, random_size
from touchstone.scenarios.scenario import vector
from touchstone.scenarios.solids import slab

TYPES = ("hinge", "slider", "ball", "fixed")
TYPE_SHARES = (0.45, 0.15, 0.3, 0.1)


def mechanisms(rng: Generator) -> Setup:
    """Trees of joined bodies of all shapes, some held by the world, that fall among free bodies."""
    count, others, reach = int(rng.integers(2, 8)), int(rng.integers(0, 4)), random_size(rng)
    places = scattered(rng, count + others, reach, int(rng.integers(1, 4)), random_gap(rng))
    loads = masses(rng, count + others, min(100.0, mass_ratio(rng)))
    bodies = []
    for k, place in enumerate(places):
        spin = np.zeros(3)
        if k >= count and rng.random() < 0.5:
            spin = float(rng.uniform(0, SPIN)) * random_direction(rng)
        shape, turn = random_shape(rng, reach, (*SHAPES, "cylinder")), random_orientation(rng)
        bodies.append(solid(f"body_{k + 1}", shape, loads[k], vector(place), turn, spin=vector(spin)))
    joints = [
        _joint(rng, f"joint_{k}", places, int(np.linalg.norm(places[:k] - places[k], axis=1).argmin()), k)
        for k in range(1, count)
    ]
    held = rng.random() < 0.3
    if held:
        joints.append(_joint(rng, f"joint_{count}", places, -1, 0))
    does = "hang and fall" if held else "fall"
    summary = f"{count} joined bodies and {others} others {does}"
    return Setup(summary, [slab("floor", MATERIAL), *bodies], joints=joints)


def servos(rng: Generator) -> Setup:
    """`mechanisms` whose hinges and sliders have servos, from soft to all but rigid."""
    setup = mechanisms(rng)
    joints = [_servo(rng, joint) if joint.type in ALONG_AXIS else joint for joint in setup.joints]
    return replace(setup, summary=f"{setup.summary}, with servos", joints=joints)


def _servo(rng: Generator, joint: BodyJoint) -> BodyJoint:
    """A joint with a spring of 1 to 1e6 N m/rad or N/m, in most cases damped."""
    stiffness, damps = float(10 ** rng.uniform(0, 6)), rng.random() < 0.7
    return replace(joint, stiffness=stiffness, damping=stiffness * float(10 ** rng.uniform(-4, 0)) * damps)


def _joint(rng: Generator, name: str, places: Array, parent: int, child: int) -> BodyJoint:
    """Random joint halfway between two bodies, or between one and a place near it in the world."""
    kind = str(rng.choice(TYPES, p=TYPE_SHARES))
    fields: dict[str, float] = {}
    if kind == "slider" or (kind == "hinge" and rng.random() < 0.5):
        fields |= {"lower": -float(rng.uniform(0.05, 1.0)), "upper": float(rng.uniform(0.05, 1.0))}
    if kind in ("hinge", "slider") and rng.random() < 0.3:
        fields["stiffness"] = float(10 ** rng.uniform(-1, 2))
    if kind != "fixed" and rng.random() < 0.4:
        fields["damping"] = float(10 ** rng.uniform(-3, 0))
    other = places[parent] if parent >= 0 else places[child] + 0.1 * rng.normal(size=3)
    anchor, axis = vector((places[child] + other) / 2), vector(random_direction(rng))
    ends = (f"body_{parent + 1}" if parent >= 0 else "", f"body_{child + 1}")
    return BodyJoint(name, kind, *ends, anchor, axis, **fields)  # type: ignore[arg-type]

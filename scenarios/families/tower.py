"""Towers of equal cubes, aligned or not, and a light cube under a heavy one: none moves."""

from collections.abc import Iterable, Sequence

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Arc, Body, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import block, slab

HALF = 0.05
"""Half an edge of a cube [m]."""
HEIGHTS = (10, 20, 40)
"""Numbers of cubes of the towers."""
JITTER = 2e-3
"""Maximum offset of a cube from the axis along x and y [m]: the weight above stays within each face."""
LOADS = {"load_1e4": 1e4, "load_1e6": 1e6}
"""Mass of the upper of two cubes [kg]; the lower has 1 kg."""


@scene
def towers() -> tuple[Scenario, ...]:
    """Stacked cubes in exact contact for one second: none moves."""
    return tuple(
        _standing(f"tower_{count}", f"a tower of {count} cubes stands", stacked([1.0] * count))
        for count in HEIGHTS
    )


@scene
def jittered_tower() -> Scenario:
    """Twenty cubes with seeded offsets from the axis."""
    offsets = np.random.default_rng(0).uniform(-JITTER, JITTER, (20, 2))
    cubes = stacked([1.0] * 20, offsets)
    return _standing("tower_20_jittered", "a tower of 20 cubes out of line stands", cubes)


@scene
def loads() -> tuple[Scenario, ...]:
    """A heavy cube on one of 1 kg."""
    return tuple(
        _standing(name, f"a cube of {mass:g} kg rests on one of 1 kg", stacked([1.0, mass]))
        for name, mass in LOADS.items()
    )


def stacked(masses: Sequence[float], offsets: Array | None = None) -> tuple[Body, ...]:
    """Cubes of these masses [kg] from the bottom up in exact contact, with offsets (n, 2) [m] if any."""
    offsets = np.zeros((len(masses), 2)) if offsets is None else offsets
    return tuple(
        block(f"box_{k + 1}", "wood", (HALF,) * 3, mass, (float(x), float(y), (2 * k + 1) * HALF))
        for k, (mass, (x, y)) in enumerate(zip(masses, offsets))
    )


def at_rest(bodies: Iterable[Body]) -> tuple[Truth, ...]:
    """Truths of bodies that do not move."""
    return tuple(Truth(body.name, "arcs", (Arc(0.0, body.position),)) for body in bodies)


def _standing(name: str, summary: str, cubes: tuple[Body, ...]) -> Scenario:
    return Scenario(
        name=name,
        summary=summary,
        tags=("probe",),
        bodies=(slab("floor", "wood"), *cubes),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.0,
        truths=at_rest(cubes),
    )

"""Towers of equal cubes, aligned or not, and a light cube under a heavy one: none moves."""

from __future__ import annotations

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import Arc, PairCoefficients, Scenario, Truth, Vector
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
        _resting(f"tower_{count}", f"a tower of {count} cubes stands", [1.0] * count, np.zeros((count, 2)))
        for count in HEIGHTS
    )


@scene
def jittered_tower() -> Scenario:
    """Twenty cubes with seeded offsets from the axis."""
    offsets = np.random.default_rng(0).uniform(-JITTER, JITTER, (20, 2))
    return _resting("tower_20_jittered", "a tower of 20 cubes out of line stands", [1.0] * 20, offsets)


@scene
def loads() -> tuple[Scenario, ...]:
    """A heavy cube on one of 1 kg."""
    return tuple(
        _resting(name, f"a cube of {mass:g} kg rests on one of 1 kg", [1.0, mass], np.zeros((2, 2)))
        for name, mass in LOADS.items()
    )


def _resting(name: str, summary: str, masses: list[float], offsets: np.ndarray) -> Scenario:
    """Stacked cubes from the bottom up, with their masses [kg] and offsets (n, 2) [m]."""
    places: dict[str, Vector] = {
        f"box_{k + 1}": (float(x), float(y), (2 * k + 1) * HALF) for k, (x, y) in enumerate(offsets)
    }
    return Scenario(
        name=name,
        summary=summary,
        tags=("probe",),
        bodies=(
            slab("floor", "wood"),
            *(block(box, "wood", (HALF,) * 3, m, at) for (box, at), m in zip(places.items(), masses)),
        ),
        coefficients=(PairCoefficients("wood", "wood", 0.0, 0.5),),
        duration=1.0,
        truths=tuple(Truth(box, "arcs", (Arc(0.0, at),)) for box, at in places.items()),
    )

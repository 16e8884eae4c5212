"""`sliders*`: a block on a sliding block: the slip between them reverses before both stop."""

from dataclasses import dataclass
from math import ceil

import numpy as np

from touchstone.scenarios.catalogue import scene
from touchstone.scenarios.scenario import GRAVITY, Arc, PairCoefficients, Scenario, Truth
from touchstone.scenarios.solids import block, slab

LOWER, UPPER = (1.5, 0.2, 0.1), (0.05, 0.05, 0.05)
"""Half extents of the blocks [m]."""


@dataclass(frozen=True, slots=True)
class Case:
    """Masses [kg], friction below and between the blocks (above 0 and smaller), first speed [m/s]."""

    lower: float = 3.0
    upper: float = 1.0
    below: float = 0.4
    between: float = 0.1
    speed: float = 3.0


@scene
def sliders() -> tuple[Scenario, ...]:
    """The lower block starts at speed, the upper one at rest on it: three seeded variants have other masses
    and frictions."""
    return (_scene("sliders", Case(), 0), *map(_seeded, range(3)))


def _seeded(seed: int) -> Scenario:
    rng = np.random.default_rng(seed)
    lower, upper, below, share, speed = rng.uniform((1, 1, 0.2, 0.2, 1), (4, 4, 0.6, 0.8, 3)).tolist()
    case = Case(lower, upper, below, share * below, speed)
    return _scene(f"sliders_seed{seed}", case, seed)


def _scene(name: str, case: Case, seed: int) -> Scenario:
    low, high = arcs(case)
    stop = max(low[-1].start, high[-1].start)
    start = (case.speed, 0.0, 0.0)
    return Scenario(
        name=name,
        summary="a block on a sliding block: the slip between them reverses before both stop",
        tags=("curved",),
        bodies=(
            slab("floor", "floor"),
            block("lower", "lower", LOWER, case.lower, low[0].position, velocity=start),
            block("upper", "upper", UPPER, case.upper, high[0].position),
        ),
        coefficients=(
            PairCoefficients("lower", "floor", 0.0, case.below),
            PairCoefficients("upper", "lower", 0.0, case.between),
            PairCoefficients("upper", "floor", 0.0, case.between),
        ),
        duration=ceil(10 * stop + 2) / 10,
        truths=(Truth("lower", "arcs", low), Truth("upper", "arcs", high)),
        seed=seed,
    )


def arcs(case: Case) -> tuple[tuple[Arc, ...], tuple[Arc, ...]]:
    """Motion of the lower and of the upper block, by Coulomb's law.

    The upper block speeds up at between * g until both are equally fast. The lower one then stops first: the
    floor slows it more than the friction between the blocks slows the upper one.
    """
    weight = case.below * (case.lower + case.upper)
    pull = case.between * GRAVITY
    braked = (weight + case.between * case.upper) * GRAVITY / case.lower
    less = (weight - case.between * case.upper) * GRAVITY / case.lower
    met = case.speed / (braked + pull)
    common = pull * met
    low = _path(LOWER[2], ((0.0, case.speed, -braked), (met, common, -less), (met + common / less, 0.0, 0.0)))
    high = _path(
        2 * LOWER[2] + UPPER[2], ((0.0, 0.0, pull), (met, common, -pull), (met + common / pull, 0.0, 0.0))
    )
    return low, high


def _path(height: float, phases: tuple[tuple[float, float, float], ...]) -> tuple[Arc, ...]:
    """Arcs along x from phases of a start [s], a speed and an acceleration."""
    found, place = [], 0.0
    for k, (start, speed, acceleration) in enumerate(phases):
        found.append(Arc(start, (place, 0.0, height), (speed, 0.0, 0.0), (acceleration, 0.0, 0.0)))
        if k + 1 < len(phases):
            time = phases[k + 1][0] - start
            place += speed * time + acceleration * time**2 / 2
    return tuple(found)

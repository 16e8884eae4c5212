"""Seeded random scenes of contact: `random_scene(seed)`, the same for the same seed on every machine.

A scene is of one of KINDS, which is its second tag. No two bodies overlap at the start: they stand on each
other or beside planes by their support functions (a gap of exactly 0 is frequent), or their bounding balls
are apart. Nothing here is tuned to any engine; `touchstone study robustness` plays these scenes and checks
what needs no truth: energy, momentum, overlap, finiteness.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.random import Generator

from touchstone.scenarios.random_scenes import fast, piles, stacks
from touchstone.scenarios.random_scenes.bodies import MATERIAL
from touchstone.scenarios.random_scenes.hands import HAND_MATERIAL
from touchstone.scenarios.random_scenes.setup import Setup
from touchstone.scenarios.scenario import PairCoefficients, Scenario

KINDS: Mapping[str, Callable[[Generator], Setup]] = {
    "drop": stacks.drops,
    "tower": stacks.towers,
    "ratio": stacks.ratios,
    "bridge": stacks.bridges,
    "lean": stacks.leaning,
    "slot": stacks.slots,
    "heap": piles.heaps,
    "wedge": piles.wedges,
    "spin": piles.spinning,
    "slide": piles.sliding,
    "free": piles.free,
    "press": piles.pressed,
}
"""Name of a kind, its tag, and what builds it: those that a seed may choose."""
FAST_KINDS: Mapping[str, Callable[[Generator], Setup]] = {"shot": fast.shots, "slap": fast.slaps}
"""Kinds that are played where they are asked for: only what sweeps passes them."""
ALL_KINDS = {**KINDS, **FAST_KINDS}
FRAME_RATE = 60
FRAMES = (42, 73)
"""Range of the number of frames: 0.7 to 1.2 s, in which drops of a few centimetres land and settle."""


def random_scene(seed: int, kind: str | None = None) -> Scenario:
    """The random scene of a seed.

    Args:
        seed: 0 or more; names the scene `random_<seed>`.
        kind: one of ALL_KINDS, or None for one of KINDS that the seed chooses.
    Returns:
        A scene of 1 to 30 simulated bodies, 0.7 to 1.2 s long, tagged `random` and by its kind; besides
        `isolated` where nothing outside pushes, `conservative` where no energy may be lost either.
    """
    rng = np.random.default_rng(seed)
    drawn = _drawn_kind(rng)
    kind = kind or drawn
    duration = int(rng.integers(*FRAMES)) / FRAME_RATE
    e, mu = _coefficient(rng), _coefficient(rng)
    setup = ALL_KINDS[kind](rng)
    hand = setup.hand
    tags = ["random", kind, *setup.tags]
    if "isolated" in tags and e == 1 and mu == 0:
        tags.append("conservative")
    materials = [(MATERIAL, MATERIAL)]
    if hand:
        materials += [(MATERIAL, HAND_MATERIAL), (HAND_MATERIAL, HAND_MATERIAL)]
    return Scenario(
        name=f"random_{seed}",
        summary=f"{kind}: {setup.summary}; e = {e:.3g}, mu = {mu:.3g}",
        tags=tuple(tags),
        bodies=(*setup.bodies, *(hand.bodies if hand else ())),
        coefficients=tuple(PairCoefficients(a, b, e, mu) for a, b in materials),
        duration=duration,
        joints=hand.joints if hand else (),
        trackers=(hand.tracker(duration),) if hand else (),
        frame_rate=FRAME_RATE,
        effects=(*(("gravity",) if setup.gravity else ()), "restitution", "friction"),
        seed=seed,
    )


def kind_of(seed: int, kind: str | None = None) -> str:
    """The kind of `random_scene(seed, kind)`."""
    return kind or _drawn_kind(np.random.default_rng(seed))


def _drawn_kind(rng: Generator) -> str:
    return str(rng.choice(list(KINDS)))


def _coefficient(rng: Generator) -> float:
    """Restitution or friction: 0, 1, or anything between."""
    return float(rng.choice([0.0, 0.3, 1.0, rng.uniform()], p=[0.25, 0.2, 0.1, 0.45]))

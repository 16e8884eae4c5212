"""Seeded random contact scenes: `random_scene(seed)` is the same for the same seed on every machine.

A scene is of one of KINDS, which is its second tag. No two bodies overlap at the start: support functions
place them on each other or beside planes (often with a gap of exactly 0), or their bounding balls are apart.
Nothing is tuned to any engine. `touchstone study robustness` plays these scenes and checks what needs no
truth: energy, momentum, overlap, finiteness.
"""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.random import Generator

from touchstone.scenarios.random_scenes import driven, fast, joined, piles, stacks
from touchstone.scenarios.random_scenes.bodies import MATERIAL
from touchstone.scenarios.random_scenes.hands import HAND_MATERIAL
from touchstone.scenarios.random_scenes.setup import Driven, Setup
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
"""Kinds that a seed may choose: name, which is also the tag, and builder."""
REQUESTED_KINDS: Mapping[str, Callable[[Generator], Setup]] = {
    "shot": fast.shots,
    "slap": fast.slaps,
    "cylinder": piles.cylinders,
    "cone": piles.cones,
    "rounded": piles.rounded_boxes,
    "terrain": piles.terrain,
    "friction": piles.resisting,
    "mechanism": joined.mechanisms,
    "servo": joined.servos,
}
"""Kinds that are used on request only, so that a seed of KINDS stays what it is: those that need continuous
collision detection, other shapes, height fields, friction beyond mu, and joints between bodies."""
DRIVEN_KINDS: Mapping[str, Callable[[Generator], Setup]] = {
    "grip": driven.grips,
    "drag": driven.drags,
    "lift": driven.lifts,
    "shake": driven.shakes,
    "belt": driven.belts,
    "sweep": driven.sweeps,
    "person": driven.persons,
}
"""Kinds with drivers of all masses and stiffnesses, that are used on request only."""
ALL_KINDS = {**KINDS, **REQUESTED_KINDS, **DRIVEN_KINDS}
FRAME_RATE = 60
FRAMES = (42, 73)
"""Range of the number of frames: 0.7 to 1.2 s, in which drops of a few centimetres land and settle."""


def random_scene(seed: int, kind: str | None = None) -> Scenario:
    """Random scene for a seed.

    Args:
        seed: 0 or more; names the scene `random_<seed>`.
        kind: one of ALL_KINDS; None: the seed chooses one of KINDS.
    Returns:
        A scene of 0 to 30 simulated bodies, 0.7 to 1.2 s long, with the tags `random` and its kind; also
        `isolated` if no external force acts, and `conservative` if energy is conserved as well.
    """
    rng = np.random.default_rng(seed)
    drawn = _drawn_kind(rng)
    kind = kind or drawn
    duration = int(rng.integers(*FRAMES)) / FRAME_RATE
    e, mu = _coefficient(rng), _coefficient(rng)
    setup = ALL_KINDS[kind](rng)
    hand, drivers = setup.hand, list(setup.driven)
    if hand:
        drivers.append(Driven(hand.bodies, hand.joints, hand.tracker(duration)))
    chains = tuple(chain for driver in drivers for chain in driver.chains)
    tags = ["random", kind, *setup.tags]
    if "isolated" in tags and e == 1 and mu == 0:
        tags.append("conservative")
    materials = [(MATERIAL, MATERIAL)]
    if drivers:
        materials += [(MATERIAL, HAND_MATERIAL), (HAND_MATERIAL, HAND_MATERIAL)]
    return Scenario(
        name=f"random_{seed}",
        summary=f"{kind}: {setup.summary}; e = {e:.3g}, mu = {mu:.3g}",
        tags=tuple(tags),
        bodies=(*setup.bodies, *(body for driver in drivers for body in driver.bodies)),
        coefficients=tuple(
            PairCoefficients(a, b, e, mu, setup.static * mu, setup.rolling, setup.torsional)
            for a, b in materials
        ),
        duration=duration,
        joints=tuple(joint for driver in drivers for joint in driver.joints),
        trackers=tuple(driver.tracker for driver in drivers),
        chains=chains,
        body_joints=tuple(setup.joints),
        frame_rate=FRAME_RATE,
        effects=(
            *(("gravity",) if setup.gravity else ()),
            *("restitution", "friction"),
            *(("self_collision",) if chains else ()),
        ),
        seed=seed,
    )


def kind_of(seed: int, kind: str | None = None) -> str:
    """Kind of `random_scene(seed, kind)`."""
    return kind or _drawn_kind(np.random.default_rng(seed))


def _drawn_kind(rng: Generator) -> str:
    return str(rng.choice(list(KINDS)))


def _coefficient(rng: Generator) -> float:
    """Random restitution or friction: 0, 1, or a value between."""
    return float(rng.choice([0.0, 0.3, 1.0, rng.uniform()], p=[0.25, 0.2, 0.1, 0.45]))

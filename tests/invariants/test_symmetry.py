"""Contact on the reference knows no left and right, no order of bodies, no place, and no end of patience."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.reports.metrics.context import Context
from touchstone.reports.metrics.motion.energy import mechanical_energy
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.random_scenes.bodies import random_orientation, random_shape, scattered, solid
from touchstone.scenarios.scenario import Arc, PairCoefficients, Scenario, Truth, Vector, vector
from touchstone.scenarios.solids import block, slab
from touchstone.scenarios.transforms import mirror, mirrored, permuted, translated

FRAME = 1 / 60
PROFILES = ("balanced", "accurate")
OFFSET: Vector = (1.0, -2.0, 0.5)
TUMBLE_LIMITS = {1: 1e-9, 2: 1e-8, 4: 1e-6}
"""Distance of the ends of so many tumbling boxes [m]: each impact multiplies a rounding by up to ten."""
TOWERS = ("tower_10", "tower_20", "tower_40", "tower_20_jittered")
MINUTE = 60.0
"""Time for which a tower must stand [s]."""


def ends(registry, scenario: Scenario, profile: str) -> dict[str, np.ndarray]:
    """Where simulated bodies end, by name (3,) [m]."""
    recording = record(registry.engine("reference"), scenario, Settings(profile, FRAME))
    bodies = enumerate(scenario.bodies)
    return {body.name: recording.position[-1, k] for k, body in bodies if body.kind == "simulated"}


def reordered_ends(registry, scenario: Scenario, order: Sequence[int], profile: str) -> dict[str, np.ndarray]:
    """`ends` of a scene whose simulated bodies are renamed: the reference sorts them by name."""
    moving = [body for body in scenario.bodies if body.kind == "simulated"]
    names = {f"body_{place}": body.name for place, body in zip(order, moving)}
    renamed = [replace(body, name=name) for name, body in zip(names, moving)]
    fixed = [body for body in scenario.bodies if body.kind == "fixed"]
    found = ends(registry, replace(scenario, bodies=(*fixed, *renamed), truths=(), expectations=()), profile)
    return {names[name]: end for name, end in found.items()}


def farthest(one: dict[str, np.ndarray], two: dict[str, np.ndarray]) -> float:
    """Largest distance of two ends of a body [m]."""
    return max(float(np.linalg.norm(one[name] - two[name])) for name in one)


def tumbling(count: int, seed: int) -> Scenario:
    """Boxes thrown at a floor with spin: e = 0.3, mu = 0.5, 1.2 s."""
    rng = np.random.default_rng(seed)
    boxes = []
    for k in range(count):
        place, turn = (0.11 * k, 0.02 * k, 0.2 + 0.05 * k), random_orientation(rng)
        thrown = {"velocity": vector(rng.normal(size=3) * 0.5), "spin": vector(rng.normal(size=3) * 5)}
        boxes.append(block(f"box_{k}", "wood", (0.05, 0.04, 0.03), 1.0, place, turn, **thrown))
    coefficients = (PairCoefficients("wood", "wood", 0.3, 0.5),)
    return Scenario("tumbling", "a test", (), (slab("floor", "wood"), *boxes), 1.2, coefficients)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("transform", ["mirrored", "reordered", "translated"])
@pytest.mark.parametrize(
    # the last four ended up to 3e-5 m apart: whether a landing was found depended on the order of pairs
    ("count", "seed"),
    [(1, 1), (2, 2), (2, 104), (4, 101), (4, 102), (4, 105)],
)
def test_tumbling_boxes_end_alike(registry, transform: str, count: int, seed: int, profile: str) -> None:
    """End at the transformed place from a transformed start."""
    scene = tumbling(count, seed)
    own = ends(registry, scene, profile)
    match transform:
        case "mirrored":
            there = {name: mirror(tuple(e)) for name, e in ends(registry, mirrored(scene), profile).items()}
        case "reordered":
            there = reordered_ends(registry, scene, range(count)[::-1], profile)
        case _:
            there = ends(registry, translated(scene, OFFSET), profile)
            there = {name: end - OFFSET for name, end in there.items()}
    assert farthest(own, there) <= TUMBLE_LIMITS[count]


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize(("count", "first"), [(2, 100), (4, 1)])
def test_most_tumbles_end_alike_elsewhere(registry, profile: str, count: int, first: int) -> None:
    """Of twelve throws, all but one end at the translated place, half of them to rounding; in one, rounding
    may decide which corner lands first."""
    apart = []
    for seed in range(first, first + 12):
        scene = tumbling(count, seed)
        there = ends(registry, translated(scene, OFFSET), profile)
        apart.append(
            farthest(ends(registry, scene, profile), {name: end - OFFSET for name, end in there.items()})
        )
    assert sorted(apart)[-2] <= TUMBLE_LIMITS[count]
    assert np.median(apart) <= TUMBLE_LIMITS[1]


@pytest.mark.parametrize("profile", PROFILES)
def test_a_break_does_not_know_the_order_of_its_balls(registry, profile: str) -> None:
    """Break fifteen balls in three orders: they end at the same places, to the bit where only the scene's
    order differs, and within 1e-12 m half a second later where that of the arrays does."""
    scene = catalogue()["break_15"]
    own = ends(registry, scene, profile)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(scene.bodies)).tolist()
        assert farthest(own, ends(registry, permuted(scene, order), profile)) == 0
        assert farthest(own, reordered_ends(registry, scene, order, profile)) <= 1e-12


@pytest.mark.parametrize("profile", PROFILES)
def test_a_heap_does_not_know_the_order_of_its_bodies(registry, profile: str) -> None:
    """Let fourteen bodies fall on each other in three orders: they rest at the same places, to the bit."""
    rng = np.random.default_rng(14)
    places = scattered(rng, 14, 0.05, 2, 0.02)
    bodies = [
        solid(f"body_{k}", random_shape(rng, 0.05, ("box", "sphere")), 1.0, vector(place))
        for k, place in enumerate(places)
    ]
    coefficients = (PairCoefficients("wood", "wood", 0.2, 0.5),)
    scene = Scenario("heap", "a test", (), (slab("floor", "wood"), *bodies), 1.0, coefficients)
    own = ends(registry, scene, profile)
    for seed in range(2):
        order = np.random.default_rng(seed).permutation(len(scene.bodies)).tolist()
        assert farthest(own, ends(registry, permuted(scene, order), profile)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("name", TOWERS)
def test_towers_stand_for_a_minute(registry, name: str, profile: str) -> None:
    """Move by at most 1e-6 m in 60 s, and gain at most 1e-9 of the energy over the floor."""
    scene = replace(catalogue()[name], duration=MINUTE)
    resting = tuple(Truth(t.body, "arcs", (Arc(0.0, t.arcs[0].position),)) for t in scene.truths)
    scene = replace(scene, truths=resting)
    recording = record(registry.engine("reference"), scene, Settings(profile, FRAME))
    assert np.linalg.norm(recording.position - recording.position[0], axis=2).max() <= 1e-6
    context = Context(recording, scene)
    energy = mechanical_energy(context, context.simulated)
    assert (energy - np.minimum.accumulate(energy)).max() <= 1e-9 * energy[0]

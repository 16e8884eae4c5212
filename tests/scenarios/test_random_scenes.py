"""Random scenes: the same for a seed, of all kinds and shapes, valid, and free of overlap at the start."""

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import State
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.random_scenes import DRIVEN_KINDS, KINDS, random_scene
from touchstone.scenarios.random_scenes.bodies import SHAPES, random_orientation, random_shape, support
from touchstone.scenarios.scenario import Capsule, Ellipsoid, Hull, Scenario

SEEDS = range(120)
FOUND = 1e-8
"""What the oracle's distances are good to [m]: bodies in contact are 1e-16 m apart or overlap by as much."""


def simulated(scenario: Scenario) -> list:
    """The simulated bodies."""
    return [body for body in scenario.bodies if body.kind == "simulated"]


def test_a_seed_gives_one_scene() -> None:
    """Build the same scene twice from a seed, another from the next, and name both by their seeds."""
    assert random_scene(17) == random_scene(17)
    assert random_scene(17) != random_scene(18)
    assert (random_scene(17).name, random_scene(17).seed) == ("random_17", 17)


def test_scenes_are_of_all_sizes_laws_and_kinds() -> None:
    """Draw every kind, every shape, 2 to 30 bodies, mass ratios to 1e4, e and mu of 0, of 1 and between."""
    scenes = [random_scene(seed) for seed in SEEDS]
    assert {scene.tags[1] for scene in scenes} == set(KINDS)
    counts = [len(simulated(scene)) for scene in scenes]
    assert (min(counts), max(counts) > 20, max(counts) <= 30) == (2, True, True)
    shapes = {type(body.pieces[0].shape).__name__ for scene in scenes for body in simulated(scene)}
    assert shapes == {"Sphere", "Box", "Capsule", "Ellipsoid", "Hull"}
    weights = [[body.mass for body in simulated(scene)] for scene in scenes]
    ratios = [max(masses) / min(masses) for masses in weights]
    assert max(ratios) == pytest.approx(1e4)
    assert sum(ratio == 1 for ratio in ratios) > 10
    for which in ("restitution", "friction"):
        values = np.array([getattr(scene.coefficients[0], which) for scene in scenes])
        assert ((values == 0).any(), (values == 1).any(), ((values > 0) & (values < 1)).any()) == (True,) * 3
    assert all(0.7 <= scene.duration <= 1.2 for scene in scenes)


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_can_be_asked_for(kind: str) -> None:
    """Build a scene of a kind whatever the seed would choose; what flies is isolated and has no floor."""
    scene = random_scene(5, kind)
    assert scene.tags[:2] == ("random", kind)
    assert ("isolated" in scene.tags) == (kind == "free") == all(b.kind == "simulated" for b in scene.bodies)
    assert bool(scene.trackers) == (kind == "press")


@pytest.mark.parametrize("kind", DRIVEN_KINDS)
def test_drivers_are_of_all_couplings(kind: str) -> None:
    """Build scenes with drivers whose path covers them, of many masses and stiffnesses, or a platform."""
    scenes = [random_scene(seed, kind) for seed in range(20)]
    if kind == "belt":
        assert all(any(map(surface_moves, scene.bodies)) for scene in scenes)
        return
    assert all(scene.trackers[0].times[-1] >= scene.duration for scene in scenes)
    roots = [scene.bodies[scene.body_index(scene.trackers[0].root)] for scene in scenes]
    assert {root.kind for root in roots} == {"prescribed" if kind == "shake" else "driven"}
    if kind not in ("shake", "person"):
        rates = [scene.trackers[0].stiffness / root.mass for scene, root in zip(scenes, roots)]
        assert max(rates) > 1000 * min(rates)
    jumps = {scene.trackers[0].interpolation for scene in scenes}
    assert jumps == ({"cubic", "held"} if kind == "person" else {"cubic"})


def at_start(registry: SimpleNamespace, scene: Scenario) -> State:
    """The state before the first step, hands as their trackers show them."""
    world = registry.engine("reference").build(scene, registry.settings("reference"))
    state = State(scene)
    world.read(state)
    world.close()
    return state


@pytest.fixture
def nearest(registry: SimpleNamespace, recordings: SimpleNamespace) -> Callable[[Scenario], float]:
    """Least distance of two bodies of a scene in its first frame, by the oracle [m]."""
    oracle = pytest.importorskip(
        "touchstone.adapters.oracles.overlap", reason="not installed: coal or python-fcl"
    )

    def measured(scene: Scenario) -> float:
        state, whole = at_start(registry, scene), recordings.recording(replace(scene, truths=()))
        first = replace(
            whole, time=whole.time[:1], position=state.position[None], orientation=state.orientation[None]
        )
        gaps = oracle.measure(first, scene).distance
        return min((float(gap[0]) for gap in gaps.values()), default=np.inf)

    return measured


def test_nothing_overlaps_at_the_start(nearest) -> None:
    """Find no overlap in any first frame by the oracle, and exact contact in many."""
    asked = [(seed, None) for seed in SEEDS] + [(seed, kind) for kind in DRIVEN_KINDS for seed in range(10)]
    found = {(seed, kind): nearest(random_scene(seed, kind)) for seed, kind in asked}
    assert {case: gap for case, gap in found.items() if gap <= -FOUND} == {}
    assert sum(gap < FOUND for gap in found.values()) > len(SEEDS) / 2


@pytest.mark.parametrize(
    "name",
    sorted({scene.name for tag in ("gallery", "probe", "seeded") for scene in tagged(tag)} | {"balls_box"}),
)
def test_scenes_of_the_catalogue_start_free_of_overlap(nearest, name: str) -> None:
    """Begin with no two bodies that may touch in each other."""
    assert nearest(catalogue()[name]) > -FOUND


@pytest.mark.parametrize("kind", SHAPES)
def test_supports_bound_points_of_the_shape(kind: str) -> None:
    """Reach as far as the farthest of many points of the surface, and within the ball that was asked for."""
    rng = np.random.default_rng(3)
    from scipy.spatial.transform import Rotation

    for _ in range(10):
        shape, turn = random_shape(rng, 0.1, (kind,)), random_orientation(rng)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        unit = rng.normal(size=(20_000, 3))
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        match shape:
            case Hull(vertices):
                points = np.array(vertices)
            case Ellipsoid(half_axes):
                points = unit * half_axes
            case Capsule(radius, half_length):
                points = radius * unit + np.outer(np.sign(unit[:, 2]), (0, 0, half_length))
            case _:
                half = getattr(shape, "half_extents", None)
                points = np.sign(unit) * half if half else shape.radius * unit
        world = Rotation.from_quat(turn, scalar_first=True).apply(points)
        # 20,000 points on a sphere are 1 degree apart: 2e-4 of the radius
        assert (world @ direction).max() == pytest.approx(support(shape, turn, tuple(direction)), rel=1e-3)
        assert np.linalg.norm(points, axis=1).max() <= 0.1 * (1 + 1e-12)

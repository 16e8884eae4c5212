"""Scenes elsewhere: mirrored, translated, permuted, moved a little; groups of pairs hold every pair once."""

import json
from dataclasses import replace
from itertools import combinations, product
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Manifest, PairFacts, State
from touchstone.adapters.recorder import manifest_json
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import Scenario
from touchstone.scenarios.transforms import mirrored, permuted, perturbed, shifted, translated
from touchstone.scenarios.truths.pair_groups import grouped

MIRROR = np.diag([-1.0, 1.0, 1.0])
SCENES = [random_scene(seed) for seed in range(30)]


def test_bodies_or_else_trackers_are_moved():
    """Move what is simulated; where nothing is, every keyframe of the trackers; leave the rest."""
    cradle, push = catalogue()["cradle"], catalogue()["wall_push"]
    shift = np.arange(15.0).reshape(5, 3) * 1e-3
    there = np.array([body.position for body in shifted(cradle, shift).bodies])
    np.testing.assert_allclose(there - [body.position for body in cradle.bodies], shift, atol=1e-15)
    one = np.array([[1e-3, 0.0, 0.0]])
    found = shifted(push, one)
    assert found.bodies == push.bodies
    moved = np.array(found.trackers[0].positions) - push.trackers[0].positions
    np.testing.assert_allclose(moved, np.tile(one, (len(moved), 1)), atol=1e-15)
    assert replace(found, trackers=push.trackers) == replace(push, expectations=(), truths=())


def test_a_perturbation_moves_every_simulated_body_by_its_size() -> None:
    """Move each simulated body by the size in seeded directions, by a rounding too, and nothing else."""
    for scene in SCENES[:6]:
        there = perturbed(scene, 1e-3, 4)
        for one, two in zip(scene.bodies, there.bodies):
            way = np.linalg.norm(np.subtract(two.position, one.position))
            assert way == pytest.approx(1e-3 if one.kind == "simulated" else 0.0, rel=1e-12)
            assert replace(two, position=one.position) == one
        assert there == perturbed(scene, 1e-3, 4) != perturbed(scene, 1e-3, 5)
    assert perturbed(SCENES[0], 1e-16, 4) != replace(SCENES[0], truths=(), expectations=())


def test_transforms_have_inverses() -> None:
    """Come back by mirroring twice, by the inverse order, and by the opposite way to rounding."""
    for scene in (*SCENES, *(catalogue()[name] for name in ("slip", "collide_sticks", "ball_snip"))):
        # a value that was published is of the scene as it stands
        scene = replace(scene, published=())
        assert mirrored(mirrored(scene)) == scene
        order = np.random.default_rng(1).permutation(len(scene.bodies))
        there = permuted(scene, order.tolist())
        assert [body.name for body in there.bodies] == [scene.bodies[k].name for k in order]
        assert permuted(there, np.argsort(order).tolist()) == scene
        back = translated(translated(scene, (1.0, -2.0, 0.5)), (-1.0, 2.0, -0.5))
        for one, two in zip(scene.bodies, back.bodies):
            np.testing.assert_allclose(two.position, one.position, atol=1e-15)


def test_no_order_but_of_all_bodies() -> None:
    """Refuse an order that leaves out a body."""
    with pytest.raises(ValueError, match="each of 0 to"):
        permuted(SCENES[0], [0] * len(SCENES[0].bodies))


def test_cones_have_no_mirror_image() -> None:
    """Refuse to mirror an avatar."""
    with pytest.raises(ValueError, match="reach cones"):
        mirrored(catalogue()["wall_push"])


INTEGRATED = ("ball_off_sphere_rough", "ellipsoid_rolls", "rattleback", "prism_rolls")


@pytest.mark.parametrize(
    "name",
    [
        *("slip", "collide_sticks", "bounce_e05", "incline_slides"),
        *(one.name for one in tagged("prescribed")),
        *INTEGRATED,
    ],
)
def test_truths_move_with_their_scene(name: str) -> None:
    """Work out the mirrored and the translated motion from the transformed truths."""
    scene, offset = catalogue()[name], (0.3, -0.2, 0.1)
    times = np.linspace(0, scene.duration, 20)
    reflected, moved = mirrored(scene), translated(scene, offset)
    # an integration ends its phases in other roundings
    slack = 1e-8 if name in INTEGRATED else 1e-12
    for k, truth in enumerate(scene.truths):
        own = motion(scene, truth, times)
        other, away = motion(reflected, reflected.truths[k], times), motion(moved, moved.truths[k], times)
        np.testing.assert_allclose(other.position, own.position @ MIRROR, atol=slack)
        np.testing.assert_allclose(other.velocity, own.velocity @ MIRROR, atol=slack)
        np.testing.assert_allclose(other.angular_velocity, -own.angular_velocity @ MIRROR, atol=slack)
        turn, image = (Rotation.from_quat(m.orientation, scalar_first=True).as_matrix() for m in (own, other))
        np.testing.assert_allclose(image, MIRROR @ turn @ MIRROR, atol=slack)
        np.testing.assert_allclose(away.position, own.position + offset, atol=slack)


def start(registry: SimpleNamespace, scene: Scenario) -> State:
    """The state before the first step, links of hands included."""
    world, state = registry.engine("reference").build(scene, registry.settings("reference")), State(scene)
    world.read(state)
    return state


def test_hands_are_mirrored_link_by_link(registry: SimpleNamespace) -> None:
    """Pose every link of a mirrored hand as the mirror image of its original."""
    seed = next(seed for seed in range(50) if random_scene(seed, "press").joints)
    scene = random_scene(seed, "press")
    own, image = start(registry, scene), start(registry, mirrored(scene))
    np.testing.assert_allclose(image.position, own.position @ MIRROR, atol=1e-12)
    turns = [Rotation.from_quat(s.orientation, scalar_first=True).as_matrix() for s in (own, image)]
    np.testing.assert_allclose(turns[1], MIRROR @ turns[0] @ MIRROR, atol=1e-12)


NAMES = [f"body-{k}" for k in range(9)]


@given(st.lists(st.sampled_from([None, 0.1, 0.2]), min_size=36, max_size=36))
def test_groups_hold_each_pair_once(facts):
    """Any table of facts comes back, with pairs that have none."""
    pairs = {pair: own for pair, own in zip(combinations(NAMES, 2), facts) if own is not None}
    groups = [(own, combinations(a, 2) if a == b else product(a, b)) for own, a, b in grouped(pairs)]
    found = [(tuple(sorted(pair)), own) for own, group in groups for pair in group]
    assert len(found) == len(pairs)
    assert dict(found) == pairs


def test_equal_bodies_are_few_groups():
    """60 balls and a floor: balls with balls, and balls with the floor."""
    balls = [f"ball {k}" for k in range(60)]
    pairs = dict.fromkeys(combinations(balls, 2), (0.5, 0.2))
    pairs |= {("floor", ball): (0.1, 0.3) for ball in balls}
    assert sorted((facts, *sorted((len(a), len(b)))) for facts, a, b in grouped(pairs)) == [
        ((0.1, 0.3), 1, 60),
        ((0.5, 0.2), 60, 60),
    ]


def test_a_manifest_of_a_thousand_bodies_is_small():
    """499,500 pairs took 45 MB a column; names and facts of two materials take 100 kB."""
    facts = tuple(
        PairFacts(f"a{i}", f"a{k}", 0.5 if (i + k) % 2 else 0.25, 0.3)
        for i, k in combinations(range(1000), 2)
    )
    text = manifest_json(Manifest("test", "1", "default", 0.01, {}, {}, facts))
    assert len(text) < 100_000
    assert len(json.loads(text)["pairs"]) == 3

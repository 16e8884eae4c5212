"""Plans in runs: what is left out changes nothing, what is asked for is marked, broken bounds are told."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.engines.reference.settings import PROFILES
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import Player, ready, record
from touchstone.scenarios.avatar.avatar import avatar_parts, standing_tracker
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.scenario import Scenario

FRAME = 1 / 60
SHORT = [name for name, one in catalogue().items() if "heap" not in one.tags and one.duration < 5]


def assert_same(one, two) -> None:
    """The same motion to the bit."""
    for name in ("position", "orientation", "linear_velocity", "angular_velocity", "joint_angle"):
        assert np.array_equal(getattr(one, name), getattr(two, name)), name


@pytest.mark.parametrize("name", SHORT)
def test_plan_and_all_effects_are_one(registry: SimpleNamespace, name: str) -> None:
    """Play a scene with all effects as with those that it needs, to the bit."""
    everything = Settings("balanced", FRAME, effects=PLANNED)
    whole = record(registry.engine("reference"), catalogue()[name], everything)
    assert_same(registry.played(name, "reference"), whole)


def random_scene(lab: SimpleNamespace, rng: np.random.Generator) -> Scenario:
    """Up to three balls and boxes, tilted, spun, thrown or at rest, and up to two driven balls on their ways,
    over a ground or in the open."""
    bodies = [lab.ground()] if rng.random() < 0.7 else []
    for k in range(rng.integers(0, 4)):
        place = (*rng.uniform(-1, 1, 2).tolist(), 0.15 + 0.4 * k)
        motion = {
            "linear_velocity": tuple((rng.normal(size=3) * rng.integers(0, 2)).tolist()),
            "angular_velocity": tuple((rng.normal(size=3) * rng.integers(0, 2)).tolist()),
        }
        if rng.random() < 0.6:
            bodies.append(lab.ball(f"b{k}", place, **motion))
            continue
        turned = rng.normal(size=4) if rng.random() < 0.5 else np.array((1.0, 0.0, 0.0, 0.0))
        motion["orientation"] = tuple((turned / np.linalg.norm(turned)).tolist())
        bodies.append(lab.block(f"b{k}", tuple(rng.uniform(0.03, 0.1, 3).tolist()), place, **motion))
    trackers = []
    for k in range(rng.integers(0, 3)) if rng.random() < 0.5 else ():
        start = rng.uniform((-1, -1, 1.6 + 0.3 * k), (1, 1, 1.7 + 0.3 * k))
        end = start + rng.normal(size=3) * rng.choice([0.0, 0.3, 1.5])
        hand = lab.ball(f"hand{k}", (0.0, 0.0, 0.0), mass=float(rng.uniform(0.2, 1)))
        bodies.append(replace(hand, kind="driven"))
        trackers.append(lab.still(hand.name, tuple(start.tolist()), tuple(end.tolist()), 0.5))
    gravity = (0.0, 0.0, -9.81 * float(rng.integers(0, 2)))
    law = {"e": float(rng.choice([0, 0.5])), "mu": float(rng.choice([0, 0.4]))}
    bodies = bodies or [lab.ball()]
    return lab.scene(*bodies, duration=0.5, gravity=gravity, trackers=tuple(trackers), **law)


def random_person(lab: SimpleNamespace, rng: np.random.Generator) -> Scenario:
    """A person who turns some chains anywhere within their hinges' limits, among up to two blocks."""
    parts = bodies, joints, chains = avatar_parts()
    tracker = standing_tracker(parts, (0.0, 0.0, 0.0), 1.0)
    limits = {joint.name: (joint.lower, joint.upper) for joint in joints}
    turned = {name for chain in chains if rng.random() < 0.6 for name in chain.joints}
    size = rng.uniform(0.1, 1.0)
    end = tuple(
        angle + size * (rng.uniform(*limits[name]) - angle) if name in turned else angle
        for name, angle in zip(tracker.joints, tracker.angles[0])
    )
    blocks = [
        lab.block(f"block{k}", tuple(rng.uniform(0.05, 0.5, 3).tolist()), tuple(place.tolist()), kind="fixed")
        for k, place in enumerate(rng.uniform((-1.2, -1.2, -0.8), (1.2, 1.2, 0.8), (rng.integers(0, 3), 3)))
    ]
    effects = ("self_collision",) if rng.random() < 0.5 else ()
    tracker = replace(tracker, angles=(tracker.angles[0], end))
    return lab.person(parts, bodies=(*bodies, *blocks), trackers=(tracker,), effects=effects)


def assert_sound(registry: SimpleNamespace, scene: Scenario, rng: np.random.Generator) -> None:
    """Play a random scene with its plan as with all effects; a bound that breaks counts as unsound."""
    profile = str(rng.choice(PROFILES))
    engine = registry.engine("reference")
    one, two = (record(engine, scene, Settings(profile, FRAME, effects=e)) for e in (None, PLANNED))
    assert_same(one, two)


@settings(max_examples=80, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_random_scenes_need_no_more_than_their_plan(lab, registry, seed: int) -> None:
    """Change nothing by forcing on what the plan of a random scene leaves out."""
    rng = np.random.default_rng(seed)
    assert_sound(registry, random_scene(lab, rng), rng)


def assert_person_sound(lab: SimpleNamespace, registry: SimpleNamespace, seed: int) -> None:
    """The same for a random person; one that is refused is not played."""
    rng = np.random.default_rng(seed)
    scene = random_person(lab, rng)
    try:
        assert_sound(registry, scene, rng)
    except AdapterError as error:
        if not any(words in str(error) for words in ("into each other", "starts stuck")):
            raise


@settings(max_examples=25, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_random_persons_need_no_more_than_their_plan(lab, registry, seed: int) -> None:
    """Change nothing by forcing on what the plan of a random person leaves out: cones, pieces, frames."""
    assert_person_sound(lab, registry, seed)


@pytest.mark.parametrize("name", ["reference", "dart", "bullet", "mujoco"])
@pytest.mark.parametrize("scene", ["fall", "tumble_stable", "spring", "bounce_e05"])
def test_engines_play_what_is_left(registry: SimpleNamespace, name: str, scene: str) -> None:
    """Play bodies that can meet nothing without their pieces, and say in the manifest what was left out."""
    reported = registry.played(scene, name).facts["effects"]
    assert tuple(reported) == PLANNED
    assert reported["contact"].startswith("needed" if scene == "bounce_e05" else "not needed")


@pytest.mark.parametrize("name", ["reference", "dart", "bullet", "mujoco"])
@pytest.mark.parametrize("scene", ["fall", "bounce_e05", "corner_slide"])
def test_engines_hold_the_shapes_that_are_left(registry: SimpleNamespace, name: str, scene: str) -> None:
    """Find in an engine, read back from it, as many shapes as the plan leaves pieces, and in what it cannot
    leave out its own words."""
    scenario = catalogue()[scene]
    player = ready(registry.engine(name), scenario, registry.settings(name))
    plan = planned(scenario)
    reported = player.world.describe().settings
    left = list(map(len, plan.pieces))
    if name == "mujoco":
        if plan.on("contact"):  # its steps take longer without the fixed pieces that meet nothing
            left = [len(b.pieces) if b.kind == "fixed" else n for b, n in zip(scenario.bodies, left)]
        # what can meet nothing has no bit in its masks, and no pair is listed that masks can give
        assert reported["explicit_pairs"] == 0
        assert (reported["shapes_that_pair_by_mask"] > 0) == plan.on("contact")
    assert reported["collision_shapes"] == sum(left)
    effects = player.recording().facts["effects"]
    player.world.close()
    kept = name == "mujoco" and plan.on("contact")
    assert ("keeps the fixed pieces" in effects["contact"]) == kept
    assert effects["inverse_kinematics"].endswith("has no such stage") == (name != "reference")
    assert effects["sleeping"].endswith("no such stage") == (name == "reference")


def test_results_are_marked_by_what_was_asked_for() -> None:
    """Name the effects in the label under which results are filed."""
    assert Settings("balanced", FRAME).label == "balanced"
    assert Settings("balanced", FRAME, effects=PLANNED).label == "balanced, effects=all"
    some = Settings("balanced", FRAME, effects=("gravity", "contact"))
    assert some.label == "balanced, effects=gravity+contact"


def test_without_gravity_and_contact(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Leave out what was asked for, needed or not."""
    scene = lab.scene(lab.ground(), lab.ball())
    engine = registry.engine("reference")
    hanging = record(engine, scene, Settings("balanced", FRAME, effects=("contact",)))
    assert (hanging.position[-1, 1] == scene.bodies[1].position).all()
    falling = record(engine, scene, Settings("balanced", FRAME, effects=("gravity",)))
    assert falling.position[-1, 1, 2] == pytest.approx(1 - 9.81 / 2)


def test_a_lie_ends_the_run(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """End a run in which a body leaves the bounds of its plan."""
    scene = lab.scene(lab.ball(), duration=0.5)
    player = ready(registry.engine("reference"), scene, Settings("balanced", FRAME))
    bounds = planned(scene).bounds
    lying = replace(planned(scene), bounds=replace(bounds, low=bounds.low + (0.0, 0.0, 0.5)))
    player = Player(player.world, scene, Settings("balanced", FRAME), lying)
    with pytest.raises(AdapterError, match="ball left the bounds of its plan"):
        player.play(30)

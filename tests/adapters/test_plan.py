"""Plans in runs: what is left out changes nothing, what is needed matters, broken bounds are errors."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from same_recording import SHORT, different

from touchstone.adapters.contract import AdapterError, Settings
from touchstone.adapters.engines.reference.settings import PAPER, PROFILES
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import Player, ready, record
from touchstone.adapters.recording import Recording
from touchstone.scenarios.avatar.avatar import avatar_parts, standing_tracker
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.plan import INERTIA_FACTOR
from touchstone.scenarios.scenario import Chain, Joint, Scenario

FRAME = 1 / 60


@pytest.mark.parametrize("name", SHORT)
def test_plan_and_all_effects_are_one(registry: SimpleNamespace, name: str) -> None:
    """Play a scene with all effects as with those that it needs, to the bit but for counters of work; so a
    second run repeats the first."""
    everything = Settings("balanced", FRAME, effects=PLANNED)
    whole = record(registry.engine("reference"), catalogue()[name], everything)
    assert different(registry.played(name, "reference"), whole) <= {"work"}


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
    assert change(one, two) == 0


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
@pytest.mark.parametrize("scene", ["fall", "bounce_e05", "corner_slide", "slap_3", "spring"])
def test_engines_hold_the_shapes_that_are_left(registry: SimpleNamespace, name: str, scene: str) -> None:
    """Find in an engine, read back from it, as many shapes as the plan leaves pieces, and in what it cannot
    leave out its own words."""
    scenario = catalogue()[scene]
    player = ready(registry.engine(name), scenario, registry.settings(name))
    plan = planned(scenario)
    reported = player.world.describe().settings
    left = list(map(len, plan.pieces))
    pieces = [len(body.pieces) for body in scenario.bodies]
    if name == "bullet":  # its steps take no less time without parts of bodies, or shapes of what moves
        left = [m if n or b.kind != "fixed" else 0 for b, m, n in zip(scenario.bodies, pieces, left)]
    if name == "mujoco":
        if plan.on("contact"):  # its steps take longer without the fixed pieces that meet nothing
            left = [m if b.kind == "fixed" else n for b, m, n in zip(scenario.bodies, pieces, left)]
        # what can meet nothing has no bit in its masks, and no pair is listed that masks can give
        assert reported["explicit_pairs"] == 0
        assert (reported["shapes_that_pair_by_mask"] > 0) == plan.on("contact")
    assert reported["collision_shapes"] == sum(left)
    effects = player.recording().facts["effects"]
    player.world.close()
    keeps = name == "bullet" or (name == "mujoco" and plan.on("contact"))
    assert (f"{name} keeps" in effects["contact"]) == keeps
    assert ("keeps it" in effects["gravity"]) == (name == "bullet" and not plan.on("gravity"))
    assert effects["inverse_kinematics"].endswith("has no such stage") == (name != "reference")
    assert effects["sleeping"].endswith("no such stage") == (name == "reference")


@pytest.mark.parametrize(("asked", "gravity", "pieces"), [("gravity", -9.81, 0), ("contact", 0.0, 1)])
def test_an_engine_keeps_nothing_that_the_caller_excludes(
    lab: SimpleNamespace, asked: str, gravity: float, pieces: int
) -> None:
    """Leave out contact, or gravity, that a falling ball needs: no engine keeps them."""
    scene = lab.scene(lab.ground(), lab.ball())
    left = planned(scene, (asked,)).applied(scene, ("fixed", "met", "moving", "gravity"))
    assert left.acting_gravity[2] == gravity
    assert len(left.bodies[1].pieces) == pieces


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


SPIN = {"angular_velocity": (0.0, 0.0, 1.0)}
FAST = {"linear_velocity": (0.0, 0.0, -50.0)}


def change(one: Recording, two: Recording) -> float:
    """Largest difference of positions [m], orientations, velocities and angles of hinges."""
    names = ("position", "orientation", "linear_velocity", "angular_velocity", "joint_angle")
    return max(float(np.abs(getattr(one, name) - getattr(two, name)).max(initial=0.0)) for name in names)


def moving(lab: SimpleNamespace) -> Scenario:
    """A person in the open who bends the left elbow."""
    parts = avatar_parts()
    tracker = standing_tracker(parts, (0.0, 0.0, 0.0), 1.0)
    bent = tuple(0.6 if "elbow" in name else angle for name, angle in zip(tracker.joints, tracker.angles[0]))
    return lab.person(parts, trackers=(replace(tracker, angles=(tracker.angles[0], bent)),))


def pushing(lab: SimpleNamespace, end: float) -> Scenario:
    """A driven ball that goes towards a wall at 0.5 m."""
    hand = replace(lab.ball("hand", (0.0, 0.0, 0.0)), kind="driven")
    wall = lab.block("wall", (0.1, 1.0, 1.0), (0.6, 0.0, 0.0), kind="fixed")
    return lab.scene(hand, wall, trackers=(lab.still("hand", (0.0, 0.0, 0.0), (end, 0.0, 0.0), 1.0),))


def lifting(lab: SimpleNamespace, cones: bool) -> Scenario:
    """A person in the open who shows the left arm farther back than its shoulder lets it go."""
    bodies, joints, chains = parts = avatar_parts()
    tracker = standing_tracker(parts, (0.0, 0.0, 0.0), 1.0)
    shown = {"left_shoulder_1": -0.9, "left_shoulder_2": 1.3, "left_shoulder_3": -3.0}
    back = tuple(shown.get(name, angle) for name, angle in zip(tracker.joints, tracker.angles[0]))
    free = tuple(replace(chain, cones=chain.cones if cones else ()) for chain in chains)
    parts = (bodies, joints, free)
    return lab.person(parts, trackers=(replace(tracker, angles=(tracker.angles[0], back)),))


def waving(lab: SimpleNamespace, apart: float) -> Scenario:
    """Two arms of one hinge each, so far from each other at their roots, that are shown turned inwards."""
    trunk = replace(lab.ball("trunk", (0.0, 0.0, 0.0)), kind="driven")
    arms = [replace(lab.ball(name, (0.0, 0.0, 0.0)), kind="driven") for name in ("left", "right")]
    arms = [replace(arm, pieces=(replace(arm.pieces[0], position=(0.0, 0.0, 0.3)),)) for arm in arms]
    joints = tuple(
        Joint(f"{arm.name}_hinge", "trunk", arm.name, (side * apart / 2, 0.0, 0.1), (0.0, 1.0, 0.0))
        for arm, side in zip(arms, (-1, 1))
    )
    chains = tuple(Chain(joint.child, (joint.name,)) for joint in joints)
    names = tuple(joint.name for joint in joints)
    still = lab.still("trunk", (0.0, 0.0, 0.0))
    tracker = replace(still, joints=names, angles=((0.0, 0.0), (0.6, -0.6)))
    effects = ("self_collision",)
    return lab.scene(trunk, *arms, joints=joints, chains=chains, trackers=(tracker,), effects=effects)


def cases(lab: SimpleNamespace) -> dict[str, tuple[Scenario, Scenario]]:
    """Of each effect a scene in which it alone matters, and one in which it is not needed."""
    ground, ball = lab.ground(), lab.ball()
    still = {"gravity": (0.0, 0.0, 0.0)}
    lying = {"position": (0.0, 0.0, 0.05)}
    rolls = lab.ball(**lying, linear_velocity=(1.0, 0.0, 0.0), angular_velocity=(0.0, 20.0, 0.0))
    spins, rests = (
        lab.ball(**lying, angular_velocity=(0.0, 0.0, 5.0)),
        lab.block("box", (0.05,) * 3, (0, 0, 0.05)),
    )
    pulled = {"gravity": (3.0, 0.0, -10.0), "mu": 0.2}
    return {
        "static_friction": (
            lab.scene(ground, rests, **pulled, laws={"static_friction": 0.4}),
            lab.scene(ground, rests, **pulled),
        ),
        "rolling_friction": (
            lab.scene(ground, rolls, mu=0.3, laws={"rolling_friction": 1e-3}),
            lab.scene(ground, rolls, mu=0.3),
        ),
        "torsional_friction": (
            lab.scene(ground, spins, mu=0.3, laws={"torsional_friction": 1e-3}),
            lab.scene(ground, spins, mu=0.3),
        ),
        "gravity": (lab.scene(ball), lab.scene(ball, **still)),
        "rotation": (lab.scene(lab.ball(**SPIN), **still), lab.scene(ball)),
        "restitution": (lab.scene(ground, ball, e=0.5), lab.scene(ground, ball)),
        "friction": (
            lab.scene(ground, lab.ball(position=(0, 0, 0.05), linear_velocity=(1.0, 0.0, 0.0)), mu=0.3),
            lab.scene(ground, lab.ball(position=(0, 0, 0.05), linear_velocity=(1.0, 0.0, 0.0))),
        ),
        "contact": (lab.scene(ground, ball), lab.scene(ball, lab.ball("other", (9.0, 0.0, 1.0)))),
        "overlap_removal": (pushing(lab, 0.6), pushing(lab, 0.05)),
        "virtual_coupling": (pushing(lab, 0.05), lab.scene(ball)),
        "inverse_kinematics": (catalogue()["wall_push"], moving(lab)),
        "attraction": (moving(lab), lab.scene(ball)),
        "reach_cones": (lifting(lab, cones=True), lifting(lab, cones=False)),
        "self_collision": (waving(lab, 0.3), waving(lab, 2.0)),
    }


OTHERS = ("sweep", "sleeping")
"""Effects with tests of their own: `sweep` below, `sleeping` in `test_sleeping.py`."""
EFFECTS = [effect for effect in PLANNED if effect not in OTHERS]


def test_cones_bound_a_tracker_that_leaves_them(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Follow a tracker out of a reach cone, where nothing is met, with the plan as with all effects."""
    engine, scene = registry.engine("reference"), lifting(lab, cones=True)
    one, two = (record(engine, scene, Settings("balanced", FRAME, effects=e)) for e in (None, PLANNED))
    assert change(one, two) == 0


@pytest.mark.parametrize("effect", EFFECTS)
def test_an_effect_that_alone_matters(lab: SimpleNamespace, registry: SimpleNamespace, effect: str) -> None:
    """Change the outcome by switching off what a scene needs, and not by switching on what it does not."""
    engine = registry.engine("reference")
    assert effect in cases(lab), f"add scenes for {effect!r} to `cases`"
    matters, idle = cases(lab)[effect]
    stages = planned(matters).stages
    assert effect in stages
    without = Settings("balanced", FRAME, effects=tuple(e for e in stages if e != effect))
    # a centimetre, or a hundredth of a radian: a difference that is seen
    assert (
        change(record(engine, matters, Settings("balanced", FRAME)), record(engine, matters, without)) > 0.01
    )
    stages = planned(idle).stages
    assert effect not in stages
    forced = Settings("balanced", FRAME, effects=tuple(e for e in PLANNED if e in stages or e == effect))
    assert planned(idle, forced.effects).on(effect)
    assert change(record(engine, idle, Settings("balanced", FRAME)), record(engine, idle, forced)) == 0


def test_sweep_alone_matters_to_a_bullet(lab: SimpleNamespace, registry: SimpleNamespace) -> None:
    """Let a fast ball through a thin plate where sweeps are switched off."""
    plate = lab.block("plate", (1.0, 1.0, 0.005), (0.0, 0.0, 0.0), kind="fixed")
    scene = lab.scene(plate, lab.ball(**FAST), duration=0.1)
    engine, stages = registry.engine("reference"), planned(scene).stages
    held = record(engine, scene, Settings("accurate", FRAME))
    assert held.position[-1, 1, 2] == pytest.approx(0.055, abs=1e-6)
    without = Settings("accurate", FRAME, effects=tuple(e for e in stages if e != "sweep"))
    assert record(engine, scene, without).position[-1, 1, 2] < -1


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("spin", [(0.0, 0.0, 0.0), (3.0, 0.1, 0.2)])
def test_flight_without_contact_is_the_same(
    lab: SimpleNamespace, registry: SimpleNamespace, profile: str, spin: tuple[float, float, float]
) -> None:
    """Fly to the bit as with all stages, for a tilted body with its centre of mass off its origin, spun or
    not, and say what was left out."""
    box = lab.block("box", (0.1, 0.05, 0.02), (0.1, 0.2, 3.0), linear_velocity=(1.0, 0.3, 2.0))
    tilted = replace(box, orientation=(0.6, 0.0, 0.8, 0.0), center_of_mass=(0.01, 0.02, 0.03))
    scene = lab.scene(replace(tilted, angular_velocity=spin), duration=0.5)
    engine = registry.engine("reference")
    one, two = (record(engine, scene, Settings(profile, FRAME, effects=e)) for e in (None, PLANNED))
    assert change(one, two) == 0
    reported = one.facts["settings"]["stages left out"]
    if profile == PAPER:
        assert reported == "none"
        return
    assert reported == ("drive, removal, contact" if any(spin) else "drive, removal, contact, rotation")
    assert two.facts["settings"]["stages left out"] == "none"


def test_an_orientation_that_scaling_changes_keeps_its_rotation(
    lab: SimpleNamespace, registry: SimpleNamespace
) -> None:
    """Run rotation of what does not turn where a turn by nothing scales its quaternion in the last digit."""
    rng = np.random.default_rng(0)
    for q in rng.normal(size=(200, 4)):
        q /= np.linalg.norm(q)
        if not (q / np.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) == q).all():
            break
    scene = lab.scene(replace(lab.ball(), orientation=tuple(q.tolist())), duration=0.2)
    engine = registry.engine("reference")
    player = ready(engine, scene, Settings("balanced", FRAME))
    assert "rotation" not in player.world.describe().settings["stages left out"]
    one, two = (record(engine, scene, Settings("balanced", FRAME, effects=e)) for e in (None, PLANNED))
    assert change(one, two) == 0


def test_held_from_turning(lab: SimpleNamespace) -> None:
    """Keep a spinning body from turning where rotation is switched off."""
    scene = lab.scene(lab.ball(**SPIN))
    applied = planned(scene, ("gravity",)).applied(scene).bodies[0]
    assert applied.angular_velocity == (0.0, 0.0, 0.0)
    assert applied.inertia[0][0] == INERTIA_FACTOR * scene.bodies[0].inertia[0][0]

"""Stages that a plan leaves out: per effect a scene that it alone matters to, and one that it does not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.settings import PAPER, PROFILES
from touchstone.adapters.motion_bounds import planned
from touchstone.adapters.recorder import ready, record
from touchstone.adapters.recording import Recording
from touchstone.scenarios.avatar.avatar import avatar_parts, standing_tracker
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.plan import INERTIA_FACTOR
from touchstone.scenarios.scenario import Chain, Joint, Scenario

FRAME = 1 / 60
SPIN = {"angular_velocity": (0.0, 0.0, 1.0)}
FAST = {"linear_velocity": (0.0, 0.0, -50.0)}


def change(one: Recording, two: Recording) -> float:
    """Largest difference of positions [m], orientations and velocities."""
    names = ("position", "orientation", "linear_velocity", "angular_velocity")
    return max(float(np.abs(getattr(one, name) - getattr(two, name)).max()) for name in names)


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

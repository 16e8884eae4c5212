"""The soak finds a planted bug, shrinks it to its smallest scene, and writes a file that replays it."""

from functools import partial

from scripted_engines import load_as

from touchstone.reports.studies.soak import Extent, shrunk, soak
from touchstone.scenarios.files.named import scenes_of_file
from touchstone.scenarios.random_scenes import random_scene
from touchstone.scenarios.scenario import BodyJoint, Sphere

SMALL = [k for k in range(120) if len(random_scene(k).bodies) < 4 and not random_scene(k).trackers]
"""Seeds of scenes that take little time."""


def small(number):
    """A random scene of up to three bodies."""
    return random_scene(SMALL[number])


def heavy_ball(scenario):
    """Planted bug: a ball that is the heaviest body fails from the tenth frame on, under gravity."""
    loose = [body for body in scenario.bodies if body.kind == "simulated"]
    heaviest = max(loose, key=lambda body: body.mass, default=None)
    ball = heaviest is not None and isinstance(heaviest.pieces[0].shape, Sphere)
    return ball and scenario.frame_count >= 10 and "gravity" in scenario.effects


def test_a_planted_bug_shrinks_to_its_core():
    """What is left is one ball, ten frames and gravity: no other body, friction, bounce or spin."""
    scenario = next(random_scene(seed) for seed in range(200) if heavy_ball(random_scene(seed)))
    assert len(scenario.bodies) > 2
    found = shrunk(scenario, heavy_ball)
    assert heavy_ball(found)
    assert [body.kind for body in found.bodies] == ["simulated"]
    assert found.frame_count == 10
    pair = found.coefficients[0]
    assert (pair.friction, pair.restitution) == (0.0, 0.0)


def test_a_mechanism_shrinks_to_its_joint():
    """What is left of a failing slider is its two bodies and it, without spring, damper and limits."""

    def slides(scenario):
        return any(joint.type == "slider" for joint in scenario.body_joints)

    made = (random_scene(seed, "mechanism") for seed in range(50))
    scenario = next(one for one in made if slides(one) and len(one.body_joints) > 2)
    found = shrunk(scenario, slides)
    (joint,) = found.body_joints
    assert joint == BodyJoint(joint.name, "slider", joint.parent, joint.child, joint.anchor, joint.axis)
    assert {body.name for body in found.bodies} == {joint.parent, joint.child} - {""}


def test_tries_are_bounded():
    """Shrinking stops after the tries that it is given, with a scene that fails."""
    calls = []
    found = shrunk(random_scene(3), lambda scene: bool(calls.append(scene)) or True, most=5)
    assert len(calls) == 5
    assert len(found.bodies) < len(random_scene(3).bodies)


def test_a_failure_is_written_with_the_line_that_replays_it(tmp_path):
    """An engine that explodes gives a scene file, whose scene is small, and a command that names it."""
    lines = []
    loader = partial(load_as, "explodes")
    extent = Extent(60.0, most=1, tries=12)
    found = soak(extent, "balanced", tmp_path, lines.append, loader, small)
    (failure,) = found.failures
    assert failure.outcome == "exploded"
    assert failure.command in lines[0]
    assert failure.command == f"touchstone run {failure.file} --engine reference --profile balanced"
    (scene,) = scenes_of_file(failure.file)
    assert scene.name in failure.file.stem
    assert len(scene.bodies) == failure.bodies <= len(small(0).bodies)
    assert scene.tags[:2] == ("soak", "random")  # invariants apply by tag
    assert scene.frame_count >= 3


def test_sound_scenes_leave_nothing(tmp_path):
    """Scenes without a failure are counted with their frames."""
    found = soak(Extent(60.0, most=3), "balanced", tmp_path, print, partial(load_as, "silent"), small)
    assert found.scenes == 3
    assert found.frames == sum(small(seed).frame_count for seed in range(3))
    assert found.failures == []
    assert not list(tmp_path.glob("*.toml"))

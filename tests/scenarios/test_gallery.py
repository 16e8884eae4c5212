"""The gallery's trackers; broken scene files are named; final positions in closed form."""

import importlib
import sys
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reports.metrics.posture import cone_excess, limit_excess
from touchstone.scenarios import catalogue as scenes
from touchstone.scenarios import families
from touchstone.scenarios.avatar.avatar import SEGMENTS, avatar_parts
from touchstone.scenarios.avatar.postures import person_tracker, reach, step
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.catalogue import catalogue, tagged
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.closed_form_ends import final_positions
from touchstone.scenarios.families import fall  # noqa: F401
from touchstone.scenarios.scenario import vector

SCENES = [scene.name for scene in tagged("gallery")]


@pytest.fixture
def posed(lab: SimpleNamespace) -> Callable[[tuple[float, ...]], np.ndarray]:
    """The bodies of a person at the world's origin, at given angles, by the reference's kinematics."""
    world = lab.build(lab.person())

    def pose(angles: tuple[float, ...]) -> np.ndarray:
        world.joints["angle"] = angles
        pose_links(world.bodies, world.joints, world.drivers[0])
        return world.bodies

    return pose


@pytest.mark.parametrize("name", SCENES)
def test_trackers_ask_nothing_a_person_cannot_do(name: str) -> None:
    """Stay within joint limits and reach cones in every displayed frame."""
    scenario = catalogue()[name]
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    angle = np.hstack([sample(tracker, times).angle for tracker in scenario.trackers])
    shown = SimpleNamespace(scenario=scenario, recording=SimpleNamespace(joint_angle=angle))
    assert limit_excess(shown).max() < 1e-12  # rounding of a spline through zeros
    for chain in scenario.chains:
        for cone in chain.cones:
            assert cone_excess(shown, cone).max() == 0


@pytest.mark.parametrize("name", SCENES)
def test_trackers_are_smooth(name: str) -> None:
    """Change no velocity by more in a frame than a quick movement does: 50 m/s^2 and 400 rad/s^2."""
    scenario = catalogue()[name]
    times = np.arange(scenario.frame_count + 1) / scenario.frame_rate
    for tracker in scenario.trackers:
        motion = sample(tracker, times)
        for rate, most in ((motion.linear_velocity, 50.0), (motion.rate, 400.0)):
            assert np.abs(np.diff(rate, axis=0)).max() * scenario.frame_rate < most


@pytest.mark.parametrize("side", [1, -1])
def test_a_hand_is_where_it_reaches(side: int, posed) -> None:
    """Put the hand's middle at random points before the person, by the reference's kinematics."""
    rng = np.random.default_rng(5)
    points = rng.uniform((0.2, 0.0, 0.2), (0.45, 0.3, 0.6), (20, 3)) * (1, side, 1)
    times = np.linspace(0, 1, len(points))
    tracker = person_tracker(times, np.zeros((len(points), 2)), 0.0, reach(side, points))
    names = [body.name for body in avatar_parts()[0]]
    hand = names.index("left_hand" if side > 0 else "right_hand")
    segment = SEGMENTS["hand"]
    for point, angles in zip(points, tracker.angles):
        bodies = posed(angles)
        middle = bodies[hand]["position"] - bodies[hand]["rotation"][:, 2] * segment.length * segment.center
        np.testing.assert_allclose(middle, point, atol=1e-12)  # rounding of nine links


def test_a_step_keeps_the_sole_level(posed) -> None:
    """Swing a leg forward and back: the foot's x stays level while the ankle can follow."""
    forward, knee = np.array((-0.2, 0.0, 0.3)), np.array((0.1, 0.0, 0.2))
    angles = step(1, forward, knee)
    tracker = person_tracker(np.arange(3.0), np.zeros((3, 2)), 0.0, angles)
    foot = [body.name for body in avatar_parts()[0]].index("left_foot")
    for row in tracker.angles:
        assert posed(row)[foot]["rotation"][2, 0] == pytest.approx(0.0, abs=1e-12)


RETURNS = "from touchstone.scenarios.catalogue import scene\n\n\n@scene\ndef odd():\n    return {}\n"


@pytest.fixture
def broken(tmp_path, monkeypatch):
    """Add a file to the families; returns the names of the scenes that are left, and the lines told."""
    (tmp_path / "fall.py").touch()  # imported already: the family of the package
    monkeypatch.setattr(families, "__path__", [str(tmp_path)])

    def add(text: str):
        (tmp_path / "zz_broken.py").write_text(text)
        sys.modules.pop("touchstone.scenarios.families.zz_broken", None)
        importlib.invalidate_caches()
        scenes.built.cache_clear()
        return set(scenes.catalogue()), scenes.faults()

    yield add
    scenes.built.cache_clear()


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("import no_such_package\n", "families/zz_broken.py:1: ModuleNotFoundError: No module named"),
        ("x = (\n", "families/zz_broken.py:1: SyntaxError: '(' was never closed"),
        ("\n\nraise SystemExit(3)\n", "families/zz_broken.py:3: SystemExit: 3"),
        (RETURNS.format(3), "families/zz_broken.py: scene odd returns int, expected Scenario or several"),
        (RETURNS.format("(1,)"), "families/zz_broken.py: scene odd returns int, expected Scenario"),
        (RETURNS.format("1 / 0"), "families/zz_broken.py: scene odd:6: ZeroDivisionError: division by zero"),
        (
            "from touchstone.scenarios.families.fall import fall\n",
            "families/zz_broken.py: two scenes are called 'fall'",
        ),
        (
            "from dataclasses import replace\nfrom touchstone.scenarios.families.fall import fall as f\n"
            + RETURNS.format("replace(f(), frame_rate=0)"),
            "families/zz_broken.py: scene odd: scenario 'fall': frame_rate: found 0, expected a whole number",
        ),
    ],
)
def test_one_line_names_what_is_broken(broken, text, line):
    """Name file, line and function; all other scenes can be played."""
    left, lines = broken(text)
    assert left == {"fall"}
    assert lines[0].startswith(line)
    assert all("\n" not in one for one in lines)


COVERED = [name for name, scenario in catalogue().items() if final_positions(scenario) is not None]


def moved(scenario, name, shift):
    bodies = tuple(
        replace(body, position=vector(np.array(body.position) + shift)) if body.name == name else body
        for body in scenario.bodies
    )
    return replace(scenario, bodies=bodies, truths=(), expectations=())


@pytest.mark.parametrize("name", COVERED)
def test_ends_are_those_of_the_truth(name):
    """End where the scene's truth ends."""
    scenario = catalogue()[name]
    ends = final_positions(scenario)
    for k, truth in enumerate(scenario.truths):
        must_be = motion(scenario, truth, np.array([0.0, scenario.duration])).position[-1]
        # truths count bounces until 1e-6 m/s; two ways to add the same times
        np.testing.assert_allclose(ends[k], must_be, atol=1e-12)


def test_a_ball_that_misses_flies_on():
    """Let balls pass each other that are farther off than their diameters."""
    scenario = moved(catalogue()["collide_oblique"], "mover", (0.0, 0.1, 0.0))
    ends, mover = final_positions(scenario), scenario.bodies[0]
    way = np.array(mover.linear_velocity) * scenario.duration
    np.testing.assert_allclose(ends, [mover.position + way, scenario.bodies[1].position], atol=1e-15)


def test_a_head_on_hit_forgets_how_far_it_came():
    """Stop a ball that meets its equal head on with e = 1 where it always stops; send the other off later."""
    scenario = replace(catalogue()["collide_ratio_1e3"], truths=())
    bodies = (replace(scenario.bodies[0], mass=1.0), scenario.bodies[1])
    scenario = replace(scenario, bodies=bodies)
    shift = np.array([-1e-3, 0.0, 0.0])
    change = final_positions(moved(scenario, "mover", shift)) - final_positions(scenario)
    # the mover stops a diameter before the target's place; the target starts later, by 1e-3 m of its way
    np.testing.assert_allclose(change, [np.zeros(3), shift], atol=1e-15)

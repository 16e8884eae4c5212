"""Fast driven bodies stay on the side they came from, and slow ones slide as before."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.oracles.overlap import measure
from touchstone.adapters.recorder import record
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE
from touchstone.reference_impl.frame import step
from touchstone.scenarios.avatar.avatar import SHOULDER, arm_with_hand_parts
from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.avatar.postures import person_tracker, reach
from touchstone.scenarios.effects import PLANNED
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import ORIGIN, Body, Scenario, Tracker

SWEPT = ("balanced", "accurate")
DISCRETE = "detection=discrete"
FRAME = 1 / 60
RADIUS = 0.01
ORACLE_SLACK = 2e-8
"""Beyond the tolerance [m]: what coal's own tolerance leaves."""
TIMES = np.array((0.0, 10.0, 11.0, 60.0)) / 60
"""A jump within a frame [s]."""
HANGING, AHEAD = (0.18, -0.22, SHOULDER[2] - 0.58), (0.45, -0.2, SHOULDER[2] - 0.1)
"""Where a right hand hangs, and where it is held forward, from the torso [m]."""


def driven_ball(lab: SimpleNamespace) -> Body:
    """A driven ball of 2 cm."""
    return replace(lab.ball("driven", (0.0, 0.0, 0.0), radius=RADIUS, mass=0.4), kind="driven")


def wall(lab: SimpleNamespace, half: float, kind: str = "fixed") -> Body:
    """A wall across x = 0."""
    return lab.block("wall", (half, 1.0, 1.0), (0.0, 0.0, 0.0), kind=kind)


def thrown(lab: SimpleNamespace, profile: str, half: float, end, kind: str = "fixed", changes=()):
    """The world, without gravity, after one frame in which the tracker jumps from x = -0.2 to `end`."""
    tracker = lab.still("driven", (-0.2, 0.0, 0.0))
    scenario = lab.scene(driven_ball(lab), wall(lab, half, kind), trackers=(tracker,), gravity=ORIGIN)
    world = lab.build(scenario, profile, FRAME, *changes)
    world.drivers[0]["target_position"] = end
    step(*world)
    return world


@pytest.mark.parametrize("half", [5e-4, 0.02, 0.1])
@pytest.mark.parametrize("speed", [1.0, 3.0, 100.0])
@pytest.mark.parametrize("profile", SWEPT)
def test_a_jump_through_a_wall_ends_before_it(lab: SimpleNamespace, profile: str, half: float, speed: float):
    """Stay on the near side of a wall of 1 mm to 20 cm, free, however far the tracker jumped."""
    world = thrown(lab, profile, half, (speed, 0.0, 0.0))
    x = world.drivers[0]["position"][0]
    assert -0.2 < x <= -half - RADIUS + 1e-6
    assert x == pytest.approx(-half - RADIUS, abs=1e-5)
    assert world.drivers[0]["is_free"] == 1
    assert lab.counters(world)["unconverged"] == 0
    # without the sweep it passes
    passing = thrown(lab, profile, half, (speed, 0.0, 0.0), changes=(DISCRETE,))
    assert passing.drivers[0]["position"][0] > half


def test_a_free_jump_is_left_alone(lab: SimpleNamespace) -> None:
    """Go as far as without the sweep, to the bit, where nothing is in the way."""
    far = (-1.0, 5.0, 0.3)
    ends = [
        thrown(lab, profile, 0.02, far, changes=changes).drivers[0]["position"].copy()
        for profile, changes in (("accurate", ()), ("balanced", ()), ("balanced", (DISCRETE,)))
    ]
    assert ends[0][1] > 0.5
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])


@pytest.mark.parametrize("profile", SWEPT)
def test_a_simulated_body_stops_a_jump_too(lab: SimpleNamespace, profile: str) -> None:
    """Meet a simulated board in the way and push it, rather than appear behind it."""
    world = thrown(lab, profile, 0.02, (3.0, 0.0, 0.0), kind="simulated")
    assert world.drivers[0]["position"][0] < world.bodies[1]["position"][0]
    assert world.bodies[1]["velocity"][0] > 0.1


def test_sliding_is_not_held_up(lab: SimpleNamespace) -> None:
    """Slide along a wall as far as without the sweep while the tracker is 1 cm inside."""
    ends = []
    for profile in ("accurate", "balanced"):
        scenario = lab.scene(
            driven_ball(lab),
            wall(lab, 0.05),
            trackers=(lab.still("driven", (-0.0601, -0.5, 0.0), (-0.05, 0.5, 0.0)),),
        )
        world = lab.build(scenario, profile)
        for frame in range(30):
            for name, at in (("old_target_position", frame), ("target_position", frame + 1)):
                world.drivers[0][name] = (-0.05, -0.5 + at / 30, 0.0)
            step(*world)
        ends.append(world.drivers[0]["position"].copy())
    assert ends[0][1] > 0.2
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-5)


@pytest.mark.parametrize("turn", [0.0, 2.5])
def test_a_hand_stays_on_its_side(lab: SimpleNamespace, turn: float) -> None:
    """Keep all parts of a hand before a wall that its tracker jumps through, turning too."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    start = (-0.4, 0.0, 0.0)
    glove = Tracker(
        root="palm",
        joints=names,
        times=(0.0, 1.0),
        positions=(start, start),
        orientations=((1.0, 0.0, 0.0, 0.0),) * 2,
        angles=((0.1,) * len(names),) * 2,
    )
    bodies = (*links, wall(lab, 0.005))
    scenario = Scenario("test", "a test", (), bodies, 1.0, TABLE_1, joints=joints, trackers=(glove,))
    sides = {}
    for name, changes in (("accurate", ()), ("balanced", ()), ("discrete", (DISCRETE,))):
        world = lab.build(scenario, "accurate" if name == "accurate" else "balanced", FRAME, *changes)
        world.drivers[0]["target_position"] = (2.0, 0.0, 0.0)
        world.drivers[0]["target_orientation"] = (np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2))
        world.joints["target_angle"] = 0.3
        step(*world)
        hand = world.bodies["driver"] >= 0
        assert world.drivers[0]["is_free"] == 1
        sides[name] = world.bodies["center"][hand, 0]
    assert (sides["accurate"] < 0).all()
    assert (sides["balanced"] < 0).all()
    assert sides["discrete"].max() > 0


JUMPS = {
    # how far the torso jumps ahead, where the right hand is before and after, and where the wall begins [m]
    "upright": (1.0, HANGING, HANGING, 0.5),
    "arm ahead": (1.0, AHEAD, AHEAD, 0.75),
    "arm alone": (0.0, HANGING, AHEAD, 0.32),
}


def behind_thin_wall(lab: SimpleNamespace, jump: str, farther: float = 0.0) -> tuple[Scenario, float]:
    """A scene in which a tracker jumps through a wall of 5 cm, and where that begins [m]."""
    if jump == "arm and fingers":
        way, face, person = 1.0 + farther, 0.3, lab.person(arm_with_hand_parts())
        still = person.trackers[0]
        places = tuple((x, *still.positions[0][1:]) for x in (0.0, 0.0, way, way))
        rest = {
            "orientations": still.orientations[:1] * 4,
            "angles": still.angles[:1] * 4,
            "interpolation": "cubic",
        }
        tracker = replace(still, times=tuple(TIMES.tolist()), positions=places, **rest)
    else:
        way, before, after, face = JUMPS[jump]
        way += farther
        person = lab.person()
        places = np.column_stack(((0.0, 0.0, way, way), np.zeros(4)))
        hand = np.array((before, before, after, after))
        tracker = person_tracker(TIMES, places, 0.0, reach(-1, hand))
    board = lab.block("wall", (0.025, 3.0, 3.0), (face + 0.025, 0.0, 0.0), kind="fixed")
    return replace(person, bodies=(*person.bodies, board), trackers=(tracker,)), face


@pytest.mark.parametrize("jump", [*JUMPS, "arm and fingers"])
def test_an_avatar_stays_on_its_side(lab: SimpleNamespace, jump: str) -> None:
    """Keep all links of a person, or of an arm with a hand, before a wall that its tracker jumps through."""
    scenario, face = behind_thin_wall(lab, jump)
    links = list(scenario.links(scenario.trackers[0]))
    for profile in SWEPT:
        recording = record(ReferenceEngine(), scenario, Settings(profile, 1 / 60, effects=PLANNED))
        assert recording.position[:, links, 0].max() < face
        assert measure(recording, scenario).overlap().max() <= OVERLAP_TOLERANCE + ORACLE_SLACK
        assert not recording.work[:, list(recording.work_names).index("gave_up")].any()


@pytest.mark.parametrize("jump", ["upright", "arm and fingers"])
def test_an_avatar_passes_without_the_sweep(lab: SimpleNamespace, jump: str) -> None:
    """Pass through the wall where only the ends of frames are tested, in at least one of three jumps: a frame
    may happen to end in the wall."""
    ends = []
    for farther in (-0.2, 0.0, 0.2):
        scenario, face = behind_thin_wall(lab, jump, farther)
        settings = Settings("balanced", 1 / 60, changes=(DISCRETE,), effects=PLANNED)
        ends.append(record(ReferenceEngine(), scenario, settings).position[-1, 0, 0] - face)
    assert max(ends) > 0.05

"""The driven loop: translation out of overlap, the way back, giving up."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.broad_phase.detection import place_pieces
from touchstone.reference_impl.core.conventions import OVERLAP_TOLERANCE, SIMULATED
from touchstone.reference_impl.kinematics.skeleton import pose_links
from touchstone.reference_impl.posture.overlap_removal import remove_overlap
from touchstone.scenarios.avatar.hand import hand_parts
from touchstone.scenarios.materials import TABLE_1
from touchstone.scenarios.scenario import Body, Scenario, Tracker

RADIUS = 0.05
TRANSLATIONS = ("balanced", "accurate")
"""Profiles that translate by Eq. 1 and by least motion."""


def driven_balls(lab: SimpleNamespace, starts, *others, profile: str = "balanced"):
    """Driven balls of 0.4 kg, bodies 0, 1, ..., that start at `starts` among others."""
    names = [f"driven_{k}" for k in range(len(starts))]
    trackers = tuple(lab.still(name, start) for name, start in zip(names, starts))
    balls = [replace(lab.ball(name, (0.0, 0.0, 0.0), mass=0.4), kind="driven") for name in names]
    return lab.build(lab.scene(*balls, *others, trackers=trackers), profile)


def remove(world) -> bool:
    """Run the removal; whether all drivers are free."""
    world.state["counters"][:] = 0
    for driver in world.drivers:
        pose_links(world.bodies, world.joints, driver)
    remove_overlap(world.of_stages())
    return bool(world.drivers["is_free"].all())


def walls(lab: SimpleNamespace, gap: float):
    """Two fixed blocks that leave a slot of width `gap` at y < 0, from x = -gap / 2 on."""
    half = (0.5, 1.0, 1.0)
    return [lab.block(f"wall_{s}", half, (s * (0.5 + gap / 2), -1.0, 0.0), kind="fixed") for s in (-1, 1)]


def slanted(lab: SimpleNamespace, name: str, normal) -> Body:
    """A fixed block with a face through the origin and this normal in the xz plane."""
    half, tilt = (1.5, 1.5, 0.5), np.arctan2(normal[0], normal[2])
    orientation = (float(np.cos(tilt / 2)), 0.0, float(np.sin(tilt / 2)), 0.0)
    position = tuple(float(-half[2] * x) for x in normal)
    return lab.block(name, half, position, kind="fixed", orientation=orientation)


def corner_world(lab: SimpleNamespace, profile: str, walls: int):
    """A driven ball 1 cm deep in ground and one or two walls, all perpendicular."""
    half = (0.5, 1.0, 1.0)
    others = [
        lab.block("wall_x", half, (-0.5, 0.0, 1.0), kind="fixed"),
        lab.block("wall_y", (1.0, 0.5, 1.0), (0.0, -0.5, 1.0), kind="fixed"),
    ]
    world = driven_balls(lab, [(0.2, 0.2, 0.2)], lab.ground(), *others[:walls], profile=profile)
    deep = RADIUS - 0.01
    world.drivers[0]["position"] = (deep, deep if walls == 2 else 0.3, deep)
    return world


@pytest.mark.parametrize(("walls", "rounds", "share"), [(1, 14, 1 / 2), (2, 23, 2 / 3)])
def test_a_corner_shrinks_per_round(lab: SimpleNamespace, walls: int, rounds: int, share: float) -> None:
    """Free a ball of 1 cm depth in ground and walls once 1e-2 / 2^14 < 1e-6 m, or 1e-2 (2/3)^23."""
    world = corner_world(lab, "balanced", walls)
    assert remove(world)
    assert lab.counters(world)["rounds"] == rounds
    expected = RADIUS - 0.01 * share**rounds
    np.testing.assert_allclose(world.drivers[0]["position"][:: 3 - walls], expected, rtol=1e-6)


@pytest.mark.parametrize("walls", [1, 2])
def test_least_motion_leaves_a_corner_in_one_round(lab: SimpleNamespace, walls: int) -> None:
    """Free a ball of 1 cm depth in ground and one or two walls in one round, to rounding."""
    world = corner_world(lab, "accurate", walls)
    assert remove(world)
    assert lab.counters(world)["rounds"] == 1
    expected = (RADIUS, RADIUS if walls == 2 else 0.3, RADIUS)
    # the depth is exact to rounding of the ground's size, 40 m
    np.testing.assert_allclose(world.drivers[0]["position"], expected, atol=1e-12)


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_a_wedge_of_ten_degrees(lab: SimpleNamespace, profile: str) -> None:
    """Leave walls with 170 degrees between their normals in one round by least motion.

    Eq. 1 shortens the depth by 0.8 % a round: it takes the way back.
    """
    half = np.radians(85)
    sides = [slanted(lab, f"wall_{s}", (s * np.sin(half), 0.0, np.cos(half))) for s in (-1, 1)]
    world = driven_balls(lab, [(0.0, 0.0, 1.0)], *sides, profile=profile)
    world.drivers[0]["position"] = (0.0, 0.0, (RADIUS - 0.01) / np.cos(half))
    assert remove(world)
    counted = lab.counters(world)
    if profile == "accurate":
        assert (counted["rounds"], counted["way_back"]) == (1, 0)
    else:
        assert (counted["rounds"], counted["way_back"]) == (8, 1)
    # both end where the ball touches both walls: straight up is the way out and the way back
    height = world.drivers[0]["position"][2]
    assert RADIUS - height * np.cos(half) <= OVERLAP_TOLERANCE
    assert height == pytest.approx(RADIUS / np.cos(half), abs=2e-5)


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_almost_opposing_walls_take_the_way_back(lab: SimpleNamespace, profile: str) -> None:
    """Send no ball 1.1 m away for a depth of 1 cm: normals a degree from opposing count as such."""
    half = np.radians(89.5)
    sides = [slanted(lab, f"wall_{s}", (s * np.sin(half), 0.0, np.cos(half))) for s in (-1, 1)]
    world = driven_balls(lab, [(0.0, 0.0, 2.0)], *sides, profile=profile)
    world.drivers[0]["position"] = (0.0, 0.0, 1.0)
    assert remove(world)
    assert lab.counters(world)["way_back"] == 1


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_opposing_depths_take_the_way_back(lab: SimpleNamespace, profile: str) -> None:
    """Leave the cycle of depths 2 and 1 cm for the last pose that fits, on the line back to the free one."""
    world = driven_balls(lab, [(0.0, 0.5, 0.0)], *walls(lab, 2 * RADIUS - 0.03), profile=profile)
    entry = np.array([0.005, -0.5, 0.0])
    world.drivers[0]["position"] = entry
    world.drivers[0]["velocity"] = (0.3, -2.0, 0.1)
    assert remove(world)
    counted = lab.counters(world)
    assert (counted["way_back"], counted["gave_up"]) == (1, 0)
    # two opposing normals have no least motion
    assert counted["rounds"] == (0 if profile == "accurate" else 8)
    position = world.drivers[0]["position"]
    along = (0.5 - position[1]) / 1.0
    np.testing.assert_allclose(position, (along * entry[0], 0.5 - along, 0.0), atol=1e-12)
    # the ball meets the nearer edge of the slot, at x = 0.035, y = 0
    depth = RADIUS - np.hypot(0.035 - position[0], position[1])
    # 24 halvings of 1 m are 6e-8 m
    assert OVERLAP_TOLERANCE - 1e-7 <= depth <= OVERLAP_TOLERANCE
    # what pointed into that edge is gone from the velocity
    out = np.array([position[0] - 0.035, position[1], 0.0])
    assert world.drivers[0]["velocity"] @ out / np.linalg.norm(out) == pytest.approx(0, abs=1e-12)
    assert world.drivers[0]["velocity"][2] == 0.1


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_no_free_pose_gives_up_where_it_stood(lab: SimpleNamespace, profile: str) -> None:
    """Report giving up, and keep the pose at entry, when there never was a free pose."""
    start = (0.005, -0.5, 0.0)
    world = driven_balls(lab, [start], *walls(lab, 2 * RADIUS - 0.03), profile=profile)
    assert world.drivers[0]["has_free"] == 0
    turned = np.array([0.8, 0.0, 0.6, 0.0])
    world.drivers[0]["orientation"] = turned
    assert not remove(world)
    counted = lab.counters(world)
    assert (counted["way_back"], counted["gave_up"]) == (0, 1)
    np.testing.assert_allclose(world.bodies[0]["position"], start, atol=1e-15)
    np.testing.assert_allclose(world.bodies[0]["orientation"], turned, atol=1e-15)


def test_a_hand_resolves_no_overlap_with_simulated_bodies(lab: SimpleNamespace) -> None:
    """Leave a simulated body in a hand's place to the simulated loop, where both move."""
    blocker = lab.block("blocker", (0.1, 0.1, 0.1), (3.0, 0.0, 0.0))
    world = driven_balls(lab, [(0.0, 0.5, 0.0)], *walls(lab, 2 * RADIUS + 0.1), blocker)
    world.bodies[3]["position"] = (0.0, 0.5, 0.0)
    place_pieces(world.bodies, world.pieces, world.vertices, SIMULATED)
    assert remove(world)
    assert lab.counters(world)["rounds"] == 0
    np.testing.assert_allclose(world.bodies[0]["position"], (0.0, 0.5, 0.0), atol=1e-15)


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_the_far_side_of_an_obstacle_is_no_way_out(lab: SimpleNamespace, profile: str) -> None:
    """Take the way back where the shortest translation leads to the far side of an obstacle."""
    face = 0.06
    box = lab.block("box", (0.09, 1.0, 1.0), (face + 0.09, 0.0, 0.0), kind="fixed")
    world = driven_balls(lab, [(0.0, 0.0, 0.0)], box, profile=profile)
    world.drivers[0]["position"] = (0.17, 0.0, 0.0)
    assert remove(world)
    assert lab.counters(world)["way_back"] == 1
    np.testing.assert_allclose(world.bodies[0]["position"], (face - RADIUS, 0, 0), atol=2e-6)


def test_only_the_velocity_into_the_obstacle_stops(lab: SimpleNamespace) -> None:
    """Take out the downward velocity over the ground and leave the rest."""
    world = driven_balls(lab, [(0.0, 0.0, 0.2)], lab.ground())
    world.drivers[0]["position"] = (0.0, 0.0, 0.04)
    world.drivers[0]["velocity"] = (1.0, 2.0, -3.0)
    assert remove(world)
    np.testing.assert_allclose(world.drivers[0]["velocity"], (1, 2, 0), atol=1e-12)
    world.drivers[0]["velocity"] = (1.0, 2.0, 3.0)
    assert remove(world)
    np.testing.assert_allclose(world.drivers[0]["velocity"], (1, 2, 3), rtol=0, atol=0)


def test_two_drivers_share_the_velocity_of_approach(lab: SimpleNamespace) -> None:
    """Leave both drivers of a touching pair their mean velocity along the normal, the rest as it was."""
    world = driven_balls(lab, ((-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)))
    world.drivers["position"][:, 0] = (-0.04, 0.04)
    world.drivers["velocity"] = ((3.0, 1.0, 0.0), (-1.0, 0.0, 2.0))
    assert remove(world)
    np.testing.assert_allclose(world.drivers["velocity"], ((1, 1, 0), (1, 0, 2)), atol=1e-12)


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_two_drivers_part_by_halves(lab: SimpleNamespace, profile: str) -> None:
    """Part two driven balls that overlap by 2 cm: 1 cm each, at once."""
    world = driven_balls(lab, ((-0.1, 0.0, 0.0), (0.1, 0.0, 0.0)), profile=profile)
    world.drivers["position"][:, 0] = (-0.04, 0.04)
    assert remove(world)
    np.testing.assert_allclose(world.drivers["position"][:, 0], (-0.05, 0.05), atol=1e-12)
    counted = lab.counters(world)
    assert (counted["rounds"], counted["way_back"], counted["gave_up"]) == (2, 0, 0)


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_what_is_left_is_the_later_drivers(lab: SimpleNamespace, profile: str) -> None:
    """Part three driven balls in a row, where the halves of the middle one cancel."""
    starts = ((-0.2, 0.0, 0.0), (0.0, 0.0, 0.0), (0.2, 0.0, 0.0))
    world = driven_balls(lab, starts, profile=profile)
    world.drivers["position"][:, 0] = (-0.08, 0.0, 0.08)
    assert remove(world)
    # outer ones by half, then the middle one by the half left on its left, then the last one by the rest
    np.testing.assert_allclose(world.drivers["position"][:, 0], (-0.09, 0.01, 0.11), atol=1e-12)


@pytest.mark.parametrize("profile", TRANSLATIONS)
@pytest.mark.parametrize("walled", [0, 1])
def test_a_driver_at_a_wall_is_not_crushed(lab: SimpleNamespace, profile: str, walled: int) -> None:
    """Free two drivers when one pushes the other into a wall, whichever comes first: the wall stays."""
    wall = lab.block("wall", (0.5, 1.0, 1.0), (0.55, 0.0, 0.0), kind="fixed")
    starts = ((-0.11, 0.0, 0.0), (0.0, 0.0, 0.0))
    order = [1 - walled, walled]
    world = driven_balls(lab, [starts[k] for k in order], wall, profile=profile)
    # both press on by 3 cm and 1 cm
    world.drivers["position"][order, 0] = (-0.08, 0.01)
    assert remove(world)
    assert lab.counters(world)["gave_up"] == 0
    left, right = world.bodies["position"][order, 0]
    assert right <= OVERLAP_TOLERANCE
    assert right - left >= 2 * RADIUS - OVERLAP_TOLERANCE


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_two_drivers_meet_in_the_middle(lab: SimpleNamespace, profile: str) -> None:
    """Drive two balls at each other and past: they meet half-way, and no frame shows an overlap."""
    world = driven_balls(lab, ((-0.2, 0.0, 0.0), (0.2, 0.0, 0.0)), profile=profile)
    for frame in range(30):
        at = 0.2 - 0.01 * frame
        world.drivers["old_target_position"][:, 0] = (-at, at)
        world.drivers["target_position"][:, 0] = (0.01 - at, at - 0.01)
        lab.play(world, 1)
        one, two = world.bodies["position"][:2, 0]
        assert two - one >= 2 * RADIUS - OVERLAP_TOLERANCE
        assert one + two == pytest.approx(0, abs=1e-9)
        assert lab.counters(world)["gave_up"] == 0
    assert two - one == pytest.approx(2 * RADIUS, abs=2 * OVERLAP_TOLERANCE)


@pytest.mark.parametrize("profile", TRANSLATIONS)
def test_a_hand_in_a_corner_ends_free(lab: SimpleNamespace, profile: str) -> None:
    """Press the hand of fifteen hulls 1 to 2 cm into table and wall: free in one round of least motion."""
    links, joints = hand_parts()
    names = tuple(joint.name for joint in joints)
    start = (-0.2, 0.0, 0.1)
    glove = Tracker(
        "palm", names, (0.0, 1.0), (start,) * 2, ((1.0, 0.0, 0.0, 0.0),) * 2, ((0.3,) * len(names),) * 2
    )
    wall = lab.block("wall", (0.5, 1.0, 1.0), (0.5, 0.0, 1.0), kind="fixed")
    scenario = Scenario(
        "corner", "", (), (*links, lab.ground(), wall), 1.0, TABLE_1, joints=joints, trackers=(glove,)
    )
    world = lab.build(scenario, profile)
    boxes = world.pieces[: len(names)]
    for offset in np.linspace(0.0, 0.01, 3):
        low, high = boxes["low"][:, 2].min(), boxes["high"][:, 0].max()
        world.drivers[0]["position"] += (0.01 + offset - high, 0.0, -0.01 - low)
        assert remove(world)
        counted = lab.counters(world)
        assert (counted["way_back"], counted["gave_up"]) == (0, 0)
        # the parts that reach deepest point at table and wall like one body
        assert counted["rounds"] == 1 if profile == "accurate" else 10 < counted["rounds"] <= 16

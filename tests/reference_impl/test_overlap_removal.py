"""The driven loop: translation out of overlap, the way back, giving up."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from reference_impl.conventions import OVERLAP_TOLERANCE, SIMULATED
from reference_impl.detection import place_pieces
from reference_impl.overlap_removal import part_simulated, remove_overlap
from scenarios.scenario import Body, Piece, Sphere
from scenarios.solids import sphere_inertia

RADIUS = 0.05


def driven_ball(position) -> Body:
    """A driven ball of 0.4 kg and 10 cm."""
    shape = Piece("driven", Sphere(RADIUS))
    return Body("driven", "driven", "wood", (shape,), mass=0.4, inertia=sphere_inertia(0.4, RADIUS))


def driven_world(lab: SimpleNamespace, start, *others):
    """A driven ball that starts at `start` among others."""
    scenario = lab.scene(driven_ball(start), *others, trackers=(lab.still("driven", start),))
    return lab.build(scenario)


def remove(world) -> bool:
    """Run the removal of driver 0."""
    world.state["counters"][:] = 0
    return remove_overlap(*world[:6], world.state[0], 0)


def walls(lab: SimpleNamespace, gap: float):
    """Two fixed blocks that leave a slot of width `gap` at y < 0, from x = -gap / 2 on."""
    half = (0.5, 1.0, 1.0)
    return [
        lab.block(f"wall_{side}", half, (side * (0.5 + gap / 2), -1.0, 0.0), kind="fixed") for side in (-1, 1)
    ]


def test_one_pair_needs_one_round(lab: SimpleNamespace) -> None:
    """Lift a driven ball out of the ground in one round, straight up."""
    world = driven_world(lab, (0.0, 0.0, 0.2), lab.ground())
    world.drivers[0]["position"] = (0.1, 0.2, 0.03)
    assert remove(world)
    assert lab.counters(world)["rounds"] == 1
    # the depth is exact to rounding of the ground's size, 40 m
    np.testing.assert_allclose(world.drivers[0]["position"], (0.1, 0.2, RADIUS), atol=1e-12)
    np.testing.assert_allclose(world.bodies[0]["position"], world.drivers[0]["position"], rtol=0, atol=0)


def test_a_square_corner_halves_per_round(lab: SimpleNamespace) -> None:
    """Free a ball of 1 cm depth in ground and wall in 14 rounds: 1e-2 / 2^14 < 1e-6 m."""
    wall = lab.block("wall", (0.5, 1.0, 1.0), (-0.5, 0.0, 1.0), kind="fixed")
    world = driven_world(lab, (0.2, 0.0, 0.2), lab.ground(), wall)
    world.drivers[0]["position"] = (RADIUS - 0.01, 0.0, RADIUS - 0.01)
    assert remove(world)
    assert lab.counters(world)["rounds"] == 14
    np.testing.assert_allclose(world.drivers[0]["position"][[0, 2]], RADIUS - 0.01 / 2**14, rtol=1e-6)


def test_opposing_depths_take_the_way_back(lab: SimpleNamespace) -> None:
    """Leave the cycle of depths 2 and 1 cm for the last pose that fits, on the line back to the free one."""
    world = driven_world(lab, (0.0, 0.5, 0.0), *walls(lab, 2 * RADIUS - 0.03))
    entry = np.array([0.005, -0.5, 0.0])
    world.drivers[0]["position"] = entry
    world.drivers[0]["velocity"] = (0.3, -2.0, 0.1)
    assert remove(world)
    counted = lab.counters(world)
    assert (counted["way_back"], counted["gave_up"]) == (1, 0)
    assert counted["rounds"] <= 10
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


def test_no_free_pose_gives_up_where_it_stood(lab: SimpleNamespace) -> None:
    """Report giving up, and keep the pose at entry, when there never was a free pose."""
    start = (0.005, -0.5, 0.0)
    world = driven_world(lab, start, *walls(lab, 2 * RADIUS - 0.03))
    assert world.drivers[0]["has_free"] == 0
    turned = np.array([0.8, 0.0, 0.6, 0.0])
    world.drivers[0]["orientation"] = turned
    assert not remove(world)
    counted = lab.counters(world)
    assert (counted["way_back"], counted["gave_up"]) == (0, 1)
    np.testing.assert_allclose(world.bodies[0]["position"], start, atol=1e-15)
    np.testing.assert_allclose(world.bodies[0]["orientation"], turned, atol=1e-15)


def test_a_free_pose_that_is_free_no_more_gives_up(lab: SimpleNamespace) -> None:
    """Give up when something stands where the last free pose was."""
    blocker = lab.block("blocker", (0.1, 0.1, 0.1), (3.0, 0.0, 0.0))
    world = driven_world(lab, (0.0, 0.5, 0.0), *walls(lab, 2 * RADIUS - 0.03), blocker)
    world.bodies[3]["position"] = (0.0, 0.5, 0.0)
    place_pieces(world.bodies, world.pieces, world.vertices, SIMULATED)
    world.drivers[0]["position"] = (0.005, -0.5, 0.0)
    assert not remove(world)
    assert lab.counters(world)["gave_up"] == 1


def test_only_the_velocity_into_the_obstacle_stops(lab: SimpleNamespace) -> None:
    """Take out the downward velocity over the ground and leave the rest."""
    world = driven_world(lab, (0.0, 0.0, 0.2), lab.ground())
    world.drivers[0]["position"] = (0.0, 0.0, 0.04)
    world.drivers[0]["velocity"] = (1.0, 2.0, -3.0)
    assert remove(world)
    np.testing.assert_allclose(world.drivers[0]["velocity"], (1, 2, 0), atol=1e-12)
    world.drivers[0]["velocity"] = (1.0, 2.0, 3.0)
    assert remove(world)
    np.testing.assert_allclose(world.drivers[0]["velocity"], (1, 2, 3), rtol=0, atol=0)


def test_a_driven_body_that_gave_up_pushes_a_simulated_one(lab: SimpleNamespace) -> None:
    """Move a simulated ball out of a driven one that is stuck, unless the ground is in its way."""
    stuck = (0.0, 0.0, 0.0)
    ground = lab.ground()
    up = lab.ball("up", (0.0, 0.0, 0.09))
    world = driven_world(lab, stuck, ground, up)
    remove(world)
    np.testing.assert_allclose(world.bodies[2]["position"], (0, 0, 0.1), atol=1e-12)
    aside = lab.ball("aside", (0.06, 0.0, 0.05))
    world = driven_world(
        lab, (0.0, 0.0, 0.11), ground, aside, lab.block("lid", (1, 1, 1), (0, 0, 1.11), "fixed")
    )
    remove(world)
    np.testing.assert_allclose(world.bodies[2]["position"], (0.06, 0.0, 0.05), atol=1e-15)


def test_simulated_bodies_part_by_halves(lab: SimpleNamespace) -> None:
    """Part two sunken balls by half each, and lift one out of the ground in full."""
    one, two = lab.ball("one", (0.0, 0.0, 1.0)), lab.ball("two", (0.08, 0.0, 1.0))
    low = lab.ball("low", (1.0, 0.0, 0.04))
    world = lab.build(lab.scene(one, two, low, lab.ground()))
    assert part_simulated(world.bodies, world.pieces, world.vertices, world.pairs, world.state[0])
    np.testing.assert_allclose(world.bodies["position"][:2, 0], (-0.01, 0.09), atol=1e-12)
    assert world.bodies["position"][2, 2] == pytest.approx(RADIUS, abs=1e-12)

"""Fat bounds: pieces inside them touch nothing; a piece that leaves them is detected again."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.reference_impl.broad_phase.detection import place_pieces
from touchstone.reference_impl.broad_phase.fat_bounds import inside_fat_bounds, update_fat_bounds
from touchstone.reference_impl.contact.integrate import none_turns
from touchstone.reference_impl.core.conventions import DRIVEN, SIMULATED
from touchstone.reference_impl.frame import step
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.scenario import Scenario

FRAME = 1 / 60


def build(scenario: Scenario, fat_bounds: bool = True, profile: str = "balanced"):
    """A reference engine's world."""
    return ReferenceEngine().build(scenario, Settings(profile, FRAME, fat_bounds=fat_bounds))


def play(world, frames: int, start: int = 0):
    """Play frames; returns the arrays."""
    for number in range(start, start + frames):
        world.drive(number)
        world.step()
    return world._world


def refresh(arrays) -> None:
    """Compute the fat bounds from the present poses, at once."""
    arrays.state["fat_bounds_wait"] = 0
    update_fat_bounds(
        arrays.bodies, arrays.pieces, arrays.vertices, arrays.drivers, arrays.pairs, arrays.state[0]
    )


def test_links_inside_their_margins_have_boxes_inside_their_fat_bounds():
    """Move the links of a person at random: where their margins hold, their boxes are inside."""
    arrays = play(build(catalogue()["two_arms"]), 3)
    links = np.flatnonzero(arrays.bodies["isolated"] == 1)
    mine = np.isin(arrays.pieces["body"], links)
    assert len(links) > 5
    rng, kept = np.random.default_rng(1), 0
    start = arrays.bodies[["position", "rotation"]].copy()
    for size in np.geomspace(1e-4, 1, 300):
        for k in links:
            turn = Rotation.from_rotvec(size * rng.normal(size=3)).as_matrix()
            arrays.bodies["rotation"][k] = turn @ start["rotation"][k]
            arrays.bodies["position"][k] = start["position"][k] + 0.1 * size * rng.normal(size=3)
        place_pieces(arrays.bodies, arrays.pieces, arrays.vertices, DRIVEN)
        rows = arrays.pieces[mine]
        within = (rows["low"] >= rows["fat_low"]).all() and (rows["high"] <= rows["fat_high"]).all()
        reported = inside_fat_bounds(arrays.bodies, arrays.pieces, arrays.state[0])
        assert within or not reported
        kept += reported
    assert 50 < kept < 250


def test_a_flight_stays_inside_its_fat_bounds(lab: SimpleNamespace):
    """Throw a spinning block: it is inside for as many frames as its fat bounds cover."""
    block = lab.block(
        "block", (0.2, 0.05, 0.03), (0, 0, 9), linear_velocity=(1, 0.5, 2), angular_velocity=(9, 5, -7)
    )
    world = build(lab.scene(block, lab.ball("other", (9.0, 0.0, 9.0))))
    arrays, number = play(world, 1), 1
    assert arrays.state[0]["simulated_isolated"] == 1
    for frames in (2, 5, 16):
        arrays.state["flight_horizon"], arrays.state["simulated_isolated"] = frames, 0
        refresh(arrays)
        assert arrays.state[0]["simulated_isolated"] == 1
        bounds = arrays.pieces[["fat_low", "fat_high"]].copy()
        for _ in range(frames):
            arrays, number = play(world, 1, number), number + 1
            place_pieces(arrays.bodies, arrays.pieces, arrays.vertices, SIMULATED)
            assert (arrays.pieces["low"] >= bounds["fat_low"]).all()
            assert (arrays.pieces["high"] <= bounds["fat_high"]).all()


@pytest.mark.parametrize(
    ("spin", "orientation", "kept"),
    [
        (0.0, (1.0, 0.0, 0.0, 0.0), True),
        (5e-324, (1.0, 0.0, 0.0, 0.0), False),
        (0.0, (0.7071067811865475, 0.7071067811865475, 0.0, 0.0), False),  # normalising it changes a digit
    ],
)
def test_a_flight_without_turns_keeps_orientations_to_the_bit(
    lab: SimpleNamespace, spin: float, orientation: tuple[float, ...], kept: bool
):
    """Fly straight only where a turn by nothing would change nothing."""
    ball = replace(lab.ball(), orientation=orientation, angular_velocity=(0.0, 0.0, spin))
    assert none_turns(play(build(lab.scene(lab.ground(), ball)), 0).bodies) == kept


def test_bodies_near_others_are_not_isolated(lab: SimpleNamespace):
    """Isolate neither a ball at rest on a ground nor the hands of a person who stands at a wall."""
    arrays = play(build(lab.scene(lab.ground(), lab.ball(position=(0, 0, 0.05)))), 20)
    assert arrays.state[0]["simulated_isolated"] == 0
    arrays = play(build(catalogue()["wall_push"]), 200)
    names = [catalogue()["wall_push"].bodies[k].name for k in np.flatnonzero(arrays.bodies["isolated"] == 0)]
    assert arrays.state[0]["driven_isolated"] == 0
    assert {"left_hand", "right_hand"} & set(names)
    assert arrays.bodies["isolated"].sum() > 5


def test_a_leap_out_of_the_fat_bounds_is_detected(lab: SimpleNamespace):
    """Put a tracker, and what flies, into a wall at one blow: the next frame is as without bounds."""
    wall = lab.block("wall", (0.1, 1.0, 1.0), (2.0, 0.0, 1.0), kind="fixed")
    hand = replace(lab.ball("hand", (0.0, 0.0, 0.0)), kind="driven")
    bodies = (wall, hand, lab.ball("ball", (0.0, 0.5, 5.0)))
    scene = lab.scene(*bodies, trackers=(lab.still("hand", (0.0, 0.0, 1.0)),))
    ends = []
    for fat_bounds in (True, False):
        arrays = play(build(scene, fat_bounds), 5)
        assert arrays.state[0]["driven_isolated"] == arrays.state[0]["simulated_isolated"] == fat_bounds
        for name in ("old_target_position", "target_position"):
            arrays.drivers[name] = (1.87, 0.0, 1.0)
        arrays.drivers["position"] = (1.87, 0.0, 1.0)
        arrays.bodies["center"][2] = arrays.bodies["position"][2] = (1.8, 0.5, 1.0)
        arrays.bodies["velocity"][2] = (20.0, 0.0, 0.0)
        step(*arrays)
        ends.append(arrays)
    one, two = ends
    assert one.state[0]["has_fat_bounds"] == 0 or one.state[0]["driven_isolated"] == 0
    assert two.bodies["position"][1, 0] == pytest.approx(1.85, abs=1e-5)
    assert two.bodies["velocity"][2, 0] <= 0
    for name in ("position", "orientation", "velocity", "omega"):
        assert np.array_equal(one.bodies[name], two.bodies[name])


def test_fat_bounds_belong_to_the_plan(registry: SimpleNamespace):
    """Use fat bounds where no effects are asked for, never with sweeps; the manifest states it."""
    from touchstone.adapters.recorder import ready

    reported = {}
    for profile, effects in (("balanced", None), ("balanced", ("contact", "gravity")), ("accurate", None)):
        player = ready(
            ReferenceEngine(), catalogue()["bounce_e05"], Settings(profile, FRAME, effects=effects)
        )
        reported[profile, effects] = player.world.describe().settings["fat bounds"]
    assert list(reported.values()) == [True, False, False]

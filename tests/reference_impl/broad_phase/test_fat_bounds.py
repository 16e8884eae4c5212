"""Fat bounds: a piece that leaves them is detected again, and the plan decides whether there are any."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.engines.reference.engine import ReferenceEngine
from touchstone.adapters.recorder import ready
from touchstone.reference_impl.frame import step
from touchstone.scenarios.catalogue import catalogue

FRAME = 1 / 60


def test_a_leap_out_of_the_fat_bounds_is_detected(lab: SimpleNamespace):
    """Put a tracker, and what flies, into a wall at one blow: the next frame is as without bounds."""
    wall = lab.block("wall", (0.1, 1.0, 1.0), (2.0, 0.0, 1.0), kind="fixed")
    hand = replace(lab.ball("hand", (0.0, 0.0, 0.0)), kind="driven")
    bodies = (wall, hand, lab.ball("ball", (0.0, 0.5, 5.0)))
    scene = lab.scene(*bodies, trackers=(lab.still("hand", (0.0, 0.0, 1.0)),))
    ends = []
    for fat_bounds in (True, False):
        world = ReferenceEngine().build(scene, Settings("balanced", FRAME, fat_bounds=fat_bounds))
        for number in range(5):
            world.drive(number)
            world.step()
        arrays = world._world
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
    reported = {}
    for profile, effects in (("balanced", None), ("balanced", ("contact", "gravity")), ("accurate", None)):
        player = ready(
            ReferenceEngine(), catalogue()["bounce_e05"], Settings(profile, FRAME, effects=effects)
        )
        reported[profile, effects] = player.world.describe().settings["fat bounds"]
    assert list(reported.values()) == [True, False, False]

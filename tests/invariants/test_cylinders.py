"""Cylinders on the reference by closed forms: rolling, sliding, standing, tipping, and a load on a rim."""

from __future__ import annotations

from math import asin, cos, radians, sin, sqrt

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.adapters.registry import load
from touchstone.scenarios.catalogue import find
from touchstone.scenarios.closed_form import motion
from touchstone.scenarios.families.ellipsoid import quaternion
from touchstone.scenarios.scenario import PairCoefficients, Scenario, vector
from touchstone.scenarios.solids import block, cylinder, slab

FRAME = 1 / 60


def play(scene: Scenario):
    return record(load("reference"), scene, Settings("balanced", FRAME))


@pytest.mark.parametrize(
    "name",
    ["cylinder_rolls", "cylinder_slides", "cylinder_spins", "cylinder_stack", "cylinder_holds"],
)
def test_cylinders_follow_their_truth(name: str) -> None:
    """Stay within a nanometre of the closed form at 1/60 s: GAP_LEFT, to which contacts close."""
    scene = find(name)
    recording = play(scene)
    for truth in scene.truths:
        true = motion(scene, truth, recording.time)
        body = scene.body_index(truth.body)
        np.testing.assert_allclose(recording.position[:, body], true.position, atol=1e-9)
        np.testing.assert_allclose(recording.angular_velocity[:, body], true.angular_velocity, atol=1e-8)


@pytest.mark.parametrize("turn", [0.0, 0.4, 0.785])
def test_a_cylinder_tips_where_its_weight_leaves_the_rim(turn: float) -> None:
    """Stand at 0.99 and tip at 1.01 of the slope at which the weight passes over the rim, however turned."""
    for share, tips in ((0.99, False), (1.01, True)):
        slope = asin(0.04 / sqrt(0.04**2 + 0.1**2)) * share
        tilt = Rotation.from_rotvec((0.0, slope, 0.0))
        up = tilt.apply((0.0, 0.0, 1.0))
        place = vector(0.1 * up)
        turned = tilt * Rotation.from_rotvec((0.0, 0.0, turn))
        post = cylinder("post", "wood", 0.04, 0.1, 1.0, place, quaternion(turned))
        pairs = (PairCoefficients("wood", "wood", 0.0, 1.0),)
        scene = Scenario("t", "", (), (slab("slope", "wood", vector(up), quaternion(tilt)), post), 1.0, pairs)
        moved = np.abs(play(scene).position[-1, 1] - place).max()
        assert (moved > 0.05) == tips
        assert tips or moved < 1e-9


def test_a_cylinder_bears_a_load_near_its_rim() -> None:
    """Stand still under a block on its cap that presses next to the rim, between two points of a square."""
    post = cylinder("post", "wood", 0.05, 0.04, 0.1, (0.0, 0.0, 0.04))
    arm = 0.04 * np.array((cos(radians(45.0)), sin(radians(45.0))))
    load_ = block("load", "wood", (0.004, 0.004, 0.01), 1.0, (*arm.tolist(), 0.09))
    pairs = (PairCoefficients("wood", "wood", 0.0, 0.5),)
    recording = play(Scenario("load", "", (), (slab("floor", "wood"), post, load_), 1.0, pairs))
    assert np.abs(recording.position - recording.position[0]).max() < 1e-5


def test_a_cylinder_that_falls_on_its_rim_gains_nothing() -> None:
    """Gain no energy where a coin is thrown on its rim, bounces, and rolls on it without loss."""
    turn = quaternion(Rotation.from_rotvec((0.9, 0.2, 0.0)))
    coin = cylinder("coin", "wood", 0.05, 0.004, 0.1, (0.0, 0.0, 0.06), turn, spin=(1.0, 2.0, 12.0))
    pairs = (PairCoefficients("wood", "wood", 0.3, 0.4),)
    recording = play(Scenario("coin", "", (), (slab("floor", "wood"), coin), 3.0, pairs))
    turned = Rotation.from_quat(recording.orientation[:, 1], scalar_first=True).inv()
    spin = turned.apply(recording.angular_velocity[:, 1])
    moments = np.diag(np.array(coin.inertia))
    energy = (
        0.05 * (recording.linear_velocity[:, 1] ** 2).sum(axis=1)
        + (moments * spin**2).sum(axis=1) / 2
        + 0.1 * 9.81 * recording.position[:, 1, 2]
    )
    assert np.diff(energy).max() < 1e-9

"""A driver's way over a substep, against the linear law by which the contact solver weighs its pushes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import ready
from touchstone.adapters.registry import load
from touchstone.reference_impl.continuous.coupling_response import unit_response
from touchstone.reference_impl.continuous.driver_motion import (
    begin_driver,
    note_curves,
    note_paths,
    set_link_ways,
)
from touchstone.reference_impl.core.driver_dtypes import DRIVER, JOINT
from touchstone.reference_impl.core.world import BODY
from touchstone.reference_impl.kinematics.skeleton import move_links
from touchstone.scenarios.catalogue import find

FRAME, SUBSTEP = 1 / 60, 0.004
MASS, STIFFNESS = 0.03, 28000.0


def path_omega(turned: np.ndarray, twist: np.ndarray) -> np.ndarray:
    """Twice the mean angular velocity of a driver over a substep from rest, turned away from its tracker, and
    under a twist."""
    bodies, joints, driver = np.zeros(1, BODY), np.zeros(0, JOINT), np.zeros(1, DRIVER)[0]
    driver["mass"], driver["stiffness"], driver["damping"] = MASS, STIFFNESS, 52.0
    for name in ("goal_start_orientation", "goal_end_orientation", "orientation"):
        driver[name] = (1.0, 0.0, 0.0, 0.0)
    driver["old_orientation"] = Rotation.from_rotvec(turned).as_quat(scalar_first=True)
    driver["shift_twist"] = twist
    note_paths(bodies, joints, driver, SUBSTEP, FRAME)
    return bodies[0]["path_omega"].copy()


@pytest.mark.parametrize("size", [1e-3, 0.3, 1.0])
def test_a_twist_adds_to_the_turn_of_a_driver_however_far_it_returns(size: float) -> None:
    """Also about an axis across that of its return, which the twist nearly holds."""
    turned, across = size * np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.3, 0.0])
    moved, _ = unit_response(STIFFNESS / MASS, 2 * np.sqrt(STIFFNESS / MASS), SUBSTEP)
    free = path_omega(turned, np.zeros(3))
    twist = -0.9 * free * SUBSTEP**2 / (2 * moved) + across
    held = path_omega(turned, twist)
    np.testing.assert_allclose(held, free + 2 * moved / SUBSTEP**2 * twist, rtol=1e-12)


def test_velocities_of_links_cover_their_ways_and_turns() -> None:
    """Those of the law of positions, also where links turn about several axes at once: mean velocities times
    the substep are the way of the centre and the rotation vector."""
    player = ready(load("reference"), find("push_box"), Settings("balanced", FRAME))
    player.play(1)
    world = player.world._world
    bodies, joints, driver = world.bodies, world.joints, world.drivers[0]
    rng = np.random.default_rng(0)
    joints["path_start"] = joints["angle"]
    joints["path_end"] = joints["angle"] + rng.uniform(-0.1, 0.1, len(joints))
    joints["rate"] = (joints["path_end"] - joints["path_start"]) / FRAME
    links = np.array([driver["root"], *joints["child"]])
    move_links(bodies, joints, driver)
    for name in ("center", "orientation", "velocity", "omega"):
        bodies[f"old_{name}"] = bodies[name]
    begin_driver(joints, driver)
    note_curves(bodies, joints, driver, SUBSTEP, FRAME)
    note_paths(bodies, joints, driver, SUBSTEP, FRAME)
    mean_velocity = (bodies["old_velocity"] + bodies["path_velocity"]) / 2
    mean_omega = (bodies["old_omega"] + bodies["path_omega"]) / 2
    set_link_ways(bodies, joints, driver, 1.0, SUBSTEP, FRAME)
    way, turned = (bodies[name] + bodies[f"{name}_bend"] for name in ("travel", "turn"))
    assert np.abs(turned[links]).max() > 0.01
    np.testing.assert_allclose(SUBSTEP * mean_velocity[links], way[links], atol=1e-12)
    np.testing.assert_allclose(SUBSTEP * mean_omega[links], turned[links], atol=1e-12)

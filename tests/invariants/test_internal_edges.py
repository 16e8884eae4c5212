"""Bodies cross seams of coplanar pieces as if the floor were one piece."""

from math import cos, sin

import numpy as np
import pytest

from touchstone.adapters.contract import Settings
from touchstone.adapters.recorder import record
from touchstone.scenarios.scenario import PairCoefficients, Scenario
from touchstone.scenarios.solids import block

PROFILES = ("balanced", "accurate")
HALF = 0.05
"""Half the edge of the cube [m]."""
SPEED = 2.0
"""Initial speed along x [m/s]."""


def tiles(start: float, yaw: float, mu: float) -> Scenario:
    """A cube, turned about z by yaw, that slides from x = start over sixteen coplanar boxes of 0.25 m."""
    floor = [
        block(f"tile_{k}", "wood", (0.125, 0.5, 0.1), 0.0, (-0.5 + 0.25 * (k + 0.5), 0.0, -0.1), kind="fixed")
        for k in range(16)
    ]
    turned = (cos(yaw / 2), 0.0, 0.0, sin(yaw / 2))
    place, speed = (start, 0.0, HALF), (SPEED, 0.0, 0.0)
    cube = block("cube", "wood", (HALF, HALF, HALF), 1.0, place, turned, velocity=speed)
    coefficients = (PairCoefficients("wood", "wood", 0.0, mu),)
    return Scenario("tiles", "a test", (), (*floor, cube), 1.0, coefficients)


@pytest.mark.parametrize("profile", PROFILES)
@pytest.mark.parametrize("mu", [0.0, 0.2])
@pytest.mark.parametrize(("start", "yaw"), [(0.0, 0.0), (0.1, 0.0), (0.0371, 0.0), (0.02, 0.3)])
def test_a_cube_slides_over_seams(registry, start: float, yaw: float, mu: float, profile: str) -> None:
    """It keeps its speed without friction, and brakes by mu g with it."""
    scene = tiles(start, yaw, mu)
    recording = record(registry.engine("reference"), scene, Settings(profile, 1 / 60))
    speed = recording.linear_velocity[:, -1]
    expected = np.maximum(SPEED - mu * 9.81 * recording.time, 0.0)
    np.testing.assert_allclose(speed[:, 0], expected, atol=1e-9)
    np.testing.assert_allclose(speed[:, 1:], 0.0, atol=1e-9)


@pytest.mark.parametrize("profile", PROFILES)
def test_a_step_stops_the_cube(registry, profile: str) -> None:
    """A tile that stands 10 um higher than the others does stop it: only steps within tolerance do not."""
    scene = tiles(0.0, 0.0, 0.0)
    bodies = list(scene.bodies)
    bodies[5] = block("tile_5", "wood", (0.125, 0.5, 0.1), 0.0, (0.875, 0.0, -0.1 + 1e-5), kind="fixed")
    stopped = Scenario("step", "a test", (), tuple(bodies), 1.0, scene.coefficients)
    recording = record(registry.engine("reference"), stopped, Settings(profile, 1 / 60))
    assert recording.linear_velocity[-1, -1, 0] < SPEED / 2

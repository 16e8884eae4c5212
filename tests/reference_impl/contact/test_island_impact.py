"""Simultaneous impacts of an island without a solution for its rebound speeds."""

from math import cos, radians, sin, tan
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

RADIUS, HALF = 0.05, (0.02, 0.3, 0.5)
SPEED = 2.0


def wedge(lab: SimpleNamespace, half_angle: float, mu: float):
    """A ball that falls at SPEED onto both walls of a V at once, each tilted by `half_angle` [rad]."""
    walls = []
    for name, side in (("left", -1.0), ("right", 1.0)):
        turn = Rotation.from_rotvec((0.0, side * half_angle, 0.0))
        # the inner face of a wall passes through the V's lowest line, the origin
        place = turn.apply((side * HALF[0], 0.0, HALF[2]))
        orientation = tuple(turn.as_quat(scalar_first=True).tolist())
        walls.append(lab.block(name, HALF, tuple(place), kind="fixed", orientation=orientation))
    ball = lab.ball("ball", (0.0, 0.0, RADIUS / sin(half_angle) + 0.01), linear_velocity=(0.0, 0.0, -SPEED))
    return lab.build(lab.scene(ball, *walls, e=0.5, mu=mu))


@pytest.mark.parametrize("half_angle", [5.0, 15.0, 25.0])
def test_a_ball_in_a_wedge_that_holds_by_friction_does_not_rebound(lab, half_angle: float) -> None:
    """Stop where mu exceeds the tangent of the half angle: any impulse on the ball holds it there."""
    angle = radians(half_angle)
    world = wedge(lab, angle, 1.2 * tan(angle))
    lab.play(world, 3)
    assert np.abs(world.bodies[0]["velocity"]).max() < 1e-9
    assert world.state[0]["residual"] < 1e-9
    lab.play(world, 57)
    assert np.abs(world.bodies[0]["velocity"]).max() < 1e-9


@pytest.mark.parametrize("half_angle", [15.0, 40.0])
def test_a_ball_in_a_wedge_that_slides_rebounds_by_newtons_law(lab, half_angle: float) -> None:
    """Without friction, both walls send it back at e times its speed."""
    angle = radians(half_angle)
    world = wedge(lab, angle, 0.0)
    lab.play(world, 1)
    fallen = 0.01
    speed = (SPEED**2 + 2 * 9.81 * fallen) ** 0.5
    time = 1 / 60 - (speed - SPEED) / 9.81
    assert world.bodies[0]["velocity"][2] == pytest.approx(0.5 * speed - 9.81 * time, abs=1e-4 / cos(angle))

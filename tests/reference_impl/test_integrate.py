"""Flight: poses, spin and their blending over a substep."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from scenarios.scenario import ORIGIN


@pytest.mark.parametrize("frames", [1, 60])
def test_free_fall_is_exact(lab: SimpleNamespace, frames: int) -> None:
    """Fall along v t + g t^2 / 2 to rounding."""
    start, velocity = np.array([0.1, -0.2, 100.0]), np.array([1.0, 2.0, 3.0])
    world = lab.build(lab.scene(lab.ball("ball", tuple(start), linear_velocity=tuple(velocity))))
    lab.play(world, frames)
    t, g = frames / 60, np.array([0, 0, -9.81])
    np.testing.assert_allclose(world.bodies["position"][0], start + velocity * t + g * t * t / 2, rtol=1e-13)
    np.testing.assert_allclose(world.bodies["velocity"][0], velocity + g * t, rtol=1e-13)


def test_eulers_flight_errs_by_half_a_step(lab: SimpleNamespace) -> None:
    """Fall g h t / 2 too far under semi-implicit Euler (method, section 6)."""
    world = lab.build(lab.scene(lab.ball("ball", (0.0, 0.0, 100.0))), profile="paper")
    lab.play(world, 60)
    error = world.bodies["position"][0, 2] - (100 - 9.81 / 2)
    assert error == pytest.approx(-9.81 / 60 / 2, rel=1e-10)


def test_a_flying_ball_turns_at_its_spin(lab: SimpleNamespace) -> None:
    """Turn by omega t exactly where the inertia is a sphere's, and keep the spin."""
    spin = (3.0, -4.0, 12.0)
    world = lab.build(lab.scene(lab.ball(angular_velocity=spin), gravity=ORIGIN))
    lab.play(world, 60)
    np.testing.assert_array_equal(world.bodies["omega"][0], spin)
    assert abs(world.bodies["orientation"][0, 0]) == pytest.approx(abs(np.cos(13 / 2)), abs=1e-13)


def test_a_tumbling_box_nearly_keeps_its_angular_momentum(lab: SimpleNamespace) -> None:
    """Lose less than 1e-3 of L and of the energy in a second; the error falls with the square of the step."""
    errors = []
    for dt in (1 / 60, 1 / 120):
        box = lab.block("box", (0.3, 0.2, 0.1), (0.0, 0.0, 0.0), angular_velocity=(0.2, 3.0, 0.1))
        world = lab.build(lab.scene(box, gravity=ORIGIN), dt=dt)
        body = world.bodies[0]

        def state(body=body):
            inertia = body["rotation"] @ body["inertia"] @ body["rotation"].T
            momentum = inertia @ body["omega"]
            return momentum.copy(), body["omega"] @ momentum / 2

        momentum, energy = state()
        lab.play(world, round(1 / dt))
        later, left = state()
        errors.append(np.linalg.norm(later - momentum) / np.linalg.norm(momentum))
        assert left == pytest.approx(energy, rel=1e-3)
    assert errors[0] < 1e-3
    assert errors[1] < errors[0] / 3

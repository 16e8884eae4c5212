"""Flight: poses, spin and their blending over a substep."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.scenarios.scenario import ORIGIN


@pytest.mark.parametrize("frames", [1, 60])
def test_free_fall_is_exact(lab: SimpleNamespace, frames: int) -> None:
    """Fall along v t + g t^2 / 2 to rounding."""
    start, velocity = np.array([0.1, -0.2, 100.0]), np.array([1.0, 2.0, 3.0])
    world = lab.build(lab.scene(lab.ball("ball", tuple(start), linear_velocity=tuple(velocity))))
    lab.play(world, frames)
    t, g = frames / 60, np.array([0, 0, -9.81])
    np.testing.assert_allclose(world.bodies["position"][0], start + velocity * t + g * t * t / 2, rtol=1e-13)
    np.testing.assert_allclose(world.bodies["velocity"][0], velocity + g * t, rtol=1e-13)


def test_a_flying_ball_turns_at_its_spin(lab: SimpleNamespace) -> None:
    """Turn by omega t exactly where the inertia is a sphere's, and keep the spin."""
    spin = (3.0, -4.0, 12.0)
    world = lab.build(lab.scene(lab.ball(angular_velocity=spin), gravity=ORIGIN))
    lab.play(world, 60)
    np.testing.assert_array_equal(world.bodies["omega"][0], spin)
    assert abs(world.bodies["orientation"][0, 0]) == pytest.approx(abs(np.cos(13 / 2)), abs=1e-13)


def axes(*moments: float, turned: Rotation | None = None) -> np.ndarray:
    """An inertia with these principal moments."""
    m = (turned or Rotation.identity()).as_matrix()
    inertia = m @ np.diag(moments) @ m.T
    return (inertia + inertia.T) / 2


SKEW = Rotation.from_rotvec([0.4, -0.9, 0.2])
TUMBLERS = {
    "stable axis": (axes(0.02, 0.03, 0.04), (0.1, 0.2, 15.0)),
    "unstable axis": (axes(0.02, 0.03, 0.04), (1e-3, 15.0, 1e-3)),
    "any axis": (axes(0.02, 0.03, 0.04), (12.0, -9.0, 13.0)),
    "nearly symmetric": (axes(0.02, 0.02 * (1 + 1e-9), 0.035), (8.0, 9.0, -10.0)),
    "nearly spherical": (axes(0.02, 0.02 * (1 + 1e-9), 0.02 * (1 - 1e-9)), (8.0, 9.0, -10.0)),
    "off-diagonal": (axes(0.02, 0.033, 0.045, turned=SKEW), (10.0, -14.0, 7.0)),
    "needle": (axes(1e-4, 0.03, 0.03005), (20.0, 3.0, -4.0)),
}


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
@pytest.mark.parametrize("tumbler", TUMBLERS)
def test_ten_seconds_of_tumbling(lab: SimpleNamespace, tumbler: str, profile: str) -> None:
    """Keep momentum and path to 1e-12 and energy to 1e-9 over 600 frames, off the centre of mass."""
    inertia, omega = TUMBLERS[tumbler]
    offset, velocity = np.array([0.02, -0.03, 0.01]), np.array([1.0, -2.0, 3.0])
    box = lab.block(
        "box",
        (0.2, 0.15, 0.1),
        (0.0, 0.0, 0.0),
        angular_velocity=omega,
        linear_velocity=tuple(velocity),
        center_of_mass=tuple(offset),
    )
    box = dataclasses.replace(box, inertia=tuple(map(tuple, inertia.tolist())))
    world = lab.build(lab.scene(box, gravity=ORIGIN), profile)
    body = world.bodies[0]

    def state() -> tuple[np.ndarray, float]:
        momentum = body["rotation"] @ inertia @ body["rotation"].T @ body["omega"]
        return momentum, body["omega"] @ momentum + velocity @ velocity

    momentum, energy = state()
    lab.play(world, 600)
    later, left = state()
    # 600 frames of roundings, here a few 1e-16 each
    assert np.linalg.norm(later - momentum) <= 1e-12 * np.linalg.norm(momentum)
    assert left == pytest.approx(energy, rel=1e-9)
    np.testing.assert_allclose(body["center"], offset + 10 * velocity, rtol=1e-12)
    np.testing.assert_array_equal(body["velocity"], velocity)


@pytest.mark.parametrize("what", ["position", "rotation"])
def test_a_flight_does_not_depend_on_the_step(lab: SimpleNamespace, what: str) -> None:
    """End a flight at the same pose after 60 steps and after 240."""
    inertia, omega = axes(0.02, 0.03, 0.04), (1.0, -2.0, 3.0)
    box = lab.block("box", (0.2, 0.15, 0.1), (0.0, 0.0, 5.0), angular_velocity=omega)
    box = dataclasses.replace(box, inertia=tuple(map(tuple, inertia.tolist())))
    ends = {}
    for rate in (60, 240):
        world = lab.build(lab.scene(box), dt=1 / rate)
        lab.play(world, rate)
        ends[rate] = world.bodies[0][what].copy()
    np.testing.assert_allclose(ends[60], ends[240], atol=1e-12)

"""Capsules that land, roll and rest on their contact manifolds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from manifold_scenes import assert_energy_never_rises, capsule, energy, quaternion, speed

from touchstone.reference_impl.core.conventions import TOUCH_DISTANCE


@pytest.mark.parametrize("turn", [0.0, 0.4, 1.2])
def test_a_dropped_capsule_comes_to_rest_on_its_side(lab: SimpleNamespace, turn: float) -> None:
    """Lie level and still two seconds after a fall at any tilt, on its side, without a gain of energy."""
    pill = capsule((0.0, 0.0, 0.25), quaternion(0.0, np.pi / 2 - turn, 0.0))
    world = lab.build(lab.scene(pill, lab.ground(), e=0.3, mu=0.3))
    energies = lab.play(world, 120, energy)
    axis = world.bodies[0]["rotation"][:, 2]
    # both ends touch: at most 2 TOUCH_DISTANCE apart in height
    assert abs(axis[2]) < 2 * TOUCH_DISTANCE / 0.3
    assert world.bodies[0]["position"][2] == pytest.approx(0.05, abs=2 * TOUCH_DISTANCE)
    assert speed(world) < 1e-6
    assert_energy_never_rises(energies, 1e-9)


def test_a_sliding_capsule_rolls_as_coulomb_says(lab: SimpleNamespace) -> None:
    """Turn sliding across the axis into rolling at v0 / (1 + I / m r^2), and keep it level and straight."""
    world = lab.build(lab.scene(capsule((0.0, 0.0, 0.05), linear_velocity=(0, 1, 0)), lab.ground(), mu=0.3))
    lab.play(world, 60)
    body = world.bodies[0]
    # friction keeps the spin about the contact: m v0 r = (m r^2 + I) w
    rolling = 1 / (1 + body["inertia"][2, 2] / 0.05**2)
    np.testing.assert_allclose(body["velocity"], (0, rolling, 0), atol=1e-9)
    np.testing.assert_allclose(body["omega"], (-rolling / 0.05, 0, 0), atol=1e-7)
    assert abs(body["rotation"][2, 2]) < 1e-9


def test_a_rod_lies_still_on_two_others(lab: SimpleNamespace) -> None:
    """Rest in the groove between two rods on the ground, which friction keeps together."""
    rods = [capsule((0.0, y, 0.05)) for y in (-0.05, 0.05)]
    rods.append(capsule((0.02, 0.0, 0.05 + 0.1 * np.cos(np.pi / 6))))
    named = [replace(rod, name=f"rod_{k}") for k, rod in enumerate(rods)]
    world = lab.build(lab.scene(*named, lab.ground(), e=0.0, mu=0.5))
    energies = lab.play(world, 60, energy)
    assert speed(world) < 1e-9
    assert_energy_never_rises(energies, 1e-12)
    for rod, body in zip(named, world.bodies):
        np.testing.assert_allclose(body["position"], rod.position, atol=2 * TOUCH_DISTANCE)

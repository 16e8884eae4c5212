"""Boxes that land, rest, slide and stack on their contact manifolds."""

from types import SimpleNamespace

import numpy as np
import pytest
from manifold_scenes import HALF, assert_energy_never_rises, energy, quaternion, speed, tilt
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.core.conventions import TOUCH_DISTANCE


@pytest.mark.parametrize("e", [0.0, 0.3])
def test_a_box_dropped_flat_rests_flat(lab: SimpleNamespace, e: float) -> None:
    """Bounce without spin, then lie for ten seconds without tilt, drift or gain of energy."""
    world = lab.build(lab.scene(lab.block("box", HALF, (0.0, 0.0, 0.3)), lab.ground(), e=e, mu=0.3))
    body, energies = world.bodies[0], []
    lab.play(world, 60, lambda w: energies.append(energy(w)))
    start = body["position"].copy()
    lab.play(world, 600, lambda w: energies.append(energy(w)))
    assert tilt(body) < 1e-9
    assert np.abs(body["position"] - start).max() < 1e-9
    assert np.abs(start - (0, 0, HALF[2])).max() < TOUCH_DISTANCE
    assert speed(world) < 1e-9
    assert_energy_never_rises(energies, 1e-9)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("e", [0.3, 1.0])
def test_a_flat_bounce_has_no_spin(lab: SimpleNamespace, e: float, mu: float) -> None:
    """Leave the ground at e times the speed of arrival at every corner."""
    box = lab.block("box", HALF, (0.0, 0.0, 0.06), linear_velocity=(0.0, 0.0, -2.0))
    world = lab.build(lab.scene(box, lab.ground(), e=e, mu=mu, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 2)
    # the sweeps end at a residual of 1e-12
    np.testing.assert_allclose(world.bodies[0]["velocity"], (0, 0, 2 * e), atol=1e-10)
    np.testing.assert_allclose(world.bodies[0]["omega"], 0, atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_tumbling_box_comes_to_rest(lab: SimpleNamespace, seed: int) -> None:
    """Lie still within four seconds of a spinning fall, and gain no more energy than flight's own error."""
    rng = np.random.default_rng(seed)
    half = tuple(rng.uniform(0.03, 0.12, 3).tolist())
    spin, turn = tuple(rng.uniform(-8, 8, 3).tolist()), Rotation.random(rng=rng).as_rotvec()
    box = lab.block("box", half, (0.0, 0.0, 0.35), orientation=quaternion(*turn), angular_velocity=spin)
    world = lab.build(lab.scene(box, lab.ground(), e=(0.0, 0.3)[seed % 2], mu=0.3))
    energies = lab.play(world, 240, energy)
    assert speed(world) < 1e-3
    # the midpoint rule of free spin keeps the angular momentum, the energy only to some (w h)^3
    assert_energy_never_rises(energies, 5e-3)


def test_a_cradle_of_boxes_passes_the_blow_on(lab: SimpleNamespace) -> None:
    """Resolve a manifold as one but pairs one at a time: the last of three touching boxes takes it all."""
    half = (0.05, 0.05, 0.05)
    boxes = [lab.block(f"box_{k}", half, (0.1 * k, 0.0, 0.0)) for k in range(3)]
    striker = lab.block("striker", half, (-0.2, 0.0, 0.0), linear_velocity=(1.0, 0.0, 0.0))
    world = lab.build(lab.scene(*boxes, striker, e=1.0, mu=0.3, gravity=(0.0, 0.0, 0.0)))
    lab.play(world, 20)
    np.testing.assert_allclose(world.bodies["velocity"][:, 0], (0, 0, 1, 0), atol=1e-9)
    assert np.abs(world.bodies["omega"]).max() < 1e-9

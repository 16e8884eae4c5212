"""Flight: poses, spin and their blending over a substep."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation


def axes(*moments: float, turned: Rotation | None = None) -> np.ndarray:
    """An inertia with these principal moments."""
    m = (turned or Rotation.identity()).as_matrix()
    inertia = m @ np.diag(moments) @ m.T
    return (inertia + inertia.T) / 2


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

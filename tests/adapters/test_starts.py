"""Bodies that start in overlap."""

from __future__ import annotations

import numpy as np
import pytest


@pytest.mark.parametrize("profile", ["balanced", "accurate"])
def test_overlap_at_the_start_is_parted_without_a_throw(lab, profile):
    """Part two boxes that start half in each other on the reference, leave them at rest, and say so: the
    energy of lifting the upper one by 5 cm."""
    half = (0.05, 0.05, 0.05)
    low, high = (lab.block(f"box_{z}", half, (0.0, 0.0, z)) for z in (0.05, 0.1))
    world = lab.build(lab.scene(lab.ground(), low, high), profile)
    told = lab.play(world, 10, lambda w: (w.state[0]["parted_energy"], w.bodies["velocity"].copy()))
    assert told[0][0] == pytest.approx(9.81 * 0.05, rel=1e-4)  # lifted from where it fell to in a frame
    # what is lifted keeps the speed of the frame at most: g / 60
    assert np.abs([velocity for _, velocity in told]).max() <= 9.81 / 60 + 1e-9
    assert world.bodies["position"][:, 2] == pytest.approx([-0.5, 0.05, 0.15], abs=1e-6)

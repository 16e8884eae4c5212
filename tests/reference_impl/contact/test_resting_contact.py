"""Resting contacts of a sliding box, beside Coulomb's law."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

G, MU, SPEED = 9.81, 0.1, 0.29


@pytest.mark.parametrize("rate", [60, 240])
def test_a_sliding_box_is_braked_by_mu_times_its_weight(lab: SimpleNamespace, rate: int) -> None:
    """Brake a box of 1 kg by mu m g, and bear its weight, while it loses three quarters of its speed."""
    half = (0.16, 0.16, 0.1)
    box = lab.block("box", half, (0.0, 0.0, half[2]), linear_velocity=(SPEED, 0.0, 0.0))
    world = lab.build(lab.scene(box, lab.ground(), mu=MU), dt=1 / rate)
    steps = round(0.75 * SPEED / (MU * G) * rate)

    def borne(world) -> float:
        rows = world.contacts[: int(world.state[0]["contact_count"])]
        return abs(float(rows["impulse"][:, 2].sum()))

    weight = sum(lab.play(world, steps, borne))
    lost = SPEED - float(world.bodies["velocity"][0, 0])
    assert lost / (MU * G * steps / rate) == pytest.approx(1, abs=1e-9)
    assert weight / (G * steps / rate) == pytest.approx(1, abs=1e-9)

"""The moment of an impact within a frame."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.core.conventions import IMPACT_SLACK, IMPACT_TARGET


@pytest.mark.parametrize("speed", [0.5, 2.0, 10.0])
def test_the_moment_is_the_closed_form(lab: SimpleNamespace, speed: float) -> None:
    """Find when a falling ball closes its gap, to the slack over its speed."""
    height = 0.004
    world = lab.build(
        lab.scene(lab.ball("ball", (0.0, 0.0, 0.05 + height), linear_velocity=(0, 0, -speed)), lab.ground())
    )
    lab.play(world, 1)
    first = world.contacts[0]
    t = (np.sqrt(speed**2 + 2 * 9.81 * height) - speed) / 9.81
    assert first["time"] == pytest.approx(t, abs=(IMPACT_TARGET + 2 * IMPACT_SLACK) / speed)
    assert abs(first["distance"] - IMPACT_TARGET) <= IMPACT_SLACK


def test_the_earliest_of_several_impacts_comes_first(lab: SimpleNamespace) -> None:
    """Log impacts of one frame in the order of their moments, whatever the order of the bodies."""
    heights = (0.03, 0.01, 0.02)
    balls = [
        lab.ball(f"ball_{k}", (k, 0.0, 0.05 + height), linear_velocity=(0.0, 0.0, -3.0))
        for k, height in enumerate(heights)
    ]
    world = lab.build(lab.scene(*balls, lab.ground(), e=0.5))
    lab.play(world, 1)
    rows = world.contacts[: int(world.state[0]["contact_count"])]
    assert rows["body_a"].tolist() == [1, 2, 0]
    assert (np.diff(rows["time"]) > 0).all()
    np.testing.assert_allclose(rows["time"], np.array([0.01, 0.02, 0.03]) / 3, rtol=0.05)

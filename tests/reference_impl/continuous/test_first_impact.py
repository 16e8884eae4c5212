"""The moment of an impact within a frame."""

from types import SimpleNamespace

import numpy as np
import pytest
from moving_pair import Scene
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.continuous.first_impact import _closing
from touchstone.reference_impl.core.conventions import IMPACT_SLACK, IMPACT_TARGET
from touchstone.reference_impl.core.counters import CAP_CLOSING
from touchstone.scenarios.scenario import Box, Sphere


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


@pytest.mark.parametrize(("slack", "capped"), [(IMPACT_SLACK, 0), (0.0, 1)])
def test_bracketing_that_runs_out_of_steps_is_counted(slack: float, capped: int) -> None:
    """Count the cap where a slack below rounding cannot be met, and return a fraction above the target."""
    scene = Scene(Sphere(0.1), Sphere(0.1)).move(0).move(1, (0.313, 0.0, 0.0), (-0.2, 0.07, 0.0))
    counters = scene.state[0]["counters"]
    target = 1 / 30000
    fraction = _closing(scene.moving_pair(), 1.0, target, slack)
    assert counters[CAP_CLOSING] == capped
    assert abs(scene.distance(fraction) - target) <= max(slack, 1e-15)


def test_the_landing_of_the_other_end_is_found() -> None:
    """Find when the raised end of a box lands while its lower end stays put: its distance is constant until
    then. Secants alone move by so little a step that they run out of steps."""
    start, turn, gap = -4e-3, 6e-3, 6e-7
    # the centre moves so that the lower edge stays at the gap, to third order in the turn
    height = gap - 0.5 * np.sin(start) + 0.1 * np.cos(start)
    rise = -turn * (0.5 * np.cos(start) + 0.1 * np.sin(start))
    bend = turn**2 * (0.5 * np.sin(start) - 0.1 * np.cos(start)) / 2
    scene = Scene(Box((2.0, 2.0, 0.5)), Box((0.5, 0.1, 0.1))).move(0, (0.0, 0.0, -0.5))
    scene.move(
        *(1, (0.0, 0.0, height), (0.0, 0.0, rise), (0.0, turn, 0.0)),
        travel_bend=(0.0, 0.0, bend),
        posture=Rotation.from_euler("y", start),
    )
    slack, depth = 5e-8, 1e-7
    fraction = _closing(scene.moving_pair(), 1.0, gap - depth, slack)
    assert scene.state[0]["counters"][CAP_CLOSING] == 0
    assert fraction == pytest.approx((depth - start) / turn, abs=slack / turn)

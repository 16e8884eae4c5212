"""Separation of simulated bodies that sank into others, beside fixed bodies and drivers."""

from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.contact.separation import SEPARATION_DEPTH, separate_simulated
from touchstone.reference_impl.core.conventions import SIMULATED

RADIUS = 0.05
"""Radius of the balls of `lab` [m]."""


def test_simulated_bodies_part_by_halves(lab: SimpleNamespace) -> None:
    """Part two sunken balls by half each, and lift one out of the ground, to the depth left to all."""
    one, two = lab.ball("one", (0.0, 0.0, 1.0)), lab.ball("two", (0.08, 0.0, 1.0))
    low = lab.ball("low", (1.0, 0.0, 0.04))
    world = lab.build(lab.scene(one, two, low, lab.ground()))
    assert separate_simulated(world.of_stages(), 0)
    np.testing.assert_allclose(
        world.bodies["position"][:2, 0],
        (-0.01 + SEPARATION_DEPTH / 2, 0.09 - SEPARATION_DEPTH / 2),
        atol=1e-12,
    )
    assert world.bodies["position"][2, 2] == pytest.approx(RADIUS - SEPARATION_DEPTH, abs=1e-12)


@pytest.mark.parametrize("kind", ["fixed", "driven"])
def test_a_jammed_bar_turns(lab: SimpleNamespace, kind: str) -> None:
    """A slanted bar overlaps two walls by 10 um each: it has no room to translate, turns hardly more than
    it must, and keeps its velocities. Driven walls stay where they are."""
    half, tilt, sunk = (0.5, 0.02, 0.02), 0.3, 1e-5
    reach = half[0] * np.cos(tilt) + half[2] * np.sin(tilt) - sunk
    starts = {f"wall {x}": (x * (reach + 1), 0.0, 0.0) for x in (-1, 1)}
    driven = kind == "driven"
    walls = [
        lab.block(name, (1, 1, 1), (0, 0, 0) if driven else start, kind) for name, start in starts.items()
    ]
    trackers = tuple(lab.still(*row) for row in starts.items()) if driven else ()
    turn = (float(np.cos(tilt / 2)), 0.0, float(-np.sin(tilt / 2)), 0.0)
    bar = lab.block("bar", half, (0, 0, 0), orientation=turn, linear_velocity=(1, 2, 3))
    world = lab.build(lab.scene(*walls, bar, trackers=trackers))
    world.drivers["velocity"] = (4, 5, 6)
    world.bodies["velocity"][:2] = (4, 5, 6)
    separate_simulated(world.of_stages(), 0)
    assert lab.counters(world)["gave_up"] == 0
    assert world.bodies["velocity"][:2].tolist() == [[4, 5, 6]] * 2
    assert world.bodies["driver"].tolist() == ([0, 1, -1] if driven else [-1] * 3)
    end, deepest = detect(world.of_stages(), SIMULATED, 0)
    assert end == 2
    assert 0 < deepest <= SEPARATION_DEPTH + 1e-9
    found = world.bodies[2]
    np.testing.assert_allclose(found["position"], (0, 0, 0), atol=1e-9)
    assert found["velocity"].tolist() == [1, 2, 3]
    # the corners that touch are that far above and below the centre
    height = half[0] * np.sin(tilt) - half[2] * np.cos(tilt)
    turned = 2 * np.arctan2(-found["orientation"][2], found["orientation"][0]) - tilt
    assert 1.0 - 1e-3 <= turned * height / (sunk - SEPARATION_DEPTH) <= 1.1

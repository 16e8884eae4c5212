"""Touching pairs of one instant, kept at the front of the list."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core.conventions import SIMULATED, TOUCH_DISTANCE
from touchstone.scenarios.scenario import PairCoefficients, Scenario


def test_touching_pairs_move_to_the_front(lab: SimpleNamespace) -> None:
    """Keep pairs within TOUCH_DISTANCE, from `first` on, with coefficients and the largest depth."""
    heights = (0.05, 0.04, 0.05 + 2e-6, 0.05 + 0.9 * TOUCH_DISTANCE, 0.3)
    balls = [lab.ball(f"ball_{k}", (k, 0.0, height)) for k, height in enumerate(heights)]
    world = lab.build(lab.scene(*balls, lab.ground(), e=0.4, mu=0.7))
    world.pairs[0]["key"] = 42.0
    end, deepest = detect(world.of_stages(), SIMULATED, 1)
    rows = world.pairs[1:end]
    assert sorted(rows["body_a"].tolist()) == [0, 1, 3]
    assert set(rows["body_b"].tolist()) == {5}
    assert deepest == pytest.approx(0.01, abs=1e-12)
    np.testing.assert_array_equal(rows["restitution"], 0.4)
    np.testing.assert_array_equal(rows["friction"], 0.7)
    np.testing.assert_allclose(rows["normal"], [(0, 0, -1)] * 3, atol=1e-12)
    assert world.pairs[0]["key"] == 42.0


def test_coefficients_are_those_of_the_pair(lab: SimpleNamespace) -> None:
    """Look restitution and friction up by both materials, in either order."""
    metal = dataclasses.replace(lab.ball("metal", (0.0, 0.0, 0.05)), material="metal")
    ground = lab.ground()
    coefficients = (
        PairCoefficients("wood", "wood", 0.1, 0.2),
        PairCoefficients("wood", "metal", 0.3, 0.4),
        PairCoefficients("metal", "metal", 0.5, 0.6),
    )
    for bodies in ((metal, ground), (ground, metal)):
        world = lab.build(Scenario("test", "a test", (), bodies, 1.0, coefficients))
        end, _ = detect(world.of_stages(), SIMULATED, 0)
        assert end == 1
        assert (world.pairs[0]["restitution"], world.pairs[0]["friction"]) == (0.3, 0.4)

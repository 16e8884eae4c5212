"""Bounds: what is played keeps to them, whatever the scene."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from adapters.bounds import bounds
from scenarios.catalogue import catalogue
from scenarios.effects import plan


def keeps(recording, scenario) -> None:
    """No body of a recording leaves its bounds."""
    made = plan(scenario, bounds(scenario))
    names = [body.name for body in scenario.bodies]
    for position in recording.position:
        assert made.broken(position, names) is None


@pytest.mark.parametrize("name", [name for name, one in catalogue().items() if "heap" not in one.tags])
def test_scenes_keep_to_their_bounds(registry: SimpleNamespace, name: str) -> None:
    """Keep to the bounds in every shipped scene."""
    keeps(registry.played(name, "reference"), catalogue()[name])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(0, 10**6))
def test_random_balls_keep_to_their_bounds(lab: SimpleNamespace, seed: int) -> None:
    """Keep to the bounds where balls of many masses hit each other and the ground."""
    rng = np.random.default_rng(seed)
    balls = [
        lab.ball(
            f"ball_{k}",
            tuple(rng.uniform(-1, 1, 2)) + (float(0.2 + 0.3 * k),),
            mass=float(10.0 ** rng.uniform(-2, 2)),
            linear_velocity=tuple(rng.normal(size=3) * 2),
            angular_velocity=tuple(rng.normal(size=3) * 5),
        )
        for k in range(rng.integers(1, 5))
    ]
    scene = lab.scene(lab.ground(), *balls, e=float(rng.uniform()), mu=float(rng.uniform()))
    made = plan(scene, bounds(scene))
    names = [body.name for body in scene.bodies]
    seen = lab.play(lab.build(scene), scene.frame_count, lambda w: w.bodies["position"].copy())
    assert [made.broken(position, names) for position in seen] == [None] * len(seen)

"""Bounds: what is played stays inside them, whatever the scene."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from touchstone.adapters.contract import AdapterError
from touchstone.adapters.motion_bounds import bounds
from touchstone.scenarios.avatar.avatar import avatar_parts, standing_tracker
from touchstone.scenarios.catalogue import catalogue
from touchstone.scenarios.plan import plan


def left(positions, scenario) -> list[str]:
    """What is said of frames in which a body is outside its bounds; `positions` (frames, bodies, 3) [m]."""
    made, names = plan(scenario, bounds(scenario)), [body.name for body in scenario.bodies]
    return list(filter(None, (made.broken(position, names) for position in positions)))


def test_what_printed_laws_may_speed_up_is_not_bounded(lab: SimpleNamespace) -> None:
    """Bound no rod that meets others with restitution and friction by its energy, but a ball, and a rod
    without either."""
    rod = lab.block("rod", (0.3, 0.02, 0.02), (0.0, 0.0, 0.3))
    for body, e, mu, bounded in (
        (rod, 0.3, 0.3, False),
        (rod, 0.3, 0.0, True),
        (rod, 0.0, 0.3, True),
        (lab.ball(), 0.3, 0.3, True),
    ):
        made = bounds(lab.scene(lab.ground(), body, e=e, mu=mu))
        assert np.isfinite(made.high[1]).all() == bounded


@pytest.mark.parametrize(("x", "bounded"), [(0.0, False), (0.35, True)])
def test_a_start_deep_in_a_block_has_no_bounds(lab: SimpleNamespace, x: float, bounded: bool) -> None:
    """Bound a person who starts beside a block, but not one who starts inside it and is pushed out."""
    parts = avatar_parts()
    block = lab.block("block", (0.2, 0.3, 0.3), (x, 0.0, 0.2), kind="fixed")
    made = bounds(lab.person(parts, bodies=(*parts[0], block)))
    assert np.isfinite(made.low[:-1]).all() == np.isfinite(made.high[:-1]).all() == bounded


def test_a_tracker_through_its_own_body_is_refused(lab: SimpleNamespace) -> None:
    """Refuse a person whose own limbs meet by its tracker while they are declared never to."""
    parts = avatar_parts()
    tracker = standing_tracker(parts, (0.0, 0.0, 0.0), 1.0)
    turned_in = tuple(angle + 0.2 for angle in tracker.angles[0])
    trackers = (replace(tracker, angles=(tracker.angles[0], turned_in)),)
    scene = lab.person(parts, trackers=trackers)
    with pytest.raises(AdapterError, match=r"'left_foot' and 'right_foot' .* m into each other"):
        bounds(scene)
    declared = replace(scene, effects=(*scene.effects, "self_collision"))
    assert plan(declared, bounds(declared)).on("self_collision")


@pytest.mark.parametrize("name", [name for name, one in catalogue().items() if "heap" not in one.tags])
def test_scenes_keep_to_their_bounds(registry: SimpleNamespace, name: str) -> None:
    """Keep to the bounds in every shipped scene."""
    assert left(registry.played(name, "reference").position, catalogue()[name]) == []


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
    seen = lab.play(lab.build(scene), scene.frame_count, lambda w: w.bodies["position"].copy())
    assert left(seen, scene) == []

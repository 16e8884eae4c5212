"""What is remembered of pairs from frame to frame, and a scene detected with it."""

import numpy as np
import pytest

from touchstone.adapters.engines.reference.reference_world import translate
from touchstone.reference_impl.broad_phase.detection import detect
from touchstone.reference_impl.core import conventions, counters
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.frame import prepare, step
from touchstone.reference_impl.geometry.depth_cache import find_entry
from touchstone.scenarios.catalogue import catalogue


def test_more_pairs_than_the_memory_holds() -> None:
    """Answer every pair when entries run out, some of them from scratch; common sets fit."""
    state, count = np.zeros(1, STATE), 2 * conventions.DEPTH_CACHE_SIZE
    for _ in range(2):
        for k in range(count):
            find_entry(state[0], k, k + 1)
    assert (state[0]["depth_cache"]["used"] > 0).mean() > 0.9
    # fifteen parts of a hand against forty pieces: no bucket overflows
    state = np.zeros(1, STATE)
    for a in range(40):
        for b in range(40, 55):
            find_entry(state[0], a, b)
    assert (state[0]["depth_cache"]["used"] > 0).sum() > 0.98 * 600


@pytest.mark.parametrize("depth", [conventions.DEPTH_WALK, conventions.DEPTH_CERTIFIED])
def test_a_scene_is_detected_alike(depth: int) -> None:
    """Find the same touching pairs and distances as exact depth in every frame of a flick."""
    world = translate(catalogue()["ball_snip"])
    world.state["dt"], world.state["gravity"] = 1 / 60, (0.0, 0.0, -9.81)
    prepare(*world)
    state, methods = world.state[0], np.zeros(3, int)
    for _ in range(60):
        found = {}
        for method in (conventions.DEPTH_EXACT, depth):
            state["depth"] = method
            state["counters"][:] = 0
            end, _ = detect(world.of_stages(), conventions.SIMULATED, 0)
            found[method] = world.pairs[:end].copy()
            counted = state["counters"][
                [counters.COUNT_WALKED, counters.COUNT_CERTIFIED, counters.COUNT_EXACT]
            ]
            assert counted.sum() == state["counters"][counters.COUNT_PAIRS]
        methods += counted
        exact, walked = found.values()
        np.testing.assert_array_equal(exact["piece_a"], walked["piece_a"])
        np.testing.assert_allclose(walked["distance"], exact["distance"], atol=1e-12)
        step(*world)
    # the ball rests on the table: one query from scratch, one certified a frame
    assert methods[1] > 10 * methods[2] > 0

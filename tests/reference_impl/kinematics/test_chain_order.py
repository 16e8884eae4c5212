"""Order of a driver's chains: every one comes up, from the generator of Park and Miller."""

from __future__ import annotations

import numpy as np

from touchstone.reference_impl.core.driver_dtypes import DRIVER
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.kinematics.chain_order import shuffle_chains


def test_every_order_of_the_chains_comes_up() -> None:
    """Draw each of the six orders of three chains about equally often."""
    state, drivers = np.zeros(1, STATE), np.zeros(1, DRIVER)
    state["random"], drivers["chain_count"] = 1, 3
    seen: dict[tuple[int, ...], int] = {}
    for _ in range(600):
        shuffle_chains(drivers[0], state[0])
        order = drivers[0]["order"][:3]
        seen[tuple(order.tolist())] = seen.get(tuple(order.tolist()), 0) + 1
    assert len(seen) == 6
    # 100 expected each, standard deviation 9.1
    assert 60 < min(seen.values()) <= max(seen.values()) < 140


def test_the_generator_is_that_of_park_and_miller() -> None:
    """Reach the state that their paper gives after 10,000 numbers from 1, four an order of five chains."""
    state, drivers = np.zeros(1, STATE)[0], np.zeros(1, DRIVER)
    state["random"], drivers["chain_count"] = 1, 5
    for _ in range(2500):
        shuffle_chains(drivers[0], state)
    assert state["random"] == 1043618065

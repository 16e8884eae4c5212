"""Order of a driver's chains: the generator of Park and Miller."""

import numpy as np

from touchstone.reference_impl.core.driver_dtypes import DRIVER
from touchstone.reference_impl.core.state_dtype import STATE
from touchstone.reference_impl.kinematics.chain_order import shuffle_chains


def test_the_generator_is_that_of_park_and_miller() -> None:
    """Reach the state that their paper gives after 10,000 numbers from 1, four an order of five chains."""
    state, drivers = np.zeros(1, STATE)[0], np.zeros(1, DRIVER)
    state["random"], drivers["chain_count"] = 1, 5
    for _ in range(2500):
        shuffle_chains(drivers[0], state)
    assert state["random"] == 1043618065

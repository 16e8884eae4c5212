"""Random order in which a frame processes a driver's chains, by a generator whose state the world holds."""

from touchstone.reference_impl.core.conventions import RANDOM_PRIME
from touchstone.reference_impl.core.kernel import kernel

RANDOM_FACTOR = 16807
"""Factor of the generator of Park and Miller (1988) [1]; its products fit 64-bit integers."""


@kernel
def shuffle_chains(driver, state):
    """Draw the order of a driver's chains in this frame (Fisher and Yates)."""
    order, count = driver["order"], driver["chain_count"]
    for i in range(count):
        order[i] = i
    for i in range(count - 1, 0, -1):
        state["random"] = RANDOM_FACTOR * state["random"] % RANDOM_PRIME
        j = int(state["random"] / RANDOM_PRIME * (i + 1))
        order[i], order[j] = order[j], order[i]

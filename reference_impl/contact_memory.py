"""Forces that held contact points last: the next hold starts from them.

Each body has a list of the points it remembers, so that finding one costs the contacts of a body, not all.
"""

from reference_impl.conventions import HOLD_MEMORY, SIMULATED
from reference_impl.kernel import kernel


@kernel
def recall(bodies, pair, state, h):
    """Set `held` from the force that held the nearest contact point of the pair, if any did."""
    body = bodies[_anchor(bodies, pair)]
    nearest, least, m = -1, 0.0, body["memory"] - 1
    while m >= 0:
        if state["held_pieces"][m, 0] == pair["piece_a"] and state["held_pieces"][m, 1] == pair["piece_b"]:
            distance = 0.0
            for i in range(3):
                distance += (state["held_point"][m, i] - pair["point"][i] + body["center"][i]) ** 2
            if nearest < 0 or distance < least:
                nearest, least = m, distance
        m = state["held_next"][m] - 1
    if nearest >= 0:
        for i in range(3):
            pair["held"][i] = h * state["held_force"][nearest, i]


@kernel
def remember(bodies, pairs, count, state, h):
    """Remember the forces at the contact points after a hold of length h."""
    for b in range(len(bodies)):
        bodies[b]["memory"] = 0
    for k in range(min(count, HOLD_MEMORY)):
        pair = pairs[k]
        body = bodies[_anchor(bodies, pair)]
        state["held_pieces"][k, 0], state["held_pieces"][k, 1] = pair["piece_a"], pair["piece_b"]
        for i in range(3):
            state["held_point"][k, i] = pair["point"][i] - body["center"][i]
            state["held_force"][k, i] = pair["held"][i] / h
        state["held_next"][k] = body["memory"]
        body["memory"] = k + 1


@kernel
def _anchor(bodies, pair):
    """Body that remembers a pair: the later of those that are simulated, for it has few contacts."""
    return pair["body_b"] if bodies[pair["body_b"]]["kind"] == SIMULATED else pair["body_a"]

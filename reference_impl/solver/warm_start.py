"""Warm start: a contact solve starts from the contact forces of the previous one.

Each body has a list of its stored points, so a look-up visits the contacts of one body, not all contacts.
"""

from touchstone.reference_impl.core.conventions import SIMULATED, WARM_START_CAPACITY
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector, dot


@inlined_kernel
def load_impulse(bodies, pair, state, h):
    """Set `resting_impulse` from the stored force at the pair's nearest contact point, if there is one, and
    `last_force` if that is the one until the start of the substep."""
    body = bodies[_anchor(bodies, pair)]
    nearest, least, m = -1, 0.0, body["memory"] - 1
    while m >= 0:
        if (
            state["warm_start_pieces"][m, 0] == pair["piece_a"]
            and state["warm_start_pieces"][m, 1] == pair["piece_b"]
        ):
            distance = 0.0
            for i in range(3):
                distance += (state["warm_start_point"][m, i] - pair["point"][i] + body["center"][i]) ** 2
            if nearest < 0 or distance < least:
                nearest, least = m, distance
        m = state["warm_start_next"][m] - 1
    begins = state["last_time"] < 0
    if begins:
        pair["last_force"][:] = 0.0
    if nearest >= 0:
        # what touches from the other side now has another past
        if begins and dot(state["warm_start_normal"][nearest], pair["normal"]) > 0:
            copy_vector(state["warm_start_force"][nearest], pair["last_force"])
            copy_vector(state["warm_start_normal"][nearest], pair["last_normal"])
        if state["statics"] == 1:
            pair["stuck"] = state["warm_start_stuck"][nearest]
        for i in range(3):
            pair["resting_impulse"][i] = h * state["warm_start_force"][nearest, i]
            if state["moments"] == 1:
                pair["moment"][i] = h * state["warm_start_moment"][nearest, i]


@inlined_kernel
def store_impulses(bodies, pairs, count, state, h):
    """Store the forces at the contact points after a contact solve over a substep of length h."""
    for b in range(len(bodies)):
        bodies[b]["memory"] = 0
    for k in range(min(count, WARM_START_CAPACITY)):
        pair = pairs[k]
        body = bodies[_anchor(bodies, pair)]
        state["warm_start_pieces"][k, 0], state["warm_start_pieces"][k, 1] = pair["piece_a"], pair["piece_b"]
        copy_vector(pair["normal"], state["warm_start_normal"][k])
        if state["statics"] == 1:
            state["warm_start_stuck"][k] = pair["stuck"]
        for i in range(3):
            state["warm_start_point"][k, i] = pair["point"][i] - body["center"][i]
            state["warm_start_force"][k, i] = pair["resting_impulse"][i] / h
            if state["moments"] == 1:
                state["warm_start_moment"][k, i] = pair["moment"][i] / h
        state["warm_start_next"][k] = body["memory"]
        body["memory"] = k + 1


@kernel
def _anchor(bodies, pair):
    """Body that stores the points of a pair: the later simulated one, which has few contacts."""
    return pair["body_b"] if bodies[pair["body_b"]]["kind"] == SIMULATED else pair["body_a"]

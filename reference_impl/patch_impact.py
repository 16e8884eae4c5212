"""The impact of a contact patch: all its points resolve as one, and the energy guard judges them together."""

from reference_impl.contact import apply_to_both, relative_velocity
from reference_impl.contact_solver import begin_row, settle
from reference_impl.conventions import APPROACH_MIN, COUNT_GUARDED, ENERGY_ROUNDING, RESTITUTION_GUARDED
from reference_impl.impulse import lossless_share
from reference_impl.kernel import kernel
from reference_impl.rotation import copy_vector


@kernel
def strike_patch(bodies, joints, drivers, pairs, count, patch, e, state):
    """Impact of a patch: all its points as one, each by Newton's law against its own velocity before.

    n.v+ >= -e n.v-, with an impulse only where equality holds: (v+ + e v-) / (1 + e) is then the projection
    of v- on the velocities that do not approach, and without friction the energy never rises. With friction
    the guard of `impulse.py` applies to all points together.
    """
    k = patch
    while k >= 0:
        begin_row(bodies, pairs[k], e * pairs[k]["key"])
        k = pairs[k]["sibling"]
    settle(bodies, joints, drivers, pairs, count, patch, state)
    gain, work = _energy_change(bodies, pairs, patch, state)
    if state["restitution_law"] == RESTITUTION_GUARDED and gain > ENERGY_ROUNDING * work:
        _guard_patch(bodies, joints, drivers, pairs, count, patch, gain, state)


@kernel
def to_middle(pairs, pair):
    """Move the contact point of a row to the middle of the points of its patch that approach as fast, to
    APPROACH_MIN: with Eq. 10 as printed a pair is struck at one point, and where a face or an edge meets
    another flatly, all of its points are the deepest."""
    point, count, k = pair["point"], 0, pair["patch"]
    point[0] = point[1] = point[2] = 0.0
    while k >= 0:
        other = pairs[k]
        if other["key"] >= pair["key"] - APPROACH_MIN:
            count += 1
            for i in range(3):
                point[i] += (other["point_a"][i] + other["point_b"][i]) / 2
        k = other["sibling"]
    for i in range(3):
        point[i] /= count


@kernel
def _energy_change(bodies, pairs, patch, state):
    """Change of kinetic energy by the impulses of a patch, and the size of their work against v- [J]."""
    gain = work = 0.0
    v, k = state["velocity"], patch
    while k >= 0:
        pair = pairs[k]
        relative_velocity(bodies, pair, state)
        for i in range(3):
            before = pair["before_b"][i] - pair["before_a"][i]
            gain += pair["held"][i] * (before + v[i]) / 2
            work += abs(pair["held"][i] * before)
        k = pair["sibling"]
    return gain, work


@kernel
def _guard_patch(bodies, joints, drivers, pairs, count, patch, gain, state):
    """Go back from a patch's impulses towards those at e = 0 until the kinetic energy does not rise."""
    p, v = state["impulse"], state["velocity"]
    k = patch
    while k >= 0:
        copy_vector(pairs[k]["held"], pairs[k]["spare"])
        pairs[k]["floor"] = 0.0
        k = pairs[k]["sibling"]
    settle(bodies, joints, drivers, pairs, count, patch, state)
    start, _ = _energy_change(bodies, pairs, patch, state)
    slope = 0.0
    k = patch
    while k >= 0:
        relative_velocity(bodies, pairs[k], state)
        for i in range(3):
            slope += (pairs[k]["spare"][i] - pairs[k]["held"][i]) * v[i]
        k = pairs[k]["sibling"]
    share = lossless_share(min(0.0, start), slope, gain)
    k = patch
    while k >= 0:
        held, spare = pairs[k]["held"], pairs[k]["spare"]
        for i in range(3):
            p[i] = share * (spare[i] - held[i])
            held[i] += p[i]
        apply_to_both(bodies, joints, drivers, pairs[k], pairs[k]["point"], p)
        k = pairs[k]["sibling"]
    state["counters"][COUNT_GUARDED] += 1

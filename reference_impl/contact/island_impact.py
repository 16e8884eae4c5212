"""Simultaneous impacts of an island, and the energy guard for an island as a whole."""

from touchstone.reference_impl.contact.impulse import lossless_share
from touchstone.reference_impl.core.conventions import APPROACH_MIN, ENERGY_ROUNDING, RESTITUTION_GUARDED
from touchstone.reference_impl.core.counters import COUNT_GUARDED, COUNT_IMPULSES
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.solver.contact_solver import solve_island
from touchstone.reference_impl.solver.islands import is_head, join_islands
from touchstone.reference_impl.solver.mobility import apply_to_both, relative_velocity


@inlined_kernel
def strike_together(bodies, joints, drivers, pairs, count, state):
    """Apply impact impulses to all rows that have a floor, island by island.

    The impulses satisfy n.v+ >= -e n.v-, and act only where equality holds. If e is the same in all rows,
    (v+ + e v-) / (1 + e) is the projection of v- on the velocities that do not approach, so the energy never
    rises without friction. With friction or different e, the guard of `impulse.py` applies to all impulses of
    the island together.
    """
    join_islands(bodies, drivers, pairs, count, False)
    for k in range(count):
        if not is_head(bodies, pairs, k):
            continue
        solve_island(bodies, joints, drivers, pairs, k, False, state)
        gain, work = _energy_change(bodies, pairs, k, state)
        if state["restitution_law"] == RESTITUTION_GUARDED and gain > ENERGY_ROUNDING * work:
            _guard(bodies, joints, drivers, pairs, k, gain, state)
        state["counters"][COUNT_IMPULSES] += 1


@kernel
def _energy_change(bodies, pairs, head, state):
    """Change of kinetic energy by the impulses of an island, and the sum of their absolute work at v- [J]."""
    gain = work = 0.0
    v, k = state["velocity"], head
    while k >= 0:
        pair = pairs[k]
        relative_velocity(bodies, pair, state)
        for i in range(3):
            before = pair["before_b"][i] - pair["before_a"][i]
            gain += pair["resting_impulse"][i] * (before + v[i]) / 2
            work += abs(pair["resting_impulse"][i] * before)
        k = pair["next_row"]
    return gain, work


@kernel
def _guard(bodies, joints, drivers, pairs, head, gain, state):
    """Interpolate an island's impulses towards those at e = 0 until the kinetic energy does not rise."""
    v, k = state["velocity"], head
    while k >= 0:
        pair = pairs[k]
        copy_vector(pair["resting_impulse"], pair["spare"])
        _add_impulse(bodies, joints, drivers, pair, -1.0, state)
        pair["resting_impulse"][:] = 0.0
        pair["floor"] = 0.0
        k = pair["next_row"]
    solve_island(bodies, joints, drivers, pairs, head, False, state)
    start, _ = _energy_change(bodies, pairs, head, state)
    slope = 0.0
    k = head
    while k >= 0:
        relative_velocity(bodies, pairs[k], state)
        for i in range(3):
            slope += (pairs[k]["spare"][i] - pairs[k]["resting_impulse"][i]) * v[i]
        k = pairs[k]["next_row"]
    share = lossless_share(min(0.0, start), slope, gain)
    k = head
    while k >= 0:
        pair = pairs[k]
        held, spare = pair["resting_impulse"], pair["spare"]
        # `spare` becomes the impulse added to the solution at e = 0
        for i in range(3):
            spare[i] = share * (spare[i] - held[i])
            held[i] += spare[i]
        apply_to_both(bodies, joints, drivers, pair, pair["point"], spare)
        k = pair["next_row"]
    state["counters"][COUNT_GUARDED] += 1


@kernel
def _add_impulse(bodies, joints, drivers, pair, share, state):
    """Apply a share of a row's `resting_impulse` to its bodies."""
    p = state["impulse"]
    for i in range(3):
        p[i] = share * pair["resting_impulse"][i]
    apply_to_both(bodies, joints, drivers, pair, pair["point"], p)


@kernel
def to_middle(pairs, pair):
    """Move a row's contact point to the mean of its manifold's points that approach as fast.

    Speeds within APPROACH_MIN count as equal. A sequential impact acts on a pair at one point, but if a face
    or an edge meets another flatly, all points of the manifold are equally deep.
    """
    point, count, k = pair["point"], 0, pair["manifold"]
    point[0] = point[1] = point[2] = 0.0
    while k >= 0:
        other = pairs[k]
        if other["key"] >= pair["key"] - APPROACH_MIN:
            count += 1
            for i in range(3):
                point[i] += (other["point_a"][i] + other["point_b"][i]) / 2
        k = other["next_point"]
    for i in range(3):
        point[i] /= count
        pair["lever_a"][i] = pair["lever_b"][i] = point[i]

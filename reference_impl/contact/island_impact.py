"""Simultaneous impacts of an island, and the energy guard for an island as a whole.

Impulses p change the relative velocities v at the contacts to v+ = v + M p, and the kinetic energy by
T(p) = p.(v + v+) / 2, which is convex. By Newton's law, n.v+ = -e n.v, friction that does not reverse the
sliding only adds to the loss. Sticking friction can gain energy, but not at e = 0.

The guard takes the impulses p0 at e = 0 and p1 at e, and moves from p1 towards p0 until T = 0:
T(p0 + s (p1 - p0)) is a parabola in s. The impulses stay in the cones, which are convex.

Held joints of mechanisms answer an impact by an inertia A that has no kinetic energy; one that would need
more than its largest force over the substep yields, without an answer. If the impact changes rates from r to
r+, T falls by (r+.A r+ - r.A r) / 2. An impact that slows them could take energy from A, so at p0 the guard
first lets A slow them, to (M + A)^-1 M r, and moves between both motions.
"""

from math import sqrt

from touchstone.reference_impl.continuous.hinge_motion import meets_limit
from touchstone.reference_impl.continuous.mechanism_motion import (
    answered,
    note_rates,
    set_rates,
    slow_joints,
    yield_to_impact,
)
from touchstone.reference_impl.core.conventions import ENERGY_ROUNDING
from touchstone.reference_impl.core.counters import COUNT_GUARDED, COUNT_IMPULSES
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector, dot
from touchstone.reference_impl.solver.contact_solver import solve_island
from touchstone.reference_impl.solver.islands import (
    has_moment,
    is_head,
    join_islands,
    load_island,
    load_limits,
)
from touchstone.reference_impl.solver.mobility import (
    apply_to_both,
    relative_turn,
    relative_velocity,
    turn_both,
)


@inlined_kernel
def strike_together(bodies, joints, drivers, pairs, count, state):
    """Apply impact impulses to all rows that have a floor, island by island.

    The impulses satisfy n.v+ >= -e n.v-, and act only where equality holds. If e is the same in all rows,
    (v+ + e v-) / (1 + e) is the projection of v- on the velocities that do not approach, so the energy never
    rises without friction. With friction or different e, the guard applies.
    """
    join_islands(bodies, drivers, pairs, count, False)
    for k in range(count):
        if is_head(bodies, pairs, k):
            _strike(bodies, joints, drivers, pairs, k, -1, state)
            state["counters"][COUNT_IMPULSES] += 1


@kernel
def stop_at_limits(bodies, joints, drivers, pairs, state):
    """Stop the mechanisms whose joints move into limits that they have reached."""
    for d in range(state["driven_count"], len(drivers)):
        if meets_limit(joints, drivers[d]):
            _strike(bodies, joints, drivers, pairs, -1, d, state)


@kernel
def _strike(bodies, joints, drivers, pairs, head, alone, state):
    """Apply impact impulses to an island: that of row `head`, or of the mechanism `alone` at its limits."""
    for d in range(state["driven_count"], len(drivers)):
        note_rates(drivers[d], drivers[d]["start_rates"])
    gain, work = _solve(bodies, joints, drivers, pairs, head, alone, state)
    while _yield(bodies, joints, drivers, state):
        _take_back(bodies, joints, drivers, pairs, head, state)
        gain, work = _solve(bodies, joints, drivers, pairs, head, alone, state)
    for d in range(state["driven_count"], len(drivers)):
        if drivers[d]["hinge_mover"] >= 0:
            end, start = drivers[d]["rates"], drivers[d]["start_rates"]
            gain -= answered(joints, drivers[d], end, end) / 2
            gain += answered(joints, drivers[d], start, start) / 2
    if gain > ENERGY_ROUNDING * work:
        _guard(bodies, joints, drivers, pairs, head, alone, gain, state)


@kernel
def _yield(bodies, joints, drivers, state):
    """Let the held joints of mechanisms yield that an impact overloads; returns whether any does."""
    found = False
    for d in range(state["driven_count"], len(drivers)):
        found = yield_to_impact(bodies, joints, drivers[d]) or found
    return found


@kernel
def _take_back(bodies, joints, drivers, pairs, head, state):
    """Return an island to its motion before its impact."""
    k = head
    while k >= 0:
        _add_impulse(bodies, joints, drivers, pairs[k], -1.0, state)
        pairs[k]["resting_impulse"][:] = pairs[k]["moment"][:] = 0.0
        k = pairs[k]["next_row"]
    for d in range(state["driven_count"], len(drivers)):
        set_rates(bodies, joints, drivers[d], drivers[d]["start_rates"], drivers[d]["start_rates"], 0.0)


@kernel
def _solve(bodies, joints, drivers, pairs, head, alone, state):
    """Solve the island of `_strike` from its present impulses, which are not applied; returns
    `_energy_change`."""
    if head >= 0:
        load_island(bodies, joints, drivers, pairs, head, 0.0, state)
    else:
        load_limits(joints, drivers, alone, state["solver"])
    solve_island(bodies, joints, drivers, pairs, 0.0, state)
    return _energy_change(bodies, joints, drivers, pairs, head, state)


@kernel
def _energy_change(bodies, joints, drivers, pairs, head, state):
    """Change of kinetic energy by the impulses of an island, which the solver holds, and the sum of their
    absolute work at v- [J]. The answers of held joints count as inertia."""
    gain = work = 0.0
    v, k = state["velocity"], head
    while k >= 0:
        pair = pairs[k]
        relative_velocity(bodies, pair, state)
        for i in range(3):
            before = pair["before_b"][i] - pair["before_a"][i]
            gain += pair["resting_impulse"][i] * (before + v[i]) / 2
            work += abs(pair["resting_impulse"][i] * before)
        if has_moment(pair):
            relative_turn(bodies, pair, pair["free_turn"])
            gain += (dot(pair["moment"], pair["turn_before"]) + dot(pair["moment"], pair["free_turn"])) / 2
            work += abs(dot(pair["moment"], pair["turn_before"]))
        k = pair["next_row"]
    for n in range(state["solver"]["row_count"]):
        row = state["solver"]["rows"][n]
        k = _limited_joint(bodies, joints, drivers, row)
        if k >= 0:
            driver = drivers[bodies[joints[k]["child"]]["driver"]]
            before = driver["start_rates"][joints[k]["coordinate"]]
            force = row["impulse"][0] * joints[k]["limited"]
            gain += force * (before + joints[k]["rate"]) / 2
            work += abs(force * before)
    return gain, work


@kernel
def _limited_joint(bodies, joints, drivers, row):
    """Joint between bodies whose limit is a row of the solver, or -1."""
    k = -2 - row["pair"]
    return k if k >= 0 and drivers[bodies[joints[k]["child"]]["driver"]]["mechanism"] == 1 else -1


@kernel
def _guard(bodies, joints, drivers, pairs, head, alone, gain, state):
    """Interpolate an island's impulses towards those at e = 0, with slowed joints, until the kinetic energy
    does not rise."""
    # limits have exerted impulses on mechanisms too
    for d in range(state["driven_count"], len(drivers)):
        note_rates(drivers[d], drivers[d]["gains"])
    rows = state["solver"]["rows"]
    for n in range(state["solver"]["row_count"]):
        k = _limited_joint(bodies, joints, drivers, rows[n])
        if k >= 0:
            joints[k]["spare_impulse"] = rows[n]["impulse"][0]
    v, k = state["velocity"], head
    while k >= 0:
        pair = pairs[k]
        copy_vector(pair["resting_impulse"], pair["spare"])
        copy_vector(pair["moment"], pair["spare_moment"])
        pair["floor"] = min(pair["floor"], 0.0)
        k = pair["next_row"]
    _take_back(bodies, joints, drivers, pairs, head, state)
    for d in range(state["driven_count"], len(drivers)):
        if drivers[d]["hinge_mover"] >= 0:
            slow_joints(bodies, joints, drivers[d])
    start, _ = _solve(bodies, joints, drivers, pairs, head, alone, state)
    slope = 0.0
    for d in range(state["driven_count"], len(drivers)):
        driver = drivers[d]
        note_rates(driver, driver["path_gains"])
        if driver["hinge_mover"] >= 0:
            before, rates = driver["start_rates"], driver["path_gains"]
            lost, kept = answered(joints, driver, before, rates), answered(joints, driver, rates, rates)
            start -= (lost + kept) / 2
            slope += lost + kept - answered(joints, driver, rates, driver["gains"])
    for n in range(state["solver"]["row_count"]):
        k = _limited_joint(bodies, joints, drivers, rows[n])
        if k >= 0:
            change = joints[k]["spare_impulse"] - rows[n]["impulse"][0]
            slope += change * joints[k]["limited"] * joints[k]["rate"]
    k = head
    while k >= 0:
        relative_velocity(bodies, pairs[k], state)
        for i in range(3):
            slope += (pairs[k]["spare"][i] - pairs[k]["resting_impulse"][i]) * v[i]
            # `_energy_change` has stored the angular velocity
            slope += (pairs[k]["spare_moment"][i] - pairs[k]["moment"][i]) * pairs[k]["free_turn"][i]
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
        held, spare = pair["moment"], pair["spare_moment"]
        for i in range(3):
            spare[i] = share * (spare[i] - held[i])
            held[i] += spare[i]
        turn_both(bodies, joints, drivers, pair, spare, state)
        k = pair["next_row"]
    for d in range(state["driven_count"], len(drivers)):
        set_rates(bodies, joints, drivers[d], drivers[d]["path_gains"], drivers[d]["gains"], share)
    state["counters"][COUNT_GUARDED] += 1


@kernel
def _add_impulse(bodies, joints, drivers, pair, share, state):
    """Apply a share of a row's `resting_impulse` and `moment` to its bodies."""
    p = state["impulse"]
    for i in range(3):
        p[i] = share * pair["resting_impulse"][i]
    apply_to_both(bodies, joints, drivers, pair, pair["point"], p)
    for i in range(3):
        p[i] = share * pair["moment"][i]
    turn_both(bodies, joints, drivers, pair, p, state)


@kernel
def lossless_share(start, slope, end):
    """Root in [0, 1] of the parabola with values `start` <= 0 at 0 and `end` > 0 at 1, and `slope` at 0."""
    bend = end - start - slope
    root = sqrt(max(0.0, slope * slope - 4 * bend * start))
    # use the form without cancellation
    if slope > 0:
        return min(1.0, -2 * start / (slope + root))
    return min(1.0, (root - slope) / (2 * bend))

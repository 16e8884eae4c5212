"""Contact solver: impulses that satisfy Coulomb's law in all rows of an island together.

From a warm start, the solver sweeps by projected Gauss-Seidel with conjugate directions (Silcowitz, Niebe &
Erleben 2010). If the sweeps come close, Newton's method finishes the result (`contact_newton`); otherwise, or
if it cycles, an interior-point method finds another start for it (`contact_interior`). The solver keeps the
impulses with the smallest residual. In the large islands of a dense substep, the interior-point method
replaces the sweeps and starts from the warm start.

Where a face leaves the load on its corners free, it is the most even one (`face_load`).

It scales impulses that did not converge down until contacts do no positive work. With u the velocities
without the impulses p, v those before the solve, and W the map from impulses to velocities, the work is

    p.(v + u + W p) / 2 <= 0  for  p scaled by  s <= -p.(v + u) / p.W p.

This holds for any p, so no iteration limit, stall or warm start can add energy. It makes a result safe, not
exact: the remaining approach lets bodies sink. The frame records it as its residual.

A converged result can do positive work too, if friction stops a row that slid in the opposite direction
before: the mean force then points along that sliding. In such an island friction opposes the mean sliding
(v + u + W p) / 2 instead, and does no positive work.

A body between two walls steeper than the friction cone cannot rebound: every impulse holds it. Coulomb's law
with rebound speeds then has no solution, but without them it has one, if the walls stand still (Acary &
Cadoux 2013). An island that finds no solution with rebound speeds does not rebound. In the same way, a
resting contact that separates slowly may come back as fast; in an island that finds no solution, it does not.
Nor do its contacts change their velocities as its bodies turn within the substep: between contacts that stick
on one body, such changes are a strain, which no impulse mends, and a jammed body does not turn.
None of this applies to islands too large for Newton's method, which only lack sweeps.

A moving surface can jam bodies against others. Where Coulomb's law holds only at speeds far above its own,
the island takes the impulses of a few sweeps, and has the residual that they leave.
"""

from math import inf

from touchstone.reference_impl.continuous.hinge_motion import has_limits
from touchstone.reference_impl.core.counters import (
    COUNT_GUARDED,
    COUNT_OPEN_SOLVES,
    COUNT_SOLVES,
    COUNT_SWEEPS,
    COUNT_UNCONVERGED,
)
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.solver.block_matrix import lay_out
from touchstone.reference_impl.solver.contact_interior import interior
from touchstone.reference_impl.solver.contact_newton import newton
from touchstone.reference_impl.solver.contact_rows import (
    changed_velocity,
    into_cone,
    keep_best,
    make_passive,
    pushes_along,
    rebuild,
    residual_of,
    reverse_slip,
    solve_row,
    take_best,
)
from touchstone.reference_impl.solver.face_load import even_out, find_faces, take_any_load
from touchstone.reference_impl.solver.islands import (
    has_moment,
    is_head,
    join_islands,
    load_island,
    load_limits,
    store_island,
)
from touchstone.reference_impl.solver.joined_load import even_stuck
from touchstone.reference_impl.solver.mobility import relative_turn, surface_velocities
from touchstone.reference_impl.solver.moment_rows import into_bounds, solve_moment
from touchstone.reference_impl.solver.tolerances import (
    NEWTON_FACTORS,
    RESIDUAL_ACCEPTED,
    RESIDUAL_DENSE,
    RESIDUAL_OPEN,
    RESIDUAL_TARGET,
    ROUNDING,
)

STEADY_SHARE, STEADY_ROUNDINGS = 0.02, 32
"""Share of RESIDUAL_TARGET at which a solve ends in the frame after a warm start that missed it, but at least
so many roundings of the impulses [1]: the impulses then remain a solution while nothing moves."""
FIRST_SWEEPS = 8
"""Sweeps before Newton's method: they determine which contacts slide and which are open."""
MOST_SWEEPS, MOST_VISITS = 200, 20_000
"""Sweeps if Newton's method is not used or failed, or row visits if those allow more sweeps: about 2 ms."""
DENSE_SWEEPS, DENSE_VISITS = 32, 4_000
"""The same in a dense substep: a frame has tens of them, and each starts from the forces of the last."""
INTERIOR_FROM, INTERIOR_ROWS = 1e-5, 16
"""Residual after the first sweeps above which the interior-point method precedes Newton's method [m/s], and
rows from which it does: Newton's method alone solves most smaller islands in as few factorisations, and keeps
the solution of the substep before where Coulomb's law has several."""
PARTING_FACTORS = 30
"""Most factorisations of an island that the law of positions asks to part, before it asks less."""
JAM_RATIO = 10.0
"""Mean change of an island's velocities, by mass, over the largest speed in its contacts, from which a moving
surface jams it [1]: 100 to 300 where it did in random scenes, mostly less than 1 elsewhere."""
FRICTION_STEPS = 8
"""Steps in which friction rises from none where other methods fail."""
EVEN_SWEEPS = 16
"""Most sweeps without friction before the first solve of an island with a mechanism."""


@kernel
def begin_row(bodies, pair, floor):
    """Initialise a row: its floor, its surface velocities and a zero impulse."""
    copy_vector(pair["normal"], pair["start_normal"])
    pair["resting_impulse"][:] = 0.0
    pair["floor"] = floor
    pair["bias"][:] = 0.0
    pair["slides"] = 0
    surface_velocities(bodies, pair, pair["before_a"], pair["before_b"])
    if has_moment(pair):
        pair["moment"][:] = 0.0
        relative_turn(bodies, pair, pair["turn_before"])


@kernel
def solve_contacts(bodies, joints, drivers, pairs, count, h, state):
    """Solve for each `resting_impulse` of the rows `pairs[:count]`; apply the solution.

    The present impulses, which have not been applied, are the warm start. With `only_led` of the state 1,
    islands that are not `led` keep theirs.

    Args:
        h: time over which the impulses act evenly (resting contact) [s], or 0 for one instant (impact).
    Returns:
        Whether every island converged.
    """
    join_islands(bodies, drivers, pairs, count, False)
    converged = True
    for d in range(len(drivers)):
        drivers[d]["is_solved"] = 0
    for k in range(count):
        if pairs[k]["island"] < 0:
            pairs[k]["resting_impulse"][:] = 0.0
            pairs[k]["moment"][:] = 0.0
        elif is_head(bodies, pairs, k) and bodies[pairs[k]["island"]]["led"] >= state["only_led"]:
            load_island(bodies, joints, drivers, pairs, k, h, state)
            converged = solve_island(bodies, joints, drivers, pairs, h, state) and converged
    for d in range(len(drivers)):
        driver = drivers[d]
        alone = driver["loops"] == 1 and driver["is_solved"] == 0 and (h > 0 or driver["mechanism"] == 1)
        if alone and has_limits(joints, driver):
            load_limits(joints, drivers, d, state["solver"])
            converged = solve_island(bodies, joints, drivers, pairs, h, state) and converged
    return converged


@kernel
def solve_island(bodies, joints, drivers, pairs, h, state):
    """Solve the loaded island; returns whether it converged, and counts failures."""
    solver = state["solver"]
    rows = solver["rows"]
    _into_cones(solver)
    find_faces(solver, pairs)
    solve_loaded(solver, state)
    # an island too large for Newton's method may have a solution that sweeps do not reach
    fits = solver["work"] >= 0
    if fits and not _is_accepted(solver) and _rebounds(solver):
        state["counters"][COUNT_GUARDED] += 1
        _stop_rebound(solver)
        solve_loaded(solver, state)
    # where a driver moves, another solve sets the motion, and so the work
    if h > 0 and solver["led"] == 0 and pushes_along(solver):
        reverse_slip(solver)
        solve_loaded(solver, state)
    if state["moving_surfaces"] == 1 and _is_jammed(solver, pairs):
        _sweep_from_zero(solver, state)
    residual, limit = solver["best_residual"], max(solver["accepted"], solver["target"])
    state["counters"][COUNT_SOLVES] += 1
    state["counters"][COUNT_OPEN_SOLVES] += residual > max(RESIDUAL_OPEN, limit)
    state["counters"][COUNT_UNCONVERGED] += residual > limit
    if residual > RESIDUAL_ACCEPTED:
        make_passive(solver)
    least = state["residual"] if solver["led"] == 1 else min(state["residual"], state["other_residual"])
    if state["separates"] == 0 and residual > max(least, state["settling"]):
        _, worst = residual_of(solver)
        own = rows[max(worst, 0)]["pair"]
        # or the limit of a joint
        a = pairs[own]["body_a"] if own >= 0 else joints[-2 - own]["parent"]
        b = pairs[own]["body_b"] if own >= 0 else joints[-2 - own]["child"]
        if residual > state["residual"]:
            state["residual"], state["residual_body_a"], state["residual_body_b"] = residual, a, b
        if solver["led"] == 0 and residual > state["other_residual"]:
            state["other_residual"], state["other_body_a"], state["other_body_b"] = residual, a, b
    store_island(bodies, joints, drivers, pairs, state)
    return residual <= limit


@kernel
def _into_cones(solver):
    """Clip all impulses to their friction cones, and the moments to their bounds."""
    for k in range(solver["row_count"]):
        into_cone(solver["rows"][k])
    into_bounds(solver)


@kernel
def _return_to_start(solver):
    """Set all impulses to those of the warm start."""
    for k in range(solver["row_count"]):
        copy_vector(solver["rows"][k]["start"], solver["rows"][k]["impulse"])
    for k in range(solver["moment_count"]):
        copy_vector(solver["moments"][k]["start"], solver["moments"][k]["impulse"])


@inlined_kernel
def _is_accepted(solver):
    """Whether the best impulses have converged."""
    return solver["best_residual"] <= max(solver["accepted"], solver["target"])


@kernel
def _rebounds(solver):
    """Whether a row has a rebound speed."""
    for k in range(solver["row_count"]):
        if solver["rows"][k]["asked"] > 0:
            return True
    return False


@kernel
def _stop_rebound(solver):
    """Lower all rebound speeds to 0, and return to the warm start."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        row["floor"], row["asked"] = min(0.0, row["floor"]), min(0.0, row["asked"])
    _return_to_start(solver)


@kernel
def _is_jammed(solver, pairs):
    """Whether a moving surface jams the island: the geometry of its contacts is nearly singular, so that they
    stick only at speeds far above that of the surface."""
    moving, fastest, energy, mass = False, 0.0, 0.0, 0.0
    for m in range(solver["mover_count"]):
        mover = solver["movers"][m]
        if mover["block"] == 0 and mover["inverse_mass"] > 0:
            mass += 1 / mover["inverse_mass"]
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        x, y, z = changed_velocity(row, solver)
        p, u = row["impulse"], row["free"]
        energy += p[0] * x + p[1] * y + p[2] * z
        fastest = max(fastest, u[0] * u[0] + u[1] * u[1] + u[2] * u[2])
        if row["pair"] >= 0:
            square = _surface_square(pairs[row["pair"]])
            moving, fastest = moving or square > 0, max(fastest, square)
    return moving and energy > JAM_RATIO * JAM_RATIO * mass * fastest


@inlined_kernel
def _surface_square(pair):
    """Square of the speed of B's material relative to A's, each relative to its body [m^2/s^2]."""
    a, b = pair["surface_a"], pair["surface_b"]
    return (b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2 + (b[2] - a[2]) ** 2


@kernel
def _sweep_from_zero(solver, state):
    """Take the best impulses of sweeps that start from zero: in so few, a jam does not build up."""
    for k in range(solver["row_count"]):
        solver["rows"][k]["impulse"][:] = 0.0
    for k in range(solver["moment_count"]):
        solver["moments"][k]["impulse"][:] = 0.0
    rebuild(solver)
    solver["best_residual"] = inf
    _sweep(solver, state, MOST_SWEEPS)
    take_best(solver)


@kernel
def solve_loaded(solver, state):
    """Find the best impulses for the loaded rows, starting from their present ones."""
    for k in range(solver["row_count"]):
        copy_vector(solver["rows"][k]["impulse"], solver["rows"][k]["start"])
    for k in range(solver["moment_count"]):
        copy_vector(solver["moments"][k]["impulse"], solver["moments"][k]["start"])
    rebuild(solver)
    if even_out(solver):
        _into_cones(solver)
        rebuild(solver)
    make_passive(solver)
    residual, _ = residual_of(solver)
    solver["best_residual"], solver["work"], solver["accepted"] = inf, 0.0, RESIDUAL_ACCEPTED
    keep_best(solver, residual)
    solver["target"] = RESIDUAL_DENSE if state["dense_substep"] == 1 else RESIDUAL_TARGET
    # in small islands exact solves cost little, and keep the result independent of the order of bodies
    if solver["row_count"] >= INTERIOR_ROWS:
        solver["target"] = max(solver["target"], state["settling"])
    if solver["target"] == RESIDUAL_TARGET:
        state["missed"] |= residual > RESIDUAL_TARGET
        # impulses that stop a drift push back by as much in the next frame: solve that one more exactly
        if state["missed_before"] == 1 and solver["led"] == 0:
            least = max(STEADY_SHARE * RESIDUAL_TARGET, STEADY_ROUNDINGS * _rounding(solver))
            solver["target"] = min(RESIDUAL_TARGET, least)
    if not residual <= solver["target"]:
        if solver["evens"] == 1 and _is_unloaded(solver):
            _load_evenly(solver, state)
        _iterate(solver, state)
        take_best(solver)
    # where friction sticks, corners keep the loads that they had when it began to
    solved = solver["evens"] == 1 and solver["best_residual"] <= solver["target"]
    if solved and even_stuck(solver):
        _into_cones(solver)
        rebuild(solver)
        residual, _ = residual_of(solver)
        solver["best_residual"] = inf
        keep_best(solver, residual)
        if not residual <= solver["target"]:
            _iterate(solver, state)
            take_best(solver)


@kernel
def _is_unloaded(solver):
    """Whether no row has an impulse."""
    for k in range(solver["row_count"]):
        p = solver["rows"][k]["impulse"]
        if p[0] != 0 or p[1] != 0 or p[2] != 0:
            return False
    return True


@kernel
def _load_evenly(solver, state):
    """Start from the most even loads without friction: where joints hold a body against turning, friction on
    any loads obeys Coulomb's law, also on those of the first corners that a sweep visits."""
    rows = solver["rows"]
    for k in range(solver["row_count"]):
        rows[k]["kept_friction"], rows[k]["friction"] = rows[k]["friction"], 0.0
    _sweep(solver, state, EVEN_SWEEPS)
    even_out(solver)
    for k in range(solver["row_count"]):
        rows[k]["friction"] = rows[k]["kept_friction"]
    solver["best_residual"] = inf
    residual, _ = residual_of(solver)
    keep_best(solver, residual)


@kernel
def _rounding(solver):
    """Largest velocity that rounding of a row's impulse hides [m/s]."""
    largest = 0.0
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        p, n = row["impulse"], row["normal"]
        largest = max(largest, ROUNDING * (p[0] * n[0] + p[1] * n[1] + p[2] * n[2]) / row["mass"])
    return largest


@kernel
def _iterate(solver, state):
    """Run sweeps, the interior-point method, Newton's method and more sweeps until one of them converges."""
    rows = solver["row_count"]
    small, alone = rows < INTERIOR_ROWS, rows + solver["moment_count"] == 1
    dense = not small and state["dense_substep"] == 1 and lay_out(solver, state)
    if not dense and (_sweep(solver, state, FIRST_SWEEPS) or (alone and _is_accepted(solver))):
        return
    if not alone:
        # where bodies are jammed, the law of positions does not insist that contacts part
        parts = state["lead"] == 1 and _rebounds(solver)
        most = PARTING_FACTORS if parts else NEWTON_FACTORS
        close = small or (not dense and solver["best_residual"] <= INTERIOR_FROM)
        # where bodies have no room to separate, the interior-point method ends far from a solution
        if close or state["separates"] == 1:
            newton(solver, False, small, most, state)
            take_best(solver)
            if _is_accepted(solver) or parts:
                return
        # from the present impulses; from none; and with all contacts as stiff as the stiffest
        for attempt in range(0 if dense else 1, 3):
            # any load that solves the island
            if attempt > 0:
                take_any_load(solver)
            if attempt < 2:
                take_best(solver)
                interior(solver, attempt == 1, state)
                if solver["best_residual"] <= solver["target"]:
                    return
            take_best(solver)
            newton(solver, attempt == 2, attempt > 0, most, state)
            take_best(solver)
            # a frame that has used half of its work does not try for the last digits
            if state["work_left"] < state["frame_work"] / 2:
                solver["accepted"] = RESIDUAL_OPEN
            if _is_accepted(solver) or parts:
                return
            if state["work_left"] < 0:
                break
        if state["work_left"] >= 0:
            _raise_friction(solver, most, state)
            if _is_accepted(solver):
                return
    # few sweeps where the rebound may be what leaves no solution
    if state["dense_substep"] == 1 or _rebounds(solver):
        _sweep(solver, state, max(DENSE_SWEEPS, DENSE_VISITS // rows))
    else:
        _sweep(solver, state, max(MOST_SWEEPS, MOST_VISITS // rows))


@kernel
def _raise_friction(solver, most, state):
    """Continue the solution without friction to that with all of it, in steps of the coefficients
    (a homotopy); the best impulses stay."""
    rows, reached = solver["rows"], solver["best_residual"]
    for k in range(solver["row_count"]):
        row = rows[k]
        copy_vector(row["best"], row["direction"])
        row["kept_friction"], row["impulse"][:] = row["friction"], 0.0
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        copy_vector(moment["best"], moment["direction"])
        moment["impulse"][:] = 0.0
    for step in range(FRICTION_STEPS + 1):
        for k in range(solver["row_count"]):
            rows[k]["friction"] = rows[k]["kept_friction"] * step / FRICTION_STEPS
        _into_cones(solver)
        rebuild(solver)
        solver["best_residual"] = inf
        residual, _ = residual_of(solver)
        keep_best(solver, residual)
        newton(solver, False, True, most, state)
        take_best(solver)
    if solver["best_residual"] > reached:
        solver["best_residual"] = reached
        for k in range(solver["row_count"]):
            copy_vector(rows[k]["direction"], rows[k]["best"])
        for k in range(solver["moment_count"]):
            copy_vector(solver["moments"][k]["direction"], solver["moments"][k]["best"])
        take_best(solver)


@kernel
def _sweep(solver, state, most):
    """Run at most `most` sweeps over all rows; returns whether they reached the solver's target.

    A share of the last direction is added to all velocities before a sweep, and to an impulse when the sweep
    visits its row.
    """
    rows, movers, count = solver["rows"], solver["movers"], solver["row_count"]
    share = last = 0.0
    for k in range(count):
        rows[k]["swept"][:] = rows[k]["direction"][:] = 0.0
    for k in range(solver["moment_count"]):
        solver["moments"][k]["swept"][:] = solver["moments"][k]["direction"][:] = 0.0
    for m in range(solver["mover_count"]):
        movers[m]["velocity_direction"][:] = movers[m]["omega_direction"][:] = 0.0
        _copy_velocity(movers[m])
    for sweep in range(most):
        for m in range(solver["mover_count"]):
            _advance_mover(movers[m], share)
        even_out(solver)
        change = size = 0.0
        for k in range(count):
            row = rows[k]
            _add_direction(row["impulse"], row["direction"], row["swept"], share)
            step = solve_row(row, solver)
            change, size = max(change, step), size + step * step * row["mass"]
        for k in range(solver["moment_count"]):
            moment = solver["moments"][k]
            _add_direction(moment["impulse"], moment["direction"], moment["swept"], share)
            step = solve_moment(moment, solver)
            change, size = max(change, step), size + step * step * moment["mass"]
        state["counters"][COUNT_SWEEPS] += 1
        # a residual costs half a sweep: skip it while the impulses change too much
        if change < 2 * solver["best_residual"] or sweep == most - 1:
            residual, _ = residual_of(solver)
            keep_best(solver, residual)
            if residual <= solver["target"]:
                return True
        # share of the last direction in the next; restart it if the step grew
        share = size / last if 0 < size <= last else 0.0
        last = size
    return False


@kernel
def _advance_mover(mover, share):
    """Add a share of the last direction to a mover's velocities; update the direction by the sweep's step."""
    v, w, p, q = mover["velocity"], mover["omega"], mover["velocity_before"], mover["omega_before"]
    for i in range(3):
        p[i], q[i] = v[i] - p[i], w[i] - q[i]
    _add_direction(v, mover["velocity_direction"], p, share)
    _add_direction(w, mover["omega_direction"], q, share)
    _copy_velocity(mover)


@kernel
def _copy_velocity(mover):
    copy_vector(mover["velocity"], mover["velocity_before"])
    copy_vector(mover["omega"], mover["omega_before"])


@kernel
def _add_direction(out_vector, direction, step, share):
    """Add a share of the last direction to a vector; update the direction by the sweep's step."""
    for i in range(3):
        direction[i] *= share
        out_vector[i] += direction[i]
        direction[i] += step[i]

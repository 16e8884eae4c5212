"""Newton's method for the contacts of one island: exact to rounding where sweeps converge slowly.

It solves Coulomb's law as an equation (natural map, Alart & Curnier 1991), regularised by the proximal point
method (Rockafellar 1976). With x the change of the movers' velocities,

    g(x) = M x - sum of J^T P(z) = 0,  z = centre - k (u(x) - floor n),  k = mass / compliance,

where P clips an impulse to its friction cone: no tension, friction at most mu times the normal impulse. The
derivative of P is not symmetric, because friction depends on the normal impulse. The centre is the last outer
iterate, so the impulses converge to Coulomb's law itself, whatever the compliance. The first iterations have
soft contacts, whose solution is unique; the later ones are stiffer.
"""

from math import sqrt

from touchstone.reference_impl.core.counters import COUNT_FACTORS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, invert_symmetric
from touchstone.reference_impl.solver.block_matrix import (
    add_row,
    begin_matrix,
    factorise,
    lay_out,
    set_rates,
    solve_factors,
    subtract_impulse,
)
from touchstone.reference_impl.solver.contact_rows import (
    changed_velocity,
    into_cone,
    keep_best,
    rebuild,
    residual_of,
)
from touchstone.reference_impl.solver.face_load import even_out
from touchstone.reference_impl.solver.moment_rows import (
    add_load_changes,
    add_soft_moments,
    advance_moments,
    begin_moment_steps,
    begin_soft_moments,
    follow_loads,
    into_bounds,
    set_moment_rates,
    subtract_soft_moments,
    take_soft_moments,
)
from touchstone.reference_impl.solver.tolerances import NEWTON_INNER, RESIDUAL_ACCEPTED

RESIDUAL_ROUNDING = 1e-14
"""Change of velocity at which an inner minimisation ends, however small the residual is [m/s]."""
COMPLIANCE_FIRST, COMPLIANCE_LAST, COMPLIANCE_LEAST = 0.03, 1e-5, 1e-10
"""Compliance of the proximal problem over the row's own mobility [1]: first, with a unique solution, or the
square root of the residual [m/s] if that is less; last; and least, for towers and jammed bodies."""
COMPLIANCE_ROUNDING = 1e-17
"""Compliance times the residual [m/s] below which rounding exceeds the remaining residual."""
COMPLIANCE_FALL, COMPLIANCE_RISE = 0.3, 5.0
"""Factors of the compliance after a slow decrease of the residual, and after a failed Newton iteration
[1]."""
RESIDUAL_FALL = 0.1
"""Fraction of the residual that an outer iteration may leave before the compliance falls [1]."""
INNER_SHARE = 1e-2
"""Change of velocity over the residual, times the compliance, at which an outer iteration ends [1]."""
NEWTON_STALLS = 4
"""Outer iterations with little progress after which a converged solution is accepted."""
LINE_SHARE, LINE_HALVES = 0.1, 10
"""Least decrease of g.M^-1 g over that of a full Newton step [1], and most halvings of the step."""


@kernel
def newton(solver, evenly, patient, most, state):
    """Improve an island's impulses until they reach the solver's target or stall; stores them by `keep_best`.

    Args:
        evenly: all rows are as stiff as the stiffest. By their own mobility, the rows of a light body are too
            soft for the load of a heavy one that it carries.
        patient: go on, with softer contacts, where an inner solve fails; otherwise, return there.
        most: largest number of factorisations.
    """
    if not lay_out(solver, state):
        return
    rows, count, left = solver["rows"], solver["row_count"], most
    for m in range(solver["mover_count"]):
        invert_symmetric(solver["movers"][m]["inverse_inertia"], solver["movers"][m]["inertia"])
    last, stalled, heaviest = solver["best_residual"], 0, 0.0
    for k in range(count):
        heaviest = max(heaviest, rows[k]["mass"])
    compliance = min(COMPLIANCE_FIRST, sqrt(last))
    while left > 0:
        even_out(solver)
        for k in range(count):
            rows[k]["stiffness"] = (heaviest if evenly else rows[k]["mass"]) / compliance
            copy_vector(rows[k]["impulse"], rows[k]["centre"])
        begin_soft_moments(solver, compliance, heaviest if evenly else 0.0)
        used, solved = _solve_soft(solver, compliance * max(RESIDUAL_ROUNDING, INNER_SHARE * last))
        state["counters"][COUNT_FACTORS] += used
        state["work_left"] -= used * solver["work"]
        left -= used
        if not solved:
            if not patient:
                return
            rebuild(solver)
            compliance = min(1.0, compliance * COMPLIANCE_RISE)
            continue
        for k in range(count):
            p = rows[k]["impulse"]
            p[0], p[1], p[2] = _project(rows[k], 0.0)
            # rounding of a large z can leave the cone
            into_cone(rows[k])
        follow_loads(solver, 0.0)
        take_soft_moments(solver)
        into_bounds(solver)
        rebuild(solver)
        residual, _ = residual_of(solver)
        keep_best(solver, residual)
        if residual <= solver["target"]:
            return
        if residual > RESIDUAL_FALL * last:
            stalled += 1
            if stalled >= NEWTON_STALLS and solver["best_residual"] <= RESIDUAL_ACCEPTED:
                return
            least = min(COMPLIANCE_LAST, max(COMPLIANCE_LEAST, COMPLIANCE_ROUNDING / residual))
            compliance = max(least, compliance * COMPLIANCE_FALL)
        else:
            compliance = max(COMPLIANCE_LAST, compliance * COMPLIANCE_FALL)
        last = residual


@kernel
def _project(row, s):
    """Impulse of a row at fraction s of the step `rate`: z clipped to its friction cone."""
    c, n, u, d, k = row["centre"], row["normal"], row["velocity"], row["rate"], row["stiffness"]
    x = c[0] - k * (u[0] + s * d[0])
    y = c[1] - k * (u[1] + s * d[1])
    z = c[2] - k * (u[2] + s * d[2])
    normal = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - normal * n[0], y - normal * n[1], z - normal * n[2]
    j = max(0.0, normal + k * row["floor"])
    size, limit = sqrt(x * x + y * y + z * z), row["friction"] * j
    scale = limit / size if size > limit else 1.0
    return j * n[0] + scale * x, j * n[1] + scale * y, j * n[2] + scale * z


@kernel
def _derivative(row, out_kernel):
    """Compute k P'(z) at the row's velocity [kg]; returns whether it is nonzero."""
    c, n, u, k, mu = row["centre"], row["normal"], row["velocity"], row["stiffness"], row["friction"]
    x, y, z = c[0] - k * u[0], c[1] - k * u[1], c[2] - k * u[2]
    normal = x * n[0] + y * n[1] + z * n[2]
    j = normal + k * row["floor"]
    if j <= 0:
        return False
    x, y, z = x - normal * n[0], y - normal * n[1], z - normal * n[2]
    size = sqrt(x * x + y * y + z * z)
    # sticking: the identity; sliding: friction rotates with z, and grows with the normal impulse
    across = radial = 1.0
    mixed = 0.0
    if size > mu * j:
        across, radial, mixed = mu * j / size, 0.0, mu
        x, y, z = x / size, y / size, z / size
    t = (x, y, z)
    for i in range(3):
        for m in range(3):
            value = (1 - across) * n[i] * n[m] + (across if i == m else 0.0)
            if radial == 0:
                value += t[i] * (mixed * n[m] - across * t[m])
            out_kernel[i, m] = k * value
    return True


@kernel
def _solve_soft(solver, tolerance):
    """Solve g(x) = 0 from the velocities of the present impulses; sets the rows' `velocity` to the solution.

    Args:
        tolerance: largest change of a row's velocity in a step that ends the iteration [m/s].
    Returns:
        Number of factorisations, and whether the iteration converged.
    """
    rows, count = solver["rows"], solver["row_count"]
    for k in range(count):
        row = rows[k]
        x, y, z = changed_velocity(row, solver)
        u, f = row["velocity"], row["free"]
        u[0], u[1], u[2] = x + f[0], y + f[1], z + f[2]
        row["rate"][:] = 0.0
    begin_moment_steps(solver)
    for i in range(6 * solver["mover_count"]):
        solver["step"][i] = 0.0
    size = _gradient(solver, 0.0)
    for used in range(1, NEWTON_INNER + 1):
        _assemble(solver)
        factorise(solver)
        solve_factors(solver)
        set_rates(solver)
        set_moment_rates(solver)
        # line search: halve the step until g decreases
        fraction = 1.0
        for _ in range(LINE_HALVES):
            changed = _gradient(solver, fraction)
            if changed <= (1 - LINE_SHARE * fraction) * size:
                break
            fraction /= 2
        moved = _advance(solver, fraction)
        # the next step would be shorter by about the factor by which g has fallen
        if min(moved, moved * sqrt(changed / size) if size > 0 else 0.0) <= tolerance:
            return used, True
        size = changed
    return NEWTON_INNER, False


@kernel
def _gradient(solver, s):
    """Compute g at fraction s of the step; returns g.M^-1 g [J]."""
    g, step, movers = solver["gradient"], solver["step"], solver["movers"]
    for m in range(solver["mover_count"]):
        mover = movers[m]
        base, inertia = 6 * mover["place"], mover["inertia"]
        v, w = mover["velocity"], mover["omega"]
        x, y, z = w[0] + s * step[base + 3], w[1] + s * step[base + 4], w[2] + s * step[base + 5]
        for i in range(3):
            g[base + i] = (v[i] + s * step[base + i]) / mover["inverse_mass"]
            g[base + 3 + i] = inertia[i, 0] * x + inertia[i, 1] * y + inertia[i, 2] * z
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        px, py, pz = _project(row, s)
        subtract_impulse(solver, row, px, py, pz)
    follow_loads(solver, s)
    subtract_soft_moments(solver, s)
    size = 0.0
    for m in range(solver["mover_count"]):
        base, inverse = 6 * movers[m]["place"], movers[m]["inverse_inertia"]
        for i in range(3):
            size += movers[m]["inverse_mass"] * g[base + i] * g[base + i]
            for j in range(3):
                size += g[base + 3 + i] * inverse[i, j] * g[base + 3 + j]
    return size


@kernel
def _assemble(solver):
    """Assemble the derivative of g: M + sum of J^T k P' J."""
    begin_matrix(solver)
    for k in range(solver["row_count"]):
        if _derivative(solver["rows"][k], solver["kernel"]):
            add_row(solver, solver["rows"][k])
    follow_loads(solver, 0.0)
    add_soft_moments(solver)
    add_load_changes(solver)


@kernel
def _advance(solver, s):
    """Apply a fraction of the step; returns the largest change of a row's velocity [m/s]."""
    step = solver["step"]
    for m in range(solver["mover_count"]):
        mover = solver["movers"][m]
        base = 6 * mover["place"]
        for i in range(3):
            mover["velocity"][i] += s * step[base + i]
            mover["omega"][i] += s * step[base + 3 + i]
    largest = 0.0
    for k in range(solver["row_count"]):
        u, d = solver["rows"][k]["velocity"], solver["rows"][k]["rate"]
        size = 0.0
        for i in range(3):
            u[i] += s * d[i]
            size += d[i] * d[i]
            d[i] = 0.0
        largest = max(largest, s * sqrt(size))
    return max(largest, advance_moments(solver, s))

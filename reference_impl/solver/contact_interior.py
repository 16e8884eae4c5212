"""Interior-point method for the contacts of one island: it does not cycle where Newton's method does.

Coulomb's law is a complementarity of second-order cones (De Saxce & Feng 1998; Acary & Cadoux 2013). With u
the velocity of a row over its floor, p its impulse, and the shift s = mu |u_t|,

    v = (u_n + s, mu u_t)  and  q = (p_n, p_t / mu)

lie in the cone |t| <= n and are orthogonal. Here all v and q start inside the cone and stay there. A step
solves the linearised equations for products v.q that are equal in all rows and smaller than before, with the
scaling of Nesterov & Todd and the corrector of Mehrotra. No row is open, stuck or sliding before the end.

The derivative of the shift makes the matrix unsymmetric. After a short step the method takes less of that
derivative; without it, each step is one of a convex problem. Vectors are scaled by the square root of the
row's mass. Newton's method finishes the result.
"""

from math import sqrt

from touchstone.reference_impl.core.counters import COUNT_FACTORS
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import invert_symmetric
from touchstone.reference_impl.solver.contact_rows import (
    into_cone,
    keep_best,
    rebuild,
    residual_of,
)
from touchstone.reference_impl.solver.envelope import (
    add_row,
    begin_matrix,
    factorise,
    lay_out,
    set_rates,
    solve_factors,
    subtract_impulse,
)
from touchstone.reference_impl.solver.interior_start import (
    along_axes,
    begin_afar,
    begin_near,
    meeting_on_axes,
    on_axes,
    set_axes,
)
from touchstone.reference_impl.solver.moment_rows import (
    add_soft_moments,
    begin_moment_steps,
    begin_soft_moments,
    into_bounds,
    step_soft_moments,
    subtract_soft_moments,
)
from touchstone.reference_impl.solver.tolerances import INTERIOR_BOUNDARY, INTERIOR_CENTRE, NEWTON_MOST

INTERIOR_STEPS, INTERIOR_ALLOWANCE = 120, 5e7
"""Most steps of the interior-point method (10 to 30 usual, 60 in jams), and multiplications of an island's
steps for which it runs after the frame's are used up (30 bodies in a heap)."""
INTERIOR_FEW, INTERIOR_MOST = 40, 4e9
"""Most steps of the interior-point method after NEWTON_MOST, and multiplications over the frame's up to which
it runs, 2 to 3 s; after these, sweeps alone."""
INTERIOR_TARGET, INTERIOR_LEAST, INTERIOR_STALLS = 1e-8, 1e-6, 4
"""Residual at which it ends and leaves the rest to Newton's method, except in dense substeps; residual below
which it ends where rounding stops it, and steps that tell so [m/s]."""
MOMENT_COMPLIANCE = 1e-3
"""Compliance of the moments' proximal steps over their own mobility [1]: their error falls by about that in a
full step."""
INTERIOR_SHORT, INTERIOR_LONG = 0.1, 0.8
"""Shares of a full step below which it takes less of the derivative of friction, and above which more [1]."""


@kernel
def interior(solver, afar, state):
    """Find an island's impulses to about INTERIOR_TARGET, or to the target of a dense substep; stores them by
    `keep_best`.

    It does nothing if the frame's budget does not allow INTERIOR_STEPS factorisations.

    Args:
        afar: start without impulses, otherwise near the present ones. From afar it takes more steps, but it
            also converges where the present impulses are misleading.
    """
    fits, work, left = lay_out(solver), solver["work"], state["newton_work"]
    if not fits or left < -INTERIOR_MOST or INTERIOR_STEPS * work > max(left, INTERIOR_ALLOWANCE):
        return
    most = INTERIOR_STEPS if left > -NEWTON_MOST else INTERIOR_FEW
    for m in range(solver["mover_count"]):
        invert_symmetric(solver["movers"][m]["inverse_inertia"], solver["movers"][m]["inertia"])
    set_axes(solver)
    if afar:
        begin_afar(solver)
    else:
        begin_near(solver)
    target = solver["target"] if state["dense_substep"] == 1 else INTERIOR_TARGET
    share, least, stalled = 1.0, 1e300, 0
    for _ in range(most):
        _set_impulses(solver)
        inside, mean, gap = _set_scaling(solver, share)
        if not inside:
            break
        residual, _ = residual_of(solver)
        keep_best(solver, residual)
        stalled = stalled + 1 if residual > least / 2 else 0
        least = min(least, residual)
        if residual <= target or (stalled >= INTERIOR_STALLS and least <= INTERIOR_LEAST):
            break
        begin_matrix(solver)
        for k in range(solver["row_count"]):
            _set_kernel(solver["rows"][k], solver["kernel"])
            add_row(solver, solver["rows"][k])
        add_soft_moments(solver)
        factorise(solver)
        state["counters"][COUNT_FACTORS] += 1
        state["newton_work"] -= work
        _begin_gradient(solver)
        _solve(solver)
        length = _longest(solver, 1.0)
        # products that vanish before the gaps do leave the method at the boundary, far from a solution
        goal = max(max(INTERIOR_CENTRE, (1 - length) ** 3) * mean, min(mean, gap * gap))
        _correct_gradient(solver, goal)
        _solve(solver)
        length = INTERIOR_BOUNDARY * _longest(solver, 1 / INTERIOR_BOUNDARY)
        if length < INTERIOR_SHORT:
            share = max(0.0, share - 0.5)
        elif length > INTERIOR_LONG:
            share = min(1.0, share + 0.25)
        _advance(solver, length)
        step_soft_moments(solver, length)


@kernel
def _set_scaling(solver, share):
    """Compute the scaling W of each row, W q = W^-1 v, the `gap`, the error of v's definition, and the
    `slope`, the derivative of the shift with respect to v_t times `share`.

    Returns:
        (inside, mean, gap): whether all vectors are inside their cones, out of which rounding may put them at
        the end; the mean of v.q over all rows [m^2/s^2], and the largest component of their gaps [m/s].
    """
    total, largest = 0.0, 0.0
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        u, p, w, gap, slope = row["velocity"], row["centre"], row["scaling"], row["gap"], row["slope"]
        across, other = sqrt(u[1] * u[1] + u[2] * u[2]), sqrt(p[1] * p[1] + p[2] * p[2])
        if not (u[0] > across and p[0] > other):
            return False, 0.0, 0.0
        x, y, z = meeting_on_axes(row, solver)
        gap[0], gap[1], gap[2] = u[0] - x - across, u[1] - y, u[2] - z
        largest = max(largest, abs(gap[0]), abs(gap[1]), abs(gap[2]))
        part = share / across if across > 0 else 0.0
        slope[0], slope[1] = part * u[1], part * u[2]
        product = u[0] * p[0] + u[1] * p[1] + u[2] * p[2]
        total += product
        one, two = sqrt((u[0] - across) * (u[0] + across)), sqrt((p[0] - other) * (p[0] + other))
        row["determinant"] = one * two
        row["stretch"] = sqrt(one / two)
        # v and q of determinant 1, and the point halfway between them
        size = sqrt(2 * (1 + product / row["determinant"]))
        one, two = 1 / (one * size), 1 / (two * size)
        w[0], w[1], w[2] = one * u[0] + two * p[0], one * u[1] - two * p[1], one * u[2] - two * p[2]
        row["bend"] = 1 / (1 + w[0])
    return True, total / solver["row_count"], largest


@kernel
def _set_impulses(solver):
    """Set the impulses of the rows and the movers' velocities from the vectors q, and centre the
    moments for a proximal step."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        p, q = row["impulse"], row["centre"]
        p[0], p[1], p[2] = along_axes(row, q[0], q[1], q[2])
        into_cone(row)
    into_bounds(solver)
    rebuild(solver)
    begin_soft_moments(solver, MOMENT_COMPLIANCE, 0.0)
    begin_moment_steps(solver)


@inlined_kernel
def _scaled(row, sign, a, b, c):
    """Apply a row's scaling W (sign 1) or its inverse (sign -1) to the vector (a, b, c)."""
    w, x, y = row["scaling"], sign * row["scaling"][1], sign * row["scaling"][2]
    factor = row["stretch"] if sign > 0 else 1 / row["stretch"]
    across = x * b + y * c
    turned = a + across * row["bend"]
    return factor * (w[0] * a + across), factor * (b + turned * x), factor * (c + turned * y)


@inlined_kernel
def _unscale(row, x, y, z):
    """Apply W^-2 to a vector: a change of v becomes a change of q."""
    w, factor = row["scaling"], 1 / (row["stretch"] * row["stretch"])
    double = 2 * (w[0] * x - w[1] * y - w[2] * z)
    return factor * (double * w[0] - x), factor * (y - double * w[1]), factor * (z - double * w[2])


@kernel
def _set_kernel(row, out_kernel):
    """Compute minus the derivative of a row's impulse with respect to its velocity [kg]."""
    axes, slope = row["axes"], row["slope"]
    for m in range(3):
        y, z = axes[1, m], axes[2, m]
        x, y, z = _unscale(row, axes[0, m] + slope[0] * y + slope[1] * z, y, z)
        out_kernel[0, m], out_kernel[1, m], out_kernel[2, m] = along_axes(row, x, y, z)


@kernel
def _begin_gradient(solver):
    """Compute the gradient of a step towards products v.q of 0, and set the rows' `centred` to 0."""
    movers, g = solver["movers"], solver["gradient"]
    for m in range(solver["mover_count"]):
        mover = movers[m]
        base, inertia, v, w = 6 * mover["place"], mover["inertia"], mover["velocity"], mover["omega"]
        for i in range(3):
            g[base + i] = v[i] / mover["inverse_mass"]
            g[base + 3 + i] = inertia[i, 0] * w[0] + inertia[i, 1] * w[1] + inertia[i, 2] * w[2]
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        gap, slope = row["gap"], row["slope"]
        row["centred"][:] = 0.0
        x, y, z = _unscale(row, gap[0] + slope[0] * gap[1] + slope[1] * gap[2], gap[1], gap[2])
        _subtract_change(solver, row, x, y, z)
    subtract_soft_moments(solver, 0.0)


@kernel
def _correct_gradient(solver, goal):
    """Change the gradient for products v.q of `goal`, and for the product of the changes of v and q of the
    step solved last; sets the rows' `centred`."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        u, c, stretch = row["velocity"], row["centred"], row["stretch"]
        x, y, z = _correction(row)
        # goal / (v_n^2 - |v_t|^2)
        part = goal / (row["determinant"] * stretch * stretch)
        c[0], c[1], c[2] = part * u[0] - x, -part * u[1] - y, -part * u[2] - z
        _subtract_change(solver, row, c[0], c[1], c[2])


@kernel
def _subtract_change(solver, row, x, y, z):
    """Subtract J^T p of a row from the gradient, with p the impulse of a change (x, y, z) of q."""
    x, y, z = along_axes(row, x, y, z)
    subtract_impulse(solver, row, x, y, z)


@kernel
def _solve(solver):
    """Solve for the step of the present gradient; sets the rows' `direction` (of v) and `swept` (of q)."""
    solve_factors(solver)
    set_rates(solver)
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        d, c, gap, slope = row["rate"], row["centred"], row["gap"], row["slope"]
        u, p, q = row["direction"], row["swept"], row["centre"]
        x, y, z = on_axes(row, d[0], d[1], d[2])
        y, z = y - gap[1], z - gap[2]
        x += slope[0] * y + slope[1] * z - gap[0]
        u[0], u[1], u[2] = x, y, z
        x, y, z = _unscale(row, x, y, z)
        p[0], p[1], p[2] = c[0] - q[0] - x, c[1] - q[1] - y, c[2] - q[2] - z


@inlined_kernel
def _correction(row):
    """Change of q that balances the product of the changes `direction` and `swept` (Mehrotra)."""
    q, u, p = row["centre"], row["direction"], row["swept"]
    l_0, l_1, l_2 = _scaled(row, 1, q[0], q[1], q[2])
    a, b, c = _scaled(row, -1, u[0], u[1], u[2])
    d, e, f = _scaled(row, 1, p[0], p[1], p[2])
    x, y, z = a * d + b * e + c * f, a * e + d * b, a * f + d * c
    first, inverse = (l_0 * x - l_1 * y - l_2 * z) / row["determinant"], 1 / l_0
    return _scaled(row, -1, first, inverse * (y - first * l_1), inverse * (z - first * l_2))


@kernel
def _longest(solver, most):
    """Longest step over the full one, at most `most`, that keeps all vectors in their cones."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        most = _exit(row["centre"], row["swept"], _exit(row["velocity"], row["direction"], most))
    return most


@kernel
def _exit(v, d, most):
    """Least positive s at which v + s d leaves the cone, at most `most`."""
    x, y, z = v[0] + most * d[0], v[1] + most * d[1], v[2] + most * d[2]
    # the cone is convex
    if x > 0 and x * x > y * y + z * z:
        return most
    a = d[0] * d[0] - d[1] * d[1] - d[2] * d[2]
    b = v[0] * d[0] - v[1] * d[1] - v[2] * d[2]
    size = sqrt(v[1] * v[1] + v[2] * v[2])
    c = (v[0] - size) * (v[0] + size)
    if d[0] < 0:
        most = min(most, -v[0] / d[0])
    root = b * b - a * c
    if root >= 0:
        q = -(b + sqrt(root)) if b > 0 else -(b - sqrt(root))
        for one in (q / a if a != 0 else 0.0, c / q if q != 0 else 0.0):
            if one > 0:
                most = min(most, one)
    return most


@kernel
def _advance(solver, s):
    """Apply a fraction of the step to the rows."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        for i in range(3):
            row["velocity"][i] += s * row["direction"][i]
            row["centre"][i] += s * row["swept"][i]

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
from touchstone.reference_impl.core.solver_conventions import (
    INTERIOR_ALLOWANCE,
    INTERIOR_BOUNDARY,
    INTERIOR_CENTRE,
    INTERIOR_FEW,
    INTERIOR_LEAST,
    INTERIOR_LONG,
    INTERIOR_MOST,
    INTERIOR_SHORT,
    INTERIOR_STALLS,
    INTERIOR_STEPS,
    INTERIOR_TARGET,
    NEWTON_MOST,
)
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
    begin_afar,
    begin_near,
    cone_friction,
    meeting_on_axes,
    on_axes,
)


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
    if afar:
        begin_afar(solver)
    else:
        begin_near(solver)
    target = solver["target"] if state["dense_substep"] == 1 else INTERIOR_TARGET
    share, least, stalled = 1.0, 1e300, 0
    for _ in range(most):
        _set_impulses(solver)
        if not _set_scaling(solver):
            break
        residual, _ = residual_of(solver)
        keep_best(solver, residual)
        stalled = stalled + 1 if residual > least / 2 else 0
        least = min(least, residual)
        if residual <= target or (stalled >= INTERIOR_STALLS and least <= INTERIOR_LEAST):
            break
        begin_matrix(solver)
        for k in range(solver["row_count"]):
            _set_kernel(solver["rows"][k], share, solver["kernel"])
            add_row(solver, solver["rows"][k])
        factorise(solver)
        state["counters"][COUNT_FACTORS] += 1
        state["newton_work"] -= work
        mean = _mean_product(solver)
        _begin_gradient(solver)
        _solve(solver)
        length = _longest(solver, 1.0)
        # products that vanish before the gaps do leave the method at the boundary, far from a solution
        goal = max(max(INTERIOR_CENTRE, (1 - length) ** 3) * mean, min(mean, _largest_gap(solver) ** 2))
        _correct_gradient(solver, goal)
        _solve(solver)
        length = INTERIOR_BOUNDARY * _longest(solver, 1 / INTERIOR_BOUNDARY)
        if length < INTERIOR_SHORT:
            share = max(0.0, share - 0.5)
        elif length > INTERIOR_LONG:
            share = min(1.0, share + 0.25)
        _advance(solver, length)


@inlined_kernel
def _form(v):
    """v_n^2 - |v_t|^2 of a vector v: positive inside the cone."""
    size = sqrt(v[1] * v[1] + v[2] * v[2])
    return (v[0] - size) * (v[0] + size)


@kernel
def _set_scaling(solver):
    """Compute the scaling W of each row, W q = W^-1 v, and its `gap`, the error of v's definition.

    Returns:
        Whether all vectors are inside their cones; rounding may put them outside at the end.
    """
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        u, p, w, gap, q = row["velocity"], row["centre"], row["scaling"], row["gap"], sqrt(row["mass"])
        one, two = _form(u), _form(p)
        if not (one > 0 and two > 0 and u[0] > 0 and p[0] > 0):
            return False
        x, y, z = meeting_on_axes(row, solver["movers"])
        gap[0] = u[0] - q * x - sqrt(u[1] * u[1] + u[2] * u[2])
        gap[1], gap[2] = u[1] - q * y, u[2] - q * z
        one, two = sqrt(one), sqrt(two)
        row["stretch"] = sqrt(one / two)
        cosine = (u[0] * p[0] + u[1] * p[1] + u[2] * p[2]) / (one * two)
        size = 2 * sqrt((1 + cosine) / 2)
        w[0] = (u[0] / one + p[0] / two) / size
        w[1], w[2] = (u[1] / one - p[1] / two) / size, (u[2] / one - p[2] / two) / size
    return True


@kernel
def _set_impulses(solver):
    """Set the impulses of the rows and the movers' velocities from the vectors q."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        p, n, t, s, q, mu = (
            row["centre"],
            row["normal"],
            row["across_1"],
            row["across_2"],
            sqrt(row["mass"]),
            cone_friction(row),
        )
        for i in range(3):
            row["impulse"][i] = q * (p[0] * n[i] + mu * (p[1] * t[i] + p[2] * s[i]))
        into_cone(row)
    rebuild(solver)


@kernel
def _mean_product(solver):
    """Mean of v.q over all rows [J]."""
    total = 0.0
    for k in range(solver["row_count"]):
        u, p = solver["rows"][k]["velocity"], solver["rows"][k]["centre"]
        total += u[0] * p[0] + u[1] * p[1] + u[2] * p[2]
    return total / solver["row_count"]


@kernel
def _largest_gap(solver):
    """Largest component of the rows' `gap` [sqrt(J)]."""
    largest = 0.0
    for k in range(solver["row_count"]):
        gap = solver["rows"][k]["gap"]
        largest = max(largest, abs(gap[0]), abs(gap[1]), abs(gap[2]))
    return largest


@kernel
def _scale(row, sign, v):
    """Apply a row's scaling W (sign 1) or its inverse (sign -1) to a vector."""
    return _scaled(row, sign, v[0], v[1], v[2])


@kernel
def _scaled(row, sign, a, b, c):
    """Apply a row's scaling W (sign 1) or its inverse (sign -1) to the vector (a, b, c)."""
    w, x, y = row["scaling"], sign * row["scaling"][1], sign * row["scaling"][2]
    factor = row["stretch"] if sign > 0 else 1 / row["stretch"]
    across = x * b + y * c
    turned = a + across / (1 + w[0])
    return factor * (w[0] * a + across), factor * (b + turned * x), factor * (c + turned * y)


@kernel
def _unscale(row, x, y, z):
    """Apply W^-2 to a vector: a change of v becomes a change of q."""
    w, factor = row["scaling"], 1 / (row["stretch"] * row["stretch"])
    double = 2 * (w[0] * x - w[1] * y - w[2] * z)
    return factor * (double * w[0] - x), factor * (y - double * w[1]), factor * (z - double * w[2])


@kernel
def _set_kernel(row, share, out_kernel):
    """Compute minus the derivative of a row's impulse with respect to its velocity [kg], and the row's
    `slope`: the derivative of the shift with respect to v_t, times `share`."""
    n, t, s, mu, mass = row["normal"], row["across_1"], row["across_2"], cone_friction(row), row["mass"]
    u, slope = row["velocity"], row["slope"]
    size = sqrt(u[1] * u[1] + u[2] * u[2])
    share = share / size if size > 0 else 0.0
    slope[0], slope[1] = share * u[1], share * u[2]
    for m in range(3):
        x, y, z = n[m], mu * t[m], mu * s[m]
        x, y, z = _unscale(row, x + slope[0] * y + slope[1] * z, y, z)
        for i in range(3):
            out_kernel[i, m] = mass * (x * n[i] + mu * (y * t[i] + z * s[i]))


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


@kernel
def _correct_gradient(solver, goal):
    """Change the gradient for products v.q of `goal`, and for the product of the changes of v and q of the
    step solved last; sets the rows' `centred`."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        u, c = row["velocity"], row["centred"]
        form = _form(u)
        x, y, z = _correction(row)
        c[0], c[1], c[2] = goal * u[0] / form - x, -goal * u[1] / form - y, -goal * u[2] / form - z
        _subtract_change(solver, row, c[0], c[1], c[2])


@kernel
def _subtract_change(solver, row, x, y, z):
    """Subtract J^T p of a row from the gradient, with p the impulse of a change (x, y, z) of q."""
    n, t, s, q = row["normal"], row["across_1"], row["across_2"], sqrt(row["mass"])
    x, y, z = q * x, q * cone_friction(row) * y, q * cone_friction(row) * z
    subtract_impulse(
        solver,
        row,
        x * n[0] + y * t[0] + z * s[0],
        x * n[1] + y * t[1] + z * s[1],
        x * n[2] + y * t[2] + z * s[2],
    )


@kernel
def _solve(solver):
    """Solve for the step of the present gradient; sets the rows' `direction` (of v) and `swept` (of q)."""
    solve_factors(solver)
    set_rates(solver)
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        d, c, gap, slope, q = row["rate"], row["centred"], row["gap"], row["slope"], sqrt(row["mass"])
        x, y, z = on_axes(row, d[0], d[1], d[2])
        x, y, z = q * x - gap[0], q * y - gap[1], q * z - gap[2]
        x += slope[0] * y + slope[1] * z
        u, p = row["direction"], row["swept"]
        u[0], u[1], u[2] = x, y, z
        x, y, z = _unscale(row, x, y, z)
        for i in range(3):
            p[i] = c[i] - row["centre"][i]
        p[0] -= x
        p[1] -= y
        p[2] -= z


@kernel
def _correction(row):
    """Change of q that balances the product of the changes `direction` and `swept` (Mehrotra)."""
    l_0, l_1, l_2 = _scale(row, 1, row["centre"])
    a, b, c = _scale(row, -1, row["direction"])
    d, e, f = _scale(row, 1, row["swept"])
    x, y, z = a * d + b * e + c * f, a * e + d * b, a * f + d * c
    size = sqrt(l_1 * l_1 + l_2 * l_2)
    first = (l_0 * x - l_1 * y - l_2 * z) / ((l_0 - size) * (l_0 + size))
    y, z = (y - first * l_1) / l_0, (z - first * l_2) / l_0
    return _scaled(row, -1, first, y, z)


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
    c = _form(v)
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

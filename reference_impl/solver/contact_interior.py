"""Interior-point method for the contacts of one island: it does not cycle where Newton's method does.

Coulomb's law is a complementarity of second-order cones (De Saxce & Feng 1998; Acary & Cadoux 2013). With u
the velocity of a row over its floor, p its impulse, and the shift s = mu |u_t|,

    v = (u_n + s, mu u_t)  and  q = (p_n, p_t / mu)

lie in the cone |t| <= n and are orthogonal. Here all v and q start inside the cone and stay there. A step
solves the linearised equations for products v.q that are equal in all rows and smaller than before, with the
scaling of Nesterov & Todd and the corrector of Mehrotra. No row is open, stuck or sliding before the end.

A row with rolling or torsional friction has such a cone for each of its bounds (`interior_cones`).

The derivative of the shift makes the matrix unsymmetric. After a short step the method takes less of that
derivative; without it, each step is one of a convex problem. Where bodies are wedged, impulses may grow
without end and still hold them: each step is a proximal one (Friedlander & Orban 2012), which leaves impulses
that nothing asks to change. Vectors are scaled by the square root of the row's mass. Newton's method finishes
the result.
"""

from math import sqrt

from touchstone.reference_impl.core.counters import COUNT_FACTORS
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import invert_symmetric
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
    into_cone,
    keep_best,
    rebuild,
    residual_of,
)
from touchstone.reference_impl.solver.interior_cones import (
    along_axes,
    correction,
    mean_square,
    on_axes,
    set_cones,
    set_kernels,
    set_scaling,
    stiffness,
    unscale,
    unscale_across,
)
from touchstone.reference_impl.solver.interior_start import begin_afar, begin_near
from touchstone.reference_impl.solver.link_rows import add_listed, add_product, list_blocks, list_turns
from touchstone.reference_impl.solver.moment_rows import (
    add_to_outer,
    clear_outer,
    into_bounds,
    set_moment_rates,
    subtract_moment,
)
from touchstone.reference_impl.solver.tolerances import INTERIOR_BOUNDARY, INTERIOR_CENTRE

INTERIOR_STEPS = 120
"""Most steps of the interior-point method (10 to 30 usual, 60 in jams)."""
INTERIOR_TARGET, INTERIOR_STALLS = 1e-8, 4
"""Residual at which it ends and leaves the rest to Newton's method [m/s]; in dense substeps it goes on to
their target, and ends after so many steps that do not halve the residual."""
INTERIOR_SHORT, INTERIOR_LONG, INTERIOR_CEILING = 0.1, 0.4, 0.9
"""Shares of a full step below which it takes half of the derivative of friction, and above which more; and
ratio to a share that was too large to which it returns at most, until two steps are long: otherwise it may
cycle [1]."""


@kernel
def interior(solver, afar, state):
    """Find an island's impulses to about INTERIOR_TARGET, or to the target of a dense substep; stores them by
    `keep_best`.

    It does nothing if the island is too large (`lay_out`).

    Args:
        afar: start without impulses, otherwise near the present ones. From afar it takes more steps, but it
            also converges where the present impulses are misleading.
    """
    if not lay_out(solver, state):
        return
    for m in range(solver["mover_count"]):
        invert_symmetric(solver["movers"][m]["inverse_inertia"], solver["movers"][m]["inertia"])
    set_cones(solver)
    if afar:
        begin_afar(solver)
    else:
        begin_near(solver)
    target = solver["target"] if state["dense_substep"] == 1 else INTERIOR_TARGET
    share, ceiling, least, stalled, lasting = 1.0, 1.0, 1e300, 0, 0
    for _ in range(INTERIOR_STEPS):
        _set_impulses(solver)
        inside, mean, gap = set_scaling(solver, share)
        if not inside:
            break
        residual, _ = residual_of(solver)
        keep_best(solver, residual)
        stalled = stalled + 1 if residual > least / 2 else 0
        least = min(least, residual)
        if residual <= target or (stalled >= INTERIOR_STALLS and least <= INTERIOR_TARGET):
            break
        set_kernels(solver, mean / mean_square(solver))
        begin_matrix(solver)
        _add_derivatives(solver)
        factorise(solver)
        state["counters"][COUNT_FACTORS] += 1
        state["work_left"] -= solver["work"]
        _solve(solver, 0.0)
        length = _longest(solver, 1.0)
        # products that vanish before the gaps do leave the method at the boundary, far from a solution
        goal = max(max(INTERIOR_CENTRE, (1 - length) ** 3) * mean, min(mean, gap * gap))
        _solve(solver, goal)
        length = INTERIOR_BOUNDARY * _longest(solver, 1 / INTERIOR_BOUNDARY)
        lasting = lasting + 1 if length > INTERIOR_LONG else 0
        if length < INTERIOR_SHORT:
            ceiling = INTERIOR_CEILING * share if share > 0.5 else ceiling
            share *= 0.5
        elif lasting > 0:
            ceiling = 1.0 if lasting > 1 else ceiling
            share = min(ceiling, share + 0.25)
        _advance(solver, length)


@kernel
def _set_impulses(solver):
    """Set the impulses of the rows and moments and the movers' velocities from the vectors q."""
    for k in range(solver["moment_count"]):
        solver["moments"][k]["impulse"][:] = 0.0
    for c in range(solver["cone_count"]):
        cone = solver["cones"][c]
        if cone["moment"] >= 0:
            p, q = solver["moments"][cone["moment"]]["impulse"], cone["load"]
            x, y, z = along_axes(cone, 0.0, q[1], q[2])
            p[0], p[1], p[2] = p[0] + x, p[1] + y, p[2] + z
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        cone = solver["cones"][row["first_cone"]]
        p, q = row["impulse"], cone["load"]
        p[0], p[1], p[2] = along_axes(cone, q[0], q[1], q[2])
        into_cone(row)
    into_bounds(solver)
    rebuild(solver)


@kernel
def _add_derivatives(solver):
    """Add J^T K J of all rows to the matrix, with K minus the derivative of the impulses with respect to the
    velocities [kg]."""
    k = solver["kernel"]
    for r in range(solver["row_count"]):
        row = solver["rows"][r]
        first, count = row["first_cone"], row["cone_count"]
        cone = solver["cones"][first]
        axes, slope = cone["axes"], cone["slope"]
        for m in range(3):
            y, z = axes[1, m], axes[2, m]
            if count == 1:
                x, y, z = unscale(cone, axes[0, m] + slope[0] * y + slope[1] * z, y, z)
            else:
                x = 0.0
                y, z = unscale_across(cone, y, z)
            k[0, m], k[1, m], k[2, m] = along_axes(cone, x, y, z)
        add_row(solver, row)
        if count > 1:
            _add_shared(solver, row)


@kernel
def _add_shared(solver, row):
    """Add the part of the moment of a row, and that of the impulse that its cones share."""
    first = row["first_cone"]
    end, k, h = first + row["cone_count"], solver["kernel"], solver["cones"][first]["shared"]
    moment = solver["moments"][solver["cones"][first + 1]["moment"]]
    k[:, :] = 0.0
    for c in range(first + 1, end):
        cone = solver["cones"][c]
        for m in range(3):
            y, z = unscale_across(cone, cone["axes"][1, m], cone["axes"][2, m])
            x, y, z = along_axes(cone, 0.0, y, z)
            k[0, m], k[1, m], k[2, m] = k[0, m] + x, k[1, m] + y, k[2, m] + z
    list_turns(solver, moment)
    add_listed(solver)
    clear_outer(solver)
    for c in range(first, end):
        cone = solver["cones"][c]
        if c == first:
            list_blocks(solver, row)
        elif c == first + 1:
            list_turns(solver, moment)
        lean, slope, unit = cone["lean"], cone["slope"], cone["unit"]
        x, y, z = along_axes(cone, h, h * lean[0], h * lean[1])
        add_to_outer(solver, x, y, z, 0)
        x, y, z = along_axes(cone, 1 / unit, (lean[0] + slope[0]) / unit, (lean[1] + slope[1]) / unit)
        add_to_outer(solver, x, y, z, 1)
    add_product(solver)


@kernel
def _centre(solver, goal):
    """Set the cones' `centred` for products v.q of `goal`, less the product of the changes of v and q of the
    step solved last; for a goal of 0, to 0."""
    for c in range(solver["cone_count"]):
        cone = solver["cones"][c]
        u, centred, stretch = cone["speed"], cone["centred"], cone["stretch"]
        if goal == 0:
            centred[:] = 0.0
            continue
        x, y, z = correction(cone)
        # goal / (v_n^2 - |v_t|^2)
        part = goal / (cone["determinant"] * stretch * stretch)
        centred[0], centred[1], centred[2] = part * u[0] - x, -part * u[1] - y, -part * u[2] - z


@kernel
def _set_gradient(solver):
    """Compute the gradient of a step to the cones' `centred`."""
    movers, g = solver["movers"], solver["gradient"]
    for m in range(solver["mover_count"]):
        mover = movers[m]
        base, inertia, v, w = 6 * mover["place"], mover["inertia"], mover["velocity"], mover["omega"]
        for i in range(3):
            g[base + i] = v[i] / mover["inverse_mass"]
            g[base + 3 + i] = inertia[i, 0] * w[0] + inertia[i, 1] * w[1] + inertia[i, 2] * w[2]
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        if row["cone_count"] > 1:
            _subtract_shared(solver, row)
            continue
        cone = solver["cones"][row["first_cone"]]
        gap, slope, c, (x, y, z) = cone["gap"], cone["slope"], cone["centred"], _drift(solver, cone)
        x += gap[0] + slope[0] * gap[1] + slope[1] * gap[2]
        x, y, z = unscale(cone, x, y + gap[1], z + gap[2])
        x, y, z = along_axes(cone, c[0] + x, c[1] + y, c[2] + z)
        subtract_impulse(solver, row, x, y, z)


@inlined_kernel
def _drift(solver, cone):
    """Change of v by which a proximal step holds back the change of q to `centred`."""
    softness, q, c = solver["softness"], cone["load"], cone["centred"]
    return softness * (q[0] - c[0]), softness * (q[1] - c[1]), softness * (q[2] - c[2])


@kernel
def _subtract_shared(solver, row):
    """Subtract the impulses of a row with several cones from the gradient, and set the cones' `aim`."""
    first, total = row["first_cone"], 0.0
    end = first + row["cone_count"]
    for c in range(first, end):
        cone = solver["cones"][c]
        lean, slope, gap, aim = cone["lean"], cone["slope"], cone["gap"], cone["aim"]
        x, y, z = _drift(solver, cone)
        x, y, z = unscale(cone, x, y, z)
        aim[0], aim[1], aim[2] = cone["centred"][0] + x, cone["centred"][1] + y, cone["centred"][2] + z
        total += aim[0] / stiffness(cone) + gap[0]
        total += (lean[0] + slope[0]) * gap[1] + (lean[1] + slope[1]) * gap[2]
    j = solver["cones"][first]["shared"] * total
    for c in range(first, end):
        cone = solver["cones"][c]
        lean, aim = cone["lean"], cone["aim"]
        y, z = unscale_across(cone, cone["gap"][1], cone["gap"][2])
        rest = j - aim[0]
        x, y, z = along_axes(cone, j, aim[1] + y + lean[0] * rest, aim[2] + z + lean[1] * rest)
        if cone["moment"] < 0:
            subtract_impulse(solver, row, x, y, z)
        else:
            subtract_moment(solver, solver["moments"][cone["moment"]], x, y, z)


@kernel
def _solve(solver, goal):
    """Solve for the step to products v.q of `goal` (`_centre`), and set those of v and q of all cones."""
    softness = solver["softness"]
    _centre(solver, goal)
    _set_gradient(solver)
    solve_factors(solver)
    set_rates(solver)
    set_moment_rates(solver)
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        first, normal, total = row["first_cone"], 0.0, 0.0
        for c in range(first, first + row["cone_count"]):
            cone = solver["cones"][c]
            d = row["rate"] if cone["moment"] < 0 else solver["moments"][cone["moment"]]["rate"]
            gap, slope, u, lean = cone["gap"], cone["slope"], cone["speed_step"], cone["lean"]
            x, y, z = on_axes(cone, d[0], d[1], d[2])
            y, z = y - gap[1], z - gap[2]
            normal += x + slope[0] * y + slope[1] * z - gap[0]
            u[0], u[1], u[2] = normal, y, z
            if row["cone_count"] > 1:
                total += cone["aim"][0] / stiffness(cone) - lean[0] * y - lean[1] * z
        for c in range(first, first + row["cone_count"]):
            cone = solver["cones"][c]
            u, p, q, centred = cone["speed_step"], cone["load_step"], cone["load"], cone["centred"]
            if row["cone_count"] > 1:
                lean, j = cone["lean"], solver["cones"][first]["shared"] * (total - normal)
                u[0] = (cone["aim"][0] - j) / stiffness(cone) - lean[0] * u[1] - lean[1] * u[2]
            x, y, z = _drift(solver, cone)
            x, y, z = unscale(cone, u[0] - x, u[1] - y, u[2] - z)
            p[0], p[1], p[2] = centred[0] - q[0] - x, centred[1] - q[1] - y, centred[2] - q[2] - z
            for i in range(3):
                u[i] += softness * p[i]


@kernel
def _longest(solver, most):
    """Longest step over the full one, at most `most`, that keeps all vectors in their cones."""
    for c in range(solver["cone_count"]):
        cone = solver["cones"][c]
        most = _exit(cone["load"], cone["load_step"], _exit(cone["speed"], cone["speed_step"], most))
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
    """Apply a fraction of the step to the cones."""
    for c in range(solver["cone_count"]):
        cone = solver["cones"][c]
        for i in range(3):
            cone["speed"][i] += s * cone["speed_step"][i]
            cone["load"][i] += s * cone["load_step"][i]

"""Newton's method for the contacts of one island: exact to rounding where sweeps crawl.

Frozen for one outer iteration: the bound of the friction of rows that slide (mu times their pressure), and
for rows that stick the cone of Coulomb (with the shift mu |u_t| of De Saxce & Feng 1998 where they are open).
What is left is convex in the movers' velocities x:

    minimise  x.M x / 2 + sum over rows of |P(z)|^2 / (2 k)-like terms,  z = centre - k (u(x) - floor n),

whose gradient is M x - J^T P(z), P the projection on the row's set of impulses (proximal point method of
Rockafellar 1976, the centre being the last answer, k = mass / compliance). Each step solves M + J^T k P' J.
At the end of all outer iterations the impulses meet Coulomb's law itself.
"""

from math import sqrt

from reference_impl.contact_rows import (
    changed_velocity,
    into_cone,
    keep_best,
    rebuild,
    residual_of,
)
from reference_impl.conventions import (
    COMPLIANCE_FALL,
    COMPLIANCE_FIRST,
    COMPLIANCE_LEAST,
    COMPLIANCE_SLIDING,
    COUNT_FACTORS,
    INNER_SHARE,
    LINE_SHARE,
    LINE_STEPS,
    NEWTON_ALLOWANCE,
    NEWTON_FACTORS,
    NEWTON_INNER,
    NEWTON_STALLS,
    RESIDUAL_ACCEPTED,
    RESIDUAL_FALL,
    RESIDUAL_ROUNDING,
    RESIDUAL_TARGET,
    SECANT_MOST,
    SLIDING,
    SLIP_MIN,
    SLIP_SHARE,
)
from reference_impl.envelope import add_block, factorise, lay_out, solve_factors
from reference_impl.kernel import kernel
from reference_impl.rotation import copy_vector, invert_symmetric


@kernel
def newton(solver, sticking, state):
    """Improve the impulses of an island until they reach RESIDUAL_TARGET or improve no more; `keep_best`.

    Args:
        sticking: begin with rows that all stick, or as the present impulses classify them.
    """
    work = lay_out(solver)
    if work < 0:
        return
    rows, count = solver["rows"], solver["row_count"]
    for m in range(solver["mover_count"]):
        invert_symmetric(solver["movers"][m]["inverse_inertia"], solver["movers"][m]["inertia"])
    # the answer nearest to the start is sought
    compliance, last, stalled = COMPLIANCE_FIRST, solver["best_residual"], 0
    for k in range(count):
        rows[k]["slides"] = 0
    if not sticking:
        _classify(solver, last)
    for k in range(count):
        if sticking:
            rows[k]["slides"] = 1 if rows[k]["friction"] == 0 else 0
            rows[k]["radius"] = rows[k]["shift"] = 0.0
        copy_vector(rows[k]["start"], rows[k]["centre"])
    left = min(NEWTON_FACTORS, int(max(state["newton_work"], NEWTON_ALLOWANCE) / work))
    while left > 0:
        for k in range(count):
            rows[k]["stiffness"] = rows[k]["mass"] / compliance
        used = _minimise(solver, compliance * max(RESIDUAL_ROUNDING, INNER_SHARE * last))
        state["counters"][COUNT_FACTORS] += used
        left -= used
        state["newton_work"] -= used * work
        for k in range(count):
            row = rows[k]
            p = row["impulse"]
            p[0], p[1], p[2] = _project(row, 0.0)
            copy_vector(p, row["centre"])
            into_cone(row)
        rebuild(solver)
        residual, _ = residual_of(solver)
        keep_best(solver, residual)
        if residual <= RESIDUAL_TARGET:
            return
        if residual > RESIDUAL_FALL * last:
            stalled += 1
            if stalled >= NEWTON_STALLS and solver["best_residual"] <= RESIDUAL_ACCEPTED:
                return
            compliance *= COMPLIANCE_FALL
        last = residual
        slides = _classify(solver, residual)
        compliance = max(COMPLIANCE_SLIDING if slides else COMPLIANCE_LEAST, compliance)


@kernel
def _classify(solver, residual):
    """Freeze what makes the problem convex, from the present impulses and velocities.

    Args:
        residual: up to which sliding is the error of an unfinished answer [m/s].
    Returns:
        Whether any row slides.
    """
    any_slides = False
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        p, n, f, mu = row["impulse"], row["normal"], row["free"], row["friction"]
        x, y, z = changed_velocity(row, solver["movers"])
        x, y, z = x + f[0], y + f[1], z + f[2]
        u_n = x * n[0] + y * n[1] + z * n[2]
        slip = sqrt((x - u_n * n[0]) ** 2 + (y - u_n * n[1]) ** 2 + (z - u_n * n[2]) ** 2)
        j = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
        size = sqrt((p[0] - j * n[0]) ** 2 + (p[1] - j * n[1]) ** 2 + (p[2] - j * n[2]) ** 2)
        # a row stuck by too large a bound of its friction goes on to slide
        slid, bound = row["slides"] == 1, mu * j
        if slid:
            bound = min(bound, row["radius"])
        sliding = slip > max(SLIP_MIN, SLIP_SHARE * residual) and size >= SLIDING * bound
        sliding = j > 0 and (sliding or (slid and size > mu * j))
        _set_radius(row, mu * j, sliding and slid)
        row["slides"] = 1 if sliding or mu == 0 else 0
        row["shift"] = 0.0 if j > 0 else mu * slip
        any_slides = any_slides or sliding
    return any_slides


@kernel
def _set_radius(row, wanted, again):
    """Bound of a row's friction for the next iteration: where it slid before, by the secant of what the last
    two bounds led to."""
    used, change = row["radius"], row["radius"] - row["last_radius"]
    row["radius"] = wanted
    if again and change != 0:
        slope = min(SECANT_MOST, max(-SECANT_MOST, (wanted - row["last_wanted"]) / change))
        row["radius"] = max(0.0, (wanted - slope * used) / (1 - slope))
    row["last_radius"], row["last_wanted"] = (used, wanted) if again else (row["radius"], wanted)


@kernel
def _project(row, s):
    """Impulse of a row at fraction s of the step `rate`: z projected on its set."""
    c, n, u, d, k = row["centre"], row["normal"], row["velocity"], row["rate"], row["stiffness"]
    x = c[0] - k * (u[0] + s * d[0])
    y = c[1] - k * (u[1] + s * d[1])
    z = c[2] - k * (u[2] + s * d[2])
    normal = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - normal * n[0], y - normal * n[1], z - normal * n[2]
    size = sqrt(x * x + y * y + z * z)
    if row["slides"] == 1:
        j = max(0.0, normal + k * row["floor"])
        scale = row["radius"] / size if size > row["radius"] else 1.0
        return j * n[0] + scale * x, j * n[1] + scale * y, j * n[2] + scale * z
    mu = row["friction"]
    j = normal + k * (row["floor"] - row["shift"])
    if size <= mu * j:
        return j * n[0] + x, j * n[1] + y, j * n[2] + z
    if mu * size <= -j:
        return 0.0, 0.0, 0.0
    j = (j + mu * size) / (1 + mu * mu)
    scale = mu * j / size
    return j * n[0] + scale * x, j * n[1] + scale * y, j * n[2] + scale * z


@kernel
def _derivative(row, out_kernel):
    """k P'(z) at the row's velocity, symmetric and not negative [kg]; returns whether it is not zero."""
    c, n, u, k, mu = row["centre"], row["normal"], row["velocity"], row["stiffness"], row["friction"]
    x, y, z = c[0] - k * u[0], c[1] - k * u[1], c[2] - k * u[2]
    normal = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - normal * n[0], y - normal * n[1], z - normal * n[2]
    size = sqrt(x * x + y * y + z * z)
    # k times: along the normal, across it, along the sliding, between both
    if row["slides"] == 1:
        along = 1.0 if normal + k * row["floor"] > 0 else 0.0
        across = 1.0 if size <= row["radius"] else row["radius"] / size
        radial, mixed = (1.0 if size <= row["radius"] else 0.0), 0.0
    else:
        j = normal + k * (row["floor"] - row["shift"])
        if size <= mu * j:
            along, across, radial, mixed = 1.0, 1.0, 1.0, 0.0
        elif mu * size <= -j:
            return False
        else:
            share = 1 / (1 + mu * mu)
            along, radial, mixed = share, mu * mu * share, mu * share
            across = mu * (j + mu * size) * share / size
    if along == 0 and across == 0:
        return False
    if size > 0:
        x, y, z = x / size, y / size, z / size
    t = (x, y, z)
    for i in range(3):
        for j in range(3):
            value = (along - across) * n[i] * n[j] + (radial - across) * t[i] * t[j]
            value += mixed * (n[i] * t[j] + t[i] * n[j]) + (across if i == j else 0.0)
            out_kernel[i, j] = k * value
    return True


@kernel
def _minimise(solver, tolerance):
    """Minimise the frozen problem from the impulses' velocities; leaves the rows' `velocity` there.

    Args:
        tolerance: change of a row's velocity in a step that ends it [m/s].
    Returns:
        Factorisations.
    """
    rows, movers, count = solver["rows"], solver["movers"], solver["row_count"]
    for k in range(count):
        row = rows[k]
        x, y, z = changed_velocity(row, movers)
        u, f = row["velocity"], row["free"]
        u[0], u[1], u[2] = x + f[0], y + f[1], z + f[2]
        row["rate"][:] = 0.0
    for used in range(1, NEWTON_INNER + 1):
        _assemble(solver)
        factorise(solver)
        solve_factors(solver)
        fraction = _search_line(solver)
        change = _advance(solver, fraction)
        if change <= tolerance:
            return used
    return NEWTON_INNER


@kernel
def _assemble(solver):
    """Gradient, and the matrix of second derivatives in its envelope."""
    g, size = solver["gradient"], 6 * solver["mover_count"]
    last = size - 1
    for i in range(solver["offset"][last] + last + 1):
        solver["entries"][i] = 0.0
    for m in range(solver["mover_count"]):
        mover = solver["movers"][m]
        base, mass, inertia = 6 * mover["place"], 1 / mover["inverse_mass"], mover["inertia"]
        v, w = mover["velocity"], mover["omega"]
        for i in range(3):
            g[base + i] = mass * v[i]
            g[base + 3 + i] = inertia[i, 0] * w[0] + inertia[i, 1] * w[1] + inertia[i, 2] * w[2]
            solver["entries"][solver["offset"][base + i] + base + i] = mass
            for j in range(i + 1):
                solver["entries"][solver["offset"][base + 3 + i] + base + 3 + j] = inertia[i, j]
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        px, py, pz = _project(row, 0.0)
        a, b = row["a"], row["b"]
        if b >= 0:
            _subtract(g, 6 * solver["movers"][b]["place"], row["r_b"], px, py, pz)
        if a >= 0:
            _subtract(g, 6 * solver["movers"][a]["place"], row["r_a"], -px, -py, -pz)
        if not _derivative(row, solver["kernel"]):
            continue
        if b >= 0:
            p = solver["movers"][b]["place"]
            add_block(solver, p, p, row["r_b"], row["r_b"], 1.0)
        if a >= 0:
            q = solver["movers"][a]["place"]
            add_block(solver, q, q, row["r_a"], row["r_a"], 1.0)
            if b >= 0:
                if p > q:
                    add_block(solver, p, q, row["r_b"], row["r_a"], -1.0)
                else:
                    add_block(solver, q, p, row["r_a"], row["r_b"], -1.0)


@kernel
def _subtract(g, base, r, px, py, pz):
    """Subtract J^T p of one side from the gradient."""
    g[base] -= px
    g[base + 1] -= py
    g[base + 2] -= pz
    g[base + 3] -= r[1] * pz - r[2] * py
    g[base + 4] -= r[2] * px - r[0] * pz
    g[base + 5] -= r[0] * py - r[1] * px


@kernel
def _search_line(solver):
    """Fraction of the step at which the objective is least, roughly; sets the rows' `rate`."""
    step, movers = solver["step"], solver["movers"]
    start = bend = 0.0
    for m in range(solver["mover_count"]):
        mover = movers[m]
        base, mass, inertia = 6 * mover["place"], 1 / mover["inverse_mass"], mover["inertia"]
        v, w = mover["velocity"], mover["omega"]
        for i in range(3):
            turned = 0.0
            for j in range(3):
                turned += inertia[i, j] * step[base + 3 + j]
            start += mass * v[i] * step[base + i] + w[i] * turned
            bend += mass * step[base + i] * step[base + i] + step[base + 3 + i] * turned
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        d = row["rate"]
        d[:] = 0.0
        if row["b"] >= 0:
            _add_rate(step, 6 * movers[row["b"]]["place"], row["r_b"], 1.0, d)
        if row["a"] >= 0:
            _add_rate(step, 6 * movers[row["a"]]["place"], row["r_a"], -1.0, d)
    first = start - _row_slope(solver, 0.0)
    early, late, slope_early = 0.0, 1.0, first
    slope_late = start + bend - _row_slope(solver, 1.0)
    if slope_late <= LINE_SHARE * abs(first):
        return 1.0
    side = 0
    s = 1.0
    for _ in range(LINE_STEPS):
        if slope_late <= slope_early:
            break
        s = (early * slope_late - late * slope_early) / (slope_late - slope_early)
        slope = start + s * bend - _row_slope(solver, s)
        if abs(slope) <= LINE_SHARE * abs(first):
            return s
        if slope > 0:
            late, slope_late = s, slope
            if side == 1:
                slope_early /= 2
            side = 1
        else:
            early, slope_early = s, slope
            if side == -1:
                slope_late /= 2
            side = -1
    return early if early > 0 else s


@kernel
def _add_rate(step, base, r, sign, out_rate):
    """Add the change of a row's velocity by one side's step."""
    x, y, z = step[base + 3], step[base + 4], step[base + 5]
    out_rate[0] += sign * (step[base] + y * r[2] - z * r[1])
    out_rate[1] += sign * (step[base + 1] + z * r[0] - x * r[2])
    out_rate[2] += sign * (step[base + 2] + x * r[1] - y * r[0])


@kernel
def _row_slope(solver, s):
    """Power of all rows' impulses along the step, at its fraction s."""
    total = 0.0
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        x, y, z = _project(row, s)
        d = row["rate"]
        total += x * d[0] + y * d[1] + z * d[2]
    return total


@kernel
def _advance(solver, s):
    """Take a fraction of the step; returns the largest change of a row's velocity [m/s]."""
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
    return largest

"""Contact rows of one island: velocities, Coulomb's law at one contact point, and the residual of all rows.

Conventions: u = free + J x is the velocity of B relative to A at a contact point, x the change of the movers'
velocities by the impulses. Coulomb's law: u.n >= floor and impulse.n >= 0, one of them with equality;
friction is at most mu times impulse.n, and exactly that, opposite to the sliding, if there is any.
"""

from math import inf, isnan, sqrt

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.solver.link_rows import link_velocity, push_link
from touchstone.reference_impl.solver.moment_rows import (
    copy_moments,
    moment_work,
    oppose_mean_turn,
    push_moments,
    worst_moment,
)
from touchstone.reference_impl.solver.tolerances import RESIDUAL_ACCEPTED, RESIDUAL_OPEN, ROUNDING

SLIDE_STEPS = 40
"""Iterations for the friction of one sliding row; up to 5 are usual."""
SLIDE_ROUNDING, SLIDE_CLOSE = 1e-15, 1e-7
"""Relative deviation from the cone at which that friction has converged, some roundings, and deviation after
which one step of Newton's method makes it so [1]."""
SPEED_LEAST, SLIDE_MOST = 1e-100, 1e100
"""Slowest approach that gets an impulse [m/s], and largest ratio of the sliding velocity to friction for
which friction is computed [1/kg]: their squares neither underflow nor overflow."""


@kernel
def changed_velocity(row, solver):
    """Change of a row's velocity by all impulses of its island [m/s]."""
    movers = solver["movers"]
    x = y = z = 0.0
    if row["b"] >= 0:
        v, w, r = movers[row["b"]]["velocity"], movers[row["b"]]["omega"], row["r_b"]
        x, y, z = _point_velocity(v, w, r)
    if row["a"] >= 0:
        v, w, r = movers[row["a"]]["velocity"], movers[row["a"]]["omega"], row["r_a"]
        p, q, s = _point_velocity(v, w, r)
        x, y, z = x - p, y - q, z - s
    if row["link_b"] >= 0:
        p, q, s = link_velocity(solver, row["link_b"], row["r_b"])
        x, y, z = x + p, y + q, z + s
    if row["link_a"] >= 0:
        p, q, s = link_velocity(solver, row["link_a"], row["r_a"])
        x, y, z = x - p, y - q, z - s
    return x, y, z


@kernel
def _point_velocity(v, w, r):
    return (
        v[0] + w[1] * r[2] - w[2] * r[1],
        v[1] + w[2] * r[0] - w[0] * r[2],
        v[2] + w[0] * r[1] - w[1] * r[0],
    )


@kernel
def push_movers(row, solver, px, py, pz):
    """Apply an impulse (px, py, pz) on B [N s], and its opposite on A, to a row's movers."""
    movers = solver["movers"]
    if row["b"] >= 0:
        _push(movers[row["b"]], row["r_b"], px, py, pz)
    if row["a"] >= 0:
        _push(movers[row["a"]], row["r_a"], -px, -py, -pz)
    if row["link_b"] >= 0:
        push_link(solver, row["link_b"], row["r_b"], px, py, pz)
    if row["link_a"] >= 0:
        push_link(solver, row["link_a"], row["r_a"], -px, -py, -pz)


@kernel
def _push(mover, r, px, py, pz):
    m, s, v, w = mover["inverse_inertia"], mover["inverse_mass"], mover["velocity"], mover["omega"]
    tx, ty, tz = r[1] * pz - r[2] * py, r[2] * px - r[0] * pz, r[0] * py - r[1] * px
    v[0] += s * px
    v[1] += s * py
    v[2] += s * pz
    w[0] += m[0, 0] * tx + m[0, 1] * ty + m[0, 2] * tz
    w[1] += m[1, 0] * tx + m[1, 1] * ty + m[1, 2] * tz
    w[2] += m[2, 0] * tx + m[2, 1] * ty + m[2, 2] * tz


@kernel
def rebuild(solver):
    """Recompute the velocities of the movers from the impulses of all rows."""
    movers = solver["movers"]
    for m in range(solver["mover_count"]):
        movers[m]["velocity"][:] = 0.0
        movers[m]["omega"][:] = 0.0
    for k in range(solver["row_count"]):
        p = solver["rows"][k]["impulse"]
        if p[0] != 0 or p[1] != 0 or p[2] != 0:
            push_movers(solver["rows"][k], solver, p[0], p[1], p[2])
    push_moments(solver)


@kernel
def into_cone(row):
    """Clip a row's impulse to its friction cone: no tension, friction at most mu times the normal impulse."""
    p, n = row["impulse"], row["normal"]
    j = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
    x, y, z = p[0] - j * n[0], p[1] - j * n[1], p[2] - j * n[2]
    size, limit = sqrt(x * x + y * y + z * z), row["friction"] * max(0.0, j)
    scale = limit / size if size > limit else 1.0
    j = max(0.0, j)
    p[0], p[1], p[2] = j * n[0] + scale * x, j * n[1] + scale * y, j * n[2] + scale * z


@kernel
def normal_load(row):
    """Normal impulse of a row [N s]."""
    p, n = row["impulse"], row["normal"]
    return p[0] * n[0] + p[1] * n[1] + p[2] * n[2]


@kernel
def normal_speed(row, solver):
    """Velocity of a row along its normal [m/s]."""
    n, f = row["normal"], row["free"]
    x, y, z = changed_velocity(row, solver)
    return n[0] * (x + f[0]) + n[1] * (y + f[1]) + n[2] * (z + f[2])


@kernel
def residual_of(solver):
    """Largest violation of Coulomb's law over all rows [m/s], and its row.

    The violation is the change of the impulse p by one projected step: |p_n - q| / m with
    q = max(0, p_n - m (u_n - floor)), and for friction |p_t - clip(p_t - m u_t, mu q)| / m (Alart & Curnier
    1991).
    """
    largest, worst = 0.0, -1
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        change = _violation(row, solver)
        if not change <= largest:
            largest, worst = change, k
        # NaN counts as the largest
        if isnan(change):
            return largest, worst
    change, row = worst_moment(solver)
    return (largest, worst) if change <= largest else (change, row)


@kernel
def _violation(row, solver):
    f, n, p, m = row["free"], row["normal"], row["impulse"], row["mass"]
    x, y, z = changed_velocity(row, solver)
    x, y, z = x + f[0], y + f[1], z + f[2]
    u_n = x * n[0] + y * n[1] + z * n[2]
    j = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
    wanted = max(0.0, j - m * (u_n - row["floor"]))
    tx, ty, tz = p[0] - j * n[0], p[1] - j * n[1], p[2] - j * n[2]
    sx, sy, sz = tx - m * (x - u_n * n[0]), ty - m * (y - u_n * n[1]), tz - m * (z - u_n * n[2])
    size, limit = sqrt(sx * sx + sy * sy + sz * sz), row["friction"] * wanted
    scale = limit / size if size > limit else 1.0
    tx, ty, tz, change = tx - scale * sx, ty - scale * sy, tz - scale * sz, j - wanted
    # rounding of a huge impulse, as of a jammed body, hides any velocity
    hidden = ROUNDING * j / m
    violation = sqrt(change * change + tx * tx + ty * ty + tz * tz) / m
    return max(violation, hidden) if hidden > RESIDUAL_OPEN else violation


@kernel
def keep_best(solver, residual):
    """Store the impulses of all rows if their residual is the smallest so far."""
    if residual < solver["best_residual"]:
        solver["best_residual"] = residual
        for k in range(solver["row_count"]):
            copy_vector(solver["rows"][k]["impulse"], solver["rows"][k]["best"])
        copy_moments(solver, True)


@kernel
def take_best(solver):
    """Restore the best impulses stored."""
    for k in range(solver["row_count"]):
        copy_vector(solver["rows"][k]["best"], solver["rows"][k]["impulse"])
    copy_moments(solver, False)
    rebuild(solver)


@kernel
def _work_terms(solver):
    """Compute -p.(v + u), p.W p and the sum of |p| over all rows.

    Twice the contacts' work is the second value minus the first.
    """
    driving, damping, size = moment_work(solver)
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        p, f, before = row["impulse"], row["free"], row["before"]
        x, y, z = changed_velocity(row, solver)
        damping += p[0] * x + p[1] * y + p[2] * z
        size += sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        for i in range(3):
            driving -= p[i] * (before[i] + f[i])
    return driving, damping, size


@kernel
def pushes_along(solver):
    """Whether the contacts do more positive work on the island than the residual explains."""
    driving, damping, size = _work_terms(solver)
    return damping - driving > RESIDUAL_ACCEPTED * size


@kernel
def reverse_slip(solver):
    """Make friction of all rows oppose the mean sliding of the substep."""
    for k in range(solver["row_count"]):
        oppose_mean_slip(solver["rows"][k])
    oppose_mean_turn(solver)


@kernel
def oppose_mean_slip(row):
    """Make friction of a row oppose the mean sliding of the substep: the sum of that before and after."""
    n, f, before = row["normal"], row["free"], row["before"]
    along = n[0] * before[0] + n[1] * before[1] + n[2] * before[2]
    for i in range(3):
        f[i] += before[i] - along * n[i]
        before[i] = along * n[i]


@kernel
def make_passive(solver):
    """Scale all impulses down until contacts do no positive work on the island (`contact_solver`)."""
    driving, damping, _ = _work_terms(solver)
    scale = 0.0
    if driving > 0:
        scale = 1.0 if damping <= driving else driving / damping
    if scale < 1.0:
        for k in range(solver["row_count"]):
            for i in range(3):
                solver["rows"][k]["impulse"][i] *= scale
        for k in range(solver["moment_count"]):
            for i in range(3):
                solver["moments"][k]["impulse"][i] *= scale
        rebuild(solver)


@inlined_kernel
def prepare_row(row):
    """Compute a row's tangents, normal mobility, and tangential mobility at a fixed normal velocity."""
    n, t, s, w = row["normal"], row["across_1"], row["across_2"], row["mobility"]
    ax, ay, az = abs(n[0]), abs(n[1]), abs(n[2])
    least = 0 if ax <= ay and ax <= az else (1 if ay <= az else 2)
    size = sqrt(1 - n[least] * n[least])
    for i in range(3):
        t[i] = ((1.0 if i == least else 0.0) - n[least] * n[i]) / size
    s[0], s[1], s[2] = n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2], n[0] * t[1] - n[1] * t[0]
    row["mass"] = 3 / (w[0, 0] + w[1, 1] + w[2, 2])
    row["along"], along_1, along_2 = _form(w, n, n), _form(w, n, t), _form(w, n, s)
    row["share_1"], row["share_2"] = along_1 / row["along"], along_2 / row["along"]
    row["across_11"] = _form(w, t, t) - along_1 * row["share_1"]
    row["across_12"] = _form(w, t, s) - along_1 * row["share_2"]
    row["across_22"] = _form(w, s, s) - along_2 * row["share_2"]


@kernel
def _form(w, a, b):
    """Compute a.W b."""
    total = 0.0
    for i in range(3):
        total += a[i] * (w[i, 0] * b[0] + w[i, 1] * b[1] + w[i, 2] * b[2])
    return total


@kernel
def solve_row(row, solver):
    """Solve Coulomb's law in one row with the other impulses fixed; returns the impulse change / m [m/s], and
    sets `swept` to the change."""
    f, p, w = row["free"], row["impulse"], row["mobility"]
    n, t, s = row["normal"], row["across_1"], row["across_2"]
    x, y, z = changed_velocity(row, solver)
    # the velocity without this row's impulse
    x += f[0] - w[0, 0] * p[0] - w[0, 1] * p[1] - w[0, 2] * p[2]
    y += f[1] - w[1, 0] * p[0] - w[1, 1] * p[1] - w[1, 2] * p[2]
    z += f[2] - w[2, 0] * p[0] - w[2, 1] * p[1] - w[2, 2] * p[2]
    missing = row["floor"] - (x * n[0] + y * n[1] + z * n[2])
    j = u = v = 0.0
    if missing > SPEED_LEAST:
        across_1, across_2 = x * t[0] + y * t[1] + z * t[2], x * s[0] + y * s[1] + z * s[2]
        j, u, v = _coulomb(row, missing / row["along"], across_1, across_2)
    x = j * n[0] + u * t[0] + v * s[0] - p[0]
    y = j * n[1] + u * t[1] + v * s[1] - p[1]
    z = j * n[2] + u * t[2] + v * s[2] - p[2]
    d = row["swept"]
    d[0], d[1], d[2] = x, y, z
    if x == 0 and y == 0 and z == 0:
        return 0.0
    p[0], p[1], p[2] = p[0] + x, p[1] + y, p[2] + z
    push_movers(row, solver, x, y, z)
    return sqrt(x * x + y * y + z * z) / row["mass"]


@kernel
def _coulomb(row, plain, x, y):
    """Compute the normal and tangential impulse of one row by Coulomb's law.

    With the normal impulse j = plain - share.q eliminated, friction q leaves the sliding velocity c + A q.
    Sticking: c + A q = 0. Sliding: c + A q = -alpha q with the alpha > 0 for which |q| = mu j, by Newton's
    method for 1 - mu j / |q|, which is nearly linear in alpha. If sticking lies outside the cone, that is
    positive at alpha = 0 and falls without bound, so a solution exists however strong the coupling.

    Args:
        plain: normal impulse without friction [N s].
        x, y: tangential velocity without the row's impulse [m/s].
    """
    mu, a, b, d = row["friction"], row["across_11"], row["across_12"], row["across_22"]
    g, h, along = row["share_1"], row["share_2"], row["along"]
    if mu == 0:
        return plain, 0.0, 0.0
    x, y = x + along * g * plain, y + along * h * plain
    q, r = _friction(a, b, d, x, y)
    j = plain - g * q - h * r
    if j >= 0 and q * q + r * r <= (mu * j) ** 2:
        return j, q, r
    low, high = 0.0, sqrt(x * x + y * y) / (mu * plain)
    # friction is below rounding
    if not high < SLIDE_MOST:
        return plain, 0.0, 0.0
    # exact if q is opposite to c, as where both tangents have the same mobility
    alpha = high - (g * x + h * y) / plain - (a * x * x + 2 * b * x * y + d * y * y) / (x * x + y * y)
    if not alpha > 0:
        alpha = high
    high, last = inf, False
    for _ in range(SLIDE_STEPS):
        q, r = _friction(a + alpha, b, d + alpha, x, y)
        square = q * q + r * r
        size, j = sqrt(square), plain - g * q - h * r
        excess = size - mu * j
        if last or abs(excess) <= SLIDE_ROUNDING * size:
            break
        # Newton's method converges quadratically: the next step is the last
        last = abs(excess) <= SLIDE_CLOSE * size
        if excess > 0:
            low = alpha
        else:
            high = alpha
        u, v = _friction(a + alpha, b, d + alpha, q, r)
        alpha -= excess * square / (mu * ((g * u + h * v) * square + j * (q * u + r * v)))
        if not low < alpha < high:
            alpha, last = (low + high) / 2 if high < inf else 2 * low, False
    # clip to the cone, whatever error remains
    j = max(0.0, j)
    scale = min(1.0, mu * j / size)
    return j, scale * q, scale * r


@inlined_kernel
def _friction(a, b, d, x, y):
    """Compute -A^-1 (x, y)."""
    scale = 1 / (a * d - b * b)
    return scale * (b * y - d * x), scale * (b * x - a * y)

"""Rows of one island: their velocities, Coulomb's law at one contact point, and the residual of all.

Conventions: u = free + J x is the velocity of B against A at a contact point, x the change of the movers'
velocities by the impulses. Coulomb's law: u.n >= floor, impulse.n >= 0, one of both with equality; friction
at most mu times impulse.n, against the sliding where there is some.
"""

from math import sqrt

from reference_impl.conventions import LOCAL_STEPS, RESIDUAL_ACCEPTED, SLIP_MIN
from reference_impl.kernel import kernel
from reference_impl.rotation import copy_vector


@kernel
def changed_velocity(row, movers):
    """Change of a row's velocity by all impulses of its island [m/s]."""
    x = y = z = 0.0
    if row["b"] >= 0:
        v, w, r = movers[row["b"]]["velocity"], movers[row["b"]]["omega"], row["r_b"]
        x, y, z = _point_velocity(v, w, r)
    if row["a"] >= 0:
        v, w, r = movers[row["a"]]["velocity"], movers[row["a"]]["omega"], row["r_a"]
        p, q, s = _point_velocity(v, w, r)
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
def push_movers(row, movers, px, py, pz):
    """Change the velocities of a row's movers by an impulse (px, py, pz) on B [N s]."""
    if row["b"] >= 0:
        _push(movers[row["b"]], row["r_b"], px, py, pz)
    if row["a"] >= 0:
        _push(movers[row["a"]], row["r_a"], -px, -py, -pz)


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
    """Velocities of the movers from the impulses of all rows."""
    movers = solver["movers"]
    for m in range(solver["mover_count"]):
        movers[m]["velocity"][:] = 0.0
        movers[m]["omega"][:] = 0.0
    for k in range(solver["row_count"]):
        p = solver["rows"][k]["impulse"]
        if p[0] != 0 or p[1] != 0 or p[2] != 0:
            push_movers(solver["rows"][k], movers, p[0], p[1], p[2])


@kernel
def into_cone(row):
    """Cut a row's impulse off at its cone: no pull, friction at most mu times the pressure."""
    p, n = row["impulse"], row["normal"]
    j = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
    x, y, z = p[0] - j * n[0], p[1] - j * n[1], p[2] - j * n[2]
    size, limit = sqrt(x * x + y * y + z * z), row["friction"] * max(0.0, j)
    scale = limit / size if size > limit else 1.0
    j = max(0.0, j)
    p[0], p[1], p[2] = j * n[0] + scale * x, j * n[1] + scale * y, j * n[2] + scale * z


@kernel
def residual_of(solver):
    """Largest violation of Coulomb's law over all rows [m/s], and the row that has it.

    Of the impulse p that is the change by one projected step: |p_n - max(0, p_n - m (u_n - floor))| / m, and
    for friction |p_t - (p_t - m u_t, cut off at mu times that)| / m (Alart & Curnier 1991).
    """
    largest, worst = 0.0, -1
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        change = _violation(row, solver["movers"])
        if not change <= largest:
            largest, worst = change, k
    return largest, worst


@kernel
def _violation(row, movers):
    f, n, p, m = row["free"], row["normal"], row["impulse"], row["mass"]
    x, y, z = changed_velocity(row, movers)
    x, y, z = x + f[0], y + f[1], z + f[2]
    u_n = x * n[0] + y * n[1] + z * n[2]
    j = p[0] * n[0] + p[1] * n[1] + p[2] * n[2]
    wanted = max(0.0, j - m * (u_n - row["floor"]))
    tx, ty, tz = p[0] - j * n[0], p[1] - j * n[1], p[2] - j * n[2]
    sx, sy, sz = tx - m * (x - u_n * n[0]), ty - m * (y - u_n * n[1]), tz - m * (z - u_n * n[2])
    size, limit = sqrt(sx * sx + sy * sy + sz * sz), row["friction"] * wanted
    scale = limit / size if size > limit else 1.0
    tx, ty, tz, j = tx - scale * sx, ty - scale * sy, tz - scale * sz, j - wanted
    return sqrt(j * j + tx * tx + ty * ty + tz * tz) / m


@kernel
def keep_best(solver, residual):
    """Keep the impulses of all rows where their residual is the least so far."""
    if residual < solver["best_residual"]:
        solver["best_residual"] = residual
        for k in range(solver["row_count"]):
            copy_vector(solver["rows"][k]["impulse"], solver["rows"][k]["best"])


@kernel
def take_best(solver):
    """Go back to the best impulses kept."""
    for k in range(solver["row_count"]):
        copy_vector(solver["rows"][k]["best"], solver["rows"][k]["impulse"])
    rebuild(solver)


@kernel
def _work_terms(solver):
    """-p.(v + u), p.W p and the sum of |p| over all rows: twice the contacts' work is the second less the
    first."""
    driving = damping = size = 0.0
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        p, f, before = row["impulse"], row["free"], row["before"]
        x, y, z = changed_velocity(row, solver["movers"])
        damping += p[0] * x + p[1] * y + p[2] * z
        size += sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2])
        for i in range(3):
            driving -= p[i] * (before[i] + f[i])
    return driving, damping, size


@kernel
def pushes_along(solver):
    """Whether the contacts do work on the island, beyond what the residual explains."""
    driving, damping, size = _work_terms(solver)
    return damping - driving > RESIDUAL_ACCEPTED * size


@kernel
def reverse_slip(solver):
    """Take friction against the mean sliding of the hold: against the velocity after it, seen from the
    reverse of the sliding before."""
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        n, f, before = row["normal"], row["free"], row["before"]
        along = n[0] * before[0] + n[1] * before[1] + n[2] * before[2]
        for i in range(3):
            f[i] += before[i] - along * n[i]
            before[i] = along * n[i]


@kernel
def make_passive(solver):
    """Scale all impulses down until contacts do no work on the island (`contact_solver`)."""
    driving, damping, _ = _work_terms(solver)
    scale = 0.0
    if driving > 0:
        scale = 1.0 if damping <= driving else driving / damping
    if scale < 1.0:
        for k in range(solver["row_count"]):
            for i in range(3):
                solver["rows"][k]["impulse"][i] *= scale
        rebuild(solver)


@kernel
def solve_row(row, movers, always):
    """Impulse of one row that meets Coulomb's law while the others stay; returns its change over m [m/s].

    Args:
        always: friction is mu times the pressure against any sliding (Eq. 10), not at most that.
    """
    f, p, m, w = row["free"], row["impulse"], row["mass"], row["mobility"]
    x, y, z = changed_velocity(row, movers)
    # the velocity without this row's impulse
    x += f[0] - w[0, 0] * p[0] - w[0, 1] * p[1] - w[0, 2] * p[2]
    y += f[1] - w[1, 0] * p[0] - w[1, 1] * p[1] - w[1, 2] * p[2]
    z += f[2] - w[2, 0] * p[0] - w[2, 1] * p[1] - w[2, 2] * p[2]
    px, py, pz = _coulomb(row, x, y, z, always)
    px, py, pz = px - p[0], py - p[1], pz - p[2]
    if px == 0 and py == 0 and pz == 0:
        return 0.0
    p[0], p[1], p[2] = p[0] + px, p[1] + py, p[2] + pz
    push_movers(row, movers, px, py, pz)
    return sqrt(px * px + py * py + pz * pz) / m


@kernel
def _coulomb(row, x, y, z, always):
    """Impulse by Coulomb's law on what meets with (x, y, z) without it."""
    n, w, mu, floor, old = row["normal"], row["mobility"], row["friction"], row["floor"], row["impulse"]
    v_n = x * n[0] + y * n[1] + z * n[2]
    if v_n >= floor:
        return 0.0, 0.0, 0.0
    wx = w[0, 0] * n[0] + w[0, 1] * n[1] + w[0, 2] * n[2]
    wy = w[1, 0] * n[0] + w[1, 1] * n[1] + w[1, 2] * n[2]
    wz = w[2, 0] * n[0] + w[2, 1] * n[1] + w[2, 2] * n[2]
    along = n[0] * wx + n[1] * wy + n[2] * wz
    if mu == 0:
        j = (floor - v_n) / along
        return j * n[0], j * n[1], j * n[2]
    # sticking: the impulse that leaves `floor` along the normal and no sliding
    a = w[1, 1] * w[2, 2] - w[1, 2] * w[1, 2]
    b = w[0, 2] * w[1, 2] - w[0, 1] * w[2, 2]
    c = w[0, 1] * w[1, 2] - w[0, 2] * w[1, 1]
    g = w[0, 0] * w[2, 2] - w[0, 2] * w[0, 2]
    h = w[0, 1] * w[0, 2] - w[0, 0] * w[1, 2]
    i = w[0, 0] * w[1, 1] - w[0, 1] * w[0, 1]
    d = w[0, 0] * a + w[0, 1] * b + w[0, 2] * c
    u, v, t = floor * n[0] - x, floor * n[1] - y, floor * n[2] - z
    px = (a * u + b * v + c * t) / d
    py = (b * u + g * v + h * t) / d
    pz = (c * u + h * v + i * t) / d
    j = px * n[0] + py * n[1] + pz * n[2]
    tx, ty, tz = px - j * n[0], py - j * n[1], pz - j * n[2]
    size = sqrt(tx * tx + ty * ty + tz * tz)
    slip = sqrt((x - v_n * n[0]) ** 2 + (y - v_n * n[1]) ** 2 + (z - v_n * n[2]) ** 2)
    if j >= 0 and size <= mu * j and not (always and slip > SLIP_MIN):
        return px, py, pz
    # sliding: pressure and friction in turn, from the friction there is
    across = 2 / (w[0, 0] + w[1, 1] + w[2, 2] - along)
    j = old[0] * n[0] + old[1] * n[1] + old[2] * n[2]
    tx, ty, tz = old[0] - j * n[0], old[1] - j * n[1], old[2] - j * n[2]
    for _ in range(LOCAL_STEPS):
        ux = x + w[0, 0] * tx + w[0, 1] * ty + w[0, 2] * tz
        uy = y + w[1, 0] * tx + w[1, 1] * ty + w[1, 2] * tz
        uz = z + w[2, 0] * tx + w[2, 1] * ty + w[2, 2] * tz
        j = max(0.0, (floor - ux * n[0] - uy * n[1] - uz * n[2]) / along)
        ux, uy, uz = tx - across * (ux + j * wx), ty - across * (uy + j * wy), tz - across * (uz + j * wz)
        off = ux * n[0] + uy * n[1] + uz * n[2]
        tx, ty, tz = ux - off * n[0], uy - off * n[1], uz - off * n[2]
        size = sqrt(tx * tx + ty * ty + tz * tz)
        scale = 1.0
        if size > mu * j or (always and size > 0):
            scale = mu * j / size
        tx, ty, tz = scale * tx, scale * ty, scale * tz
    return j * n[0] + tx, j * n[1] + ty, j * n[2] + tz

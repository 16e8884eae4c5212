"""Loads on the contacts of an island with a mechanism: the least ones of equal effect.

Joints take up forces and moments, so contacts on mechanisms leave more loads free than those of a face, and
those of several faces depend on each other. All normal impulses p of an island are made the least ones of
equal effect: what is left of p without the part that moves nothing, J' p = 0. As contacts turn within a
substep, a little of almost every load moves something; a load counts as free whose mobility is NEGLIGIBLE.

What no load moves, no load mends: the rims of two wheels on one axle close at velocities that differ by the
error of their prediction, and a floor in each of them would load one rim of each wheel alone. The part of the
velocities that only free loads change is left out of the floors, up to `slack`: the contacts press together.
"""

from math import sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import dot
from touchstone.reference_impl.core.solver_dtypes import EVEN_ROWS
from touchstone.reference_impl.solver.contact_rows import changed_velocity, normal_load, normal_speed
from touchstone.reference_impl.solver.tolerances import EVEN_ROUNDINGS, ROUNDING

NEGLIGIBLE = 1e-7
"""Mobility of a load over that of a contact, up to which the load is free [1]."""
STUCK, STUCK_HALVINGS = 1e-9, 8
"""Slip of a contact that sticks [m/s], and most halvings of the way to the least impulses, if it leaves a
cone."""
EVEN_SHARE = 1e-3
"""Change of an impulse over the largest load that is worth another solve [1]."""


@kernel
def even_joined(solver):
    """Make the loads of an island with a mechanism the least ones of equal effect, as far as all press;
    returns whether any changes."""
    if solver["evens"] == 0:
        return False
    _find_pressing(solver)
    _leave_gaps(solver)
    n, rows, x, most = solver["even_count"], solver["rows"], solver["even_load"], 0.0
    for k in range(n):
        x[k] = -normal_load(rows[solver["even_rows"][k]])
        most = max(most, -x[k])
    # the part that moves nothing, reversed
    _without(solver["even_basis"], solver["even_rank"], n, x)
    share, largest = 1.0, 0.0
    for k in range(n):
        load = normal_load(rows[solver["even_rows"][k]])
        largest = max(largest, abs(x[k]))
        if load + share * x[k] < 0:
            share = -load / x[k]
    if largest <= EVEN_ROUNDINGS * ROUNDING * most or share == 0:
        return False
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        for i in range(3):
            row["impulse"][i] += share * x[k] * row["normal"][i]
    return True


@kernel
def even_stuck(solver):
    """Make all impulses of an island with a mechanism the least ones of equal effect, where all its loaded
    contacts stick, as far as they stay in their cones; returns whether any changes."""
    n, rows, x = solver["even_count"], solver["rows"], solver["stick_load"]
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        if normal_load(row) > 0 and _slip(row, solver) > STUCK:
            return even_joined(solver)
    rank, most, largest = _find_basis(solver, 3, x, solver["stick_basis"]), 0.0, 0.0
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        p = row["impulse"]
        x[3 * k] = -dot(p, row["normal"])
        x[3 * k + 1], x[3 * k + 2] = -dot(p, row["across_1"]), -dot(p, row["across_2"])
        most = max(most, -x[3 * k])
    _without(solver["stick_basis"], rank, 3 * n, x)
    share = 1.0
    for _ in range(STUCK_HALVINGS):
        inside = True
        for k in range(n):
            row = rows[solver["even_rows"][k]]
            p, load = row["impulse"], normal_load(row)
            across = (
                dot(p, row["across_1"]) + share * x[3 * k + 1],
                dot(p, row["across_2"]) + share * x[3 * k + 2],
            )
            load += share * x[3 * k]
            if load < 0 or sqrt(across[0] ** 2 + across[1] ** 2) > row["friction"] * load:
                inside = False
        if inside:
            break
        share /= 2
    if not inside:
        return False
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        for i in range(3):
            largest = max(largest, share * abs(x[3 * k + i]))
            row["impulse"][i] += share * (
                x[3 * k] * row["normal"][i]
                + x[3 * k + 1] * row["across_1"][i]
                + x[3 * k + 2] * row["across_2"][i]
            )
    return largest > EVEN_SHARE * most


@kernel
def _find_pressing(solver):
    """Find the contacts whose loads are evened out together, all but those without a load that part, and the
    basis of the loads that move anything."""
    rows, n, changed = solver["rows"], 0, False
    for k in range(solver["row_count"]):
        row = rows[k]
        apart = normal_load(row) == 0 and normal_speed(row, solver) - row["asked"] > solver["slack"]
        if row["pair"] < 0 or apart:
            continue
        if n == EVEN_ROWS:
            drop_joined(solver)
            return
        changed = changed or n >= solver["even_count"] or solver["even_rows"][n] != k
        solver["even_rows"][n] = k
        n += 1
    if changed or n != solver["even_count"]:
        solver["even_count"] = n
        solver["even_rank"] = _find_basis(solver, 1, solver["even_load"], solver["even_basis"])


@kernel
def _leave_gaps(solver):
    """Leave the part of the velocities that only free loads change out of the floors, up to `slack`."""
    rows, x, n, most = solver["rows"], solver["even_load"], solver["even_count"], solver["slack"]
    for k in range(solver["row_count"]):
        rows[k]["floor"] = rows[k]["asked"]
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        x[k] = normal_speed(row, solver) - row["asked"]
    _without(solver["even_basis"], solver["even_rank"], n, x)
    for k in range(n):
        rows[solver["even_rows"][k]]["floor"] += max(-most, min(x[k], most))


@kernel
def drop_joined(solver):
    """Even out no loads any more, and ask the floors as they were."""
    for k in range(solver["row_count"]):
        solver["rows"][k]["floor"] = solver["rows"][k]["asked"]
    solver["evens"] = solver["even_count"] = 0


@kernel
def _find_basis(solver, width, x, out_basis):
    """Orthonormal basis of the normal impulses (`width` 1) or of all impulses (3) that move anything, by Gram
    and Schmidt over the coordinates of the movers; returns its rank. x is scratch."""
    rows, n, rank, largest = solver["rows"], width * solver["even_count"], 0, 0.0
    for k in range(solver["even_count"]):
        largest = max(largest, 1 / rows[solver["even_rows"][k]]["mass"])
    for m in range(solver["mover_count"]):
        mover = solver["movers"][m]
        for c in range(6):
            mobility = mover["inverse_mass"] if c < 3 else mover["inverse_inertia"][c - 3, c - 3]
            for k in range(solver["even_count"]):
                row = rows[solver["even_rows"][k]]
                for i in range(width):
                    # what sticks is loaded
                    loaded = width == 1 or normal_load(row) > 0
                    x[width * k + i] = _along(solver, row, m, c, i) if loaded else 0.0
            _without(out_basis, rank, n, x)
            left = 0.0
            for k in range(n):
                left += x[k] * x[k]
            if left * mobility > NEGLIGIBLE * largest and rank < n:
                left = sqrt(left)
                for k in range(n):
                    out_basis[rank, k] = x[k] / left
                rank += 1
    return rank


@kernel
def _without(basis, rank, n, x):
    """Remove from x its part along the first vectors of a basis; twice, as rounding leaves some of it."""
    for _ in range(2):
        for j in range(rank):
            along = 0.0
            for k in range(n):
                along += basis[j, k] * x[k]
            for k in range(n):
                x[k] -= along * basis[j, k]


@kernel
def _along(solver, row, m, c, axis):
    """Velocity of a row along its normal (`axis` 0) or a tangent (1, 2) per coordinate c of mover m."""
    n, total = row["normal"] if axis == 0 else (row["across_1"] if axis == 1 else row["across_2"]), 0.0
    for side in range(2):
        own, link = (row["b"], row["link_b"]) if side else (row["a"], row["link_a"])
        r, sign = (row["r_b"], 1.0) if side else (row["r_a"], -1.0)
        if own == m:
            total += sign * _turned(n, r, c)
        if link >= 0:
            b = m - solver["links"][link]["mover"]
            if 0 <= b < solver["links"][link]["blocks"]:
                z = solver["links"][link]["response"][b, c]
                for i in range(6):
                    total += sign * z[i] * _turned(n, r, i)
    return total


@kernel
def _turned(n, r, c):
    """Velocity along n of the point r of a body, per component c of its velocities."""
    if c < 3:
        return n[c]
    i, j = (c + 1) % 3, (c + 2) % 3
    return r[i] * n[j] - r[j] * n[i]


@kernel
def _slip(row, solver):
    """Speed along the contact plane of a row [m/s]."""
    f = row["free"]
    x, y, z = changed_velocity(row, solver)
    u = (x + f[0], y + f[1], z + f[2])
    return sqrt(dot(u, row["across_1"]) ** 2 + dot(u, row["across_2"]) ** 2)

"""Load on the corners of a face: the most even one.

The velocities of a rigid body tell the sum and the moment of the normal impulses p on its face. Four corners
leave one distribution free: p + t z with sum(z_i) = 0 and sum(z_i x_i) = 0. It limits friction at each corner
and so decides how a body that slides and turns is braked. Of all that press, the solver keeps the one with
the least sum(p_i^2), z.p = 0: that of equally stiff corners, and independent of the order of rows.

Joints take up forces and moments, so faces on mechanisms leave more loads free, and those of several faces
depend on each other. There all normal impulses p of an island are made the least ones of equal effect: what
is left of p without the part that moves nothing, J' p = 0.
"""

from math import sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import dot
from touchstone.reference_impl.core.solver_dtypes import EVEN_ROWS
from touchstone.reference_impl.solver.contact_rows import changed_velocity
from touchstone.reference_impl.solver.tolerances import RESIDUAL_ACCEPTED, ROUNDING

SHARED_NORMAL = 1e-12
"""Difference of the normals' components up to which four points are those of a face [1]."""
STUCK, STUCK_HALVINGS = 1e-9, 8
"""Slip of a contact that sticks [m/s], and most halvings of the way to the least impulses, if it leaves a
cone."""
EVEN_SHARE = 1e-3
"""Change of an impulse over the largest load that is worth another solve [1]."""
EVEN_ROUNDINGS = 64
"""Deviation from the most even load, in roundings of the whole load, that stays: what rests is not moved
[1]."""


@kernel
def find_faces(solver, pairs):
    """List the faces of the loaded rows in `faces`, with z of each corner in `spread`."""
    rows, count = solver["rows"], 0
    for k in range(solver["row_count"]):
        own = rows[k]["pair"]
        if own < 0 or pairs[own]["manifold"] != own:
            continue
        face, found, m = solver["faces"][count], 0, own
        while m >= 0 and found < 4:
            n = pairs[m]["solver_row"]
            # rows that part are not loaded
            if n >= solver["row_count"] or rows[n]["pair"] != m:
                break
            face[found] = n
            found, m = found + 1, pairs[m]["next_point"]
        if found == 4 and _spread(rows, face):
            count += 1
    solver["face_count"] = count
    find_motions(solver)


@kernel
def _spread(rows, face):
    """Compute z of four coplanar points from the areas of their triangles; returns whether they are."""
    size = 0.0
    for k in range(4):
        row = rows[face[k]]
        for i in range(3):
            if abs(row["normal"][i] - rows[face[0]]["normal"][i]) > SHARED_NORMAL:
                return False
        area = 0.0
        for m in range(1, 4):
            # along the edges of the triangle of the other three
            x, y = _in_plane(rows[face[0]], rows[face[(k + m) % 4]])
            u, v = _in_plane(rows[face[0]], rows[face[(k + m % 3 + 1) % 4]])
            area += x * v - y * u
        row["spread"] = area if k % 2 == 0 else -area
        size += area * area
    return size > 0


@kernel
def _in_plane(first, row):
    """Place of a row's point relative to the first one's, along that one's tangents."""
    x, y = 0.0, 0.0
    for i in range(3):
        # a body that does not move has no levers
        way = row["r_b"][i] - first["r_b"][i] if first["b"] >= 0 else row["r_a"][i] - first["r_a"][i]
        x, y = x + way * first["across_1"][i], y + way * first["across_2"][i]
    return x, y


@kernel
def even_out(solver):
    """Make the load on all faces the most even one that presses; returns whether any changes."""
    if solver["joined"] == 1:
        return even_all(solver)
    rows, changed = solver["rows"], False
    for f in range(solver["face_count"]):
        face, over, size, total = solver["faces"][f], 0.0, 0.0, 0.0
        for k in range(4):
            row = rows[face[k]]
            load, z = _load(row), row["spread"]
            over, size, total = over + z * load, size + z * z, total + load
        share = -over / size if abs(over) > EVEN_ROUNDINGS * ROUNDING * total * sqrt(size) else 0.0
        for k in range(4):
            row = rows[face[k]]
            load, z = _load(row), row["spread"]
            if load + share * z < 0:
                share = -load / z
            elif load == 0 and share * z > 0 and _parts(row, solver):
                share = 0.0
        if share != 0:
            changed = True
            for k in range(4):
                row = rows[face[k]]
                for i in range(3):
                    row["impulse"][i] += share * row["spread"] * row["normal"][i]
    return changed


@kernel
def find_motions(solver):
    """Find the orthonormal basis of the loads of an island with a mechanism that move anything, J J'."""
    rows, n = solver["rows"], 0
    solver["even_count"] = solver["even_rank"] = 0
    if solver["joined"] == 0:
        return
    for k in range(solver["row_count"]):
        if rows[k]["pair"] >= 0:
            if n == EVEN_ROWS:
                return
            solver["even_rows"][n] = k
            n += 1
    solver["even_count"] = n
    solver["even_rank"] = _find_basis(solver, 1, solver["even_load"], solver["even_basis"])


@kernel
def _find_basis(solver, width, x, out_basis):
    """Orthonormal basis of the normal impulses (`width` 1) or of all impulses (3) that move anything, by Gram
    and Schmidt over the coordinates of the movers, twice; returns its rank. x is scratch."""
    rows, n, rank = solver["rows"], width * solver["even_count"], 0
    for m in range(solver["mover_count"]):
        for c in range(6):
            size = 0.0
            for k in range(solver["even_count"]):
                row = rows[solver["even_rows"][k]]
                for i in range(width):
                    # what sticks is loaded
                    loaded = width == 1 or _load(row) > 0
                    x[width * k + i] = _along(solver, row, m, c, i) if loaded else 0.0
                    size += x[width * k + i] ** 2
            for _ in range(2):
                _without(out_basis, rank, n, x)
            left = 0.0
            for k in range(n):
                left += x[k] * x[k]
            if left > SHARED_NORMAL * size and rank < n:
                left = sqrt(left)
                for k in range(n):
                    out_basis[rank, k] = x[k] / left
                rank += 1
    return rank


@kernel
def _without(basis, rank, n, x):
    """Remove from x its part along the first vectors of a basis."""
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
def even_stuck(solver):
    """Make all impulses of an island with a mechanism the least ones of equal effect, where all its loaded
    contacts stick, as far as they stay in their cones; returns whether any changes."""
    n, rows, x = solver["even_count"], solver["rows"], solver["stick_load"]
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        if _load(row) > 0 and _slip(row, solver) > STUCK:
            return even_all(solver)
    rank, most, largest = _find_basis(solver, 3, x, solver["stick_basis"]), 0.0, 0.0
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        p = row["impulse"]
        x[3 * k] = -dot(p, row["normal"])
        x[3 * k + 1], x[3 * k + 2] = -dot(p, row["across_1"]), -dot(p, row["across_2"])
        most = max(most, -x[3 * k])
    for _ in range(2):
        _without(solver["stick_basis"], rank, 3 * n, x)
    share = 1.0
    for _ in range(STUCK_HALVINGS):
        inside = True
        for k in range(n):
            row = rows[solver["even_rows"][k]]
            p, load = row["impulse"], _load(row)
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
def _slip(row, solver):
    """Speed along the contact plane of a row [m/s]."""
    f = row["free"]
    x, y, z = changed_velocity(row, solver)
    u = (x + f[0], y + f[1], z + f[2])
    return sqrt(dot(u, row["across_1"]) ** 2 + dot(u, row["across_2"]) ** 2)


@kernel
def _turned(n, r, c):
    """Velocity along n of the point r of a body, per component c of its velocities."""
    if c < 3:
        return n[c]
    i, j = (c + 1) % 3, (c + 2) % 3
    return r[i] * n[j] - r[j] * n[i]


@kernel
def even_all(solver):
    """Make the loads of an island with a mechanism the least ones of equal effect, as far as all press;
    returns whether any changes."""
    n, rows, x, most = solver["even_count"], solver["rows"], solver["even_load"], 0.0
    if n == 0:
        return False
    for k in range(n):
        x[k] = -_load(rows[solver["even_rows"][k]])
        most = max(most, -x[k])
    # the part that moves nothing, reversed
    for _ in range(2):
        _without(solver["even_basis"], solver["even_rank"], n, x)
    share, largest = 1.0, 0.0
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        load = _load(row)
        largest = max(largest, abs(x[k]))
        if load + share * x[k] < 0:
            share = -load / x[k]
        elif load == 0 and x[k] > 0 and _parts(row, solver):
            share = 0.0
    if largest <= EVEN_ROUNDINGS * ROUNDING * most or share == 0:
        return False
    for k in range(n):
        row = rows[solver["even_rows"][k]]
        for i in range(3):
            row["impulse"][i] += share * x[k] * row["normal"][i]
    return True


@kernel
def _load(row):
    """Normal impulse of a row [N s]."""
    p, n = row["impulse"], row["normal"]
    return p[0] * n[0] + p[1] * n[1] + p[2] * n[2]


@kernel
def _parts(row, solver):
    """Whether a row separates faster than its floor."""
    n, f = row["normal"], row["free"]
    x, y, z = changed_velocity(row, solver)
    speed = n[0] * (x + f[0]) + n[1] * (y + f[1]) + n[2] * (z + f[2])
    return speed - row["floor"] > RESIDUAL_ACCEPTED

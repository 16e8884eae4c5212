"""Load on the corners of a face: the most even one.

The velocities of a rigid body tell the sum and the moment of the normal impulses p on its face. Four corners
leave one distribution free: p + t z with sum(z_i) = 0 and sum(z_i x_i) = 0. It limits friction at each corner
and so decides how a body that slides and turns is braked. Of all that press, the solver keeps the one with
the least sum(p_i^2), z.p = 0: that of equally stiff corners, and independent of the order of rows. Mechanisms
leave more loads free (`joined_load`).
"""

from math import sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.solver.contact_rows import normal_load, normal_speed
from touchstone.reference_impl.solver.joined_load import drop_joined, even_joined
from touchstone.reference_impl.solver.tolerances import EVEN_ROUNDINGS, RESIDUAL_ACCEPTED, ROUNDING

SHARED_NORMAL = 1e-12
"""Difference of the normals' components up to which four points are those of a face [1]."""


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
    solver["face_count"], solver["evens"], solver["even_count"] = count, solver["joined"], 0


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
        return even_joined(solver)
    rows, changed = solver["rows"], False
    for f in range(solver["face_count"]):
        face, over, size, total = solver["faces"][f], 0.0, 0.0, 0.0
        for k in range(4):
            row = rows[face[k]]
            load, z = normal_load(row), row["spread"]
            over, size, total = over + z * load, size + z * z, total + load
        share = -over / size if abs(over) > EVEN_ROUNDINGS * ROUNDING * total * sqrt(size) else 0.0
        for k in range(4):
            row = rows[face[k]]
            load, z = normal_load(row), row["spread"]
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
def take_any_load(solver):
    """Even out no loads of an island any more: any that solves it is taken."""
    solver["face_count"] = 0
    drop_joined(solver)


@kernel
def _parts(row, solver):
    """Whether a row separates faster than its floor."""
    return normal_speed(row, solver) - row["floor"] > RESIDUAL_ACCEPTED

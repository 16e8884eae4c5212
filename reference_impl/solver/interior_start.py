"""Starts of the interior-point method, and the vectors on whose cones it works (`contact_interior`)."""

from math import sqrt

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.solver_conventions import INTERIOR_FRICTION, INTERIOR_START
from touchstone.reference_impl.solver.contact_rows import changed_velocity


@inlined_kernel
def cone_friction(row):
    """Coefficient of friction of a row, at least INTERIOR_FRICTION: the cone needs an inside."""
    return max(row["friction"], INTERIOR_FRICTION)


@kernel
def meeting_on_axes(row, movers):
    """Velocity of a row over its floor, as `on_axes` gives it [m/s]."""
    f, n, floor = row["free"], row["normal"], row["floor"]
    x, y, z = changed_velocity(row, movers)
    return on_axes(row, x + f[0] - floor * n[0], y + f[1] - floor * n[1], z + f[2] - floor * n[2])


@kernel
def on_axes(row, x, y, z):
    """Components of a velocity along the normal, and along the tangents times the friction [m/s]."""
    n, t, s, mu = row["normal"], row["across_1"], row["across_2"], cone_friction(row)
    return (
        x * n[0] + y * n[1] + z * n[2],
        mu * (x * t[0] + y * t[1] + z * t[2]),
        mu * (x * s[0] + y * s[1] + z * s[2]),
    )


@kernel
def begin_afar(solver):
    """Start without impulses, on the axes of all cones, at the largest speed of the island."""
    rows, count, speed = solver["rows"], solver["row_count"], 0.0
    for m in range(solver["mover_count"]):
        solver["movers"][m]["velocity"][:] = 0.0
        solver["movers"][m]["omega"][:] = 0.0
    for k in range(count):
        x, y, z = meeting_on_axes(rows[k], solver["movers"])
        speed = max(speed, abs(x), abs(y), abs(z))
    speed *= sqrt(_mean_mass(solver))
    for k in range(count):
        u, p = rows[k]["velocity"], rows[k]["centre"]
        u[0] = p[0] = speed
        u[1] = u[2] = p[1] = p[2] = 0.0


@kernel
def begin_near(solver):
    """Start near the present impulses: of all vectors with equal products v.q, those with q - v of the
    impulses. The products fall with the square of the residual."""
    product = (INTERIOR_START * solver["best_residual"]) ** 2 * _mean_mass(solver)
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        i, n, t, s, q, mu = (
            row["impulse"],
            row["normal"],
            row["across_1"],
            row["across_2"],
            sqrt(row["mass"]),
            cone_friction(row),
        )
        x, y, z = meeting_on_axes(row, solver["movers"])
        x = (i[0] * n[0] + i[1] * n[1] + i[2] * n[2]) / q - q * (x + sqrt(y * y + z * z))
        y = (i[0] * t[0] + i[1] * t[1] + i[2] * t[2]) / (q * mu) - q * y
        z = (i[0] * s[0] + i[1] * s[1] + i[2] * s[2]) / (q * mu) - q * z
        size = sqrt(y * y + z * z)
        if size > 0:
            y, z = y / size, z / size
        _split(x + size, x - size, y, z, product, row["centre"])
        _split(-x - size, size - x, y, z, product, row["velocity"])


@kernel
def _mean_mass(solver):
    """Mean of the rows' masses [kg]."""
    mass = 0.0
    for k in range(solver["row_count"]):
        mass += solver["rows"][k]["mass"] / solver["row_count"]
    return mass


@kernel
def _split(one, two, y, z, product, out_vector):
    """Compute (x + sqrt(x^2 + 4 product)) / 2 of a vector x.

    The root is that of the cone's algebra: of both eigenvalues.

    Args:
        one, two: eigenvalues of x, x_n + |x_t| and x_n - |x_t|.
        y, z: direction of x_t.
    """
    one, two = _positive(one, product), _positive(two, product)
    out_vector[0] = (one + two) / 2
    out_vector[1], out_vector[2] = (one - two) / 2 * y, (one - two) / 2 * z


@inlined_kernel
def _positive(x, product):
    """(x + sqrt(x^2 + 4 product)) / 2, without cancellation."""
    root = sqrt(x * x + 4 * product)
    return (x + root) / 2 if x >= 0 else 2 * product / (root - x)

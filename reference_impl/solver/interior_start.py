"""Starts of the interior-point method, and the vectors on whose cones it works (`contact_interior`)."""

from math import frexp, ldexp, sqrt

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.solver.contact_rows import changed_velocity
from touchstone.reference_impl.solver.tolerances import INTERIOR_FRICTION

INTERIOR_START = 3.0
"""Velocity error that a start near the present impulses allows for, over their residual [1]; its square times
the mean mass is the product v.q of every row."""


@kernel
def set_axes(solver):
    """Set the axes of all rows: the normal, and the tangents times the friction, times the root of the mass.

    The mass is in a unit of 2^k kg, so masses that are all 8 times as large give the same results to the bit.
    The axes turn a velocity to v; their transpose times the unit turns q to an impulse.
    """
    _, exponent = frexp(_mean_mass(solver))
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        row["unit"] = ldexp(1.0, exponent)
        axes, n, t, s, q = row["axes"], row["normal"], row["across_1"], row["across_2"], _root_mass(row)
        mu = q * cone_friction(row)
        for i in range(3):
            axes[0, i], axes[1, i], axes[2, i] = q * n[i], mu * t[i], mu * s[i]


@inlined_kernel
def _root_mass(row):
    """Square root of a row's mass in its unit [1]."""
    return sqrt(row["mass"] / row["unit"])


@inlined_kernel
def cone_friction(row):
    """Coefficient of friction of a row, at least INTERIOR_FRICTION: the cone needs an inside."""
    return max(row["friction"], INTERIOR_FRICTION)


@kernel
def meeting_on_axes(row, solver):
    """Velocity of a row over its floor, as `on_axes` gives it [m/s]."""
    f, n, floor = row["free"], row["normal"], row["floor"]
    x, y, z = changed_velocity(row, solver)
    return on_axes(row, x + f[0] - floor * n[0], y + f[1] - floor * n[1], z + f[2] - floor * n[2])


@inlined_kernel
def on_axes(row, x, y, z):
    """Components of a vector along a row's axes."""
    a = row["axes"]
    return (
        a[0, 0] * x + a[0, 1] * y + a[0, 2] * z,
        a[1, 0] * x + a[1, 1] * y + a[1, 2] * z,
        a[2, 0] * x + a[2, 1] * y + a[2, 2] * z,
    )


@inlined_kernel
def along_axes(row, x, y, z):
    """Sum of a row's axes times x, y and z, times its unit of mass."""
    a, unit = row["axes"], row["unit"]
    x, y, z = unit * x, unit * y, unit * z
    return (
        a[0, 0] * x + a[1, 0] * y + a[2, 0] * z,
        a[0, 1] * x + a[1, 1] * y + a[2, 1] * z,
        a[0, 2] * x + a[1, 2] * y + a[2, 2] * z,
    )


@kernel
def begin_afar(solver):
    """Start without impulses, on the axes of all cones, at the largest speed of the island."""
    rows, count, speed = solver["rows"], solver["row_count"], 0.0
    for m in range(solver["mover_count"]):
        solver["movers"][m]["velocity"][:] = 0.0
        solver["movers"][m]["omega"][:] = 0.0
    for k in range(count):
        x, y, z = meeting_on_axes(rows[k], solver)
        speed = max(speed, max(abs(x), abs(y), abs(z)) / _root_mass(rows[k]))
    speed *= sqrt(_mean_mass(solver) / rows[0]["unit"])
    for k in range(count):
        u, p = rows[k]["velocity"], rows[k]["centre"]
        u[0] = p[0] = speed
        u[1] = u[2] = p[1] = p[2] = 0.0


@kernel
def begin_near(solver):
    """Start near the present impulses: of all vectors with equal products v.q, those with q - v of the
    impulses. The products fall with the square of the residual."""
    mass = _mean_mass(solver) / solver["rows"][0]["unit"]
    product = (INTERIOR_START * solver["best_residual"]) ** 2 * mass
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        i, mass, mu = row["impulse"], row["mass"], cone_friction(row)
        u, v, w = meeting_on_axes(row, solver)
        x, y, z = on_axes(row, i[0], i[1], i[2])
        x = x / mass - u - sqrt(v * v + w * w)
        y, z = y / (mass * mu * mu) - v, z / (mass * mu * mu) - w
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

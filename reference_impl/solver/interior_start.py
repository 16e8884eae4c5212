"""Starts of the interior-point method (`contact_interior`): the vectors v and q of all cones."""

from math import sqrt

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.solver.interior_cones import mean_mass, meeting_on_axes, on_axes

INTERIOR_START = 3.0
"""Velocity error that a start near the present impulses allows for, over their residual [1]; its square times
the mean mass is the product v.q of every cone."""


@kernel
def begin_afar(solver):
    """Start without impulses, on the axes of all cones, at the largest speed of the island."""
    rows, count, speed = solver["rows"], solver["row_count"], 0.0
    for m in range(solver["mover_count"]):
        solver["movers"][m]["velocity"][:] = 0.0
        solver["movers"][m]["omega"][:] = 0.0
    unit = solver["cones"][0]["unit"]
    for k in range(count):
        for c in range(rows[k]["first_cone"], rows[k]["first_cone"] + rows[k]["cone_count"]):
            x, y, z = meeting_on_axes(rows[k], solver["cones"][c], solver)
            speed = max(speed, max(abs(x), abs(y), abs(z)) / sqrt(rows[k]["mass"] / unit))
    speed *= sqrt(mean_mass(solver) / unit)
    for c in range(solver["cone_count"]):
        u, p = solver["cones"][c]["speed"], solver["cones"][c]["load"]
        u[0] = p[0] = speed
        u[1] = u[2] = p[1] = p[2] = 0.0


@kernel
def begin_near(solver):
    """Start near the present impulses: of all vectors with equal products v.q, those with q - v of the
    impulses. The products fall with the square of the residual."""
    mean = mean_mass(solver) / solver["cones"][0]["unit"]
    product = (INTERIOR_START * solver["best_residual"]) ** 2 * mean
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        i, mass, load, normal = row["impulse"], row["mass"], 0.0, 0.0
        for c in range(row["first_cone"], row["first_cone"] + row["cone_count"]):
            cone = solver["cones"][c]
            u, v, w = meeting_on_axes(row, cone, solver)
            if cone["moment"] < 0:
                load, y, z = on_axes(cone, i[0], i[1], i[2])
                normal = u / row["cone_count"]
            else:
                moment = solver["moments"][cone["moment"]]["impulse"]
                _, y, z = on_axes(cone, moment[0], moment[1], moment[2])
            square = mass * cone["bound"] * cone["bound"]
            x = load / mass - normal - sqrt(v * v + w * w)
            y, z = y / square - v, z / square - w
            size = sqrt(y * y + z * z)
            if size > 0:
                y, z = y / size, z / size
            _split(x + size, x - size, y, z, product, cone["load"])
            _split(-x - size, size - x, y, z, product, cone["speed"])


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

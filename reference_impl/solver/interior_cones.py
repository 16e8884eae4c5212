"""Cones of the interior-point method (`contact_interior`): their vectors v and q, scaling and derivatives.

Each row has a cone for its friction, and one for each bound of its moment: across the normal and along it.
The cones of a row share its normal impulse j, the first component of their q; the first components of their v
add up to the row's normal velocity over its floor, plus its shift.

With c the q that a step aims at while v stays, it changes q by c - q - U dv. U is the inverse of W^2 + d,
with W the scaling of Nesterov & Todd and d the softness of a proximal step, the mean of v.q over that of q.q:
it vanishes with v.q. With U_n the first entry of U, U_t the column below it, the lean b = U_t / U_n and the
Schur complement S of U_n, minus the derivative of (j, q_t of all cones) with respect to the row's normal
velocity and the v_t is

    K = h (1, b) (1, b + slope)' + S,  1 / h = sum of 1 / U_n:

of rank one over all cones of the row, and a block for each.
"""

from math import frexp, ldexp, sqrt

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.solver.contact_rows import changed_velocity
from touchstone.reference_impl.solver.moment_rows import turn_velocity
from touchstone.reference_impl.solver.tolerances import INTERIOR_FRICTION


@kernel
def set_cones(solver):
    """Set the cones of all rows, and their axes: the normal, and the tangents times the bound over the normal
    impulse, times the root of the row's mass.

    The mass is in a unit of 2^k kg, so masses that are all 8 times as large give the same results to the bit.
    The axes turn a velocity to v; their transpose times the unit turns q to an impulse.
    """
    _, exponent = frexp(mean_mass(solver))
    unit = ldexp(1.0, exponent)
    solver["cone_count"], m = 0, 0
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        row["first_cone"] = solver["cone_count"]
        q, n, t, s = sqrt(row["mass"] / unit), row["normal"], row["across_1"], row["across_2"]
        _add_cone(solver, -1, unit, q, row["friction"], n, t, s)
        # moments are in the order of their rows
        if m < solver["moment_count"] and solver["moments"][m]["row"] == k:
            moment = solver["moments"][m]
            if moment["rolling"] > 0:
                _add_cone(solver, m, unit, q, moment["rolling"], n, t, s)
            if moment["torsion"] > 0:
                _add_cone(solver, m, unit, q, moment["torsion"], n, n, n)
                solver["cones"][solver["cone_count"] - 1]["axes"][2, :] = 0.0
            m += 1
        row["cone_count"] = solver["cone_count"] - row["first_cone"]


@kernel
def _add_cone(solver, moment, unit, root, bound, n, t, s):
    """Add a cone along the normal n and the tangents t and s; the axis n of a moment is 0."""
    cone = solver["cones"][solver["cone_count"]]
    solver["cone_count"] += 1
    # the cone needs an inside
    cone["moment"], cone["unit"], cone["bound"] = moment, unit, max(bound, INTERIOR_FRICTION)
    axes, across = cone["axes"], root * cone["bound"]
    for i in range(3):
        axes[0, i], axes[1, i], axes[2, i] = root * n[i] if moment < 0 else 0.0, across * t[i], across * s[i]


@kernel
def mean_mass(solver):
    """Mean of the rows' masses [kg]."""
    mass = 0.0
    for k in range(solver["row_count"]):
        mass += solver["rows"][k]["mass"] / solver["row_count"]
    return mass


@kernel
def meeting_on_axes(row, cone, solver):
    """Velocity of a row over its floor, or of its moment, on the axes of a cone."""
    if cone["moment"] >= 0:
        x, y, z = turn_velocity(solver["moments"][cone["moment"]], solver)
        return on_axes(cone, x, y, z)
    f, n, floor = row["free"], row["normal"], row["floor"]
    x, y, z = changed_velocity(row, solver)
    return on_axes(cone, x + f[0] - floor * n[0], y + f[1] - floor * n[1], z + f[2] - floor * n[2])


@inlined_kernel
def on_axes(cone, x, y, z):
    """Components of a vector along the axes of a cone."""
    a = cone["axes"]
    return (
        a[0, 0] * x + a[0, 1] * y + a[0, 2] * z,
        a[1, 0] * x + a[1, 1] * y + a[1, 2] * z,
        a[2, 0] * x + a[2, 1] * y + a[2, 2] * z,
    )


@inlined_kernel
def along_axes(cone, x, y, z):
    """Sum of the axes of a cone times x, y and z, times its unit of mass."""
    a, unit = cone["axes"], cone["unit"]
    x, y, z = unit * x, unit * y, unit * z
    return (
        a[0, 0] * x + a[1, 0] * y + a[2, 0] * z,
        a[0, 1] * x + a[1, 1] * y + a[2, 1] * z,
        a[0, 2] * x + a[1, 2] * y + a[2, 2] * z,
    )


@kernel
def set_scaling(solver, share):
    """Compute the scaling W of each cone, W q = W^-1 v, the `gap`, the error of v's definition, and the
    `slope`, the derivative of the shift with respect to v_t times `share`.

    Returns:
        (inside, mean, gap): whether all vectors are inside their cones, out of which rounding may put them at
        the end; the mean of v.q over all cones [m^2/s^2], and the largest component of their gaps [m/s].
    """
    total, largest = 0.0, 0.0
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        first = row["first_cone"]
        for c in range(first, first + row["cone_count"]):
            cone = solver["cones"][c]
            u, p, gap, slope = cone["speed"], cone["load"], cone["gap"], cone["slope"]
            across, other = sqrt(u[1] * u[1] + u[2] * u[2]), sqrt(p[1] * p[1] + p[2] * p[2])
            if not (u[0] > across and p[0] > other):
                return False, 0.0, 0.0
            x, y, z = meeting_on_axes(row, cone, solver)
            gap[0], gap[1], gap[2] = u[0] - x - across, u[1] - y, u[2] - z
            if c > first:
                solver["cones"][first]["gap"][0] += gap[0]
                gap[0] = 0.0
            largest = max(largest, abs(gap[1]), abs(gap[2]))
            part = share / across if across > 0 else 0.0
            slope[0], slope[1] = part * u[1], part * u[2]
            product = u[0] * p[0] + u[1] * p[1] + u[2] * p[2]
            total += product
            _scale(cone, across, other, product)
        largest = max(largest, abs(solver["cones"][first]["gap"][0]))
    return True, total / solver["cone_count"], largest


@inlined_kernel
def _scale(cone, across, other, product):
    """Set the scaling of a cone, for |v_t|, |q_t| and v.q."""
    u, p, w = cone["speed"], cone["load"], cone["scaling"]
    one, two = sqrt((u[0] - across) * (u[0] + across)), sqrt((p[0] - other) * (p[0] + other))
    cone["determinant"] = one * two
    cone["stretch"] = sqrt(one / two)
    # v and q of determinant 1, and the point halfway between them
    size = sqrt(2 * (1 + product / cone["determinant"]))
    one, two = 1 / (one * size), 1 / (two * size)
    w[0], w[1], w[2] = one * u[0] + two * p[0], one * u[1] - two * p[1], one * u[2] - two * p[2]
    cone["bend"] = 1 / (1 + w[0])


@kernel
def set_kernels(solver, softness):
    """Set U of all cones, the lean b, and the change h of the normal impulse of the rows with several."""
    solver["softness"] = softness
    for k in range(solver["row_count"]):
        row = solver["rows"][k]
        first, total = row["first_cone"], 0.0
        for c in range(first, first + row["cone_count"]):
            cone = solver["cones"][c]
            w, side, u, lean = cone["scaling"], cone["side"], cone["kernel"], cone["lean"]
            size, square = sqrt(w[1] * w[1] + w[2] * w[2]), cone["stretch"] * cone["stretch"]
            side[0], side[1] = (w[1] / size, w[2] / size) if size > 0 else (1.0, 0.0)
            # W over its stretch has determinant 1
            most = (w[0] + size) * (w[0] + size)
            u[0], u[1] = 1 / (square * most + softness), 1 / (square / most + softness)
            u[2] = 1 / (square + softness)
            if row["cone_count"] > 1:
                part = (u[0] - u[1]) / (u[0] + u[1])
                lean[0], lean[1] = part * side[0], part * side[1]
                total += 1 / stiffness(cone)
                solver["cones"][first]["shared"] = 1 / total


@kernel
def mean_square(solver):
    """Mean square of q over all cones [m^2/s^2]."""
    total = 0.0
    for c in range(solver["cone_count"]):
        q = solver["cones"][c]["load"]
        total += q[0] * q[0] + q[1] * q[1] + q[2] * q[2]
    return total / solver["cone_count"]


@inlined_kernel
def stiffness(cone):
    """First entry of U."""
    return (cone["kernel"][0] + cone["kernel"][1]) / 2


@inlined_kernel
def scaled(cone, sign, a, b, c):
    """Apply the scaling W of a cone (sign 1) or its inverse (sign -1) to the vector (a, b, c)."""
    w, x, y = cone["scaling"], sign * cone["scaling"][1], sign * cone["scaling"][2]
    factor = cone["stretch"] if sign > 0 else 1 / cone["stretch"]
    across = x * b + y * c
    turned = a + across * cone["bend"]
    return factor * (w[0] * a + across), factor * (b + turned * x), factor * (c + turned * y)


@inlined_kernel
def unscale(cone, x, y, z):
    """Apply U to a vector: a change of v becomes a change of q."""
    side, u = cone["side"], cone["kernel"]
    along = side[0] * y + side[1] * z
    one, two = u[0] * (x + along) / 2, u[1] * (x - along) / 2
    part = one - two - u[2] * along
    return one + two, part * side[0] + u[2] * y, part * side[1] + u[2] * z


@inlined_kernel
def unscale_across(cone, y, z):
    """Apply the Schur complement S of U to a vector across the axis."""
    side, u = cone["side"], cone["kernel"]
    part = (2 * u[0] * u[1] / (u[0] + u[1]) - u[2]) * (side[0] * y + side[1] * z)
    return part * side[0] + u[2] * y, part * side[1] + u[2] * z


@inlined_kernel
def correction(cone):
    """Change of q that balances the product of the changes of v and q in the last step (Mehrotra)."""
    q, u, p = cone["load"], cone["speed_step"], cone["load_step"]
    l_0, l_1, l_2 = scaled(cone, 1, q[0], q[1], q[2])
    a, b, c = scaled(cone, -1, u[0], u[1], u[2])
    d, e, f = scaled(cone, 1, p[0], p[1], p[2])
    x, y, z = a * d + b * e + c * f, a * e + d * b, a * f + d * c
    first, inverse = (l_0 * x - l_1 * y - l_2 * z) / cone["determinant"], 1 / l_0
    return scaled(cone, -1, first, inverse * (y - first * l_1), inverse * (z - first * l_2))

"""Rows of rolling and torsional friction: moments that a contact bears beside its impulse.

A contact that presses with the normal impulse j bears a moment on B, and its opposite on A: across the normal
up to the rolling length times j, along it up to the torsional length times j. Within these bounds it takes
the most power from the relative angular velocity, as Coulomb's friction does from the slip: what turns is
braked by all of it, what does not turn is held by up to that.

With the angular velocity w of B relative to A and the moment M, a row has u = arm w and p = M / arm, where
turning at the `arm` is as mobile as the contact's translation. So its unit, mass and residual are those of
the rows of contacts. Bounds follow the normal impulses of each sweep, and in Newton's method those of each
velocity; the interior-point method takes a proximal step of the moments along with each of its own.
"""

from math import sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, dot
from touchstone.reference_impl.solver.link_rows import (
    add_listed,
    add_product,
    link_turn,
    list_blocks,
    list_turns,
    turn_link,
)

ROLL_STEPS, ROLL_ROUNDING = 40, 1e-15
"""Iterations for the moment of a row that rolls (5 are usual), and relative deviation from its bound at which
that has converged: some roundings [1]."""


@kernel
def changed_turn(moment, solver):
    """Change of a row's velocity u by all impulses and moments of its island [m/s]."""
    movers, row, arm = solver["movers"], solver["rows"][moment["row"]], moment["arm"]
    x = y = z = 0.0
    if row["b"] >= 0:
        w = movers[row["b"]]["omega"]
        x, y, z = w[0], w[1], w[2]
    if row["a"] >= 0:
        w = movers[row["a"]]["omega"]
        x, y, z = x - w[0], y - w[1], z - w[2]
    if row["link_b"] >= 0:
        p, q, s = link_turn(solver, row["link_b"])
        x, y, z = x + p, y + q, z + s
    if row["link_a"] >= 0:
        p, q, s = link_turn(solver, row["link_a"])
        x, y, z = x - p, y - q, z - s
    return arm * x, arm * y, arm * z


@kernel
def turn_velocity(moment, solver):
    """Velocity u of a row [m/s]."""
    f = moment["free"]
    x, y, z = changed_turn(moment, solver)
    return x + f[0], y + f[1], z + f[2]


@kernel
def _push(moment, solver, px, py, pz):
    """Apply an impulse p to a row's movers."""
    movers, row, arm = solver["movers"], solver["rows"][moment["row"]], moment["arm"]
    x, y, z = arm * px, arm * py, arm * pz
    for side in range(2):
        m, link, sign = (row["b"], row["link_b"], 1.0) if side else (row["a"], row["link_a"], -1.0)
        if m >= 0:
            w, inverse = movers[m]["omega"], movers[m]["inverse_inertia"]
            for i in range(3):
                w[i] += sign * (inverse[i, 0] * x + inverse[i, 1] * y + inverse[i, 2] * z)
        if link >= 0:
            turn_link(solver, link, sign * x, sign * y, sign * z)


@kernel
def turn_mobility(solver, moment):
    """Set a row's mobility: the change of its velocity per impulse [1/kg]."""
    w, row, arm = moment["mobility"], solver["rows"][moment["row"]], moment["arm"]
    w[:, :] = 0.0
    for side in range(2):
        m = row["b"] if side else row["a"]
        if m >= 0:
            inverse = solver["movers"][m]["inverse_inertia"]
            for i in range(3):
                for j in range(3):
                    w[i, j] += arm * arm * inverse[i, j]
    if row["link_a"] >= 0 or row["link_b"] >= 0:
        list_turns(solver, moment)
        rigid = (1 if row["a"] >= 0 else 0) + (1 if row["b"] >= 0 else 0)
        for k in range(rigid, solver["block_count"]):
            z = solver["block"][k]
            for i in range(3):
                for j in range(3):
                    for c in range(6):
                        w[i, j] += z[i, c] * z[j, c]


@kernel
def push_moments(solver):
    """Add the impulses of all moments to the velocities of the movers."""
    for k in range(solver["moment_count"]):
        p = solver["moments"][k]["impulse"]
        _push(solver["moments"][k], solver, p[0], p[1], p[2])


@kernel
def _load(row):
    """Normal impulse that bounds the moments of a contact [N s]."""
    return max(0.0, dot(row["impulse"], row["normal"]))


@kernel
def _clip(moment, row, load, p):
    """Clip an impulse p to its bounds under a load."""
    n = row["normal"]
    along = n[0] * p[0] + n[1] * p[1] + n[2] * p[2]
    x, y, z = p[0] - along * n[0], p[1] - along * n[1], p[2] - along * n[2]
    size, limit, most = sqrt(x * x + y * y + z * z), moment["rolling"] * load, moment["torsion"] * load
    scale = limit / size if size > limit else 1.0
    along = min(most, max(-most, along))
    return scale * x + along * n[0], scale * y + along * n[1], scale * z + along * n[2]


@kernel
def into_bounds(solver):
    """Clip all moments to the bounds that their contacts' impulses set."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        p, row = moment["impulse"], solver["rows"][moment["row"]]
        p[0], p[1], p[2] = _clip(moment, row, _load(row), (p[0], p[1], p[2]))


@kernel
def worst_moment(solver):
    """Largest violation of the law over all moments [m/s], and the row of its contact: the change of p by one
    projected step, over the mass."""
    largest, worst = 0.0, -1
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        p, m, row = moment["impulse"], moment["mass"], solver["rows"][moment["row"]]
        x, y, z = turn_velocity(moment, solver)
        x, y, z = _clip(moment, row, _load(row), (p[0] - m * x, p[1] - m * y, p[2] - m * z))
        change = sqrt((x - p[0]) ** 2 + (y - p[1]) ** 2 + (z - p[2]) ** 2) / m
        if not change <= largest:
            largest, worst = change, moment["row"]
    return largest, worst


@kernel
def solve_moment(moment, solver):
    """Solve the law of one row with the other impulses fixed, about the normal and then across it; returns
    the change of the impulse over the mass [m/s], and sets `swept` to the change."""
    row, p, w, d = solver["rows"][moment["row"]], moment["impulse"], moment["mobility"], moment["swept"]
    n, t, s, load = row["normal"], row["across_1"], row["across_2"], _load(row)
    x, y, z = turn_velocity(moment, solver)
    u = (x, y, z)
    copy_vector(p, d)
    along, w_n = dot(n, p), (_form(w, n, n), _form(w, t, n), _form(w, s, n))
    most = moment["torsion"] * load
    twist = min(most, max(-most, along - dot(n, u) / w_n[0])) - along
    roll_1, roll_2 = dot(t, p), dot(s, p)
    a, b, c = _form(w, t, t), _form(w, t, s), _form(w, s, s)
    # the velocity across the normal without the moment across it
    x = dot(t, u) + w_n[1] * twist - a * roll_1 - b * roll_2
    y = dot(s, u) + w_n[2] * twist - b * roll_1 - c * roll_2
    one, two = _roll(a, b, c, x, y, moment["rolling"] * load)
    size = 0.0
    for i in range(3):
        p[i] = (along + twist) * n[i] + one * t[i] + two * s[i]
        d[i] = p[i] - d[i]
        size += d[i] * d[i]
    _push(moment, solver, d[0], d[1], d[2])
    return sqrt(size) / moment["mass"]


@kernel
def _roll(a, b, c, x, y, limit):
    """Impulse q across the normal, |q| <= limit, for the velocity (x, y) without it and the mobility A of
    entries a, b, c: A q = -(x, y) within the bound; else (A + alpha) q = -(x, y) with the alpha for which |q|
    is the limit, by Newton's method for 1 / |q|, which is concave in alpha."""
    if limit == 0:
        return 0.0, 0.0
    alpha = 0.0
    for _ in range(ROLL_STEPS):
        p, q = a + alpha, c + alpha
        scale = 1 / (p * q - b * b)
        u, v = scale * (b * y - q * x), scale * (b * x - p * y)
        size = sqrt(u * u + v * v)
        if size <= limit * (1 + ROLL_ROUNDING):
            break
        # the derivative of |q|^2 / 2 with respect to alpha, reversed
        fall = scale * (q * u * u - 2 * b * u * v + p * v * v)
        alpha += size * size / fall * (size - limit) / limit
    scale = limit / size if size > limit else 1.0
    return scale * u, scale * v


@kernel
def _form(w, a, b):
    """Compute a.W b."""
    total = 0.0
    for i in range(3):
        total += a[i] * (w[i, 0] * b[0] + w[i, 1] * b[1] + w[i, 2] * b[2])
    return total


@kernel
def moment_work(solver):
    """Compute -p.(before + free), p.W p and the sum of |p| over all moments, as those of contacts."""
    driving = damping = size = 0.0
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        p, f, before = moment["impulse"], moment["free"], moment["before"]
        x, y, z = changed_turn(moment, solver)
        damping += p[0] * x + p[1] * y + p[2] * z
        size += sqrt(dot(p, p))
        driving -= dot(p, before) + dot(p, f)
    return driving, damping, size


@kernel
def oppose_mean_turn(solver):
    """Make all moments oppose the mean turning of the substep: the sum of that before and after."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        for i in range(3):
            moment["free"][i] += moment["before"][i]
            moment["before"][i] = 0.0


@kernel
def begin_soft_moments(solver, compliance, heaviest):
    """Centre the moments for an iteration of a proximal method, with bounds by the present loads.

    Args:
        heaviest: mass of all rows [kg], or 0: each has its own.
    """
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        moment["stiffness"] = (heaviest if heaviest > 0 else moment["mass"]) / compliance
        moment["load"] = _load(solver["rows"][moment["row"]])
        copy_vector(moment["impulse"], moment["centre"])


@kernel
def follow_loads(solver, s):
    """Bound the moments by the normal impulses of Newton's method at fraction s of its step."""
    for k in range(solver["moment_count"]):
        row = solver["rows"][solver["moments"][k]["row"]]
        n, stiffness = row["normal"], row["stiffness"]
        speed = dot(n, row["velocity"]) + s * dot(n, row["rate"]) - row["floor"]
        solver["moments"][k]["load"] = max(0.0, dot(n, row["centre"]) - stiffness * speed)


@kernel
def begin_moment_steps(solver):
    """Set the velocities of the moments from the present impulses, and their rates to 0."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        u = moment["velocity"]
        u[0], u[1], u[2] = turn_velocity(moment, solver)
        moment["rate"][:] = 0.0


@kernel
def _project(moment, row, s):
    """Impulse of a row at fraction s of the step `rate`."""
    c, u, d, k = moment["centre"], moment["velocity"], moment["rate"], moment["stiffness"]
    p = (
        c[0] - k * (u[0] + s * d[0]),
        c[1] - k * (u[1] + s * d[1]),
        c[2] - k * (u[2] + s * d[2]),
    )
    return _clip(moment, row, moment["load"], p)


@kernel
def take_soft_moments(solver):
    """Set the impulses of all moments to those of the present velocities."""
    for k in range(solver["moment_count"]):
        p = solver["moments"][k]["impulse"]
        p[0], p[1], p[2] = _project(solver["moments"][k], solver["rows"][solver["moments"][k]["row"]], 0.0)


@kernel
def subtract_soft_moments(solver, s):
    """Subtract J^T p of all moments at fraction s of the step from the gradient."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        x, y, z = _project(moment, solver["rows"][moment["row"]], s)
        subtract_moment(solver, moment, x, y, z)


@kernel
def subtract_moment(solver, moment, px, py, pz):
    """Subtract J^T p of a moment from the gradient."""
    list_turns(solver, moment)
    for k in range(solver["block_count"]):
        base, j = 6 * solver["block_place"][k], solver["block"][k]
        for c in range(6):
            solver["gradient"][base + c] -= j[0, c] * px + j[1, c] * py + j[2, c] * pz


@kernel
def add_soft_moments(solver):
    """Add J^T K J of all moments to the matrix."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        if _derivative(moment, solver["rows"][moment["row"]], solver["kernel"]):
            list_turns(solver, moment)
            add_listed(solver)


@kernel
def add_load_changes(solver):
    """Add to the matrix of Newton's method how the bounds of the moments follow the normal impulses: (J' g)
    (k J' n)', with g the change of a moment per load, and k n' J that of the load."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        row = solver["rows"][moment["row"]]
        if moment["load"] == 0 or not _change_per_load(moment, row, moment["swept"]):
            continue
        g, n, stiffness = moment["swept"], row["normal"], row["stiffness"]
        list_turns(solver, moment)
        clear_outer(solver)
        add_to_outer(solver, g[0], g[1], g[2], 0)
        list_blocks(solver, row)
        add_to_outer(solver, stiffness * n[0], stiffness * n[1], stiffness * n[2], 1)
        add_product(solver)


@kernel
def _change_per_load(moment, row, out_change):
    """Derivative of a row's impulse with respect to its load [1]; returns whether it is not zero."""
    c, n, u, k = moment["centre"], row["normal"], moment["velocity"], moment["stiffness"]
    x, y, z = c[0] - k * u[0], c[1] - k * u[1], c[2] - k * u[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    size = sqrt(x * x + y * y + z * z)
    roll = moment["rolling"] / size if size > moment["rolling"] * moment["load"] else 0.0
    twist = moment["torsion"] if abs(along) > moment["torsion"] * moment["load"] else 0.0
    twist = twist if along > 0 else -twist
    for i, value in enumerate((x, y, z)):
        out_change[i] = roll * value + twist * n[i]
    return roll != 0 or twist != 0


@kernel
def clear_outer(solver):
    """Set both vectors `outer` of the listed blocks to 0."""
    for side in range(2):
        for k in range(solver["block_count"]):
            solver["outer"][side, k, :] = 0.0


@kernel
def add_to_outer(solver, x, y, z, side):
    """Add J' (x, y, z) to the vector `outer[side]` of the listed blocks."""
    for k in range(solver["block_count"]):
        j = solver["block"][k]
        for c in range(6):
            solver["outer"][side, k, c] += j[0, c] * x + j[1, c] * y + j[2, c] * z


@kernel
def _derivative(moment, row, out_kernel):
    """Minus the derivative of a row's impulse with respect to its velocity [kg]; returns whether it is not
    zero."""
    c, n, u, k = moment["centre"], row["normal"], moment["velocity"], moment["stiffness"]
    x, y, z = c[0] - k * u[0], c[1] - k * u[1], c[2] - k * u[2]
    along = x * n[0] + y * n[1] + z * n[2]
    x, y, z = x - along * n[0], y - along * n[1], z - along * n[2]
    size, limit = sqrt(x * x + y * y + z * z), moment["rolling"] * moment["load"]
    twist = 1.0 if abs(along) <= moment["torsion"] * moment["load"] else 0.0
    across, radial = 1.0, 0.0
    if size > limit:
        across, radial, x, y, z = limit / size, limit / size, x / size, y / size, z / size
    t = (x, y, z)
    for i in range(3):
        for m in range(3):
            value = (twist - across) * n[i] * n[m] - radial * t[i] * t[m]
            out_kernel[i, m] = k * (value + (across if i == m else 0.0))
    return twist > 0 or across > 0


@kernel
def set_moment_rates(solver):
    """Compute the change of the moments' velocities along the step."""
    step = solver["step"]
    for k in range(solver["moment_count"]):
        d = solver["moments"][k]["rate"]
        d[:] = 0.0
        list_turns(solver, solver["moments"][k])
        for n in range(solver["block_count"]):
            base, j = 6 * solver["block_place"][n], solver["block"][n]
            for i in range(3):
                for c in range(6):
                    d[i] += j[i, c] * step[base + c]


@kernel
def advance_moments(solver, s):
    """Apply a fraction of the step; returns the largest change of a moment's velocity [m/s]."""
    largest = 0.0
    for k in range(solver["moment_count"]):
        u, d = solver["moments"][k]["velocity"], solver["moments"][k]["rate"]
        largest = max(largest, s * sqrt(dot(d, d)))
        for i in range(3):
            u[i] += s * d[i]
            d[i] = 0.0
    return largest


@kernel
def copy_moments(solver, keep):
    """Store the impulses of all moments in `best`, or restore them from there."""
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        if keep:
            copy_vector(moment["impulse"], moment["best"])
        else:
            copy_vector(moment["best"], moment["impulse"])

"""Relative acceleration at a contact that follows from velocities alone, J' v.

Over a substep bodies rotate, and contact points move with them. A constraint on the velocities at the points
of the start lets a touching pair sink or part by h^2 / 2 times J' v. Rows of polyhedra therefore add h J' v
to their velocity at the end of the substep: the pair stays in contact to third order in h.

For a vertex q of B on a face of A with normal n, both their gap and their sliding follow from

    J' v = w_B x (w_B x r_B) - w_A x (w_A x r_A) - w_A x u - n (n.(w_A x u)),    u = v_B(q) - v_A(q)

(centripetal and Coriolis terms; r leads from a centre of mass to q). For two edges along e_A and e_B, n
rotates by n', which keeps it perpendicular to both:

    n.J' v = n.(w_B x (w_B x r_B) - w_A x (w_A x r_A)) + 2 n'.u,    n'.e_A = -n.(w_A x e_A),   n'.e_B likewise
"""

from touchstone.reference_impl.core.conventions import (
    BIAS_DEPTH,
    BIAS_SHARE,
    FLIGHT_BALLISTIC,
    IMPULSES_TOGETHER,
    NEVER,
    SIMULATED,
)
from touchstone.reference_impl.core.kernel import kernel

LEAST_CROSSING = 1e-3
"""Squared sine of the angle between two edges below which their normal rotates too fast [1]."""


@kernel
def corrects_rotation(state):
    """Whether the profile's resting contacts take J' v into account."""
    return state["flight"] == FLIGHT_BALLISTIC and state["impulses"] == IMPULSES_TOGETHER


@kernel
def bias_share(bodies, pieces, pairs, count, h, state):
    """Share of h for which the bias of all pressing pairs is exact enough, given the velocities after a
    solve; NEVER if that is longer than h.

    If J' v h changes linearly by d over the substep, a pair sinks or parts by d h / 6.
    """
    error = 0.0
    for k in range(count):
        pair = pairs[k]
        n, p, early, late = pair["normal"], pair["resting_impulse"], pair["bias"], state["velocity"]
        if p[0] == 0 and p[1] == 0 and p[2] == 0:
            continue
        set_bias(bodies, pieces, pair, h, late)
        d = n[0] * (late[0] - early[0]) + n[1] * (late[1] - early[1]) + n[2] * (late[2] - early[2])
        error = max(error, abs(d) * h / 6)
    return (BIAS_SHARE * BIAS_DEPTH / error) ** (1 / 3) if error > BIAS_DEPTH else NEVER


@kernel
def set_bias(bodies, pieces, pair, h, out_bias):
    """Compute the change of a row's relative velocity over h [s] by J' v; 0 for round pieces, and for
    features whose normal is undefined."""
    a, b, n = bodies[pair["body_a"]], bodies[pair["body_b"]], pair["normal"]
    out_bias[:] = 0.0
    level, e, f = pair["level"], pair["edge_a"], pair["edge_b"]
    cos = e[0] * f[0] + e[1] * f[1] + e[2] * f[2]
    sin2 = e[0] * e[0] + e[1] * e[1] + e[2] * e[2] - cos * cos
    on_face = level != 0.5
    if pair["manifold"] < 0 or not (on_face or sin2 > LEAST_CROSSING):
        return
    # the points of the cores move with their bodies; on the face's body, that of the other is as good
    above, below = pieces[pair["piece_b"]]["radius"], pieces[pair["piece_a"]]["radius"]
    u, v, w = _rotation(a, pair["point"], n, above if level == 0.0 else -below, -h, out_bias)
    x, y, z = _rotation(b, pair["point"], n, -below if level == 1.0 else above, h, out_bias)
    u, v, w = x - u, y - v, z - w
    if on_face:
        x, y, z = _omega(a if level == 0.0 else b)
        x, y, z = h * (y * w - z * v), h * (z * u - x * w), h * (x * v - y * u)
        along = x * n[0] + y * n[1] + z * n[2]
        out_bias[0] -= x + along * n[0]
        out_bias[1] -= y + along * n[1]
        out_bias[2] -= z + along * n[2]
        return
    along_a, along_b = _tilt(a, n, e), _tilt(b, n, f)
    s, t = (along_a - cos * along_b) / sin2, (along_b - cos * along_a) / sin2
    x, y, z = s * e[0] + t * f[0], s * e[1] + t * f[1], s * e[2] + t * f[2]
    change = 2 * (x * u + y * v + z * w) - (above + below) * (x * x + y * y + z * z)
    change = h * change + out_bias[0] * n[0] + out_bias[1] * n[1] + out_bias[2] * n[2]
    for i in range(3):
        out_bias[i] = change * n[i]


@kernel
def _omega(body):
    """Angular velocity of a body; driven bodies do not move within a frame."""
    if body["kind"] != SIMULATED:
        return 0.0, 0.0, 0.0
    return body["omega"][0], body["omega"][1], body["omega"][2]


@kernel
def _tilt(body, n, edge):
    """-n.(w x e): the rate at which a normal turns towards an edge that rotates with its body."""
    x, y, z = _omega(body)
    return -(
        n[0] * (y * edge[2] - z * edge[1])
        + n[1] * (z * edge[0] - x * edge[2])
        + n[2] * (x * edge[1] - y * edge[0])
    )


@kernel
def _rotation(body, point, n, offset, h, out_bias):
    """Add h times a body's centripetal acceleration at `point` + offset n; returns its velocity there."""
    if body["kind"] != SIMULATED:
        return 0.0, 0.0, 0.0
    c, w, v = body["center"], body["omega"], body["velocity"]
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    x, y, z = x + offset * n[0], y + offset * n[1], z + offset * n[2]
    x, y, z = w[1] * z - w[2] * y, w[2] * x - w[0] * z, w[0] * y - w[1] * x
    out_bias[0] += h * (w[1] * z - w[2] * y)
    out_bias[1] += h * (w[2] * x - w[0] * z)
    out_bias[2] += h * (w[0] * y - w[1] * x)
    return v[0] + x, v[1] + y, v[2] + z

"""Rates of contact normals: how the normal n of two features in contact rotates with them.

For a vertex q of B on a face of A, q moves with B and n rotates with A. For two edges along e_A and e_B, n
rotates by n', which keeps it perpendicular to both, and the contact point moves along them:

    n'.e_A = -n.(w_A x e_A),    n'.e_B = -n.(w_B x e_B)

For a sphere on a box or a capsule, n' has two parts. Along the axes in which the touched feature extends, n
rotates with the feature. Across them it is u / d, with u the velocity of the sphere's centre relative to the
feature, and d the distance of their cores.

All vectors are in the world frame; rates are in 1/s.
"""

from touchstone.reference_impl.core.conventions import BOX, CAPSULE, SIMULATED
from touchstone.reference_impl.core.kernel import kernel

LEAST_SLOPE = 1e-7
"""Cosine of the angle between a normal and an axis below which they are perpendicular [1]."""


@kernel
def rate_on_face(body, n):
    """n' of the face of a body, which rotates with it."""
    x, y, z = _omega(body)
    return y * n[2] - z * n[1], z * n[0] - x * n[2], x * n[1] - y * n[0]


@kernel
def squared_sine(pair):
    """Squared sine of the angle between the edges of a pair [1]; 0 if it has none."""
    e, cos = pair["edge_a"], _cosine(pair)
    return e[0] * e[0] + e[1] * e[1] + e[2] * e[2] - cos * cos


@kernel
def rate_between_edges(a, b, pair):
    """n' of two crossing edges, which keeps it perpendicular to both."""
    e, f, n = pair["edge_a"], pair["edge_b"], pair["start_normal"]
    cos, sin2 = _cosine(pair), squared_sine(pair)
    along_a, along_b = _tilt(a, n, e), _tilt(b, n, f)
    s, t = (along_a - cos * along_b) / sin2, (along_b - cos * along_a) / sin2
    return s * e[0] + t * f[0], s * e[1] + t * f[1], s * e[2] + t * f[2]


@kernel
def slip_along_edge(pair, x, y, z):
    """Speed of the contact point along A's edge, if B's edge moves by (x, y, z) relative to it [m/s]."""
    e, f, cos = pair["edge_a"], pair["edge_b"], _cosine(pair)
    over_a = x * e[0] + y * e[1] + z * e[2]
    over_b = x * f[0] + y * f[1] + z * f[2]
    return (over_a - cos * over_b) / squared_sine(pair)


@kernel
def rate_on_sphere(body, piece, n, u, v, w, distance, scratch):
    """n' of a sphere on a box or capsule.

    Args:
        body, piece: of the box or capsule.
        n: normal (3,) [1].
        u, v, w: velocity of the core of the box or capsule relative to the sphere's [m/s].
        distance: from the sphere's core to the other along the normal [m].
        scratch: (3,), overwritten.
    """
    along, m = u * n[0] + v * n[1] + w * n[2], piece["world_rotation"]
    x, y, z = (u - along * n[0]) / distance, (v - along * n[1]) / distance, (w - along * n[2]) / distance
    for i in range(3):
        if _extends_along(piece, i, n):
            scratch[0], scratch[1], scratch[2] = m[0, i], m[1, i], m[2, i]
            s = _tilt(body, n, scratch) - x * scratch[0] - y * scratch[1] - z * scratch[2]
            x, y, z = x + s * scratch[0], y + s * scratch[1], z + s * scratch[2]
    return x, y, z


@kernel
def has_turning_normal(body, piece, n):
    """Whether the normal of a sphere on this piece can rotate, or its surface moves at a velocity that varies
    along it, and `rate_on_sphere` computes the rate of the normal.

    The normal on a face of a body that does not move is constant. Two spheres are excluded: large islands of
    spheres, whose solves do not converge, would reach more caps.
    """
    w = piece["surface_omega"]
    if piece["kind"] != BOX or is_moving(body) or w[0] != 0 or w[1] != 0 or w[2] != 0:
        return piece["kind"] == BOX or piece["kind"] == CAPSULE
    free = 0
    for i in range(3):
        if _extends_along(piece, i, n):
            free += 1
    return free != 2


@kernel
def is_moving(body):
    """Whether a body moves within a substep: links of drivers with chains do not."""
    return body["kind"] == SIMULATED or body["moves"] == 1


@kernel
def velocity_at(body, point):
    """Velocity (3 floats) [m/s] of a body at a point (3,) [m]; 0 if it does not move within a substep."""
    if not is_moving(body):
        return 0.0, 0.0, 0.0
    c, w, v = body["center"], body["omega"], body["velocity"]
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    return v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x


@kernel
def _extends_along(piece, i, n):
    """Whether the feature of a box or capsule that touches a sphere extends along the piece's axis i.

    It does if the axis is perpendicular to the normal.
    """
    m = piece["world_rotation"]
    if piece["kind"] == CAPSULE and i != 2:
        return False
    return abs(m[0, i] * n[0] + m[1, i] * n[1] + m[2, i] * n[2]) < LEAST_SLOPE


@kernel
def _cosine(pair):
    """Cosine of the angle between the edges of a pair [1]."""
    e, f = pair["edge_a"], pair["edge_b"]
    return e[0] * f[0] + e[1] * f[1] + e[2] * f[2]


@kernel
def _omega(body):
    """Angular velocity of a body; 0 if it does not move within a substep."""
    if not is_moving(body):
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

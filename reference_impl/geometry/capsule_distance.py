"""Signed distance of capsules and spheres in closed form: the distance of their cores minus their radii.

A core is a segment or a point, given by its half vector `u` or `v` in world axes, zero for a sphere. GJK and
EPA give the same result except for crossing cores, whose Minkowski difference has no volume.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    CAPSULE,
    CYLINDER,
    MANIFOLD_HEIGHT,
    PARALLEL_SINE,
    SPHERE,
    TOUCHING_DISTANCE_SHARE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import cross, dot, plus, vector_of


@kernel
def has_side(piece):
    """Whether a piece has a side about a segment, as capsules and cylinders do."""
    return piece["kind"] == CAPSULE or piece["kind"] == CYLINDER


@kernel
def side_radius(piece):
    """Distance of a piece's surface from its core or, of a cylinder's side, from its axis [m]."""
    return piece["size"][0] if piece["kind"] == CYLINDER else piece["radius"]


@kernel
def have_segments(piece_a, piece_b):
    """Whether the cores of both pieces are segments or points."""
    a, b = piece_a["kind"], piece_b["kind"]
    return (a == CAPSULE or a == SPHERE) and (b == CAPSULE or b == SPHERE)


@kernel
def segment_distance(piece_a, piece_b, out_pair):
    """Compute signed distance [m], normal A to B, and a witness on each piece; writes `out_pair` (PAIR)."""
    one, two = core_of(piece_a), core_of(piece_b)
    u, v, c = one[1], two[1], plus(one[0], -1.0, two[0])
    s, t = _nearest_places(u, v, c)
    w = _core_vector(u, v, c, s, t)
    gap = sqrt(dot(w, w))
    if gap <= TOUCHING_DISTANCE_SHARE * (sqrt(dot(u, u)) + sqrt(dot(v, v)) + sqrt(dot(c, c))):
        w = _across(u, v, w)
    _write_contact(one, two, s, t, w, out_pair)
    out_pair["distance"] = gap - one[2] - two[2]


@kernel
def core_of(piece):
    """Core of a sphere, a capsule or a cylinder: centre, half vector, and distance of its surface from it."""
    h, m = piece["size"][2], piece["world_rotation"]
    return vector_of(piece["world_position"]), (h * m[0, 2], h * m[1, 2], h * m[2, 2]), side_radius(piece)


@kernel
def are_alongside(one, two, least, most):
    """Whether two sides, or a side and an edge, touch each other over some length.

    Their distance is from `least` to `most` [m] at both of its ends: sides that overlap by more than the
    pieces do are those of cylinders that touch elsewhere.

    Args:
        one, two: their cores (`core_of`); that of an edge is the edge.
    """
    u, v, c = one[1], two[1], plus(one[0], -1.0, two[0])
    (s, t), (p, q) = _facing_end(u, v, c, 1.0), _facing_end(u, v, c, -1.0)
    if min(abs(s - p) * sqrt(dot(u, u)), abs(t - q) * sqrt(dot(v, v))) <= MANIFOLD_HEIGHT:
        return False
    for x, y in ((s, t), (p, q)):
        w = _core_vector(u, v, c, x, y)
        gap = sqrt(dot(w, w))
        if gap == 0 or not least <= gap - one[2] - two[2] <= most:
            return False
    return True


@kernel
def contact_at_end(one, two, end, out_pair):
    """Contact of two cores at one end (1 or -1) of the length over which they face each other."""
    u, v, c = one[1], two[1], plus(one[0], -1.0, two[0])
    s, t = _facing_end(u, v, c, end)
    _write_contact(one, two, s, t, _core_vector(u, v, c, s, t), out_pair)


@kernel
def _facing_end(u, v, c, end):
    """Parameters on both cores of an end of the length over which they face each other.

    It is an end of one core, and its nearest point on the other. `end` is that of B's core."""
    s = _foot(u, end * v[0] - c[0], end * v[1] - c[1], end * v[2] - c[2])
    if -1 < s < 1:
        return s, end
    return s, _foot(v, c[0] + s * u[0], c[1] + s * u[1], c[2] + s * u[2])


@kernel
def _core_vector(u, v, c, s, t):
    """Vector from a point of A's core to one of B's."""
    return t * v[0] - s * u[0] - c[0], t * v[1] - s * u[1] - c[1], t * v[2] - s * u[2] - c[2]


@kernel
def _write_contact(one, two, s, t, w, out_pair):
    """Write the distance, normal and witnesses of core points with the vector w, or parallel to it, between
    them; the distance is that of w."""
    length = sqrt(dot(w, w))
    n = (w[0] / length, w[1] / length, w[2] / length)
    p = plus(plus(one[0], s, one[1]), one[2], n)
    q = plus(plus(two[0], t, two[1]), -two[2], n)
    for i in range(3):
        out_pair["normal"][i], out_pair["point_a"][i], out_pair["point_b"][i] = n[i], p[i], q[i]
    out_pair["distance"] = length - one[2] - two[2]


@kernel
def _foot(p, x, y, z):
    """Parameter in [-1, 1] of the point on the core with half vector p that is nearest to (x, y, z)."""
    square = dot(p, p)
    return min(1.0, max(-1.0, dot(p, (x, y, z)) / square)) if square > 0 else 0.0


@kernel
def _are_parallel(u, v):
    n = cross(u, v)
    return dot(n, n) <= PARALLEL_SINE * PARALLEL_SINE * dot(u, u) * dot(v, v)


@kernel
def _nearest_places(u, v, c):
    """Parameters s, t in [-1, 1] of the nearest points c + s u and t v."""
    if _are_parallel(u, v):
        # the middle of the section in which the segments face each other
        s = _foot(u, v[0] - c[0], v[1] - c[1], v[2] - c[2]) / 2
        s += _foot(u, -v[0] - c[0], -v[1] - c[1], -v[2] - c[2]) / 2
        return s, _foot(v, c[0] + s * u[0], c[1] + s * u[1], c[2] + s * u[2])
    # candidates: the lines' closest points (cross products lose half the digits of a determinant), and ends
    n = cross(u, v)
    nearest = min(1.0, max(-1.0, dot(cross(v, c), n) / dot(n, n)))
    best_s = best_t = 0.0
    least = -1.0
    for k in range(5):
        end = 1.0 if k % 2 == 0 else -1.0
        if k < 3:
            s = nearest if k == 2 else end
            t = _foot(v, c[0] + s * u[0], c[1] + s * u[1], c[2] + s * u[2])
        else:
            s, t = _foot(u, end * v[0] - c[0], end * v[1] - c[1], end * v[2] - c[2]), end
        x, y, z = c[0] + s * u[0] - t * v[0], c[1] + s * u[1] - t * v[1], c[2] + s * u[2] - t * v[2]
        square = x * x + y * y + z * z
        if least < 0 or square < least:
            best_s, best_t, least = s, t, square
    return best_s, best_t


@kernel
def _across(u, v, w):
    """A direction perpendicular to both cores, on the side of w."""
    if _are_parallel(u, v):
        p = u if dot(u, u) >= dot(v, v) else v
        x, y, z = abs(p[0]), abs(p[1]), abs(p[2])
        if x + y + z == 0.0:
            return 0.0, 0.0, 1.0
        ex = 1.0 if x <= y and x <= z else 0.0
        ey = 1.0 if ex == 0.0 and y <= z else 0.0
        n = cross(p, (ex, ey, 1.0 - ex - ey))
    else:
        p, n = u, cross(u, v)
    # remove the component along a core that rounding leaves: it matters for nearly parallel cores
    along = dot(n, p) / dot(p, p)
    n = (n[0] - along * p[0], n[1] - along * p[1], n[2] - along * p[2])
    return n if dot(n, w) >= 0 else (-n[0], -n[1], -n[2])

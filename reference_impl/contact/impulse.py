"""The law of one impact: Newton's restitution, Coulomb's friction and the energy guard (Eqs. 7 to 10).

An impulse p on B (and -p on A) at one point changes the velocity v of B relative to A there to v+ = v + M p,
where M is the contact's mobility. It changes the kinetic energy by T(p) = p.v + p.M p / 2 = p.(v + v+) / 2,
which is convex. Under Newton's law, n.v+ = -e n.v, T is (1 - e) j n.v / 2 <= 0 without friction. Friction
that does not reverse the sliding only adds to the loss. Sticking friction can gain energy: it leaves
e^2 (n.v)^2 n.M^-1 n / 2 of the initial v.M^-1 v / 2. At e = 0 it cannot gain energy, and neither can any
impulse between it and the impulse without friction.

The guard takes the impulses p0 at e = 0 and p1 at e, and moves from p1 towards p0 until T = 0:
T(p0 + s (p1 - p0)) is a parabola in s. Newton's law then holds with s e in place of e, and p stays in the
cone, which is convex. If both stick, s e is the largest restitution without energy gain:
sqrt(v.M^-1 v / n.M^-1 n) / |n.v|.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import (
    ENERGY_ROUNDING,
    FRICTION_PAPER,
    RESTITUTION_NEWTON,
    SLIP_MIN,
)
from touchstone.reference_impl.core.kernel import kernel


@kernel
def resting_restitution(e, approach, v_rest):
    """Restitution that falls linearly from e at 2 v_rest to 0 at v_rest; speeds in m/s."""
    if v_rest <= 0:
        return e
    return e * min(1.0, max(0.0, approach / v_rest - 1))


@kernel
def contact_impulse(v, n, mobility, e, mu, friction, restitution, out_impulse):
    """Compute the impulse on B of one impact (Eqs. 8-10).

    Args:
        v: velocity of B relative to A at the contact before the impulse [m/s]; n.v < 0 if they approach.
        n: unit normal, A to B.
        mobility: velocity of B relative to A per impulse on B (3, 3) [1/kg].
        e, mu: restitution and friction of the pair.
        friction: FRICTION_PAPER (friction is always mu j, opposite to the sliding; j from Eq. 9) or
            FRICTION_COULOMB (friction at most stops the sliding; j satisfies Newton's law with friction).
        restitution: RESTITUTION_NEWTON, or RESTITUTION_GUARDED: lower where the kinetic energy would rise.
        out_impulse: (3,) [N s].
    Returns:
        Whether the guard acted.
    """
    m = mobility
    x, y, z = _unguarded(v, n, m, e, mu, friction)
    out_impulse[0], out_impulse[1], out_impulse[2] = x, y, z
    if restitution == RESTITUTION_NEWTON:
        return False
    gain = _energy_change(v, m, x, y, z)
    if gain <= ENERGY_ROUNDING * abs(x * v[0] + y * v[1] + z * v[2]):
        return False
    # Eq. 10 as printed may gain energy at e = 0 too: reduce friction together with e
    a, b, c = _unguarded(v, n, m, 0.0, 0.0 if friction == FRICTION_PAPER else mu, friction)
    x, y, z = x - a, y - b, z - c
    u, w, q = respond(m, a, b, c)
    slope = x * (v[0] + u) + y * (v[1] + w) + z * (v[2] + q)
    s = lossless_share(_energy_change(v, m, a, b, c), slope, gain)
    out_impulse[0], out_impulse[1], out_impulse[2] = a + s * x, b + s * y, c + s * z
    return True


@kernel
def lossless_share(start, slope, end):
    """Root in [0, 1] of the parabola with values `start` <= 0 at 0 and `end` > 0 at 1, and `slope` at 0."""
    bend = end - start - slope
    root = sqrt(max(0.0, slope * slope - 4 * bend * start))
    # use the form without cancellation
    if slope > 0:
        return min(1.0, -2 * start / (slope + root))
    return min(1.0, (root - slope) / (2 * bend))


@kernel
def _unguarded(v, n, m, e, mu, friction):
    """Compute the impulse of one impact under Newton's law, without the energy guard."""
    v_n = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    tx, ty, tz = v[0] - v_n * n[0], v[1] - v_n * n[1], v[2] - v_n * n[2]
    # project twice: rounding of a fast approach leaves a normal component in a slow slip
    rest = tx * n[0] + ty * n[1] + tz * n[2]
    tx, ty, tz = tx - rest * n[0], ty - rest * n[1], tz - rest * n[2]
    slip = sqrt(tx * tx + ty * ty + tz * tz)
    slides = slip > SLIP_MIN
    scale = mu / slip if slides else 0.0
    # sliding impulse per unit of j
    dx, dy, dz = n[0] - scale * tx, n[1] - scale * ty, n[2] - scale * tz
    target = -(1 + e) * v_n
    plain = target / normal_response(m, n, n[0], n[1], n[2])
    if friction == FRICTION_PAPER:
        return plain * dx, plain * dy, plain * dz
    # sticking: the impulse satisfies Newton's law and stops the sliding
    x, y, z = _solve(m, -e * v_n * n[0] - v[0], -e * v_n * n[1] - v[1], -e * v_n * n[2] - v[2])
    j = x * n[0] + y * n[1] + z * n[2]
    px, py, pz = x - j * n[0], y - j * n[1], z - j * n[2]
    held = sqrt(px * px + py * py + pz * pz)
    if held <= mu * j:
        return x, y, z
    # sliding: mu j opposite to the slip, unless that reverses the slip or jams (Painleve)
    along = normal_response(m, n, dx, dy, dz)
    if slides and along > 0:
        k = target / along
        u, w, q = respond(m, k * dx, k * dy, k * dz)
        if slip * slip + tx * u + ty * w + tz * q >= 0:
            return k * dx, k * dy, k * dz
    # otherwise interpolate from no friction to sticking, up to the cone; Newton's law holds in between
    s = mu * plain / (held - mu * (j - plain))
    j = plain + s * (j - plain)
    return j * n[0] + s * px, j * n[1] + s * py, j * n[2] + s * pz


@kernel
def _energy_change(v, m, x, y, z):
    """Change of kinetic energy [J] by the impulse (x, y, z) at the relative velocity v."""
    u, w, q = respond(m, x, y, z)
    return x * (v[0] + u / 2) + y * (v[1] + w / 2) + z * (v[2] + q / 2)


@kernel
def respond(m, x, y, z):
    """M (x, y, z)"""
    return (
        m[0, 0] * x + m[0, 1] * y + m[0, 2] * z,
        m[1, 0] * x + m[1, 1] * y + m[1, 2] * z,
        m[2, 0] * x + m[2, 1] * y + m[2, 2] * z,
    )


@kernel
def normal_response(m, n, x, y, z):
    """n . M (x, y, z)"""
    u, w, q = respond(m, x, y, z)
    return n[0] * u + n[1] * w + n[2] * q


@kernel
def _solve(m, x, y, z):
    """Solve M p = (x, y, z) for a (3, 3) matrix by cofactors."""
    a = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
    b = m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
    c = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]
    d = m[0, 0] * a + m[0, 1] * b + m[0, 2] * c
    p = a * x + (m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]) * y + (m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]) * z
    q = b * x + (m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]) * y + (m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]) * z
    r = c * x + (m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1]) * y + (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]) * z
    return p / d, q / d, r / d

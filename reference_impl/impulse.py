"""The law of one impact: Newton's restitution and Coulomb's friction at one point (Eqs. 7 to 10)."""

from math import sqrt

from reference_impl.conventions import FRICTION_PAPER, SLIP_MIN
from reference_impl.kernel import kernel


@kernel
def resting_restitution(e, approach, v_rest):
    """Restitution that fades linearly from e at 2 v_rest to 0 at v_rest; speeds in m/s."""
    if v_rest <= 0:
        return e
    return e * min(1.0, max(0.0, approach / v_rest - 1))


@kernel
def contact_impulse(v, n, mobility, e, mu, friction, out_impulse):
    """Impulse on B of one impact (Eqs. 8-10).

    Args:
        v: velocity of B against A at the contact before the impulse [m/s]; approaching, n.v < 0.
        n: unit normal, A to B.
        mobility: velocity of B against A per impulse on B (3, 3) [1/kg].
        e, mu: restitution and friction of the pair.
        friction: FRICTION_PAPER (always mu j against the sliding, j from Eq. 9) or FRICTION_COULOMB (at most
            what stops the sliding; j such that Newton's law holds with friction acting).
        out_impulse: (3,) [N s].
    """
    v_n = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    tx, ty, tz = v[0] - v_n * n[0], v[1] - v_n * n[1], v[2] - v_n * n[2]
    slip = sqrt(tx * tx + ty * ty + tz * tz)
    if slip > SLIP_MIN:
        tx, ty, tz = tx / slip, ty / slip, tz / slip
    else:
        tx = ty = tz = 0.0
    target = -(1 + e) * v_n
    m = mobility
    if friction == FRICTION_PAPER:
        j = target / normal_response(m, n, n[0], n[1], n[2])
    else:
        # stick: the impulse that reverses v_n and stops the sliding
        x, y, z = -e * v_n * n[0] - v[0], -e * v_n * n[1] - v[1], -e * v_n * n[2] - v[2]
        x, y, z = _solve(m, x, y, z)
        j = x * n[0] + y * n[1] + z * n[2]
        px, py, pz = x - j * n[0], y - j * n[1], z - j * n[2]
        if px * px + py * py + pz * pz <= (mu * j) ** 2 and j > 0:
            out_impulse[0], out_impulse[1], out_impulse[2] = x, y, z
            return
        # slide: mu j against the sliding, and j takes what friction adds to v_n into account
        along = normal_response(m, n, n[0] - mu * tx, n[1] - mu * ty, n[2] - mu * tz)
        # jamming (Painleve): friction alone would drive the bodies together
        if along <= 0:
            along = normal_response(m, n, n[0], n[1], n[2])
        j = target / along
    out_impulse[0] = j * (n[0] - mu * tx)
    out_impulse[1] = j * (n[1] - mu * ty)
    out_impulse[2] = j * (n[2] - mu * tz)


@kernel
def normal_response(m, n, x, y, z):
    """n . M (x, y, z)"""
    return (
        n[0] * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z)
        + n[1] * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z)
        + n[2] * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z)
    )


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

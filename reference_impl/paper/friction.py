"""Friction of a collision (section "Adding friction", Eq. 10)."""

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.paper.vectors import dot, length, scaled, sub

SLIP_LEAST = 1e-9
"""Sliding speed below which the direction of sliding is undefined and there is no friction [m/s]."""


@kernel
def friction_impulse(v_ab, n, j, mu):
    """Eq. 10: J_f = -mu j v_t / |v_t|, with v_t = v_ab - (n . v_ab) n, the friction on B.

    Always mu j, even where less would stop the sliding: it may reverse it. j is that of Eq. 9, for the same
    velocity before the collision.

    Args:
        v_ab: velocity of B relative to A at the contact before the collision, a triple [m/s].
        n: unit normal from A to B, a triple.
        j: magnitude of the normal impulse [N s].
        mu: coefficient of friction of the pair (table 1).
    Returns:
        The impulse on B, a triple [N s].
    """
    v_t = sub(v_ab, scaled(dot(n, v_ab), n))
    slip = length(v_t)
    if slip < SLIP_LEAST:
        return 0.0, 0.0, 0.0
    return scaled(-mu * j / slip, v_t)

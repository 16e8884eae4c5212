"""Rotation of a body over a substep under the torques of its contacts.

Its angular momentum changes by the angular impulses of both laws: by J over the substep, of which K, that of
the law of positions, weighs the torque by the time left. A torque that changes evenly gives, at the fraction
s of the substep,

    L(s) = L(0) + s J - 3 s (1 - s) (J - K).

The rotation vector v from the orientation at the start obeys v' = rate_of(v, omega) with omega = I^-1 L
(Iserles, Munthe-Kaas, Norsett & Zanna 2000, Lie-group methods, section 4). One step of fourth order is exact
about a fixed axis.
"""

from touchstone.reference_impl.continuous.free_rotation import is_isotropic
from touchstone.reference_impl.core.conventions import KEEPS_OMEGA, SIMULATED
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    column,
    cross,
    dot,
    invert_symmetric,
    matrix_of,
    plus,
    rate_of,
    row,
    times,
    turn,
    vector_of,
)


@kernel
def curve_rotation(body, h):
    """Set `curve_turn` of a body: its rotation vector over a substep of length h [s] less h times the mean of
    `old_omega` and `path_omega`. Its world inertia is that after free rotation; turns the body."""
    out_curve = body["curve_turn"]
    out_curve[:] = 0.0
    free = body["kind"] == SIMULATED and body["driver"] < 0 and body["led"] == 1
    if not free or body["spin_keeps"] == KEEPS_OMEGA:
        return
    own, start, w0, wp = body["scratch"], vector_of(body["momentum"]), body["old_omega"], body["path_omega"]
    if is_isotropic(body["inertia"]):
        # the mean of the rates is exact
        out_curve[0], out_curve[1], out_curve[2] = times(h * h / 12, cross(wp, w0))
        return
    invert_symmetric(body["inverse_inertia"], own)
    gain = plus(_by(own, vector_of(body["omega"])), -1.0, start)
    late = plus(plus(gain, 1.0, start), -1.0, _by(own, vector_of(wp)))
    # a torque that keeps its sign changes by twice its mean at most; another one is of a landing, or a jam
    if 9 * dot(late, late) > dot(gain, gain):
        return
    invert_symmetric(body["inertia"], own)
    first = vector_of(w0)
    second = _rate(body, times(h / 2, first), start, gain, late, 0.5)
    third = _rate(body, times(h / 2, second), start, gain, late, 0.5)
    fourth = _rate(body, times(h, third), start, gain, late, 1.0)
    for i in range(3):
        mean = (first[i] + 2 * second[i] + 2 * third[i] + fourth[i]) / 6
        out_curve[i] = h * (mean - (w0[i] + wp[i]) / 2)


@kernel
def mean_omega_curve(body, h):
    """Mean angular velocity of a body over a substep of length h, less the mean of `old_omega` and
    `path_omega` [rad/s]; the rotation vector has the term h^2 / 12 omega(h) x omega(0), too (Magnus)."""
    turned = times(-h / 12, cross(body["path_omega"], body["old_omega"]))
    return plus(turned, 1 / h, vector_of(body["curve_turn"]))


@kernel
def _rate(body, v, start, gain, late, s):
    """Rate of the rotation vector v at the fraction s; the inverse inertia in body axes is in `scratch`."""
    turn(body["old_orientation"], v[0], v[1], v[2], body["orientation"])
    matrix_of(body["orientation"], body["rotation"])
    m, momentum = body["rotation"], plus(plus(start, s, gain), -3 * s * (1 - s), late)
    spin = _by(body["scratch"], (column(m, 0, momentum), column(m, 1, momentum), column(m, 2, momentum)))
    return rate_of(v, _by(m, spin))


@kernel
def _by(m, v):
    """m v, of a tuple."""
    return row(m, 0, v), row(m, 1, v), row(m, 2, v)

"""Torque-free rotation of a rigid body, exact to rounding at any time within a substep, by Taylor series.

In body-fixed axes that coincide with the world's at the start of a step, Euler's equations and the attitude
kinematics are quadratic:

    M' = M x w,    p' = p w / 2,    w = J^-1 M

M is the angular momentum, w the angular velocity, p the quaternion of the rotation since the start, and J the
world inertia at the start. At the start M equals the angular momentum in the world, which is conserved.
Cauchy products give each coefficient from the previous ones; this needs no principal axes and holds for any
inertia. For every physical inertia, the poles of the elliptic functions that solve M are at least about
1.5 rad away; a substep is therefore divided into steps of SPIN_STEP.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import KEEPS_MOMENTUM, KEEPS_NOTHING, KEEPS_OMEGA, SPIN_TERMS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    conjugate_by,
    copy_quaternion,
    invert_symmetric,
    matrix_of,
    normalise,
    rotate,
    turn,
)

SPIN_STEP = 0.4
"""Rotation that one step of the series covers [rad]: 13 to 25 terms; the cost hardly depends on it."""
SPIN_ROUNDING = 1e-17
"""Size of a term over the whole at which the series ends [1]: a tenth of a rounding."""
STEADY_SPIN = 1e-15
"""Sine between angular momentum and velocity below which the axis is fixed [1]: a few roundings."""
SPIN_STEPS = 10_000
"""Steps of one substep beyond which a body keeps its omega: 240,000 rad/s at 60 frames per second."""


@kernel
def is_isotropic(inertia):
    """Whether a body's inertia is exactly the same about all axes."""
    equal = inertia[0, 0] == inertia[1, 1] and inertia[1, 1] == inertia[2, 2]
    return equal and inertia[0, 1] == 0 and inertia[0, 2] == 0 and inertia[1, 2] == 0


@kernel
def refresh_inertia(body):
    """World inverse inertia of a simulated body from its rotation matrix."""
    conjugate_by(body["rotation"], body["inertia"], body["scratch"])
    invert_symmetric(body["scratch"], body["inverse_inertia"])


@kernel
def rotate_freely(body, h):
    """Omega, orientation and world inverse inertia after a time h of torque-free rotation from `old_*`.

    Sets `spin_steps`: the number of series steps in h, or 0 if the body rotates about a fixed axis. With
    steps, also sets `spin_most` and `spin_bend`: bounds on |omega| [rad per h] and |omega'| [rad per h^2].
    `end_substep` keeps what `spin_keeps` says.
    """
    body["spin_steps"], body["spin_keeps"] = 0, KEEPS_NOTHING
    inertia, omega, momentum = body["inertia"], body["old_omega"], body["momentum"]
    if is_isotropic(inertia):
        return
    conjugate_by(body["rotation"], inertia, body["scratch"])
    rotate(body["scratch"], omega, momentum)
    x = momentum[1] * omega[2] - momentum[2] * omega[1]
    y = momentum[2] * omega[0] - momentum[0] * omega[2]
    z = momentum[0] * omega[1] - momentum[1] * omega[0]
    rate = sqrt(omega[0] ** 2 + omega[1] ** 2 + omega[2] ** 2)
    size = sqrt(momentum[0] ** 2 + momentum[1] ** 2 + momentum[2] ** 2)
    steady = x * x + y * y + z * z <= (STEADY_SPIN * size * rate) ** 2
    # a spin beyond the steps, or NaN, keeps its omega, which conserves the energy but not the momentum
    too_fast = not rate * h < SPIN_STEPS * SPIN_STEP
    if steady or too_fast:
        turn(body["old_orientation"], omega[0] * h, omega[1] * h, omega[2] * h, body["orientation"])
        matrix_of(body["orientation"], body["rotation"])
        body["spin_keeps"] = KEEPS_OMEGA if too_fast else KEEPS_NOTHING
        refresh_inertia(body)
        return
    body["spin_keeps"] = KEEPS_MOMENTUM
    body["spin_steps"] = 1 + int(rate * h / SPIN_STEP)
    body["spin_span"] = h / body["spin_steps"]
    _run_steps(body)
    rotation_at(body, 1.0)
    matrix_of(body["orientation"], body["rotation"])
    free_omega(body, body["omega"])


@kernel
def free_omega(body, out_omega):
    """Angular velocity of a freely rotating body at its current rotation matrix; refreshes its inertia."""
    refresh_inertia(body)
    rotate(body["inverse_inertia"], body["momentum"], out_omega)


@kernel
def _run_steps(body):
    """Evaluate all steps and set the bounds on |omega| and |omega'|."""
    most = bend = 0.0
    for step in range(body["spin_steps"]):
        rate, change = _start_step(body, step)
        most, bend = max(most, rate), max(bend, change)
    h = body["spin_span"] * body["spin_steps"]
    body["spin_most"], body["spin_bend"] = most * h, bend * h * body["spin_steps"]


@kernel
def rotation_at(body, s):
    """Orientation of a freely rotating body at fraction s of the time h of `rotate_freely`."""
    steps = body["spin_steps"]
    wanted = max(0, min(int(s * steps), steps - 1))
    if wanted < body["spin_step"]:
        _start_step(body, 0)
    while body["spin_step"] < wanted:
        _start_step(body, body["spin_step"] + 1)
    _evaluate(body, s * steps - wanted)


@kernel
def _start_step(body, step):
    """Expand the series of step 0 or of the step after the current one; returns the bounds of `_expand`."""
    start = body["spin_start"]
    if step == 0:
        copy_quaternion(body["old_orientation"], start)
    else:
        _evaluate(body, 1.0)
        copy_quaternion(body["orientation"], start)
    body["spin_step"] = step
    matrix_of(start, body["rotation"])
    refresh_inertia(body)
    return _expand(body, body["spin_span"])


@kernel
def _expand(body, span):
    """Series coefficients in time / span, with span [s], from the current rotation matrix.

    Returns:
        (most, change): bounds on |omega| [rad/s] and on its change [rad/s per span] in the step.
    """
    p, M, w = body["turn_series"], body["momentum_series"], body["omega_series"]
    inverse = body["inverse_inertia"]
    p[0, 0], p[0, 1], p[0, 2], p[0, 3] = 1.0, 0.0, 0.0, 0.0
    for i in range(3):
        M[0, i] = body["momentum"][i]
    size = sqrt(M[0, 0] ** 2 + M[0, 1] ** 2 + M[0, 2] ** 2)
    most = change = 0.0
    for k in range(SPIN_TERMS):
        for i in range(3):
            w[k, i] = inverse[i, 0] * M[k, 0] + inverse[i, 1] * M[k, 1] + inverse[i, 2] * M[k, 2]
        rate = sqrt(w[k, 0] ** 2 + w[k, 1] ** 2 + w[k, 2] ** 2)
        most, change = most + rate, change + k * rate
        left = sqrt(M[k, 0] ** 2 + M[k, 1] ** 2 + M[k, 2] ** 2) / size
        left += sqrt(p[k, 0] ** 2 + p[k, 1] ** 2 + p[k, 2] ** 2 + p[k, 3] ** 2)
        body["spin_terms"] = k + 1
        if left <= SPIN_ROUNDING or k + 1 == SPIN_TERMS:
            break
        _multiply_series(p, M, w, k, span / (k + 1))
    return most, change


@kernel
def _multiply_series(p, M, w, k, factor):
    """Coefficients k + 1 of the quaternion and of the momentum from those up to k."""
    x = y = z = a = b = c = d = 0.0
    for j in range(k + 1):
        u, v, t = w[k - j, 0], w[k - j, 1], w[k - j, 2]
        x += M[j, 1] * t - M[j, 2] * v
        y += M[j, 2] * u - M[j, 0] * t
        z += M[j, 0] * v - M[j, 1] * u
        a -= p[j, 1] * u + p[j, 2] * v + p[j, 3] * t
        b += p[j, 0] * u + p[j, 2] * t - p[j, 3] * v
        c += p[j, 0] * v + p[j, 3] * u - p[j, 1] * t
        d += p[j, 0] * t + p[j, 1] * v - p[j, 2] * u
    M[k + 1, 0], M[k + 1, 1], M[k + 1, 2] = factor * x, factor * y, factor * z
    factor /= 2
    p[k + 1, 0], p[k + 1, 1], p[k + 1, 2], p[k + 1, 3] = factor * a, factor * b, factor * c, factor * d


@kernel
def _evaluate(body, t):
    """Orientation at the fraction t of the current step (Horner)."""
    p, q, out_q = body["turn_series"], body["spin_start"], body["orientation"]
    a = b = c = d = 0.0
    for k in range(body["spin_terms"] - 1, -1, -1):
        a, b, c, d = a * t + p[k, 0], b * t + p[k, 1], c * t + p[k, 2], d * t + p[k, 3]
    w, x, y, z = q[0], q[1], q[2], q[3]
    out_q[0] = a * w - b * x - c * y - d * z
    out_q[1] = a * x + b * w + c * z - d * y
    out_q[2] = a * y + c * w + d * x - b * z
    out_q[3] = a * z + d * w + b * y - c * x
    normalise(out_q)

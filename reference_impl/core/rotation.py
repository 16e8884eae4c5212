"""Unit quaternions (wxyz), rotation matrices and rotation vectors."""

from math import atan2, cos, sin, sqrt

from touchstone.reference_impl.core.kernel import kernel

SMALL_ANGLE = 1e-8
"""Angle below which sin(x) / x is 1 to rounding [rad]."""
SMALL_SQUARE = 1e-6
"""Square of an angle below which two terms of the series of a Jacobian leave 1e-15 [rad^2]."""


@kernel
def copy_vector(v, out_vector):
    """Copy a (3,) vector element by element: a slice assignment may allocate, which kernels cannot."""
    for i in range(3):
        out_vector[i] = v[i]


@kernel
def copy_quaternion(q, out_q):
    """Copy a (4,) quaternion element by element."""
    for i in range(4):
        out_q[i] = q[i]


@kernel
def matrix_of(q, out_matrix):
    """Compute the rotation matrix (3, 3) of the unit quaternion q."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    out_matrix[0, 0] = 1 - 2 * (y * y + z * z)
    out_matrix[0, 1] = 2 * (x * y - w * z)
    out_matrix[0, 2] = 2 * (x * z + w * y)
    out_matrix[1, 0] = 2 * (x * y + w * z)
    out_matrix[1, 1] = 1 - 2 * (x * x + z * z)
    out_matrix[1, 2] = 2 * (y * z - w * x)
    out_matrix[2, 0] = 2 * (x * z - w * y)
    out_matrix[2, 1] = 2 * (y * z + w * x)
    out_matrix[2, 2] = 1 - 2 * (x * x + y * y)


@kernel
def quaternion_of(m, out_q):
    """Compute the unit quaternion of a rotation matrix (Shepperd 1978: divides by the largest component)."""
    t = m[0, 0] + m[1, 1] + m[2, 2]
    k = 0
    if t < m[0, 0] or t < m[1, 1] or t < m[2, 2]:
        k = 1 if m[0, 0] >= m[1, 1] and m[0, 0] >= m[2, 2] else (2 if m[1, 1] >= m[2, 2] else 3)
    if k == 0:
        out_q[0] = 1 + t
        out_q[1], out_q[2], out_q[3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    else:
        i = k - 1
        j, l = (i + 1) % 3, (i + 2) % 3  # noqa: E741
        out_q[0] = m[l, j] - m[j, l]
        out_q[1 + i] = 1 + m[i, i] - m[j, j] - m[l, l]
        out_q[1 + j] = m[j, i] + m[i, j]
        out_q[1 + l] = m[l, i] + m[i, l]
    normalise(out_q)


@kernel
def normalise(q):
    """Normalise a quaternion to length 1, in place."""
    size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] /= size


@kernel
def turn(q, x, y, z, out_q):
    """Rotate quaternion q by the world rotation vector v = (x, y, z) [rad]: exp(v) q; `out_q` may be q."""
    angle = sqrt(x * x + y * y + z * z)
    s = 0.5 if angle < SMALL_ANGLE else sin(0.5 * angle) / angle
    c = cos(0.5 * angle)
    x, y, z = s * x, s * y, s * z
    q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
    out_q[0] = c * q0 - x * q1 - y * q2 - z * q3
    out_q[1] = c * q1 + x * q0 + y * q3 - z * q2
    out_q[2] = c * q2 - x * q3 + y * q0 + z * q1
    out_q[3] = c * q3 + x * q2 - y * q1 + z * q0
    normalise(out_q)


@kernel
def rotation_between(p, q, out_vector):
    """Compute the shortest world rotation vector [rad] from quaternion p to q."""
    w = q[0] * p[0] + q[1] * p[1] + q[2] * p[2] + q[3] * p[3]
    x = -q[0] * p[1] + q[1] * p[0] - q[2] * p[3] + q[3] * p[2]
    y = -q[0] * p[2] + q[1] * p[3] + q[2] * p[0] - q[3] * p[1]
    z = -q[0] * p[3] - q[1] * p[2] + q[2] * p[1] + q[3] * p[0]
    size = sqrt(x * x + y * y + z * z)
    factor = 2.0 if size < SMALL_ANGLE else 2 * atan2(size, abs(w)) / size
    if w < 0:
        factor = -factor
    out_vector[0], out_vector[1], out_vector[2] = factor * x, factor * y, factor * z


@kernel
def rotate(m, v, out_v):
    """out_v = m v; `out_v` may be v."""
    x, y, z = v[0], v[1], v[2]
    for i in range(3):
        out_v[i] = m[i, 0] * x + m[i, 1] * y + m[i, 2] * z


@kernel
def conjugate_by(rotation, matrix, out_matrix):
    """out_matrix = rotation matrix rotation^T, for a symmetric (3, 3) matrix; must not alias."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                for l in range(3):  # noqa: E741
                    total += rotation[i, k] * matrix[k, l] * rotation[j, l]
            out_matrix[i, j] = total


@kernel
def multiply(a, b, out_matrix):
    """out_matrix = a b for (3, 3) matrices; must not alias."""
    for i in range(3):
        for j in range(3):
            out_matrix[i, j] = a[i, 0] * b[0, j] + a[i, 1] * b[1, j] + a[i, 2] * b[2, j]


@kernel
def invert_symmetric(m, out_matrix):
    """Invert a symmetric positive definite (3, 3) matrix by cofactors; must not alias."""
    a = m[1, 1] * m[2, 2] - m[1, 2] * m[1, 2]
    b = m[0, 2] * m[1, 2] - m[0, 1] * m[2, 2]
    c = m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]
    inverse = 1 / (m[0, 0] * a + m[0, 1] * b + m[0, 2] * c)
    out_matrix[0, 0] = a * inverse
    out_matrix[0, 1] = out_matrix[1, 0] = b * inverse
    out_matrix[0, 2] = out_matrix[2, 0] = c * inverse
    out_matrix[1, 1] = (m[0, 0] * m[2, 2] - m[0, 2] * m[0, 2]) * inverse
    out_matrix[1, 2] = out_matrix[2, 1] = (m[0, 1] * m[0, 2] - m[0, 0] * m[1, 2]) * inverse
    out_matrix[2, 2] = (m[0, 0] * m[1, 1] - m[0, 1] * m[0, 1]) * inverse


@kernel
def dot(u, v):
    """Scalar product of two vectors (3,), arrays or tuples."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@kernel
def cross(u, v):
    """Vector product of two vectors (3,), arrays or tuples, as a tuple."""
    return u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]


@kernel
def vector_of(v):
    """An array (3,) as a tuple."""
    return v[0], v[1], v[2]


@kernel
def times(s, v):
    """s v."""
    return s * v[0], s * v[1], s * v[2]


@kernel
def plus(u, s, v):
    """u + s v."""
    return u[0] + s * v[0], u[1] + s * v[1], u[2] + s * v[2]


@kernel
def column(m, j, v):
    """Component of v along column j of m."""
    return m[0, j] * v[0] + m[1, j] * v[1] + m[2, j] * v[2]


@kernel
def row(m, i, v):
    """Component i of m v."""
    return m[i, 0] * v[0] + m[i, 1] * v[1] + m[i, 2] * v[2]


@kernel
def spin_of(v, rate):
    """Angular velocity of exp(v) for a rotation vector v that changes at a rate: J rate, with the left
    Jacobian J = I + b [v] + c [v]^2 of rotations."""
    square = dot(v, v)
    if square < SMALL_SQUARE:
        b, c = 0.5 - square / 24, 1 / 6 - square / 120
    else:
        angle = sqrt(square)
        b, c = (1 - cos(angle)) / square, (1 - sin(angle) / angle) / square
    x = cross(v, rate)
    return plus(plus(rate, b, x), c, cross(v, x))


@kernel
def rate_of(v, spin):
    """Rate of a rotation vector v at which exp(v) has an angular velocity: J^-1 spin, the inverse of
    `spin_of` for angles below 2 pi."""
    square = dot(v, v)
    if square < SMALL_SQUARE:
        c = 1 / 12 + square / 720
    else:
        half = sqrt(square) / 2
        c = (1 - half * cos(half) / sin(half)) / square
    x = cross(v, spin)
    return plus(plus(spin, -0.5, x), c, cross(v, x))


@kernel
def turned_by(v, u):
    """A vector u turned by the rotation vector v: u + [v] J u."""
    return plus(u, 1.0, cross(v, spin_of(v, u)))


@kernel
def carried_along(m, n, v):
    """Vector v after the smallest rotation that turns unit vector m into n, which is not opposite."""
    s = plus(m, 1.0, n)
    return plus(plus(v, -dot(s, v) / (1 + dot(m, n)), s), 2 * dot(m, v), n)

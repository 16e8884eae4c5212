"""Vectors as triples, which kernels hold in registers: the equations are written with these."""

from math import sqrt

from touchstone.reference_impl.core.kernel import inlined_kernel, kernel


@inlined_kernel
def vector(field):
    """The triple of an array field (3,)."""
    return field[0], field[1], field[2]


@kernel
def store(v, out_field):
    """Write a triple to an array field (3,)."""
    out_field[0], out_field[1], out_field[2] = v


@inlined_kernel
def add(a, b):
    """a + b"""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined_kernel
def sub(a, b):
    """a - b"""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inlined_kernel
def scaled(s, a):
    """s a"""
    return s * a[0], s * a[1], s * a[2]


@inlined_kernel
def dot(a, b):
    """a . b"""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined_kernel
def cross(a, b):
    """a x b"""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inlined_kernel
def length(a):
    """|a|"""
    return sqrt(dot(a, a))


@inlined_kernel
def times(matrix, a):
    """M a, for a matrix (3, 3)"""
    m = matrix
    return (
        m[0, 0] * a[0] + m[0, 1] * a[1] + m[0, 2] * a[2],
        m[1, 0] * a[0] + m[1, 1] * a[1] + m[1, 2] * a[2],
        m[2, 0] * a[0] + m[2, 1] * a[1] + m[2, 2] * a[2],
    )


@inlined_kernel
def transposed_times(matrix, a):
    """M^T a, for a matrix (3, 3)"""
    m = matrix
    return (
        m[0, 0] * a[0] + m[1, 0] * a[1] + m[2, 0] * a[2],
        m[0, 1] * a[0] + m[1, 1] * a[1] + m[2, 1] * a[2],
        m[0, 2] * a[0] + m[1, 2] * a[1] + m[2, 2] * a[2],
    )

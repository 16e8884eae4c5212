"""Siconos (Acary et al.) as a second opinion on contact problems: its C library, where it is installed.

Debian and Ubuntu have it as `libsiconos-numerics7`.
"""

import ctypes
from ctypes import POINTER, c_bool, c_double, c_int, c_void_p
from ctypes.util import find_library

import numpy as np

GAUSS_SEIDEL = 500
"""Nonsmooth Gauss-Seidel, SICONOS_FRICTION_3D_NSGS of its Friction_cst.h."""
DENSE = 0
"""Storage type of a dense matrix, by columns."""


class _Options(ctypes.Structure):
    """First fields of `SolverOptions` (SolverOptions.h): the first integer is the limit of iterations, the
    first real number the tolerance."""

    _fields_ = (
        ("solver", c_int),
        ("is_set", c_bool),
        ("integer_count", c_int),
        ("integers", POINTER(c_int)),
        ("real_count", c_int),
        ("reals", POINTER(c_double)),
    )


def library() -> ctypes.CDLL | None:
    """The library with the signatures used here, or None where it is not installed."""
    found = find_library("siconos_numerics")
    if found is None:
        return None
    numerics = ctypes.CDLL(found)
    numerics.NM_create_from_data.restype = c_void_p
    numerics.NM_create_from_data.argtypes = [c_int, c_int, c_int, c_void_p]
    numerics.frictionContactProblem_new_with_data.restype = c_void_p
    numerics.frictionContactProblem_new_with_data.argtypes = [c_int, c_int, c_void_p, c_void_p, c_void_p]
    numerics.solver_options_create.restype = POINTER(_Options)
    numerics.solver_options_create.argtypes = [c_int]
    numerics.fc3d_driver.restype = c_int
    numerics.fc3d_driver.argtypes = [c_void_p, c_void_p, c_void_p, POINTER(_Options)]
    return numerics


def solved(numerics: ctypes.CDLL, matrix: np.ndarray, free: np.ndarray, friction: np.ndarray) -> np.ndarray:
    """Impulses of a contact problem, per contact along its normal and two tangents (3 n,) [N s].

    Args:
        matrix: velocities per impulse (3 n, 3 n) [1/kg].
        free: velocities without impulses (3 n,) [m/s].
        friction: coefficients (n,).
    """
    columns, free, friction = np.asfortranarray(matrix), free.copy(), friction.copy()
    size = len(free)
    stored = numerics.NM_create_from_data(DENSE, size, size, columns.ctypes.data)
    problem = numerics.frictionContactProblem_new_with_data(
        3, size // 3, stored, free.ctypes.data, friction.ctypes.data
    )
    options = numerics.solver_options_create(GAUSS_SEIDEL)
    options.contents.integers[0], options.contents.reals[0] = 20_000, 1e-14
    impulses, velocities = np.zeros(size), np.zeros(size)
    numerics.fc3d_driver(problem, impulses.ctypes.data, velocities.ctypes.data, options)
    return impulses

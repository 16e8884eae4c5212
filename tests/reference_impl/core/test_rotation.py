"""Quaternions, matrices and rotation vectors against scipy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.core.rotation import (
    invert_symmetric,
    matrix_of,
    quaternion_of,
    rotation_between,
    turn,
)

ANGLES = [0.0, 1e-12, 1e-8, 1e-4, 1.0, 3.0, np.pi - 1e-9, np.pi]


@pytest.mark.parametrize("angle", ANGLES)
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-0.6, 0, 0.8), (2 / 3, -1 / 3, 2 / 3)])
def test_quaternion_and_matrix_are_inverse(angle: float, axis) -> None:
    """Return from matrix to quaternion on every branch, up to sign."""
    turned = Rotation.from_rotvec(angle * np.array(axis))
    q, matrix, back = turned.as_quat(scalar_first=True), np.zeros((3, 3)), np.zeros(4)
    matrix_of(q, matrix)
    np.testing.assert_allclose(matrix, turned.as_matrix(), atol=1e-15)
    quaternion_of(matrix, back)
    np.testing.assert_allclose(back * np.sign(back @ q), q, atol=1e-15)


@pytest.mark.parametrize("angle", ANGLES[:-1])
def test_turn_and_rotation_between_are_inverse(angle: float) -> None:
    """Recover the rotation vector that turned a quaternion, whatever the sign of either."""
    start = Rotation.from_rotvec([0.3, -2.0, 0.7])
    vector = angle * np.array([2.0, -1.0, 2.0]) / 3
    p, q, found = start.as_quat(scalar_first=True), np.zeros(4), np.zeros(3)
    turn(p, *vector, q)
    expected = (Rotation.from_rotvec(vector) * start).as_quat(scalar_first=True)
    np.testing.assert_allclose(q * np.sign(q @ expected), expected, atol=1e-15)
    for sign in (1, -1):
        rotation_between(p, sign * q, found)
        # the angle is 2 atan2(|v|, w): good to rounding everywhere short of pi
        np.testing.assert_allclose(found, vector, atol=5e-15)


def test_inverse_of_an_inertia() -> None:
    """Invert symmetric positive definite matrices."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        root, inverse = rng.normal(size=(3, 3)), np.zeros((3, 3))
        m = root @ root.T + 0.1 * np.eye(3)
        invert_symmetric(m, inverse)
        # cofactors lose the condition number, at most 1e3 here
        np.testing.assert_allclose(inverse @ m, np.eye(3), atol=1e-12)

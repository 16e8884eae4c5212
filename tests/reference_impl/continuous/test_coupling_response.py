"""The damped spring in closed form, against the matrix exponential."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm

from touchstone.reference_impl.continuous.coupling_response import decay, unit_response

LOGARITHM = st.floats(-1, 1)


@given(LOGARITHM, LOGARITHM, LOGARITHM)
def test_the_response_to_a_force_is_the_matrix_exponential(h: float, k: float, r: float) -> None:
    """Over 1e-4 to 0.03 s, for stiffness from 1e-1 to 1e7 /s^2 and damping from 1e-2 to 1e4 /s."""
    h, k, r = 10 ** (-2.7 + 1.3 * h), 10 ** (3 + 4 * k), 10 ** (1 + 3 * r)
    exact = expm(np.array([[0, 1, 0], [-k, -r, 1], [0, 0, 0]]) * h)
    moved, speed = unit_response(k, r, h)
    np.testing.assert_allclose(moved, exact[0, 2], rtol=1e-8)
    np.testing.assert_allclose(speed, exact[1, 2], rtol=1e-8, atol=1e-9 * h)


@given(LOGARITHM, LOGARITHM, LOGARITHM)
def test_a_force_that_balances_the_spring_moves_nothing(h: float, k: float, r: float) -> None:
    """A deviation x and the force K x leave x where it is, at any step: static forces are exact."""
    h, k, r = 10 ** (-2.7 + 1.3 * h), 10 ** (3 + 4 * k), 10 ** (1 + 3 * r)
    x, v = decay(0.01, 0.0, k, r, h)
    moved, speed = unit_response(k, r, h)
    np.testing.assert_allclose(x + moved * k * 0.01, 0.01, rtol=1e-9)
    np.testing.assert_allclose(v + speed * k * 0.01, 0.0, atol=1e-9 * k * h * 0.01)

"""The damped spring in closed form, against the matrix exponential."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.continuous.coupling_response import decay, decay_turn, unit_response

LOGARITHM = st.floats(-1, 1)


@settings(deadline=None)
@given(LOGARITHM, LOGARITHM, LOGARITHM)
def test_the_response_to_a_force_is_the_matrix_exponential(h: float, k: float, r: float) -> None:
    """Over 1e-4 to 0.03 s, for stiffness from 1e-1 to 1e7 /s^2 and damping from 1e-2 to 1e4 /s."""
    h, k, r = 10 ** (-2.7 + 1.3 * h), 10 ** (3 + 4 * k), 10 ** (1 + 3 * r)
    exact = expm(np.array([[0, 1, 0], [-k, -r, 1], [0, 0, 0]]) * h)
    moved, speed = unit_response(k, r, h)
    np.testing.assert_allclose(moved, exact[0, 2], rtol=1e-8)
    np.testing.assert_allclose(speed, exact[1, 2], rtol=1e-8, atol=1e-9 * h)


@settings(deadline=None)
@given(LOGARITHM, LOGARITHM, LOGARITHM)
def test_a_force_that_balances_the_spring_moves_nothing(h: float, k: float, r: float) -> None:
    """A deviation x and the force K x leave x where it is, at any step: static forces are exact."""
    h, k, r = 10 ** (-2.7 + 1.3 * h), 10 ** (3 + 4 * k), 10 ** (1 + 3 * r)
    x, v = decay(0.01, 0.0, k, r, h)
    moved, speed = unit_response(k, r, h)
    np.testing.assert_allclose(x + moved * k * 0.01, 0.01, rtol=1e-9)
    np.testing.assert_allclose(v + speed * k * 0.01, 0.0, atol=1e-9 * k * h * 0.01)


@settings(deadline=None)
@given(st.integers(0, 1000), st.floats(1e-3, 3.0))
def test_a_turning_driver_moves_as_its_angular_velocity_says(seed: int, angle: float) -> None:
    """However far it is turned from its goal, at the start and after a time; two times follow as one."""
    rng = np.random.default_rng(seed)
    axis, omega, pace = rng.normal(size=(3, 3)) * ((1.0,), (30.0,), (5.0,))
    error = angle * axis / np.linalg.norm(axis)

    def after(t: float) -> tuple[Rotation, np.ndarray, np.ndarray]:
        """Orientation, angular velocity and rotation vector from the goal after a time t."""
        e = error.copy()
        w = np.array(decay_turn(e, omega, tuple(pace), 400.0, t))
        return Rotation.from_rotvec(e) * Rotation.from_rotvec(t * pace), w, e

    step = 1e-7
    for t in (0.0, 0.01):
        (start, before, _), (end, later, _) = after(t), after(t + step)
        turned = (end * start.inv()).as_rotvec() / step
        np.testing.assert_allclose(turned, (before + later) / 2, atol=1e-5 * np.linalg.norm(before))
    _, w, e = after(0.01)
    w = np.array(decay_turn(e, w, tuple(pace), 400.0, 0.02))
    _, whole, kept = after(0.03)
    np.testing.assert_allclose(e, kept, atol=1e-11)
    np.testing.assert_allclose(w, whole, atol=1e-9)

"""Torque-free rotation against its closed forms, and the invariants of Euler's equations."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.special import ellipj

from touchstone.reference_impl.continuous.free_rotation import (
    SPIN_STEP,
    SPIN_STEPS,
    free_omega,
    refresh_inertia,
    rotate_freely,
    rotation_at,
)
from touchstone.reference_impl.core.rotation import matrix_of
from touchstone.reference_impl.core.world import BODY

ROUNDING = 1e-14
"""Some roundings of a number near 1, and of an angle of a radian or so."""


def top(inertia: object, omega: object, posture: Rotation | None = None) -> np.void:
    """A body at the start of a substep; a vector of inertias stands for principal ones."""
    body = np.zeros(1, BODY)[0]
    given_inertia = np.array(inertia, dtype=float)
    body["inertia"] = np.diag(given_inertia) if given_inertia.ndim == 1 else given_inertia
    turned = posture or Rotation.identity()
    body["old_orientation"] = body["orientation"] = turned.as_quat(scalar_first=True)
    body["rotation"] = turned.as_matrix()
    body["old_omega"] = body["omega"] = omega
    refresh_inertia(body)
    return body


def go_on(body: np.void, h: float) -> None:
    """One more substep of length h."""
    body["old_orientation"], body["old_omega"] = body["orientation"], body["omega"]
    rotate_freely(body, h)


def momentum(body: np.void) -> np.ndarray:
    """Angular momentum in the world at the body's present pose and rate."""
    return body["rotation"] @ body["inertia"] @ body["rotation"].T @ body["omega"]


def euler_top(inertia: np.ndarray, omega: np.ndarray, t: float) -> np.ndarray:
    """Rate in body axes after time t (Landau & Lifshitz, section 37), for I1 < I2 < I3, omega_2 = 0 at the
    start, and omega_1, omega_3 > 0."""
    a, b, c = inertia
    energy, square = inertia @ omega**2, (inertia * omega) @ (inertia * omega)
    high = square > energy * b
    if not high:
        a, c = c, a
    speed = np.sqrt((c - b) * (square - energy * a) / (a * b * c))
    m = (b - a) * (energy * c - square) / ((c - b) * (square - energy * a))
    sn, cn, dn, _ = ellipj(speed * t, m)
    first = np.sqrt((energy * c - square) / (a * (c - a))) * cn
    second = np.sqrt((energy * c - square) / (b * (c - b))) * sn
    third = np.sqrt((square - energy * a) / (c * (c - a))) * dn
    return np.array([first, second, third]) if high else np.array([third, second, first])


@pytest.mark.parametrize("omega", [(2.0, 0.0, 15.0), (15.0, 0.0, 2.0), (10.0, 0.0, 6.0), (1e-3, 0.0, 20.0)])
def test_the_rate_is_the_elliptic_functions(omega) -> None:
    """Follow cn, sn and dn over ten periods of an asymmetric body, in frames and within them."""
    inertia, rate = np.array([0.02, 0.03, 0.04]), np.array(omega)
    posture = Rotation.from_rotvec([0.3, -1.0, 0.7])
    body = top(inertia, posture.apply(rate), posture)
    found = np.zeros(3)
    for frame in range(200):
        go_on(body, 1 / 60)
        assert body["spin_steps"] > 0
        for s in (0.3, 1.0):
            rotation_at(body, s)
            matrix_of(body["orientation"], body["rotation"])
            free_omega(body, found)
            expected = euler_top(inertia, rate, (frame + s) / 60)
            # roundings of the phase grow with the number of frames
            np.testing.assert_allclose(body["rotation"].T @ found, expected, atol=1e-12 * np.abs(rate).max())


def test_a_symmetric_top_precesses() -> None:
    """Turn a symmetric top about its axis, and that about the angular momentum, at constant rates."""
    across, along, rate = 0.03, 0.011, np.array([3.0, -4.0, 12.0])
    body, t = top((across, across, along), rate), 0.0
    about_momentum = np.array([across, across, along]) * rate / across
    about_axis = np.array([0, 0, rate[2] * (1 - along / across)])
    for _ in range(60):
        t += 1 / 60
        go_on(body, 1 / 60)
        expected = Rotation.from_rotvec(t * about_momentum) * Rotation.from_rotvec(t * about_axis)
        np.testing.assert_allclose(body["rotation"], expected.as_matrix(), atol=1e-13)


@pytest.mark.parametrize("axis", range(3))
def test_a_principal_axis_stays(axis: int) -> None:
    """Keep the rate to the bit about a principal axis, the middle one included."""
    rate = np.eye(3)[axis] * 7.0
    body = top((0.02, 0.03, 0.04), rate)
    go_on(body, 0.1)
    assert body["spin_steps"] == 0
    np.testing.assert_array_equal(body["omega"], rate)
    expected = np.linalg.inv(body["rotation"] @ body["inertia"] @ body["rotation"].T)
    np.testing.assert_allclose(body["rotation"], Rotation.from_rotvec(0.1 * rate).as_matrix(), atol=ROUNDING)
    np.testing.assert_allclose(body["inverse_inertia"], expected, rtol=1e-12, atol=1e-12)


numbers = st.floats(-1, 1, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)


@st.composite
def tops(draw: st.DrawFn) -> np.void:
    """A body of any physical inertia, from a needle to a plate, turned and spinning at up to 60 rad/s."""
    spread = [draw(st.floats(-4, 0)) for _ in range(3)]
    squares = 10.0 ** np.array(spread)
    axes = Rotation.from_rotvec(3 * draw(vectors)).as_matrix()
    inertia = axes @ np.diag(squares.sum() - squares) @ axes.T
    rate = draw(st.sampled_from([1e-3, 1.0, 20.0])) * 3 * draw(vectors)
    return top((inertia + inertia.T) / 2, rate, Rotation.from_rotvec(3 * draw(vectors)))


@settings(max_examples=100, deadline=None)
@given(tops())
def test_momentum_and_energy_stay(body: np.void) -> None:
    """Keep the angular momentum and the energy over twenty frames."""
    before = momentum(body)
    energy = before @ body["omega"]
    for _ in range(20):
        go_on(body, 1 / 60)
    # roundings, and the condition of the inertia, at most 2e4, of every frame
    # (not the norm: squares of tiny momenta underflow)
    np.testing.assert_allclose(momentum(body), before, atol=1e-11 * np.abs(before).max())
    assert momentum(body) @ body["omega"] == pytest.approx(energy, rel=1e-10, abs=0)


@settings(max_examples=60, deadline=None)
@given(tops(), st.floats(0.01, 0.99))
def test_a_part_of_the_time_is_a_shorter_time(body: np.void, s: float) -> None:
    """Pose at a fraction what a rotation for that time gives, and reach the same end in two parts."""
    parts, short = body.copy(), body.copy()
    rotate_freely(body, 1 / 60)
    end = body["orientation"].copy()
    rotate_freely(short, s / 60)
    if body["spin_steps"] > 0:
        rotation_at(body, s)
        np.testing.assert_allclose(body["orientation"], short["orientation"], atol=1e-12)
    go_on(parts, s / 60)
    go_on(parts, (1 - s) / 60)
    np.testing.assert_allclose(parts["orientation"], end, atol=1e-12)


@settings(max_examples=60, deadline=None)
@given(tops())
def test_the_bounds_hold(body: np.void) -> None:
    """Bound the rate and its change all along."""
    h, rates = 0.05, []
    rotate_freely(body, h)
    if body["spin_steps"] == 0:
        return
    most, bend = body["spin_most"] / h, body["spin_bend"] / h**2
    samples = np.linspace(0, 1, 201)
    for s in samples:
        rotation_at(body, s)
        matrix_of(body["orientation"], body["rotation"])
        free_omega(body, body["spin_rate"])
        rates.append(body["spin_rate"].copy())
    assert np.linalg.norm(rates, axis=1).max() <= most * (1 + 1e-12)
    # a mean change over a sample's time is at most the largest; roundings of the rates are divided by it
    changes = np.linalg.norm(np.diff(rates, axis=0), axis=1) / (h / 200)
    assert changes.max() <= bend * (1 + 1e-9) + 1e-12 * most * 200 / h


def test_any_fraction_in_any_order() -> None:
    """Pose fractions of a fast spin of many steps backwards, forwards and twice, always the same."""
    body = top((0.02, 0.03, 0.04), (30.0, 200.0, -100.0))
    rotate_freely(body, 1 / 60)
    assert body["spin_steps"] > 5
    poses = {}
    for s in (1.0, 0.0, 0.7, 0.31, 0.3, 0.99, 0.3, 0.7, 0.0, 1.0):
        rotation_at(body, s)
        np.testing.assert_array_equal(poses.setdefault(s, body["orientation"].copy()), body["orientation"])
    np.testing.assert_allclose(poses[0.0], body["old_orientation"], atol=ROUNDING)


@pytest.mark.parametrize("rate", [1e7, 1e50, np.nan])
def test_a_senseless_spin_ends(rate: float) -> None:
    """Return at once from rates beyond the cap; a finite one keeps its axis."""
    body = top((0.02, 0.03, 0.04), (rate, rate / 2, 1.0))
    rotate_freely(body, 1 / 60)
    assert rate / 60 > SPIN_STEPS * SPIN_STEP or np.isnan(rate)
    assert body["spin_steps"] == 0
    assert np.isfinite(body["orientation"]).all() or np.isnan(rate)

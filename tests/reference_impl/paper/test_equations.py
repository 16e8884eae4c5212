"""Every equation of the paper against the formula in scalar Python, written from the page."""

from math import acos, cos, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from touchstone.reference_impl.core.driver_dtypes import DRIVER
from touchstone.reference_impl.paper.ccd_ik import joint_rotation, project
from touchstone.reference_impl.paper.friction import friction_impulse
from touchstone.reference_impl.paper.impulses import impulse_magnitude, rotational_term
from touchstone.reference_impl.paper.penetration_depth import add_depth, global_depth
from touchstone.reference_impl.paper.virtual_coupling import coupled, follow_tracker

SEEDS = range(20)
ROUNDING = 1e-12
"""Relative difference of the same formula in another order of operations [1]."""
Triple = tuple[float, float, float]


def triple(rng: np.random.Generator) -> Triple:
    """Random vector."""
    return tuple(rng.normal(size=3).tolist())


def unit(rng: np.random.Generator) -> Triple:
    """Random direction."""
    v = triple(rng)
    return tuple(x / sqrt(sum(y * y for y in v)) for x in v)


def dot(a, b) -> float:
    """a . b"""
    return sum(x * y for x, y in zip(a, b))


def cross(a, b) -> list[float]:
    """a x b"""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


@pytest.mark.parametrize("seed", SEEDS)
def test_eq_1_global_depth(seed: int) -> None:
    """PD_g = sum(pd_i^2 n_i) / sum(pd_i)."""
    rng = np.random.default_rng(seed)
    depths, normals = rng.uniform(0, 0.1, 4).tolist(), [unit(rng) for _ in range(4)]
    sums = np.zeros((3, 3))
    for pd, n in zip(depths, normals):
        add_depth(sums, 1.0, pd, n, 1.0)
    wanted = [sum(pd * pd * n[i] for pd, n in zip(depths, normals)) / sum(depths) for i in range(3)]
    np.testing.assert_allclose(global_depth(sums), wanted, rtol=ROUNDING)


def test_eq_1_of_one_pair_is_its_depth() -> None:
    """PD_g = pd n for one pair; B moves along n, A against it, and each by half where both move."""
    n = (0.6, 0.0, 0.8)
    for side, share, wanted in ((1.0, 1.0, 0.02), (-1.0, 1.0, -0.02), (1.0, 0.5, 0.01), (-1.0, 0.5, -0.01)):
        sums = np.zeros((3, 3))
        add_depth(sums, side, 0.02, n, share)
        np.testing.assert_allclose(global_depth(sums), np.multiply(wanted, n), rtol=ROUNDING)


@pytest.mark.parametrize("seed", SEEDS)
def test_eq_4_projection_on_the_joint_plane(seed: int) -> None:
    """p' = p - (a . (p - o)) a lies in the plane through o, and p - p' along the axis."""
    rng = np.random.default_rng(seed)
    p, a, o = triple(rng), unit(rng), triple(rng)
    height = dot(a, [x - y for x, y in zip(p, o)])
    np.testing.assert_allclose(project(p, a, o), [x - height * y for x, y in zip(p, a)], ROUNDING, ROUNDING)


@pytest.mark.parametrize("seed", SEEDS)
def test_eq_5_rotation_of_a_joint(seed: int) -> None:
    """phi = acos(ee' . goal') of unit vectors, positive about the axis."""
    rng = np.random.default_rng(seed)
    a = unit(rng)
    ee, goal = (project(triple(rng), a, (0.0, 0.0, 0.0)) for _ in range(2))
    sizes = [sqrt(dot(v, v)) for v in (ee, goal)]
    phi = acos(dot(ee, goal) / sizes[0] / sizes[1])
    wanted = phi if dot(a, cross(ee, goal)) >= 0 else -phi
    assert joint_rotation(ee, goal, a) == pytest.approx(wanted, abs=1e-7)


@pytest.mark.parametrize("mass", [0.01, 0.1, 0.4, 2.0, 100.0])
@pytest.mark.parametrize("h", [1 / 960, 1 / 60, 1 / 10])
def test_eq_6_virtual_coupling(mass: float, h: float) -> None:
    """m x'' = -K x - R x' as an integrator of high order has it: light, critical (0.4 kg) and heavy."""
    k, r = 1000.0 / mass, 40.0 / mass
    start = (0.03, -0.7)
    found = solve_ivp(
        lambda _, y: (y[1], -k * y[0] - r * y[1]), (0, h), start, method="Radau", rtol=1e-11, atol=1e-13
    )
    np.testing.assert_allclose(coupled(*start, k, r, h), found.y[:, -1], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("mass", [1e-6, 1e6])
def test_eq_6_neither_overflows_nor_jumps(mass: float) -> None:
    """Stay finite far from critical damping, and continuous at it."""
    assert np.isfinite(coupled(1.0, 1.0, 1000.0 / mass, 40.0 / mass, 1 / 60)).all()
    below, at, above = (coupled(0.03, -0.7, 2500.0 * (1 + e), 100.0, 1 / 60) for e in (-1e-7, 0.0, 1e-7))
    np.testing.assert_allclose(below, at, rtol=1e-5)
    np.testing.assert_allclose(above, at, rtol=1e-5)


def turned(angle: float) -> tuple[float, float, float, float]:
    """Quaternion of a turn about x [rad]."""
    return cos(angle / 2), sin(angle / 2), 0.0, 0.0


def coupled_driver(**fields: object) -> np.void:
    """A driver of 0.3 kg at its tracker, with K = 1000 N/m and R = 40 N s/m."""
    driver = np.zeros(1, DRIVER)[0]
    for name in ("orientation", "old_target_orientation", "target_orientation"):
        driver[name] = turned(0.0)
    for name, value in ({"mass": 0.3, "stiffness": 1000.0, "damping": 40.0} | fields).items():
        driver[name] = value
    return driver


def test_eq_6_has_no_lag_behind_a_steady_tracker() -> None:
    """Stay on a tracker that moves and turns steadily, at its speed."""
    h, v, w = 1 / 60, (1.0, -2.0, 0.5), 3.0
    driver = coupled_driver(target_position=np.multiply(h, v), target_orientation=turned(w * h))
    driver["velocity"], driver["omega"] = v, (w, 0.0, 0.0)
    follow_tracker(driver, h)
    np.testing.assert_allclose(driver["position"], np.multiply(h, v), rtol=1e-12)
    np.testing.assert_allclose(driver["velocity"], v, rtol=1e-12)
    np.testing.assert_allclose(driver["orientation"], turned(w * h), atol=1e-12)
    np.testing.assert_allclose(driver["omega"], (w, 0.0, 0.0), atol=1e-9)


def test_eq_6_rotation_is_coupled_as_translation() -> None:
    """Return to a tracker at rest by Eq. 6 with K / m and R / m, from a distance and from an angle."""
    h, k, r = 1 / 60, 1000.0 / 0.3, 40.0 / 0.3
    driver = coupled_driver(position=(0.1, 0.0, 0.0), orientation=turned(0.1))
    follow_tracker(driver, h)
    x, x_rate = coupled(0.1, 0.0, k, r, h)
    np.testing.assert_allclose(driver["position"], (x, 0.0, 0.0), rtol=1e-12)
    np.testing.assert_allclose(driver["velocity"], (x_rate, 0.0, 0.0), rtol=1e-12)
    np.testing.assert_allclose(driver["orientation"], turned(x), atol=1e-12)
    np.testing.assert_allclose(driver["omega"], (x_rate, 0.0, 0.0), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_eqs_8_and_9_reverse_the_approach(seed: int) -> None:
    """j = -(1 + e) v_n / (1/m_a + 1/m_b + A + B), with A = n . ((I_a^-1 (r_a x n)) x r_a): v_n+ = -e v_n-."""
    rng = np.random.default_rng(seed)
    n, r_a, r_b, e, v_n = unit(rng), triple(rng), triple(rng), rng.uniform(), -rng.uniform(0.1, 5)
    m_a, m_b = rng.uniform(0.1, 10, 2).tolist()
    i_a, i_b = (np.diag(rng.uniform(0.1, 10, 3)) for _ in range(2))
    terms = []
    for inverse, r in ((i_a, r_a), (i_b, r_b)):
        turned = [dot(row, cross(r, n)) for row in inverse.tolist()]
        terms.append(dot(n, cross(turned, r)))
        assert rotational_term(n, inverse, r) == pytest.approx(terms[-1], rel=ROUNDING)
    j = impulse_magnitude(v_n, e, 1 / m_a + 1 / m_b, *terms)
    assert j == pytest.approx(-(1 + e) * v_n / (1 / m_a + 1 / m_b + sum(terms)), rel=ROUNDING)
    # Eq. 8, by the velocities of both bodies after the impulse j n on B and -j n on A
    change = j / m_b + j / m_a
    for inverse, r in ((i_a, r_a), (i_b, r_b)):
        change += dot(n, np.cross(inverse @ np.multiply(j, cross(r, n)), r))
    assert v_n + change == pytest.approx(-e * v_n, rel=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_eq_10_friction(seed: int) -> None:
    """J_f = -mu j v_t / |v_t|: always mu j, against the sliding, and across the normal."""
    rng = np.random.default_rng(seed)
    v, n, j, mu = triple(rng), unit(rng), rng.uniform(0, 10), rng.uniform(0, 1)
    v_n = dot(n, v)
    v_t = [x - v_n * y for x, y in zip(v, n)]
    size = sqrt(dot(v_t, v_t))
    wanted = [-mu * j * x / size for x in v_t]
    np.testing.assert_allclose(friction_impulse(v, n, j, mu), wanted, rtol=1e-9, atol=1e-12)


def test_eq_10_has_no_direction_without_sliding() -> None:
    """No friction where nothing slides."""
    assert friction_impulse((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), 1.0, 0.5) == (0.0, 0.0, 0.0)

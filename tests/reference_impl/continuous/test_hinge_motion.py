"""Motion of hinges over a substep, against the matrix exponential of their servos, and their limits."""

import numpy as np
import pytest
from scipy.linalg import expm

from touchstone.reference_impl.continuous.hinge_modes import weigh_chains
from touchstone.reference_impl.continuous.hinge_motion import (
    advance_hinges,
    begin_hinges,
    drop_limits,
    enter_hinges,
    find_limits,
    leave_hinges,
)
from touchstone.reference_impl.core.driver_dtypes import DRIVER, JOINT

FRAME, SUBSTEP = 1 / 60, 0.004


@pytest.fixture
def hinge() -> tuple[np.ndarray, np.void]:
    """A hinge of a chain that turns from 0.1 to 0.3 rad in a frame, 0.05 rad behind its path at the start and
    0.03 behind at the end of the driven loop."""
    joints, driver = np.zeros(1, JOINT), np.zeros(1, DRIVER)[0]
    driver["joint_count"] = driver["hinge_count"] = driver["chain_count"] = 1
    driver["hinge_frequency"], joints["servo"], joints["coupling"][:, 0] = 70.0, 70.0**2, 1.0
    joints["inner"], joints["lower"], joints["upper"] = -1, -1.0, 1.0
    joints["angle"] = joints["shown_angle"] = 0.1
    joints["offset"], joints["offset_rate"] = -0.05, 0.7
    begin_hinges(joints, driver)
    joints["angle"], joints["offset"], joints["offset_rate"] = 0.3, -0.03, 0.2
    enter_hinges(joints, driver, FRAME)
    return joints, driver


@pytest.mark.parametrize("frequency", [5.0, 70.0, 3000.0])
@pytest.mark.parametrize("inertia", [0.1, 1.0, 3.0])
def test_an_offset_obeys_the_servo_with_a_constant_torque(hinge, frequency, inertia):
    """Follow the exact solution at any stiffness, below and above the inertia that is damped critically; a
    spring that swings faster than the substep is damped so, too."""
    joints, driver = hinge
    driver["hinge_frequency"], torque = frequency, 40.0
    joints["servo"], joints["coupling"][:, 0] = frequency**2, inertia
    torque *= float(inertia**0.5)  # of an inertia per amplitude of 1
    joints["twist"] = joints["shift_twist"] = torque * SUBSTEP
    advance_hinges(joints, driver, SUBSTEP / 2, SUBSTEP, FRAME, 1.0)
    stiffness, damping = frequency**2 / inertia, 2 * frequency / inertia
    if stiffness * SUBSTEP**2 > 1:
        damping = max(damping, 2 * stiffness**0.5)
    exact = expm(np.array([[0, 1, 0], [-stiffness, -damping, 40.0], [0, 0, 0]]) * SUBSTEP / 2)
    x, rate, _ = exact @ (-0.05, 0.7, 1.0)
    pace = (0.33 - 0.15) / FRAME
    np.testing.assert_allclose(joints["offset"], x, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(joints["offset_rate"], rate, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(joints["angle"], 0.15 + pace * SUBSTEP / 2 + x, rtol=1e-12)
    np.testing.assert_allclose(joints["rate"], pace + rate, rtol=1e-8)


def test_the_hinges_of_a_chain_move_together():
    """Follow the exact solution of three hinges whose inertia couples them, under torques of their own."""
    rng, n, w = np.random.default_rng(7), 3, 40.0
    joints, driver = np.zeros(n, JOINT), np.zeros(1, DRIVER)[0]
    driver["joint_count"] = driver["hinge_count"] = n
    driver["chain_count"], driver["chains"][0], driver["hinge_frequency"] = 1, (0, n - 1), w
    root = rng.normal(size=(n, n))
    inertia, servo, torque = root @ root.T + 0.1 * np.eye(n), rng.uniform(1, 1e4, n), rng.normal(size=n)
    joints["coupling"][:, :n], joints["servo"], joints["coordinate"] = np.tril(inertia), servo, range(n)
    joints["inner"], joints["touched"][0] = (-1, 0, 1), 1
    joints["offset"], joints["offset_rate"] = rng.normal(size=(2, n))
    begin_hinges(joints, driver)
    start = np.concatenate([joints["offset"], joints["offset_rate"], [1.0]])
    weigh_chains(joints, driver)
    modes = joints["modes"][:, :n]
    np.testing.assert_allclose(modes.T @ inertia @ modes, np.eye(n), atol=1e-13)
    paces = np.diag(joints["pace"])
    np.testing.assert_allclose(modes.T @ np.diag(servo) @ modes, paces, rtol=1e-11, atol=1e-9)
    joints["twist"] = joints["shift_twist"] = SUBSTEP * modes.T @ torque
    law = np.zeros((2 * n + 1, 2 * n + 1))
    law[:n, n : 2 * n] = np.eye(n)
    law[n : 2 * n, :n] = -np.linalg.solve(inertia, np.diag(servo))
    law[n : 2 * n, n : 2 * n] = 2 / w * law[n : 2 * n, :n]
    law[n : 2 * n, -1] = np.linalg.solve(inertia, torque)
    advance_hinges(joints, driver, SUBSTEP, SUBSTEP, FRAME, 1.0)
    exact = expm(law * SUBSTEP) @ start
    np.testing.assert_allclose(joints["offset"], exact[:n], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(joints["offset_rate"], exact[n : 2 * n], rtol=1e-8, atol=1e-9)


def test_a_torque_that_balances_the_servo_turns_nothing(hinge):
    """Keep an offset x under the torque w^2 x, at any step."""
    joints, driver = hinge
    joints["old_offset_rate"] = 0.0
    for h in (1e-4, 1e-2, 1.0):
        joints["twist"] = joints["shift_twist"] = -0.05 * 70.0**2 * h
        advance_hinges(joints, driver, h, h, FRAME, 1.0)
        np.testing.assert_allclose(joints["offset"], -0.05, rtol=1e-9)
        np.testing.assert_allclose(joints["offset_rate"], 0.0, atol=1e-7)


def test_without_contact_a_hinge_ends_where_the_driven_loop_left_it(hinge):
    """To the bit."""
    joints, driver = hinge
    advance_hinges(joints, driver, FRAME, FRAME, FRAME, 1.0)
    leave_hinges(joints, driver, False)
    assert (joints["angle"], joints["offset"], joints["offset_rate"]) == (0.3, -0.03, 0.2)


def test_a_limit_is_a_row_from_its_first_violation_until_the_hinge_leaves_it(hinge):
    """Find each limit once; keep it while it pushes or touches."""
    joints, driver = hinge
    joints["angle"] = 1.0 + 1e-6
    assert find_limits(joints, driver)
    assert joints["limited"] == -1
    assert not find_limits(joints, driver)
    joints["angle"], joints["limit_impulse"] = 0.9, 1e-3
    drop_limits(joints, driver)
    assert joints["limited"] == -1
    joints["limit_impulse"] = 0.0
    drop_limits(joints, driver)
    assert joints["limited"] == 0

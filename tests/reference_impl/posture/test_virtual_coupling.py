"""Eq. 6 in closed form against the matrix exponential and an integrator."""

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from touchstone.reference_impl.continuous.coupling_response import decay
from touchstone.reference_impl.core.driver_dtypes import DRIVER
from touchstone.reference_impl.posture.virtual_coupling import COUPLING_REACH, follow_tracker

HAND = (1000 / 0.4, 40 / 0.4)
SPRINGS = {
    # (K / m, R / m)
    "hand, critical": HAND,
    "light, overdamped": (1000 / 0.1, 40 / 0.1),
    "heavy, underdamped": (1000 / 2.0, 40 / 2.0),
    "just under": (2500 * (1 + 1e-9), 100.0),
    "just over": (2500 * (1 - 1e-9), 100.0),
    "at the series' end, under": (2500 + 1.01e-5 * 3600, 100.0),
    "at the series' end, over": (2500 - 1.01e-5 * 3600, 100.0),
    "stiff": (1e5 / 0.4, 40 / 0.4),
    "stiff, overdamped": (1e5 / 0.4, 1e5 / 0.4),
    "undamped": (2500.0, 0.0),
}


@pytest.mark.parametrize("h", [1 / 240, 1 / 60, 1 / 30, 1.0])
@pytest.mark.parametrize("name", SPRINGS)
def test_decay_is_the_matrix_exponential(name: str, h: float) -> None:
    """Match exp(A h) for springs on both sides of critical damping and at it."""
    k, r = SPRINGS[name]
    flow = expm(np.array([[0.0, 1.0], [-k, -r]]) * h)
    # expm itself is good to about eps times |A h|
    slack = 1e-15 * max(10.0, (k + r) * h)
    for start in ((1.0, 0.0), (0.0, 1.0), (0.3, -7.0)):
        x, v = decay(*start, k, r, h)
        assert x == pytest.approx((flow @ start)[0], abs=slack)
        assert v == pytest.approx((flow @ start)[1], abs=slack * max(1.0, np.sqrt(k)))


def driver(mass: float = 0.4) -> np.ndarray:
    """A driver at rest on its tracker in the origin."""
    rows = np.zeros(1, DRIVER)
    rows["mass"], rows["stiffness"], rows["damping"] = mass, 1000.0, 40.0
    for name in ("orientation", "target_orientation", "old_target_orientation"):
        rows[name] = (1, 0, 0, 0)
    return rows


def test_only_a_person_far_from_its_tracker_is_pulled_no_stronger() -> None:
    """A hand 3 m behind follows the linear spring of Eq. 6, a person one as long as COUPLING_REACH."""
    found = {}
    for name, chains, distance in (("hand", 0, 3.0), ("person", 1, 3.0), ("near", 1, COUPLING_REACH)):
        rows = driver(12.0)
        rows["chain_count"] = chains
        rows["old_target_position"] = rows["target_position"] = (distance, 0.0, 0.0)
        follow_tracker(rows[0], 1 / 60)
        found[name] = rows["velocity"][0, 0]
    assert found["hand"] == pytest.approx(found["near"] * 3.0 / COUPLING_REACH, rel=1e-12)
    assert found["person"] == pytest.approx(found["near"], rel=1e-12)


def test_rotation_is_critically_damped() -> None:
    """Turn about one axis as theta (1 + w t) exp(-w t), w = sqrt(K / m)."""
    rows, w = driver(), np.sqrt(2500.0)
    axis = np.array([0.6, 0.0, 0.8])
    rows["orientation"] = Rotation.from_rotvec(0.5 * axis).as_quat(scalar_first=True)
    for frame in range(1, 11):
        follow_tracker(rows[0], 1 / 60)
        t = frame / 60
        turned = Rotation.from_quat(rows["orientation"][0], scalar_first=True).as_rotvec()
        np.testing.assert_allclose(turned, 0.5 * (1 + w * t) * np.exp(-w * t) * axis, atol=1e-13)
        np.testing.assert_allclose(rows["omega"][0], -0.5 * w * w * t * np.exp(-w * t) * axis, atol=1e-11)


def test_a_steady_tracker_is_kept_up_with() -> None:
    """Stay on a tracker that moves and turns steadily when already moving and turning with it."""
    rows, pace, spin = driver(), np.array([1.0, -2.0, 0.5]), np.array([0.0, 3.0, 4.0])
    rows["velocity"], rows["omega"] = pace, spin
    for frame in range(1, 31):
        for name in ("position", "orientation"):
            rows[f"old_target_{name}"] = rows[f"target_{name}"]
        rows["target_position"] = pace * frame / 60
        rows["target_orientation"] = Rotation.from_rotvec(spin * frame / 60).as_quat(scalar_first=True)
        follow_tracker(rows[0], 1 / 60)
    np.testing.assert_allclose(rows["position"], rows["target_position"], atol=1e-13)
    np.testing.assert_allclose(rows["velocity"][0], pace, atol=1e-12)
    np.testing.assert_allclose(np.abs(rows["orientation"][0] @ rows["target_orientation"][0]), 1, atol=1e-14)
    np.testing.assert_allclose(rows["omega"][0], spin, atol=1e-12)

"""The servo of a hinge that contact turned away from its tracker."""

from __future__ import annotations

from math import exp

import numpy as np
import pytest

from touchstone.reference_impl.core.driver_dtypes import JOINT
from touchstone.reference_impl.posture.chain_servo import follow_offset


def hinge(offset: float, rate: float = 0.0) -> np.void:
    """A hinge with an offset [rad] and its rate [rad/s]."""
    joint = np.zeros(1, JOINT)
    joint[0]["offset"], joint[0]["offset_rate"] = offset, rate
    return joint[0]


def test_a_hinge_at_its_tracker_stays_there():
    """Leave a hinge without an offset as it is, to the bit."""
    joint = hinge(0.0)
    assert not follow_offset(joint, 40.0, 1 / 60)
    assert joint["offset"] == joint["offset_rate"] == 0.0


def test_short_frames_follow_critical_damping():
    """Reach (x + (x' + w x) t) exp(-w t) to first order in the frame."""
    w, time, errors = 40.0, 0.05, []
    for frames in (1000, 2000):
        joint = hinge(0.2, -3.0)
        for _ in range(frames):
            follow_offset(joint, w, time / frames)
        errors.append(joint["offset"] - (0.2 + (-3.0 + w * 0.2) * time) * exp(-w * time))
    assert abs(errors[0]) < 1e-4
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=0.02)


@pytest.mark.parametrize("w", [1.0, 40.0, 1e4])
def test_no_frame_is_too_long(w):
    """Bring an offset back without passing zero, however stiff the servo is."""
    joint, last = hinge(0.3), 0.3
    for _ in range(30):
        follow_offset(joint, w, 1 / 60)
        assert 0.0 <= joint["offset"] <= last
        last = joint["offset"]


def test_an_offset_settles():
    """End at zero exactly: the chain then follows its tracker again to the bit."""
    joint = hinge(0.3)
    for _ in range(60):
        follow_offset(joint, 40.0, 1 / 60)
    assert joint["offset"] == joint["offset_rate"] == 0.0

"""Motion of a tracker from its keyframes, with velocities: cubic interpolation, or held keyframes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, RotationSpline

from touchstone.scenarios.scenario import Tracker

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline

ROUNDING = 1e-9
"""Time after a keyframe that still counts as the keyframe's own [s]: rounding of steps."""


@dataclass(frozen=True, slots=True)
class TrackerMotion:
    """Tracker at n times: world poses and velocities of its root, angles and rates of its hinges."""

    position: NDArray[np.float64]  # (n, 3) [m]
    orientation: NDArray[np.float64]  # (n, 4) wxyz
    linear_velocity: NDArray[np.float64]  # (n, 3) [m/s], of the root's origin
    angular_velocity: NDArray[np.float64]  # (n, 3) [rad/s], world
    angle: NDArray[np.float64]  # (n, joints) [rad]
    rate: NDArray[np.float64]  # (n, joints) [rad/s]


def ease(times: NDArray[np.float64], start: float, duration: float) -> NDArray[np.float64]:
    """Smooth step from 0 at `start` to 1 after `duration` [s], at rest at both ends."""
    s = np.clip((times - start) / duration, 0.0, 1.0)
    return s * s * (3 - 2 * s)


def path(tracker: Tracker) -> CubicSpline:
    """Cubic spline through a tracker's positions [m], at rest at both ends; its second argument is the order
    of a derivative."""
    from scipy.interpolate import CubicSpline  # import on demand: a quarter of the importers' import time

    return CubicSpline(tracker.times, tracker.positions, bc_type="clamped")


def sample(tracker: Tracker, times: NDArray[np.float64]) -> TrackerMotion:
    """Motion of a tracker at `times` [s], by its `interpolation`.

    cubic: splines through the keyframes. Positions and angles are at rest at both ends; orientations follow
    scipy's RotationSpline (continuous angular acceleration), which starts and ends at the rate of its
    keyframes. held: the first keyframe at or after each time, with the mean velocity since the previous one.
    All native steps of a displayed frame thus see the sample of its end, as the reference does.
    """
    if tracker.interpolation == "held":
        return _held(tracker, times)
    from scipy.interpolate import CubicSpline  # import on demand: a quarter of the importers' import time

    positions = path(tracker)
    count = len(tracker.joints)
    angles = CubicSpline(
        tracker.times, np.reshape(tracker.angles, (len(tracker.times), count)), bc_type="clamped"
    )
    keys = Rotation.from_quat(np.array(tracker.orientations), scalar_first=True)
    rotations = RotationSpline(tracker.times, keys)
    turned = rotations(times)
    # RotationSpline gives rates along the body's axes; ours are along the world axes.
    return TrackerMotion(
        position=positions(times),
        orientation=turned.as_quat(scalar_first=True),
        linear_velocity=positions(times, 1),
        angular_velocity=turned.apply(rotations(times, 1)),
        angle=angles(times),
        rate=angles(times, 1),
    )


def _held(tracker: Tracker, times: NDArray[np.float64]) -> TrackerMotion:
    keys = np.array(tracker.times)
    k = np.minimum(np.searchsorted(keys, times - ROUNDING), len(keys) - 1)
    before = np.maximum(k - 1, 0)
    lasted = np.where(k > 0, keys[k] - keys[before], 1.0)[:, None]
    position = np.array(tracker.positions)
    angle = np.reshape(tracker.angles, (len(keys), len(tracker.joints)))
    turned = Rotation.from_quat(np.array(tracker.orientations), scalar_first=True)
    return TrackerMotion(
        position=position[k],
        orientation=turned[k].as_quat(scalar_first=True),
        linear_velocity=(position[k] - position[before]) / lasted,
        angular_velocity=(turned[k] * turned[before].inv()).as_rotvec() / lasted,
        angle=angle[k],
        rate=(angle[k] - angle[before]) / lasted,
    )

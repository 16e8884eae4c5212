"""Motion of a tracker from its keyframes, with velocities.

Source of the slopes of pchip: Fritsch and Butland (1984), *A method for constructing local monotone piecewise
cubic interpolants*.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation, RotationSpline

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.scenario import IDENTITY, Interpolation, Tracker

if TYPE_CHECKING:
    from scipy.interpolate import PPoly

ROUNDING = 1e-9
"""Time after a keyframe that still counts as the keyframe's own [s]: rounding of steps."""
SWING, LEAST_SWING = 0.1, 5e-3
"""Share of the range of keyframes [1], and distance [m, rad], by which a path may leave them: what a spline
through keyframes of a smooth motion does."""
SWING_SAMPLES = 16
"""Times of an interval at which a path is compared with its keyframes [1]."""
DEGREES = 180 / pi
SMALL_TURN = 1e-4
"""Angle below which the series of a rotation's rates are exact to rounding [rad]."""


@dataclass(frozen=True, slots=True)
class TrackerMotion:
    """Tracker at n times: world poses and velocities of its root, angles and rates of its hinges."""

    position: Array  # (n, 3) [m]
    orientation: Array  # (n, 4) wxyz
    linear_velocity: Array  # (n, 3) [m/s], of the root's origin
    angular_velocity: Array  # (n, 3) [rad/s], world
    angle: Array  # (n, joints) [rad]
    rate: Array  # (n, joints) [rad/s]


def ease(times: Array, start: float, duration: float) -> Array:
    """Smooth step from 0 at `start` to 1 after `duration` [s], at rest at both ends."""
    s = np.clip((times - start) / duration, 0.0, 1.0)
    return s * s * (3 - 2 * s)


def through(stations: Sequence[tuple[float, ArrayLike]], times: Array) -> Array:
    """Points (n, 3) at `times` (n,) [s] of an eased way through stations: end times [s] and points then."""
    points = np.tile(np.asarray(stations[0][1], dtype=float), (len(times), 1))
    for (start, place), (end, following) in pairwise(stations):
        points += np.outer(ease(times, start, end - start), np.subtract(following, place))
    return points


def keyframed(
    root: str,
    times: ArrayLike,
    positions: ArrayLike,
    orientations: ArrayLike = IDENTITY,
    joints: Sequence[str] = (),
    angles: ArrayLike = (),
    interpolation: Interpolation = "cubic",
    **coupling: Any,
) -> Tracker:
    """Tracker through k keyframes at `times` (k,) [s].

    Args:
        positions, orientations: of the root (k, 3) [m] and (k, 4) wxyz, or one for all keyframes.
        angles: of the `joints` (k, j) [rad], or those of all keyframes (j,).
        coupling: stiffness, damping, hinge_frequency.
    """
    moments = np.asarray(times, dtype=float)

    def rows(values: ArrayLike, size: int) -> tuple[Any, ...]:
        each = np.broadcast_to(np.asarray(values, dtype=float), (len(moments), size))
        return tuple(map(tuple, each.tolist()))

    return Tracker(
        root,
        tuple(joints),
        tuple(moments.tolist()),
        rows(positions, 3),
        rows(orientations, 4),
        rows(angles, len(joints)),
        interpolation=interpolation,
        **coupling,
    )


def path(tracker: Tracker) -> PPoly:
    """Piecewise polynomial through a tracker's positions [m]; its second argument is the order of a
    derivative."""
    return _through(tracker, np.array(tracker.positions))


def sample(tracker: Tracker, times: Array) -> TrackerMotion:
    """Motion of a tracker at `times` [s], by its `interpolation`.

    pchip: cubics that stay between their keyframes, at rest at both ends and wherever the path turns back or
    rests. Orientations: the same of the rotation vector from each keyframe to the next.
    cubic: splines. Positions and angles are at rest at both ends; orientations follow scipy's RotationSpline
    (continuous angular acceleration), which starts and ends at the rate of its keyframes.
    linear: constant velocities between keyframes.
    held: the first keyframe at or after each time, with the mean velocity since the previous one.
    All native steps of a displayed frame thus see the sample of its end, as the reference does.
    """
    if tracker.interpolation == "held":
        return _held(tracker, times)
    positions = path(tracker)
    angles = _through(tracker, np.reshape(tracker.angles, (len(tracker.times), len(tracker.joints))))
    turned, rates = _turned(tracker, times)
    return TrackerMotion(
        position=positions(times),
        orientation=turned.as_quat(scalar_first=True),
        linear_velocity=positions(times, 1),
        angular_velocity=turned.apply(rates),
        angle=angles(times),
        rate=angles(times, 1),
    )


def _through(tracker: Tracker, values: Array) -> PPoly:
    """Piecewise polynomial through values (k, n) at a tracker's keyframes."""
    from scipy import interpolate  # import on demand: a quarter of the importers' import time

    times = np.array(tracker.times)
    match tracker.interpolation:
        case "cubic":
            return interpolate.CubicSpline(times, values, bc_type="clamped")
        case "linear":
            return interpolate.PPoly(
                np.stack([np.diff(values, axis=0) / np.diff(times)[:, None], values[:-1]]), times
            )
    return interpolate.CubicHermiteSpline(times, values, _slopes(times, values))


def _slopes(times: Array, values: Array) -> Array:
    """Slopes (k, n) of pchip at its keyframes, at rest at both ends."""
    from scipy.interpolate import PchipInterpolator

    slopes = np.array(PchipInterpolator(times, values)(times, 1))
    slopes[[0, -1]] = 0.0
    return slopes


def _turned(tracker: Tracker, times: Array) -> tuple[Rotation, Array]:
    """Orientations at `times` [s], and angular velocities (n, 3) along the body's axes."""
    keys = Rotation.from_quat(np.array(tracker.orientations), scalar_first=True)
    if tracker.interpolation == "cubic":
        spline = RotationSpline(tracker.times, keys)
        return spline(times), spline(times, 1)
    ends = np.array(tracker.times)
    lasts = np.diff(ends)[:, None]
    turns = (keys[:-1].inv() * keys[1:]).as_rotvec()
    if tracker.interpolation == "linear":
        first = last = turns / lasts
    else:
        # a turn has the same components along the axes at its start and at its end
        slopes = _slopes(ends, np.concatenate([np.zeros((1, 3)), np.cumsum(turns, axis=0)]))
        first, last = slopes[:-1], _rate_of_vector(turns, slopes[1:])
    k = np.clip(np.searchsorted(ends, times, side="right") - 1, 0, len(lasts) - 1)
    h, turn, first, last = lasts[k], turns[k], first[k], last[k]
    u = (times - ends[k])[:, None] / h
    vector = u * u * (3 - 2 * u) * turn + h * u * (1 - u) * ((1 - u) * first - u * last)
    rate = 6 * u * (1 - u) * turn / h + (1 - u) * (1 - 3 * u) * first + u * (3 * u - 2) * last
    return keys[k] * Rotation.from_rotvec(vector), _body_rate(vector, rate)


def _body_rate(vector: Array, rate: Array) -> Array:
    """Angular velocities along the body's axes, from rotation vectors (n, 3) [rad] and their rates."""
    angle = np.linalg.norm(vector, axis=1, keepdims=True)
    safe = np.maximum(angle, SMALL_TURN)
    a, b = (1 - np.cos(safe)) / safe**2, (safe - np.sin(safe)) / safe**3
    once = np.cross(vector, rate)
    return np.asarray(rate - a * once + b * np.cross(vector, once))


def _rate_of_vector(vector: Array, body_rate: Array) -> Array:
    """Rates of rotation vectors (n, 3) [rad] from angular velocities along the body's axes."""
    half = np.maximum(np.linalg.norm(vector, axis=1, keepdims=True), SMALL_TURN) / 2
    once = np.cross(vector, body_rate)
    return np.asarray(
        body_rate + once / 2 + (1 - half / np.tan(half)) / (2 * half) ** 2 * np.cross(vector, once)
    )


def swings(tracker: Tracker) -> list[str]:
    """One line per part of a path that leaves its keyframes: where it does so most.

    An interval leaves them where it is outside the range of the two keyframes at its ends, and one on each
    side, by more than SWING of that range.
    """
    ends = np.array(tracker.times)
    shares = np.arange(SWING_SAMPLES) / SWING_SAMPLES
    found = sample(tracker, (ends[:-1, None] + np.diff(ends)[:, None] * shares).ravel())
    keys = Rotation.from_quat(np.array(tracker.orientations), scalar_first=True)
    near = np.clip(np.arange(len(ends) - 1)[:, None] + np.arange(-1, 3), 0, len(ends) - 1)
    start = near[:, 1]
    # turns from the keyframe at the start of the interval
    turned = Rotation.from_quat(found.orientation, scalar_first=True)
    turns = np.atleast_1d((keys[np.repeat(start, SWING_SAMPLES)].inv() * turned).magnitude())
    ranges = np.stack([(keys[start].inv() * keys[k]).magnitude() for k in near.T], axis=1)
    places = np.array(tracker.positions)[near]
    parts = [
        (f"{tracker.root} leaves its keyframes", "mm", 1e3, found.position, places),
        (f"{tracker.root} turns beyond its keyframes", "degrees", DEGREES, turns[:, None], ranges[..., None]),
    ]
    for k, joint in enumerate(tracker.joints):
        angles = np.array(tracker.angles)[near][..., k : k + 1]
        parts.append((f"{joint} leaves its keyframes", "degrees", DEGREES, found.angle[:, k : k + 1], angles))
    lines = []
    for what, unit, scale, path, keyed in parts:
        path = path.reshape(len(ends) - 1, SWING_SAMPLES, -1)
        low, high = keyed.min(axis=1), keyed.max(axis=1)
        beyond = np.maximum(path.max(axis=1) - high, low - path.min(axis=1))
        allowed = np.maximum(SWING * (high - low), LEAST_SWING)
        over = np.asarray(np.where(beyond > allowed, beyond, 0.0)).max(axis=1, initial=0.0)
        k = int(np.argmax(over))
        if over[k]:
            lines.append(f"{what} by {over[k] * scale:.3g} {unit} from {ends[k]:g} to {ends[k + 1]:g} s")
    return lines


def _held(tracker: Tracker, times: Array) -> TrackerMotion:
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

"""Orientations of bodies, and directions on slopes."""

from math import cos, sin

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.scenario import Quaternion


def quaternion(turn: Rotation) -> Quaternion:
    """A rotation as wxyz."""
    w, x, y, z = turn.as_quat(scalar_first=True).tolist()
    return (w, x, y, z)


def about_y(angle: float) -> Quaternion:
    """A turn about the y axis [rad]."""
    return (cos(angle / 2), 0.0, sin(angle / 2), 0.0)


def slope(angle: float) -> tuple[Quaternion, Array, Array]:
    """Orientation of a slope of an angle [rad] that falls along x, its direction downhill and its normal."""
    return about_y(angle), np.array((cos(angle), 0.0, -sin(angle))), np.array((sin(angle), 0.0, cos(angle)))

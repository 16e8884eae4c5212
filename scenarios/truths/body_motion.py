"""The motion of one body at several times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a body at n times: centre of mass and its velocity, orientation wxyz, angular velocity;
    world."""

    position: Array  # (n, 3) [m]
    velocity: Array  # (n, 3) [m/s]
    orientation: Array  # (n, 4)
    angular_velocity: Array  # (n, 3) [rad/s]

"""The motion of one body at several times."""

from dataclasses import dataclass

from touchstone.scenarios.arrays import Array


@dataclass(frozen=True, slots=True)
class Motion:
    """State of a body at n times: centre of mass and its velocity, orientation wxyz, angular velocity;
    world."""

    position: Array  # (n, 3) [m]
    velocity: Array  # (n, 3) [m/s]
    orientation: Array  # (n, 4)
    angular_velocity: Array  # (n, 3) [rad/s]

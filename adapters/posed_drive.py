"""Driven links as kinematic bodies that follow their tracker regardless of contacts (drive `posed`).

The reference drives a hand in this way, so this drive makes timing comparable: there are no link dynamics.
Engines differ in how a kinematic link's motion acts on bodies in contact: DART's contacts use its velocity;
those of MuJoCo (mocap bodies) and pybullet (bodies without mass) do not.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import State
from touchstone.scenarios.avatar.kinematics import link_poses
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.scenario import Scenario, Tracker


class Posed:
    """Motion of one tracker's links over the native steps of a run; index 0 is the start, k + 1 the end of
    step k.

    Attributes:
        links: bodies, root first.
        place, orientation: of the links' origins (n, steps + 1, 3) [m] and (n, steps + 1, 4) wxyz, world.
        center: centres of mass (n, steps + 1, 3) [m], world.
        velocity, omega: of the centres of mass [m/s] and of the links [rad/s] during each step (n, steps, 3).
    """

    def __init__(self, scenario: Scenario, tracker: Tracker, dt: float) -> None:
        steps = round(scenario.duration / dt)
        motion = sample(tracker, np.minimum(np.arange(steps + 1) * dt, scenario.duration))
        self.links = scenario.links(tracker)
        self.angle, self.rate = motion.angle, motion.rate
        self.place, turn = link_poses(scenario, tracker, motion.position, motion.orientation, motion.angle)
        flat = Rotation.from_matrix(turn.reshape(-1, 3, 3))
        self.orientation = flat.as_quat(scalar_first=True).reshape(*turn.shape[:2], 4)
        arms = np.array([scenario.bodies[link].center_of_mass for link in self.links])
        self.center = self.place + np.einsum("ntij,nj->nti", turn, arms)
        self.velocity = np.diff(self.center, axis=1) / dt
        between = turn[:, 1:] @ np.swapaxes(turn[:, :-1], -1, -2)
        turned = Rotation.from_matrix(between.reshape(-1, 3, 3)).as_rotvec()
        self.omega = turned.reshape(len(self.links), steps, 3) / dt

    def show(self, moment: int, state: State, hinges: slice) -> None:
        """Write the links' poses and velocities and their hinges' angles at step `moment` into a state."""
        links, step = list(self.links), max(moment - 1, 0)
        state.position[links], state.orientation[links] = self.place[:, moment], self.orientation[:, moment]
        state.linear_velocity[links], state.angular_velocity[links] = (
            self.velocity[:, step],
            self.omega[:, step],
        )
        state.joint_angle[hinges], state.joint_rate[hinges] = self.angle[moment], self.rate[moment]


def posed_of(scenario: Scenario, dt: float) -> tuple[tuple[Posed, slice], ...]:
    """Motions of all trackers, each with the slice of its hinges among all hinges."""
    found, first = [], 0
    for tracker in scenario.trackers:
        found.append((Posed(scenario, tracker, dt), slice(first, first + len(tracker.joints))))
        first += len(tracker.joints)
    return tuple(found)

"""Bodies that follow their tracker regardless of contacts: links (drive `posed`) and prescribed bodies.

The reference drives a hand in this way, so the drive `posed` makes timing comparable: there are no link
dynamics. Engines differ in how a kinematic link's motion acts on bodies in contact: DART's contacts use its
velocity; those of MuJoCo (mocap bodies) and pybullet (bodies without mass) do not.

A prescribed body carries bodies in contact at its velocity in every engine. In a step it moves at the mean
velocity of that step, as semi-implicit Euler moves all other bodies.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Settings, State
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
        prescribed: whether it is a prescribed body.
        start: the tracker at the start.
    """

    def __init__(self, scenario: Scenario, tracker: Tracker, dt: float) -> None:
        steps = round(scenario.duration / dt)
        motion = sample(tracker, np.minimum(np.arange(steps + 1) * dt, scenario.duration))
        self._dt = dt
        self.links, self.prescribed = scenario.links(tracker), scenario.prescribes(tracker)
        self.start = sample(tracker, np.zeros(1))
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
        shown = (np.concatenate((rates[:, :1], rates), axis=1) for rates in (self.velocity, self.omega))
        self._shown_velocity, self._shown_omega = shown
        if self.prescribed:
            omega, arm = motion.angular_velocity, self.center - self.place
            self._shown_velocity = motion.linear_velocity + np.cross(omega, arm)
            self._shown_omega = omega[None]

    def pace(self, step: int) -> tuple[Array, Array]:
        """Mean velocity of the root's origin [m/s] and mean angular velocity [rad/s; world] of the step that
        ends at `step`; at the start, those of the tracker. After the last step they do not change."""
        if step == 0:
            return self.start.linear_velocity[0], self.start.angular_velocity[0]
        step = min(step, len(self.place[0]) - 1)
        return (self.place[0, step] - self.place[0, step - 1]) / self._dt, self.omega[0, step - 1]

    def show(self, moment: int, state: State, hinges: slice) -> None:
        """Write the links' poses and velocities and their hinges' angles at step `moment` into a state: the
        velocities of a prescribed body at that time, those of driven links during the step before."""
        links = list(self.links)
        state.position[links], state.orientation[links] = self.place[:, moment], self.orientation[:, moment]
        state.linear_velocity[links] = self._shown_velocity[:, moment]
        state.angular_velocity[links] = self._shown_omega[:, moment]
        state.joint_angle[hinges], state.joint_rate[hinges] = self.angle[moment], self.rate[moment]


def posed_of(scenario: Scenario, settings: Settings) -> tuple[tuple[Posed, slice], ...]:
    """Motions of the trackers that no coupling moves, each with the slice of its hinges among all hinges."""
    found, first, others = [], 0, coupled(scenario, settings)
    for k, tracker in enumerate(scenario.trackers):
        if k not in others:
            hinges = slice(first, first + len(tracker.joints))
            found.append((Posed(scenario, tracker, settings.dt), hinges))
        first += len(tracker.joints)
    return tuple(found)


def coupled(scenario: Scenario, settings: Settings) -> list[int]:
    """Indices of the trackers that a coupling connects with their driven bodies."""
    driven = [k for k, tracker in enumerate(scenario.trackers) if not scenario.prescribes(tracker)]
    return [] if settings.drive == "posed" else driven

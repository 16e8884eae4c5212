"""Virtual coupling of the root and hinge servo, the same for every dynamics engine.

Root: force K (p_t - p) + R (v_t - v) at the root's origin (Eq. 6), and a torque, critically damped at the
same frequency w = sqrt(K / m): I (w^2 theta + 2 w (omega_t - omega)). I is the inertia of the whole driven
body about the root's origin in the first posture. Both are implicit (`implicit_coupling.py`): the root
carries a `ballast` at its origin, and `wrench` is the force that belongs to it. Hinges: torque M (w_h^2 (q_t
- q) + 2 w_h (q_t' - q')). M is the effective inertia of the hinges in the first posture with the root
*free*, limited to `INERTIA_RATIO` times the effective inertia in any posture of the tracker: a bent arm's
twist has thirty times the inertia of a stretched one's. With the root fixed, or without the limit, the gains
would be too high, and an explicit servo diverges at 1/240 s. Manifests publish both as gains.

By default (`native`) hinges follow an engine's own position servo, with one gain per hinge
(`servo_stiffness`, `servo_damping`); each adapter documents its servo. Under `torque` the root's force and
torque and the torques of hinges are computed at a step's start and held over it. They add energy where a limb
is pressed, and diverge where a body is light for its gains.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import DRIVES, Array, BodyFacts, State
from touchstone.adapters.engines.implicit_coupling import held_law, step_law
from touchstone.adapters.vector_products import cross, rotation_between, rotation_matrix
from touchstone.scenarios.avatar.kinematics import joint_space_inertia, link_poses
from touchstone.scenarios.avatar.tracking import TrackerMotion, sample
from touchstone.scenarios.scenario import Body, Scenario, Tracker

INERTIA_RATIO = 2.0
"""Maximum ratio of the servo's inertia to that of the hinges, in any direction and posture [1]. At 70 rad/s
and 1/240 s the loop diverges from 3.2."""
ROOT_DRIVES = {
    "native": "implicit spring and damper: force on a root with added inertia",
    "torque": "explicit force and torque",
    "posed": "none: links are kinematic",
}
"""How a drive couples roots to their trackers, for manifests."""
POSTURES_PER_SECOND = 10
"""Rate at which a tracker's postures are sampled for the hinges' inertia [1/s]: fast ones take 0.1 s."""
KEPT = 32
"""Trackers whose inertia a process keeps."""


@dataclass(frozen=True, slots=True)
class StartingBody:
    """A tracker's driven body in its first posture, and the inertia of its servo, which no step changes.

    Attributes:
        motion: of the tracker at the start.
        position, orientation: of the links' origins, root first (n, 3) [m] and (n, 4) wxyz.
        mass: of all links [kg].
        axes: of the root (3, 3).
        inertia: in joint space (6 + j, 6 + j).
        servo: inertia of the hinges (j, j), limited in all postures of the tracker.
    """

    motion: TrackerMotion
    position: Array
    orientation: Array
    mass: float
    axes: Array
    inertia: Array
    servo: Array


@lru_cache(KEPT)
def starting_body(scenario: Scenario, tracker: Tracker) -> StartingBody:
    """The driven body of a tracker; computed once per process, for it takes longer than many a scene."""
    start = sample(tracker, np.zeros(1))
    place, turn = _poses(scenario, tracker, start)
    inertia = joint_space_inertia(scenario, tracker, place[:, 0], turn[:, 0])
    servo = _felt(inertia)
    times = np.linspace(0.0, scenario.duration, 1 + round(POSTURES_PER_SECOND * scenario.duration))
    if tracker.joints:
        places, turns = _poses(scenario, tracker, sample(tracker, times))
        for k in range(len(times)):
            own = joint_space_inertia(scenario, tracker, places[:, k], turns[:, k])
            servo = cut(servo, _felt(own))
    mass = sum(scenario.bodies[link].mass for link in scenario.links(tracker))
    orientation = Rotation.from_matrix(turn[:, 0]).as_quat(scalar_first=True)
    return StartingBody(start, place[:, 0], orientation, mass, turn[0, 0], inertia, servo)


def servo_stiffness(scenario: Scenario, tracker: Tracker) -> Array:
    """Stiffness (j,) [N m/rad] of the servos of a person's hinges, one each."""
    found: Array = tracker.hinge_frequency**2 * starting_body(scenario, tracker).servo.diagonal()
    return found


class Drive:
    """Targets and gains of one tracker, for the native steps of one run.

    Attributes:
        ballast: what the root carries at its origin, mass [kg] and inertia along its axes (3, 3) [kg m^2].
        root: mass, mass centre and inertia of the root with its ballast, which engines simulate.
    """

    def __init__(self, scenario: Scenario, tracker: Tracker, dt: float, drive: str = DRIVES[0]) -> None:
        steps = round(scenario.duration / dt)
        self.target = sample(tracker, np.minimum(np.arange(1, steps + 1) * dt, scenario.duration))
        self.links = scenario.links(tracker)
        body = starting_body(scenario, tracker)
        self.start = body.motion
        self.inertia = body.axes.T @ body.inertia[3:6, 3:6] @ body.axes
        self.stiffness, self.damping = tracker.stiffness, tracker.damping
        self.frequency = float(np.sqrt(tracker.stiffness / body.mass))
        self.hinge_frequency = tracker.hinge_frequency
        self._person = any(name in tracker.joints for chain in scenario.chains for name in chain.joints)
        self.hinge_stiffness = tracker.hinge_frequency**2 * body.servo
        self.hinge_damping = 2 * tracker.hinge_frequency * body.servo
        # (n, 3) and (n, 4) of the links, root first; engines may change theirs
        self.start_position, self.start_orientation = body.position.copy(), body.orientation.copy()
        self._dt = dt
        self._linear, self._angular = held_law(self.stiffness, self.damping), held_law(*self._rotation)
        if drive == DRIVES[0]:
            lone = not tracker.joints and not any(scenario.bodies[self.links[0]].center_of_mass)
            self._linear = step_law(self.stiffness, self.damping, body.mass, dt, lone)
            self._angular = step_law(*self._rotation, 1.0, dt, lone)
        self.ballast = self._linear.added, self._angular.added * self.inertia
        bare = scenario.bodies[self.links[0]]
        self._center = np.array(bare.center_of_mass)
        self.root = _joined(BodyFacts(bare.mass, bare.center_of_mass, bare.inertia), *self.ballast)
        self._aim(drive == DRIVES[0] and tracker.interpolation != "held")
        self._before = (np.full(3, np.nan),) * 4 + (np.zeros((3, 3)),)

    @property
    def _rotation(self) -> tuple[float, float]:
        """Stiffness [1/s^2] and damping [1/s] of the rotation per inertia."""
        return self.frequency**2, 2 * self.frequency

    def _aim(self, starts: bool) -> None:
        """Set the tracker's poses that steps refer to, at their starts or ends, and the part of force and
        torque that its velocity causes."""
        position, turned = self.target.position, self.target.orientation
        pace, rate = self.target.linear_velocity, self.target.angular_velocity
        before, rate_before = pace, rate
        if starts:
            position = np.concatenate([self.start.position, position])
            turned = np.concatenate([self.start.orientation, turned])
            pace = np.diff(position, axis=0) / self._dt
            key = Rotation.from_quat(turned, scalar_first=True)
            rate = (key[1:] * key[:-1].inv()).as_rotvec() / self._dt
            before = np.concatenate([self.start.linear_velocity, pace[:-1]])
            rate_before = np.concatenate([self.start.angular_velocity, rate[:-1]])
        self._position, self._orientation = position, turned
        self._push = self._linear.damping * before + self._linear.lead * (pace - before)
        self._twist = self._angular.damping * rate_before + self._angular.lead * (rate - rate_before)

    @cached_property
    def servo_stiffness(self) -> Array:
        """Stiffness (j,) [N m/rad] of an engine's own servos, one per hinge."""
        return self._per_hinge(self.hinge_stiffness)

    @cached_property
    def servo_damping(self) -> Array:
        """Damping (j,) [N m s/rad] of an engine's own servos."""
        return self._per_hinge(self.hinge_damping)

    def _per_hinge(self, gains: Array) -> Array:
        """One gain per hinge (j,) from a gain matrix (j, j).

        For a person, the diagonal; for a hand, the geometric mean of the diagonal and the row's absolute sum
        (all hinges turn together). The mean would add energy where a person's limbs are pressed, because many
        hang on one hinge.
        """
        alone = gains.diagonal()
        if self._person:
            return alone
        found: Array = np.sqrt(alone * np.abs(gains).sum(axis=1))
        return found

    def largest_torques(self, step: int, angle: Array, rate: Array) -> Array:
        """Bounds (j,) [N m] on the torques of an engine's own servos, for any signs of the errors at the
        step's start."""
        error = np.abs(self.target.angle[step] - angle)
        error_rate = np.abs(self.target.rate[step] - rate)
        found: Array = self.servo_stiffness * error + self.servo_damping * error_rate
        return found

    def wrench(
        self, step: int, position: Array, orientation: Array, velocity: Array, omega: Array
    ) -> tuple[Array, Array]:
        """Force and torque on the root's origin, and on its ballast, for a native step.

        Args:
            step: number of the step.
            position, orientation: of the root's origin (3,) [m] and (4,) wxyz, at the step's start.
            velocity, omega: of the root's origin [m/s] and about it [rad/s], world.
        """
        force = self.stiffness * (self._position[step] - position) - self._linear.damping * velocity
        force += self._push[step]
        wanted = self._angular.stiffness * rotation_between(orientation, self._orientation[step])
        wanted += self._twist[step] - self._angular.damping * omega
        axes = rotation_matrix(orientation)
        inertia = axes @ self.inertia @ axes.T
        torque = inertia @ wanted
        self._before = force, torque, velocity.copy(), omega.copy(), self._angular.added * inertia
        # the coupling's inertia has no gyroscopic torque, but that of a part of the body has
        return force, torque + cross(omega, self._before[-1] @ omega)

    def central_start(self) -> tuple[Array, Array]:
        """Velocity of the mass centre of the root with its ballast, and angular velocity, at the start."""
        velocity, omega = self.start.linear_velocity[0], self.start.angular_velocity[0]
        arm = rotation_matrix(self.start_orientation[0]) @ self.root.center_of_mass
        return velocity + cross(omega, arm), omega

    def central_wrench(
        self, step: int, position: Array, orientation: Array, velocity: Array, omega: Array
    ) -> tuple[Array, Array]:
        """`wrench` for an engine that reports the velocity of the mass centre of the root with its ballast
        [m/s], and takes the force and the torque there."""
        arm = rotation_matrix(orientation) @ self.root.center_of_mass
        force, torque = self.wrench(step, position, orientation, velocity - cross(omega, arm), omega)
        return force, torque - cross(arm, force)

    def read_central(self, state: State, tracker: int, velocity: Array, omega: Array) -> None:
        """`read` for an engine that reports the velocity of the mass centre of the root with its ballast."""
        arm = rotation_matrix(state.orientation[self.links[0]]) @ self.root.center_of_mass
        self.read(state, tracker, velocity - cross(omega, arm), omega)

    def read(self, state: State, tracker: int, velocity: Array, omega: Array) -> None:
        """Write the velocity of the root's mass centre, and the force and torque of the last `wrench` without
        what its ballast took, into a state that has the root's orientation.

        Args:
            tracker: row of the drive in the state.
            velocity, omega: of the root's origin at the step's end [m/s], [rad/s], world.
        """
        force, torque, start, turned, ballast = self._before
        root, (mass, _) = self.links[0], self.ballast
        arm = rotation_matrix(state.orientation[root]) @ self._center
        state.linear_velocity[root] = velocity + cross(omega, arm)
        state.force[tracker] = force - mass / self._dt * (velocity - start)
        state.torque[tracker] = torque - ballast @ (omega - turned) / self._dt

    def hinge_torques(self, step: int, angle: Array, rate: Array) -> Array:
        """Torques on the hinges (j,) [N m] for a native step, from their state at its start."""
        error = self.target.angle[step] - angle
        error_rate = self.target.rate[step] - rate
        return self.hinge_stiffness @ error + self.hinge_damping @ error_rate

    def gains(self) -> dict[str, object]:
        """Published gains."""
        return {
            "stiffness [N/m]": self.stiffness,
            "damping [N s/m]": self.damping,
            "rotation frequency [rad/s]": self.frequency,
            "rotation inertia [kg m^2]": self.inertia.tolist(),
            "added mass [kg]": self.ballast[0],
            "added inertia [kg m^2]": self.ballast[1].tolist(),
            "hinge stiffness [N m/rad]": self.hinge_stiffness.tolist(),
            "hinge damping [N m s/rad]": self.hinge_damping.tolist(),
        }


def simulated_masses(scenario: Scenario, drives: Sequence[Drive]) -> list[Body | BodyFacts]:
    """Mass properties of all bodies as engines simulate them: roots with their ballast."""
    roots = {drive.links[0]: drive.root for drive in drives}
    return [roots.get(k, body) for k, body in enumerate(scenario.bodies)]


def without_ballast(
    found: Mapping[str, BodyFacts], scenario: Scenario, drives: Sequence[Drive]
) -> dict[str, BodyFacts]:
    """Mass properties by body that an engine reports, less the ballast of roots."""
    bare = dict(found)
    for drive in drives:
        name, (mass, inertia) = scenario.bodies[drive.links[0]].name, drive.ballast
        if mass > 0:
            bare[name] = _joined(bare[name], -mass, -inertia)
    return bare


def _poses(scenario: Scenario, tracker: Tracker, motion: TrackerMotion) -> tuple[Array, Array]:
    """Origins (n, t, 3) [m] and rotations (n, t, 3, 3) of the links as the tracker specifies them."""
    return link_poses(scenario, tracker, motion.position, motion.orientation, motion.angle)


def _joined(body: BodyFacts, mass: float, inertia: Array) -> BodyFacts:
    """A body and what it carries at its origin: a mass [kg] and an inertia about it (3, 3) [kg m^2]."""
    whole = body.mass + mass
    arm = np.array(body.center_of_mass)
    center = body.mass / whole * arm
    about = np.array(body.inertia) + inertia + body.mass * _steiner(arm - center) + mass * _steiner(center)
    return BodyFacts.of(whole, center, about)


def _steiner(arm: Array) -> Array:
    """Inertia of a unit mass at an arm (3,) [m]."""
    turned: Array = arm @ arm * np.eye(3) - np.outer(arm, arm)
    return turned


def _felt(inertia: Array) -> Array:
    """Effective inertia (j, j) of the hinges for a joint-space inertia (6 + j, 6 + j) with a free root."""
    root, across = inertia[:6, :6], inertia[:6, 6:]
    felt: Array = inertia[6:, 6:] - across.T @ np.linalg.solve(root, across)
    return felt


def cut(servo: Array, felt: Array) -> Array:
    """Servo inertia (j, j), limited to `INERTIA_RATIO` times the hinges' effective inertia in every
    direction; never larger than before."""
    root = np.linalg.cholesky(felt)
    inverse = np.linalg.inv(root)
    ratios, axes = np.linalg.eigh(inverse @ servo @ inverse.T)
    if ratios[-1] <= INERTIA_RATIO:
        return servo
    kept = root @ axes
    smaller: Array = kept * np.minimum(ratios, INERTIA_RATIO) @ kept.T
    return smaller

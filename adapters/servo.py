"""Virtual coupling of the root and hinge servo, the same for every dynamics engine.

Root: force K (p_t - p) + R (v_t - v) at the root's origin (Eq. 6), and a torque, critically damped at the
same frequency w = sqrt(K / m): I (w^2 theta + 2 w (omega_t - omega)). Hinges: torque
M (w_h^2 (q_t - q) + 2 w_h (q_t' - q')). I is the inertia of the whole driven body about the root's origin in
the first posture. M is the effective inertia of the hinges in that posture with the root *free*, limited to
`INERTIA_RATIO` times the effective inertia in any posture of the tracker: a bent arm's twist has thirty times
the inertia of a stretched one's. With the root fixed, or without the limit, the gains would be too high, and
an explicit servo diverges at 1/240 s. Manifests publish both as gains.

By default (`native`) hinges follow an engine's own position servo, with one gain per hinge
(`servo_stiffness`, `servo_damping`); each adapter documents its servo. Explicit torques held over a step add
energy where a limb is pressed; they remain available as `torque`. The root's force and torque are held over a
step as well; where that loop diverges without any contact, the scene is refused: it is no engine's fault.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Unsupported
from touchstone.adapters.vector_products import rotation_between, rotation_matrix
from touchstone.scenarios.avatar.kinematics import joint_space_inertia, link_poses
from touchstone.scenarios.avatar.tracking import TrackerMotion, sample
from touchstone.scenarios.scenario import Scenario, Tracker

INERTIA_RATIO = 2.0
"""Maximum ratio of the servo's inertia to that of the hinges, in any direction and posture [1]. At 70 rad/s
and 1/240 s the loop diverges from 3.2."""
STABLE_GAIN = 2.0
"""Largest R dt + K dt^2 / 2 over the inertia at which semi-implicit Euler is stable with a spring (K) and a
damper (R) whose force is held over a step [1]."""
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


class Drive:
    """Targets and gains of one tracker, for the native steps of one run."""

    def __init__(self, scenario: Scenario, tracker: Tracker, dt: float) -> None:
        steps = round(scenario.duration / dt)
        self.target = sample(tracker, np.minimum(np.arange(1, steps + 1) * dt, scenario.duration))
        self.links = scenario.links(tracker)
        body = starting_body(scenario, tracker)
        self.start = body.motion
        self.inertia = body.axes.T @ body.inertia[3:6, 3:6] @ body.axes
        self.stiffness, self.damping = tracker.stiffness, tracker.damping
        self.frequency = float(np.sqrt(tracker.stiffness / body.mass))
        self._require_stable(tracker.root, body.inertia[:6, :6], dt)
        self.hinge_frequency = tracker.hinge_frequency
        self._person = any(name in tracker.joints for chain in scenario.chains for name in chain.joints)
        self.hinge_stiffness = tracker.hinge_frequency**2 * body.servo
        self.hinge_damping = 2 * tracker.hinge_frequency * body.servo
        # (n, 3) and (n, 4) of the links, root first; engines may change theirs
        self.start_position, self.start_orientation = body.position.copy(), body.orientation.copy()

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
        """Bounds (j,) [N m] on `hinge_torques`, for any signs of the errors at the step's start."""
        error = np.abs(self.target.angle[step] - angle)
        error_rate = np.abs(self.target.rate[step] - rate)
        return np.abs(self.hinge_stiffness) @ error + np.abs(self.hinge_damping) @ error_rate

    def _require_stable(self, root: str, inertia: Array, dt: float) -> None:
        """Raise Unsupported where the root's force, held over a step, surely diverges.

        Hinges are taken as locked: with free ones the root has less inertia, and diverges at smaller steps.
        """
        if self._held_gain(inertia, dt) <= STABLE_GAIN:
            return
        rate = 1 / dt
        while self._held_gain(inertia, 1 / rate) > STABLE_GAIN:
            rate *= 1.001
        raise Unsupported(
            f"the coupling of {root!r} to its tracker is a force held over a step, which diverges at "
            f"1/{1 / dt:.4g} s and is stable from 1/{np.ceil(rate):.0f} s on"
        )

    def _held_gain(self, inertia: Array, dt: float) -> float:
        """Largest eigenvalue of R dt + K dt^2 / 2 of force and torque over the root's inertia (6, 6) [1]."""
        w, gain = self.frequency * dt, np.zeros((6, 6))
        gain[:3, :3] = (self.damping * dt + self.stiffness * dt**2 / 2) * np.eye(3)
        gain[3:, 3:] = (2 * w + w**2 / 2) * inertia[3:, 3:]
        return float(np.linalg.eigvals(np.linalg.solve(inertia, gain)).real.max())

    def wrench(
        self, step: int, position: Array, orientation: Array, velocity: Array, omega: Array
    ) -> tuple[Array, Array]:
        """Force and torque on the root's origin for a native step.

        Args:
            step: number of the step; its target is the tracker at the step's end.
            position, orientation: of the root's origin (3,) [m] and (4,) wxyz, at the step's start.
            velocity, omega: of the root's origin [m/s] and about it [rad/s], world.
        """
        target = self.target
        force = self.stiffness * (target.position[step] - position)
        force += self.damping * (target.linear_velocity[step] - velocity)
        wanted = self.frequency**2 * rotation_between(orientation, target.orientation[step])
        wanted += 2 * self.frequency * (target.angular_velocity[step] - omega)
        axes = rotation_matrix(orientation)
        return force, axes @ (self.inertia @ (axes.T @ wanted))

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
            "hinge stiffness [N m/rad]": self.hinge_stiffness.tolist(),
            "hinge damping [N m s/rad]": self.hinge_damping.tolist(),
        }


def _poses(scenario: Scenario, tracker: Tracker, motion: TrackerMotion) -> tuple[Array, Array]:
    """Origins (n, t, 3) [m] and rotations (n, t, 3, 3) of the links as the tracker specifies them."""
    return link_poses(scenario, tracker, motion.position, motion.orientation, motion.angle)


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

"""Bodies that move regardless of contacts: links (drive `posed`), prescribed bodies and moving surfaces.

Without link dynamics contacts alone are compared, and their times. Engines differ in how a kinematic link's
motion acts on bodies in contact: DART's contacts use its velocity; those of MuJoCo (mocap bodies) and
pybullet (bodies without mass) do not. The reference's links are the limit of stiff couplings (`kinematic` in
`adapters/engines/reference/reference_world.py`).

A prescribed body carries bodies in contact at its velocity in every engine. In a step it moves at the mean
velocity of that step, as semi-implicit Euler moves all other bodies.

Engines without surface velocity (Bullet, DART) play a body with a moving surface as a prescribed one that has
the velocity of the surface in contacts, and is put back at every step. It pushes along the normal too, where
the surface does not move along its own plane.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Settings, State, Unsupported
from touchstone.scenarios.avatar.kinematics import link_poses
from touchstone.scenarios.avatar.surface_motion import surface_motion, surface_moves
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.scenario import UNMOVED, Body, Scenario, Tracker

RIGID = 1e-12
"""Difference of the motion of two pieces' surfaces over their speed that is rounding [1]."""


class Posed:
    """Motion of one tracker's links over the native steps of a run; index 0 is the start, k + 1 the end of
    step k.

    Attributes:
        links: bodies, root first.
        place, orientation: of the links' origins (n, steps + 1, 3) [m] and (n, steps + 1, 4) wxyz, world.
        center: centres of mass (n, steps + 1, 3) [m], world.
        velocity, omega: of the centres of mass [m/s] and of the links [rad/s] during each step (n, steps, 3).
        prescribed: whether it is a prescribed body, or a fixed one with a moving surface.
        surface_velocity, surface_omega: of the material relative to the links at their origins, by the first
            piece, during each step (n, steps, 3) [m/s, rad/s; world].
        start: the tracker at the start.
    """

    def __init__(self, scenario: Scenario, tracker: Tracker, dt: float) -> None:
        steps = round(scenario.duration / dt)
        motion = sample(tracker, np.minimum(np.arange(steps + 1) * dt, scenario.duration))
        self._dt = dt
        self.links = scenario.links(tracker)
        self.prescribed = scenario.bodies[self.links[0]].kind in UNMOVED
        self.start = sample(tracker, np.zeros(1))
        self.angle, self.rate = motion.angle, motion.rate
        self.place, turn = link_poses(scenario, tracker, motion.position, motion.orientation, motion.angle)
        flat = Rotation.from_matrix(turn.reshape(-1, 3, 3))
        self.orientation = flat.as_quat(scalar_first=True).reshape(*turn.shape[:2], 4)
        arms = np.array([scenario.bodies[link].center_of_mass for link in self.links])
        self.center = self.place + np.einsum("ntij,nj->nti", turn, arms)
        self.velocity = np.diff(self.center, axis=1) / dt
        motions = np.array([_surface_motion(scenario.bodies[link]) for link in self.links])
        self.surface_velocity, self.surface_omega = np.einsum("ntij,nkj->knti", turn[:, :-1], motions)
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


def _surface_motion(body: Body) -> tuple[Array, Array]:
    """Velocity at a body's origin and angular velocity of the material of its first piece, body frame."""
    return surface_motion(body.pieces[0], np.zeros(3)) if body.pieces else (np.zeros(3), np.zeros(3))


def moving_surfaces(engine: str, scenario: Scenario, settings: Settings) -> tuple[tuple[Posed, slice], ...]:
    """Motions of the fixed bodies with moving surfaces, for an engine that has no surface velocity.

    Raises:
        Unsupported: two pieces of a body do not move as one rigid body.
    """
    found = []
    for body in filter(surface_moves, scenario.bodies):
        motions = np.array([surface_motion(piece, np.zeros(3)) for piece in body.pieces])
        if np.ptp(motions, axis=0).max() > RIGID * np.abs(motions).max():
            raise Unsupported(f"{engine}: the surfaces of the pieces of {body.name!r} move differently")
        if body.kind == "fixed":
            times = (0.0, scenario.duration)
            rows = ((body.position,) * 2, (body.orientation,) * 2, ((), ()))
            found.append((Posed(scenario, Tracker(body.name, (), times, *rows), settings.dt), slice(0)))
    return tuple(found)


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

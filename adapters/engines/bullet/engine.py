"""Bullet through pybullet, in reduced coordinates: a body, a driven hand or a mechanism is a multibody.

Under `maximal`, free balls and boxes are rigid bodies.

Conventions: quaternions are xyzw, ours wxyz. Bullet poses and moves the *inertial frame* of a link (origin at
the centre of mass, axes along the principal moments), while `createMultiBody` takes link frames, chains link
frames to link frames and expects a hinge's axis in the child's frame. Velocities are in world axes; the
linear velocity is that of the centre of mass. A contact's normal points from B to A and its distance is
negative in overlap, both at the start of the step. It has a witness on each body (we take the midpoint) and
three forces on A, along the normal and two tangents. Impulse = force * step; ours acts on B, so it is
negated. Coefficients multiply. Spheres, boxes and capsules of a body share a compound; hulls cannot, so
further hulls of a body are massless links fixed to it. A prescribed body is a multibody without mass: its
contacts use the velocity that is set for it, those of a rigid body without mass do not. pybullet prints its
build time on import: the child's stdout is redirected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from math import inf
from typing import Any, ClassVar

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Manifest, Settings, State, Unsupported
from touchstone.adapters.engines.bullet.bodies import ROUNDED, Bodies, Factors
from touchstone.adapters.engines.bullet.joints import close_loops, couple_joints
from touchstone.adapters.engines.bullet.read_back import ReadBack
from touchstone.adapters.engines.bullet.tables import BASE, FRICTION_MAX, UNTURNED, Multibody
from touchstone.adapters.engines.scene_world import SceneWorld
from touchstone.adapters.material_combine import (
    check_range,
    crossed_factors,
    friction_lengths,
    frictions,
    product_factors,
    restitutions,
)
from touchstone.adapters.posed_drive import moving_surfaces
from touchstone.adapters.registry import ENGINES, require_profile
from touchstone.adapters.servo import Drive
from touchstone.adapters.vector_products import cross
from touchstone.scenarios.scenario import Cone, Ellipsoid, Scenario

MISSING = {Cone: "cones", Ellipsoid: "ellipsoids"}


class BulletEngine:
    """Bullet's multibody world with its sequential impulse solver."""

    name: ClassVar[str] = "bullet"
    profiles: ClassVar[Mapping[str, float]] = ENGINES["bullet"].profiles
    plays_body_joints: ClassVar[bool] = True
    friction_laws: ClassVar[tuple[str, ...]] = ("rolling_friction", "torsional_friction")

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        joined = {name for joint in scenario.body_joints for name in (joint.parent, joint.child)}
        for body in scenario.bodies:
            for kind in {type(piece.shape) for piece in body.pieces} & MISSING.keys():
                raise Unsupported(f"bullet: pybullet makes no {MISSING[kind]} (body {body.name!r})")
            is_link = body.kind == "driven" or body.name in joined
            if any(isinstance(p.shape, ROUNDED) for p in body.pieces) and (is_link or len(body.pieces) > 1):
                raise Unsupported(f"bullet: margins round the only hull of a free body (body {body.name!r})")
        check_range("bullet", "friction", scenario, frictions(scenario), greatest=FRICTION_MAX)
        restitution = product_factors("bullet", "restitution", scenario, restitutions(scenario))
        friction = product_factors("bullet", "friction", scenario, frictions(scenario))
        rolling, spinning = (
            crossed_factors("bullet", f"{law} friction", scenario, friction_lengths(scenario, law), friction)
            for law in ("rolling", "torsional")
        )
        factors = [Factors(*of_body) for of_body in zip(restitution, friction, rolling, spinning)]
        return World(scenario, settings, factors)

    def version(self) -> str:
        return f"{version('pybullet')} (API {pybullet.getAPIVersion()})"


class World(SceneWorld):
    """A scenario in a physics client."""

    def __init__(self, scenario: Scenario, settings: Settings, factors: list[Factors]) -> None:
        surfaces = moving_surfaces("bullet", scenario, settings)
        super().__init__(BulletEngine(), scenario, settings, surfaces=surfaces)
        self._on = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
        self._native = settings.drive == "native"
        self._bodies = Bodies(scenario, settings, factors, dict(zip(self._coupled, self._drives)), self._on)
        self._parameters, self._axes, self._arm = self._bodies.parameters, self._bodies.axes, self._bodies.arm
        pybullet.setPhysicsEngineParameter(fixedTimeStep=settings.dt, **self._parameters.solver, **self._on)
        pybullet.setGravity(*scenario.acting_gravity, **self._on)
        n, hinges = len(scenario.bodies), sum(len(tracker.joints) for tracker in scenario.trackers)
        self._to_body = Rotation.from_quat(self._axes).inv()
        self._root_to_body = [self._to_body[drive.links[0]] for drive in self._drives]
        # Inertial frames and hinges as read from Bullet.
        self._center, self._turn = np.zeros((n, 3)), np.tile(UNTURNED, (n, 1))
        self._velocity, self._omega = np.zeros((n, 3)), np.zeros((n, 3))
        self._angle, self._rate = np.zeros(hinges), np.zeros(hinges)
        # Commands: torque per hinge, force against gravity per body.
        self._hinge_torque = np.zeros(hinges)
        down = np.array(scenario.acting_gravity)
        self._lift = [(-body.mass * down).tolist() for body in self._bodies.masses]
        self._bodies.add()
        self._driven = self._bodies.driven
        self._place_posed()
        for multibody in (*self._bodies.free, *self._bodies.joined):
            self._observe(multibody)  # fixed bodies are read only here
        links = {body: own[0] for body, own in self._bodies.colliders.items()}
        close_loops(scenario, links, self._center, self._turn, self._on)
        couple_joints(scenario, links, self._on)
        simulated = [one for one in self._bodies.free if scenario.bodies[one.bodies[0]].kind != "fixed"]
        self._moving = (*simulated, *self._bodies.joined, *self._driven)
        self._bodies.filter_pairs()
        self._contact_count = 0
        # Body frames of all bodies as last read, and their arms to the centres of mass, world.
        self._read_since_step = False
        self._place, self._orientation, self._lever = np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 3))

    def _observe(self, multibody: Multibody) -> None:
        """Read a multibody's inertial frames, velocities and hinges."""
        number, bodies, hinges, based = multibody
        for root in bodies[:based]:
            self._center[root], self._turn[root] = pybullet.getBasePositionAndOrientation(number, **self._on)
            self._velocity[root], self._omega[root] = pybullet.getBaseVelocity(number, **self._on)
        links = list(bodies[based:])
        if links:
            states = pybullet.getLinkStates(
                number, range(len(links)), computeLinkVelocity=1, computeForwardKinematics=1, **self._on
            )
            rows = np.array([state[0] + state[1] + state[6] + state[7] for state in states])
            self._center[links], self._turn[links] = rows[:, :3], rows[:, 3:7]
            self._velocity[links], self._omega[links] = rows[:, 7:10], rows[:, 10:]
        if hinges.stop:
            joints = pybullet.getJointStates(number, range(len(links)), **self._on)
            self._angle[hinges], self._rate[hinges] = np.array([joint[:2] for joint in joints]).T
            if self._native:
                self._hinge_torque[hinges] = [joint[3] for joint in joints]

    def drive(self, step: int) -> None:
        """Command roots, hinges and motors and cancel gravity on driven links, or pose kinematic links."""
        self._moment = step + 1
        self._place_posed()
        for motors in self._bodies.motors:
            motors.push()
        for k, (multibody, drive) in enumerate(zip(self._driven, self._drives)):
            number, bodies = multibody.id, multibody.bodies
            root = bodies[0]
            if not self._read_since_step:
                self._observe(multibody)
                turned = Rotation.from_quat(self._turn[root]) * self._root_to_body[k]
                self._orientation[root] = turned.as_quat(scalar_first=True)
                self._lever[root] = turned.apply(self._arm[root])
                self._place[root] = self._center[root] - self._lever[root]
            position, orientation, omega = self._place[root], self._orientation[root], self._omega[root]
            velocity = self._velocity[root] - cross(omega, self._lever[root])
            force, torque = drive.wrench(step, position, orientation, velocity, omega)
            self._push(number, BASE, force.tolist(), position)
            pybullet.applyExternalTorque(number, BASE, torque.tolist(), pybullet.WORLD_FRAME, **self._on)
            for link, body in enumerate(bodies, start=BASE):
                self._push(number, link, self._lift[body], self._center[body])
            if len(bodies) > 1:
                self._turn_hinges(step, multibody, drive)

    def _place_posed(self) -> None:
        """Set the poses of kinematic links at the current step's end, and of prescribed bodies at its start,
        with the velocities of their surfaces."""
        for posed, _ in self._posed:
            step = max(self._moment - 1, 0)
            moment = step if posed.prescribed else self._moment
            turned = Rotation.from_quat(posed.orientation[:, moment], scalar_first=True)
            frames = (turned * Rotation.from_quat(self._axes[list(posed.links)])).as_quat()
            for k, (link, center, frame) in enumerate(zip(posed.links, posed.center[:, moment], frames)):
                number = self._bodies.kinematic[link]
                pybullet.resetBasePositionAndOrientation(number, center.tolist(), frame.tolist(), **self._on)
                if posed.prescribed:
                    spin, arm = posed.surface_omega[k, step], posed.center[k, step] - posed.place[k, step]
                    velocity = posed.velocity[k, step] + posed.surface_velocity[k, step] + cross(spin, arm)
                    rates = velocity.tolist(), (posed.omega[k, step] + spin).tolist()
                    pybullet.resetBaseVelocity(number, *rates, **self._on)

    def _turn_hinges(self, step: int, multibody: Multibody, drive: Drive) -> None:
        """Command hinges by motors or torques.

        A motor's target is the rate at the end of the step under the servo's law; its torque is limited to
        that of the law.
        """
        number, bodies, hinges, _ = multibody
        links, angle, rate = range(len(bodies) - 1), self._angle[hinges], self._rate[hinges]
        if not self._native:
            torques = self._hinge_torque[hinges] = drive.hinge_torques(step, angle, rate)
            pybullet.setJointMotorControlArray(
                number, links, pybullet.TORQUE_CONTROL, forces=torques.tolist(), **self._on
            )
            return
        stiffness, damping = servo_gains(drive.hinge_frequency, self._settings.dt)
        target, target_rate = drive.target.angle[step], drive.target.rate[step]
        pybullet.setJointMotorControlArray(
            number,
            links,
            pybullet.POSITION_CONTROL,
            targetPositions=(target - self._settings.dt * target_rate).tolist(),
            targetVelocities=target_rate.tolist(),
            forces=drive.largest_torques(step, angle, rate).tolist(),
            positionGains=[stiffness] * len(links),
            velocityGains=[damping] * len(links),
            **self._on,
        )

    def _push(self, number: int, link: int, force: list[float], position: Array) -> None:
        pybullet.applyExternalForce(number, link, force, position.tolist(), pybullet.WORLD_FRAME, **self._on)

    def step(self) -> None:
        self._read_since_step = False
        pybullet.stepSimulation(**self._on)

    def read(self, state: State) -> None:
        for multibody in self._moving:
            self._observe(multibody)
        turned = Rotation.from_quat(self._turn) * self._to_body
        self._lever, self._orientation = turned.apply(self._arm), turned.as_quat(scalar_first=True)
        self._place = self._center - self._lever
        self._read_since_step = True
        state.position[:], state.orientation[:] = self._place, self._orientation
        state.linear_velocity[:], state.angular_velocity[:] = self._velocity, self._omega
        state.joint_angle[:], state.joint_rate[:] = self._angle, self._rate
        if self._drives:
            for k, drive in zip(self._coupled, self._drives):
                root = drive.links[0]
                velocity = self._velocity[root] - cross(self._omega[root], self._lever[root])
                drive.read(state, k, velocity, self._omega[root])
            state.hinge_torque[:] = self._hinge_torque
        self._show_posed(state)
        # A point that the solver skipped keeps the force of an earlier step.
        farthest = self._parameters.base.get("contactProcessingThreshold", inf)
        points = [
            point
            for point in pybullet.getContactPoints(**self._on)
            if not (point[8] > farthest or (point[8] > 0 and point[9] == point[10] == point[12] == 0))
        ]
        if points:
            self._add_contacts(points, state)
        self._contact_count = state.contact_count

    def _add_contacts(self, points: Sequence[tuple[Any, ...]], state: State) -> None:
        _, a, b, link_a, link_b, on_a, on_b, normal, distance, *forces = zip(*points)
        push, pull_1, tangent_1, pull_2, tangent_2 = forces
        axes = np.array((normal, tangent_1, tangent_2)).swapaxes(0, 1)
        force = np.array((push, pull_1, pull_2)).T
        first, second = (
            np.array([self._bodies.body_of[key] for key in zip(*one)]) for one in ((a, link_a), (b, link_b))
        )
        impulse = -self._settings.dt * (force[:, None] @ axes)[:, 0]
        middle = (np.array(on_a) + np.array(on_b)) / 2
        state.add_contacts(first, second, middle, -axes[:, 0], np.array(distance), impulse)

    def describe(self) -> Manifest:
        """Manifest of all values that Bullet reports, and of settings without a getter as they were set."""
        solver = pybullet.getPhysicsEngineParameters(**self._on)
        found = ReadBack(self._scenario, self._settings, self._bodies, self._on)
        return self._manifest(
            found.settings(solver),
            found.bodies(),
            self._pair_facts(found.combined),
            found.pieces(),
            dt=solver["fixedTimeStep"],
            limits=found.limits(),
            freedom=found.freedom(),
        )

    def cross(self) -> None:
        pybullet.setTimeStep(self._settings.dt, **self._on)

    def work(self) -> Mapping[str, float]:
        """Contact points of the last step; reading iterations would cost 2 us per step."""
        return {"contacts": float(self._contact_count)}

    def close(self) -> None:
        pybullet.disconnect(**self._on)


def servo_gains(frequency: float, dt: float) -> tuple[float, float]:
    """Position and velocity gain [1] of a motor that acts as a critically damped servo.

    A motor sets the rate at the step's end, v' = v + kp (p - q) / dt + kd (v_t - v). The law of a servo of
    `frequency` w [rad/s] at that time is v' = v + dt (w^2 (q_t - q - dt v') + 2 w (v_t - v')). It is a
    motor's law with p = q_t - dt v_t.
    """
    turn = frequency * dt
    share = 1 / (1 + turn) ** 2
    return turn * turn * share, (2 + turn) * turn * share

"""Bullet through pybullet, in reduced coordinates: every body is a multibody with its own base.

Under `maximal`, free balls and boxes are rigid bodies.

Conventions: quaternions are xyzw, ours wxyz. Bullet poses and moves the *inertial frame* of a link (origin at
the centre of mass, axes along the principal moments), while `createMultiBody` takes link frames, chains link
frames to link frames and expects a hinge's axis in the child's frame. Velocities are in world axes; the
linear velocity is that of the centre of mass. A contact's normal points from B to A and its distance is
negative in overlap, both at the start of the step. It has a witness on each body (we take the midpoint) and
three forces on A, along the normal and two tangents. Impulse = force * step; ours acts on B, so it is
negated. Coefficients multiply. Spheres, boxes and capsules of a body share a compound; hulls cannot, so
further hulls of a body are massless links fixed to it. pybullet prints its build time on import: the child's
stdout is redirected.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from itertools import combinations, product
from math import inf
from typing import ClassVar

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import (
    Array,
    BodyFacts,
    Manifest,
    PairFacts,
    Scalar,
    Settings,
    State,
    Unsupported,
)
from touchstone.adapters.engines.bullet import tables as bullet_tables
from touchstone.adapters.engines.bullet.tables import (
    BASE,
    FRICTION_MAX,
    LINK,
    NO_SHAPE,
    RIGID_BODY,
    UNTURNED,
    Links,
    Multibody,
    Part,
)
from touchstone.adapters.material_combine import check_range, frictions, product_factors, restitutions
from touchstone.adapters.posed_drive import posed_of
from touchstone.adapters.registry import ACCURATE, ENGINES, MAXIMAL, require_profile
from touchstone.adapters.servo import Drive
from touchstone.scenarios.scenario import (
    IDENTITY,
    ORIGIN,
    Body,
    Box,
    Capsule,
    Ellipsoid,
    Hull,
    Joint,
    Piece,
    Scenario,
    Sphere,
)
from touchstone.scenarios.solids import box_inertia, sphere_inertia

Joints = tuple[Joint, ...]
INERTIA_TOLERANCE = 1e-12
"""Relative tolerance between a body's inertia and that of its shape: rounding."""
HINGE_DRIVES = {
    "native": "position control",
    "torque": "off (force 0)",
    "posed": "none: links are bodies without mass",
}
PRIMITIVES = {Sphere: pybullet.GEOM_SPHERE, Box: pybullet.GEOM_BOX, Capsule: pybullet.GEOM_CAPSULE}


class BulletEngine:
    """Bullet's multibody world with its sequential impulse solver."""

    name: ClassVar[str] = "bullet"
    profiles: ClassVar[Mapping[str, float]] = ENGINES["bullet"].profiles

    def build(self, scenario: Scenario, settings: Settings) -> World:
        """Build a world in its own physics client."""
        require_profile(self.name, settings)
        for body in scenario.bodies:
            if any(isinstance(piece.shape, Ellipsoid) for piece in body.pieces):
                raise Unsupported(f"bullet: pybullet makes no ellipsoids (body {body.name!r})")
        check_range("bullet", "friction", scenario, frictions(scenario), greatest=FRICTION_MAX)
        restitution = product_factors("bullet", "restitution", scenario, restitutions(scenario))
        friction = product_factors("bullet", "friction", scenario, frictions(scenario))
        return World(scenario, settings, list(zip(restitution, friction)))

    def version(self) -> str:
        """Versions of the package and of Bullet's API."""
        return f"{version('pybullet')} (API {pybullet.getAPIVersion()})"


class World:
    """A scenario in a physics client; `factors` are the restitution and friction of each body."""

    def __init__(self, scenario: Scenario, settings: Settings, factors: list[tuple[float, float]]) -> None:
        self._scenario, self._settings, self._factors = scenario, settings, factors
        posed = settings.drive == "posed"
        self._posed = posed_of(scenario, settings.dt) if posed else ()
        self._moment = 0
        driven = () if posed else scenario.trackers
        self._drives = [Drive(scenario, tracker, settings.dt) for tracker in driven]
        self._on = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
        self._told = bullet_tables.ACCURATE if settings.profile == ACCURATE else bullet_tables.DEFAULT
        self._native = settings.drive == "native"
        self._sleep = bullet_tables.SLEEPING if settings.sleeping else {}
        pybullet.setPhysicsEngineParameter(fixedTimeStep=settings.dt, **self._told.solver, **self._on)
        pybullet.setGravity(*scenario.acting_gravity, **self._on)
        n, hinges = len(scenario.bodies), sum(len(tracker.joints) for tracker in scenario.trackers)
        # Inertial frames in the body frames.
        self._moments, axes = zip(*(_principal_axes(body) for body in scenario.bodies))
        self._axes, self._arm = np.array(axes), np.array([body.center_of_mass for body in scenario.bodies])
        self._to_body = Rotation.from_quat(self._axes).inv()
        # Inertial frames and hinges as read from Bullet.
        self._center, self._turn = np.zeros((n, 3)), np.tile(UNTURNED, (n, 1))
        self._velocity, self._omega = np.zeros((n, 3)), np.zeros((n, 3))
        self._angle, self._rate = np.zeros(hinges), np.zeros(hinges)
        # Commands: force and torque per tracker, torque per hinge, force against gravity per body.
        self._wrench, self._hinge_torque = np.zeros((len(scenario.trackers), 2, 3)), np.zeros(hinges)
        self._lift = [(-body.mass * np.array(scenario.acting_gravity)).tolist() for body in scenario.bodies]
        self._colliders: dict[int, list[tuple[int, int]]] = {}
        maximal = settings.profile == MAXIMAL
        self._rigid = {k for k, body in enumerate(scenario.bodies) if maximal and _is_plain(body)}
        self._free = [self._add_free(k) for k, group in enumerate(scenario.groups()) if group < 0]
        self._driven = [self._add_driven(k) for k in range(len(self._drives))]
        shown = [link for one, _ in self._posed for link in one.links]
        self._kinematic = {link: self._create((link,), (), ORIGIN, IDENTITY) for link in shown}
        self._place_posed()
        for multibody in self._free:
            self._observe(multibody)  # fixed bodies are read only here
        simulated = [one for one in self._free if scenario.bodies[one.bodies[0]].kind != "fixed"]
        self._moving = (*simulated, *self._driven)
        self._body_of = {link: body for body, links in self._colliders.items() for link in links}
        self._filter_pairs()
        self._contact_count = 0

    def _add_free(self, body: int) -> Multibody:
        """Add a fixed or simulated body."""
        given = self._scenario.bodies[body]
        create = self._create_rigid if body in self._rigid else self._create
        number = create((body,), (), given.position, given.orientation)
        pybullet.resetBaseVelocity(number, given.linear_velocity, given.angular_velocity, **self._on)
        return Multibody(number, (body,), slice(0))

    def _add_driven(self, tracker: int) -> Multibody:
        """Add a driven body in its initial state, with hinge limits and without Bullet's default motors."""
        scenario, drive = self._scenario, self._drives[tracker]
        by_name = {joint.name: joint for joint in scenario.joints}
        joints = tuple(by_name[name] for name in scenario.trackers[tracker].joints)
        first = sum(len(other.joints) for other in scenario.trackers[:tracker])
        orientation, start, links = drive.start_orientation[0], drive.start, range(len(joints))
        number = self._create(drive.links, joints, drive.start_position[0], orientation)
        for k, joint in enumerate(joints):
            pybullet.resetJointState(number, k, start.angle[0, k], start.rate[0, k], **self._on)
            limits = {"jointLowerLimit": joint.lower, "jointUpperLimit": joint.upper}
            pybullet.changeDynamics(number, k, **limits, **self._on)
        if joints:
            no_force = [0.0] * len(joints)
            pybullet.setJointMotorControlArray(
                number, links, pybullet.VELOCITY_CONTROL, forces=no_force, **self._on
            )
        arm = Rotation.from_quat(orientation, scalar_first=True).apply(self._arm[drive.links[0]])
        omega = start.angular_velocity[0]
        velocity = start.linear_velocity[0] + np.cross(omega, arm)
        pybullet.resetBaseVelocity(number, velocity.tolist(), omega.tolist(), **self._on)
        return Multibody(number, drive.links, slice(first, first + len(joints)))

    def _create(self, bodies: Links, joints: Joints, position: Sequence[float], wxyz: Sequence[float]) -> int:
        """Create a multibody: base = first body, link k = child of joint k, then links for further hulls."""
        scenario = self._scenario
        shapes = [self._add_shapes(scenario.bodies[body]) for body in bodies]
        base, *parts = (self._part(body, shape[0]) for body, shape in zip(bodies, shapes))
        for k, joint in enumerate(joints):
            rest = Rotation.from_quat(joint.orientation, scalar_first=True)
            parts[k] = parts[k]._replace(
                linkPositions=joint.position,
                linkOrientations=_xyzw(joint.orientation),
                linkParentIndices=bodies.index(scenario.body_index(joint.parent)),
                linkJointTypes=pybullet.JOINT_REVOLUTE,
                linkJointAxis=tuple(rest.inv().apply(joint.axis).tolist()),
            )
        further = [(k, shape) for k, own in enumerate(shapes) for shape in own[1:]]
        parts += [Part(0.0, shape, linkParentIndices=k) for k, shape in further]
        meeting = any(a in bodies and b in bodies for a, b in scenario.touching_pairs())
        number = pybullet.createMultiBody(
            baseMass=base.linkMasses,
            baseCollisionShapeIndex=base.linkCollisionShapeIndices,
            basePosition=position,
            baseOrientation=_xyzw(wxyz),
            baseInertialFramePosition=base.linkInertialFramePositions,
            baseInertialFrameOrientation=base.linkInertialFrameOrientations,
            flags=pybullet.URDF_MAINTAIN_LINK_ORDER | (pybullet.URDF_USE_SELF_COLLISION if meeting else 0),
            **dict(zip(Part._fields, zip(*parts))),
            **self._on,
        )
        self._tell(number, (*bodies, *(bodies[k] for k, _ in further)), len(joints))
        return int(number)

    def _create_rigid(
        self, bodies: Links, _: Joints, position: Sequence[float], wxyz: Sequence[float]
    ) -> int:
        """Create a body of one shape in maximal coordinates; Bullet computes its inertia from the shape."""
        (body,) = bodies
        given = self._scenario.bodies[body]
        (shape,) = self._add_shapes(given)
        number = pybullet.createMultiBody(
            baseMass=self._part(body, shape).linkMasses,
            baseCollisionShapeIndex=shape,
            basePosition=position,
            baseOrientation=_xyzw(wxyz),
            useMaximalCoordinates=True,
            **self._on,
        )
        self._tell(number, bodies, NO_SHAPE)
        return int(number)

    def _tell(self, number: int, bodies: Links, turned: int) -> None:
        """Set coefficients, damping and activation of a new base and its links (link k: bodies[k + 1]), and
        moments of inertia of the base and of the first `turned` links."""
        root = self._scenario.bodies[bodies[0]]
        has_hull = any(isinstance(piece.shape, Hull) for piece in root.pieces)
        told = self._told.base | (self._told.hull if has_hull else {})
        told |= {} if root.kind == "driven" else self._sleep
        pybullet.changeDynamics(number, BASE, **told, **self._on)
        for link, body in enumerate(bodies, start=BASE):
            restitution, friction = self._factors[body]
            own = {"restitution": restitution, "lateralFriction": friction, **LINK}
            if link < turned:
                own["localInertiaDiagonal"] = self._moments[body]
            pybullet.changeDynamics(number, link, **own, **self._on)
            self._colliders.setdefault(body, []).append((number, link))

    def _part(self, body: int, shape: int) -> Part:
        """Mass and inertial frame of a body."""
        given = self._scenario.bodies[body]
        weightless = given.kind == "fixed" or (given.kind == "driven" and self._posed)
        mass = 0.0 if weightless else given.mass
        return Part(mass, shape, given.center_of_mass, tuple(self._axes[body]))

    def _add_shapes(self, body: Body) -> list[int]:
        """Create Bullet's shapes of a body: one compound of its primitives, and one shape per hull."""
        plain = [piece for piece in body.pieces if not isinstance(piece.shape, Hull)]
        shapes = [self._add_primitives(plain)] if plain else []
        shapes += [self._add_hull(p, p.shape) for p in body.pieces if isinstance(p.shape, Hull)]
        return shapes or [NO_SHAPE]

    def _add_primitives(self, pieces: list[Piece]) -> int:
        shapes = [piece.shape for piece in pieces]
        return pybullet.createCollisionShapeArray(
            shapeTypes=[PRIMITIVES[type(shape)] for shape in shapes],
            radii=[shape.radius if isinstance(shape, Sphere | Capsule) else 0.0 for shape in shapes],
            lengths=[2 * shape.half_length if isinstance(shape, Capsule) else 0.0 for shape in shapes],
            halfExtents=[shape.half_extents if isinstance(shape, Box) else ORIGIN for shape in shapes],
            collisionFramePositions=[piece.position for piece in pieces],
            collisionFrameOrientations=[_xyzw(piece.orientation) for piece in pieces],
            **self._on,
        )

    def _add_hull(self, piece: Piece, hull: Hull) -> int:
        return pybullet.createCollisionShape(
            pybullet.GEOM_MESH,
            vertices=hull.vertices,
            collisionFramePosition=piece.position,
            collisionFrameOrientation=_xyzw(piece.orientation),
            **self._on,
        )

    def _filter_pairs(self) -> None:
        """Restrict collisions to the scenario's touching pairs."""
        touching = set(self._scenario.touching_pairs())
        for pair in combinations(range(len(self._scenario.bodies)), 2):
            if pair not in touching:
                for (a, link_a), (b, link_b) in product(*(self._colliders[body] for body in pair)):
                    pybullet.setCollisionFilterPair(a, b, link_a, link_b, 0, **self._on)

    def _observe(self, multibody: Multibody) -> None:
        """Read a multibody's inertial frames, velocities and hinges."""
        number, (root, *links), hinges = multibody
        self._center[root], self._turn[root] = pybullet.getBasePositionAndOrientation(number, **self._on)
        self._velocity[root], self._omega[root] = pybullet.getBaseVelocity(number, **self._on)
        if links:
            states = pybullet.getLinkStates(
                number, range(len(links)), computeLinkVelocity=1, computeForwardKinematics=1, **self._on
            )
            for array, field in ((self._center, 0), (self._turn, 1), (self._velocity, 6), (self._omega, 7)):
                array[links] = [state[field] for state in states]
            joints = pybullet.getJointStates(number, range(len(links)), **self._on)
            self._angle[hinges], self._rate[hinges] = np.array([joint[:2] for joint in joints]).T
            if self._native:
                self._hinge_torque[hinges] = [joint[3] for joint in joints]

    def drive(self, step: int) -> None:
        """Command roots and hinges and cancel gravity on driven links, or pose kinematic links."""
        self._moment = step + 1
        self._place_posed()
        for k, (multibody, drive) in enumerate(zip(self._driven, self._drives)):
            self._observe(multibody)
            number, bodies, _ = multibody
            root, omega = bodies[0], self._omega[bodies[0]]
            turned = Rotation.from_quat(self._turn[root]) * self._to_body[root]
            arm = turned.apply(self._arm[root])
            position, velocity = self._center[root] - arm, self._velocity[root] - np.cross(omega, arm)
            wrench = drive.wrench(step, position, turned.as_quat(scalar_first=True), velocity, omega)
            self._wrench[k] = wrench
            force, torque = self._wrench[k].tolist()
            self._push(number, BASE, force, position)
            pybullet.applyExternalTorque(number, BASE, torque, pybullet.WORLD_FRAME, **self._on)
            for link, body in enumerate(bodies, start=BASE):
                self._push(number, link, self._lift[body], self._center[body])
            if len(bodies) > 1:
                self._turn_hinges(step, multibody, drive)

    def _place_posed(self) -> None:
        """Set the poses of kinematic links for the current step."""
        for posed, _ in self._posed:
            turned = Rotation.from_quat(posed.orientation[:, self._moment], scalar_first=True)
            frames = (turned * Rotation.from_quat(self._axes[list(posed.links)])).as_quat()
            for link, center, frame in zip(posed.links, posed.center[:, self._moment], frames):
                number = self._kinematic[link]
                pybullet.resetBasePositionAndOrientation(number, center.tolist(), frame.tolist(), **self._on)

    def _turn_hinges(self, step: int, multibody: Multibody, drive: Drive) -> None:
        """Command hinges by motors or torques.

        A motor's target is the rate at the end of the step under the servo's law; its torque is limited to
        that of the law.
        """
        number, bodies, hinges = multibody
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
        """Apply a force at a world point for the next step."""
        pybullet.applyExternalForce(number, link, force, position.tolist(), pybullet.WORLD_FRAME, **self._on)

    def step(self) -> None:
        """Advance one native step."""
        pybullet.stepSimulation(**self._on)

    def read(self, state: State) -> None:
        """Read the state and the contacts of the last step."""
        for multibody in self._moving:
            self._observe(multibody)
        turned = Rotation.from_quat(self._turn) * self._to_body
        state.position[:] = self._center - turned.apply(self._arm)
        state.orientation[:] = turned.as_quat(scalar_first=True)
        state.linear_velocity[:], state.angular_velocity[:] = self._velocity, self._omega
        state.joint_angle[:], state.joint_rate[:] = self._angle, self._rate
        if not self._posed:
            state.force[:], state.torque[:] = self._wrench[:, 0], self._wrench[:, 1]
            state.hinge_torque[:] = self._hinge_torque
        for posed, hinges in self._posed:
            posed.show(self._moment, state, hinges)
        # A point that the solver skipped keeps the force of an earlier step.
        farthest = self._told.base.get("contactProcessingThreshold", inf)
        for point in pybullet.getContactPoints(**self._on):
            _, a, b, link_a, link_b, on_a, on_b, normal, distance, *forces = point
            push, pull_1, tangent_1, pull_2, tangent_2 = forces
            if distance > farthest or (distance > 0 and push == pull_1 == pull_2 == 0):
                continue
            axes = np.array((normal, tangent_1, tangent_2))
            impulse = -self._settings.dt * (np.array((push, pull_1, pull_2)) @ axes)
            middle = (np.array(on_a) + on_b) / 2
            bodies = self._body_of[a, link_a], self._body_of[b, link_b]
            state.add_contact(*bodies, middle, -axes[0], distance, impulse)
        self._contact_count = state.contact_count

    def describe(self) -> Manifest:
        """Manifest of all values that Bullet reports, and of settings without a getter as they were set."""
        engine, bodies = BulletEngine(), self._scenario.bodies
        told = pybullet.getPhysicsEngineParameters(**self._on)
        # mass, mu, moments, centre, axes, e, rolling and spinning friction, damping, stiffness, kind, margin
        facts = [pybullet.getDynamicsInfo(*self._colliders[k][0], **self._on) for k in range(len(bodies))]
        return Manifest(
            engine=engine.name,
            version=engine.version(),
            profile=self._settings.profile,
            dt=told["fixedTimeStep"],
            settings=self._settings_read_back(told, facts),
            bodies={body.name: _body_facts(fact) for body, fact in zip(bodies, facts)},
            pairs=tuple(self._pair_facts(facts, a, b) for a, b in self._scenario.touching_pairs()),
            drives={t.root: drive.gains() for t, drive in zip(self._scenario.trackers, self._drives)},
            limits=self._limits(),
            pieces={body.name: self._piece_count(k) for k, body in enumerate(bodies)},
            freedom=self._freedom(),
        )

    def _limits(self) -> dict[str, tuple[float, float]]:
        pybullet.syncBodyInfo(**self._on)  # getJointInfo reads a copy made before the limits were set
        found = {}
        for multibody, tracker in zip(self._driven, self._scenario.trackers):
            for k, name in enumerate(tracker.joints):
                found[name] = pybullet.getJointInfo(multibody.id, k, **self._on)[8:10]
        return found

    def _piece_count(self, body: int) -> int:
        """Shape count of a body, read back; Bullet reports none for rigid bodies."""
        if body in self._rigid:
            return len(self._scenario.bodies[body].pieces)
        return sum(len(pybullet.getCollisionShapeData(*link, **self._on)) for link in self._colliders[body])

    def _freedom(self) -> int:
        """Degrees of freedom: six per base with mass, one per hinge."""
        free = 0
        for multibody in (*self._free, *self._driven):
            free += 6 * (pybullet.getDynamicsInfo(multibody.id, BASE, **self._on)[0] > 0)
            kinds = [
                pybullet.getJointInfo(multibody.id, k, **self._on)[2]
                for k in range(pybullet.getNumJoints(multibody.id, **self._on))
            ]
            free += kinds.count(pybullet.JOINT_REVOLUTE)
        return free

    def _pair_facts(self, facts: list[tuple], a: int, b: int) -> PairFacts:
        first, second = self._scenario.bodies[a].name, self._scenario.bodies[b].name
        return PairFacts(first, second, facts[a][5] * facts[b][5], facts[a][1] * facts[b][1])

    def _settings_read_back(self, told: dict[str, Scalar], facts: list[tuple]) -> dict[str, Scalar]:
        pybullet.syncBodyInfo(**self._on)  # getJointInfo reads a copy made before the limits were set
        links = [(m.id, k) for m in self._driven for k in range(len(m.bodies) - 1)]
        joints = [pybullet.getJointInfo(*link, **self._on) for link in links]
        rows = zip(facts, self._scenario.bodies)
        hulls = [fact for fact, body in rows if any(isinstance(p.shape, Hull) for p in body.pieces)]
        as_set = self._told.solver | self._told.base | self._told.hull | LINK | self._sleep
        return {
            **{f"{name} (read back)": value for name, value in told.items()},
            **{f"{name} (as set)": value for name, value in as_set.items() if name not in told},
            "rolling friction, largest (read back)": _largest(facts, 6),
            "spinning friction, largest (read back)": _largest(facts, 7),
            "contact damping, largest; -1 = rigid (read back)": _largest(facts, 8),
            "contact stiffness, largest; -1 = rigid (read back)": _largest(facts, 9),
            "margin outside hulls, largest [m] (read back)": _largest(hulls, 11),
            "joint damping, largest (read back)": _largest(joints, 6),
            "joint friction, largest (read back)": _largest(joints, 7),
            "hinges with limits (read back)": sum(joint[8] <= joint[9] for joint in joints),
            "hull corners": "rounded by Bullet to about 1e-4 of the hull's size",
            "integrator": "semi-implicit Euler on reduced coordinates, gyroscopic term on",
            "sleep of driven bodies": "off: no force wakes a multibody",
            "default joint motors": HINGE_DRIVES[self._settings.drive],
            "gravity of driven links": "cancelled by an opposite force at each centre of mass",
            "contact breaking": "the threshold is one for the whole process",
            "threads": 1,
            "bodies in maximal coordinates": sum(fact[10] == RIGID_BODY for fact in facts),
            "collision_shapes": sum(self._piece_count(k) for k in range(len(self._scenario.bodies))),
        }

    def cross(self) -> None:
        """Set the time step to its present value."""
        pybullet.setTimeStep(self._settings.dt, **self._on)

    def stage_seconds(self) -> Mapping[str, float]:
        """Nothing: pybullet writes its timers to files only."""
        return {}

    def work(self) -> Mapping[str, float]:
        """Contact points of the last step; reading iterations would cost 2 us per step."""
        return {"contacts": float(self._contact_count)}

    def close(self) -> None:
        """Disconnect the client."""
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


def _xyzw(quaternion: Sequence[float]) -> tuple[float, ...]:
    """Reorder a quaternion wxyz to Bullet's xyzw."""
    w, x, y, z = (float(value) for value in quaternion)
    return x, y, z, w


def _principal_axes(body: Body) -> tuple[list[float], Sequence[float]]:
    """Principal moments of a body, and the quaternion xyzw of its principal axes in the body frame."""
    inertia = np.array(body.inertia)
    if not np.any(inertia - np.diag(np.diagonal(inertia))):
        return np.diagonal(inertia).tolist(), UNTURNED
    moments, axes = np.linalg.eigh(inertia)
    axes[:, 0] *= np.linalg.det(axes)  # makes the axes right-handed
    return moments.tolist(), Rotation.from_matrix(axes).as_quat().tolist()


def _is_plain(body: Body) -> bool:
    """Whether maximal coordinates can represent a body.

    It must be a fixed body of one shape, or a simulated ball or box whose inertia is that of its shape:
    Bullet accepts no other (`changeDynamics` of a rigid body's inertia gives NaN).
    """
    if body.kind == "driven" or not body.pieces:
        return False
    hulls = sum(isinstance(piece.shape, Hull) for piece in body.pieces)
    if body.kind == "fixed":
        return hulls == 0 or len(body.pieces) == 1
    piece = body.pieces[0]
    centred = (piece.position, piece.orientation, body.center_of_mass) == (ORIGIN, IDENTITY, ORIGIN)
    if len(body.pieces) > 1 or not centred:
        return False
    match piece.shape:
        case Sphere(radius):
            inertia = sphere_inertia(body.mass, radius)
        case Box(half_extents):
            inertia = box_inertia(body.mass, half_extents)
        case _:
            return False
    return bool(np.allclose(inertia, body.inertia, rtol=INERTIA_TOLERANCE, atol=0.0))


def _largest(rows: list[tuple], field: int) -> float:
    return max((row[field] for row in rows), default=0.0)


def _body_facts(fact: tuple) -> BodyFacts:
    """Mass properties from Bullet's record of a link, rotated to the body axes."""
    # Bullet reports no axes for a rigid body: its inertia is along those of its shape.
    axes = np.eye(3) if fact[10] == RIGID_BODY else Rotation.from_quat(fact[4]).as_matrix()
    inertia = axes @ np.diag(fact[2]) @ axes.T
    return BodyFacts(fact[0], fact[3], tuple(tuple(row) for row in inertia.tolist()))

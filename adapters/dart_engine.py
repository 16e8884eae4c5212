"""DART 6 through dartpy: one World per scene, one Skeleton per body or per driven hand.

Conventions: rotations are matrices; `Quaternion.wxyz()` is ours. A BodyNode's frame is our body frame, the
centre of mass beside it; its velocities are asked for in world axes. A free joint's coordinates are angular,
then linear. A contact's normal goes from body 2 to body 1 and its force (world axes, friction included) acts
on body 1; depth is positive in overlap; the pair comes in any order. Contacts are those of the step's start;
force times dt is the impulse. Its point is the witnesses' midpoint with FCL (primitives; with meshes and
ellipsoids it may be off by the depth) and body 1's witness with Bullet, from which the midpoint follows.
External and joint forces act for one step: DART clears them at its end. Coefficients sit on shapes and mix
by product (restitution) and by minimum (friction). Boxes and ellipsoids are given by full sizes.

Hulls: dartpy 6.20 binds no ConvexMeshShape, and a MeshShape comes from a file only: the vertices pass through
a temporary OBJ file, deleted at once, and end in single precision. Every detector takes a MeshShape as a
triangle soup, a shell without an inside.

Detector: FCL, DART's default, wherever it works. FCL 0.7 gives a sphere against a triangle its depth with the
wrong sign and DART drops contacts of negative depth: a sphere passes through a hull. In place of a capsule
DART hands it a ball of 10 cm, and only prints an error. Scenes in which a sphere can meet a hull, or a
capsule anything, use DART's Bullet detector, exact for those; it makes ellipsoids 1 cm too large all round: a
scene that needs both is Unsupported.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import dartpy
import numpy as np
from scipy.spatial import ConvexHull

from adapters.drive import Drive
from adapters.engine import Array, BodyFacts, Manifest, PairFacts, Scalar, Settings, State, Unsupported
from adapters.mixing import frictions, minimum_factors, product_factors, restitutions
from adapters.registry import ENGINES
from scenarios.scenario import Body, Box, Capsule, Ellipsoid, Hull, Joint, Piece, Scenario, Sphere

ROOT_DOFS = 6
"""Coordinates of a free joint; those of the hinges follow in the tracker's order."""
UNREADABLE: dict[str, Scalar] = {
    # compiled in, no getter or setter in dartpy; from DART's ContactConstraint.cpp
    "contact_error_reduction": 0.01,
    "contact_error_reduction_velocity_max [m/s]": 0.001,
    "contact_force_mixing": 1e-5,
    "contact_error_allowance [m]": 0.0,
    "bounce_threshold, e v [m/s]": 0.1,
    "friction_cone": "two directions, each within mu times the normal force",
    "integrator": "semi-implicit Euler",
    "warm_starting": False,
}


class DartEngine:
    """DART with its default solver; the profiles differ in their step (1/1020: DART's 1 ms, fitted)."""

    name: ClassVar[str] = "dart"
    profiles: ClassVar[Mapping[str, float]] = ENGINES["dart"].profiles

    def build(self, scenario: Scenario, settings: Settings) -> World:
        """Translate a scenario; raises Unsupported where DART cannot represent it."""
        if settings.profile not in self.profiles:
            raise Unsupported(f"dart: no profile {settings.profile!r}; valid: {', '.join(self.profiles)}")
        return World(scenario, settings)

    def version(self) -> str:
        """The version of the loaded package."""
        return str(dartpy.__version__)


def _detector(scenario: Scenario) -> Any:
    """FCL, or Bullet where a sphere can meet a hull or a capsule anything."""
    reason = _fault_of_fcl(scenario)
    if not reason:
        return dartpy.collision.FCLCollisionDetector()
    shapes = _meeting_shapes(scenario)
    if any(Ellipsoid in a | b for a, b in shapes):
        raise Unsupported(f"dart: {reason}, and no detector has both that and true ellipsoids")
    return dartpy.collision.BulletCollisionDetector()


def _meeting_shapes(scenario: Scenario) -> list[tuple[set[type], set[type]]]:
    """Kinds of shape of the two bodies of each touching pair."""
    kinds = [{type(piece.shape) for piece in body.pieces} for body in scenario.bodies]
    return [(kinds[a], kinds[b]) for a, b in scenario.touching_pairs()]


def _fault_of_fcl(scenario: Scenario) -> str:
    """What of a scene DART's default detector gets wrong, or ""."""
    pairs = _meeting_shapes(scenario)
    if any(Capsule in a | b for a, b in pairs):
        return "capsules meet"
    spheres_on_hulls = any((Sphere in a and Hull in b) or (Hull in a and Sphere in b) for a, b in pairs)
    return "spheres meet hulls" if spheres_on_hulls else ""


def isometry(position: Any, orientation: Any) -> Any:
    """A pose, from a position [m] and a quaternion wxyz."""
    return dartpy.math.Isometry3(dartpy.math.Quaternion(*orientation), np.array(position, dtype=float))


def _set_solver(world: Any, scenario: Scenario, settings: Settings) -> None:
    """Every default on purpose: DART's own, but sleeping off."""
    world.setTimeStep(settings.dt)
    world.setGravity(np.array(scenario.acting_gravity))
    world.setNumSimulationThreads(1)
    deactivation = world.getDeactivationOptions()
    deactivation.mEnabled = False
    world.setDeactivationOptions(deactivation)
    world.setCollisionDetector(_detector(scenario))
    # dartpy has no constructors for LCP solvers: the world's own stay, and are published
    world.getConstraintSolver().setSplitImpulseEnabled(False)


def _set_mass(node: Any, body: Body) -> None:
    """Ours, not the shapes'; a fixed body has none and keeps DART's 1 kg, which nothing feels."""
    if body.kind != "fixed":
        center = np.array(body.center_of_mass)
        node.setInertia(dartpy.dynamics.Inertia(body.mass, center, np.array(body.inertia)))


def _add_body(world: Any, body: Body) -> Any:
    """A fixed or free body as a skeleton of its own."""
    skeleton = dartpy.dynamics.Skeleton(body.name)
    pose = isometry(body.position, body.orientation)
    if body.kind == "fixed":
        joint, node = skeleton.createWeldJointAndBodyNodePair()
        joint.setTransformFromParentBodyNode(pose)
    else:
        joint, node = skeleton.createFreeJointAndBodyNodePair()
        joint.setTransform(pose)
        omega = np.array(body.angular_velocity)
        arm = pose.rotation() @ np.array(body.center_of_mass)
        joint.setAngularVelocity(omega)
        joint.setLinearVelocity(np.array(body.linear_velocity) - np.cross(omega, arm))
    world.addSkeleton(skeleton)
    return node


def _add_driven(world: Any, scenario: Scenario, drive: Drive, hinges: list[Joint]) -> dict[int, Any]:
    """A driven body as one skeleton: its nodes per index in the scenario, weightless, posed at time 0."""
    skeleton = dartpy.dynamics.Skeleton(scenario.bodies[drive.links[0]].name)
    free, root = skeleton.createFreeJointAndBodyNodePair()
    free.setTransform(isometry(drive.start_position[0], drive.start_orientation[0]))
    free.setAngularVelocity(drive.start.angular_velocity[0])
    free.setLinearVelocity(drive.start.linear_velocity[0])
    nodes = {drive.links[0]: root}
    for link, hinge in zip(drive.links[1:], hinges):
        parent = nodes[scenario.body_index(hinge.parent)]
        joint, nodes[link] = skeleton.createRevoluteJointAndBodyNodePair(parent)
        # pose of the child = position, rotation(axis, q), orientation
        joint.setTransformFromParentBodyNode(isometry(hinge.position, (1.0, 0.0, 0.0, 0.0)))
        joint.setTransformFromChildBodyNode(isometry((0.0, 0.0, 0.0), hinge.orientation).inverse())
        joint.setAxis(np.array(hinge.axis))
        joint.setActuatorType(dartpy.dynamics.ActuatorType.FORCE)
        joint.setPositionLowerLimit(0, hinge.lower)
        joint.setPositionUpperLimit(0, hinge.upper)
        joint.setLimitEnforcement(True)
    dofs = range(ROOT_DOFS, ROOT_DOFS + len(hinges))
    skeleton.setPositions(dofs, drive.start.angle[0])
    skeleton.setVelocities(dofs, drive.start.rate[0])
    for node in nodes.values():
        node.setGravityMode(False)
    if "self_collision" in scenario.effects:
        skeleton.enableSelfCollisionCheck()
    world.addSkeleton(skeleton)
    return nodes


def add_piece(node: Any, piece: Piece, name: str, restitution: float, friction: float) -> None:
    match piece.shape:
        case Sphere():
            shape = _add_sphere(node, piece.shape, name)
        case Box():
            shape = _add_box(node, piece.shape, name)
        case Capsule():
            shape = _add_capsule(node, piece.shape, name)
        case Ellipsoid():
            shape = _add_ellipsoid(node, piece.shape, name)
        case Hull():
            shape = _add_hull(node, piece.shape, name)
        case _:
            raise Unsupported(f"dart: no shape {type(piece.shape).__name__}")
    shape.setRelativeTransform(isometry(piece.position, piece.orientation))
    shape.createCollisionAspect()
    shape.createDynamicsAspect()
    # sets both friction directions
    shape.getDynamicsAspect().setFrictionCoeff(friction)
    shape.getDynamicsAspect().setRestitutionCoeff(restitution)


def _add_sphere(node: Any, shape: Sphere, name: str) -> Any:
    return node.createShapeNode(dartpy.dynamics.SphereShape(shape.radius), name)


def _add_box(node: Any, shape: Box, name: str) -> Any:
    return node.createShapeNode(dartpy.dynamics.BoxShape(2 * np.array(shape.half_extents)), name)


def _add_capsule(node: Any, shape: Capsule, name: str) -> Any:
    return node.createShapeNode(dartpy.dynamics.CapsuleShape(shape.radius, 2 * shape.half_length), name)


def _add_ellipsoid(node: Any, shape: Ellipsoid, name: str) -> Any:
    return node.createShapeNode(dartpy.dynamics.EllipsoidShape(2 * np.array(shape.half_axes)), name)


def _add_hull(node: Any, shape: Hull, name: str) -> Any:
    """A MeshShape of the hull's triangles, turned outwards, by way of a file that is deleted at once."""
    hull = ConvexHull(np.array(shape.vertices))
    lines = ["v {!r} {!r} {!r}".format(*vertex) for vertex in shape.vertices]
    for triangle, outwards in zip(hull.simplices, hull.equations[:, :3]):
        p, q, r = hull.points[triangle]
        turned = triangle if np.cross(q - p, r - p) @ outwards > 0 else triangle[::-1]
        lines.append("f {} {} {}".format(*(turned + 1)))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "hull.obj"
        path.write_text("\n".join(lines) + "\n")
        mesh = f'<mesh filename="{path.as_uri()}"/>'
        link = f'<link name="l"><collision><geometry>{mesh}</geometry></collision></link>'
        urdf = f'<robot name="r">{link}</robot>'
        loaded = dartpy.utils.DartLoader().parseSkeletonString(urdf, dartpy.common.Uri(""))
        return node.createShapeNode(loaded.getBodyNode(0).getShapeNode(0).getShape(), name)


def _filter(world: Any, scenario: Scenario, nodes: list[Any]) -> None:
    """Blacklist every pair of bodies that may not touch."""
    # the option is handed out as a copy, the filter in it is the world's own
    blacklist = world.getConstraintSolver().getCollisionOption().collisionFilter
    allowed = set(scenario.touching_pairs())
    for b, second in enumerate(nodes):
        for a, first in enumerate(nodes[:b]):
            if (a, b) not in allowed:
                blacklist.addBodyNodePairToBlackList(first, second)


class World:
    """A dartpy World; `_nodes` holds a BodyNode per body of the scenario."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        self._scenario, self._settings = scenario, settings
        self._world = dartpy.simulation.World(scenario.name)
        _set_solver(self._world, scenario, settings)
        restitution = product_factors("dart", "restitution", scenario, restitutions(scenario))
        friction = minimum_factors("dart", "friction", scenario, frictions(scenario))
        self._drives = [Drive(scenario, tracker, settings.dt) for tracker in scenario.trackers]
        by_name = {joint.name: joint for joint in scenario.joints}
        nodes: dict[int, Any] = {}
        for drive, tracker in zip(self._drives, scenario.trackers):
            nodes |= _add_driven(self._world, scenario, drive, [by_name[name] for name in tracker.joints])
        for k, body in enumerate(scenario.bodies):
            if body.kind != "driven":
                nodes[k] = _add_body(self._world, body)
        self._nodes = [nodes[k] for k in range(len(scenario.bodies))]
        self._owner: dict[str, int] = {}
        for k, (node, body) in enumerate(zip(self._nodes, scenario.bodies)):
            _set_mass(node, body)
            for i, piece in enumerate(body.pieces):
                add_piece(node, piece, f"{k}.{i}", restitution[k], friction[k])
                self._owner[f"{k}.{i}"] = k
        _filter(self._world, scenario, self._nodes)
        detector = self._world.getConstraintSolver().getCollisionDetector().getType()
        self._to_midpoint = 0.5 if detector == "bullet" else 0.0
        self._roots = [self._nodes[drive.links[0]] for drive in self._drives]
        self._hands = [root.getSkeleton() for root in self._roots]
        self._force = np.full((len(self._drives), 3), np.nan)
        self._torque = np.full((len(self._drives), 3), np.nan)
        self._hinge_torque = [np.full(len(tracker.joints), np.nan) for tracker in scenario.trackers]

    def drive(self, step: int) -> None:
        """Force and torque at the root's origin in world axes, torques at the hinges."""
        for k, (drive, root, hand) in enumerate(zip(self._drives, self._roots, self._hands)):
            pose = root.getWorldTransform()
            self._force[k], self._torque[k] = drive.wrench(
                step,
                pose.translation(),
                pose.quaternion().wxyz(),
                root.getLinearVelocity(),
                root.getAngularVelocity(),
            )
            root.addExtForce(self._force[k])
            root.addExtTorque(self._torque[k], False)
            angle, rate = hand.getPositions()[ROOT_DOFS:], hand.getVelocities()[ROOT_DOFS:]
            self._hinge_torque[k] = drive.hinge_torques(step, angle, rate)
            hand.setForces(np.concatenate([np.zeros(ROOT_DOFS), self._hinge_torque[k]]))

    def step(self) -> None:
        """One World.step."""
        self._world.step()

    def read(self, state: State) -> None:
        """Poses and velocities of the step's end, contacts of its start."""
        for k, node in enumerate(self._nodes):
            pose = node.getWorldTransform()
            state.position[k], state.orientation[k] = pose.translation(), pose.quaternion().wxyz()
            state.linear_velocity[k] = node.getCOMLinearVelocity()
            state.angular_velocity[k] = node.getAngularVelocity()
        if self._hands:
            state.joint_angle[:] = np.concatenate([hand.getPositions()[ROOT_DOFS:] for hand in self._hands])
            state.joint_rate[:] = np.concatenate([hand.getVelocities()[ROOT_DOFS:] for hand in self._hands])
            state.hinge_torque[:] = np.concatenate(self._hinge_torque)
            state.force[:], state.torque[:] = self._force, self._torque
        state.clear_contacts()
        for contact in self._world.getLastCollisionResult().getContacts():
            first = self._owner[contact.collisionObject1.getShapeFrame().getName()]
            second = self._owner[contact.collisionObject2.getShapeFrame().getName()]
            normal, depth = contact.normal, contact.penetrationDepth
            point = contact.point + self._to_midpoint * depth * normal
            impulse = -self._settings.dt * contact.force
            state.add_contact(first, second, point, -normal, -depth, impulse)

    def describe(self) -> Manifest:
        """The manifest, as DART tells it."""
        names = [body.name for body in self._scenario.bodies]
        aspects = {k: self._aspect(k) for pair in self._scenario.touching_pairs() for k in pair}
        return Manifest(
            engine=DartEngine.name,
            version=str(dartpy.__version__),
            profile=self._settings.profile,
            dt=self._world.getTimeStep(),
            settings=self._facts(),
            bodies={
                body.name: _body_facts(node)
                for body, node in zip(self._scenario.bodies, self._nodes)
                if body.kind != "fixed"
            },
            pairs=tuple(
                PairFacts(
                    names[a],
                    names[b],
                    aspects[a].getRestitutionCoeff() * aspects[b].getRestitutionCoeff(),
                    min(aspects[a].getFrictionCoeff(), aspects[b].getFrictionCoeff()),
                )
                for a, b in self._scenario.touching_pairs()
            ),
            drives={tracker.root: d.gains() for tracker, d in zip(self._scenario.trackers, self._drives)},
        )

    def _aspect(self, body: int) -> Any:
        return self._nodes[body].getShapeNode(0).getDynamicsAspect()

    def _facts(self) -> dict[str, Scalar]:
        world, solver = self._world, self._world.getConstraintSolver()
        detector, option = solver.getCollisionDetector(), solver.getCollisionOption()
        hinges = [hand.getJoint(k) for hand in self._hands for k in range(1, hand.getNumJoints())]
        dofs = [
            (joint, k)
            for hand in self._hands
            for joint in hand.getJoints()
            for k in range(joint.getNumDofs())
        ]
        facts: dict[str, Scalar] = {
            "detector": detector.getType(),
            "detector_reason": _fault_of_fcl(self._scenario) or "DART's default",
            "solver": type(solver).__name__,
            "lcp_solver": solver.getBoxedLcpSolver().getType(),
            "lcp_solver_fallback": solver.getSecondaryBoxedLcpSolver().getType(),
            "matrix_free_solver": solver.getMatrixFreeContactSolverOptions().mEnabled,
            "split_impulse": solver.isSplitImpulseEnabled(),
            "contacts_max": option.maxNumContacts,
            "contacts_per_pair_max": option.getEffectiveMaxNumContactsPerPair(),
            "contacts_of_negative_depth": option.allowNegativePenetrationDepthContacts,
            "deactivation": world.getDeactivationOptions().mEnabled,
            "threads": world.getNumSimulationThreads(),
            "gravity": str(world.getGravity().tolist()),
            "driven_feel_gravity": any(
                n.getGravityMode() for hand in self._hands for n in hand.getBodyNodes()
            ),
            "joint_damping": max((joint.getDampingCoefficient(k) for joint, k in dofs), default=0.0),
            "joint_friction": max((joint.getCoulombFriction(k) for joint, k in dofs), default=0.0),
            "joint_stiffness": max((joint.getSpringStiffness(k) for joint, k in dofs), default=0.0),
            "hinges": len(hinges),
            "hinge_limits": sum(joint.areLimitsEnforced() for joint in hinges),
            "hull_vertex_type": "float32, triangle soup",
        }
        if detector.getType() == "fcl":
            facts["fcl_primitives"] = detector.getPrimitiveShapeType().name
            facts["fcl_contact_points"] = detector.getContactPointComputationMethod().name
        return facts | UNREADABLE

    def cross(self) -> None:
        """A getter of one number."""
        self._world.getTime()

    def stage_seconds(self) -> Mapping[str, float]:
        """DART has no timers."""
        return {}

    def work(self) -> Mapping[str, float]:
        """Contacts of the last step."""
        return {"contacts": self._world.getLastCollisionResult().getNumContacts()}

    def close(self) -> None:
        """Drop every reference into DART; its memory goes with the last one."""
        self._nodes, self._roots, self._hands = [], [], []
        self._world.removeAllSkeletons()


def _body_facts(node: Any) -> BodyFacts:
    rows: Array = node.getInertia().getMoment()
    return BodyFacts(node.getMass(), tuple(node.getLocalCOM().tolist()), tuple(map(tuple, rows.tolist())))

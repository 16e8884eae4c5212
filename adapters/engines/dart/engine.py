"""DART 6 through dartpy: one World per scene, one Skeleton per body or per driven hand.

Conventions: rotations are matrices; `Quaternion.wxyz()` is ours. A BodyNode's frame is our body frame, with
an offset centre of mass; its velocities are read in world axes. A free joint's coordinates are angular, then
linear. A contact's normal points from body 2 to body 1 and its force (world axes, friction included) acts on
body 1; depth is positive in overlap; the order of the pair varies. Contacts are those of the step's start;
force times dt is the impulse. With FCL a contact's point is the witnesses' midpoint (primitives; with meshes
and ellipsoids it may be off by the depth). With Bullet it is body 1's witness, from which we compute the
midpoint. External and joint forces act for one step: DART clears them at its end. Coefficients belong to
shapes; DART combines them by product (restitution) and by minimum (friction). Boxes and ellipsoids are given
by full sizes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import dartpy
import numpy as np

from touchstone.adapters.contract import Array, Manifest, Scalar, Settings, State
from touchstone.adapters.engines.dart.joints import add_mechanisms, couple_joints, push_motors
from touchstone.adapters.engines.dart.model import (
    DETECTORS,
    ROOT_DOFS,
    add_body,
    add_driven,
    add_kinematic,
    add_piece,
    add_servos,
    body_facts,
    detector_choice,
    detector_of,
    friction_solver,
    isometry,
    set_mass,
    solver_options,
)
from touchstone.adapters.engines.dart.settings import SETTINGS
from touchstone.adapters.engines.scene_world import SceneWorld
from touchstone.adapters.material_combine import (
    check_range,
    frictions,
    minimum_factors,
    product_factors,
    restitutions,
)
from touchstone.adapters.posed_drive import moving_surfaces
from touchstone.adapters.registry import ENGINES, require_profile
from touchstone.adapters.servo import ROOT_DRIVES, simulated_masses
from touchstone.scenarios.scenario import UNMOVED, Scenario

COEFFICIENT_MIN = 1e-3
"""Restitution and friction up to this value count as zero in DART (ContactSurface.hpp) [1]."""
FRICTION_CONES = {
    "DantzigBoxedLcpSolver": "two directions, each within mu times the normal force",
    "PgsBoxedLcpSolver": "two directions, each within mu times the normal force",
    "NsgsFrictionSolver": "circular",
    "FbfFrictionSolver": "circular",
}
"""Friction cone of a contact under each solver."""
HINGE_DRIVES = {
    "native": "implicit springs and dampers",
    "torque": "explicit torques",
    "posed": "none: links have prescribed velocities",
}
UNREADABLE: dict[str, Scalar] = {
    # Compiled in, without getter or setter in dartpy; from DART's ContactConstraint.cpp.
    "contact_error_reduction": 0.01,
    "contact_error_reduction_velocity_max [m/s]": 0.001,
    "contact_force_mixing": 1e-5,
    "contact_error_allowance [m]": 0.0,
    "bounce_threshold, e v [m/s]": 0.1,
    "integrator": "semi-implicit Euler",
    "warm_starting": False,
}


class DartEngine:
    """DART with its default solver at its own step (1/1020 s: DART's 1 ms, fitted to a frame) or another's;
    `accurate` uses the exact friction cone."""

    name: ClassVar[str] = "dart"
    profiles: ClassVar[Mapping[str, float]] = ENGINES["dart"].profiles
    plays_body_joints: ClassVar[bool] = True

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        return World(scenario, settings)

    def version(self) -> str:
        return str(dartpy.__version__)


def _set_solver(world: Any, scenario: Scenario, settings: Settings) -> None:
    """Set every default explicitly; values are DART's own, except in profiles."""
    world.setTimeStep(settings.dt)
    world.setGravity(np.array(scenario.acting_gravity))
    world.setNumSimulationThreads(1)
    deactivation = world.getDeactivationOptions()
    values = SETTINGS.in_force(settings.profile, settings.changes)
    deactivation.mEnabled = settings.sleeping or bool(values["sleep"])
    world.setDeactivationOptions(deactivation)
    detector = str(SETTINGS["detector"].word(values["detector"])) if "detector" in values else ""
    world.setCollisionDetector(DETECTORS[detector]() if detector else detector_of(scenario, settings.profile))
    solver = world.getConstraintSolver()
    solver.setSplitImpulseEnabled(bool(values["split_impulse"]))
    option = solver.getMatrixFreeContactSolverOptions()
    option.mEnabled = bool(values["matrix_free"])
    solver.setMatrixFreeContactSolverOptions(option)
    name = SETTINGS["solver"].word(values["solver"])
    options = values.get("iterations"), values.get("tolerance")
    if name != "dantzig" or any(option is not None for option in options):
        solver.setBoxedLcpSolver(friction_solver(solver, str(name), *options))


def _filter(world: Any, scenario: Scenario, nodes: list[Any]) -> None:
    """Exclude every pair of bodies that may not touch from collision."""
    # dartpy returns the option as a copy, but the filter in it is the world's own.
    blacklist = world.getConstraintSolver().getCollisionOption().collisionFilter
    allowed = set(scenario.touching_pairs())
    for b, second in enumerate(nodes):
        for a, first in enumerate(nodes[:b]):
            if (a, b) not in allowed:
                blacklist.addBodyNodePairToBlackList(first, second)


def _hinges(hand: Any) -> list[tuple[Any, float, float]]:
    """Joints of a skeleton after the root's, with their limits [rad], in the order of the tracker."""
    joints = [hand.getJoint(number) for number in range(1, hand.getNumJoints())]
    return [(one, one.getPositionLowerLimit(0), one.getPositionUpperLimit(0)) for one in joints]


class World(SceneWorld):
    """A dartpy World; `_nodes` holds a BodyNode per body of the scenario."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        surfaces = moving_surfaces("dart", scenario, settings)
        super().__init__(DartEngine(), scenario, settings, surfaces=surfaces)
        self._world = dartpy.simulation.World(scenario.name)
        _set_solver(self._world, scenario, settings)
        asked = {"restitution": restitutions(scenario), "friction": frictions(scenario)}
        for kind, wanted in asked.items():
            check_range("dart", kind, scenario, wanted, least=COEFFICIENT_MIN)
        restitution = product_factors("dart", "restitution", scenario, asked["restitution"], greatest=1.0)
        friction = minimum_factors("dart", "friction", scenario, asked["friction"])
        by_name = {joint.name: joint for joint in scenario.joints}
        nodes: dict[int, Any] = {}
        for one, _ in self._posed:
            nodes |= {link: add_kinematic(self._world, scenario.bodies[link]) for link in one.links}
        for drive, tracker in zip(self._drives, self._trackers):
            nodes |= add_driven(self._world, scenario, drive, [by_name[name] for name in tracker.joints])
        joined = add_mechanisms(self._world, scenario)
        nodes |= joined.nodes
        self._motors = joined.motors
        for k, body in enumerate(scenario.bodies):
            if k not in nodes:
                nodes[k] = add_body(self._world, body)
        self._nodes = [nodes[k] for k in range(len(scenario.bodies))]
        self._moving = [(k, nodes[k]) for k, body in enumerate(scenario.bodies) if body.kind != "fixed"]
        # Poses of fixed bodies, read once.
        poses = [node.getWorldTransform() for node in self._nodes]
        self._position = np.array([pose.translation() for pose in poses])
        self._orientation = np.array([pose.quaternion().wxyz() for pose in poses])
        masses = simulated_masses(scenario, self._drives)
        self._body_of: dict[Any, int] = {node: k for k, node in enumerate(self._nodes)}
        for k, (node, body) in enumerate(zip(self._nodes, scenario.bodies)):
            if body.kind not in UNMOVED:  # others keep DART's 1 kg, without effect
                set_mass(node, masses[k])
            for i, piece in enumerate(body.pieces):
                add_piece(node, piece, f"{k}.{i}", restitution[k], friction[k])
        couple_joints(scenario, joined)
        _filter(self._world, scenario, self._nodes)
        detector = self._world.getConstraintSolver().getCollisionDetector().getType()
        self._to_midpoint = 0.5 if detector == "bullet" else 0.0
        self._roots = [self._nodes[drive.links[0]] for drive in self._drives]
        self._hands = [root.getSkeleton() for root in self._roots]
        self._hinge_torque = [np.full(len(tracker.joints), np.nan) for tracker in self._trackers]
        self._native = settings.drive == "native"
        self._changed = [np.zeros(ROOT_DOFS + len(one)) for one in self._hinge_torque]
        self._set_point = [(np.full_like(one, np.nan),) * 2 for one in self._hinge_torque]
        if self._native:
            for drive, hand in zip(self._drives, self._hands):
                add_servos(hand, drive)
        self._hinges = [_hinges(hand) for hand in self._hands]

    def drive(self, step: int) -> None:
        """Apply force and torque at the root's origin in world axes, and command the hinges' servos or
        torques; set poses and velocities of kinematic links and prescribed bodies."""
        self._moment = step + 1
        self._move_posed()
        push_motors(self._motors)
        for k, (drive, root, hand) in enumerate(zip(self._drives, self._roots, self._hands)):
            pose = root.getWorldTransform()
            force, torque = drive.wrench(
                step,
                pose.translation(),
                pose.quaternion().wxyz(),
                root.getLinearVelocity(),
                root.getAngularVelocity(),
            )
            root.addExtForce(force)
            root.addExtTorque(torque, False)
            angle, rate = hand.getPositions()[ROOT_DOFS:], hand.getVelocities()[ROOT_DOFS:]
            if self._native:
                self._changed[k] = np.array(hand.getVelocityChanges())
                self._set_point[k] = drive.target.angle[step], drive.target.rate[step]
                for target, (joint, low, high) in zip(drive.target.angle[step].tolist(), self._hinges[k]):
                    # DART rejects a rest position beyond the limits.
                    joint.setRestPosition(0, min(max(target, low), high))
                torques = drive.servo_damping * drive.target.rate[step]
            else:
                torques = self._hinge_torque[k] = drive.hinge_torques(step, angle, rate)
            hand.setForces(np.concatenate([np.zeros(ROOT_DOFS), torques]))

    def _move_posed(self) -> None:
        """Move kinematic and prescribed bodies from their poses at the step's start to those at its end."""
        step = self._moment - 1
        for posed, _ in self._posed:
            for k, link in enumerate(posed.links):
                joint = self._nodes[link].getParentJoint()
                joint.setTransform(isometry(posed.place[k, step], posed.orientation[k, step]))
                velocity = (posed.place[k, step + 1] - posed.place[k, step]) / self._settings.dt
                joint.setAngularVelocity(posed.omega[k, step] + posed.surface_omega[k, step])
                joint.setLinearVelocity(velocity + posed.surface_velocity[k, step])
                joint.setCommands(joint.getVelocities())

    def step(self) -> None:
        self._world.step()

    def read(self, state: State) -> None:
        """Read poses and velocities of the step's end, and contacts of its start."""
        state.position[:], state.orientation[:] = self._position, self._orientation
        for k, node in self._moving:
            pose = node.getWorldTransform()
            state.position[k], state.orientation[k] = pose.translation(), pose.quaternion().wxyz()
            state.linear_velocity[k] = node.getCOMLinearVelocity()
            state.angular_velocity[k] = node.getAngularVelocity()
        self._show_posed(state)
        if self._hands:
            moved = [(hand.getPositions(), hand.getVelocities()) for hand in self._hands]
            self._write_hinges(state, [(q[ROOT_DOFS:], rate[ROOT_DOFS:]) for q, rate in moved])
            state.hinge_torque[:] = np.concatenate([self._hinge_torques(k) for k in range(len(self._hands))])
            for k, drive, root in zip(self._coupled, self._drives, self._roots):
                drive.read(state, k, root.getLinearVelocity(), root.getAngularVelocity())
        state.clear_contacts()
        if contacts := self._world.getLastCollisionResult().getContacts():
            self._add_contacts(contacts, state)

    def _add_contacts(self, contacts: list[Any], state: State) -> None:
        sides = zip(*((one.collisionObject1, one.collisionObject2) for one in contacts))
        nodes = ([one.getShapeFrame().getBodyNodePtr() for one in side] for side in sides)
        first, second = (np.array([self._body_of[node] for node in side]) for side in nodes)
        normal = np.array([contact.normal for contact in contacts])
        depth = np.array([contact.penetrationDepth for contact in contacts])
        point = np.array([contact.point for contact in contacts])
        point += (self._to_midpoint * depth)[:, None] * normal
        impulse = -self._settings.dt * np.array([contact.force for contact in contacts])
        state.add_contacts(first, second, point, -normal, -depth, impulse)

    def _hinge_torques(self, tracker: int) -> Array:
        """Torques on the hinges of a tracker during the last step (j,) [N m].

        DART evaluates springs and dampers at the end of the step as it would be without the impulses of
        contacts and limits.
        """
        if not self._native:
            return self._hinge_torque[tracker]
        hand, drive, dt = self._hands[tracker], self._drives[tracker], self._settings.dt
        angle, rate = self._set_point[tracker]
        changed = np.array(hand.getVelocityChanges())
        # After a step without impulses, DART still holds the changes of an earlier step.
        changed = np.where(np.array_equal(changed, self._changed[tracker]), 0.0, changed)[ROOT_DOFS:]
        error = angle - hand.getPositions()[ROOT_DOFS:] + dt * changed
        error_rate = rate - hand.getVelocities()[ROOT_DOFS:] + changed
        return drive.servo_stiffness * error + drive.servo_damping * error_rate

    def describe(self) -> Manifest:
        world, bodies = self._world, zip(self._scenario.bodies, self._nodes)
        return self._manifest(
            self._facts(),
            {body.name: body_facts(node) for body, node in bodies if body.kind not in UNMOVED},
            self._pair_facts(self._combined),
            [node.getNumShapeNodes() for node in self._nodes],
            dt=world.getTimeStep(),
            limits=self._limits(),
            freedom=sum(world.getSkeleton(k).getNumDofs() for k in range(world.getNumSkeletons()))
            - 6 * sum(one.prescribed for one, _ in self._posed),
        )

    def _limits(self) -> dict[str, tuple[float, float]]:
        names = [name for tracker in self._trackers for name in tracker.joints]
        hinges = [hinge for hand in self._hands for hinge in _hinges(hand)]
        return {name: (low, high) for name, (_, low, high) in zip(names, hinges)}

    def _combined(self, a: int, b: int) -> tuple[float, float]:
        one, two = (self._nodes[body].getShapeNode(0).getDynamicsAspect() for body in (a, b))
        friction = min(one.getFrictionCoeff(), two.getFrictionCoeff())
        return one.getRestitutionCoeff() * two.getRestitutionCoeff(), friction

    def _facts(self) -> dict[str, Scalar]:
        world, solver = self._world, self._world.getConstraintSolver()
        detector, option = solver.getCollisionDetector(), solver.getCollisionOption()
        deactivation = world.getDeactivationOptions()
        hinges = [hand.getJoint(k) for hand in self._hands for k in range(1, hand.getNumJoints())]
        dofs = [
            (joint, k)
            for hand in self._hands
            for joint in hand.getJoints()
            for k in range(joint.getNumDofs())
        ]
        facts: dict[str, Scalar] = {
            "detector": detector.getType(),
            "detector_reason": self._detector_reason(),
            "solver": type(solver).__name__,
            "lcp_solver": solver.getBoxedLcpSolver().getType(),
            "friction_cone": FRICTION_CONES[solver.getBoxedLcpSolver().getType()],
            **solver_options(solver.getBoxedLcpSolver()),
            "lcp_solver_fallback": solver.getSecondaryBoxedLcpSolver().getType(),
            "matrix_free_solver": solver.getMatrixFreeContactSolverOptions().mEnabled,
            "split_impulse": solver.isSplitImpulseEnabled(),
            "contacts_max": option.maxNumContacts,
            "contacts_per_pair_max": option.getEffectiveMaxNumContactsPerPair(),
            "contacts_of_negative_depth": option.allowNegativePenetrationDepthContacts,
            "deactivation": deactivation.mEnabled,
            "deactivation_speed [m/s]": deactivation.mLinearSpeedThreshold,
            "deactivation_rate [rad/s]": deactivation.mAngularSpeedThreshold,
            "deactivation_time [s]": deactivation.mTimeUntilSleep,
            "deactivation_wake_factor": deactivation.mWakeThresholdScale,
            "threads": world.getNumSimulationThreads(),
            "collision_shapes": sum(
                shape.hasCollisionAspect()
                for k in range(world.getNumSkeletons())
                for body in world.getSkeleton(k).getBodyNodes()
                for shape in body.getShapeNodes()
            ),
            "gravity": str(world.getGravity().tolist()),
            "driven_feel_gravity": any(
                n.getGravityMode() for hand in self._hands for n in hand.getBodyNodes()
            ),
            "joint_damping": max((joint.getDampingCoefficient(k) for joint, k in dofs), default=0.0),
            "joint_friction": max((joint.getCoulombFriction(k) for joint, k in dofs), default=0.0),
            "joint_stiffness": max((joint.getSpringStiffness(k) for joint, k in dofs), default=0.0),
            "hinges": len(hinges),
            "root_drive": ROOT_DRIVES[self._settings.drive],
            "hinge_drive": HINGE_DRIVES[self._settings.drive],
            "hinge_limits": sum(joint.areLimitsEnforced() for joint in hinges),
            "hull_vertex_type": "float32, triangle soup",
        }
        if detector.getType() == "fcl":
            facts["fcl_primitives"] = detector.getPrimitiveShapeType().name
            facts["fcl_contact_points"] = detector.getContactPointComputationMethod().name
        return facts | UNREADABLE

    def _detector_reason(self) -> str:
        if "detector" in SETTINGS.numbers(self._settings.changes):
            return "chosen"
        return detector_choice(self._scenario, self._settings.profile)[1]

    def cross(self) -> None:
        self._world.getTime()

    def work(self) -> Mapping[str, float]:
        return {"contacts": self._world.getLastCollisionResult().getNumContacts()}

    def close(self) -> None:
        self._nodes, self._moving, self._roots, self._hands, self._body_of = [], [], [], [], {}
        self._motors = []
        self._world.removeAllSkeletons()

"""Drake through pydrake: one MultibodyPlant per scene, stepped by its discrete solver.

Conventions: quaternions are wxyz and boxes have full sides. A body's velocity is that of its *origin*, along
world axes. A contact's `nhat_BA` points from B to A and its force acts on B; depth is positive in overlap; A
and B are ordered by Drake. Contact results are those of the last step, with the geometry of its start; force
times dt is the impulse. Friction is combined harmonically (2 f g / (f + g)); there is no restitution.

Profiles, at Drake's default step of 1 ms: `recommended` has hydroelastic contact, which Drake's
documentation recommends for faces: surfaces on which the pressure fields of two compliant bodies are equal,
with SceneGraph's defaults, 1e7 Pa and meshes of 2 cm. Each surface is recorded as one contact at its centre
of pressure. Balls, capsules and ellipsoids have no pressure field, and meet everything in points. `default`
has geometries as they come, without pressure fields, and thus one point for each pair of pieces: 1e6 N/m of
each geometry, 5e5 N/m of a contact, whatever the masses. Both have the default approximation (`lagged`:
Hunt-Crossley dissipation of 50 s/m, friction bounded by the normal force of the step before). `sap` is
`default` with the convex approximation that gives the SAP solver its name and 0.1 s of relaxation, `tamsi`
with the TAMSI solver, which Drake deprecates. `cenic` is hydroelastic contact in a plant without steps of
its own: the CENIC integrator chooses them by its accuracy, within 1/240 s; in impulses the force at the end
stands for the whole step.
https://drake.mit.edu/doxygen_cxx/group__multibody__simulation.html
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, ClassVar

import numpy as np
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce, SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CalcContactFrictionFromSurfaceProperties,
    ExternallyAppliedSpatialForce,
)
from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
from pydrake.systems.framework import DiagramBuilder

from touchstone.adapters.contract import (
    Array,
    BodyFacts,
    Manifest,
    Scalar,
    Settings,
    State,
    Unsupported,
)
from touchstone.adapters.engines.drake import CENIC, ENTRY, TAMSI
from touchstone.adapters.engines.drake.model import (
    Geometries,
    add_hinge,
    add_pieces,
    add_servos,
    check_restitution,
    contact_facts,
    filter_pairs,
    harmonic_factors,
    hydroelastic_of,
    inertia_of,
    set_contact_model,
    start_of,
    transform,
    word_of,
)
from touchstone.adapters.engines.scene_world import SceneWorld
from touchstone.adapters.material_combine import frictions
from touchstone.adapters.registry import require_profile
from touchstone.adapters.servo import ROOT_DRIVES, simulated_masses
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.scenario import Scenario


class DrakeEngine:
    """Drake with hydroelastic or point contacts, in a discrete plant or under the CENIC integrator."""

    name: ClassVar[str] = "drake"
    profiles: ClassVar[Mapping[str, float]] = ENTRY.profiles

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        if settings.drive == "posed" and scenario.trackers:
            raise Unsupported("drake: no kinematic links in a discrete plant; choose --drive native")
        if any(map(scenario.prescribes, scenario.trackers)):
            raise Unsupported("drake: no prescribed bodies in a discrete plant")
        if any(map(surface_moves, scenario.bodies)):
            raise Unsupported("drake: no moving surfaces in a discrete plant")
        if word_of(settings, "approximation") == TAMSI and scenario.trackers and settings.drive == "native":
            raise Unsupported("drake: TAMSI has no position servos; choose the profile recommended")
        if word_of(settings, "integrator") == CENIC and scenario.trackers:
            raise Unsupported("drake: driven bodies diverge under CENIC; choose the profile recommended")
        check_restitution(scenario)
        return World(scenario, settings)

    def version(self) -> str:
        return version("drake")


class World(SceneWorld):
    """A plant, its diagram and simulator. `bodies` has Drake's body per body of the scenario; None: fixed."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        super().__init__(DrakeEngine(), scenario, settings)
        builder, variable = DiagramBuilder(), word_of(settings, "integrator") == CENIC
        step = 0.0 if variable else settings.dt
        self._plant, scene_graph = AddMultibodyPlantSceneGraph(builder, time_step=step)
        self._build(scene_graph)
        self._diagram = builder.Build()
        self._root_context = self._diagram.CreateDefaultContext()
        self._context = self._plant.GetMyMutableContextFromRoot(self._root_context)
        self._set_initial_state()
        self._simulator = Simulator(self._diagram, self._root_context)
        if variable:
            accuracy = float(word_of(settings, "accuracy"))
            config = SimulatorConfig(integration_scheme=CENIC, accuracy=accuracy, max_step_size=settings.dt)
            ApplySimulatorConfig(config, self._simulator)
        self._results = self._plant.get_contact_results_output_port()
        self._steps = 0
        self.drive(0)
        self._simulator.Initialize()

    def _build(self, scene_graph: Any) -> None:
        scenario, settings, plant = self._scenario, self._settings, self._plant
        set_contact_model(plant, scene_graph, settings)
        plant.mutable_gravity_field().set_gravity_vector(np.array(scenario.acting_gravity))
        factors = harmonic_factors(scenario, frictions(scenario))
        driven = [plant.AddModelInstance(f"driven {k}") for k in range(len(scenario.trackers))]
        for instance in driven:
            plant.set_gravity_enabled(instance, False)
        free = plant.AddModelInstance("simulated")
        groups, geometries, fields = scenario.groups(), Geometries(), hydroelastic_of(settings)
        masses = simulated_masses(scenario, self._drives)
        self._bodies: list[Any] = []
        for k, body in enumerate(scenario.bodies):
            if body.kind == "fixed":
                self._bodies.append(None)
                geometries[k] = add_pieces(plant, plant.world_body(), body, factors[k], True, fields)
                continue
            instance = driven[groups[k]] if groups[k] >= 0 else free
            self._bodies.append(plant.AddRigidBody(body.name, instance, inertia_of(masses[k])))
            geometries[k] = add_pieces(plant, self._bodies[k], body, factors[k], False, fields)
        self._index = {one: k for k, ids in geometries.items() for one in ids}
        self._geometries = geometries
        filter_pairs(plant, scene_graph, scenario, geometries)
        self._add_drives()
        plant.Finalize()
        self._inspector, self._scene_graph = scene_graph.model_inspector(), scene_graph
        self._driven = driven

    def _add_drives(self) -> None:
        scenario = self._scenario
        by_name = {body.name: drake for body, drake in zip(scenario.bodies, self._bodies)}
        joints = {joint.name: joint for joint in scenario.joints}
        self._hinges = []
        for drive, tracker in zip(self._drives, scenario.trackers):
            hinges = [add_hinge(self._plant, by_name, joints[name]) for name in tracker.joints]
            if self._settings.drive == "native":
                add_servos(self._plant, hinges, drive)
            self._hinges.append(hinges)

    def _set_initial_state(self) -> None:
        context, plant = self._context, self._plant
        for body, drake in zip(self._scenario.bodies, self._bodies):
            if body.kind != "simulated":
                continue
            pose, omega, velocity = start_of(body)
            self._place(drake, pose)
            self._move(drake, omega, velocity)
        for drive, hinges in zip(self._drives, self._hinges):
            root = self._bodies[drive.links[0]]
            self._place(root, transform(drive.start_position[0], drive.start_orientation[0]))
            self._move(root, drive.start.angular_velocity[0], drive.start.linear_velocity[0])
            for hinge, angle, rate in zip(hinges, drive.start.angle[0], drive.start.rate[0]):
                hinge.set_angle(context, angle)
                hinge.set_angular_rate(context, rate)
        plant.ValidateContext(context)

    def _place(self, body: Any, pose: RigidTransform) -> None:
        self._plant.SetFreeBodyPose(self._context, body, pose)

    def _move(self, body: Any, omega: Array, velocity: Array) -> None:
        self._plant.SetFreeBodySpatialVelocity(self._context, body, SpatialVelocity(omega, velocity))

    def drive(self, step: int) -> None:
        """Apply each root's wrench and set the target of its servos, or the torques of its hinges."""
        plant, context, forces = self._plant, self._context, []
        self._applied: list[Array] = []
        torques = np.zeros(plant.num_velocities())
        for k, drive in enumerate(self._drives):
            root = self._bodies[drive.links[0]]
            pose, moved = self._pose(root), plant.EvalBodySpatialVelocityInWorld(context, root)
            turn = pose.rotation().ToQuaternion().wxyz()
            motion = moved.translational(), moved.rotational()
            force, torque = drive.wrench(step, pose.translation(), turn, *motion)
            self._applied += [force, torque]
            applied = ExternallyAppliedSpatialForce()
            applied.body_index, applied.p_BoBq_B = root.index(), np.zeros(3)
            applied.F_Bq_W = SpatialForce(tau=torque, f=force)
            forces.append(applied)
            if not self._hinges[k]:
                continue
            if self._settings.drive == "native":
                target = np.concatenate([drive.target.angle[step], drive.target.rate[step]])
                plant.get_desired_state_input_port(self._driven[k]).FixValue(context, target)
            else:
                angle, rate = self._hinge_state(k)
                for hinge, torque in zip(self._hinges[k], drive.hinge_torques(step, angle, rate)):
                    torques[hinge.velocity_start()] = torque
        if self._drives:
            plant.get_applied_spatial_force_input_port().FixValue(context, AbstractValue.Make(forces))
            if self._settings.drive != "native":
                plant.get_applied_generalized_force_input_port().FixValue(context, torques)
                self._hinge_torque = torques

    def applied(self) -> Array:
        """Force [N] and torque [N m] that the last `drive` set on each root (6 d,)."""
        return np.concatenate(self._applied)

    def step(self) -> None:
        self._steps += 1
        self._simulator.AdvanceTo(self._steps * self._settings.dt)

    def read(self, state: State) -> None:
        """Read poses and velocities of the step's end, and the contacts that acted in it."""
        plant, context = self._plant, self._context
        for k, (body, drake) in enumerate(zip(self._scenario.bodies, self._bodies)):
            if drake is None:
                state.position[k], state.orientation[k] = body.position, body.orientation
                state.linear_velocity[k] = state.angular_velocity[k] = 0.0
                continue
            pose, moved = self._pose(drake), plant.EvalBodySpatialVelocityInWorld(context, drake)
            arm, omega = pose.rotation() @ np.array(body.center_of_mass), moved.rotational()
            state.position[k] = pose.translation()
            state.orientation[k] = pose.rotation().ToQuaternion().wxyz()
            state.linear_velocity[k] = moved.translational() + np.cross(omega, arm)
            state.angular_velocity[k] = omega
        self._read_contacts(state)
        if self._drives:
            self._write_hinges(state, [self._hinge_state(k) for k in range(len(self._drives))])
            for k, drive in enumerate(self._drives):
                moved = plant.EvalBodySpatialVelocityInWorld(context, self._bodies[drive.links[0]])
                drive.read(state, k, moved.translational(), moved.rotational())
            state.hinge_torque[:] = self._hinge_torques()

    def _read_contacts(self, state: State) -> None:
        state.clear_contacts()
        if not self._steps:
            return
        results = self._results.Eval(self._context)
        for k in range(results.num_point_pair_contacts()):
            contact = results.point_pair_contact_info(k)
            pair = contact.point_pair()
            state.add_contact(
                self._index[pair.id_A],
                self._index[pair.id_B],
                (pair.p_WCa + pair.p_WCb) / 2,
                -pair.nhat_BA_W,
                -pair.depth,
                contact.contact_force() * self._settings.dt,
            )
        for k in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(k)
            surface, force = info.contact_surface(), info.F_Ac_W()
            a, b = self._index[surface.id_M()], self._index[surface.id_N()]
            place = surface.centroid() + _arm(force.translational(), force.rotational())
            normal, depth = _main_face(surface)
            state.add_contact(a, b, place, normal, -depth, -force.translational() * self._settings.dt)

    def _pose(self, body: Any) -> RigidTransform:
        return self._plant.EvalBodyPoseInWorld(self._context, body)

    def _hinge_state(self, tracker: int) -> tuple[Array, Array]:
        """Angles [rad] and rates [rad/s] of a tracker's hinges."""
        hinges, context = self._hinges[tracker], self._context
        angles = np.array([hinge.get_angle(context) for hinge in hinges])
        return angles, np.array([hinge.get_angular_rate(context) for hinge in hinges])

    def _hinge_torques(self) -> Array:
        hinges = [hinge for each in self._hinges for hinge in each]
        if not hinges:
            return np.zeros(0)
        if self._settings.drive != "native":
            return np.array([self._hinge_torque[hinge.velocity_start()] for hinge in hinges])
        torque: Array = self._plant.get_net_actuation_output_port().Eval(self._context)
        return torque

    def describe(self) -> Manifest:
        scenario, plant = self._scenario, self._plant
        facts = {
            body.name: _body_facts(drake)
            for body, drake in zip(scenario.bodies, self._bodies)
            if drake is not None
        }
        return self._manifest(
            self._facts(),
            facts,
            self._pair_facts(self._combined),
            [len(self._geometries[k]) for k in range(len(scenario.bodies))],
            limits={
                hinge.name(): (float(hinge.position_lower_limit()), float(hinge.position_upper_limit()))
                for hinges in self._hinges
                for hinge in hinges
            },
            freedom=int(plant.num_velocities()),
        )

    def _facts(self) -> dict[str, Scalar]:
        plant = self._plant
        return {
            **contact_facts(plant, self._scene_graph, self._settings),
            **self._integrator_facts(),
            "gravity_vector": str(plant.gravity_field().gravity_vector().tolist()),
            "root_drive": ROOT_DRIVES[self._settings.drive],
            "actuators": int(plant.num_actuators()),
            "collision_shapes": len(self._index),
        }

    def _integrator_facts(self) -> dict[str, Scalar]:
        if self._plant.time_step() > 0:
            return {"integrator": "discrete"}
        accuracy = float(self._simulator.get_integrator().get_target_accuracy())
        return {"integrator": CENIC, "accuracy": accuracy}

    def _combined(self, a: int, b: int) -> tuple[float, float]:
        """Restitution, which Drake has not, and friction of two bodies as it combines it."""
        properties = (self._inspector.GetProximityProperties(self._geometries[k][0]) for k in (a, b))
        surfaces = (one.GetProperty("material", "coulomb_friction") for one in properties)
        return 0.0, float(CalcContactFrictionFromSurfaceProperties(*surfaces).dynamic_friction())

    def cross(self) -> None:
        self._plant.time_step()

    def close(self) -> None:
        del self._simulator, self._results, self._context, self._root_context, self._diagram


def _arm(force: Array, torque: Array) -> Array:
    """Shortest way [m] from the point of a torque [N m] to the line along which the force [N] acts."""
    square = float(force @ force)
    return np.cross(force, torque) / square if square > 0 else np.zeros(3)


def _main_face(surface: Any) -> tuple[Array, float]:
    """Normal from M to N of the largest face of a contact surface, and the depth [m] at its middle: how far
    both pressure fields are entered there."""
    face = max(range(surface.num_faces()), key=surface.area)
    field = surface.tri_e_MN() if surface.is_triangle() else surface.poly_e_MN()
    pressure = field.EvaluateCartesian(face, surface.centroid(face))
    slopes = (surface.EvaluateGradE_M_W(face), surface.EvaluateGradE_N_W(face))
    return -surface.face_normal(face), sum(pressure / float(np.linalg.norm(slope)) for slope in slopes)


def _body_facts(body: Any) -> BodyFacts:
    """Mass, mass centre and central inertia of a Drake body."""
    spatial = body.default_spatial_inertia()
    central = spatial.Shift(spatial.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    return BodyFacts.of(spatial.get_mass(), spatial.get_com(), central)

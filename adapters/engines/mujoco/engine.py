"""Engine interface of MuJoCo 4.

Conventions: quaternions are wxyz, sizes are half sizes and distances are negative in overlap, as ours. A
contact's normal points from geom[0] to geom[1] and its force, in the axes (normal, tangent, tangent), acts on
geom[1]. MuJoCo orders the two geoms by type (a sphere comes before a box), so each geom is mapped back to its
body and `State.add_contact` flips the contact if needed. `pos` is the midpoint of the witnesses. Contacts and
forces are those of the start of the step: force times dt is the impulse. A free joint's qvel holds the world
velocity of the body's *origin* and the angular velocity along the *body's* axes; `cvel` is taken at the
subtree's centre of mass. A hinge's axis is in the child's frame. `xpos` lags behind `qpos` after a step:
`read` runs the kinematics again, which does not change the state. `contacts.py` sets e and mu.

Contacts do not use the velocity of a mocap body: a box on an accelerating one feels no friction from its
motion. A prescribed body is therefore a heavy free body. Each step sets its pose, its velocity, and the force
that moves it to its next pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import mujoco
import numpy as np

from touchstone.adapters.contract import (
    AdapterError,
    Array,
    BodyFacts,
    Manifest,
    Scalar,
    Settings,
    State,
    Unsupported,
)
from touchstone.adapters.engines.mujoco.contacts import add_contacts, contact_parameters, restitution_of
from touchstone.adapters.engines.mujoco.joints import (
    add_loops_and_motors,
    inverse,
    start_rates,
    turned,
)
from touchstone.adapters.engines.mujoco.model import (
    add_bodies,
    add_servos,
    hear_warnings,
    prescribed_mass,
    set_options,
)
from touchstone.adapters.engines.scene_world import SceneWorld, drives_of
from touchstone.adapters.posed_drive import Posed, coupled
from touchstone.adapters.registry import ENGINES, require_profile
from touchstone.adapters.servo import ROOT_DRIVES, Drive, simulated_masses
from touchstone.adapters.vector_products import cross
from touchstone.scenarios.body_joints import spanning_trees
from touchstone.scenarios.scenario import Scenario

OPTIONS = (
    *("timestep", "iterations", "tolerance", "ls_iterations", "ls_tolerance", "noslip_iterations"),
    *("noslip_tolerance", "impratio", "ccd_iterations", "ccd_tolerance", "density", "viscosity"),
    "sleep_tolerance",
)
FLAGS = (
    # option field, its bits, their prefix, whether a set bit means on
    ("disableflags", mujoco.mjtDisableBit, "mjDSBL_", False),
    ("enableflags", mujoco.mjtEnableBit, "mjENBL_", True),
)
LARGEST = (
    *("dof_damping", "dof_frictionloss", "dof_armature", "jnt_stiffness"),
    *("pair_margin", "pair_gap", "geom_margin", "geom_gap"),
)
DISTINCT = (
    *("pair_solref", "pair_solreffriction", "pair_solimp", "pair_dim"),
    *("geom_solref", "geom_solimp", "geom_condim"),
)
KINDS = ("integrator", "solver", "cone", "jacobian")
HINGE_DRIVES = {
    "native": "position actuators",
    "torque": "explicit torques",
    "posed": "none: links are mocap bodies",
}
TIMER = mujoco.mjtTimer
IMPULSE_TIMERS = (TIMER.mjTIMER_POS_MAKE, TIMER.mjTIMER_POS_PROJECT, TIMER.mjTIMER_CONSTRAINT)
LOSSES = (int(mujoco.mjtWarning.mjWARN_CONTACTFULL), int(mujoco.mjtWarning.mjWARN_CNSTRFULL))
"""MuJoCo's warnings that contacts were dropped because memory was full."""


class MujocoEngine:
    """MuJoCo with the integrator and the cone that its documentation recommends; `default` with its defaults;
    `accurate` with stiffer contacts. `masks`: whether masks and priorities of geoms may choose what meets."""

    name: ClassVar[str] = "mujoco"
    profiles: ClassVar[Mapping[str, float]] = ENGINES["mujoco"].profiles
    plays_body_joints: ClassVar[bool] = True
    friction_laws: ClassVar[tuple[str, ...]] = ("rolling_friction", "torsional_friction")
    masks: ClassVar[bool] = True

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        hear_warnings()
        spec, bodies, drives = translated(scenario, settings, self.masks)
        try:
            model = spec.compile()
        except ValueError as error:
            raise Unsupported(f"mujoco: {error}") from error
        ids = [bodies[k].id for k in range(len(scenario.bodies))]
        return self.world_of(model, ids, scenario, settings, drives)

    def world_of(
        self, model: Any, body: list[int], scenario: Scenario, settings: Settings, drives: list[Drive]
    ) -> World:
        """What steps a compiled model."""
        return World(model, body, scenario, settings, drives)

    def version(self) -> str:
        return mujoco.mj_versionString()


def translated(
    scenario: Scenario, settings: Settings, masks: bool = True
) -> tuple[Any, dict[int, Any], list[Drive]]:
    """The spec of a scenario, its bodies by the scenario's index, and the drives of its trackers."""
    spec = mujoco.MjSpec()
    set_options(spec, scenario, settings)
    posed = settings.drive == "posed"
    drives = drives_of(scenario, settings)
    bodies = add_bodies(spec, scenario, simulated_masses(scenario, drives), settings, posed)
    add_contacts(spec, bodies, scenario, settings, masks)
    if settings.drive == "native":
        for drive, k in zip(drives, coupled(scenario, settings)):
            add_servos(spec, scenario.trackers[k].joints, drive)
    add_loops_and_motors(spec, scenario, settings)
    return spec, bodies, drives


class World(SceneWorld):
    """A compiled model and its data. `body` maps the scenario's index to MuJoCo's, `index` is the inverse."""

    def __init__(
        self, model: Any, body: list[int], scenario: Scenario, settings: Settings, drives: list[Drive]
    ) -> None:
        super().__init__(MujocoEngine(), scenario, settings, drives)
        self._model, self._data = model, mujoco.MjData(model)
        self._body = np.array(body)
        self._index = np.full(model.nbody, -1)
        self._index[self._body] = np.arange(len(body))
        self._native = settings.drive == "native"
        hinges = [[model.joint(name).id for name in tracker.joints] for tracker in self._trackers]
        self._hinge_qpos = [model.jnt_qposadr[ids].astype(int) for ids in hinges]
        self._hinge_dof = [model.jnt_dofadr[ids].astype(int) for ids in hinges]
        counts = [len(tracker.joints) for tracker in self._trackers]
        self._servos = [slice(sum(counts[:k]), sum(counts[: k + 1])) for k in range(len(counts))]
        self._root = [int(self._body[drive.links[0]]) for drive in self._drives]
        self._timers = np.zeros(int(TIMER.mjNTIMER))
        self._set_initial_state()

    def _free_joint(self, body: int) -> tuple[Array, Array, slice]:
        """Views of a free body's qpos (7,) and qvel (6,), and its degrees of freedom."""
        joint = self._model.body_jntadr[body]
        first, dof = int(self._model.jnt_qposadr[joint]), int(self._model.jnt_dofadr[joint])
        dofs = slice(dof, dof + 6)
        return self._data.qpos[first : first + 7], self._data.qvel[dofs], dofs

    def _set_initial_state(self) -> None:
        nested = {joint.child for joint in spanning_trees(self._scenario)[0]}
        start_rates(self._scenario, self._model, self._data.qvel)
        for body, source in zip(self._body, self._scenario.bodies):
            if source.kind == "simulated" and source.name not in nested:
                qpos, qvel, _ = self._free_joint(body)
                omega = np.array(source.angular_velocity)
                arm = turned(source.center_of_mass, qpos[3:])
                qvel[:3] = source.linear_velocity - np.cross(omega, arm)
                qvel[3:] = turned(omega, inverse(qpos[3:]))
        for drive, root, angles, dofs in zip(self._drives, self._root, self._hinge_qpos, self._hinge_dof):
            qpos, qvel, _ = self._free_joint(root)
            qpos[:3], qpos[3:] = drive.start_position[0], drive.start_orientation[0]
            qvel[:3] = drive.start.linear_velocity[0]
            qvel[3:] = turned(drive.start.angular_velocity[0], inverse(qpos[3:]))
            self._data.qpos[angles], self._data.qvel[dofs] = drive.start.angle[0], drive.start.rate[0]
        self._place_posed()

    def drive(self, step: int) -> None:
        """Apply a force in world axes and a torque in body axes to the root; command servos or torques of
        hinges.

        A position actuator has no set point of the rate, so its set point is advanced by damping / stiffness
        times the rate.
        """
        data = self._data
        self._moment = step + 1
        self._place_posed()
        for k, drive in enumerate(self._drives):
            qpos, qvel, root = self._free_joint(self._root[k])
            omega = turned(qvel[3:], qpos[3:])
            force, torque = drive.wrench(step, qpos[:3], qpos[3:], qvel[:3], omega)
            data.qfrc_applied[root] = *force, *turned(torque, inverse(qpos[3:]))
            dofs = self._hinge_dof[k]
            if self._native:
                lead = drive.servo_damping / drive.servo_stiffness
                data.ctrl[self._servos[k]] = drive.target.angle[step] + lead * drive.target.rate[step]
            else:
                angle, rate = data.qpos[self._hinge_qpos[k]], data.qvel[dofs]
                data.qfrc_applied[dofs] = drive.hinge_torques(step, angle, rate)

    def _place_posed(self) -> None:
        """Set the poses of kinematic links for the current step, and the state of prescribed bodies."""
        for posed, _ in self._posed:
            if posed.prescribed:
                self._move_prescribed(posed)
                continue
            mocap = self._model.body_mocapid[self._body[list(posed.links)]]
            self._data.mocap_pos[mocap] = posed.place[:, self._moment]
            self._data.mocap_quat[mocap] = posed.orientation[:, self._moment]

    def _move_prescribed(self, posed: Posed) -> None:
        """Set a prescribed body's pose and velocity at the step's start, and its force and torque in it.

        Semi-implicit Euler turns the velocity at the start, the mean of the step before, into the mean of
        this step, which leads to the pose at its end. All moments of inertia are equal.
        """
        k, mass = max(self._moment - 1, 0), prescribed_mass(self._scenario)
        qpos, qvel, dofs = self._free_joint(int(self._body[posed.links[0]]))
        qpos[:3], qpos[3:] = posed.place[0, k], posed.orientation[0, k]
        velocity, omega = posed.pace(k)
        qvel[:3], qvel[3:] = velocity, turned(omega, inverse(qpos[3:]))
        after, turning = posed.pace(k + 1)
        rate = turned(turning, inverse(qpos[3:])) - qvel[3:]
        self._data.qfrc_applied[dofs] = mass / self._settings.dt * np.array([*(after - velocity), *rate])

    def step(self) -> None:
        mujoco.mj_step(self._model, self._data)

    def read(self, state: State) -> None:
        """Read contacts of the step's start, then poses and velocities of its end."""
        model, data, body = self._model, self._data, self._body
        self._read_contacts(state)
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        state.position[:], state.orientation[:] = data.xpos[body], data.xquat[body]
        omega = data.cvel[body, :3]
        arm = data.xipos[body] - data.subtree_com[model.body_rootid[body]]
        state.linear_velocity[:] = data.cvel[body, 3:] + cross(omega, arm)
        state.angular_velocity[:] = omega
        self._show_posed(state)
        if self._drives:
            angles, dofs = np.concatenate(self._hinge_qpos), np.concatenate(self._hinge_dof)
            state.joint_angle[:], state.joint_rate[:] = data.qpos[angles], data.qvel[dofs]
            state.hinge_torque[:] = np.concatenate([self._hinge_torques(k) for k in range(len(self._drives))])
            for k, drive, root in zip(self._coupled, self._drives, self._root):
                qpos, qvel, _ = self._free_joint(root)
                drive.read(state, k, qvel[:3], turned(qvel[3:], qpos[3:]))

    def _hinge_torques(self, tracker: int) -> Array:
        """Torques on the hinges of a tracker during the last step (j,) [N m]; MuJoCo evaluates joint damping
        at the end of a step."""
        dofs = self._hinge_dof[tracker]
        torque: Array = self._data.qfrc_applied[dofs] + self._data.qfrc_actuator[dofs]
        return torque - self._model.dof_damping[dofs] * self._data.qvel[dofs]

    def _read_contacts(self, state: State) -> None:
        model, data = self._model, self._data
        if data.warning.number[LOSSES,].any():
            raise AdapterError("mujoco: out of memory for contacts; some were dropped")
        state.clear_contacts()
        if not data.ncon:
            return
        contact, force = data.contact, np.zeros((data.ncon, 6))
        for k, row in enumerate(force):
            mujoco.mj_contactForce(model, data, k, row)
        bodies = self._index[model.geom_bodyid[contact.geom]]
        axes = contact.frame.reshape(-1, 3, 3)
        impulse = self._settings.dt * (force[:, None, :3] @ axes)[:, 0]
        state.add_contacts(bodies[:, 0], bodies[:, 1], contact.pos, axes[:, 0], contact.dist, impulse)

    def describe(self) -> Manifest:
        scenario, parameters = self._scenario, contact_parameters(self._model)

        def combined(a: int, b: int) -> tuple[float, float]:
            one, two = int(self._body[a]), int(self._body[b])
            size, solref, mu = parameters[min(one, two), max(one, two)]
            return restitution_of(solref, self._settings), mu if size > 1 else 0.0

        return self._manifest(
            self._facts(),
            {source.name: self._body_facts(k) for k, source in zip(self._body, scenario.bodies)},
            self._pair_facts(combined),  # all pairs of two bodies' geoms are equal by construction
            [int(self._model.body_geomnum[k]) for k in self._body],
            dt=float(self._model.opt.timestep),
            limits={
                j.name: tuple(self._model.joint(j.name).range.tolist())
                for j in (scenario.joints if self._settings.drive != "posed" else ())
            },
            freedom=int(self._model.nv) - 6 * sum(one.prescribed for one, _ in self._posed),
        )

    def _facts(self) -> dict[str, Scalar]:
        """Options, flags (true = on) and the maximum or distinct values of the compiled model."""
        model, option = self._model, self._model.opt
        facts: dict[str, Scalar] = {}
        for name in KINDS:
            facts[name] = getattr(mujoco, f"mjt{name.capitalize()}")(getattr(option, name)).name
        facts |= {name: getattr(option, name) for name in OPTIONS}
        for field, bits, prefix, on in FLAGS:
            for name, bit in bits.__members__.items():
                if name.startswith(prefix):
                    facts[name.removeprefix(prefix).lower()] = bool(getattr(option, field) & int(bit)) == on
        for name in LARGEST:
            facts[f"{name}_max"] = float(np.abs(getattr(model, name)).max(initial=0.0))
        for name in DISTINCT:
            facts[name] = str(np.unique(getattr(model, name), axis=0).tolist())
        hinge = model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE
        return facts | {
            "gravity_vector": str(option.gravity.tolist()),
            "hinge_limits": f"{int(model.jnt_limited[hinge].sum())} of {int(hinge.sum())}, soft",
            "hinge_limit_solref": str(np.unique(model.jnt_solref[hinge], axis=0).tolist()),
            "gravity_compensated_bodies": int(np.count_nonzero(model.body_gravcomp == 1.0)),
            "actuators": int(model.nu),
            "root_drive": ROOT_DRIVES[self._settings.drive],
            "hinge_drive": HINGE_DRIVES[self._settings.drive],
            "collision_shapes": int(model.ngeom),
            "explicit_pairs": int(model.npair),
            "excluded_body_pairs": int(model.nexclude),
            "shapes_that_pair_by_mask": int(np.count_nonzero(model.geom_contype | model.geom_conaffinity)),
            "hull_vertex_type": str(model.mesh_vert.dtype),
            "threads": "one" if self._data.threadpool == 0 else "pool",
            "warnings": self._warnings(),
        }

    def _warnings(self) -> str:
        """MuJoCo's warnings so far, each with its number; its output has their texts."""
        counts = {
            name.removeprefix("mjWARN_").lower(): int(self._data.warning.number[int(kind)])
            for name, kind in mujoco.mjtWarning.__members__.items()
            if kind != mujoco.mjtWarning.mjNWARNING
        }
        return ", ".join(f"{name} {count}" for name, count in counts.items() if count) or "none"

    def _body_facts(self, body: int) -> BodyFacts:
        model = self._model
        flat = np.zeros(9)
        mujoco.mju_quat2Mat(flat, model.body_iquat[body])
        axes = flat.reshape(3, 3)
        inertia = axes * model.body_inertia[body] @ axes.T
        return BodyFacts.of(model.body_mass[body], model.body_ipos[body], inertia)

    def cross(self) -> None:
        mujoco.mj_version()

    def stage_seconds(self) -> Mapping[str, float]:
        """Time per stage from MuJoCo's timers [s].

        `impulses` covers construction, projection and solution of constraints; `integration` covers the rest:
        kinematics, mass matrix, bias and passive forces, advance.
        """
        timers = self._data.timer.duration.copy()
        spent, self._timers = timers - self._timers, timers
        collision = float(spent[TIMER.mjTIMER_POS_COLLISION])
        impulses = float(sum(spent[k] for k in IMPULSE_TIMERS))
        rest = float(spent[TIMER.mjTIMER_STEP]) - collision - impulses
        return {"collision": collision, "impulses": impulses, "integration": rest}

    def work(self) -> Mapping[str, float]:
        """Contacts, constraint rows and solver iterations (summed over islands) of the last step."""
        data = self._data
        iterations = data.solver_niter[: max(1, data.nisland)].sum()
        return {"contacts": data.ncon, "rows": data.nefc, "iterations": int(iterations)}

    def close(self) -> None:
        del self._data, self._model

"""Newton: one model per scene on the CPU, stepped by one of its rigid-body solvers in single precision.

Conventions: quaternions are xyzw; boxes and ellipsoids have half sides, a capsule lies along z. A body's
velocity is that of its centre of mass, then the angular velocity, along world axes. A contact's normal points
from shape 0 to shape 1; its points are given in the frames of their bodies, its force acts on the body of
shape 0 and is the mean over the step; force times dt is the impulse. Contacts are those of the step's start.
XPBD does not report the impulses by which it restores restitution after its positions are solved. Friction
and restitution are given per shape: MuJoCo takes the larger friction, the others the mean of both. MuJoCo has
no restitution, nor has Kamino with its defaults. Torsional and rolling friction, which Newton has by default,
are off. Kinematic bodies are where a step starts while it is solved, and contacts feel their velocity in it.

Profiles, at the steps of Newton's examples of rigid contact: `xpbd` (ten iterations; restitution where a pair
has some) and `steel` take the contacts of Newton's CollisionPipeline; `mujoco` (MuJoCo Warp),
`mujoco-elliptic` with the cone that these examples choose, and `kamino` detect their own. All else has
Newton's defaults, but the room for contacts: MuJoCo Warp estimates it from the start of a scene, and drops
what exceeds it. Featherstone and the semi-implicit solver report no contact forces, and have no profile.
https://newton-physics.github.io/newton/stable/solvers/index.html
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import Any, ClassVar

import newton
import numpy as np
import warp
from numpy.typing import NDArray

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
from touchstone.adapters.engines.newton import ENTRY, KAMINO, STEEL, XPBD
from touchstone.adapters.engines.newton.articulation import HINGE_DRIVES, Articulation
from touchstone.adapters.engines.newton.model import (
    CPU,
    INELASTIC,
    OF_MUJOCO,
    WORLD,
    builder_of,
    model_of,
    solver_of,
)
from touchstone.adapters.engines.newton.settings import SETTINGS
from touchstone.adapters.engines.scene_world import SceneWorld
from touchstone.adapters.posed_drive import coupled
from touchstone.adapters.registry import require_profile
from touchstone.adapters.servo import ROOT_DRIVES, simulated_masses
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.scenario import Scenario

CONTACT_FORCE, OVERFLOW = "contact_f", "overflow"
"""Observables of the solvers: the force of each contact [N] on the body of its shape 0; MuJoCo Warp's bits of
what exceeded its room."""

OF_SOLVERS = (
    *("iterations", "rigid_contact_relaxation", "angular_damping", "baumgarte", "cfm"),
    *("enable_restitution", "restitution_velocity_threshold"),
)
"""Settings that some solvers have as attributes."""


class NewtonEngine:
    """Newton with XPBD; `mujoco` and `mujoco-elliptic` with MuJoCo Warp, `steel` with Steel, `kamino`."""

    name: ClassVar[str] = "newton"
    profiles: ClassVar[Mapping[str, float]] = ENTRY.profiles

    def __init__(self) -> None:
        warp.config.quiet = True

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        if settings.profile == KAMINO and len(coupled(scenario, settings)) < len(scenario.trackers):
            raise Unsupported("newton: Kamino's PADMM does not move kinematic bodies")
        if settings.profile == KAMINO and any(
            scenario.trackers[k].joints for k in coupled(scenario, settings)
        ):
            raise Unsupported(
                "newton: Kamino's dense matrix has no room for the contacts that a hand may have"
            )
        if any(map(surface_moves, scenario.bodies)):
            raise Unsupported("newton: the adapter has no moving surfaces")
        if settings.sleeping:
            raise Unsupported("newton: these solvers have no sleeping on the CPU")
        if settings.profile == KAMINO and not any(scenario.touching_pairs()):
            raise Unsupported("newton: Kamino steps no scene in which nothing can touch")
        if scenario.trackers and SETTINGS.in_force(settings.profile, settings.changes)["worlds"] > 1:
            raise Unsupported("newton: the adapter has no batches of scenes with trackers")
        return World(scenario, settings)

    def version(self) -> str:
        return version("newton")


class World(SceneWorld):
    """A model, its solver and two states that take turns. `_bodies` has Newton's body per body of the
    scenario, `_owners` the scenario's body per shape."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        super().__init__(NewtonEngine(), scenario, settings)
        posed = list(self._posed_links())
        masses = simulated_masses(scenario, self._drives)
        self._worlds = int(SETTINGS.in_force(settings.profile, settings.changes)["worlds"])
        builder = builder_of(scenario, settings.profile)
        self._jointed = [
            Articulation(builder, scenario, tracker, drive, settings.drive)
            for tracker, drive in zip(self._trackers, self._drives)
            if tracker.joints
        ]
        linked = {link: body for one in self._jointed for link, body in one.bodies.items()}
        given = builder, scenario, settings.profile, masses, linked, posed, self._worlds
        self._model, bodies, owners = model_of(*given)
        self._bodies, self._owners = np.array(bodies), np.array(owners)
        self._free = np.array([k for k, own in enumerate(bodies) if own != WORLD and k not in posed], int)
        self._fixed = np.flatnonzero(self._bodies == WORLD)
        self._now, self._before = self._model.state(), self._model.state()
        self._set_motion()
        self._solver, self._control = solver_of(self._model, settings), self._model.control()
        self._detector: Any = None
        if settings.profile in OF_MUJOCO:
            most = self._solver.get_max_contact_count()
            self._contacts = newton.Contacts(most, 0, device=CPU)
        elif settings.profile == KAMINO:
            self._contacts = newton.Contacts(self._model.rigid_contact_max, 0, device=CPU)
        else:
            self._detector = newton.CollisionPipeline(self._model)
            self._contacts = self._detector.contacts()
        kinds = {CONTACT_FORCE, OVERFLOW} & self._solver.supported_observables
        self._observed = self._solver.observables(kinds, contacts=self._contacts)
        self._room = self._observed.overflow if OVERFLOW in kinds else None
        self._steps = 0
        self._start = self._now.body_q.numpy().astype(float)

    def _set_motion(self) -> None:
        """Set velocities, and the poses of driven bodies, at the start."""
        if self._model.body_count == 0:
            return
        moved, place = self._now.body_qd.numpy(), self._now.body_q.numpy()
        for k in self._free:
            body, each = self._scenario.bodies[k], self._model.body_count // self._worlds
            moved[self._bodies[k] :: each] = *body.linear_velocity, *body.angular_velocity
        for drive in self._drives:
            root = self._bodies[drive.links[0]]
            place[root] = *drive.start_position[0], *np.roll(drive.start_orientation[0], -1)
            moved[root] = np.concatenate(drive.central_start())
        self._now.body_q.assign(place)
        self._now.body_qd.assign(moved)
        newton.eval_ik(self._model, self._now, self._now.joint_q, self._now.joint_qd)
        for one in self._jointed:
            one.start(self._model, self._now)
        if self._jointed:
            newton.eval_fk(self._model, self._now.joint_q, self._now.joint_qd, self._now)

    def _pose(self, step: int) -> None:
        """Put kinematic bodies where a step starts, with their velocity in it."""
        place, moved = self._now.body_q.numpy(), self._now.body_qd.numpy()
        for one, _ in self._posed:
            for k, link in enumerate(one.links):
                body = self._bodies[link]
                place[body] = *one.place[k, step], *np.roll(one.orientation[k, step], -1)
                moved[body] = *one.velocity[k, step], *one.omega[k, step]
        self._now.body_q.assign(place)
        self._now.body_qd.assign(moved)
        given = self._model, self._now, self._now.joint_q, self._now.joint_qd
        newton.eval_ik(*given, body_flag_filter=newton.BodyFlags.KINEMATIC)

    def drive(self, step: int) -> None:
        """Apply force and torque to the roots, and lift all links, which feel no gravity. Keep the poses of
        the step's start, for its contacts: XPBD overwrites its input state."""
        self._moment = step + 1
        if self._posed:
            self._pose(step)
        self._start = self._now.body_q.numpy().astype(float)
        self._now.clear_forces()
        if not self._drives:
            return
        moved, pushed = self._now.body_qd.numpy().astype(float), self._now.body_f.numpy()
        gravity = np.array(self._scenario.acting_gravity)
        for drive in self._drives:
            root = self._bodies[drive.links[0]]
            place, turn = self._start[root, :3], np.roll(self._start[root, 3:], 1)
            force, torque = drive.central_wrench(step, place, turn, moved[root, :3], moved[root, 3:])
            pushed[root] = *(force - drive.root.mass * gravity), *torque
        for one in self._jointed:
            for body, mass in one.weights:
                pushed[body, :3] -= mass * gravity
        self._now.body_f.assign(pushed)
        commands = [one.command(step, self._now, self._control) for one in self._jointed]
        self._torques = np.concatenate(commands) if commands else np.zeros(0)

    def step(self) -> None:
        """Find contacts, where the solver does not, and advance by one step."""
        if self._detector is not None:
            self._detector.collide(self._now, self._contacts)
        given = self._now, self._before, self._control, self._contacts, self._settings.dt
        self._solver.step(*given, observables=self._observed)
        self._now, self._before = self._before, self._now
        self._steps += 1

    def read(self, state: State) -> None:
        """Read poses and velocities of the step's end, and the contacts that acted in it."""
        for k in self._fixed:
            body = self._scenario.bodies[k]
            state.position[k], state.orientation[k] = body.position, body.orientation
            state.linear_velocity[k] = state.angular_velocity[k] = 0.0
        if len(self._free):
            mine = self._bodies[self._free]
            pose, moved = self._now.body_q.numpy()[mine], self._now.body_qd.numpy()[mine]
            state.position[self._free] = pose[:, :3]
            turn = pose[:, [6, 3, 4, 5]].astype(float)
            state.orientation[self._free] = turn / np.linalg.norm(turn, axis=1, keepdims=True)
            state.linear_velocity[self._free] = moved[:, :3]
            state.angular_velocity[self._free] = moved[:, 3:]
        self._show_posed(state)
        for number, drive in zip(self._coupled, self._drives):
            root = drive.links[0]
            drive.read_central(
                state, number, *(one[root].copy() for one in (state.linear_velocity, state.angular_velocity))
            )
        if self._jointed:
            if self._settings.profile == XPBD:  # it has poses of bodies alone
                newton.eval_ik(self._model, self._now, self._now.joint_q, self._now.joint_qd)
            self._write_hinges(state, [one.hinges(self._now) for one in self._jointed])
            if self._steps:
                state.hinge_torque[:] = self._torques
        self._read_contacts(state)

    def _read_contacts(self, state: State) -> None:
        state.clear_contacts()
        contacts = self._contacts
        count = int(contacts.rigid_contact_count.numpy()[0])
        if not self._steps or not count:
            return
        full = self._solver.constraint_overflow if self._settings.profile == STEEL else self._room
        if count > contacts.rigid_contact_max or (full is not None and full.numpy().any()):
            raise AdapterError("newton: more contacts than there is room for; Newton drops the others")
        shapes = contacts.rigid_contact_shape0, contacts.rigid_contact_shape1
        one, two = (each.numpy()[:count] for each in shapes)
        mine = np.flatnonzero((one < len(self._owners)) & (two < len(self._owners)))  # of the first world
        a, b = self._owners[one[mine]], self._owners[two[mine]]
        first = _points(self, a, mine, contacts.rigid_contact_point0, contacts.rigid_contact_offset0)
        second = _points(self, b, mine, contacts.rigid_contact_point1, contacts.rigid_contact_offset1)
        normal = contacts.rigid_contact_normal.numpy()[mine].astype(float)
        impulse = -self._observed.contact_f.numpy()[mine, :3].astype(float) * self._settings.dt
        distance = ((second - first) * normal).sum(axis=1)
        acted = (distance <= 0) | impulse.any(axis=1)  # others are candidates within Newton's gap
        point = (first + second) / 2
        state.add_contacts(a[acted], b[acted], point[acted], normal[acted], distance[acted], impulse[acted])

    def describe(self) -> Manifest:
        scenario, model = self._scenario, self._model
        mass, com, inertia = (
            array.numpy() if array is not None else np.zeros(0)
            for array in (model.body_mass, model.body_com, model.body_inertia)
        )
        facts = {
            scenario.bodies[k].name: BodyFacts.of(mass[body], com[body], inertia[body])
            for k, body in zip(self._free, self._bodies[self._free])
        }
        return self._manifest(
            self._facts(),
            facts,
            self._pair_facts(self._combined),
            [int((self._owners == k).sum()) for k in range(len(scenario.bodies))],
            limits={name: pair for one in self._jointed for name, pair in one.limits(self._model).items()},
            freedom=6 * len(self._free) - 5 * sum(len(one.bodies) - 1 for one in self._jointed),
        )

    def _facts(self) -> dict[str, Scalar]:
        model, solver = self._model, self._solver
        facts: dict[str, Scalar] = {
            "solver": type(solver).__name__,
            "device": str(model.device),
            "warp": version("warp-lang"),
            "gravity_vector": str(model.gravity.numpy()[0].astype(float).tolist()),
            "collision_shapes": int(model.shape_count),
            "root_drive": ROOT_DRIVES[self._settings.drive],
            **({"hinge_drive": HINGE_DRIVES[self._settings.drive]} if self._jointed else {}),
        }
        if self._settings.profile in OF_MUJOCO:
            options = ("iterations", "ls_iterations", "tolerance", "impratio", "cone", "solver", "integrator")
            facts |= {name: float(getattr(solver.mj_model.opt, name)) for name in options}
            facts["mujoco_warp"] = version("mujoco-warp")
        else:
            facts["rigid_gap [m]"] = float(newton.ModelBuilder().rigid_gap)
            facts |= {name: float(getattr(solver, name)) for name in OF_SOLVERS if hasattr(solver, name)}
        if self._settings.profile in INELASTIC:
            facts["restitution"] = "none"
        return facts

    def _combined(self, a: int, b: int) -> tuple[float, float]:
        of = [int(np.argmax(self._owners == body)) for body in (a, b)]
        mu = self._model.shape_material_mu.numpy()[of].astype(float)
        e = self._model.shape_material_restitution.numpy()[of].astype(float)
        friction = mu.mean()
        if self._settings.profile in OF_MUJOCO:
            first_rank, other_rank = self._model.mujoco.geom_priority.numpy()[of]
            friction = mu.max() if first_rank == other_rank else mu[int(other_rank > first_rank)]
        return float(e.mean()), float(friction)

    def cross(self) -> None:
        warp.is_cpu_available()

    def close(self) -> None:
        del self._solver, self._detector, self._contacts, self._observed, self._model


def _points(world: World, bodies: Array, rows: NDArray[np.int_], points: Any, offsets: Any) -> Array:
    """Places of some contacts (c,) on the surfaces of bodies (c, 3) [m], at the step's start."""
    local = points.numpy()[rows].astype(float) + offsets.numpy()[rows]
    index = world._bodies[bodies]
    moving = index != WORLD
    if not moving.any():
        return local
    pose = world._start[index[moving]]
    axis, w, given = pose[:, 3:6], pose[:, 6:7], local[moving]
    across = 2 * np.cross(axis, given)
    local[moving] = pose[:, :3] + given + w * across + np.cross(axis, across)
    return local

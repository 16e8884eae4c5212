"""PhysX 5 through SAPIEN: one scene on a PhysxCpuSystem, in single precision, on the calling thread.

Conventions: quaternions are wxyz; boxes have half sides, a capsule lies along x. A body's velocity is that
of its mass centre, along world axes. Of a contact of bodies 0 and 1 the normal points from 1 to 0, the point
lies on the surface of 1, from which we compute the midpoint, and the impulse acts on 0. SAPIEN passes on
normal impulses alone: PhysX reports those of friction apart. Contacts are those of the step's start. Friction
(static and dynamic are equal) and restitution belong to materials; PhysX takes the mean of both, and SAPIEN
has no other combine mode. SAPIEN's cylinders are prisms of 32 sides; there are neither cones nor
ellipsoids. Driven bodies with hinges are articulations (`articulation.py`).

Profiles, at 1/120 s, SAPIEN's 1/100 s fitted to a frame: `default` has SAPIEN's defaults: TGS, ten position
iterations, bounces from 2 m/s on, and PhysX's angular damping. `recommended` has the step and the bounce
threshold of Isaac Lab's configuration for contact-rich tasks, 0.2 m/s, and no damping: the scenes have no
air. `pgs` is the same with the PGS solver. Sleeping is off unless it is asked for.
https://nvidia-omniverse.github.io/PhysX/physx/5.3.1/docs/RigidBodyDynamics.html
https://isaac-sim.github.io/IsaacLab/develop/source/overview/core-concepts/physical-backends/physx/configuration.html
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import ClassVar

import numpy as np

from touchstone.adapters.contract import Manifest, Settings, State, Unsupported
from touchstone.adapters.engines.physx import ENTRY
from touchstone.adapters.engines.physx.articulation import HINGE_DRIVES, Articulation
from touchstone.adapters.engines.physx.model import Pieces, add_bodies, facts_of, mass_facts, pose, scene_of
from touchstone.adapters.engines.scene_world import SceneWorld
from touchstone.adapters.registry import require_profile
from touchstone.adapters.servo import ROOT_DRIVES
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.scenario import Scenario


class PhysxEngine:
    """PhysX with TGS (`recommended`, and `default` with SAPIEN's defaults) or PGS (`pgs`)."""

    name: ClassVar[str] = "physx"
    profiles: ClassVar[Mapping[str, float]] = ENTRY.profiles

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        if any(map(surface_moves, scenario.bodies)):
            raise Unsupported("physx: the adapter has no moving surfaces")
        return World(scenario, settings)

    def version(self) -> str:
        return version("sapien")


class World(SceneWorld):
    """A scene. `_added` has entity and component per body, `_moving` the bodies that PhysX moves."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        super().__init__(PhysxEngine(), scenario, settings)
        self._scene, self._system = scene_of(settings, scenario.acting_gravity)
        posed = self._posed_links()
        pieces = Pieces(scenario, settings)
        added = add_bodies(self._scene, scenario, settings, posed, self._drives, pieces)
        self._jointed = []
        for tracker, drive in zip(self._trackers, self._drives):
            if tracker.joints:
                given = self._scene, scenario, tracker, drive, settings, pieces.attach
                self._jointed.append(Articulation(*given))
                added |= self._jointed[-1].added
        self._added = [added[k] for k in range(len(scenario.bodies))]
        self._number = {component: k for k, (_, component) in enumerate(self._added)}
        still = [body.kind == "fixed" or k in posed for k, body in enumerate(scenario.bodies)]
        self._moving = [k for k, fixed in enumerate(still) if not fixed]
        self._position = np.array([body.position for body in scenario.bodies])
        self._orientation = np.array([body.orientation for body in scenario.bodies])

    def drive(self, step: int) -> None:
        """Apply force and torque to the roots; give kinematic bodies their poses at the step's end."""
        self._moment = step + 1
        for drive in self._drives:
            entity, body = self._added[drive.links[0]]
            place, turn = entity.pose.p.astype(float), entity.pose.q.astype(float)
            moved = body.linear_velocity.astype(float), body.angular_velocity.astype(float)
            body.add_force_torque(*drive.central_wrench(step, place, turn, *moved), "force")
        for jointed in self._jointed:
            jointed.command(step)
        for one, _ in self._posed:
            for k, link in enumerate(one.links):
                target = pose(one.place[k, step + 1], one.orientation[k, step + 1])
                self._added[link][1].set_kinematic_target(target)

    def step(self) -> None:
        self._system.step()

    def read(self, state: State) -> None:
        """Read poses and velocities of the step's end, and contacts of its start."""
        state.position[:], state.orientation[:] = self._position, self._orientation
        for k in self._moving:
            entity, body = self._added[k]
            place = entity.pose
            turn = place.q.astype(float)
            state.position[k], state.orientation[k] = place.p, turn / np.linalg.norm(turn)
            state.linear_velocity[k], state.angular_velocity[k] = body.linear_velocity, body.angular_velocity
        self._show_posed(state)
        for k, drive in zip(self._coupled, self._drives):
            body = self._added[drive.links[0]][1]
            drive.read_central(
                state, k, body.linear_velocity.astype(float), body.angular_velocity.astype(float)
            )
        if self._jointed:
            self._write_hinges(state, [jointed.state() for jointed in self._jointed])
            if self._moment:
                state.hinge_torque[:] = np.concatenate([jointed.torques() for jointed in self._jointed])
        self._read_contacts(state)

    def _read_contacts(self, state: State) -> None:
        state.clear_contacts()
        sides, found = [], []
        for contact in self._system.get_contacts():
            pair = [self._number[body] for body in contact.bodies]
            for point in contact.points:
                sides.append(pair)
                found.append((*point.position, *point.normal, point.separation, *point.impulse))
        if not found:
            return
        a, b = np.array(sides).T
        rows = np.array(found, dtype=float)
        point, normal, distance, impulse = rows[:, :3], rows[:, 3:6], rows[:, 6], rows[:, 7:]
        acted = (distance <= 0) | impulse.any(axis=1)  # others are candidates within the contact offsets
        point = point + normal * distance[:, None] / 2
        state.add_contacts(b[acted], a[acted], point[acted], normal[acted], distance[acted], impulse[acted])

    def describe(self) -> Manifest:
        components = [component for _, component in self._added]
        return self._manifest(
            facts_of(self._system, components)
            | {"root_drive": ROOT_DRIVES[self._settings.drive]}
            | ({"hinge_drive": HINGE_DRIVES[self._settings.drive]} if self._jointed else {}),
            {self._names[k]: mass_facts(components[k]) for k in self._moving},
            self._pair_facts(self._combined),
            [len(one.collision_shapes) for one in components],
            limits={name: both for jointed in self._jointed for name, both in jointed.limits().items()},
            freedom=6 * len(self._moving) - 5 * sum(len(one.added) - 1 for one in self._jointed),
        )

    def _combined(self, a: int, b: int) -> tuple[float, float]:
        first, second = (self._added[k][1].collision_shapes[0].physical_material for k in (a, b))
        restitution = (first.restitution + second.restitution) / 2
        return restitution, (first.dynamic_friction + second.dynamic_friction) / 2

    def cross(self) -> None:
        _ = self._system.timestep

    def close(self) -> None:
        self._number, self._added, self._jointed = {}, [], []
        del self._scene, self._system

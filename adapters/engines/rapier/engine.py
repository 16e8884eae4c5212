"""Rapier through its Python package: one PhysicsWorld per scene, in single precision, on one thread.

Conventions: quaternions are read as xyzw and given as wxyz; boxes have half sides, a capsule lies along z. A
body's velocity is that of its mass centre, along world axes. A manifold's normal points from body 1 to body
2, its points are given in the frames of their colliders; impulses are sums over the substeps of a step.
Contacts are those of the step's start; Rapier keeps them while a pair moves by less than 5 cm, and the
distance is computed from its points. Friction and restitution belong to colliders with a combine rule each:
the adapter takes Rapier's default, the mean, or the first of product, least and largest that gives each pair
its coefficients. Masses are those of the scene: colliders have no density. There is no ellipsoid. Driven
bodies with hinges are multibodies (`multibody.py`).

Impulses of friction are those of COULOMB: per point along two axes that follow from the normal. SIMPLIFIED
reports none, so that its contacts have the normal impulse alone.

Profiles, at Rapier's default step of 1/60 s: `default`; `recommended` has twelve substeps
(`num_solver_iterations`) instead of four, Rapier's advice for stacks and complex machinery; `accurate`
moreover solves friction at each contact point, which Rapier calls more accurate and slower, and keeps no
contacts of pairs that moved. Sleeping is off unless it is asked for.
https://docs.rs/rapier3d/latest/rapier3d/dynamics/struct.IntegrationParameters.html
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from typing import ClassVar

import numpy as np

from touchstone.adapters.contract import AdapterError, Array, Manifest, Settings, State, Unsupported
from touchstone.adapters.engines.rapier import ENTRY
from touchstone.adapters.engines.rapier.model import (
    UNTURNED,
    add_bodies,
    add_coupling,
    facts_of,
    mass_facts,
    pose,
    tangents_of,
    world_of,
    wxyz,
)
from touchstone.adapters.engines.rapier.multibody import HINGE_DRIVE, Hinges, groups_of
from touchstone.adapters.engines.scene_world import SceneWorld
from touchstone.adapters.posed_drive import coupled
from touchstone.adapters.registry import require_profile
from touchstone.adapters.servo import ROOT_DRIVES, Drive
from touchstone.adapters.vector_products import turned
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.scenario import ORIGIN, Scenario

POINT = (1 << 31) - 1
"""Bits of a solver contact's number that are its point; the highest one marks new contacts."""

ROOT_DRIVE = "motors to kinematic bodies at the tracker: implicit Euler in each substep"

STAGES = {
    "collision": ("collision_detection",),
    "impulses": ("island_construction", "island_constraints_collection", "solver"),
    "integration": ("update", "user_changes", "ccd"),
}
"""Stages of a step, and Rapier's counters of them."""


class RapierEngine:
    """Rapier: `default`, `recommended` with more substeps, `accurate` with friction at points."""

    name: ClassVar[str] = "rapier"
    profiles: ClassVar[Mapping[str, float]] = ENTRY.profiles

    def build(self, scenario: Scenario, settings: Settings) -> World:
        require_profile(self.name, settings)
        others = coupled(scenario, settings)
        if others and settings.drive != "native":
            raise Unsupported("rapier: forces act in each substep, not once; choose --drive native")
        if any(map(surface_moves, scenario.bodies)):
            raise Unsupported("rapier: the adapter has no moving surfaces")
        return World(scenario, settings)

    def version(self) -> str:
        return version("rapier3d")


class World(SceneWorld):
    """A PhysicsWorld. `_bodies` has Rapier's body per body, `_moving` the bodies that Rapier moves."""

    def __init__(self, scenario: Scenario, settings: Settings) -> None:
        driven = [scenario.trackers[k] for k in coupled(scenario, settings)]
        drives = [Drive(scenario, tracker, settings.dt, "torque") for tracker in driven]
        super().__init__(RapierEngine(), scenario, settings, drives)
        self._world = world_of(settings, scenario.acting_gravity)
        groups = groups_of(scenario, [tracker for tracker in driven if tracker.joints])
        self._handles, self._rules = add_bodies(self._world, scenario, settings, self._posed_links(), groups)
        self._anchors = [add_coupling(self._world, one, self._handles[one.links[0]]) for one in drives]
        self._hinges = [
            Hinges(self._world, scenario, tracker, drive, self._handles)
            for tracker, drive in zip(driven, drives)
            if tracker.joints
        ]
        self._bodies = [self._world.rigid_bodies[handle] for handle in self._handles]
        self._moving = [k for k, body in enumerate(self._bodies) if body.is_dynamic]
        # poses of the step's start, those of the contacts; fixed bodies keep theirs
        self._position = np.array([body.position for body in scenario.bodies])
        self._orientation = np.array([body.orientation for body in scenario.bodies])
        colliders = list(self._world.colliders)
        self._number = {handle: k for k, (handle, _) in enumerate(colliders)}
        self._owner = np.array([one.user_data for _, one in colliders], dtype=int)
        self._place = np.array([one.translation_wrt_parent.to_tuple() for _, one in colliders])
        self._turn = np.array([wxyz(one.rotation_wrt_parent) for _, one in colliders])

    def drive(self, step: int) -> None:
        """Give kinematic bodies, those at the trackers too, their poses at the step's end."""
        self._moment = step + 1
        for drive, (place, turn) in zip(self._drives, self._anchors):
            place.set_next_kinematic_position(pose(drive.target.position[step], UNTURNED))
            turn.set_next_kinematic_position(pose(ORIGIN, drive.target.orientation[step]))
        for hinges in self._hinges:
            hinges.command(step)
        for one, _ in self._posed:
            for k, link in enumerate(one.links):
                place = pose(one.place[k, step + 1], one.orientation[k, step + 1])
                self._bodies[link].set_next_kinematic_position(place)

    def step(self) -> None:
        self._world.step()

    def read(self, state: State) -> None:
        """Read poses and velocities of the step's end, and the contacts that acted in it."""
        if lost := self._world.quarantine.bodies:
            names = ", ".join(self._scenario.bodies[self._handles.index(one)].name for one in lost)
            raise AdapterError(f"rapier: quarantined {names}: the state was not finite")
        self._read_contacts(state)
        for k in self._moving:
            body = self._bodies[k]
            self._position[k], self._orientation[k] = body.translation.to_tuple(), wxyz(body.rotation)
            state.linear_velocity[k] = body.linvel.to_tuple()
            state.angular_velocity[k] = body.angvel.to_tuple()
        state.position[:], state.orientation[:] = self._position, self._orientation
        if self._hinges:
            self._write_hinges(state, [one.state() for one in self._hinges])
        for one, hinges in self._posed:
            one.show(self._moment, state, hinges)
            links = list(one.links)
            self._position[links] = state.position[links]
            self._orientation[links] = state.orientation[links]

    def _read_contacts(self, state: State) -> None:
        state.clear_contacts()
        found = []
        for pair in self._world.narrow_phase.contact_pairs() if self._moment else ():
            both = self._number[pair.collider1], self._number[pair.collider2]
            for manifold in pair.manifolds:
                normal, points = manifold.data.normal.to_tuple(), manifold.points
                for contact in manifold.data.solver_contacts:
                    point = points[contact.contact_id & POINT]
                    places = *point.local_p1.to_tuple(), *point.local_p2.to_tuple()
                    found.append((*both, *normal, *places, point.impulse, *point.tangent_impulse))
        if not found:
            return
        rows = np.array(found)
        sides, normal = rows[:, :2].astype(int), rows[:, 2:5]
        first, second = (
            self._world_points(sides[:, 0], rows[:, 5:8]),
            self._world_points(sides[:, 1], rows[:, 8:11]),
        )
        along, across = tangents_of(-normal)
        impulse = rows[:, 11:12] * normal - rows[:, 12:13] * along - rows[:, 13:14] * across
        distance = ((second - first) * normal).sum(axis=1)
        acted = (distance <= 0) | (rows[:, 11] > 0)  # others are candidates within the prediction distance
        a, b = self._owner[sides[acted]].T
        point = (first + second)[acted] / 2
        state.add_contacts(a, b, point, normal[acted], distance[acted], impulse[acted])

    def _world_points(self, colliders: Array, local: Array) -> Array:
        """Points (n, 3) [m] of colliders in the world, at the step's start."""
        owners = self._owner[colliders]
        point = self._place[colliders] + turned(self._turn[colliders], local)
        return self._position[owners] + turned(self._orientation[owners], point)

    def describe(self) -> Manifest:
        return self._manifest(
            facts_of(self._world, self._settings, self._rules)
            | {"root_drive": ROOT_DRIVE if self._anchors else ROOT_DRIVES["posed"]}
            | ({"hinge_drive": HINGE_DRIVE} if self._hinges else {}),
            {self._names[k]: mass_facts(self._bodies[k]) for k in self._moving},
            self._pair_facts(self._combined),
            [len(body.colliders) for body in self._bodies],
            limits={name: both for one in self._hinges for name, both in one.limits().items()},
            freedom=6 * len(self._moving) - 5 * sum(len(one.limits()) for one in self._hinges),
        )

    def _combined(self, a: int, b: int) -> tuple[float, float]:
        first, second = (self._world.colliders[self._bodies[k].colliders[0]] for k in (a, b))
        (*_, mix_friction), (*_, mix_restitution) = self._rules
        friction = mix_friction(first.friction, second.friction)
        return mix_restitution(first.restitution, second.restitution), friction

    def cross(self) -> None:
        _ = self._world.num_threads

    def stage_seconds(self) -> Mapping[str, float]:
        """Time per stage of the last step from Rapier's counters [s]."""
        stages = self._world.physics_pipeline.counters.stages
        return {
            name: 1e-3 * sum(getattr(stages, f"{one}_time_ms") for one in parts)
            for name, parts in STAGES.items()
        }

    def work(self) -> Mapping[str, float]:
        return {"contacts": self._world.physics_pipeline.counters.solver.ncontacts}

    def close(self) -> None:
        del self._bodies, self._hinges, self._world

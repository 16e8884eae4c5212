"""Driven bodies with hinges as PhysX's articulations, whose joint drives are the servos: implicit springs and
dampers, solved with the contacts. Links have no gravity; joints have neither friction nor armature."""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import sapien
from sapien import physx
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import DRIVES, Array, Settings, Unsupported
from touchstone.adapters.engines.physx.model import pose, set_mass
from touchstone.adapters.engines.physx.settings import SETTINGS
from touchstone.adapters.servo import Drive
from touchstone.scenarios.scenario import ORIGIN, Joint, Scenario, Tracker

GROUPS = 32
"""Bits of SAPIEN's third collision group [1]: bodies that share one do not meet."""
ABOUT = 3
"""Component of a joint's force that is the torque about its x axis; forces come first."""
FASTEST = 1e6
"""Rate of hinges that PhysX does not exceed [rad/s]."""
HINGE_DRIVES = {
    "native": "joint drives of an articulation: implicit springs and dampers",
    "torque": "explicit torques on an articulation",
}


class Articulation:
    """A driven body. `added` has SAPIEN's entity and component per body."""

    def __init__(
        self,
        scene: Any,
        scenario: Scenario,
        tracker: Tracker,
        drive: Drive,
        settings: Settings,
        attach: Callable[[Any, int, Sequence[int]], None],
    ) -> None:
        """Add a body to a scene at its start; `attach` adds the pieces of a body in some collision groups."""
        self._drive, self._native = drive, settings.drive == DRIVES[0]
        self.added: dict[int, tuple[Any, Any]] = {}
        hinges = {hinge.name: hinge for hinge in scenario.joints}
        chosen = [hinges[name] for name in tracker.joints]
        apart = _apart(scenario, drive.links)
        root = drive.links[0]
        for k, link in enumerate(drive.links):
            parent = self.added[scenario.body_index(chosen[k - 1].parent)][1] if k else None
            component = physx.PhysxArticulationLinkComponent(parent)
            attach(component, link, (1, 1, apart[link], root + 1))
            component.set_disable_gravity(True)
            set_mass(component, scenario.bodies[link] if k else drive.root)
            entity = sapien.Entity()
            entity.add_component(component)
            entity.set_pose(pose(drive.start_position[k], drive.start_orientation[k]))
            if k:
                _set_hinge(component.joint, chosen[k - 1])
                if self._native:
                    gains = float(drive.servo_stiffness[k - 1]), float(drive.servo_damping[k - 1])
                    component.joint.set_drive_properties(*gains)
            self.added[link] = entity, component
        for entity, _ in self.added.values():
            scene.add_entity(entity)
        self._whole = self.added[root][1].articulation
        self._joints = [self.added[link][1].joint for link in drive.links[1:]]
        active = [joint.name for joint in self._whole.active_joints]
        self._order = [active.index(hinge.name) for hinge in chosen]
        rows = {link: row for row, link in enumerate(self._whole.links)}
        self._rows = [rows[self.added[link][1]] for link in drive.links[1:]]
        self._start(settings)

    def _start(self, settings: Settings) -> None:
        values, start = SETTINGS.in_force(settings.profile, settings.changes), self._drive.start
        for name in ("solver_position_iterations", "solver_velocity_iterations"):
            getattr(self._whole, f"set_{name}")(values[name])
        self._whole.set_sleep_threshold(0.0)
        self._whole.set_qpos(self._ordered(start.angle[0]))
        self._whole.set_qvel(self._ordered(start.rate[0]))
        velocity, omega = self._drive.central_start()
        self._whole.set_root_linear_velocity(velocity)
        self._whole.set_root_angular_velocity(omega)

    def _ordered(self, values: Array) -> Array:
        """Values of the hinges (j,) in PhysX's order."""
        found = np.zeros(len(self._order))
        found[self._order] = values
        return found

    def state(self) -> tuple[Array, Array]:
        """Angles [rad] and rates [rad/s] of the hinges (j,)."""
        return (
            self._whole.qpos[self._order].astype(float),
            self._whole.qvel[self._order].astype(float),
        )

    def command(self, step: int) -> None:
        """Set the servos' targets of a step, or the torques that are held over it."""
        target = self._drive.target
        if self._native:
            for joint, angle, rate in zip(self._joints, target.angle[step], target.rate[step]):
                joint.set_drive_target(angle)
                joint.set_drive_velocity_target(rate)
        else:
            self._torques = self._drive.hinge_torques(step, *self.state())
            self._whole.set_qf(self._ordered(self._torques))

    def torques(self) -> Array:
        """Torques on the hinges (j,) [N m] during the last step, those of limits included."""
        if not self._native:
            return self._torques
        found: Array = self._whole.link_incoming_joint_forces[self._rows, ABOUT].astype(float)
        return found

    def limits(self) -> dict[str, tuple[float, float]]:
        """Limits of each hinge [rad]."""
        return {joint.name: tuple(joint.limits[0].astype(float).tolist()) for joint in self._joints}


def _set_hinge(joint: Any, hinge: Joint) -> None:
    """Make a joint a hinge: PhysX's turn about the x axis of a frame in both links."""
    joint.name, joint.type = hinge.name, "revolute"
    turn = Rotation.align_vectors([hinge.axis], [(1.0, 0.0, 0.0)])[0]
    frame = pose(ORIGIN, turn.as_quat(scalar_first=True))
    joint.pose_in_parent = pose(hinge.position, (1.0, 0.0, 0.0, 0.0)) * frame
    joint.pose_in_child = pose(ORIGIN, hinge.orientation).inv() * frame
    joint.set_limits(np.array([[hinge.lower, hinge.upper]], dtype=np.float32))
    joint.set_friction(0.0)
    joint.set_armature(np.zeros(1, dtype=np.float32))
    joint.set_max_velocity(FASTEST)


def _apart(scenario: Scenario, links: Sequence[int]) -> dict[int, int]:
    """Bits per link: links with a common bit may not touch each other."""
    meeting, found = set(scenario.touching_pairs()), dict.fromkeys(links, 0)
    solid = [link for link in links if scenario.bodies[link].pieces]
    never = [pair for pair in combinations(sorted(solid), 2) if pair not in meeting]
    if len(never) == len(solid) * (len(solid) - 1) // 2:
        return dict.fromkeys(links, 1)
    if len(never) > GROUPS:
        raise Unsupported(
            f"physx: {len(never)} pairs of links that may not touch, SAPIEN has {GROUPS} groups"
        )
    for bit, pair in enumerate(never):
        for link in pair:
            found[link] |= 1 << bit
    return found

"""Driven bodies with hinges as Rapier's multibodies, in reduced coordinates; motors of their joints are the
servos, implicit springs and dampers in each substep. Rapier does not report their torques."""

from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import Any

import numpy as np
import rapier3d
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, Unsupported
from touchstone.adapters.engines.rapier.model import pose
from touchstone.adapters.servo import Drive
from touchstone.scenarios.scenario import ORIGIN, Joint, Scenario, Tracker

GROUPS = 31
"""Rapier's collision groups that links may have of their own [1]; all other bodies are in all groups."""
HINGE = rapier3d.JointAxis.ANG_X
FREE = 6
"""Coordinates of a root [1]."""
HINGE_DRIVE = "motors of a multibody's joints: implicit Euler in each substep"


class Hinges:
    """Hinges of a driven body, whose links are bodies of the world already."""

    def __init__(
        self, world: Any, scenario: Scenario, tracker: Tracker, drive: Drive, handles: Sequence[Any]
    ) -> None:
        """Join the links at the start; `handles` has Rapier's body per body of the scenario."""
        parameters = world.integration_parameters
        self._dt, substeps = parameters.dt, parameters.num_solver_iterations
        self._early = (substeps - 1) / (2 * substeps)
        self._drive, self._gains = drive, (drive.servo_stiffness, drive.servo_damping)
        by_name = {hinge.name: hinge for hinge in scenario.joints}
        self._chosen = [by_name[name] for name in tracker.joints]
        for hinge, stiffness, damping in zip(self._chosen, drive.servo_stiffness, drive.servo_damping):
            parent, child = (handles[scenario.body_index(name)] for name in (hinge.parent, hinge.child))
            world.rigid_bodies[child].gravity_scale = 0.0
            world.multibody_joints.insert(
                parent, child, _joint(hinge, float(stiffness), float(damping)), True
            )
        links = [world.multibody_joints.rigid_body_link(handles[link]) for link in drive.links[1:]]
        self._whole = world.multibody_joints.get_multibody(links[0].multibody)
        self._links = [one.id for one in links]
        self._places = [self._whole.get_link(one).assembly_id for one in self._links]
        start = np.zeros(FREE + len(self._links))
        self._whole.set_damping(start.tolist())  # by default 0.1 N m s, ten and more times a servo's
        start[self._places] = drive.start.angle[0]
        self._whole.apply_displacements(start.tolist())
        self._whole.forward_kinematics(world.rigid_bodies, True)
        self._whole.update_rigid_bodies(world.rigid_bodies, True)
        start[:3], start[3:FREE] = drive.central_start()
        start[self._places] = drive.start.rate[0]
        self._whole.set_generalized_velocity(start.tolist())

    def state(self) -> tuple[Array, Array]:
        """Angles [rad] and rates [rad/s] of the hinges (j,)."""
        angle, rate = np.array(self._whole.generalized_position()), self._whole.generalized_velocity()
        return angle[self._places], np.array(rate)[self._places]

    def command(self, step: int) -> None:
        """Set the motors' targets of a step: the mean over its substeps of what is linear in it."""
        drive, target = self._drive, self._drive.target
        before = target.angle[step - 1] if step else drive.start.angle[0]
        mean = target.angle[step] - self._early * (target.angle[step] - before)
        rate = (target.angle[step] - before) / self._dt
        for link, *motor in zip(self._links, *map(np.ndarray.tolist, (mean, rate, *self._gains))):
            self._whole.set_link_motor(link, HINGE, *motor)

    def limits(self) -> dict[str, tuple[float, float]]:
        """Limits of each hinge [rad], as set."""
        return {hinge.name: (hinge.lower, hinge.upper) for hinge in self._chosen}


def _joint(hinge: Joint, stiffness: float, damping: float) -> Any:
    """A joint that turns about the x axis of a frame in both bodies."""
    turn = Rotation.align_vectors([hinge.axis], [(1.0, 0.0, 0.0)])[0]
    back = Rotation.from_quat(hinge.orientation, scalar_first=True).inv() * turn
    locked = rapier3d.JointAxesMask.LOCKED_REVOLUTE_AXES
    joint = rapier3d.GenericJoint.builder(locked)
    joint = joint.local_frame1(pose(hinge.position, turn.as_quat(scalar_first=True)))
    joint = joint.local_frame2(pose(ORIGIN, back.as_quat(scalar_first=True)))
    joint = joint.limits(HINGE, hinge.lower, hinge.upper)
    joint = joint.motor(HINGE, 0.0, 0.0, stiffness, damping)
    return joint.motor_model(HINGE, rapier3d.MotorModel.FORCE_BASED).build()


def groups_of(scenario: Scenario, trackers: Sequence[Tracker]) -> Mapping[int, Any]:
    """Collision groups of the links of driven bodies, by which those that may not touch do not."""
    meeting, found, used = set(scenario.touching_pairs()), {}, 0
    for tracker in trackers:
        links = [k for k in sorted(scenario.links(tracker)) if scenario.bodies[k].pieces]
        touching = [pair for pair in combinations(links, 2) if pair in meeting]
        own = {link: 1 << (used + (k if touching else 0)) for k, link in enumerate(links)}
        used += len(links) if touching else 1
        for link in links:
            never = sum({own[k] for k in links if tuple(sorted((k, link))) not in meeting})
            filtered = rapier3d.Group((1 << 32) - 1 - never)
            found[link] = rapier3d.InteractionGroups(rapier3d.Group(own[link]), filtered)
    if used > GROUPS:
        raise Unsupported(f"rapier: {used} links that may or may not touch, it has {GROUPS} groups")
    return found

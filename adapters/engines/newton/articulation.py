"""Driven bodies with hinges as Newton's articulations, whose joint drives are the servos. Links have no
gravity, joints neither friction nor armature."""

from typing import Any

import newton
import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import DRIVES, Array
from touchstone.adapters.engines.newton.model import add_link, pose
from touchstone.adapters.servo import Drive
from touchstone.scenarios.scenario import ORIGIN, Joint, Scenario, Tracker

FREE = 7, 6
"""Coordinates and degrees of freedom of a root."""
STRONGEST, FASTEST = 1e9, 1e6
"""Torque [N m] and rate [rad/s] of hinges that Newton's drives do not exceed."""
HINGE_DRIVES = {
    "native": "joint drives of an articulation: stiffness and damping",
    "torque": "explicit torques on an articulation",
}


class Articulation:
    """A driven body. `bodies` has Newton's body per link, `weights` body and mass of those below the root."""

    def __init__(self, builder: Any, scenario: Scenario, tracker: Tracker, drive: Drive, kind: str) -> None:
        """Add its links and joints to a builder; `kind` is one of DRIVES."""
        self._drive, self._native = drive, kind == DRIVES[0]
        hinges = {hinge.name: hinge for hinge in scenario.joints}
        self._chosen = [hinges[name] for name in tracker.joints]
        self.bodies: dict[int, int] = {}
        joints = []
        for k, link in enumerate(drive.links):
            body = scenario.bodies[link]
            own = pose(drive.start_position[k], drive.start_orientation[k])
            self.bodies[link] = add_link(builder, body.name, body if k else drive.root, own)
            if k == 0:
                joints.append(builder.add_joint_free(self.bodies[link]))
                continue
            hinge = self._chosen[k - 1]
            parent = self.bodies[scenario.body_index(hinge.parent)]
            joints.append(self._add_hinge(builder, hinge, parent, self.bodies[link], k - 1))
        builder.add_articulation(joints)
        self._joints = joints
        self.weights = [(self.bodies[link], scenario.bodies[link].mass) for link in drive.links[1:]]

    def _add_hinge(self, builder: Any, hinge: Joint, parent: int, child: int, number: int) -> int:
        gains = {"actuator_mode": newton.JointTargetMode.NONE, "target_ke": 0.0, "target_kd": 0.0}
        if self._native:
            gains = {
                "actuator_mode": newton.JointTargetMode.POSITION_VELOCITY,
                "target_ke": float(self._drive.servo_stiffness[number]),
                "target_kd": float(self._drive.servo_damping[number]),
            }
        # XPBD's drives miss their targets about an axis that is not one of the joint's frame
        turn = Rotation.align_vectors([hinge.axis], [(1.0, 0.0, 0.0)])[0]
        back = Rotation.from_quat(hinge.orientation, scalar_first=True).inv() * turn
        joint: int = builder.add_joint_revolute(
            parent,
            child,
            parent_xform=pose(hinge.position, turn.as_quat(scalar_first=True)),
            child_xform=pose(ORIGIN, back.as_quat(scalar_first=True)),
            axis=newton.Axis.X,
            limit_lower=hinge.lower,
            limit_upper=hinge.upper,
            armature=0.0,
            friction=0.0,
            effort_limit=STRONGEST,
            velocity_limit=FASTEST,
            label=hinge.name,
            collision_filter_parent=False,
            **gains,
        )
        return joint

    def start(self, model: Any, state: Any) -> None:
        self._coordinates = model.joint_q_start.numpy()[self._joints]
        self._freedoms = model.joint_qd_start.numpy()[self._joints]
        place, moved = state.joint_q.numpy(), state.joint_qd.numpy()
        first, other = self._coordinates[0], self._freedoms[0]
        turn = np.roll(self._drive.start_orientation[0], -1)
        place[first : first + FREE[0]] = *self._drive.start_position[0], *turn
        moved[other : other + FREE[1]] = np.concatenate(self._drive.central_start())
        place[self._coordinates[1:]] = self._drive.start.angle[0]
        moved[self._freedoms[1:]] = self._drive.start.rate[0]
        state.joint_q.assign(place)
        state.joint_qd.assign(moved)

    def hinges(self, state: Any) -> tuple[Array, Array]:
        """Angles [rad] and rates [rad/s] of the hinges (j,)."""
        return (
            state.joint_q.numpy()[self._coordinates[1:]].astype(float),
            state.joint_qd.numpy()[self._freedoms[1:]].astype(float),
        )

    def command(self, step: int, state: Any, control: Any) -> Array:
        """Set the servos' targets of a step, or the torques that are held over it; these, or NaN."""
        target = self._drive.target
        if self._native:
            aims, rates = control.joint_target_q.numpy(), control.joint_target_qd.numpy()
            aims[self._coordinates[1:]], rates[self._freedoms[1:]] = target.angle[step], target.rate[step]
            control.joint_target_q.assign(aims)
            control.joint_target_qd.assign(rates)
            return np.full(len(self._chosen), np.nan)
        torques: Array = self._drive.hinge_torques(step, *self.hinges(state))
        forces = control.joint_f.numpy()
        forces[self._freedoms[1:]] = torques
        control.joint_f.assign(forces)
        return torques

    def limits(self, model: Any) -> dict[str, tuple[float, float]]:
        """Limits of each hinge [rad]."""
        lower, upper = model.joint_limit_lower.numpy(), model.joint_limit_upper.numpy()
        return {
            hinge.name: (float(lower[k]), float(upper[k]))
            for hinge, k in zip(self._chosen, self._freedoms[1:])
        }

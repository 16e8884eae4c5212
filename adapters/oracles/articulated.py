"""Kinematics, inertia and energy of driven trees by pinocchio, and a plain inverse kinematics of one chain.

Conventions: pinocchio's free root takes (position, quaternion xyzw) and velocities along the root's own axes;
ours are along the world axes. Its hinge has a placement and rotates about an axis in the child's frame; ours
is given in the parent's.
"""

from typing import NamedTuple

import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.scenarios.scenario import Body, Chain, Joint, Scenario, Tracker, Vector


class Articulated:
    """Driven body of a tracker; links are counted root first, then the children of its joints."""

    def __init__(self, scenario: Scenario, tracker: Tracker) -> None:
        by_name = {joint.name: joint for joint in scenario.joints}
        hinges = [by_name[name] for name in tracker.joints]
        bodies = [scenario.bodies[link] for link in scenario.links(tracker)]
        self.model = pinocchio.Model()
        self.model.gravity.linear = np.array(scenario.acting_gravity)
        root = self.model.addJoint(0, pinocchio.JointModelFreeFlyer(), pinocchio.SE3.Identity(), tracker.root)
        joint_of = {tracker.root: root}
        _weigh(self.model, root, bodies[0])
        for hinge, body in zip(hinges, bodies[1:]):
            joint_of[hinge.child] = _add_hinge(self.model, joint_of[hinge.parent], hinge)
            _weigh(self.model, joint_of[hinge.child], body)
        self.data = self.model.createData()

    def posture(self, position: Array, orientation: Array, angles: Array) -> Array:
        """Configuration from the root's origin (3,) [m] and quaternion wxyz, and the hinges' angles [rad]."""
        w, x, y, z = orientation
        return np.concatenate([position, (x, y, z, w), angles])

    def poses(self, posture: Array) -> tuple[Array, Array]:
        """Origins (n, 3) [m] and rotation matrices (n, 3, 3) of the links, world."""
        pinocchio.forwardKinematics(self.model, self.data, posture)
        links = self.data.oMi.tolist()[1:]
        return np.array([link.translation for link in links]), np.array([link.rotation for link in links])

    def inertia(self, posture: Array) -> Array:
        """Joint-space inertia (6 + j, 6 + j), in the coordinates of `joint_space_inertia` in
        `kinematics.py`."""
        upper = np.triu(pinocchio.crba(self.model, self.data, posture))
        own = upper + np.triu(upper, 1).T
        turned = self._to_own_axes(posture)
        return turned.T @ own @ turned

    def body(self, posture: Array) -> tuple[float, Array, Array]:
        """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2] of the whole body,
        world."""
        pinocchio.ccrba(self.model, self.data, posture, np.zeros(self.model.nv))
        whole = self.data.Ig
        return float(whole.mass), np.array(self.data.com[0]), np.array(whole.inertia)

    def kinetic_energy(self, posture: Array, rates: Array) -> float:
        """Kinetic energy [J]; rates (6 + j,) are those of the root's origin and rotation along the world
        axes, then of the hinges."""
        own = self._to_own_axes(posture) @ rates
        return float(pinocchio.computeKineticEnergy(self.model, self.data, posture, own))

    def _to_own_axes(self, posture: Array) -> Array:
        turned = np.eye(self.model.nv)
        rotation = Rotation.from_quat(posture[3:7]).as_matrix()
        turned[:3, :3] = turned[3:6, 3:6] = rotation.T
        return turned


def _add_hinge(model: pinocchio.Model, parent: int, hinge: Joint) -> int:
    rest = Rotation.from_quat(np.array(hinge.orientation), scalar_first=True)
    placement = pinocchio.SE3(rest.as_matrix(), np.array(hinge.position))
    joint = pinocchio.JointModelRevoluteUnaligned(rest.inv().apply(hinge.axis))
    number: int = model.addJoint(parent, joint, placement, hinge.name)
    return number


def _weigh(model: pinocchio.Model, joint: int, body: Body) -> None:
    inertia = pinocchio.Inertia(body.mass, np.array(body.center_of_mass), np.array(body.inertia))
    model.appendBodyToJoint(joint, inertia, pinocchio.SE3.Identity())


class Reached(NamedTuple):
    """Number of steps, remaining distance [m], and angles [rad]."""

    steps: int
    left: float
    angles: Array


class DampedLeastSquares:
    """Plain damped least-squares inverse kinematics of a chain, called from Python.

    Moves the chain's hinges only, with its root fixed at the world's origin; clips at joint limits and has no
    reach cones.
    """

    def __init__(self, scenario: Scenario, chain: Chain, point: Vector, damping: float, cap: int) -> None:
        """
        Args:
            point: end effector in the last link's frame [m].
            damping: damping of the steps [m].
            cap: maximum number of steps.
        """
        by_name = {joint.name: joint for joint in scenario.joints}
        hinges = [by_name[name] for name in chain.joints]
        self.model, last = pinocchio.Model(), 0
        for hinge in hinges:
            last = _add_hinge(self.model, last, hinge)
        tip = pinocchio.SE3(np.eye(3), np.array(point))
        self.frame = self.model.addFrame(pinocchio.Frame("point", last, 0, tip, pinocchio.FrameType.OP_FRAME))
        self.data = self.model.createData()
        self.lower = np.array([hinge.lower for hinge in hinges])
        self.upper = np.array([hinge.upper for hinge in hinges])
        self.damping, self.cap = damping**2 * np.eye(3), cap

    def place(self, angles: Array) -> Array:
        """Position of the end effector (3,) [m] in the frame of the first hinge's parent."""
        pinocchio.framesForwardKinematics(self.model, self.data, angles)
        point: Array = self.data.oMf[self.frame].translation
        return point

    def solve(self, angles: Array, goal: Array, tolerance: float) -> Reached:
        """Iterate steps J^T (J J^T + damping^2 1)^-1 (goal - point) from `angles` until within
        `tolerance`."""
        model, data, axes = self.model, self.data, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        for steps in range(self.cap + 1):
            away = goal - self.place(angles)
            left = np.linalg.norm(away)
            if left <= tolerance or steps == self.cap:
                break
            jacobian = pinocchio.computeFrameJacobian(model, data, angles, self.frame, axes)[:3]
            pull = np.linalg.solve(jacobian @ jacobian.T + self.damping, away)
            angles = np.clip(angles + jacobian.T @ pull, self.lower, self.upper)
        return Reached(steps, float(left), angles)

    def cross(self) -> None:
        """Make the cheapest call into pinocchio."""
        self.model.existFrame("")

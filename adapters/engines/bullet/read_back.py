"""What Bullet reports of a world: mass properties, coefficients, limits and settings, read back."""

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array, BodyFacts, Scalar, Settings
from touchstone.adapters.engines.bullet.bodies import Bodies
from touchstone.adapters.engines.bullet.tables import BASE, LINK, RIGID_BODY
from touchstone.adapters.posed_drive import coupled
from touchstone.adapters.servo import ROOT_DRIVES
from touchstone.scenarios.scenario import Hull, Scenario

HINGE_DRIVES = {
    "native": "position control",
    "torque": "off (force 0)",
    "posed": "none: links are bodies without mass",
}
FREEDOM = {
    pybullet.JOINT_REVOLUTE: 1,
    pybullet.JOINT_PRISMATIC: 1,
    pybullet.JOINT_SPHERICAL: 3,
    pybullet.JOINT_FIXED: 0,
}
"""Degrees of freedom of joints."""


class ReadBack:
    """Facts of a world in the client `on`."""

    def __init__(self, scenario: Scenario, settings: Settings, bodies: Bodies, on: dict[str, int]) -> None:
        self._scenario, self._settings, self._bodies, self._on = scenario, settings, bodies, on
        # mass, mu, moments, centre, axes, e, rolling and spinning friction, damping, stiffness, kind, margin
        self._facts = [
            pybullet.getDynamicsInfo(*bodies.colliders[k][0], **on) for k in range(len(scenario.bodies))
        ]

    def bodies(self) -> dict[str, BodyFacts]:
        rows = zip(self._scenario.bodies, self._facts, self._bodies.origin)
        return {body.name: _body_facts(fact, origin) for body, fact, origin in rows}

    def combined(self, a: int, b: int) -> tuple[float, float]:
        """Restitution and friction of a pair."""
        first, second = self._facts[a], self._facts[b]
        return first[5] * second[5], first[1] * second[1]

    def pieces(self) -> list[int]:
        """Shapes of each body; Bullet reports none for rigid bodies."""
        return [
            len(body.pieces)
            if k in self._bodies.rigid
            else sum(
                len(pybullet.getCollisionShapeData(*link, **self._on)) for link in self._bodies.colliders[k]
            )
            for k, body in enumerate(self._scenario.bodies)
        ]

    def limits(self) -> dict[str, tuple[float, float]]:
        """Limits by hinge [rad]."""
        pybullet.syncBodyInfo(**self._on)  # getJointInfo reads a copy made before the limits were set
        found = {}
        trackers = [self._scenario.trackers[k] for k in coupled(self._scenario, self._settings)]
        for multibody, tracker in zip(self._bodies.driven, trackers):
            for k, name in enumerate(tracker.joints):
                found[name] = pybullet.getJointInfo(multibody.id, k, **self._on)[8:10]
        return found

    def freedom(self) -> int:
        """Degrees of freedom: six per base with mass, and those of joints."""
        free = 0
        for multibody in (*self._bodies.free, *self._bodies.joined, *self._bodies.driven):
            free += 6 * (pybullet.getDynamicsInfo(multibody.id, BASE, **self._on)[0] > 0)
            kinds = [
                pybullet.getJointInfo(multibody.id, k, **self._on)[2]
                for k in range(pybullet.getNumJoints(multibody.id, **self._on))
            ]
            free += sum(FREEDOM[kind] for kind in kinds)
        return free

    def settings(self, solver: dict[str, Scalar]) -> dict[str, Scalar]:
        """Settings: those of the solver (`solver`) and others as read back, the rest as set."""
        pybullet.syncBodyInfo(**self._on)  # getJointInfo reads a copy made before the limits were set
        jointed = (*self._bodies.joined, *self._bodies.driven)
        links = [(m.id, k) for m in jointed for k in range(len(m.bodies) - m.based)]
        joints = [pybullet.getJointInfo(*link, **self._on) for link in links]
        facts = self._facts
        rows = zip(facts, self._scenario.bodies)
        hulls = [fact for fact, body in rows if any(isinstance(p.shape, Hull) for p in body.pieces)]
        as_set = (
            self._bodies.parameters.solver
            | self._bodies.parameters.base
            | self._bodies.parameters.hull
            | LINK
            | self._bodies.sleep
        )
        return {
            **{f"{name} (read back)": value for name, value in solver.items()},
            **{f"{name} (as set)": value for name, value in as_set.items() if name not in solver},
            "rolling friction, largest (read back)": _largest(facts, 6),
            "spinning friction, largest (read back)": _largest(facts, 7),
            "contact damping, largest; -1 = rigid (read back)": _largest(facts, 8),
            "contact stiffness, largest; -1 = rigid (read back)": _largest(facts, 9),
            "margin outside hulls, largest [m] (read back)": _largest(hulls, 11),
            "joint damping, largest (read back)": _largest(joints, 6),
            "joint friction, largest (read back)": _largest(joints, 7),
            "hinges with limits (read back)": sum(joint[8] <= joint[9] for joint in joints),
            "hull corners": "rounded by Bullet to about 1e-4 of the hull's size",
            "integrator": "semi-implicit Euler on reduced coordinates, gyroscopic term on",
            "sleep of driven bodies": "off: no force wakes a multibody",
            "root_drive": ROOT_DRIVES[self._settings.drive],
            "default joint motors": HINGE_DRIVES[self._settings.drive],
            "joint springs and dampers": "joint motors to the rate without force, by at most the law's force",
            "gravity of driven links": "cancelled by an opposite force at each centre of mass",
            "contact breaking": "the threshold is one for the whole process",
            "threads": 1,
            "bodies with friction anchors": len(self._bodies.anchored),
            "bodies in maximal coordinates": sum(fact[10] == RIGID_BODY for fact in facts),
            "collision_shapes": sum(self.pieces()),
        }


def _largest(rows: list[tuple], field: int) -> float:
    return max((row[field] for row in rows), default=0.0)


def _body_facts(fact: tuple, origin: Array) -> BodyFacts:
    """Mass properties from Bullet's record of a link with an origin in the body frame, rotated to the body
    axes."""
    # Bullet reports no axes for a rigid body: its inertia is along those of its shape.
    axes = np.eye(3) if fact[10] == RIGID_BODY else Rotation.from_quat(fact[4]).as_matrix()
    return BodyFacts.of(fact[0], fact[3] + origin, axes @ np.diag(fact[2]) @ axes.T)

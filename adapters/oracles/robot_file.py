"""A robot's file as an independent reader has it, compared with the imported scene.

URDF is read by pinocchio, which shares nothing with the importer; MJCF by MuJoCo, whose kinematics and masses
are compared with the links that the importer builds. Everything is in the frame of the root link. A hinge is
its axis w and moment v = p x w about the root's origin (Pluecker coordinates), since any point p of the axis
describes it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path

import mujoco
import numpy as np
import pinocchio

from touchstone.adapters.contract import Array
from touchstone.adapters.oracles.articulated import Articulated
from touchstone.adapters.robots.links import (
    BALL,
    HINGE,
    UNLIMITED,
    MassProperties,
    body_mass,
    combined,
    joints_of,
)
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.link_body import BASE, BASE_NOTE
from touchstone.adapters.robots.robot_scene import BASE_END, LEFT_OUT, Imported
from touchstone.adapters.robots.source import Source
from touchstone.scenarios.avatar.kinematics import hinges, link_poses
from touchstone.scenarios.scenario import Scenario, Tracker

EQUAL = 1e-9
"""Deviation up to which a scene has what the file says [1]: rounding of some thirty links."""
SHARED = 1e-5
"""The same away from the start, where hinges of one body have different anchors and share its mass."""
POSTURES = 3
"""Postures in which the whole robot is weighed: the start, and random ones."""
QUANTITIES = ("mass", "centre", "inertia", "axes", "limits")
READERS = {"urdf": "pinocchio", "mjcf": "mujoco"}


@dataclass(frozen=True, slots=True)
class Hinge:
    """Axis (3,), its moment about the root's origin (3,) [m], and limits [rad]."""

    axis: Array
    moment: Array
    limits: tuple[float, float]


class FileTree(ABC):
    """Tree of a file that moves: driven by a tracker if it has hinges."""

    name: str
    hinges: dict[str, Hinge]
    turned: Collection[str]
    """Hinges that `whole` can turn."""

    @abstractmethod
    def whole(self, angles: Mapping[str, float]) -> MassProperties:
        """Mass properties of all links; hinges that are not named stand at 0."""


class UrdfTree(FileTree):
    """Tree of a URDF file, by pinocchio."""

    def __init__(self, path: Path, root: str) -> None:
        self._model = pinocchio.buildModelFromUrdf(str(path), pinocchio.JointModelFreeFlyer())
        self._data = self._model.createData()
        neutral = pinocchio.neutral(self._model)
        pinocchio.framesForwardKinematics(self._model, self._data, neutral)
        # a root that is fixed to a link called "world" has its own frame, as has one that turns on a base
        names = [name for name in (root, root.removesuffix(BASE_END)) if self._model.existFrame(name)]
        frame = self._model.getFrameId(names[0]) if names else 0
        self._from_world = self._data.oMf[frame].inverse()
        jacobian = self._from_world.action @ pinocchio.computeJointJacobians(self._model, self._data, neutral)
        self.hinges, self.name = {}, root
        for name, joint in list(zip(self._model.names, self._model.joints))[2:]:
            column = jacobian[:, joint.idx_v]
            if not column[3:].any():
                continue  # it slides
            limits = (-UNLIMITED, UNLIMITED)
            if joint.nq == 1:
                bounds = self._model.lowerPositionLimit, self._model.upperPositionLimit
                limits = (float(bounds[0][joint.idx_q]), float(bounds[1][joint.idx_q]))
            self.hinges[name] = Hinge(column[3:].copy(), column[:3].copy(), limits)
        self.turned = self.hinges

    def whole(self, angles: Mapping[str, float]) -> MassProperties:
        """Mass properties of all links."""
        model, data = self._model, self._data
        turned = np.zeros(model.nv)
        for name, angle in angles.items():
            turned[model.joints[model.getJointId(name)].idx_v] = angle
        posture = pinocchio.integrate(model, pinocchio.neutral(model), turned)
        pinocchio.ccrba(model, data, posture, np.zeros(model.nv))
        whole = MassProperties(float(data.Ig.mass), np.array(data.com[0]), np.array(data.Ig.inertia))
        return whole.moved(self._from_world.translation, self._from_world.rotation)


class MjcfTree(FileTree):
    """Tree of an MJCF model below one body of the world, by MuJoCo."""

    def __init__(self, model: mujoco.MjModel, root: int) -> None:
        self.name = model.body(root).name
        self._model, self._data = model, mujoco.MjData(model)
        self._bodies = [body for body in range(model.nbody) if model.body_rootid[body] == root]
        mujoco.mj_kinematics(model, self._data)
        self._place = self._data.xpos[root].copy()
        self._turn = self._data.xmat[root].reshape(3, 3).copy()
        self.hinges = {}
        self._coordinate: dict[str, int] = {}
        for body in self._bodies:
            joints = joints_of(model, body)
            if body == root and any(int(model.jnt_type[joint]) != HINGE for joint in joints):
                continue  # the pose of the root's tracker takes their place
            for joint in joints:
                self._add(joint, model.joint(joint).name or f"joint_{joint}")
        self.turned = self._coordinate

    def _add(self, joint: int, name: str) -> None:
        model, data = self._model, self._data
        kind, limited = int(model.jnt_type[joint]), bool(model.jnt_limited[joint])
        low, high = model.jnt_range[joint].tolist() if limited else (-UNLIMITED, UNLIMITED)
        if kind == HINGE:
            start = float(model.qpos0[model.jnt_qposadr[joint]])
            self._coordinate[name] = int(model.jnt_qposadr[joint])
            found = {name: (data.xaxis[joint], (low - start, high - start))}
        elif kind == BALL:
            most = high if limited else np.pi
            axes = data.xmat[model.jnt_bodyid[joint]].reshape(3, 3).T
            found = {f"{name}_{letter}": (axis, (-most, most)) for letter, axis in zip("xyz", axes)}
        else:
            return
        for own, (axis, limits) in found.items():
            along = self._turn.T @ axis
            point = self._turn.T @ (data.xanchor[joint] - self._place)
            self.hinges[own] = Hinge(along, np.cross(point, along), limits)

    def whole(self, angles: Mapping[str, float]) -> MassProperties:
        """Mass properties of all links."""
        model, data = self._model, self._data
        data.qpos[:] = model.qpos0
        for name, angle in angles.items():
            data.qpos[self._coordinate[name]] += angle
        mujoco.mj_kinematics(model, data)
        parts = []
        for body in self._bodies:
            turn = self._turn.T @ data.xmat[body].reshape(3, 3)
            parts.append(body_mass(model, body).moved(self._turn.T @ (data.xpos[body] - self._place), turn))
        return combined(parts)


def trees_of(path: Path, source: Source, scenario: Scenario) -> list[FileTree]:
    """Trees of a file that move, in its order; raises RobotError if its reader cannot read it."""
    if source.form == "urdf":
        roots = [tracker.root for tracker in scenario.trackers]
        roots += [body.name for body in scenario.bodies if body.kind == "simulated"]
        try:
            return [UrdfTree(path, root) for root in roots]
        except (ValueError, RuntimeError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise RobotError(f"{path}: pinocchio cannot read it: {reason}") from error
    model = source.model
    return [MjcfTree(model, int(root)) for root in np.unique(model.body_rootid[model.jnt_bodyid])]


def deviations(found: Imported, trees: list[FileTree]) -> dict[str, float]:
    """Largest deviation of a scene from its file, for each of QUANTITIES [1]; infinite for a hinge or a tree
    that one of them lacks. Angles are in rad, all else relative to the robot's mass, size or inertia."""
    scenario, off = found.scenario, dict.fromkeys(QUANTITIES, 0.0)
    driven = [tracker for tracker in scenario.trackers if not scenario.prescribes(tracker)]
    turning = [tree for tree in trees if tree.hinges]
    free = {body.name: body for body in scenario.bodies if body.kind == "simulated"}
    still = [tree for tree in trees if not tree.hinges and not _is_left_out(found, tree)]
    if len(driven) != len(turning) or len(free) != len(still):
        return dict.fromkeys(QUANTITIES, inf)
    each = [_of_tree(found, tracker, tree) for tracker, tree in zip(driven, turning)]
    for body, tree in zip(free.values(), still):
        own = MassProperties(body.mass, np.array(body.center_of_mass), np.array(body.inertia))
        each.append(_apart(own, _based(found, body.name, tree.whole({}))))
    for away in each:
        off |= {name: max(off[name], value) for name, value in away.items()}
    return off


def _is_left_out(found: Imported, tree: FileTree) -> bool:
    return any(note.startswith(f"{LEFT_OUT} {tree.name!r}") for note in found.notes)


def _based(found: Imported, root: str, whole: MassProperties) -> MassProperties:
    """Mass properties of a file with the base that a root without mass gets, as a note says."""
    noted = any(note.startswith(f"body {root!r}: {BASE_NOTE}") for note in found.notes)
    return combined([whole, BASE]) if noted else whole


def _apart(own: MassProperties, theirs: MassProperties) -> dict[str, float]:
    """Relative deviations of mass, centre and inertia; of a centre, over the size."""
    inertia = np.abs(theirs.inertia).max()
    if theirs.mass <= 0 or inertia <= 0:
        return dict.fromkeys(QUANTITIES[:3], inf)
    return {
        "mass": abs(own.mass - theirs.mass) / theirs.mass,
        "centre": float(np.abs(own.center - theirs.center).max()) / _size(theirs),
        "inertia": float(np.abs(own.inertia - theirs.inertia).max() / inertia),
    }


def _size(whole: MassProperties) -> float:
    return float(np.sqrt(np.abs(whole.inertia).max() / whole.mass))


def _of_tree(found: Imported, tracker: Tracker, tree: FileTree) -> dict[str, float]:
    scenario = found.scenario
    shared = SHARED / EQUAL if any("different anchors" in note for note in found.notes) else 1.0
    off, rng, size = dict.fromkeys(QUANTITIES, 0.0), np.random.default_rng(0), 1.0
    for k in range(POSTURES):
        angles = {name: rng.uniform(-1, 1) if k else 0.0 for name in tracker.joints if name in tree.turned}
        own = _whole(scenario, tracker, np.array([angles.get(name, 0.0) for name in tracker.joints]))
        theirs = _based(found, tracker.root, tree.whole(angles))
        for name, value in _apart(own, theirs).items():
            off[name] = max(off[name], value / (shared if k else 1.0))
        size = _size(theirs) if theirs.mass > 0 else 1.0
    ours = _hinges(scenario, tracker)
    if ours.keys() != tree.hinges.keys():
        return off | {"axes": inf, "limits": inf}
    for name, hinge in ours.items():
        other = tree.hinges[name]
        moment = float(np.abs(hinge.moment - other.moment).max()) / size
        off["axes"] = max(off["axes"], moment, float(np.abs(hinge.axis - other.axis).max()))
        # equal limits, such as the zeros of a URDF that states none, are no limits: the importer notes it
        low, high = other.limits if other.limits[0] < other.limits[1] else (-UNLIMITED, UNLIMITED)
        off["limits"] = max(off["limits"], abs(hinge.limits[0] - low), abs(hinge.limits[1] - high))
    return off


def _whole(scenario: Scenario, tracker: Tracker, angles: Array) -> MassProperties:
    body = Articulated(scenario, tracker)
    return MassProperties(*body.body(body.posture(np.zeros(3), np.array((1.0, 0, 0, 0)), angles)))


def _hinges(scenario: Scenario, tracker: Tracker) -> dict[str, Hinge]:
    """Hinges of a driven body at angle 0 in the frame of its root."""
    still = np.zeros((1, 3)), np.array([[1.0, 0, 0, 0]]), np.zeros((1, len(tracker.joints)))
    place, turn = link_poses(scenario, tracker, *still)
    found = {}
    for joint, parent, child in hinges(scenario, tracker):
        axis = turn[parent, 0] @ np.array(joint.axis)
        found[joint.name] = Hinge(axis, np.cross(place[child, 0], axis), (joint.lower, joint.upper))
    return found

"""A robot's file as an independent reader has it, compared with the imported scene.

URDF is read by pinocchio, which shares nothing with the importer; MJCF by MuJoCo, whose kinematics and masses
are compared with the links that the importer builds. Everything is in the frame of the root link. A hinge is
its axis w and moment v = p x w about the root's origin (Pluecker coordinates), since any point p of the axis
describes it; a slider has w = 0, and its axis as v.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path

import mujoco
import numpy as np
import pinocchio
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.oracles.articulated import Articulated
from touchstone.adapters.robots.link_body import BASE, BASE_NOTE
from touchstone.adapters.robots.links import (
    BALL,
    FREE,
    HINGE,
    SLIDE,
    UNLIMITED,
    MassProperties,
    body_mass,
    combined,
    joint_name,
    joints_of,
)
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.adapters.robots.robot_scene import BASE_END, LEFT_OUT, Imported
from touchstone.adapters.robots.source import Source
from touchstone.scenarios.avatar.kinematics import hinges, link_poses, matrix
from touchstone.scenarios.scenario import BodyJoint, Scenario, Tracker

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
    """Axis (3,), its moment about the root's origin (3,) [m], and limits [rad]; or a slider."""

    axis: Array
    moment: Array
    limits: tuple[float, float]
    slides: bool = False


class FileTree(ABC):
    """Tree of a file that moves: driven by a tracker if it has hinges, or a mechanism.

    Attributes:
        hinges: hinges, the three of a ball joint, and the sliders of a mechanism.
        turned: joints that `whole` can move.
        pose: position and axes of the root in the file's world, if it stands there.
        several: whether a body has several joints.
    """

    name: str
    hinges: dict[str, Hinge]
    turned: Collection[str]
    pose: tuple[Array, Array] | None = None
    several: bool = False

    @abstractmethod
    def whole(self, angles: Mapping[str, float]) -> MassProperties:
        """Mass properties of all links; hinges that are not named stand at 0."""


class UrdfTree(FileTree):
    """Tree of a URDF file, by pinocchio."""

    def __init__(self, path: Path, root: str, mechanism: bool = False, fixed: bool = False) -> None:
        base = () if fixed else (pinocchio.JointModelFreeFlyer(),)
        self._model = pinocchio.buildModelFromUrdf(str(path), *base)
        self.pose = (np.zeros(3), np.eye(3)) if fixed else None
        self._data = self._model.createData()
        neutral = pinocchio.neutral(self._model)
        pinocchio.framesForwardKinematics(self._model, self._data, neutral)
        # a root that is fixed to a link called "world" has its own frame, as has one that turns on a base
        names = [name for name in (root, root.removesuffix(BASE_END)) if self._model.existFrame(name)]
        frame = self._model.getFrameId(names[0]) if names and not fixed else 0
        self._from_world = self._data.oMf[frame].inverse()
        columns = pinocchio.computeJointJacobians(self._model, self._data, neutral)
        jacobian = self._from_world.action @ np.reshape(columns, (6, -1))  # one column is flat
        self.hinges, self.name = {}, root
        for name, joint in list(zip(self._model.names, self._model.joints))[1 + len(base) :]:
            column = jacobian[:, joint.idx_v]
            slides = not column[3:].any()
            if slides and not mechanism:
                continue
            limits = (-UNLIMITED, UNLIMITED)
            if joint.nq == 1:
                bounds = self._model.lowerPositionLimit, self._model.upperPositionLimit
                limits = (float(bounds[0][joint.idx_q]), float(bounds[1][joint.idx_q]))
            self.hinges[name] = Hinge(column[3:].copy(), column[:3].copy(), limits, slides)
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

    def __init__(
        self, model: mujoco.MjModel, root: int, mechanism: bool = False, fixed: bool = False
    ) -> None:
        self.name = model.body(root).name
        self._model, self._data = model, mujoco.MjData(model)
        tree = [body for body in range(model.nbody) if model.body_rootid[body] == root]
        # of a mechanism, what stands still has no mass
        still = {0, int(model.body_weldid[root])} if fixed else {0} if mechanism else set()
        self._bodies = [body for body in tree if int(model.body_weldid[body]) not in still]
        self.several = any(int(model.body_jntnum[body]) > 1 for body in tree)
        mujoco.mj_kinematics(model, self._data)
        self._place = self._data.xpos[root].copy()
        self._turn = self._data.xmat[root].reshape(3, 3).copy()
        own = [int(model.jnt_type[joint]) for joint in joints_of(model, root)]
        self.pose = (self._place, self._turn) if mechanism and (fixed or FREE not in own) else None
        self.hinges = {}
        self._coordinate: dict[str, int] = {}
        for body in self._bodies:
            joints = joints_of(model, body)
            if body == root and not mechanism and any(kind != HINGE for kind in own):
                continue  # the pose of the root's tracker takes their place
            for joint in joints:
                self._add(joint, joint_name(model, joint), mechanism)
        self.turned = self._coordinate

    def _add(self, joint: int, name: str, mechanism: bool) -> None:
        model, data = self._model, self._data
        kind, limited = int(model.jnt_type[joint]), bool(model.jnt_limited[joint])
        low, high = model.jnt_range[joint].tolist() if limited else (-UNLIMITED, UNLIMITED)
        if kind == HINGE or (kind == SLIDE and mechanism):
            start = float(model.qpos0[model.jnt_qposadr[joint]]) if limited else 0.0
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
            if kind == SLIDE:
                self.hinges[own] = Hinge(np.zeros(3), along, limits, slides=True)
            else:
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
        children = {joint.child for joint in scenario.body_joints}
        roots = [tracker.root for tracker in scenario.trackers]
        free = [b.name for b in scenario.bodies if b.kind == "simulated" and b.name not in children]
        try:
            if scenario.body_joints and not free:
                return [UrdfTree(path, "", mechanism=True, fixed=True)]
            return [UrdfTree(path, root, bool(scenario.body_joints)) for root in (*roots, *free)]
        except (ValueError, RuntimeError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise RobotError(f"{path}: pinocchio cannot read it: {reason}") from error
    model = source.model
    standing = {body.name for body in scenario.bodies if body.kind == "fixed"}
    mechanism, found = bool(scenario.body_joints), list[FileTree]()
    for root in map(int, np.unique(model.body_rootid[model.jnt_bodyid])):
        is_free = FREE in model.jnt_type[joints_of(model, root)]
        is_held = mechanism and is_free and model.body(root).name in standing
        found.append(MjcfTree(model, root, mechanism, is_held))
    return found


def deviations(found: Imported, trees: list[FileTree]) -> dict[str, float]:
    """Largest deviation of a scene from its file, for each of QUANTITIES [1]; infinite for a hinge or a tree
    that one of them lacks. Angles are in rad, all else relative to the robot's mass, size or inertia."""
    scenario, off = found.scenario, dict.fromkeys(QUANTITIES, 0.0)
    driven = [tracker for tracker in scenario.trackers if not scenario.prescribes(tracker)]
    turning = [tree for tree in trees if tree.hinges]
    joined = {name for joint in scenario.body_joints for name in (joint.parent, joint.child)}
    free = {b.name: b for b in scenario.bodies if b.kind == "simulated" and b.name not in joined}
    still = [
        tree
        for tree in trees
        if not tree.hinges and not any(note.startswith(f"{LEFT_OUT} {tree.name!r}") for note in found.notes)
    ]
    if len(free) != len(still) or (len(driven) != len(turning) and not joined):
        return dict.fromkeys(QUANTITIES, inf)
    if joined:
        each = [_of_mechanism(found, tree) for tree in turning]
    else:
        each = [_of_tree(found, tracker, tree) for tracker, tree in zip(driven, turning)]
    for body, tree in zip(free.values(), still):
        own = MassProperties(body.mass, np.array(body.center_of_mass), np.array(body.inertia))
        each.append(_apart(own, _based(found, body.name, tree.whole({}))))
    for away in each:
        off |= {name: max(off[name], value) for name, value in away.items()}
    return off


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
    return off | _hinges_apart(_hinges(scenario, tracker), tree, size)


def _hinges_apart(ours: Mapping[str, Hinge], tree: FileTree, size: float) -> dict[str, float]:
    """Deviations of axes and limits of a robot of a size [m]."""
    off = {"axes": 0.0, "limits": 0.0}
    if ours.keys() != tree.hinges.keys():
        return {"axes": inf, "limits": inf}
    for name, hinge in ours.items():
        other = tree.hinges[name]
        moment = float(np.abs(hinge.moment - other.moment).max()) / (1.0 if other.slides else size)
        off["axes"] = max(off["axes"], moment, float(np.abs(hinge.axis - other.axis).max()))
        # equal limits, such as the zeros of a URDF that states none, are no limits: the importer notes it
        theirs = other.limits if other.limits[0] < other.limits[1] else (-UNLIMITED, UNLIMITED)
        apart = np.clip(hinge.limits, -UNLIMITED, UNLIMITED) - np.clip(theirs, -UNLIMITED, UNLIMITED)
        off["limits"] = max(off["limits"], float(np.abs(apart).max()))
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


Motion = tuple[Array, Array]
"""Rotation (3, 3) and translation (3,) of a body from its pose at the start, world."""


def _of_mechanism(found: Imported, tree: FileTree) -> dict[str, float]:
    """Deviations of simulated bodies that joints connect: those of a tree's joints, by their names."""
    scenario, off = found.scenario, dict.fromkeys(QUANTITIES, 0.0)
    names = {name.removesuffix(end) for name in tree.hinges for end in ("", "_x", "_y", "_z")}
    joints = [joint for joint in scenario.body_joints if joint.name in names]
    named = {body.name: body for body in scenario.bodies if body.kind == "simulated"}
    bodies = {name: named[name] for j in joints for name in (j.parent, j.child) if name in named}
    if not joints:
        return dict.fromkeys(QUANTITIES, inf)
    root = next((name for name in bodies if all(joint.child != name for joint in joints)), "")
    place, turn = tree.pose or (np.array(bodies[root].position), matrix(bodies[root].orientation))
    start = {
        name: found.start.get(name, float(np.clip(0.0, *hinge.limits))) for name, hinge in tree.hinges.items()
    }
    rng, size = np.random.default_rng(0), 1.0
    for k in range(POSTURES):
        moved = {joint.name for joint in joints} & set(tree.turned)
        # a slider moves by the robot's size, by which deviations of centres are measured
        most = {name: size if tree.hinges[name].slides else 1.0 for name in sorted(moved)}
        given = {name: rng.uniform(-far, far) if k else start[name] for name, far in most.items()}
        motions = _motions(joints, {name: q - start[name] for name, q in given.items()})
        parts = []
        for name, body in bodies.items():
            own = MassProperties(body.mass, np.array(body.center_of_mass), np.array(body.inertia))
            own = own.moved(np.array(body.position), matrix(body.orientation))
            spin, way = motions.get(name, (np.eye(3), np.zeros(3)))
            parts.append(own.moved(way, spin).moved(-turn.T @ place, turn.T))
        theirs = _based(found, root, tree.whole(given))
        for quantity, value in _apart(combined(parts), theirs).items():
            off[quantity] = max(off[quantity], value * (EQUAL / SHARED if k and tree.several else 1.0))
        size = _size(theirs) if theirs.mass > 0 else 1.0
    neutral = _motions(joints, {name: -q for name, q in start.items()})
    ours: dict[str, Hinge] = {}
    for joint in joints:
        spin, way = neutral.get(joint.parent, (np.eye(3), np.zeros(3)))
        point = turn.T @ (spin @ joint.anchor + way - place)
        axis, q = turn.T @ spin @ joint.axis, start.get(joint.name, 0.0)
        limits = joint.lower + q, joint.upper + q
        if joint.type == "ball":
            for letter, along in zip("xyz", (turn.T @ matrix(bodies[joint.child].orientation)).T):
                # a scene has no limits of ball joints, which a note says
                free = tree.hinges[f"{joint.name}_{letter}"].limits
                ours[f"{joint.name}_{letter}"] = Hinge(along, np.cross(point, along), free)
        elif joint.type == "slider":
            ours[joint.name] = Hinge(np.zeros(3), axis, limits, slides=True)
        else:
            ours[joint.name] = Hinge(axis, np.cross(point, axis), limits)
    return off | _hinges_apart(ours, tree, size)


def _motions(joints: list[BodyJoint], positions: Mapping[str, float]) -> dict[str, Motion]:
    """Motion of each child of joints, parents first, at their positions; those without one stay at 0."""
    found: dict[str, Motion] = {}
    for joint in joints:
        spin, way = found.get(joint.parent, (np.eye(3), np.zeros(3)))
        q, axis, anchor = positions.get(joint.name, 0.0), np.array(joint.axis), np.array(joint.anchor)
        if joint.type == "slider":
            found[joint.child] = spin, way + spin @ axis * q
        else:
            own = Rotation.from_rotvec(axis * q).as_matrix()
            found[joint.child] = spin @ own, way + spin @ (anchor - own @ anchor)
    return found

"""Links of a compiled robot: bodies without a hinge of their own are part of their parent; a link with
several hinges becomes as many.

MuJoCo turns a body by its joints in order, each about an axis and an anchor in the body's frame; ours has one
hinge per link, whose frame has its origin on the hinge. The mass of a body with several hinges is shared:
balls about their common anchor, whose inertia no rotation changes, hang between them. Links of a driven body
have hinges only; those of a simulated mechanism have sliders and ball joints too.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.robots.robot_error import RobotError
from touchstone.scenarios.scenario import UNBOUNDED

HINGE, SLIDE, BALL, FREE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{name}")) for name in ("HINGE", "SLIDE", "BALL", "FREE")
)
COUPLING = int(mujoco.mjtEq.mjEQ_JOINT)
"""Type of equalities of two joints."""
KINDS: dict[int, Literal["hinge", "slider", "ball"]] = {HINGE: "hinge", SLIDE: "slider", BALL: "ball"}
"""Types of joints between the links of a simulated mechanism."""
SHARE, LEAST_SHARE = 0.1, 1e-4
"""Share of a body's mass in the balls between its hinges, and the least one that is tried [1]."""
SIMULATED_SHARE = 1e-6
"""The same of a simulated mechanism [1]: its motion is to differ less from the model's than engines do."""
LEAST_MASS = 1e-12
"""Mass [kg] up to which a link counts as massless: no engine divides by it."""
SAME_POINT = 1e-9
"""Distance up to which hinges have a common anchor [m]."""
UNLIMITED = 1000.0
"""Limit of a hinge that has none [rad]: some 160 turns."""


@dataclass(frozen=True, slots=True)
class MassProperties:
    """Mass [kg], centre of mass (3,) [m] and inertia about it (3, 3) [kg m^2], in one frame."""

    mass: float
    center: Array
    inertia: Array

    def moved(self, place: Array, turn: Array) -> MassProperties:
        """The same in the frame in which this one is at `place`, with its axes as the columns of `turn`."""
        return MassProperties(self.mass, place + turn @ self.center, turn @ self.inertia @ turn.T)

    def about(self, point: Array) -> Array:
        """Inertia about a point (3, 3)."""
        arm = point - self.center
        return self.inertia + self.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


NOTHING = MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))


def combined(parts: list[MassProperties]) -> MassProperties:
    """Mass properties of several parts in one frame."""
    heavy = [part for part in parts if part.mass > 0 or part.inertia.any()]
    if len(heavy) < 2 or not any(part.mass > 0 for part in heavy):
        return heavy[0] if heavy else NOTHING
    mass = sum(part.mass for part in heavy)
    center = sum((part.mass * part.center for part in heavy), np.zeros(3)) / mass
    return MassProperties(mass, center, sum((part.about(center) for part in heavy), np.zeros((3, 3))))


@dataclass(frozen=True, slots=True)
class Member:
    """A body of the model inside a link: its index, and its pose in the link's frame."""

    body: int
    place: Array
    turn: Array


@dataclass(slots=True)
class Link:
    """Rigid link; root links have no joint.

    Attributes:
        parent: index of the parent link, -1 for the root of a tree.
        joint, place, turn, axis: name of the hinge; pose of the link's frame in the parent's at angle 0; axis
            in the parent's frame.
        limits: of the joint [rad, m].
        kind, source: type of the joint, and its index in the model.
    """

    name: str
    parent: int
    mass: MassProperties
    place: Array
    turn: Array
    members: list[Member] = field(default_factory=list)
    joint: str = ""
    axis: Array = field(default_factory=lambda: np.zeros(3))
    limits: tuple[float, float] = (0.0, 0.0)
    kind: Literal["hinge", "slider", "ball"] = "hinge"
    source: int = -1


class Freedom(NamedTuple):
    """Joint of a body: name, anchor and axis in the body's frame, limits [rad, m], type, index in model."""

    name: str
    anchor: Array
    axis: Array
    limits: tuple[float, float]
    kind: Literal["hinge", "slider", "ball"]
    source: int


def body_mass(model: Any, body: int) -> MassProperties:
    """Mass properties of a body of the model in its own frame."""
    turn = Rotation.from_quat(model.body_iquat[body], scalar_first=True).as_matrix()
    inertia = turn @ np.diag(model.body_inertia[body]) @ turn.T
    return MassProperties(
        float(model.body_mass[body]), model.body_ipos[body].copy(), (inertia + inertia.T) / 2
    )


def joints_of(model: Any, body: int) -> range:
    """Indices of a body's joints."""
    first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
    return range(first, first + count)


def joint_name(model: Any, joint: int) -> str:
    """Name of a joint, or one by its index."""
    return model.joint(joint).name or f"joint_{joint}"


def position_limits(model: Any, joint: int, unlimited: float) -> tuple[float, float]:
    """Limits of a hinge or slider from the model's reference [rad, m]; `unlimited` both ways without any."""
    if not model.jnt_limited[joint]:
        return -unlimited, unlimited
    low, high = model.jnt_range[joint].tolist()
    start = float(model.qpos0[model.jnt_qposadr[joint]])
    return low - start, high - start


class TreeBuilder:
    """Links of the tree below one body, parents first; `notes` names what cannot be kept.

    `simulated`: links have all joints of the model, else hinges only, three of them in place of a ball joint.
    """

    def __init__(self, model: Any, notes: list[str], simulated: bool = False) -> None:
        self._model, self._notes, self._simulated = model, notes, simulated
        self.links: list[Link] = []

    def add_root(self, body: int, base: str | None = None) -> None:
        """Root link from a body; `base`: name of a link without mass above it, which holds its joints."""
        model = self._model
        place, turn = model.body_pos[body].copy(), _matrix(model.body_quat[body])
        if base is not None:
            self.links.append(Link(base, -1, NOTHING, place, turn))
            self._add_jointed(body, 0, np.zeros(3), np.eye(3))
            return
        self.links.append(Link(model.body(body).name or "root", -1, NOTHING, place, turn))
        self._add_member(body, 0, np.zeros(3), np.eye(3))

    def _add_member(self, body: int, link: int, place: Array, turn: Array) -> None:
        """Make a body part of a link, and add what hangs on it."""
        if self.links[link].members:
            self._note_joints(body)
        own = self.links[link]
        own.members.append(Member(body, place, turn))
        own.mass = combined([own.mass, body_mass(self._model, body).moved(place, turn)])
        for child in range(body + 1, self._model.nbody):
            if self._model.body_parentid[child] == body:
                relative = self._model.body_pos[child], _matrix(self._model.body_quat[child])
                inside = place + turn @ relative[0], turn @ relative[1]
                if self._joints(child):
                    self._add_jointed(child, link, *inside)
                else:
                    self._add_member(child, link, *inside)

    def _joints(self, body: int) -> list[Freedom]:
        """Joints of a body that its links have."""
        model, found = self._model, []
        unlimited = UNBOUNDED if self._simulated else UNLIMITED
        for joint in joints_of(model, body):
            name, kind = joint_name(model, joint), int(model.jnt_type[joint])
            anchor = model.jnt_pos[joint].copy()
            if kind == HINGE or (kind == SLIDE and self._simulated):
                axis = model.jnt_axis[joint] / np.linalg.norm(model.jnt_axis[joint])
                limits = position_limits(model, joint, unlimited)
                found.append(Freedom(name, anchor, axis, limits, KINDS[kind], joint))
            elif kind == BALL and self._simulated:
                bounds = -UNBOUNDED, UNBOUNDED
                found.append(Freedom(name, anchor, np.array((0.0, 0.0, 1.0)), bounds, "ball", joint))
            elif kind == BALL:
                most = float(model.jnt_range[joint, 1]) if model.jnt_limited[joint] else np.pi
                for letter, axis in zip("xyz", np.eye(3)):
                    found.append(Freedom(f"{name}_{letter}", anchor, axis, (-most, most), "hinge", joint))
        return found

    def _add_jointed(self, body: int, parent: int, place: Array, turn: Array) -> None:
        """Links of a body with hinges; `place` and `turn` pose the body in the parent link's frame."""
        self._note_joints(body)
        joints = self._joints(body)
        name = self._model.body(body).name or f"body_{body}"
        anchors = np.array([joint.anchor for joint in joints])
        first = len(self.links)
        for k, (joint, anchor, axis, limits, kind, source) in enumerate(joints):
            # The first joint sits in the parent link; each further one in the link before.
            at = place + turn @ anchor if k == 0 else anchor - anchors[k - 1]
            rest, along = (turn, turn @ axis) if k == 0 else (np.eye(3), axis)
            above = parent if k == 0 else len(self.links) - 1
            own = name if k == len(joints) - 1 else f"{name}_{joint}"
            self.links.append(Link(own, above, NOTHING, at, rest, [], joint, along, limits, kind, source))
        last = len(self.links) - 1
        self._add_member(body, last, -anchors[-1], np.eye(3))
        self._share_mass(name, first, last, anchors)

    def _note_joints(self, body: int) -> None:
        model = self._model
        for joint in joints_of(model, body):
            name, kind = joint_name(model, joint), int(model.jnt_type[joint])
            if self._simulated:
                if kind == BALL and model.jnt_limited[joint]:
                    self._notes.append(f"left out: the limit of ball joint {name!r}")
            elif kind == SLIDE:
                self._notes.append(
                    f"joint {name!r} slides: it stays where it starts, since scenes have hinges only"
                )
            elif kind == BALL:
                self._notes.append(
                    f"joint {name!r} is a ball: three hinges about x, y and z with its limit each"
                )

    def _share_mass(self, name: str, first: int, last: int, anchors: Array) -> None:
        """Give the links between several hinges balls of the body's mass."""
        if first == last:
            return
        if self._simulated:
            # the balls of a light body would count as massless
            mass = self.links[last].mass.mass / (last - first)
            heavy = mass * SIMULATED_SHARE > LEAST_MASS
            self._shared(name, first, anchors, SIMULATED_SHARE if heavy else SHARE)
            if self.links[first].mass.mass <= LEAST_MASS:
                raise RobotError(f"body {name!r}: {mass:.2g} kg are too little for {len(anchors)} joints")
            return
        if np.abs(anchors - anchors[-1]).max() > SAME_POINT:
            self._notes.append(
                f"body {name!r}: its hinges have different anchors; mass and inertia are kept at the start, "
                f"and up to {LEAST_SHARE:g} of them moves otherwise than in the model"
            )
            self._shared(name, first, anchors, LEAST_SHARE)
            return
        self._shared(name, first, anchors, SHARE)

    def _shared(self, name: str, first: int, anchors: Array, share: float) -> None:
        """Take balls at the `anchors` from the mass of the last of several links, so that all weigh the same
        at the start."""
        count, origin = len(anchors) - 1, np.zeros(3)
        last = first + count
        whole = self.links[last].mass
        if whole.mass <= 0:
            raise RobotError(f"body {name!r}: has no mass, but {count + 1} joints")
        about = whole.about(origin)
        moment, least = float(np.linalg.eigvalsh(about)[0]), min(share, LEAST_SHARE)
        while share >= least:
            part, mass = share / count, whole.mass * (1 - share)
            ball = MassProperties(part * whole.mass, origin, part * moment * np.eye(3))
            placed = [replace(ball, center=anchor - anchors[-1]) for anchor in anchors[:-1]]
            center = (whole.center * whole.mass - sum(one.mass * one.center for one in placed)) / mass
            rest = MassProperties(mass, center, np.zeros((3, 3)))
            inertia = about - sum(one.about(origin) for one in placed) - rest.about(origin)
            low, middle, high = np.linalg.eigvalsh(inertia)
            if low > 0 and high <= low + middle:
                self.links[last].mass = replace(rest, inertia=inertia)
                for k in range(first, last):
                    self.links[k].mass = ball
                return
            share /= 2
        raise RobotError(f"body {name!r}: its inertia is too flat to be shared among its {count + 1} joints")


def _matrix(quaternion: Array) -> Array:
    return np.asarray(Rotation.from_quat(quaternion, scalar_first=True).as_matrix())


def world_pose(model: Any, body: int) -> tuple[Array, Array]:
    """Position (3,) [m] and axes as columns (3, 3) of a body at the start, world; joints stand at 0."""
    place, turn = np.zeros(3), np.eye(3)
    while body:
        own = _matrix(model.body_quat[body])
        place, turn = model.body_pos[body] + own @ place, own @ turn
        body = int(model.body_parentid[body])
    return place, turn

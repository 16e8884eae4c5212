"""A robot in a posture: poses, pieces in the world, gravity's load on its joints, levers of its links."""

from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from touchstone.adapters.contract import Array
from touchstone.adapters.robots.links import HINGE, SLIDE
from touchstone.adapters.robots.pieces import TYPE, PieceMaker, collides
from touchstone.scenarios.scenario import Piece


@dataclass(frozen=True, slots=True)
class Posture:
    """Positions of all joints [rad, m; MuJoCo's qpos], with a name for messages."""

    model: Any
    maker: PieceMaker
    name: str
    qpos: Array
    data: Any = field(repr=False)

    def piece(self, geom: int) -> Piece:
        body = self.model.geom_bodyid[geom]
        return self.maker.piece(geom, self.data.xpos[body], self.data.xmat[body].reshape(3, 3))

    def load(self, joint: int) -> float:
        """Torque or force that a drive needs to hold a hinge or slide against gravity [N m, N]; springs and
        gravity compensation help."""
        dof = self.model.jnt_dofadr[joint]
        return abs(float(self.data.qfrc_bias[dof] - self.data.qfrc_passive[dof]))

    def lever(self, joint: int, body: int, point: Array, direction: Array) -> float:
        """Speed of a body's point along a direction per speed of a joint [m or 1]."""
        rows = np.zeros((3, self.model.nv))
        mujoco.mj_jac(self.model, self.data, rows, None, point, body)
        return float(direction @ rows[:, self.model.jnt_dofadr[joint]])


def posture(model: Any, maker: PieceMaker, name: str, qpos: Array) -> Posture:
    """A robot at rest in a posture."""
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    return Posture(model, maker, name, qpos, data)


def postures(model: Any, maker: PieceMaker) -> list[Posture]:
    """The reference posture and every keyframe."""
    keys = [(f"keyframe {model.key(k).name or k!r}", model.key_qpos[k]) for k in range(model.nkey)]
    return [posture(model, maker, name, qpos) for name, qpos in [("the start", model.qpos0), *keys]]


def axial_joints(model: Any) -> list[int]:
    """Hinges and slides."""
    return [j for j in range(model.njnt) if int(model.jnt_type[j]) in (HINGE, SLIDE)]


def name_of(model: Any, kind: str, index: int) -> str:
    """A part by its kind and name, or number where it has none."""
    return f"{kind} {getattr(model, kind)(index).name or index!r}"


def colliding(model: Any) -> list[int]:
    """Geoms that can touch others and have a shape that scenes know."""
    known = ("plane", "sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh")
    return [
        g for g in range(model.ngeom) if collides(model, g) and TYPE.get(int(model.geom_type[g])) in known
    ]

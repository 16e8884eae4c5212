"""Bullet's solver settings, and records of createMultiBody's arguments."""

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import pybullet

from touchstone.adapters.engines.bullet.settings import OF_BODIES, SETTINGS
from touchstone.scenarios.scenario import ORIGIN

Links = tuple[int, ...]
Link = dict[str, Any]
"""Fields of a Part that place a link and say how its joint moves."""

BASE = -1
"""Bullet's index of a multibody's base; its links count from 0."""
NO_SHAPE = -1
RIGID_BODY = 1
"""Type that `getDynamicsInfo` reports for a body in maximal coordinates (BT_RIGID_BODY)."""
UNTURNED = (0.0, 0.0, 0.0, 1.0)
"""Unit quaternion, xyzw."""
FRICTION_MAX = 10.0
"""Value at which Bullet clamps the product of two frictions (MAX_FRICTION of btManifoldResult.cpp) [1]."""
SPEED_LIMIT = 1e9
"""Unreachable bound on every generalised velocity [m/s, rad/s]: Bullet's default of 100 would remove
momentum."""

SOLVER: dict[str, int | float] = {
    # pybullet's defaults of what the table of settings lacks, set explicitly; omitting them leaves runs
    # identical to the bit.
    "numNonContactInnerIterations": 1,
    "allowedCcdPenetration": 0.04,
    "minimumSolverIslandSize": 0,
    "deterministicOverlappingPairs": 0,
    "enableSAT": 0,
}
MULTIBODY: dict[str, int | float] = {
    # changeDynamics applies these to the base, whatever link it names: never mix them with LINK.
    "linearDamping": 0.0,
    "angularDamping": 0.0,
    "maxJointVelocity": SPEED_LIMIT,
    "activationState": pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
}
ASLEEP: dict[str, int | float] = {"activationState": pybullet.ACTIVATION_STATE_ENABLE_SLEEPING}
"""Setting of a base that may sleep, if requested; never of a driven one, which no force would wake."""
LINK: dict[str, int | float] = {"jointDamping": 0.0}


class Parameters(NamedTuple):
    """Settings of a profile for the solver, every base, and the base of a body with hulls; whether free balls
    and boxes are in maximal coordinates, bodies may sleep, and friction has anchors (None: by body)."""

    solver: dict[str, int | float]
    base: dict[str, int | float]
    hull: dict[str, int | float]
    maximal: bool
    sleep: bool
    anchors: bool | None


def parameters_of(profile: str, changes: Iterable[str]) -> Parameters:
    """Settings of a profile with its changes ("key=value").

    All but `default` and `maximal`: no margin of 1 mm, by which hulls hover (pybullet's quickstart guide).
    `recommended`, `equal-step`, `sleeping`: friction anchors for boxes and hulls of scenes that start at
    rest, which correct the drift of contact points that stick, as Bullet's own model of a gripper has them
    (friction_anchor in its franka_panda/panda.urdf).
    `accurate`: at four times the default rate, a quarter of the correction per step corrects at the same
    rate in time and adds a quarter of the speed to a rebound. Contacts slower than twice the speed that
    gravity adds in a step of 1/960 s rest instead of bouncing. There are no contacts ahead of a collision:
    they brake a body before it touches, and only the remaining speed bounces (bullet3, pull requests 1701
    and 3096, issue 3094).
    """
    values = SETTINGS.in_force(profile, changes)
    own = {name: values.pop(name, None) for name in OF_BODIES}
    threshold, margin = own["contactProcessingThreshold"], own["collisionMargin"]
    return Parameters(
        solver=SOLVER | values,
        base=MULTIBODY | ({} if threshold is None else {"contactProcessingThreshold": threshold}),
        hull={} if margin is None else {"collisionMargin": margin},
        maximal=bool(own["coordinates"]),
        sleep=bool(own["sleep"]),
        anchors=None if own["frictionAnchor"] is None else bool(own["frictionAnchor"]),
    )


class Part(NamedTuple):
    """A link, field by field an argument of createMultiBody; by default fixed in its parent's frame."""

    linkMasses: float
    linkCollisionShapeIndices: int
    linkInertialFramePositions: tuple[float, ...] = ORIGIN
    linkInertialFrameOrientations: tuple[float, ...] = UNTURNED
    linkPositions: tuple[float, ...] = ORIGIN
    linkOrientations: tuple[float, ...] = UNTURNED
    linkParentIndices: int = 0  # 0 = base
    linkJointTypes: int = pybullet.JOINT_FIXED
    linkJointAxis: tuple[float, ...] = (0.0, 0.0, 1.0)
    linkVisualShapeIndices: int = NO_SHAPE


class Multibody(NamedTuple):
    """A base with its links: Bullet's id, the bodies (base first), its hinges among all hinges, and whether
    the base is the first body, or none (0 or 1)."""

    id: int
    bodies: Links
    hinges: slice = slice(0)
    based: int = 1


def xyzw(quaternion: Sequence[float]) -> tuple[float, ...]:
    """Reorder a quaternion wxyz to Bullet's xyzw."""
    w, x, y, z = (float(value) for value in quaternion)
    return x, y, z, w

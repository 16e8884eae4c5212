"""What Bullet is told beside the scene: solver settings, and the shape of createMultiBody's arguments."""

from __future__ import annotations

from typing import NamedTuple

import pybullet

from touchstone.scenarios.scenario import ORIGIN

Links = tuple[int, ...]

BASE = -1
"""Bullet's number of a multibody's base; its links count from 0."""
NO_SHAPE = -1
RIGID_BODY = 1
"""What `getDynamicsInfo` calls a body in maximal coordinates (BT_RIGID_BODY)."""
UNTURNED = (0.0, 0.0, 0.0, 1.0)
"""The unit quaternion, xyzw."""
FRICTION_MAX = 10.0
"""Greatest product of two frictions (MAX_FRICTION of btManifoldResult.cpp) [1]: Bullet cuts it there."""
SPEED_LIMIT = 1e9
"""Bound on every generalised velocity [m/s, rad/s], out of reach: Bullet's 100 cuts momentum."""

SOLVER: dict[str, int | float] = {
    # pybullet's defaults, set on purpose: leaving them out changes no bit of a run
    "numSubSteps": 0,
    "numSolverIterations": 50,
    "numNonContactInnerIterations": 1,
    "constraintSolverType": pybullet.CONSTRAINT_SOLVER_LCP_SI,
    "solverResidualThreshold": 1e-7,
    "warmStartingFactor": 0.1,
    "enableConeFriction": 1,
    "erp": 0.2,
    "contactERP": 0.08,
    "frictionERP": 0.2,
    "globalCFM": 0.0,
    "contactSlop": 1e-5,
    "useSplitImpulse": 1,
    "splitImpulsePenetrationThreshold": -0.04,
    "restitutionVelocityThreshold": 0.2,
    "contactBreakingThreshold": 0.02,
    "allowedCcdPenetration": 0.04,
    "minimumSolverIslandSize": 0,
    "deterministicOverlappingPairs": 0,
    "enableSAT": 0,
}
MULTIBODY: dict[str, int | float] = {
    # changeDynamics with any of these goes to the base, whatever link it names: never mix with LINK
    "linearDamping": 0.0,
    "angularDamping": 0.0,
    "maxJointVelocity": SPEED_LIMIT,
    "activationState": pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
}
SLEEPING: dict[str, int | float] = {"activationState": pybullet.ACTIVATION_STATE_ENABLE_SLEEPING}
"""Of a base that may sleep, where that is asked for; never of a driven one, which no force would wake."""
LINK: dict[str, int | float] = {"jointDamping": 0.0, "rollingFriction": 0.0, "spinningFriction": 0.0}


# `recommended` is `default`: "in many cases it is best to leave the timeStep to default, which is 240Hz.
# Several parameters are tuned with this value in mind. For example the number of solver iterations and the
# error reduction parameters" (pybullet's quickstart guide, setTimeStep), and "useMaximalCoordinates:
# experimental, best to leave it 0/false" (createMultiBody). Damping and sleep are off under all profiles.


class Told(NamedTuple):
    """What a profile tells the solver, every base, and the base of a body with hulls."""

    solver: dict[str, int | float]
    base: dict[str, int | float]
    hull: dict[str, int | float]


DEFAULT = Told(SOLVER, MULTIBODY, {})
ACCURATE = Told(
    solver=SOLVER
    | {
        # at four times the default rate a quarter of the correction per step: as fast in time, and a quarter
        # of the speed that it adds to a rebound
        "contactERP": 0.02,
        # twice what gravity gives a body in a step of 1/960 s [m/s]: slower is rest, not a bounce
        "restitutionVelocityThreshold": 0.02,
    },
    base=MULTIBODY
    | {
        # no contacts ahead of a collision: they brake a body before it meets the other, and only what speed
        # it has left bounces (bullet3, pull request 1701 and issue 3094)
        "contactProcessingThreshold": 0.0,
    },
    # else hulls hover by 1 mm (pybullet's quickstart guide, changeDynamics); reaches no hull of a link
    hull={"collisionMargin": 0.0},
)


class Part(NamedTuple):
    """A link, field by field an argument of createMultiBody; on its own fixed in the frame of its parent."""

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
    """A base with its links: its id in Bullet, its bodies (base first), its hinges among all hinges."""

    id: int
    bodies: Links
    hinges: slice

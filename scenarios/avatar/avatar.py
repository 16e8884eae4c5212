"""Articulated person: a tracked torso, head, arms and legs on 27 hinges; and one arm with a hand.

At angles 0 the person stands upright with hanging arms, palms to the thighs, and every link's axes are the
torso's: x forward, y left, z up; the torso's origin lies between the hips. The right side mirrors the left
one, so equal angles give mirrored postures. A ball joint is three hinges through one point, the third along
the bone.

Lengths, masses, centres and inertias: de Leva, "Adjustments to Zatsiorsky-Seluyanov's segment inertia
parameters", Journal of Biomechanics 29(9), 1996, table 4, men of 1.741 m and 73.0 kg. Shoulders and hands:
Drillis and Contini's proportions after Winter, "Biomechanics and Motor Control of Human Movement", figure
4.1. Ranges of motion: American Academy of Orthopaedic Surgeons, "Joint Motion", 1965, except the shoulder's
combined motions, which are ours. Widths and depths are those of a medium adult, rounded to centimetres.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from math import atan2, cos, hypot, pi, radians, sin
from typing import NamedTuple

import numpy as np

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.chains import ball_limits
from touchstone.scenarios.avatar.hand import PALM_HALF_EXTENTS, hand_parts
from touchstone.scenarios.scenario import (
    IDENTITY,
    ORIGIN,
    Body,
    Box,
    Chain,
    Hull,
    Joint,
    Matrix,
    Piece,
    Quaternion,
    ReachCone,
    Tracker,
    Vector,
)
from touchstone.scenarios.solids import elliptic_hull, sphere_inertia
from touchstone.scenarios.transforms import Changes, each, mapped

STATURE, MASS = 1.741, 73.0
"""Height [m] and mass [kg]."""


class Segment(NamedTuple):
    """Length [m]; mass relative to the body's; centre of mass from the inner end, and radii of gyration about
    x, y and z, relative to the length."""

    length: float
    mass: float
    center: float
    gyration: tuple[float, float, float]


SEGMENTS: dict[str, Segment] = {
    "head": Segment(0.2429, 0.0694, 1 - 0.5002, (0.303, 0.315, 0.261)),
    "torso": Segment(0.6033, 0.4346, 1 - 0.5138, (0.328, 0.306, 0.169)),
    "upper_arm": Segment(0.2817, 0.0271, 0.5772, (0.285, 0.269, 0.158)),
    "forearm": Segment(0.2689, 0.0162, 0.4574, (0.276, 0.265, 0.121)),
    "hand": Segment(0.0862, 0.0061, 0.7900, (0.513, 0.628, 0.401)),
    "thigh": Segment(0.4222, 0.1416, 0.4095, (0.329, 0.329, 0.149)),
    "shank": Segment(0.4340, 0.0433, 0.4459, (0.255, 0.249, 0.103)),
    "foot": Segment(0.2581, 0.0137, 0.4415, (0.124, 0.245, 0.257)),
}
HIP_HEIGHT = STATURE - SEGMENTS["head"].length - SEGMENTS["torso"].length
"""Height of the torso's origin above the soles [m]."""
ANKLE_HEIGHT = HIP_HEIGHT - SEGMENTS["thigh"].length - SEGMENTS["shank"].length
HEEL = 0.06
"""Distance of the heel behind the ankle [m]."""
HAND_LENGTH = 0.108 * STATURE
SHOULDER: Vector = (0.0, 0.20, 0.818 * STATURE - HIP_HEIGHT)
HIP: Vector = (0.0, 0.085, 0.0)
"""Left joints in the torso's frame [m]."""
JOINT_SHARE = 0.1
"""Share of a segment's mass in the ball of tissue about its inner joint, divided among the links between its
hinges. The ball is centred on the joint, so the segment's mass, centre and inertia are the same in every
posture."""
TISSUE_DENSITY = 1100.0
"""Density of tissue [kg/m^3]."""
BEND: dict[str, tuple[tuple[Vector, float, float], ...]] = {
    # Hinges of the left side: axis, limits [degrees].
    "elbow": (((0.0, -1.0, 0.0), 0.0, 150.0),),
    "wrist": (((-1.0, 0.0, 0.0), -70.0, 80.0), ((0.0, -1.0, 0.0), -30.0, 20.0)),
    "knee": (((0.0, 1.0, 0.0), 0.0, 135.0),),
    "ankle": (((0.0, -1.0, 0.0), -50.0, 20.0), ((1.0, 0.0, 0.0), -35.0, 15.0)),
}
"""Flexion of elbow, wrist (towards the palm) and knee, dorsiflexion; deviation to the thumb; eversion."""
UPRIGHT: Quaternion = (0.5**0.5, 0.0, 0.5**0.5, 0.0)
"""Rotation that turns x downwards."""
DOWN: Vector = (0.0, 0.0, -1.0)
UP: Vector = (0.0, 0.0, 1.0)
SIDEWAYS: Vector = (0.0, -1.0, 0.0)
"""First axis of hips and neck: a bone never points along it."""
OBLIQUE: Vector = (0.5**0.5, -(0.5**0.5), 0.0)
"""First axis of the left shoulder: in front of the right shoulder, behind the left one; no arm points
there."""
ARM_SWING = (
    # Plane of elevation: 0 sideways, 90 forward; elevation from hanging [degrees].
    *((-90.0, 60.0), (-45.0, 70.0), (-30.0, 90.0), (-30.0, 150.0), (90.0, 180.0)),
    *((130.0, 140.0), (120.0, 90.0), (125.0, 50.0), (180.0, 15.0)),
)
ARM_CENTER = (45.0, 85.0)
CORNERS = 12
"""Number of corners of the cones of hips and neck."""
MARGIN = 0.02
"""Margin of the hinge limits of a ball joint beyond its reach cone [rad]."""

Hinges = tuple[tuple[Vector, float, float], ...]
"""Axes in the frame of the first one's parent, and limits [rad]."""
Parts = tuple[tuple[Body, ...], tuple[Joint, ...], tuple[Chain, ...]]
"""Bodies, hinges from root to tips, chains."""


@cache
def avatar_parts() -> Parts:
    """The person, torso first: neck, then arms and legs, left before right."""
    pelvis = _part("pelvis", (0.13, 0.15, 0.11), (0.0, 0.0, 0.06))
    trunk = _part("trunk", (0.25, 0.16, 0.11), (0.0, 0.0, 0.36))
    torso = _link("torso", "torso", UP, (pelvis, trunk))
    head = _link("head", "head", UP, (_part("head", (0.12, 0.075, 0.095), (0.0, 0.0, 0.123)),))
    neck, hinges = _ball("neck", (SIDEWAYS, UP), _ellipse(45, 45, 45, 45, UP), (-60, 60))
    bodies, joints = _hang("torso", "neck", (0.0, 0.0, SEGMENTS["torso"].length), hinges, head)
    chains: tuple[Chain, ...] = (Chain("neck", tuple(joint.name for joint in joints), (neck,)),)
    for left in (_arm(_hand()), _leg()):
        for limb in (left, _mirrored(left)):
            bodies, joints, chains = bodies + limb[0], joints + limb[1], chains + limb[2]
    return (torso, *bodies), joints, chains


@cache
def arm_with_hand_parts() -> Parts:
    """Right arm with the hand of fifteen parts, whose fingers are in no chain. The root is the shoulder:
    another share of its ball of tissue, without a shape."""
    (palm, *fingers), finger_joints = hand_parts()
    # The hand's frame leads from the palm's middle to the wrist.
    forward = PALM_HALF_EXTENTS[0]
    palm = replace(palm, center_of_mass=(forward, 0.0, 0.0))
    finger_joints = tuple(
        replace(j, position=(j.position[0] + forward, *j.position[1:])) if j.parent == "palm" else j
        for j in finger_joints
    )
    bodies, joints, chains = _mirrored(_arm(palm))
    # Fingers down, thumb forward.
    joints = (*joints[:-1], replace(joints[-1], orientation=(0.5, 0.5, 0.5, -0.5)))
    shoulder = replace(bodies[0], name="shoulder")
    joints = (replace(joints[0], parent="shoulder", position=ORIGIN), *joints[1:])
    return (shoulder, *bodies, *fingers), (*joints, *finger_joints), chains


def standing_tracker(
    parts: Parts, position: Vector, duration: float, orientation: Quaternion = IDENTITY
) -> Tracker:
    """Tracker that holds the parts' root at a pose, with all angles 0."""
    names = tuple(joint.name for joint in parts[1])
    angles = ((0.0,) * len(names),) * 2
    return Tracker(parts[0][0].name, names, (0.0, duration), (position,) * 2, (orientation,) * 2, angles)


def _arm(hand: Body) -> Parts:
    upper_arm = _link("left_upper_arm", "upper_arm", DOWN, (_rod("left_upper_arm", "upper_arm", 0.045),))
    forearm = _link("left_forearm", "forearm", DOWN, (_rod("left_forearm", "forearm", 0.04),))
    corners = tuple(_arm_direction(*ends) for ends in ARM_SWING)
    axes, swing = (OBLIQUE, DOWN), (_arm_direction(*ARM_CENTER), *corners)
    cone, hinges = _ball("left_shoulder", axes, swing, (-90, 70))
    elbow, wrist = (0.0, 0.0, -SEGMENTS["upper_arm"].length), (0.0, 0.0, -SEGMENTS["forearm"].length)
    parts = (
        _hang("torso", "left_shoulder", SHOULDER, hinges, upper_arm),
        _hang(upper_arm.name, "left_elbow", elbow, _bend("elbow"), forearm),
        _hang(forearm.name, "left_wrist", wrist, _bend("wrist"), hand),
    )
    return _chained("left_arm", parts, cone)


def _hand() -> Body:
    half = HAND_LENGTH / 2
    return _link("left_hand", "hand", DOWN, (_part("left_hand", (half, 0.015, 0.042), (0.0, 0.0, -half)),))


def _leg() -> Parts:
    thigh = _link("left_thigh", "thigh", DOWN, (_rod("left_thigh", "thigh", 0.075),))
    shank = _link("left_shank", "shank", DOWN, (_rod("left_shank", "shank", 0.055),))
    length, height = SEGMENTS["foot"].length, ANKLE_HEIGHT
    sole = Piece("left_foot", Box((length / 2, 0.045, height / 2)), (length / 2 - HEEL, 0.0, -height / 2))
    foot = _link("left_foot", "foot", (1.0, 0.0, 0.0), (sole,), (-HEEL, 0.0, -height / 2))
    cone, hinges = _ball("left_hip", (SIDEWAYS, DOWN), _ellipse(120, 30, 45, 30, DOWN), (-45, 45))
    knee, ankle = (0.0, 0.0, -SEGMENTS["thigh"].length), (0.0, 0.0, -SEGMENTS["shank"].length)
    parts = (
        _hang("torso", "left_hip", HIP, hinges, thigh),
        _hang(thigh.name, "left_knee", knee, _bend("knee"), shank),
        _hang(shank.name, "left_ankle", ankle, _bend("ankle"), foot),
    )
    return _chained("left_leg", parts, cone)


def _chained(
    name: str, parts: Iterable[tuple[tuple[Body, ...], tuple[Joint, ...]]], cone: ReachCone
) -> Parts:
    bodies = tuple(body for own, _ in parts for body in own)
    joints = tuple(joint for _, own in parts for joint in own)
    return bodies, joints, (Chain(name, tuple(joint.name for joint in joints), (cone,)),)


def _link(name: str, segment: str, along: Vector, pieces: tuple[Piece, ...], start: Vector = ORIGIN) -> Body:
    """Body of a segment that extends from `start` along a direction of the link's frame."""
    length, share, center, (x, y, z) = SEGMENTS[segment]
    mass = share * MASS
    moments = mass * (length * np.array((x, y, z))) ** 2
    place = np.array(start) + center * length * np.array(along)
    return Body(
        name,
        "driven",
        "human",
        pieces,
        mass=mass,
        center_of_mass=_vector(place),
        inertia=_matrix(np.diag(moments)),
    )


def _hang(
    parent: str, name: str, position: Vector, hinges: Hinges, link: Body
) -> tuple[tuple[Body, ...], tuple[Joint, ...]]:
    """Link on hinges through one point; balls of tissue between them share part of its mass."""
    numbered = [f"{name}_{k}" for k in range(1, len(hinges) + 1)] if len(hinges) > 1 else [name]
    bodies = (*_balls(link, numbered[:-1]), _without_balls(link) if len(hinges) > 1 else link)
    joints = []
    for own, (axis, lower, upper), child in zip(numbered, hinges, bodies):
        joints.append(Joint(own, parent, child.name, position, axis, lower=lower, upper=upper))
        parent, position = child.name, ORIGIN
    return bodies, tuple(joints)


def _balls(link: Body, names: list[str]) -> tuple[Body, ...]:
    """Bodies with equal shares of the ball of tissue about a link's origin."""
    if not names:
        return ()
    mass = JOINT_SHARE * link.mass / len(names)
    inertia = sphere_inertia(mass, _ball_radius(link))
    return tuple(Body(name, "driven", "human", (), mass=mass, inertia=inertia) for name in names)


def _ball_radius(link: Body) -> float:
    return float((JOINT_SHARE * link.mass / TISSUE_DENSITY * 3 / (4 * pi)) ** (1 / 3))


def _without_balls(link: Body) -> Body:
    """Link without the ball of tissue about its origin."""
    ball = JOINT_SHARE * link.mass
    mass, center = link.mass - ball, np.array(link.center_of_mass) * link.mass / (link.mass - ball)
    inertia = np.array(link.inertia) + _steiner(link.mass, np.array(link.center_of_mass))
    inertia -= np.array(sphere_inertia(ball, _ball_radius(link))) + _steiner(mass, center)
    return replace(link, mass=mass, center_of_mass=_vector(center), inertia=_matrix(inertia))


def _steiner(mass: float, arm: Array) -> Array:
    """Inertia about the origin of a point mass at `arm`."""
    return mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))


def _bend(name: str) -> Hinges:
    return tuple((axis, radians(lower), radians(upper)) for axis, lower, upper in BEND[name])


def _ball(
    name: str, axes: tuple[Vector, Vector], swing: tuple[Vector, ...], twist: tuple[float, float]
) -> tuple[ReachCone, Hinges]:
    """Reach cone and hinges of a ball joint.

    Takes its first and third axis, the centre and corners of its swing, and its twist [degrees]; hinge limits
    contain the cone.
    """
    names = (f"{name}_1", f"{name}_2", f"{name}_3")
    cone = ReachCone(names, swing[0], swing[1:], (radians(twist[0]), radians(twist[1])))
    frame = np.column_stack((axes[0], np.cross(axes[1], axes[0]), axes[1]))
    limits = ball_limits(cone, frame)
    return cone, tuple(
        (_vector(axis), float(low - MARGIN), float(high + MARGIN))
        for axis, (low, high) in zip(frame.T, limits)
    )


def _ellipse(forward: float, backward: float, out: float, inward: float, rest: Vector) -> tuple[Vector, ...]:
    """Centre and corners of a swing cone.

    The corners lie at the ends of four swings from `rest` [degrees] (forward, backward, left, right) and on
    quarters of ellipses between them; the centre is their middle.
    """
    turns = 2 * pi * np.arange(CORNERS) / CORNERS * rest[2]
    ends = [
        (cos(t) * (forward if cos(t) > 0 else backward), sin(t) * (out if sin(t) > 0 else inward))
        for t in turns.tolist()
    ]
    found = []
    for ahead, aside in (((forward - backward) / 2, (out - inward) / 2), *ends):
        swing, heading = radians(hypot(ahead, aside)), atan2(aside, ahead)
        flat = np.array((cos(heading), sin(heading), 0.0))
        found.append(_vector(cos(swing) * np.array(rest) + sin(swing) * flat))
    return tuple(found)


def _arm_direction(plane: float, elevation: float) -> Vector:
    p, e = radians(plane), radians(elevation)
    return (sin(e) * sin(p), sin(e) * cos(p), -cos(e))


def _rod(name: str, segment: str, radius: float) -> Piece:
    """Elliptic hull along a limb that extends slightly beyond both joints."""
    length = SEGMENTS[segment].length
    return _part(name, (0.54 * length, radius, radius), (0.0, 0.0, -length / 2))


def _part(name: str, half_axes: Vector, position: Vector) -> Piece:
    """Elliptic hull with half axes downwards, sideways and forward [m]."""
    return Piece(name, Hull(elliptic_hull(half_axes)), position, UPRIGHT)


def _right(name: str) -> str:
    return name.replace("left_", "right_")


def _reflected(point: Vector) -> Vector:
    return (point[0], 0.0 - point[1], point[2])


def _turned(axis: Vector) -> Vector:
    """Mirror image of a rotation axis."""
    return (0.0 - axis[0], axis[1], 0.0 - axis[2])


def _inertia(matrix: Matrix) -> Matrix:
    return _matrix(np.array(matrix) * np.outer((1, -1, 1), (1, -1, 1)))


MIRRORED: Changes = {
    **dict.fromkeys(("name", "parent", "child"), _right),
    "joints": each(_right),
    **dict.fromkeys(("position", "center_of_mass"), _reflected),
    "inertia": _inertia,
    **dict.fromkeys(("axis", "center"), _turned),
    "swing": each(_turned),
}
"""What changes of parts of the left side: axes, and with them cones, change their sense; hulls and boxes are
their own mirror images."""


def _mirrored(left: Parts) -> Parts:
    bodies, joints, chains = (tuple(mapped(one, MIRRORED) for one in parts) for parts in left)
    return bodies, joints, chains


def _vector(values: Array) -> Vector:
    x, y, z = (values + 0.0).tolist()
    return (x, y, z)


def _matrix(rows: Array) -> Matrix:
    x, y, z = map(_vector, rows)
    return (x, y, z)

"""Postures of the person as joint angles: arms that reach points, stepping legs, and their trackers.

Points and directions are in the torso's frame with axes x forward, y left, z up (`avatar.py`), one row per
time. Angles are arrays by hinge name, one entry per time.
"""

from collections.abc import Mapping
from functools import cache
from math import pi, radians

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.avatar import BEND, HIP_HEIGHT, SEGMENTS, SHOULDER, avatar_parts
from touchstone.scenarios.avatar.chains import hinge_axes
from touchstone.scenarios.avatar.tracking import keyframed
from touchstone.scenarios.scenario import Joint, Tracker, Vector

Angles = Mapping[str, Array]

FREQUENCY = 15.0
"""Frequency of the critically damped coupling of a person's torso [rad/s]. The torso has less than half of
the mass it moves: an explicit step of 1/240 s diverges from 18 rad/s, so also at the hand's 50 rad/s."""
HINGE_FREQUENCY = 40.0
"""Frequency of a person's servos [rad/s]: at the hand's 70, DART diverges at 1/240 s once an arm is
pushed."""
STRETCHED = 0.999
"""Maximum reach of an arm, relative to its length [1]: when stretched, the elbow's direction is undefined."""
CLEARANCE = 0.03
"""Height of the soles above the floor when upright [m]: trackers measure it no more accurately."""
LEFT, RIGHT = 1, -1
"""Sides of the person."""
HANGING: Vector = (0.18, 0.22, SHOULDER[2] - 0.58)
"""Middle of a hanging left hand, with the elbow bent by 45 degrees [m]."""


def hanging(side: int, times: Array) -> Array:
    """Middle of a hanging hand at all times (n, 3) [m]."""
    return np.tile(np.multiply(HANGING, (1, side, 1)), (len(times), 1))


def between(start: Array, end: Array | Vector, share: Array) -> Array:
    """Points (n, 3) [m] between `start` and `end`, by the share (n,) of the path."""
    return np.asarray(start + share[:, None] * (np.asarray(end) - start))


def reach(side: int, points: Array, elbow: Vector | Array = (-0.5, 0.0, -1.0)) -> Angles:
    """Shoulder and elbow angles that place the middle of the hand at `points` (n, 3) [m], with a straight
    wrist.

    Args:
        side: 1 for the left arm, -1 for the right one.
        points: the arm points towards points out of reach.
        elbow: direction of the elbow from the line between shoulder and hand; constant, or one row per time.
    """
    upper, hand = SEGMENTS["upper_arm"].length, SEGMENTS["hand"]
    lower = SEGMENTS["forearm"].length + hand.length * hand.center
    way = points - np.array(SHOULDER) * (1, side, 1)
    distance = np.linalg.norm(way, axis=1, keepdims=True)
    toward = way / distance
    distance = np.minimum(distance, (upper + lower) * STRETCHED)
    cosine = (distance**2 + upper**2 - lower**2) / (2 * distance * upper)
    out = _unit(elbow - toward * (toward * elbow).sum(axis=1, keepdims=True))
    bone = cosine * toward + np.sqrt(1 - cosine**2) * out
    # At angles 0 the upper arm points down, and the forearm bends towards its x.
    forearm = distance * toward - upper * bone
    ahead = _unit(forearm - bone * (forearm * bone).sum(axis=1, keepdims=True))
    turned = np.stack((ahead, np.cross(-bone, ahead), -bone), axis=2)
    name = "left" if side > 0 else "right"
    bent = np.arccos((distance[:, 0] ** 2 - upper**2 - lower**2) / (2 * upper * lower))
    return _ball_angles(f"{name}_shoulder", Rotation.from_matrix(turned)) | {f"{name}_elbow": bent}


def step(side: int, forward: Array, knee: Array) -> Angles:
    """Angles of a leg swung forward, with its knee bent [rad] and its sole as level as the ankle allows."""
    name = "left" if side > 0 else "right"
    swung = Rotation.from_rotvec(np.outer(-forward, (0.0, 1.0, 0.0)))
    (_, low, high), _ = BEND["ankle"]
    level = np.clip(knee - forward, radians(low), radians(high))
    return _ball_angles(f"{name}_hip", swung) | {f"{name}_knee": knee, f"{name}_ankle_1": level}


def person_tracker(times: Array, places: Array, heading: float, *angles: Angles) -> Tracker:
    """Tracker of the upright person, with the torso above `places` (n, 2) [m] and its x rotated by `heading`
    from the world's [rad]; hinges that `angles` do not name stay at 0."""
    bodies, joints, _ = avatar_parts()
    mass = sum(body.mass for body in bodies)
    named = {name: rows for limb in angles for name, rows in limb.items()}
    still = np.zeros(len(times))
    rows = np.column_stack([named.get(joint.name, still) for joint in joints])
    height = np.full(len(times), HIP_HEIGHT + CLEARANCE)
    turned = (float(np.cos(heading / 2)), 0.0, 0.0, float(np.sin(heading / 2)))
    return keyframed(
        bodies[0].name,
        times,
        np.column_stack((places, height)),
        turned,
        [joint.name for joint in joints],
        rows,
        stiffness=mass * FREQUENCY**2,
        damping=2 * mass * FREQUENCY,
        hinge_frequency=HINGE_FREQUENCY,
    )


def _ball_angles(name: str, turned: Rotation) -> dict[str, Array]:
    """Angles of a ball joint's hinges for an orientation of its bone's frame, each within half a turn of the
    middle of its limits."""
    hinges = tuple(_joints()[f"{name}_{k}"] for k in (1, 2, 3))
    axes = Rotation.from_matrix(hinge_axes(hinges))
    angles = (axes.inv() * turned * axes).as_euler("XYZ")
    middle = np.array([(hinge.lower + hinge.upper) / 2 for hinge in hinges])
    angles = middle + (angles - middle + pi) % (2 * pi) - pi
    return {hinge.name: angles[:, k] for k, hinge in enumerate(hinges)}


@cache
def _joints() -> dict[str, Joint]:
    return {joint.name: joint for joint in avatar_parts()[1]}


def _unit(rows: Array) -> Array:
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)

"""Postures of the person in joint angles: arms that reach for points, legs that step, trackers of both.

Points and directions are in the torso's frame, whose axes are x forward, y left, z up (`avatar.py`), one row
a moment. Angles are by the names of their hinges, one a moment.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from math import pi, radians

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.scenarios.avatar.avatar import BEND, HIP_HEIGHT, SEGMENTS, SHOULDER, avatar_parts
from touchstone.scenarios.avatar.chains import hinge_axes
from touchstone.scenarios.scenario import Joint, Tracker, Vector, vector

Array = NDArray[np.float64]
Angles = Mapping[str, Array]

FREQUENCY = 15.0
"""Of the coupling of a person's torso [rad/s], critically damped. The torso is less than half of what it
moves: from 18 rad/s on an explicit step of 1/240 s diverges, and so it would at the hand's 50 rad/s."""
HINGE_FREQUENCY = 40.0
"""Of a person's servos [rad/s]: at the hand's 70 DART diverges at 1/240 s, once an arm is pushed."""
STRETCHED = 0.999
"""Share of its length that an arm reaches at most [1]: a stretched one does not tell where the elbow is."""
CLEARANCE = 0.03
"""Of the soles over the floor, upright [m]: a tracker knows the height of a person's soles no better."""
LEFT, RIGHT = 1, -1
"""Sides of the person."""
HANGING: Vector = (0.18, 0.22, SHOULDER[2] - 0.58)
"""The middle of a left hand that hangs, the elbow bent by half a right angle [m]."""


def hanging(side: int, times: Array) -> Array:
    """The middle of a hand that hangs (n, 3) [m], at every moment."""
    return np.tile(np.multiply(HANGING, (1, side, 1)), (len(times), 1))


def between(start: Array, end: Array | Vector, share: Array) -> Array:
    """Points (n, 3) on the way from `start` to `end` [m], by the share (n,) of it that is done."""
    return np.asarray(start + share[:, None] * (np.asarray(end) - start))


def reach(side: int, points: Array, elbow: Vector | Array = (-0.5, 0.0, -1.0)) -> Angles:
    """Shoulder and elbow, so that the middle of the hand is at `points` (n, 3) [m], the wrist straight.

    Args:
        side: 1 for the left arm, -1 for the right one.
        points: those out of reach are pointed at.
        elbow: where it points, seen from the line between shoulder and hand; always, or a row a moment.
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
    # at angles 0 the upper arm points down, and the forearm bends to its x
    forearm = distance * toward - upper * bone
    ahead = _unit(forearm - bone * (forearm * bone).sum(axis=1, keepdims=True))
    turned = np.stack((ahead, np.cross(-bone, ahead), -bone), axis=2)
    name = "left" if side > 0 else "right"
    bent = np.arccos((distance[:, 0] ** 2 - upper**2 - lower**2) / (2 * upper * lower))
    return _ball_angles(f"{name}_shoulder", Rotation.from_matrix(turned)) | {f"{name}_elbow": bent}


def step(side: int, forward: Array, knee: Array) -> Angles:
    """A leg swung forward, its knee bent [rad], its sole as level as the ankle lets it be."""
    name = "left" if side > 0 else "right"
    swung = Rotation.from_rotvec(np.outer(-forward, (0.0, 1.0, 0.0)))
    (_, low, high), _ = BEND["ankle"]
    level = np.clip(knee - forward, radians(low), radians(high))
    return _ball_angles(f"{name}_hip", swung) | {f"{name}_knee": knee, f"{name}_ankle_1": level}


def person_tracker(times: Array, places: Array, heading: float, *angles: Angles) -> Tracker:
    """The person's tracker: upright, its torso over `places` (n, 2) [m], its x turned by `heading` from the
    world's [rad]; hinges that `angles` do not name stay at 0."""
    bodies, joints, _ = avatar_parts()
    mass = sum(body.mass for body in bodies)
    named = {name: rows for limb in angles for name, rows in limb.items()}
    still = np.zeros(len(times))
    rows = np.column_stack([named.get(joint.name, still) for joint in joints])
    height = np.full(len(times), HIP_HEIGHT + CLEARANCE)
    turned = (float(np.cos(heading / 2)), 0.0, 0.0, float(np.sin(heading / 2)))
    return Tracker(
        root=bodies[0].name,
        joints=tuple(joint.name for joint in joints),
        times=tuple(times.tolist()),
        positions=tuple(map(vector, np.column_stack((places, height)))),
        orientations=(turned,) * len(times),
        angles=tuple(map(tuple, rows.tolist())),
        stiffness=mass * FREQUENCY**2,
        damping=2 * mass * FREQUENCY,
        hinge_frequency=HINGE_FREQUENCY,
    )


def _ball_angles(name: str, turned: Rotation) -> dict[str, Array]:
    """Angles of a ball joint's hinges at which its bone's frame is turned so, each within half a turn of the
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

"""Driven bodies of an imported robot: joints, chains, the tracker that holds the start posture, and the
floor."""

from collections.abc import Collection
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.robots.links import Link
from touchstone.adapters.robots.pieces import SLAB, quaternion
from touchstone.scenarios.avatar.kinematics import link_poses, piece_box
from touchstone.scenarios.scenario import Body, BodyJoint, Box, Chain, Joint, Piece, Tracker, Vector, vector
from touchstone.scenarios.solids import slab

DURATION = 1.0
"""Duration of the scene [s]: the robot holds its posture."""
FREQUENCY, ROOT_SHARE = 15.0, 0.43
"""Frequency of the critically damped coupling of a root [rad/s], and the share of the root in the mass that
it moves for which an explicit step of 1/240 s bears it; a lighter root is coupled as much more softly."""
HINGE_FREQUENCY = 50.0
"""Frequency of the servos of hinges [rad/s]."""
MOST_CHAINS = 8
"""Largest number of chains of a driven body: what the reference turns by inverse kinematics."""
CLEARANCE = 1e-3
"""Height of a robot above its floor [m]."""


@dataclass(slots=True)
class Parts:
    """Parts of a scene under construction.

    Attributes:
        standing: names of the bodies of mechanisms on the world.
        geoms: of a body the index of its tree's root in the model, 0 for the world, and its geoms there.
        start: of the model's joints the coordinate at the start, from its reference [rad, m], in the order
            of `body_joints`.
        coupled: the same of those that are coupled, known before.
    """

    bodies: list[Body] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)
    trackers: list[Tracker] = field(default_factory=list)
    chains: list[Chain] = field(default_factory=list)
    body_joints: list[BodyJoint] = field(default_factory=list)
    contact_exclusions: list[tuple[str, ...]] = field(default_factory=list)
    standing: set[str] = field(default_factory=set)
    geoms: dict[str, tuple[int, list[int]]] = field(default_factory=dict)
    start: dict[int, float] = field(default_factory=dict)
    coupled: dict[int, float] = field(default_factory=dict)


def free_name(name: str, taken: Collection[str]) -> str:
    """The name, or with a number behind it if it is taken."""
    number, found = 2, name
    while found in taken:
        found, number = f"{name}_{number}", number + 1
    return found


def named_once(pieces: list[Piece]) -> tuple[Piece, ...]:
    """Pieces with distinct names."""
    found: list[Piece] = []
    for piece in pieces:
        found.append(replace(piece, name=free_name(piece.name, [other.name for other in found])))
    return tuple(found)


def add_hinges(links: list[Link], parts: Parts) -> None:
    """Joints, tracker and chains of a driven body."""
    joints: list[Joint] = []
    for link in links[1:]:
        name = free_name(link.joint, [joint.name for joint in (*parts.joints, *joints)])
        axis = link.axis / np.linalg.norm(link.axis)
        turn, above = quaternion(Rotation.from_matrix(link.turn)), links[link.parent].name
        joints.append(Joint(name, above, link.name, vector(link.place), vector(axis), turn, *link.limits))
    start = tuple(float(np.clip(0.0, *link.limits)) for link in links[1:])
    mass, root = sum(link.mass.mass for link in links), links[0].mass.mass
    frequency = FREQUENCY * min(1.0, root / (mass * ROOT_SHARE))
    parts.joints += joints
    parts.trackers.append(
        Tracker(
            root=links[0].name,
            joints=tuple(joint.name for joint in joints),
            times=(0.0, DURATION),
            positions=(vector(links[0].place),) * 2,
            orientations=(quaternion(Rotation.from_matrix(links[0].turn)),) * 2,
            angles=(start,) * 2,
            stiffness=mass * frequency**2,
            damping=2 * mass * frequency,
            hinge_frequency=HINGE_FREQUENCY,
        )
    )
    parts.chains += _chains(links, [joint.name for joint in joints])


def _chains(links: list[Link], joints: list[str]) -> list[Chain]:
    """Chains: runs of hinges without a branch between them, each called like its first hinge; the longest."""
    count = [sum(other.parent == k for other in links) for k in range(len(links))]
    runs: list[list[str]] = []
    for k, link in enumerate(links[1:], start=1):
        if link.parent == k - 1 and link.parent > 0 and count[link.parent] == 1:
            runs[-1].append(joints[k - 1])
        else:
            runs.append([joints[k - 1]])
    kept = sorted(runs, key=len, reverse=True)[:MOST_CHAINS]
    return [Chain(run[0], tuple(run)) for run in runs if run in kept]


def place_floor(parts: Parts, notes: list[str]) -> None:
    """Add a floor under what moves if there is none; raise what starts in the floor."""
    low = _lowest(parts)
    if low is None:
        return
    floors = [
        body.position[2] + piece.position[2] + SLAB[2]
        for body in parts.bodies
        if body.kind == "fixed"
        for piece in body.pieces
        if piece.shape == Box(SLAB) and piece.orientation[0] > 1 - 1e-9
    ]
    if not any(body.kind == "fixed" for body in parts.bodies):
        floor = slab(free_name("floor", [body.name for body in parts.bodies]), "floor")
        x, y, z = floor.position
        parts.bodies.insert(0, replace(floor, position=(x, y, z + low - CLEARANCE)))
        notes.append(f"floor: added {CLEARANCE * 1e3:g} mm below the robot, at z = {low - CLEARANCE:.4g} m")
    elif floors and low < max(floors):
        rise = max(floors) - low + CLEARANCE
        notes.append(f"start: raised by {rise:.4g} m, since the model starts in its floor")
        for k, tracker in enumerate(parts.trackers):
            raised = tuple(_raised(place, rise) for place in tracker.positions)
            parts.trackers[k] = replace(tracker, positions=raised)
        for k, body in enumerate(parts.bodies):
            if body.kind == "simulated" and parts.body_joints and body.name not in parts.standing:
                parts.bodies[k] = replace(body, position=_raised(body.position, rise))
        for k, joint in enumerate(parts.body_joints):
            if joint.child not in parts.standing:
                parts.body_joints[k] = replace(joint, anchor=_raised(joint.anchor, rise))


def _raised(place: Vector, rise: float) -> Vector:
    return (place[0], place[1], place[2] + rise)


def _lowest(parts: Parts) -> float | None:
    """Height of the lowest point of what moves, at the start [m]; None if only mechanisms on the world do."""
    heights = [0.0] if not parts.trackers and not parts.body_joints else []
    by_name = {body.name: body for body in parts.bodies}
    for tracker in parts.trackers:
        scenario: Any = SimpleNamespace(joints=parts.joints)
        first = np.array(tracker.positions[:1]), np.array(tracker.orientations[:1])
        place, turn = link_poses(scenario, tracker, *first, np.array(tracker.angles[:1]))
        children = {joint.name: joint.child for joint in parts.joints}
        names = (tracker.root, *(children[name] for name in tracker.joints))
        for k, name in enumerate(names):
            heights += [piece_box(piece, place[k, 0], turn[k, 0])[0][2] for piece in by_name[name].pieces]
    for body in parts.bodies:
        if body.kind == "simulated" and body.name not in parts.standing:
            turned = Rotation.from_quat(body.orientation, scalar_first=True).as_matrix()
            heights += [piece_box(piece, np.array(body.position), turned)[0][2] for piece in body.pieces]
    if not heights and parts.standing:
        return None
    return float(min(heights, default=0.0))

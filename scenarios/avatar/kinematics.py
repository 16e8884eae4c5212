"""Forward kinematics of a driven body in NumPy, its joint-space inertia, and bounding boxes of pieces.

Servos, bounds and postures of every engine use this module, as do the tracked postures from which the judge
measures pressing: neither needs the reference. Conventions as in `scenario.py`: at angle q the child frame is
at the hinge's position in the parent frame, with orientation rotation(axis, q) * the hinge's orientation.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.scenarios.arrays import Array
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.extents import extents
from touchstone.scenarios.scenario import Joint, Piece, Quaternion, Scenario, Tracker


def matrix(orientation: Quaternion | Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions wxyz (..., 4)."""
    found: Array = Rotation.from_quat(np.asarray(orientation, float), scalar_first=True).as_matrix()
    return found


def hinges(scenario: Scenario, tracker: Tracker) -> Iterator[tuple[Joint, int, int]]:
    """Joints of a tracker in its order, each with the indices of its parent and its child in
    `scenario.links(tracker)`."""
    by_name = {joint.name: joint for joint in scenario.joints}
    place = {tracker.root: 0}
    for k, name in enumerate(tracker.joints, start=1):
        joint = by_name[name]
        place[joint.child] = k
        yield joint, place[joint.parent], k


def link_poses(
    scenario: Scenario, tracker: Tracker, position: Array, orientation: Array, angle: Array
) -> tuple[Array, Array]:
    """Poses of a driven body's links at t samples, root first, then the children of its joints.

    Args:
        position, orientation: of the root (t, 3) [m] and (t, 4) wxyz, world.
        angle: of the hinges (t, j) [rad].
    Returns:
        Origins (1 + j, t, 3) [m] and rotation matrices (1 + j, t, 3, 3), world.
    """
    count = 1 + len(tracker.joints)
    place, turn = np.zeros((count, len(position), 3)), np.zeros((count, len(position), 3, 3))
    place[0], turn[0] = position, matrix(orientation)
    for joint, parent, child in hinges(scenario, tracker):
        hinge = Rotation.from_rotvec(angle[:, child - 1, None] * np.array(joint.axis)).as_matrix()
        place[child] = place[parent] + turn[parent] @ np.array(joint.position)
        turn[child] = turn[parent] @ (hinge @ matrix(joint.orientation))
    return place, turn


def tracked_poses(scenario: Scenario, tracker: Tracker, times: Array) -> tuple[Array, Array]:
    """Poses of all links when root and hinges follow the tracker exactly.

    Args:
        times: (f,) [s].
    Returns:
        Positions (f, l, 3) [m] of the links' origins and orientations (f, l, 4) wxyz, world, in the order of
        `scenario.links(tracker)`.
    """
    motion = sample(tracker, times)
    place, turn = link_poses(scenario, tracker, motion.position, motion.orientation, motion.angle)
    turned = Rotation.from_matrix(turn.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return place.swapaxes(0, 1), turned.reshape(*turn.shape[:2], 4).swapaxes(0, 1)


def joint_space_inertia(scenario: Scenario, tracker: Tracker, place: Array, turn: Array) -> Array:
    """Joint-space inertia of a posed driven body, from its kinetic energy: sum of m Jv'Jv + Jw'I Jw.

    Args:
        place, turn: origins (1 + j, 3) [m] and rotation matrices (1 + j, 3, 3) of the links, world.
    Returns:
        (6 + j, 6 + j): the root's linear velocity at its origin [m/s] and angular velocity [rad/s] along the
        world axes, then the hinges' rates [rad/s].
    """
    tree = list(hinges(scenario, tracker))
    size = 6 + len(tree)
    # Columns of the Jacobians: velocities of a link's centre of mass and its rotation per coordinate.
    axes = np.array([turn[parent] @ np.array(joint.axis) for joint, parent, _ in tree]).reshape(-1, 3)
    moved_by = np.zeros((len(tree) + 1, len(tree)), bool)
    for _, parent, child in tree:
        moved_by[child] = moved_by[parent]
        moved_by[child, child - 1] = True
    inertia = np.zeros((size, size))
    for k, link in enumerate(scenario.links(tracker)):
        body = scenario.bodies[link]
        center = place[k] + turn[k] @ np.array(body.center_of_mass)
        moving, turning = np.zeros((3, size)), np.zeros((3, size))
        moving[:, :3] = turning[:, 3:6] = np.eye(3)
        moving[:, 3:6] = np.cross(np.eye(3), center - place[0]).T
        own = moved_by[k]
        turning[:, 6:][:, own] = axes[own].T
        moving[:, 6:][:, own] = np.cross(axes[own], center - place[1:][own]).T
        world = turn[k] @ np.array(body.inertia) @ turn[k].T
        inertia += body.mass * moving.T @ moving + turning.T @ world @ turning
    return inertia


def piece_box(piece: Piece, place: Array, turn: Array) -> tuple[Array, Array]:
    """Lower and upper corner (3,) [m, world] of the axis-aligned bounding box of a piece whose body has its
    origin at `place` and its axes as the columns of `turn`."""
    center, axes = place + turn @ np.array(piece.position), turn @ matrix(piece.orientation)
    low, high = extents(piece.shape, axes[None])
    return center + low[0], center + high[0]

"""Kinematics of a driven body, a tree of links connected by hinges, and its composite inertia."""

from math import cos, nan, sin

import numpy as np

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    conjugate_by,
    copy_quaternion,
    copy_vector,
    matrix_of,
    multiply,
    quaternion_of,
    rotate,
    rotation_between,
)


@kernel
def hinge_rotation(axis, c, s, rest, out_rotation):
    """Rotation of a child in its parent's frame: `rest`, then a rotation about `axis` by the angle with
    cosine c and sine s (Rodrigues)."""
    x, y, z = axis[0], axis[1], axis[2]
    for j in range(3):
        u, v, w = rest[0, j], rest[1, j], rest[2, j]
        along = (1 - c) * (x * u + y * v + z * w)
        out_rotation[0, j] = c * u + s * (y * w - z * v) + along * x
        out_rotation[1, j] = c * v + s * (z * u - x * w) + along * y
        out_rotation[2, j] = c * w + s * (x * v - y * u) + along * z


@kernel
def place(body):
    """Compute a body's rotation matrix and world centre of mass from its origin and orientation."""
    matrix_of(body["orientation"], body["rotation"])
    rotate(body["rotation"], body["center_of_mass"], body["center"])
    for i in range(3):
        body["center"][i] += body["position"][i]


@kernel
def pose_links(bodies, joints, driver):
    """Forward kinematics: world poses of a driver's links from the driver's pose and its hinges' angles."""
    _pose_root(bodies, driver)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        _pose_link(bodies, joints[k])


@kernel
def pose_moved(bodies, joints, driver):
    """`pose_links`, restricted to links whose hinge or parent has moved since they were last posed."""
    root, moved = bodies[driver["root"]], False
    for i in range(3):
        moved = moved or root["position"][i] != driver["position"][i]
    for i in range(4):
        moved = moved or root["orientation"][i] != driver["orientation"][i]
    if moved:
        _pose_root(bodies, driver)
    root["moved"] = 1 if moved else 0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        moved = bodies[joint["parent"]]["moved"] == 1 or joint["angle"] != joint["posed_angle"]
        if moved:
            _pose_link(bodies, joint)
        bodies[joint["child"]]["moved"] = 1 if moved else 0


@kernel
def _pose_root(bodies, driver):
    """Set the pose of a driver's root to the driver's pose."""
    root = bodies[driver["root"]]
    copy_vector(driver["position"], root["position"])
    copy_quaternion(driver["orientation"], root["orientation"])
    place(root)


@kernel
def _pose_link(bodies, joint):
    """Pose a hinge's child from its parent."""
    child = bodies[joint["child"]]
    measure_angle(joint)
    hang(bodies[joint["parent"]], joint, child)
    quaternion_of(child["rotation"], child["orientation"])
    place(child)
    joint["posed_angle"] = joint["angle"]


@kernel
def measure_angle(joint):
    """Compute the cosine and sine of a hinge's angle."""
    if joint["angle"] != joint["posed_angle"]:
        joint["posed_angle"] = nan
    joint["cosine"], joint["sine"] = cos(joint["angle"]), sin(joint["angle"])


@kernel
def hang(parent, joint, child):
    """Compute rotation and origin of a hinge's child from its parent's and the angle's cosine and sine."""
    joint["posed_angle"] = nan
    hinge_rotation(joint["axis"], joint["cosine"], joint["sine"], joint["rest"], child["scratch"])
    multiply(parent["rotation"], child["scratch"], child["rotation"])
    rotate(parent["rotation"], joint["position"], child["position"])
    for i in range(3):
        child["position"][i] += parent["position"][i]


@kernel
def move_links(bodies, joints, driver):
    """World velocities of a driver's links from its coupling velocity and its hinges' rates."""
    root = bodies[driver["root"]]
    _velocity_at(driver["velocity"], driver["omega"], driver["position"], root["center"], root["velocity"])
    copy_vector(driver["omega"], root["omega"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        parent, child = bodies[joint["parent"]], bodies[joint["child"]]
        rotate(parent["rotation"], joint["axis"], child["omega"])
        for i in range(3):
            child["omega"][i] = parent["omega"][i] + joint["rate"] * child["omega"][i]
        # the hinge moves with the parent; the child's centre of mass rotates about the hinge
        _velocity_at(
            parent["velocity"], parent["omega"], parent["center"], child["position"], child["velocity"]
        )
        _velocity_at(child["velocity"], child["omega"], child["position"], child["center"], child["velocity"])


@kernel
def store_shown(bodies, joints, driver):
    """Store the poses of a driver's links as those last shown."""
    for k in range(driver["joint_count"] + 1):
        body = bodies[link_of(joints, driver, k)]
        copy_vector(body["center"], body["shown_center"])
        copy_quaternion(body["orientation"], body["shown_orientation"])


@kernel
def move_from_shown(bodies, joints, driver, h):
    """World velocities of a driver's links and rates of its hinges: differences between the poses last shown
    and the current ones, over h [s]."""
    turned = driver["scratch"][0]
    for k in range(driver["joint_count"] + 1):
        body = bodies[link_of(joints, driver, k)]
        rotation_between(body["shown_orientation"], body["orientation"], turned)
        for i in range(3):
            body["velocity"][i] = (body["center"][i] - body["shown_center"][i]) / h
            body["omega"][i] = turned[i] / h
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["rate"] = (joints[k]["angle"] - joints[k]["shown_angle"]) / h


@kernel
def link_of(joints, driver, k):
    """Body of a driver's link k: the joints' children in order, then the root."""
    return driver["root"] if k == driver["joint_count"] else joints[driver["first_joint"] + k]["child"]


@kernel
def are_adjacent(bodies, a, b):
    """Whether two links are exempt from self-collision: one is the other's nearest parent with pieces, or no
    chain hinge is between them."""
    one, two = bodies[a], bodies[b]
    if one["driver"] < 0 or one["driver"] != two["driver"]:
        return False
    return one["hinge"] == two["hinge"] or one["above"] == b or two["above"] == a


@kernel
def _velocity_at(velocity, omega, origin, point, out_velocity):
    """Velocity of a rigid body's `point` from that of its `origin`; `out_velocity` may be `velocity`."""
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    out_velocity[0] = velocity[0] + omega[1] * z - omega[2] * y
    out_velocity[1] = velocity[1] + omega[2] * x - omega[0] * z
    out_velocity[2] = velocity[2] + omega[0] * y - omega[1] * x


@kernel
def composite_inertia(bodies, joints, driver, out_center, out_inertia):
    """Composite centre of mass (3,) and inertia about it (3, 3) of a driver, world; returns the mass [kg]."""
    count = driver["joint_count"]
    mass = 0.0
    out_center[:] = 0.0
    for k in range(count + 1):
        body = bodies[link_of(joints, driver, k)]
        mass += body["mass"]
        for i in range(3):
            out_center[i] += body["mass"] * body["center"][i]
    for i in range(3):
        out_center[i] /= mass
    out_inertia[:] = 0.0
    for k in range(count + 1):
        body = bodies[link_of(joints, driver, k)]
        _add_inertia(body, out_center, out_inertia)
    return mass


@kernel
def _add_inertia(body, center, out_inertia):
    """Add a body's inertia about `center` (Steiner)."""
    # a link has no inverse inertia: its `inverse_inertia` stores its inertia in world axes
    own = body["inverse_inertia"]
    conjugate_by(body["rotation"], body["inertia"], own)
    x, y, z = body["center"][0] - center[0], body["center"][1] - center[1], body["center"][2] - center[2]
    r = (x, y, z)
    square = x * x + y * y + z * z
    for i in range(3):
        for j in range(3):
            out_inertia[i, j] += own[i, j] - body["mass"] * r[i] * r[j]
        out_inertia[i, i] += body["mass"] * square


def joint_space_inertia(bodies, joints, driver):
    """Joint-space inertia of a posed driver, from its kinetic energy: sum of m Jv'Jv + Jw'I Jw.

    Returns:
        (6 + j, 6 + j): the root's linear velocity at its origin [m/s] and angular velocity [rad/s] along the
        world's axes, then the hinges' rates [rad/s].
    """
    chain = joints[driver["first_joint"] : driver["first_joint"] + driver["joint_count"]]
    above = {int(joint["child"]): k for k, joint in enumerate(chain)}
    origin = bodies[driver["root"]]["position"]
    inertia = np.zeros((6 + len(chain), 6 + len(chain)))
    for body in (int(driver["root"]), *above):
        link = bodies[body]
        moving, turning = np.zeros((3, len(inertia))), np.zeros((3, len(inertia)))
        moving[:, :3] = turning[:, 3:6] = np.eye(3)
        moving[:, 3:6] = np.cross(np.eye(3), link["center"] - origin).T
        while body in above:
            k = above[body]
            axis = bodies[chain[k]["parent"]]["rotation"] @ chain[k]["axis"]
            turning[:, 6 + k] = axis
            moving[:, 6 + k] = np.cross(axis, link["center"] - bodies[body]["position"])
            body = int(chain[k]["parent"])
        world = link["rotation"] @ link["inertia"] @ link["rotation"].T
        inertia += link["mass"] * moving.T @ moving + turning.T @ world @ turning
    return inertia

"""Mechanisms: bodies connected by joints, in the coordinates of a spanning tree of them.

Positions and rates of the tree's joints are the coordinates; the tree is therefore kept exactly. A hinge or a
slider has one position and one rate; a ball joint a quaternion, the orientation of its child in its parent's
axes, and the child's angular velocity relative to its parent, along the world's axes; a free joint the
centre of mass and the orientation of its child, and their velocities. Joints that close loops, and couplings,
are constraints between these coordinates (`continuous/mechanism_dynamics.py`).

A joint's `columns` have the velocity of everything it moves, taken at the mechanism's `center`, and the
angular velocity per rate.
"""

from math import atan2, sqrt

from touchstone.reference_impl.core.conventions import (
    JOINT_BALL,
    JOINT_FREE,
    JOINT_HINGE,
    JOINT_SLIDER,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    SMALL_ANGLE,
    column,
    copy_vector,
    cross,
    dot,
    matrix_of,
    normalise,
    plus,
    rotate,
    row,
    times,
    turn,
    vector_of,
)


@kernel
def pose_mechanism(bodies, joints, driver):
    """Pose the bodies of a mechanism by its `positions`, and set its centre and its joints' columns."""
    pose_bodies(bodies, joints, driver, driver["positions"])
    copy_vector(bodies[driver["root"]]["center"], driver["center"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        _set_columns(bodies, joints[k], driver["center"])


@kernel
def pose_bodies(bodies, joints, driver, positions):
    """Pose the bodies of a mechanism by positions of its joints; its columns stay as they are."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        _pose_child(bodies, joints[k], positions)


@kernel
def _pose_child(bodies, joint, positions):
    child, place, kind = bodies[joint["child"]], joint["place"], joint["type"]
    q, m = child["orientation"], child["rotation"]
    if kind == JOINT_FREE:
        for i in range(4):
            q[i] = positions[place + 3 + i]
        normalise(q)
        matrix_of(q, m)
        for i in range(3):
            child["center"][i] = positions[place + i]
    else:
        x, y, z, w = (
            joint["rest_turn"][1],
            joint["rest_turn"][2],
            joint["rest_turn"][3],
            joint["rest_turn"][0],
        )
        if kind == JOINT_BALL:
            w, x, y, z = positions[place], positions[place + 1], positions[place + 2], positions[place + 3]
        if joint["parent"] >= 0:
            # the product of both quaternions
            p = bodies[joint["parent"]]["orientation"]
            q[0] = p[0] * w - p[1] * x - p[2] * y - p[3] * z
            q[1] = p[0] * x + p[1] * w + p[2] * z - p[3] * y
            q[2] = p[0] * y - p[1] * z + p[2] * w + p[3] * x
            q[3] = p[0] * z + p[1] * y - p[2] * x + p[3] * w
        else:
            q[0], q[1], q[2], q[3] = w, x, y, z
        normalise(q)
        x, y, z = world_axis(bodies, joint)
        if kind == JOINT_HINGE:
            angle = positions[place]
            turn(q, angle * x, angle * y, angle * z, q)
        matrix_of(q, m)
        c = parent_point(bodies, joint, joint["parent_anchor"])
        if kind == JOINT_SLIDER:
            c = plus(c, positions[place], (x, y, z))
        for i in range(3):
            child["center"][i] = c[i] - row(m, i, joint["child_anchor"])
    rotate(m, child["center_of_mass"], child["position"])
    for i in range(3):
        child["position"][i] = child["center"][i] - child["position"][i]


@kernel
def world_axis(bodies, joint):
    """Axis of a joint in the world."""
    return parent_direction(bodies, joint, joint["axis"])


@kernel
def parent_direction(bodies, joint, v):
    """A vector in the axes of a joint's parent, in the world."""
    if joint["parent"] < 0:
        return vector_of(v)
    m = bodies[joint["parent"]]["rotation"]
    return row(m, 0, v), row(m, 1, v), row(m, 2, v)


@kernel
def parent_point(bodies, joint, v):
    """A point of a joint's parent, from its centre of mass in its axes, in the world."""
    if joint["parent"] < 0:
        return vector_of(v)
    return plus(parent_direction(bodies, joint, v), 1.0, bodies[joint["parent"]]["center"])


@kernel
def child_point(bodies, joint):
    """Anchor of a joint on its child, in the world."""
    child, v = bodies[joint["child"]], joint["child_anchor"]
    m = child["rotation"]
    return plus((row(m, 0, v), row(m, 1, v), row(m, 2, v)), 1.0, child["center"])


@kernel
def _set_columns(bodies, joint, center):
    s = joint["columns"]
    s[:, :] = 0.0
    for i in range(3):
        joint["arm"][i] = bodies[joint["child"]]["center"][i] - center[i]
    if joint["type"] == JOINT_HINGE:
        a = world_axis(bodies, joint)
        v = cross(a, plus(center, -1.0, child_point(bodies, joint)))
        for i in range(3):
            s[0, i], s[0, 3 + i] = v[i], a[i]
    elif joint["type"] == JOINT_SLIDER:
        a = world_axis(bodies, joint)
        for i in range(3):
            s[0, i] = a[i]
    elif joint["width"] > 0:
        first = joint["width"] - 3
        o = child_point(bodies, joint)
        if joint["type"] == JOINT_FREE:
            o = vector_of(bodies[joint["child"]]["center"])
        x, y, z = center[0] - o[0], center[1] - o[1], center[2] - o[2]
        for i in range(3):
            if first > 0:
                s[i, i] = 1.0
            s[first + i, 3 + i] = 1.0
        s[first, 1], s[first, 2] = -z, y
        s[first + 1, 0], s[first + 1, 2] = z, -x
        s[first + 2, 0], s[first + 2, 1] = -y, x


@kernel
def find_start_rates(bodies, joints, driver):
    """Set a mechanism's `rates` from the velocities of its bodies."""
    rates = driver["rates"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        child, c, a = bodies[joint["child"]], joint["coordinate"], world_axis(bodies, joint)
        v, w = vector_of(child["velocity"]), vector_of(child["omega"])
        if joint["type"] == JOINT_FREE:
            for i in range(3):
                rates[c + i], rates[c + 3 + i] = v[i], w[i]
            continue
        if joint["inner"] >= 0:
            parent = bodies[joint["parent"]]
            u = cross(parent["omega"], plus(child["center"], -1.0, parent["center"]))
            v = plus(plus(v, -1.0, parent["velocity"]), -1.0, u)
            w = plus(w, -1.0, parent["omega"])
        if joint["type"] == JOINT_HINGE:
            rates[c] = dot(a, w)
        elif joint["type"] == JOINT_SLIDER:
            rates[c] = dot(a, v)
        elif joint["type"] == JOINT_BALL:
            for i in range(3):
                rates[c + i] = w[i]


@kernel
def move_mechanism(bodies, joints, driver):
    """Set the velocities of a mechanism's bodies from its `rates`, at the poses of its columns."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        child = bodies[joints[k]["child"]]
        child["velocity"][:] = child["omega"][:] = 0.0
    add_velocities(bodies, joints, driver, driver["rates"])


@kernel
def add_velocities(bodies, joints, driver, rates):
    """Add to the velocities of a mechanism's bodies those at some `rates`, at the poses of its columns."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        child, s, c = bodies[joint["child"]], joint["columns"], joint["coordinate"]
        v, w = joint["push"], joint["spin"]
        v[:] = w[:] = 0.0
        if joint["inner"] >= 0:
            copy_vector(joints[joint["inner"]]["push"], v)
            copy_vector(joints[joint["inner"]]["spin"], w)
        for j in range(joint["width"]):
            for i in range(3):
                v[i] += s[j, i] * rates[c + j]
                w[i] += s[j, 3 + i] * rates[c + j]
        x, y, z = cross(w, joint["arm"])
        child["velocity"][0] += v[0] + x
        child["velocity"][1] += v[1] + y
        child["velocity"][2] += v[2] + z
        for i in range(3):
            child["omega"][i] += w[i]


@kernel
def add_rates(bodies, joints, driver, rates, share):
    """Add to a mechanism's `positions` a share [s] of `rates`, at its bodies' present poses."""
    positions = driver["positions"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        c, place = joint["coordinate"], joint["place"]
        if joint["type"] == JOINT_HINGE or joint["type"] == JOINT_SLIDER:
            positions[place] += share * rates[c]
        elif joint["type"] == JOINT_BALL:
            w = (share * rates[c], share * rates[c + 1], share * rates[c + 2])
            _turn_on(joint["turned"], positions, place, in_parent(bodies, joint, w))
        elif joint["type"] == JOINT_FREE:
            for i in range(3):
                positions[place + i] += share * rates[c + i]
            w = (share * rates[c + 3], share * rates[c + 4], share * rates[c + 5])
            _turn_on(joint["turned"], positions, place + 3, w)


@kernel
def find_way(bodies, joints, driver, start, end, out_way):
    """Compute the rates that lead in a unit of time from positions `start` to `end` of a mechanism; rotations
    are the shortest, along the axes of the bodies' present poses."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        place, c = joint["place"], joint["coordinate"]
        if joint["width"] == 1:
            out_way[c] = end[place] - start[place]
        elif joint["type"] == JOINT_BALL:
            w = _turn_between(start, end, place)
            w = parent_direction(bodies, joint, w)
            out_way[c], out_way[c + 1], out_way[c + 2] = w
        elif joint["type"] == JOINT_FREE:
            for i in range(3):
                out_way[c + i] = end[place + i] - start[place + i]
            out_way[c + 3], out_way[c + 4], out_way[c + 5] = _turn_between(start, end, place + 3)


@kernel
def _turn_between(p, q, k):
    """Shortest rotation vector between the quaternions from place k on."""
    w = q[k] * p[k] + q[k + 1] * p[k + 1] + q[k + 2] * p[k + 2] + q[k + 3] * p[k + 3]
    x = -q[k] * p[k + 1] + q[k + 1] * p[k] - q[k + 2] * p[k + 3] + q[k + 3] * p[k + 2]
    y = -q[k] * p[k + 2] + q[k + 1] * p[k + 3] + q[k + 2] * p[k] - q[k + 3] * p[k + 1]
    z = -q[k] * p[k + 3] - q[k + 1] * p[k + 2] + q[k + 2] * p[k + 1] + q[k + 3] * p[k]
    size = sqrt(x * x + y * y + z * z)
    factor = 2.0 if size < SMALL_ANGLE else 2 * atan2(size, abs(w)) / size
    if w < 0:
        factor = -factor
    return factor * x, factor * y, factor * z


@kernel
def in_parent(bodies, joint, v):
    """A world vector in the axes of a joint's parent."""
    if joint["parent"] < 0:
        return v[0], v[1], v[2]
    m = bodies[joint["parent"]]["rotation"]
    return column(m, 0, v), column(m, 1, v), column(m, 2, v)


@kernel
def _turn_on(q, positions, place, w):
    """Turn the quaternion from `place` on by a rotation vector; q is scratch."""
    for i in range(4):
        q[i] = positions[place + i]
    turn(q, w[0], w[1], w[2], q)
    for i in range(4):
        positions[place + i] = q[i]


@kernel
def loop_rates(bodies, joint, k, out_row):
    """Constraint k of a joint that closes a loop: the rate at which it parts, by velocities taken at the
    origin of `out_row`: 6 factors of the child's velocity at the joint and of its angular velocity.

    Returns:
        Whether there is such a constraint. The first three part the anchors along the world's axes, or across
        a slider's axis; the others turn the child against its parent.
    """
    a, kind = world_axis(bodies, joint), joint["type"]
    out_row[:] = 0.0
    if k < 3:
        n = (1.0 if k == 0 else 0.0, 1.0 if k == 1 else 0.0, 1.0 if k == 2 else 0.0)
        if kind == JOINT_SLIDER:
            if k == 2:
                return False
            n = across(a, k)
        out_row[0], out_row[1], out_row[2] = n
        return True
    if kind == JOINT_BALL or (kind == JOINT_HINGE and k == 5):
        return False
    n = (1.0 if k == 3 else 0.0, 1.0 if k == 4 else 0.0, 1.0 if k == 5 else 0.0)
    if kind == JOINT_HINGE:
        n = across(a, k - 3)
    out_row[3], out_row[4], out_row[5] = n
    return True


@kernel
def across(a, k):
    """Two unit vectors perpendicular to the unit vector a."""
    least = 0 if abs(a[0]) <= abs(a[1]) and abs(a[0]) <= abs(a[2]) else (1 if abs(a[1]) <= abs(a[2]) else 2)
    e = (1.0 if least == 0 else 0.0, 1.0 if least == 1 else 0.0, 1.0 if least == 2 else 0.0)
    n = cross(a, e)
    n = times(1 / dot(n, n) ** 0.5, n)
    return n if k == 0 else cross(a, n)


@kernel
def loop_gap(bodies, joint, k, n):
    """How far constraint k of a loop's joint is open along its direction n [m or rad]."""
    if k < 3:
        return dot(
            n, plus(child_point(bodies, joint), -1.0, parent_point(bodies, joint, joint["parent_anchor"]))
        )
    child = bodies[joint["child"]]
    if joint["type"] == JOINT_HINGE:
        # the child's axis, which lies along the parent's at rest, has turned by a x b
        a = world_axis(bodies, joint)
        m, u = child["rotation"], joint["child_axis"]
        b = (row(m, 0, u), row(m, 1, u), row(m, 2, u))
        return dot(n, cross(a, b))
    real, u = _half_turn(bodies, joint)
    return (2.0 if real > 0 else -2.0) * dot(n, u)


@kernel
def hinge_angle(bodies, joint, axis):
    """Angle of a hinge that closes a loop, between -pi and pi [rad]."""
    real, u = _half_turn(bodies, joint)
    return 2 * atan2(dot(axis, u) * (1.0 if real > 0 else -1.0), abs(real))


@kernel
def _half_turn(bodies, joint):
    """Quaternion of the turn from rest to a joint's child, along the world's axes: real and vector part."""
    child, r = bodies[joint["child"]], joint["rest_turn"]
    q, p = child["orientation"], (1.0, 0.0, 0.0, 0.0)
    if joint["parent"] >= 0:
        o = bodies[joint["parent"]]["orientation"]
        p = (o[0], o[1], o[2], o[3])
    w = p[0] * r[0] - p[1] * r[1] - p[2] * r[2] - p[3] * r[3]
    x = p[0] * r[1] + p[1] * r[0] + p[2] * r[3] - p[3] * r[2]
    y = p[0] * r[2] - p[1] * r[3] + p[2] * r[0] + p[3] * r[1]
    z = p[0] * r[3] + p[1] * r[2] - p[2] * r[1] + p[3] * r[0]
    u = (
        -q[0] * x + q[1] * w - q[2] * z + q[3] * y,
        -q[0] * y + q[1] * z + q[2] * w - q[3] * x,
        -q[0] * z - q[1] * y + q[2] * x + q[3] * w,
    )
    real = q[0] * w + q[1] * x + q[2] * y + q[3] * z
    return real, u

"""Ball joint limits: a spherical polygon bounds the bone's direction, and an interval bounds its twist.

After Wilhelms and Van Gelder, "Fast and easy reach-cone joint limits" (Journal of Graphics Tools 6(2), 2001).
Coordinates are those of the three hinges' axes at angles 0, the third along the bone. The rotation is
Rx(q1) Ry(q2) Rz(q3); its last column is the bone, and its first column, the mark, defines the twist.
"""

from math import atan2, cos, pi, sin, sqrt

from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.kinematics.skeleton import measure_angle

CONE_SLACK = 1e-12
"""Height over an edge's plane, times the edge's length, that counts as inside [1]: some thousand roundings,
so that a projected direction is not projected again."""
HALF_TURN = 1e-14
"""1 + cosine below which the shortest rotation between two directions has no axis [1]: some 50 roundings."""
GIMBAL_COSINE = 1e-9
"""Cosine of the second angle below which only the sum of the first and third is determined [1]: the accuracy
of their directions is 1e-16 over it."""
LIMIT_SLACK = 1e-9
"""Excess over a hinge's limit that rounding of recovered angles explains [rad]; it is clamped."""


@kernel
def keep_in_cone(joints, first):
    """Project a ball joint into its reach cone, in place.

    Args:
        first: index of the ball joint's first hinge. `last_angle` of its three hinges is inside the cone: it
            is what they get where limits exclude the projection.
    Returns:
        Whether an angle changed.
    """
    joint = joints[first]
    bone_and_mark(joint, joints[first + 1], joints[first + 2], joint["bone"], joint["mark"])
    if not project(joint):
        return False
    if not recover_angles(joints, first):
        for k in range(first, first + 3):
            joints[k]["angle"] = joints[k]["last_angle"]
    for k in range(first, first + 3):
        measure_angle(joints[k])
    return True


@kernel
def keep_in_cones(joints, first, last):
    """Project every ball joint of hinges `first` to `last` into its reach cone."""
    for k in range(first, last + 1):
        measure_angle(joints[k])
    for k in range(first, last + 1):
        if joints[k]["cone_count"] > 0:
            keep_in_cone(joints, k)


@kernel
def project(joint):
    """Project `bone` on the nearest direction inside, rotating `mark` with it by the shortest rotation; then
    clamp the twist to its interval. Returns whether either was outside."""
    bone, mark, nearest = joint["bone"], joint["mark"], joint["nearest"]
    inside = is_inside(joint, bone)
    if not inside:
        nearest_direction(joint, bone, nearest)
        carry(bone, nearest, mark)
        copy_vector(nearest, bone)
    twist = twist_of(joint)
    kept = nearest_twist(twist, joint["twist_lower"], joint["twist_upper"])
    if abs(kept - twist) <= CONE_SLACK:
        return not inside
    turn_about(bone, cos(kept - twist), sin(kept - twist), mark)
    return True


@kernel
def bone_and_mark(first, second, third, out_bone, out_mark):
    """Last and first column of Rx(q1) Ry(q2) Rz(q3), from three joints' cosines and sines."""
    c1, c2, c3 = first["cosine"], second["cosine"], third["cosine"]
    s1, s2, s3 = first["sine"], second["sine"], third["sine"]
    out_bone[0], out_bone[1], out_bone[2] = s2, -s1 * c2, c1 * c2
    out_mark[0], out_mark[1], out_mark[2] = c2 * c3, c1 * s3 + s1 * s2 * c3, s1 * s3 - c1 * s2 * c3


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _volume(a, b, c):
    """(a x b) . c: positive if c is to the left of the arc from a to b."""
    return (
        (a[1] * b[2] - a[2] * b[1]) * c[0]
        + (a[2] * b[0] - a[0] * b[2]) * c[1]
        + (a[0] * b[1] - a[1] * b[0]) * c[2]
    )


@kernel
def take_corner(joint, i, out_corner):
    """Copy corner i of a reach cone."""
    for j in range(3):
        out_corner[j] = joint["cone"][i, j]


@kernel
def is_inside(joint, bone):
    """Whether the unit vector `bone` is inside the polygon or on its edges."""
    if _dot(joint["cone_center"], bone) > joint["cone_cap"]:
        return True
    center, count = joint["cone_center"], joint["cone_count"]
    corner, following = joint["corner"], joint["next_corner"]
    take_corner(joint, count - 1, following)
    left = _volume(center, following, bone)
    for i in range(count):
        copy_vector(following, corner)
        take_corner(joint, i, following)
        right = _volume(center, following, bone)
        # test the edge only if the bone is in the wedge that it spans with the centre
        if left >= 0 and right <= 0 and _volume(corner, following, bone) >= -CONE_SLACK:
            return True
        left = right
    return False


@kernel
def nearest_direction(joint, bone, out_direction):
    """Unit vector on the polygon's edges with the smallest great-circle distance to `bone`."""
    a, b, normal, foot = joint["corner"], joint["next_corner"], joint["normal"], joint["foot"]
    best, count = -2.0, joint["cone_count"]
    for i in range(count):
        take_corner(joint, i, a)
        take_corner(joint, (i + 1) % count, b)
        if _dot(a, bone) > best:
            best = _dot(a, bone)
            copy_vector(a, out_direction)
        # project the bone on the plane of the edge ab
        normal[0], normal[1] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2]
        normal[2] = a[0] * b[1] - a[1] * b[0]
        height = _dot(normal, bone) / _dot(normal, normal)
        for j in range(3):
            foot[j] = bone[j] - height * normal[j]
        size = sqrt(_dot(foot, foot))
        if size > best and _volume(normal, a, foot) >= 0 and _volume(foot, b, normal) >= 0:
            best = size
            for j in range(3):
                out_direction[j] = foot[j] / size


@kernel
def carry(start, end, vector):
    """Rotate `vector`, perpendicular to `start`, by the shortest rotation from `start` to `end`, in place."""
    size = 1 + (start[0] * end[0] + start[1] * end[1] + start[2] * end[2])
    # for opposite directions, rotate by pi about the vector itself, which leaves it unchanged
    if size > HALF_TURN:
        share = (vector[0] * end[0] + vector[1] * end[1] + vector[2] * end[2]) / size
        for i in range(3):
            vector[i] -= share * (start[i] + end[i])


@kernel
def twist_of(joint):
    """Angle about the bone from the zero-twist mark, carried from the cone's centre, to the mark [rad]."""
    zero = joint["zero"]
    copy_vector(joint["cone_mark"], zero)
    carry(joint["cone_center"], joint["bone"], zero)
    return atan2(_volume(zero, joint["mark"], joint["bone"]), _dot(zero, joint["mark"]))


@kernel
def nearest_twist(twist, lower, upper):
    """Angle in [lower, upper] nearest to `twist` on the circle; all angles are in [-pi, pi]."""
    if lower <= twist <= upper:
        return twist
    to_lower, to_upper = abs(twist - lower), abs(twist - upper)
    return lower if min(to_lower, 2 * pi - to_lower) < min(to_upper, 2 * pi - to_upper) else upper


@kernel
def turn_about(axis, c, s, vector):
    """Rotate `vector` about the unit `axis` by the angle of cosine c and sine s, in place (Rodrigues)."""
    x, y, z = vector[0], vector[1], vector[2]
    along = (1 - c) * (axis[0] * x + axis[1] * y + axis[2] * z)
    vector[0] = c * x + s * (axis[1] * z - axis[2] * y) + along * axis[0]
    vector[1] = c * y + s * (axis[2] * x - axis[0] * z) + along * axis[1]
    vector[2] = c * z + s * (axis[0] * y - axis[1] * x) + along * axis[2]


@kernel
def recover_angles(joints, first):
    """Set a ball joint's angles from its `bone` and `mark`, on the branch nearest to the current angles.

    Returns:
        Whether a branch is within the hinges' limits; if not, the angles do not change.
    """
    joint = joints[first]
    bone, mark = joint["bone"], joint["mark"]
    old1, old3 = joint["angle"], joints[first + 2]["angle"]
    level = sqrt(bone[1] * bone[1] + bone[2] * bone[2])
    if level < GIMBAL_COSINE:
        # gimbal lock determines only q3 +- q1: each angle takes half of the change
        side = 1.0 if bone[0] > 0 else -1.0
        missing = atan2(mark[1], -side * mark[2]) - old3 - side * old1
        missing = atan2(sin(missing), cos(missing)) / 2
        cost, q1, q2, q3 = _branch(joints, first, old1 + side * missing, side * pi / 2, old3 + missing)
    else:
        q1, q2 = atan2(-bone[1], bone[2]), atan2(bone[0], level)
        q3 = atan2(bone[2] * mark[1] - bone[1] * mark[2], mark[0])
        other, p1, p2, p3 = _branch(joints, first, q1 + pi, pi - q2, q3 + pi)
        cost, q1, q2, q3 = _branch(joints, first, q1, q2, q3)
        if other < cost:
            cost, q1, q2, q3 = other, p1, p2, p3
    if cost < 1e300:
        joint["angle"], joints[first + 1]["angle"], joints[first + 2]["angle"] = q1, q2, q3
        return True
    return False


@kernel
def _branch(joints, first, q1, q2, q3):
    """Squared distance of a branch from the current angles, infinite outside the limits, and its angles after
    `_wind`."""
    q1, q2, q3 = _wind(joints[first], q1), _wind(joints[first + 1], q2), _wind(joints[first + 2], q3)
    d1, d2, d3 = q1 - joints[first]["angle"], q2 - joints[first + 1]["angle"], q3 - joints[first + 2]["angle"]
    return d1 * d1 + d2 * d2 + d3 * d3, q1, q2, q3


@kernel
def _wind(joint, angle):
    """`angle` plus the whole turns that bring it nearest to the joint's within limits, or infinity."""
    angle += 2 * pi * round((joint["angle"] - angle) / (2 * pi))
    if angle > joint["upper"] + LIMIT_SLACK:
        angle -= 2 * pi
    elif angle < joint["lower"] - LIMIT_SLACK:
        angle += 2 * pi
    if angle < joint["lower"] - LIMIT_SLACK or angle > joint["upper"] + LIMIT_SLACK:
        return float("inf")
    return min(max(angle, joint["lower"]), joint["upper"])

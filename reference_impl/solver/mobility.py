"""Velocities and mobility at a contact point, and impulses on its two bodies."""

from math import sqrt
from typing import NamedTuple

import numpy as np

from touchstone.reference_impl.continuous.contact_motion import set_surface_motion
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import carried_along, copy_vector, cross, dot
from touchstone.reference_impl.kinematics.skeleton import move_links
from touchstone.reference_impl.solver.hinge_response import push_hinges, push_joints


class MassProperties(NamedTuple):
    """What an impulse moves: a body, or a driver with all its links."""

    inverse_mass: float
    inverse_inertia: np.ndarray  # (3, 3), about the centre of mass, world axes
    center: np.ndarray  # centre of mass (3,), world


@kernel
def surface_velocity(body, point, out_velocity):
    """World velocity of a body's surface at a world point."""
    out_velocity[0], out_velocity[1], out_velocity[2] = _velocity_at(body, point)


@kernel
def _velocity_at(body, point):
    return point_velocity(body["velocity"], body["omega"], body["center"], point)


@kernel
def point_velocity(v, w, c, point):
    """Velocity at a world point of a rigid motion: v at the point c, and omega w."""
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    return v[0] + w[1] * z - w[2] * y, v[1] + w[2] * x - w[0] * z, v[2] + w[0] * y - w[1] * x


@kernel
def surface_velocities(bodies, pair, out_a, out_b):
    """World velocities of the material of both surfaces at a pair's levers."""
    surface_velocity(bodies[pair["body_a"]], pair["lever_a"], out_a)
    surface_velocity(bodies[pair["body_b"]], pair["lever_b"], out_b)
    for i in range(3):
        out_a[i] += pair["surface_a"][i]
        out_b[i] += pair["surface_b"][i]


@kernel
def relative_turn(bodies, pair, out_omega):
    """Angular velocity of B relative to A [rad/s]."""
    for i in range(3):
        out_omega[i] = bodies[pair["body_b"]]["omega"][i] - bodies[pair["body_a"]]["omega"][i]


@kernel
def carry_turn(pair, w, sign):
    """Carry an angular velocity w with the normal of a row, which a substep turns: from its start to the
    middle (sign 1), or back there from its end (sign -1)."""
    n, m = pair["start_normal"], pair["normal"]
    return carried_along(n, m, w) if sign > 0 else carried_along(m, n, w)


@kernel
def relative_velocity(bodies, pair, state):
    """Store both surface velocities and v, that of B relative to A, at a contact point; returns n . v."""
    a, b, v, n = state["velocity_a"], state["velocity_b"], state["velocity"], pair["normal"]
    surface_velocities(bodies, pair, a, b)
    for i in range(3):
        v[i] = b[i] - a[i]
    return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]


@kernel
def final_velocity(bodies, pair, state):
    """As `relative_velocity`, at the end of a substep whose rotation changes it by the pair's `bias`."""
    relative_velocity(bodies, pair, state)
    v, n = state["velocity"], pair["normal"]
    for i in range(3):
        v[i] += pair["bias"][i]
    return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]


@inlined_kernel
def meeting_velocity(bodies, pair):
    """Velocity of B relative to A at a pair's contact point."""
    x, y, z = _velocity_at(bodies[pair["body_b"]], pair["lever_b"])
    u, v, w = _velocity_at(bodies[pair["body_a"]], pair["lever_a"])
    p, q = pair["surface_a"], pair["surface_b"]
    return x + q[0] - (u + p[0]), y + q[1] - (v + p[1]), z + q[2] - (w + p[2])


@kernel
def place_contact(pair, level):
    """Place a contact between its witness points, at `level` 0 on that of A, at 1 on that of B; impulses act
    there.

    The level of a manifold is that of its reference face: all its points then lie in one plane, so a body
    that rotates about an edge can stick to all.
    """
    for i in range(3):
        x = (1 - level) * pair["point_a"][i] + level * pair["point_b"][i]
        pair["point"][i] = pair["lever_a"][i] = pair["lever_b"][i] = x


@kernel
def place_surfaces(bodies, pieces, pairs, count):
    """Compute the surface motion of the rows `pairs[:count]` at their contact points."""
    for k in range(count):
        place_contact(pairs[k], pairs[k]["level"])
        set_surface_motion(bodies, pieces, pairs[k])


@kernel
def approach_speed(bodies, pair, state):
    """Compute a pair's contact point, and in `key` its approach speed in excess of `speculative_speed`."""
    place_contact(pair, pair["level"])
    pair["key"] = -relative_velocity(bodies, pair, state) - pair["speculative_speed"]


@kernel
def contact_mobility(bodies, drivers, pair, out_mobility):
    """Velocity of B relative to A per impulse on B (3, 3) [1/kg], at a pair's levers; Eq. 9 divides by n.M n.

    A driven link has the mass and inertia of its driver's coupled body; hinges add theirs (`link_rows`).
    """
    out_mobility[:] = 0.0
    for side in range(2):
        body = bodies[pair["body_a"] if side == 0 else pair["body_b"]]
        point = pair["lever_a"] if side == 0 else pair["lever_b"]
        if body["driver"] >= 0:
            driver = drivers[body["driver"]]
            if driver["inverse_mass"] > 0 and driver["mechanism"] == 0:
                moved = MassProperties(driver["inverse_mass"], driver["inverse_inertia"], driver["center"])
                _add_mobility(moved, point, out_mobility)
        elif body["inverse_mass"] > 0:
            moved = MassProperties(body["inverse_mass"], body["inverse_inertia"], body["center"])
            _add_mobility(moved, point, out_mobility)


@kernel
def _add_mobility(moved, point, out_mobility):
    """Add 1/m - [r] I^-1 [r], a body's velocity at `point` per impulse there."""
    m, c = moved.inverse_inertia, moved.center
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    for j in range(3):
        # r x e_j
        cx = -z if j == 1 else (y if j == 2 else 0.0)
        cy = z if j == 0 else (-x if j == 2 else 0.0)
        cz = -y if j == 0 else (x if j == 1 else 0.0)
        sx = m[0, 0] * cx + m[0, 1] * cy + m[0, 2] * cz
        sy = m[1, 0] * cx + m[1, 1] * cy + m[1, 2] * cz
        sz = m[2, 0] * cx + m[2, 1] * cy + m[2, 2] * cz
        # (I^-1 (r x e_j)) x r
        out_mobility[0, j] += sy * z - sz * y
        out_mobility[1, j] += sz * x - sx * z
        out_mobility[2, j] += sx * y - sy * x
        out_mobility[j, j] += moved.inverse_mass


@kernel
def apply_impulse(bodies, joints, drivers, b, point, px, py, pz):
    """Apply an impulse (px, py, pz) [N s] to body b at `point`, or to the coupled body of a driven link."""
    body = bodies[b]
    if body["driver"] >= 0:
        driver = drivers[body["driver"]]
        if driver["inverse_mass"] == 0:
            return
        if driver["mechanism"] == 1:
            push_joints(bodies, joints, driver, b, point, px, py, pz)
            return
        moved = MassProperties(driver["inverse_mass"], driver["inverse_inertia"], driver["center"])
        c, v, reference = driver["center"], driver["velocity"], driver["position"]
        dx, dy, dz = _change_velocity(moved, point, px, py, pz, v, driver["omega"])
        # a driver's velocity is that of its root's origin
        x, y, z = reference[0] - c[0], reference[1] - c[1], reference[2] - c[2]
        v[0] += dy * z - dz * y
        v[1] += dz * x - dx * z
        v[2] += dx * y - dy * x
        if body["hinge"] >= 0 and driver["loops"] == 1:
            push_hinges(joints, driver, body["hinge"], point, px, py, pz)
        move_links(bodies, joints, driver)
    elif body["inverse_mass"] > 0:
        moved = MassProperties(body["inverse_mass"], body["inverse_inertia"], body["center"])
        _change_velocity(moved, point, px, py, pz, body["velocity"], body["omega"])


@kernel
def apply_to_both(bodies, joints, drivers, pair, point, p):
    """Apply the impulse p to body B and -p to body A of a pair."""
    apply_impulse(bodies, joints, drivers, pair["body_b"], point, p[0], p[1], p[2])
    apply_impulse(bodies, joints, drivers, pair["body_a"], point, -p[0], -p[1], -p[2])


@kernel
def turn_both(bodies, joints, drivers, pair, moment, state):
    """Apply an angular impulse [N m s] to body B of a pair, and its opposite to A: two impulses 1 m apart."""
    n, there, least = moment, state["point"], 0
    for i in range(1, 3):
        least = i if abs(n[i]) < abs(n[least]) else least
    axis = (1.0 if least == 0 else 0.0, 1.0 if least == 1 else 0.0, 1.0 if least == 2 else 0.0)
    arm = cross(n, axis)
    size = sqrt(dot(arm, arm))
    if size == 0:
        return
    arm = (arm[0] / size, arm[1] / size, arm[2] / size)
    x, y, z = cross(n, arm)
    for side in range(2):
        b, sign = (pair["body_b"], 1.0) if side else (pair["body_a"], -1.0)
        copy_vector(bodies[b]["center"], there)
        apply_impulse(bodies, joints, drivers, b, there, -sign * x, -sign * y, -sign * z)
        for i in range(3):
            there[i] += arm[i]
        apply_impulse(bodies, joints, drivers, b, there, sign * x, sign * y, sign * z)


@kernel
def _change_velocity(moved, point, px, py, pz, out_v, out_w):
    """Add the change by an impulse at `point` to the velocity of the centre of mass and to omega; returns
    that of omega."""
    m, c = moved.inverse_inertia, moved.center
    x, y, z = point[0] - c[0], point[1] - c[1], point[2] - c[2]
    tx, ty, tz = y * pz - z * py, z * px - x * pz, x * py - y * px
    dx = m[0, 0] * tx + m[0, 1] * ty + m[0, 2] * tz
    dy = m[1, 0] * tx + m[1, 1] * ty + m[1, 2] * tz
    dz = m[2, 0] * tx + m[2, 1] * ty + m[2, 2] * tz
    out_v[0] += moved.inverse_mass * px
    out_v[1] += moved.inverse_mass * py
    out_v[2] += moved.inverse_mass * pz
    out_w[0] += dx
    out_w[1] += dy
    out_w[2] += dz
    return dx, dy, dz

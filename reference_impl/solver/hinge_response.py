"""Response of a driver's chains to impulses on their links (ours).

The paper gives an avatar's link the inverse mass 0 in Eq. 9: such a link transfers any impulse and crushes a
box against a wall. Here a contact moves a link by its driver as one rigid body, at the composite mass and
inertia of all links, and by the hinges of its chain:

    Y = J_r (1/m, I^-1) J_r' + J_h S^-1 J_h'

In an impact S is the inertia of the hinges with the root free, their part of the joint-space inertia less
the recoil of all links as one rigid body; J_h has the recoil in it, and the root takes it up: Y is that of
the whole joint-space inertia. Forces over a substep turn hinges without recoil of the root, which its own
coupling holds: S^-1 is there V s V', with V the modes of a chain under its servos and s their responses, in
closed form (`hinge_motion`). Static torques are therefore exact.

The contact solver works with coordinates y of unit mass: x' = L^-T y, with S = L L', or x' = V s^(1/2) y.
Velocities and moments are taken at the driver's centre of mass.
"""

from math import sqrt

from touchstone.reference_impl.continuous.hinge_modes import weigh_chains
from touchstone.reference_impl.continuous.mechanism_dynamics import (
    factorise,
    keep_loops,
    solve_lower,
    weigh_mechanism,
)
from touchstone.reference_impl.continuous.mechanism_motion import take_gains
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import cross, dot, invert_symmetric, rotate
from touchstone.reference_impl.kinematics.mechanism import pose_mechanism
from touchstone.reference_impl.kinematics.skeleton import composite_inertia


@kernel
def weigh_hinges(bodies, joints, driver):
    """Compute a driver's composite centre and inertia, factorise S and find the modes of its chains, at its
    present posture; of a mechanism, the inertia of its rates."""
    if driver["mechanism"] == 1:
        pose_mechanism(bodies, joints, driver)
        weigh_mechanism(bodies, joints, driver)
        return
    composite_inertia(bodies, joints, driver, driver["center"], driver["inertia"])
    invert_symmetric(driver["inertia"], driver["inverse_inertia"])
    if driver["hinge_count"] > 0 and (driver["loops"] == 1 or driver["hinge_factor"][0, 0] == 0):
        _sum_moved(bodies, joints, driver)
        _set_inertia(bodies, joints, driver)
        factorise(driver["hinge_factor"], driver["hinge_count"])
        weigh_chains(joints, driver)


@kernel
def _sum_moved(bodies, joints, driver):
    """Sum up mass, first moment and inertia of all links that each hinge moves, about the centre of mass."""
    first, end, c = driver["first_joint"], driver["first_joint"] + driver["joint_count"], driver["center"]
    for k in range(first, end):
        joint = joints[k]
        link = bodies[joint["child"]]
        mass, center, own = link["mass"], link["center"], link["inverse_inertia"]
        r = (center[0] - c[0], center[1] - c[1], center[2] - c[2])
        square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2]
        joint["moved_mass"] = mass
        for i in range(3):
            joint["moved_moment"][i] = mass * r[i]
            for j in range(3):
                # a link's `inverse_inertia` holds its inertia in world axes (`composite_inertia`)
                joint["moved_inertia"][i, j] = own[i, j] - mass * r[i] * r[j]
            joint["moved_inertia"][i, i] += mass * square
    for k in range(end - 1, first - 1, -1):
        if joints[k]["inner"] < 0:
            continue
        joint, inner = joints[k], joints[joints[k]["inner"]]
        inner["moved_mass"] += joint["moved_mass"]
        for i in range(3):
            inner["moved_moment"][i] += joint["moved_moment"][i]
            for j in range(3):
                inner["moved_inertia"][i, j] += joint["moved_inertia"][i, j]


@kernel
def _set_inertia(bodies, joints, driver):
    """Compute S in the lower half of `hinge_factor`, the inertia of chains with the root held in `coupling`,
    and each hinge's arm and momenta."""
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    s = driver["hinge_factor"]
    for k in range(first, end):
        joint = joints[k]
        if joint["coordinate"] < 0:
            continue
        a, arm, m, inertia = joint["world_axis"], joint["arm"], joint["moved_moment"], joint["moved_inertia"]
        rotate(bodies[joint["parent"]]["rotation"], joint["axis"], a)
        o, c, mass = bodies[joint["child"]]["position"], driver["center"], joint["moved_mass"]
        arm[0], arm[1], arm[2] = cross(a, (c[0] - o[0], c[1] - o[1], c[2] - o[2]))
        x, y, z = cross(a, m)
        p = joint["push"]
        p[0], p[1], p[2] = x + mass * arm[0], y + mass * arm[1], z + mass * arm[2]
        x, y, z = cross(m, arm)
        rotate(inertia, a, joint["spin"])
        spin = joint["spin"]
        spin[0], spin[1], spin[2] = spin[0] + x, spin[1] + y, spin[2] + z
        rotate(driver["inverse_inertia"], spin, joint["recoil_turn"])
        for i in range(3):
            joint["recoil"][i] = joint["push"][i] / driver["mass"]
    for k in range(first, end):
        row = joints[k]["coordinate"]
        if row < 0:
            continue
        p, spin = joints[k]["push"], joints[k]["spin"]
        for j in range(first, k + 1):
            column = joints[j]["coordinate"]
            if column >= 0:
                s[row, column] = -dot(p, joints[j]["recoil"]) - dot(spin, joints[j]["recoil_turn"])
        j = k
        while j >= 0:
            if joints[j]["coordinate"] >= 0:
                held = dot(joints[j]["arm"], p) + dot(joints[j]["world_axis"], spin)
                s[row, joints[j]["coordinate"]] += held
                if joints[j]["chain"] == joints[k]["chain"]:
                    joints[k]["coupling"][j - driver["chains"][joints[k]["chain"], 0]] = held
            j = joints[j]["inner"]


@kernel
def set_response(joints, driver, k, out_link):
    """Compute the velocities of what hinge k moves, at the driver's centre of mass, per coordinate of its
    hinges; or of a body of a mechanism, at its centre of mass."""
    z = out_link["response"]
    out_link["blocks"] = (driver["hinge_count"] + 5) // 6
    z[:, :, :] = 0.0
    if driver["mechanism"] == 1:
        _set_columns(joints, k, z)
        _solve_lower(driver, out_link)
        return
    if driver["lasting"] == 1:
        while k >= 0:
            joint = joints[k]
            if joint["coordinate"] >= 0:
                for i in range(3):
                    _add_modes(joints, driver, k, i, joint["arm"][i], z)
                    _add_modes(joints, driver, k, 3 + i, joint["world_axis"][i], z)
            k = joint["inner"]
        return
    while k >= 0:
        joint, c = joints[k], joints[k]["coordinate"]
        if c >= 0:
            for i in range(3):
                z[c // 6, c % 6, i], z[c // 6, c % 6, 3 + i] = joint["arm"][i], joint["world_axis"][i]
        k = joint["inner"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint, c = joints[k], joints[k]["coordinate"]
        if c >= 0:
            for i in range(3):
                z[c // 6, c % 6, i] -= joint["recoil"][i]
                z[c // 6, c % 6, 3 + i] -= joint["recoil_turn"][i]
    _solve_lower(driver, out_link)


@kernel
def _add_modes(joints, driver, k, i, per_rate, out_z):
    """Add to component i of a response what hinge k does, `per_rate`, by each mode of its chain."""
    first = driver["chains"][joints[k]["chain"], 0]
    for m in range(first, driver["chains"][joints[k]["chain"], 1] + 1):
        c = joints[m]["coordinate"]
        out_z[c // 6, c % 6, i] += joints[k]["modes"][m - first] * sqrt(joints[m]["share"]) * per_rate


@kernel
def _set_columns(joints, k, out_z):
    """Velocities of the child of joint k of a mechanism, at its centre of mass, per rate."""
    arm = joints[k]["arm"]
    while k >= 0:
        joint = joints[k]
        for j in range(joint["width"]):
            c, s = joint["coordinate"] + j, joint["columns"][j]
            w = (s[3], s[4], s[5])
            v = cross(w, arm)
            for i in range(3):
                out_z[c // 6, c % 6, i], out_z[c // 6, c % 6, 3 + i] = s[i] + v[i], w[i]
        k = joint["inner"]


@kernel
def set_limit_response(joints, driver, k, sign, out_link):
    """Compute the rate of hinge k per coordinate of the driver's hinges, times a sign, as a velocity along
    x."""
    z, c = out_link["response"], joints[k]["coordinate"]
    out_link["blocks"] = (driver["hinge_count"] + 5) // 6
    z[:, :, :] = 0.0
    if driver["mechanism"] == 0 and driver["lasting"] == 1:
        _add_modes(joints, driver, k, 0, sign, z)
        return
    z[c // 6, c % 6, 0] = sign
    _solve_lower(driver, out_link)


@kernel
def _solve_lower(driver, link):
    """Turn a link's velocities per rate of each hinge, J, into those per coordinate: rows of L^-1 J'."""
    s, count, z = driver["hinge_factor"], driver["hinge_count"], link["response"]
    for c in range(count):
        row = z[c // 6, c % 6]
        for j in range(c):
            other, factor = z[j // 6, j % 6], s[c, j]
            if factor != 0:
                for i in range(6):
                    row[i] -= factor * other[i]
        for i in range(6):
            row[i] /= s[c, c]
    _keep_loops(driver, z)


@kernel
def _keep_loops(driver, z):
    """Remove from a response what opens loops of a mechanism."""
    for j in range(driver["loop_rows"]):
        basis = driver["loop_basis"][j]
        for i in range(6):
            along = 0.0
            for c in range(driver["hinge_count"]):
                along += basis[c] * z[c // 6, c % 6, i]
            for c in range(driver["hinge_count"]):
                z[c // 6, c % 6, i] -= along * basis[c]


@kernel
def find_rates(driver):
    """Turn `hinge_response` from coordinates y of unit mass into rates L^-T y."""
    s, count, x = driver["hinge_factor"], driver["hinge_count"], driver["hinge_response"]
    for c in range(count - 1, -1, -1):
        for j in range(c + 1, count):
            x[c] -= s[j, c] * x[j]
        x[c] /= s[c, c]


@kernel
def push_hinges(joints, driver, k, point, px, py, pz):
    """Change the rates of a driver's hinges by an impulse (px, py, pz) [N s] at a point moved by hinge k."""
    s, count, x, c = driver["hinge_factor"], driver["hinge_count"], driver["hinge_response"], driver["center"]
    p = (px, py, pz)
    moment = cross((point[0] - c[0], point[1] - c[1], point[2] - c[2]), p)
    x[:] = 0.0
    while k >= 0:
        joint = joints[k]
        if joint["coordinate"] >= 0:
            x[joint["coordinate"]] = dot(joint["arm"], p) + dot(joint["world_axis"], moment)
        k = joint["inner"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        if joints[k]["coordinate"] >= 0:
            recoil = dot(joints[k]["recoil"], p) + dot(joints[k]["recoil_turn"], moment)
            x[joints[k]["coordinate"]] -= recoil
    for i in range(count):
        for j in range(i):
            x[i] -= s[i, j] * x[j]
        x[i] /= s[i, i]
    find_rates(driver)
    turn_at_once(joints, driver)


@kernel
def turn_at_once(joints, driver):
    """Change the rates of a driver's hinges by `hinge_response`, and the root's by their recoil."""
    v, w, c, o = driver["velocity"], driver["omega"], driver["center"], driver["position"]
    away = (o[0] - c[0], o[1] - c[1], o[2] - c[2])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["coordinate"] < 0:
            continue
        rate, r = driver["hinge_response"][joint["coordinate"]], joint["recoil_turn"]
        joint["rate"] += rate
        joint["offset_rate"] += rate
        x, y, z = cross(r, away)
        v[0] -= rate * (joint["recoil"][0] + x)
        v[1] -= rate * (joint["recoil"][1] + y)
        v[2] -= rate * (joint["recoil"][2] + z)
        for i in range(3):
            w[i] -= rate * r[i]


@kernel
def push_joints(bodies, joints, driver, b, point, px, py, pz):
    """Change the rates of a mechanism by an impulse (px, py, pz) [N s] at a point of its body b."""
    x, o, count = driver["hinge_response"], bodies[b]["center"], driver["hinge_count"]
    k = bodies[b]["hinge"]
    r = (point[0] - o[0], point[1] - o[1], point[2] - o[2])
    r = (r[0] + joints[k]["arm"][0], r[1] + joints[k]["arm"][1], r[2] + joints[k]["arm"][2])
    for i in range(count):
        x[i] = 0.0
    while k >= 0:
        joint = joints[k]
        for j in range(joint["width"]):
            s = joint["columns"][j]
            v = cross((s[3], s[4], s[5]), r)
            x[joint["coordinate"] + j] = (s[0] + v[0]) * px + (s[1] + v[1]) * py + (s[2] + v[2]) * pz
        k = joint["inner"]
    solve_lower(driver["hinge_factor"], count, x)
    keep_loops(driver, x)
    find_rates(driver)
    take_gains(bodies, joints, driver)

"""Equations of motion of mechanisms in the rates q' of their trees' joints (ours; Featherstone 2008).

    M q'' = Q + G' l,    G q'' = -c

M is the joint-space inertia by composite bodies, Q the forces of gravity, joints, and rotation, G the rates
at which the joints of loops part, and c their acceleration at q'' = 0; a coupling of two joints of the tree
has a row of G, too, which is constant. With M = L L', y = L' q' are
coordinates of unit mass. In these, loops leave what is perpendicular to the columns of A = L^-1 G': their
orthonormal basis has no row for a constraint that depends on others, so redundant loops share their forces in
the sense of least squares.
"""

from math import expm1, sqrt

from touchstone.reference_impl.continuous.coupling_response import unit_response
from touchstone.reference_impl.core.conventions import (
    JOINT_BALL,
    JOINT_FIXED,
    JOINT_FREE,
    JOINT_HINGE,
    JOINT_SLIDER,
    NEVER,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import conjugate_by, cross, dot, plus, rotate, times, vector_of
from touchstone.reference_impl.kinematics.mechanism import (
    add_rates,
    child_point,
    hinge_angle,
    in_parent,
    loop_gap,
    loop_rates,
    move_mechanism,
    parent_point,
    pose_mechanism,
    world_axis,
)

DEPENDENT = 1e-6
"""Part of a constraint that others do not imply below which it is redundant [1]: rounding of close angles."""
HELD = 2.5
"""Rate of a joint's spring and damper times the length of a substep [rad] from which contact and limits meet
it as a force that is even over the substep: of that of contact, its rate at the end would tell less than a
quarter."""
CLOSINGS = 3
"""Newton's iterations that close loops: each squares the error."""


@kernel
def factorise(s, count):
    """Cholesky factor of the leading (count, count) matrix, in place of its lower half."""
    for i in range(count):
        for j in range(i + 1):
            total = s[i, j]
            for k in range(j):
                total -= s[i, k] * s[j, k]
            s[i, j] = sqrt(total) if i == j else total / s[j, j]


@kernel
def weigh_mechanism(bodies, joints, driver):
    """Factorise the inertia of a mechanism and its constraints, at its bodies' present poses."""
    first, end, c = driver["first_joint"], driver["first_joint"] + driver["joint_count"], driver["center"]
    s = driver["hinge_factor"]
    for k in range(first, end):
        joint = joints[k]
        body, inertia = bodies[joint["child"]], joint["moved_inertia"]
        conjugate_by(body["rotation"], body["inertia"], inertia)
        r = plus(body["center"], -1.0, c)
        square = dot(r, r)
        joint["moved_mass"] = body["mass"]
        for i in range(3):
            joint["moved_moment"][i] = body["mass"] * r[i]
            for j in range(3):
                inertia[i, j] += body["mass"] * ((square if i == j else 0.0) - r[i] * r[j])
    for k in range(end - 1, first - 1, -1):
        joint = joints[k]
        _weigh_columns(joints, joint, s)
        if joint["inner"] >= 0:
            inner = joints[joint["inner"]]
            inner["moved_mass"] += joint["moved_mass"]
            for i in range(3):
                inner["moved_moment"][i] += joint["moved_moment"][i]
                for j in range(3):
                    inner["moved_inertia"][i, j] += joint["moved_inertia"][i, j]
    if driver["stiffened"] == 1:
        for k in range(first, end):
            for j in range(joints[k]["width"]):
                s[joints[k]["coordinate"] + j, joints[k]["coordinate"] + j] += joints[k]["answer"]
    factorise(s, driver["hinge_count"])
    _set_loops(bodies, joints, driver)


@kernel
def answer_step(joints, driver, h):
    """Let springs and dampers answer as in an implicit step of length h: h D + h^2 K."""
    driver["stiffened"] = 1
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["answer"] = 0.0
        if joint["held"] == 1:
            continue
        if joint["type"] == JOINT_BALL:
            joint["answer"] = h * joint["damping"]
        elif _is_free(joint, driver):
            joint["answer"] = h * joint["damping"] + h * h * joint["stiffness"]


@kernel
def answer_forces(bodies, joints, driver, h, lead):
    """Let springs and dampers answer a force that is even over a time h, in rates at its end, or in twice
    their mean if `lead` is 1; weighs the mechanism again if there are any.

    Of a rate with the mobility m, the response falls from h m to H m, or from h^2 m / 2 to G m
    (`coupling_response`): so does that of all rates to one damper, whose term has rank one.
    """
    found = False
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["held"] == 1:
            found = True
            continue
        joint["answer"] = 0.0
        if joint["type"] != JOINT_BALL and not _is_free(joint, driver):
            continue
        if joint["stiffness"] == 0 and joint["damping"] == 0:
            continue
        found = True
        m = joint_mobility(joint, driver)
        if _is_fast(joint, m, h):
            joint["answer"] = _even_answer(joint, h)
        elif m > 0:
            share = _answer(joint["stiffness"] * m, joint["damping"] * m, h, lead)
            joint["answer"] = (1 / share - 1) / m
    if found:
        weigh_answers(bodies, joints, driver)


@kernel
def weigh_answers(bodies, joints, driver):
    """`weigh_mechanism` with the answers of springs and dampers."""
    driver["stiffened"] = 1
    weigh_mechanism(bodies, joints, driver)
    driver["stiffened"] = 0


@kernel
def has_springs(joints, driver):
    """Whether a joint of a mechanism's tree has a spring or a damper."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        if joints[k]["stiffness"] + joints[k]["damping"] > 0:
            return True
    return False


@kernel
def hold_joints(joints, driver, h):
    """Find the joints whose springs and dampers are too fast for a substep of length h (HELD), of a mechanism
    that is weighed without answers, and set their answers (`answer_lacks`); their forces begin at 0, or at
    their largest."""
    driver["held"] = 0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        joint["held"], joint["answer"] = 0, 0.0
        if joint["width"] > 0 and joint["stiffness"] + joint["damping"] > 0:
            joint["mobility"] = joint_mobility(joint, driver)
            if _is_fast(joint, joint["mobility"], h):
                joint["held"] = driver["held"] = 1
                for j in range(joint["width"]):
                    c, force = joint["coordinate"] + j, _asked_force(joint, driver, j)
                    full = abs(force) >= joint["largest_force"]
                    driver["held_force"][c] = 0.0
                    _change_force(joint, driver, c, force if full else 0.0, h)


@kernel
def _is_fast(joint, mobility, h):
    """Whether a joint's spring and damper are too fast for a substep of length h (HELD)."""
    return h * (joint["damping"] * mobility + sqrt(joint["stiffness"] * mobility)) > HELD


@kernel
def _even_answer(joint, h):
    """Answer of a held joint (`answer_lacks`)."""
    return h * joint["damping"] + h * h / 4 * joint["stiffness"]


@kernel
def drop_holds(joints, driver):
    """Let the forces of all joints follow their positions and rates."""
    driver["held"] = 0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["held"] = 0


@kernel
def note_lacks(joints, driver, h):
    """Store in `lacks` by how much the even force of each held joint lacks that of its mean position and of
    its rate at the end of the substep of length h, where the mechanism is. One that is asked for less than
    its largest answers again.

    So springs keep their energy, and dampers stop what is fast.
    """
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint, c = joints[k], joints[k]["coordinate"]
        for j in range(joint["width"] if joint["held"] == 1 else 0):
            force, most, held = _asked_force(joint, driver, j), joint["largest_force"], driver["held_force"]
            if joint["width"] == 1:
                moved = driver["positions"][joint["place"]] - driver["start_positions"][joint["place"]]
                force += joint["stiffness"] * moved / 2
            if joint["answer"] == 0:
                if (force if held[c + j] > 0 else -force) < most:
                    joint["answer"] = _even_answer(joint, h)
                else:
                    force = min(max(force, -most), most)
            driver["lacks"][c + j] = force - held[c + j]


@kernel
def first_rest(joints, driver, h):
    """Fraction of a substep of length h at which the first held joint, driven by its largest force, reaches
    the rate of its damper or motor; NEVER if none does.

    With the mobility m, the rate u becomes u' by the even force F, and u' + h m (L - F) by the largest L.
    """
    first = NEVER
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint, c, most = joints[k], joints[k]["coordinate"], joints[k]["largest_force"]
        if joint["held"] == 0 or joint["width"] != 1 or joint["stiffness"] > 0:
            continue
        start, gain = driver["start_rates"][c], driver["gains"][c] - driver["known_gains"][c]
        away = joint["target_rate"] - start
        force = driver["held_force"][c] - joint["answer"] * gain / h
        if joint["damping"] * abs(away) <= most or abs(force) >= most:
            continue
        full = most if away > 0 else -most
        change = driver["end_rates"][c] + driver["gains"][c] - start + h * joint["mobility"] * (full - force)
        if change * away > 0 and abs(away) < abs(change):
            first = min(first, away / change)
    return first


@kernel
def answer_lacks(bodies, joints, driver, h):
    """Change the even forces of held joints by what they lack at the end of a substep of length h; weighs the
    mechanism with the answers of its joints.

    By a force even over h a rate changes by x and the mean position by h x / 4: springs and dampers answer by
    the inertia h D + h^2 K / 4, by none where the force is its largest.

    Returns:
        Largest change of a rate times h [m or rad].
    """
    x, count, most = driver["force"], driver["hinge_count"], 0.0
    weigh_answers(bodies, joints, driver)
    for i in range(count):
        x[i] = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        for c in range(joints[k]["coordinate"], joints[k]["coordinate"] + joints[k]["width"]):
            if joints[k]["held"] == 1:
                x[c] = h * driver["lacks"][c]
    answer_impulses(driver, x)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        for c in range(joints[k]["coordinate"], joints[k]["coordinate"] + joints[k]["width"]):
            if joints[k]["held"] == 1:
                _change_force(joints[k], driver, c, driver["lacks"][c] - joints[k]["answer"] * x[c] / h, h)
    for i in range(count):
        most = max(most, h * abs(x[i]))
    return most


@kernel
def answer_gains(joints, driver, h):
    """Change the even forces of held joints by their answers to `gains`, less `known_gains`."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        for c in range(joints[k]["coordinate"], joints[k]["coordinate"] + joints[k]["width"]):
            if joints[k]["held"] == 1:
                gain = driver["gains"][c] - driver["known_gains"][c]
                _change_force(joints[k], driver, c, -joints[k]["answer"] * gain / h, h)


@kernel
def _change_force(joint, driver, c, change, h):
    """Change the even force of a held joint along rate c, up to its largest: there it does not answer."""
    force, most = driver["held_force"][c] + change, joint["largest_force"]
    driver["held_force"][c] = min(max(force, -most), most)
    answers = joint["width"] > 1 or abs(force) < most
    joint["answer"] = _even_answer(joint, h) if answers else 0.0


@kernel
def joint_mobility(joint, driver):
    """Rate of a joint, or of the first of a ball joint's, per impulse along it."""
    x = driver["force"]
    for i in range(driver["hinge_count"]):
        x[i] = 0.0
    x[joint["coordinate"]] = 1.0
    solve_lower(driver["hinge_factor"], driver["hinge_count"], x)
    keep_loops(driver, x)
    m = 0.0
    for i in range(driver["hinge_count"]):
        m += x[i] * x[i]
    return m


@kernel
def _answer(stiffness, damping, h, lead):
    """Response of a damped spring of unit mass to a force over a time h, over that without it [1]."""
    a = damping * h
    if stiffness == 0:
        speed = -expm1(-a) / a
        # (1 - speed) / a would cancel
        moved = (1 - speed) / a if a > 1e-4 else 0.5 - a / 6
        return 2 * moved if lead == 1 else speed
    moved, speed = unit_response(stiffness, damping, h)
    return 2 * moved / (h * h) if lead == 1 else speed / h


@kernel
def _is_free(joint, driver):
    """Whether a joint's own force is below its largest."""
    if joint["width"] != 1:
        return False
    return abs(_asked_force(joint, driver, 0)) < joint["largest_force"]


@kernel
def _weigh_columns(joints, joint, s):
    """Compute the rows of the inertia of a joint's rates."""
    m, h = joint["moved_mass"], joint["moved_moment"]
    for j in range(joint["width"]):
        u, row = joint["columns"][j], joint["coordinate"] + j
        v, w = (u[0], u[1], u[2]), (u[3], u[4], u[5])
        # momentum of all that it moves, and angular momentum about the centre
        p = plus(times(m, v), 1.0, cross(w, h))
        x, y, z = cross(h, v)
        spin = joint["spin"]
        rotate(joint["moved_inertia"], w, spin)
        spin[0], spin[1], spin[2] = spin[0] + x, spin[1] + y, spin[2] + z
        for i in range(j + 1):
            s[row, joint["coordinate"] + i] = _power(joint["columns"][i], p, spin)
        for i in range(joint["coordinate"]):
            s[row, i] = 0.0
        k = joint["inner"]
        while k >= 0:
            for i in range(joints[k]["width"]):
                s[row, joints[k]["coordinate"] + i] = _power(joints[k]["columns"][i], p, spin)
            k = joints[k]["inner"]


@kernel
def _power(u, force, torque):
    return (
        u[0] * force[0]
        + u[1] * force[1]
        + u[2] * force[2]
        + u[3] * torque[0]
        + u[4] * torque[1]
        + u[5] * torque[2]
    )


@kernel
def solve_lower(s, count, x):
    """x = L^-1 x."""
    for i in range(count):
        total = x[i]
        for j in range(i):
            total -= s[i, j] * x[j]
        x[i] = total / s[i, i]


@kernel
def solve_upper(s, count, x):
    """x = L'^-1 x."""
    for i in range(count - 1, -1, -1):
        total = x[i]
        for j in range(i + 1, count):
            total -= s[j, i] * x[j]
        x[i] = total / s[i, i]


@kernel
def answer_impulses(driver, x):
    """Turn impulses along a mechanism's rates into the changes of these, as it is weighed."""
    solve_lower(driver["hinge_factor"], driver["hinge_count"], x)
    keep_loops(driver, x)
    solve_upper(driver["hinge_factor"], driver["hinge_count"], x)


@kernel
def add_rows(joints, b, bodies, point, out_row, u, sign):
    """Add to `out_row` per rate of a mechanism the rate, by factors u, of body b's velocity at a point and of
    its angular velocity, times a sign."""
    if b < 0 or bodies[b]["driver"] < 0:
        return
    n, turn = (u[0], u[1], u[2]), (u[3], u[4], u[5])
    k = bodies[b]["hinge"]
    while k >= 0:
        joint, first = joints[k], joints[k]["coordinate"]
        for j in range(joint["width"]):
            s = joint["columns"][j]
            w = (s[3], s[4], s[5])
            v = plus((s[0], s[1], s[2]), 1.0, cross(w, point))
            out_row[first + j] += sign * (dot(n, v) + dot(turn, w))
        k = joint["inner"]


@kernel
def _set_loops(bodies, joints, driver):
    """Orthonormal basis of the constraints of couplings and loops."""
    driver["loop_rows"] = 0
    first, count, o = driver["first_joint"] + driver["joint_count"], driver["hinge_count"], driver["center"]
    x, u = driver["force"], driver["loop_direction"]
    for k in range(first - driver["joint_count"] if driver["mimic_count"] > 0 else first, first):
        joint = joints[k]
        if joint["mimics"] >= 0:
            for i in range(count):
                x[i] = 0.0
            x[joint["coordinate"]], x[joints[joint["mimics"]]["coordinate"]] = 1.0, -joint["ratio"]
            solve_lower(driver["hinge_factor"], count, x)
            _add_constraint(driver, x, 0.0, 6 * k)
    for k in range(first, first + driver["loop_count"]):
        joint = joints[k]
        point = plus(child_point(bodies, joint), -1.0, o)
        for c in range(6):
            if not loop_rates(bodies, joint, c, u):
                continue
            for i in range(count):
                x[i] = 0.0
            add_rows(joints, joint["child"], bodies, point, x, u, 1.0)
            add_rows(joints, joint["parent"], bodies, point, x, u, -1.0)
            solve_lower(driver["hinge_factor"], count, x)
            # at least what the child alone would answer: a constraint that the tree keeps is all rounding
            inertia = bodies[joint["child"]]["inertia"]
            whole = 1 / bodies[joint["child"]]["mass"]
            if c >= 3:
                whole = 3 / (inertia[0, 0] + inertia[1, 1] + inertia[2, 2])
            _add_constraint(driver, x, whole, 6 * k + c)


@kernel
def _add_constraint(driver, x, whole, place):
    """Add a constraint x, in coordinates of unit mass, to the orthonormal basis, by Gram and Schmidt, twice;
    one that depends on those before is left out. `whole`: least square of one that does not."""
    n, count, r, square = driver["loop_rows"], driver["hinge_count"], driver["loop_factor"], 0.0
    for i in range(count):
        square += x[i] * x[i]
    whole = max(whole, square)
    for j in range(n):
        r[n, j] = 0.0
    for _ in range(2):
        for j in range(n):
            along = 0.0
            for i in range(count):
                along += driver["loop_basis"][j, i] * x[i]
            r[n, j] += along
            for i in range(count):
                x[i] -= along * driver["loop_basis"][j, i]
    left = 0.0
    for i in range(count):
        left += x[i] * x[i]
    if left > DEPENDENT * DEPENDENT * whole:
        r[n, n] = sqrt(left)
        for i in range(count):
            driver["loop_basis"][n, i] = x[i] / r[n, n]
        driver["loop_row"][n] = place
        driver["loop_rows"] = n + 1


@kernel
def keep_loops(driver, x):
    """Remove from coordinates of unit mass what opens loops or slips in couplings."""
    for j in range(driver["loop_rows"]):
        along = 0.0
        for i in range(driver["hinge_count"]):
            along += driver["loop_basis"][j, i] * x[i]
        for i in range(driver["hinge_count"]):
            x[i] -= along * driver["loop_basis"][j, i]


@kernel
def _answer_errors(driver, x):
    """Add to coordinates of unit mass, which open no loop, the least that opens them by `loop_error`."""
    r, error = driver["loop_factor"], driver["loop_error"]
    for j in range(driver["loop_rows"]):
        for i in range(j):
            error[j] -= r[j, i] * error[i]
        error[j] /= r[j, j]
        for i in range(driver["hinge_count"]):
            x[i] += error[j] * driver["loop_basis"][j, i]


@kernel
def close_loops(bodies, joints, driver):
    """Close a mechanism's loops and couplings by the least motion, measured by its inertia, and stop their
    parting; poses and moves its bodies, and leaves it weighed there."""
    count, x, q = driver["hinge_count"], driver["force"], driver["positions"]
    for _ in range(CLOSINGS):
        for j in range(driver["loop_rows"]):
            joint, c = joints[driver["loop_row"][j] // 6], driver["loop_row"][j] % 6
            u = driver["loop_direction"]
            if joint["mimics"] >= 0:
                driver["loop_error"][j] = (
                    joint["ratio"] * q[joints[joint["mimics"]]["place"]] - q[joint["place"]]
                )
                continue
            loop_rates(bodies, joint, c, u)
            n = (u[0], u[1], u[2]) if c < 3 else (u[3], u[4], u[5])
            driver["loop_error"][j] = -loop_gap(bodies, joint, c, n)
        for i in range(count):
            x[i] = 0.0
        _answer_errors(driver, x)
        solve_upper(driver["hinge_factor"], count, x)
        add_rates(bodies, joints, driver, x, 1.0)
        pose_mechanism(bodies, joints, driver)
        weigh_mechanism(bodies, joints, driver)
    s, rates = driver["hinge_factor"], driver["rates"]
    for i in range(count):
        total = 0.0
        for j in range(i, count):
            total += s[j, i] * rates[j]
        x[i] = total
    keep_loops(driver, x)
    solve_upper(s, count, x)
    for i in range(count):
        rates[i] = x[i]
    move_mechanism(bodies, joints, driver)


@kernel
def set_slope(bodies, joints, driver, out_slope):
    """Rates of change of a mechanism's positions and rates, at which its bodies are posed and moved.

    Args:
        out_slope: (positions, then rates), and the power of all forces of joints that have no energy, which
            springs of the tree have.
    """
    first, end, o = driver["first_joint"], driver["first_joint"] + driver["joint_count"], driver["center"]
    size, count, force = driver["position_count"], driver["hinge_count"], driver["force"]
    power = joint_power(joints, driver)
    set_drifts(bodies, joints, driver)
    for k in range(first, end):
        joint = joints[k]
        body, f, t = bodies[joint["child"]], joint["pull"], joint["torque"]
        w, own = body["omega"], joint["moved_inertia"]
        conjugate_by(body["rotation"], body["inertia"], own)
        rotate(own, joint["spin_drift"], t)
        rotate(own, w, f)
        x, y, z = cross(w, f)
        for i in range(3):
            f[i] = body["mass"] * (driver["gravity"][i] - joint["drift"][i])
        u, v, s = cross(plus(body["center"], -1.0, o), f)
        t[0], t[1], t[2] = u - x - t[0], v - y - t[1], s - z - t[2]
    if driver["constrained"] == 0:
        _accelerate_tree(bodies, joints, driver)
    else:
        power += _accelerate_loops(bodies, joints, driver)
    for i in range(count):
        out_slope[size + i] = force[i]
    out_slope[size + count] = power
    for k in range(first, end):
        _set_position_slope(bodies, joints[k], driver, out_slope)


@kernel
def _accelerate_loops(bodies, joints, driver):
    """Set `force` to the accelerations of the rates of a mechanism with constraints, which is weighed, from
    the force and torque on each body; returns the power of joints that close loops [W]."""
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    count, force, power = driver["hinge_count"], driver["force"], 0.0
    for k in range(end - 1, first - 1, -1):
        joint = joints[k]
        for j in range(joint["width"]):
            force[joint["coordinate"] + j] = _power(joint["columns"][j], joint["pull"], joint["torque"])
            if joint["type"] != JOINT_FREE:
                force[joint["coordinate"] + j] += _present_force(joint, driver, j)
        if joint["inner"] >= 0:
            inner = joints[joint["inner"]]
            for i in range(3):
                inner["pull"][i] += joint["pull"][i]
                inner["torque"][i] += joint["torque"][i]
    for k in range(end, end + driver["loop_count"]):
        power += _add_loop_force(bodies, joints, joints[k], driver)
    for i in range(count):
        force[i] += driver["known_force"][i]
    solve_lower(driver["hinge_factor"], count, force)
    if driver["loop_rows"] > 0:
        keep_loops(driver, force)
        for j in range(driver["loop_rows"]):
            driver["loop_error"][j] = -_parting(bodies, joints, driver, driver["loop_row"][j])
        _answer_errors(driver, force)
    solve_upper(driver["hinge_factor"], count, force)
    return power


@kernel
def _accelerate_tree(bodies, joints, driver):
    """Set `force` to the accelerations of the rates of a mechanism without loops, from the force and torque
    on each body, by articulated bodies (Featherstone 2008, section 7.3), in time that grows with the number
    of joints. A ball is three hinges."""
    first, end, o = driver["first_joint"], driver["first_joint"] + driver["joint_count"], driver["center"]
    for k in range(first, end):
        joint = joints[k]
        own, bias = joint["articulated"], joint["bias"]
        _set_spatial_inertia(bodies[joint["child"]], joint["moved_inertia"], o, own)
        for i in range(3):
            bias[i], bias[3 + i] = -joint["pull"][i], -joint["torque"][i]
    for k in range(end - 1, first - 1, -1):
        joint = joints[k]
        own, bias, extra = joint["articulated"], joint["bias"], 0.0
        if driver["stiffened"] == 1:
            extra = joint["answer"]
        for j in range(joint["width"] - 1, -1, -1):
            s, u, weight = joint["columns"][j], joint["carried"][j], extra
            push = driver["known_force"][joint["coordinate"] + j]
            if joint["type"] != JOINT_FREE:
                push += _present_force(joint, driver, j)
            for i in range(6):
                total = 0.0
                for m in range(6):
                    total += own[i, m] * s[m]
                u[i] = total
                weight += s[i] * total
                push -= s[i] * bias[i]
            joint["weights"][j], joint["pushes"][j] = weight, push
            for i in range(6):
                part = u[i] / weight
                bias[i] += part * push
                for m in range(6):
                    own[i, m] -= part * u[m]
        if joint["inner"] >= 0:
            inner = joints[joint["inner"]]
            for i in range(6):
                inner["bias"][i] += bias[i]
                for m in range(6):
                    inner["articulated"][i, m] += own[i, m]
    for k in range(first, end):
        joint = joints[k]
        # from here on the acceleration of the child beyond its drift
        a = joint["bias"]
        for i in range(6):
            a[i] = joints[joint["inner"]]["bias"][i] if joint["inner"] >= 0 else 0.0
        for j in range(joint["width"]):
            x = joint["pushes"][j]
            for i in range(6):
                x -= joint["carried"][j, i] * a[i]
            x /= joint["weights"][j]
            driver["force"][joint["coordinate"] + j] = x
            for i in range(6):
                a[i] += x * joint["columns"][j, i]


@kernel
def _set_spatial_inertia(body, turning, o, out_inertia):
    """Momentum and angular momentum about o of a body per velocity at o and angular velocity (6, 6), from its
    inertia `turning` about its centre of mass."""
    m, r = body["mass"], plus(body["center"], -1.0, o)
    square = dot(r, r)
    for i in range(3):
        for j in range(3):
            out_inertia[i, j] = m if i == j else 0.0
            out_inertia[3 + i, 3 + j] = turning[i, j] + m * ((square if i == j else 0.0) - r[i] * r[j])
    x, y, z = m * r[0], m * r[1], m * r[2]
    arms = ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
    for i in range(3):
        for j in range(3):
            out_inertia[i, 3 + j] = out_inertia[3 + j, i] = arms[i][j]


@kernel
def joint_force(joint, position, rate):
    """Force or torque of a joint's spring, damper or motor along its axis."""
    most = joint["largest_force"]
    return min(max(_unbounded_force(joint, position, rate), -most), most)


@kernel
def _unbounded_force(joint, position, rate):
    return joint["stiffness"] * (joint["target"] - position) + joint["damping"] * (
        joint["target_rate"] - rate
    )


@kernel
def joint_power(joints, driver):
    """Power of the dampers and motors of the joints of a mechanism's tree [W]: of all but their springs."""
    rates, power = driver["rates"], 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint, c = joints[k], joints[k]["coordinate"]
        if joint["type"] == JOINT_BALL:
            for j in range(3):
                power += _present_force(joint, driver, j) * rates[c + j]
        elif joint["width"] == 1 and (joint["damping"] != 0 or joint["held"] == 1):
            most, x = joint["largest_force"], driver["positions"][joint["place"]]
            spring = min(max(joint["stiffness"] * (joint["target"] - x), -most), most)
            power += (_present_force(joint, driver, 0) - spring) * rates[c]
    return power


@kernel
def _own_force(joint, driver, j):
    """Force of a joint of the tree along its rate j, at its position and rate."""
    return min(max(_asked_force(joint, driver, j), -joint["largest_force"]), joint["largest_force"])


@kernel
def _asked_force(joint, driver, j):
    """`_own_force` without bounds."""
    rate = driver["rates"][joint["coordinate"] + j]
    if joint["width"] == 1:
        return _unbounded_force(joint, driver["positions"][joint["place"]], rate)
    return -joint["damping"] * rate


@kernel
def _present_force(joint, driver, j):
    """Force of a joint of the tree along its rate j: even, if it is held."""
    if joint["held"] == 1:
        return driver["held_force"][joint["coordinate"] + j]
    return _own_force(joint, driver, j)


@kernel
def _add_loop_force(bodies, joints, joint, driver):
    """Add the force of the spring, damper or motor of a joint that closes a loop; returns its power [W]."""
    if joint["stiffness"] == 0 and joint["damping"] == 0:
        return 0.0
    o, a = child_point(bodies, joint), world_axis(bodies, joint)
    arm, u = plus(o, -1.0, driver["center"]), driver["loop_direction"]
    _, _, v, w = _point_drift(bodies, joints, joint["child"], o)
    _, _, p, q = _point_drift(bodies, joints, joint["parent"], o)
    v, w = plus(v, -1.0, p), plus(w, -1.0, q)
    for i in range(6):
        u[i] = 0.0
    if joint["type"] == JOINT_SLIDER:
        x = dot(a, plus(o, -1.0, parent_point(bodies, joint, joint["parent_anchor"])))
        force = joint_force(joint, x, dot(a, v))
        power = force * dot(a, v)
        for i in range(3):
            u[i] = force * a[i]
    elif joint["type"] == JOINT_HINGE:
        force = joint_force(joint, hinge_angle(bodies, joint, a), dot(a, w))
        power = force * dot(a, w)
        for i in range(3):
            u[3 + i] = force * a[i]
    else:
        for i in range(3):
            u[3 + i] = -joint["damping"] * w[i]
        power = -joint["damping"] * dot(w, w)
    add_rows(joints, joint["child"], bodies, arm, driver["force"], u, 1.0)
    add_rows(joints, joint["parent"], bodies, arm, driver["force"], u, -1.0)
    return power


@kernel
def set_drifts(bodies, joints, driver):
    """Set the accelerations at constant rates of a mechanism's bodies, which are posed and moved."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        _set_drift(bodies, joints, joints[k], driver["rates"])


@kernel
def _set_drift(bodies, joints, joint, rates):
    """Accelerations of a joint's child at constant rates."""
    a, alpha, child = joint["drift"], joint["spin_drift"], bodies[joint["child"]]
    a[:] = alpha[:] = 0.0
    if joint["type"] == JOINT_FREE:
        return
    w = (0.0, 0.0, 0.0)
    o = child_point(bodies, joint)
    if joint["parent"] >= 0 and bodies[joint["parent"]]["driver"] >= 0:
        parent = bodies[joint["parent"]]
        inner = joints[parent["hinge"]]
        w = vector_of(parent["omega"])
        # of the parent's point at the joint; that of a slider moves along it
        r = plus(o, -1.0, parent["center"])
        x = plus(vector_of(inner["drift"]), 1.0, cross(inner["spin_drift"], r))
        x = plus(x, 1.0, cross(w, cross(w, r)))
        for i in range(3):
            a[i], alpha[i] = x[i], inner["spin_drift"][i]
    u = vector_of(child["omega"])
    if joint["type"] == JOINT_SLIDER:
        x = times(2 * rates[joint["coordinate"]], cross(w, world_axis(bodies, joint)))
        for i in range(3):
            a[i] += x[i]
    elif joint["type"] != JOINT_BALL and joint["type"] != JOINT_FIXED:
        # the axis turns with the parent
        x = cross(w, u)
        for i in range(3):
            alpha[i] += x[i]
    r = plus(child["center"], -1.0, o)
    x = plus(cross(alpha, r), 1.0, cross(u, cross(u, r)))
    for i in range(3):
        a[i] += x[i]


@kernel
def _parting(bodies, joints, driver, place):
    """Acceleration of a constraint at constant rates."""
    joint, c, u = joints[place // 6], place % 6, driver["loop_direction"]
    if joint["mimics"] >= 0:
        return 0.0
    loop_rates(bodies, joint, c, u)
    o = child_point(bodies, joint)
    a, alpha, v, w = _point_drift(bodies, joints, joint["child"], o)
    b, beta, p, q = _point_drift(bodies, joints, joint["parent"], o)
    if c < 3:
        n = (u[0], u[1], u[2])
        return dot(n, plus(plus(a, -1.0, b), -2.0, cross(q, plus(v, -1.0, p))))
    n = (u[3], u[4], u[5])
    return dot(n, plus(alpha, -1.0, beta)) + dot(cross(q, n), plus(w, -1.0, q))


@kernel
def _point_drift(bodies, joints, b, point):
    """Accelerations at constant rates and velocities of a body at a point; zero of what does not move."""
    zero = (0.0, 0.0, 0.0)
    if b < 0 or bodies[b]["driver"] < 0:
        return zero, zero, zero, zero
    body, joint = bodies[b], joints[bodies[b]["hinge"]]
    r, w = plus(point, -1.0, body["center"]), vector_of(body["omega"])
    alpha = vector_of(joint["spin_drift"])
    a = plus(plus(vector_of(joint["drift"]), 1.0, cross(alpha, r)), 1.0, cross(w, cross(w, r)))
    return a, alpha, plus(vector_of(body["velocity"]), 1.0, cross(w, r)), w


@kernel
def _set_position_slope(bodies, joint, driver, out_slope):
    c, place, rates, p = joint["coordinate"], joint["place"], driver["rates"], driver["positions"]
    if joint["width"] == 1:
        out_slope[place] = rates[c]
    elif joint["type"] == JOINT_BALL:
        w = in_parent(bodies, joint, (rates[c], rates[c + 1], rates[c + 2]))
        _set_turn_slope(p, place, w, out_slope)
    elif joint["type"] == JOINT_FREE:
        for i in range(3):
            out_slope[place + i] = rates[c + i]
        _set_turn_slope(p, place + 3, (rates[c + 3], rates[c + 4], rates[c + 5]), out_slope)


@kernel
def _set_turn_slope(p, k, w, out_slope):
    """q' = w q / 2 of the quaternion from place k on."""
    out_slope[k] = -(w[0] * p[k + 1] + w[1] * p[k + 2] + w[2] * p[k + 3]) / 2
    out_slope[k + 1] = (w[0] * p[k] + w[1] * p[k + 3] - w[2] * p[k + 2]) / 2
    out_slope[k + 2] = (w[1] * p[k] + w[2] * p[k + 1] - w[0] * p[k + 3]) / 2
    out_slope[k + 3] = (w[2] * p[k] + w[0] * p[k + 2] - w[1] * p[k + 1]) / 2

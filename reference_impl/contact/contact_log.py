"""Contact log of a frame: one row per impulse, with the surface velocities before and after it."""

from touchstone.reference_impl.core.conventions import FIXED, SIMULATED
from touchstone.reference_impl.core.counters import COUNT_LOST
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector, dot
from touchstone.reference_impl.solver.islands import has_moment
from touchstone.reference_impl.solver.mobility import point_velocity, relative_turn, surface_velocity


@kernel
def log_contact(contacts, state, pair, point, time):
    """Add a row to the frame's contact log; returns its index, or -1 (counted) if the log is full."""
    row = state["contact_count"]
    if row == len(contacts):
        state["counters"][COUNT_LOST] += 1
        return -1
    contact = contacts[row]
    contact["time"] = time
    contact["body_a"], contact["body_b"] = pair["body_a"], pair["body_b"]
    contact["distance"] = pair["distance"]
    copy_vector(point, contact["position"])
    copy_vector(pair["normal"], contact["normal"])
    state["contact_count"] = row + 1
    return row


@kernel
def close_row(bodies, pair, contact, p):
    """Complete a row of the contact log with its impulse p and the surface velocities after it."""
    copy_vector(p, contact["impulse"])
    _surface_after(bodies[pair["body_a"]], pair["lever_a"], pair["surface_a"], contact["velocity_a_after"])
    _surface_after(bodies[pair["body_b"]], pair["lever_b"], pair["surface_b"], contact["velocity_b_after"])


@kernel
def _surface_after(body, point, motion, out_velocity):
    surface_velocity(body, point, out_velocity)
    for i in range(3):
        out_velocity[i] += motion[i]


@kernel
def log_held(bodies, pairs, count, contacts, state, time):
    """Log the nonzero impulses of the rows `pairs[:count]`.

    In an island with a driver, the velocities are those at the middle of the substep whose mean covers its
    way: the impulse times the mean is then the work.
    """
    for k in range(count):
        pair = pairs[k]
        p = pair["resting_impulse"]
        if p[0] == 0 and p[1] == 0 and p[2] == 0:
            continue
        row = log_contact(contacts, state, pair, pair["point"], time)
        if row >= 0:
            copy_vector(pair["before_a"], contacts[row]["velocity_a_before"])
            copy_vector(pair["before_b"], contacts[row]["velocity_b_before"])
            close_row(bodies, pair, contacts[row], p)
            if bodies[pair["body_a"]]["led"] == 0 and bodies[pair["body_b"]]["led"] == 0:
                _add_bias(bodies, pair, contacts[row])
                if state["moving_surfaces"] == 1:
                    _extrapolate_surfaces(bodies, pair, contacts[row])
            else:
                contact, a, b = contacts[row], bodies[pair["body_a"]], bodies[pair["body_b"]]
                before, after = contact["velocity_a_before"], contact["velocity_a_after"]
                _cover_way(a, pair["lever_a"], pair["surface_a"], before, after)
                before, after = contact["velocity_b_before"], contact["velocity_b_after"]
                _cover_way(b, pair["lever_b"], pair["surface_b"], before, after)


@kernel
def _cover_way(body, point, motion, before, after):
    """Set the surface velocities of a body in an island with a driver at the start of a substep, and those at
    its end whose mean with them covers the way, both at the contact point of its middle."""
    if body["led"] == 1:
        x, y, z = point_velocity(body["old_velocity"], body["old_omega"], body["center"], point)
        before[0], before[1], before[2] = x + motion[0], y + motion[1], z + motion[2]
        x, y, z = point_velocity(body["path_velocity"], body["path_omega"], body["center"], point)
        after[0], after[1], after[2] = x + motion[0], y + motion[1], z + motion[2]


@kernel
def _add_bias(bodies, pair, contact):
    """Add to the velocities after a substep how rotation changes them, on a simulated body."""
    to_b = bodies[pair["body_b"]]["kind"] == SIMULATED
    for i in range(3):
        if to_b:
            contact["velocity_b_after"][i] += pair["bias"][i]
        else:
            contact["velocity_a_after"][i] -= pair["bias"][i]


@kernel
def _extrapolate_surfaces(bodies, pair, contact):
    """Add to the velocities after a substep the second half of the change of a fixed body's surface motion,
    which is a part of `bias`, so that the other body got it."""
    if bodies[pair["body_a"]]["kind"] == FIXED:
        middle, before = pair["surface_a"], pair["before_a"]
    elif bodies[pair["body_b"]]["kind"] == FIXED:
        middle, before = pair["surface_b"], pair["before_b"]
    else:
        return
    for i in range(3):
        contact["velocity_a_after"][i] += middle[i] - before[i]
        contact["velocity_b_after"][i] += middle[i] - before[i]


@kernel
def note_moment_work(bodies, pairs, count, share, state):
    """Add to `moment_work` the work of rolling and torsional friction of the rows `pairs[:count]`, of whose
    moments a share acted [1]."""
    for k in range(count):
        if has_moment(pairs[k]):
            m, w = pairs[k]["moment"], pairs[k]["free_turn"]
            relative_turn(bodies, pairs[k], w)
            state["moment_work"] += share * (dot(m, pairs[k]["turn_before"]) + dot(m, w)) / 2


@inlined_kernel
def shorten_resting_contacts(contacts, first, end, fraction):
    """Scale the impulses and velocity changes in rows `first` to `end` - 1 to a fraction of their substep."""
    for k in range(first, end):
        row = contacts[k]
        for i in range(3):
            row["impulse"][i] *= fraction
            a, b = row["velocity_a_before"][i], row["velocity_b_before"][i]
            row["velocity_a_after"][i] = a + fraction * (row["velocity_a_after"][i] - a)
            row["velocity_b_after"][i] = b + fraction * (row["velocity_b_after"][i] - b)

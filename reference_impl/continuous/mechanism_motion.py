"""Motion of mechanisms over a substep: the solution of their equations of motion, and the response to
impulses.

Positions and rates follow the equations of motion (`mechanism_flow`). Of impulses of contacts and limits,
even over a substep of length h, the solver knows the response at its middle alone: the rates L'^-1 y, in full
at its end, and h / 2 times that in the positions, as for a free body. So the mechanism moves again under the
forces that were solved (`follow_forces`), and what its motion differs by is corrected in another solve: its
momentum changes by the impulses, and no more.
"""

from math import sqrt

from touchstone.reference_impl.continuous.free_rotation import refresh_inertia
from touchstone.reference_impl.continuous.hinge_motion import (
    ask_limits,
    drop_limits,
    find_limits,
    has_limits,
)
from touchstone.reference_impl.continuous.mechanism_dynamics import (
    answer_forces,
    answer_gains,
    answer_impulses,
    answer_lacks,
    close_loops,
    drop_holds,
    has_springs,
    hold_joints,
    note_lacks,
    weigh_answers,
    weigh_mechanism,
)
from touchstone.reference_impl.continuous.mechanism_flow import flow
from touchstone.reference_impl.core.conventions import KEEPS_NOTHING, NEVER
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, rotation_between
from touchstone.reference_impl.kinematics.mechanism import (
    add_rates,
    add_velocities,
    find_start_rates,
    find_way,
    move_mechanism,
    pose_bodies,
    pose_mechanism,
)

HOLD_ROUNDS = 8
"""Most motions of a substep until the even forces of held joints are those at its end: each squares the error
but for rotation."""


@kernel
def start_mechanism(bodies, joints, driver):
    """Pose a newly filled mechanism, with rates by the velocities of its bodies."""
    pose_mechanism(bodies, joints, driver)
    weigh_mechanism(bodies, joints, driver)
    find_start_rates(bodies, joints, driver)
    move_mechanism(bodies, joints, driver)
    show_rates(joints, driver)


@kernel
def begin_mechanism(driver):
    """Store a mechanism's positions and rates at the start of a substep."""
    driver["end_time"], driver["at_middle"] = -1.0, 0
    for i in range(driver["position_count"]):
        driver["start_positions"][i] = driver["positions"][i]
    for i in range(driver["hinge_count"]):
        driver["start_rates"][i] = driver["rates"][i]


@kernel
def _return(driver):
    """Set a mechanism's positions and rates to those at the start of its substep; poses no body."""
    for i in range(driver["position_count"]):
        driver["positions"][i] = driver["start_positions"][i]
    for i in range(driver["hinge_count"]):
        driver["rates"][i] = driver["start_rates"][i]


@kernel
def return_mechanism(bodies, joints, driver):
    """Return a mechanism to the start of its substep."""
    _return(driver)
    show_rates(joints, driver)
    pose_bodies(bodies, joints, driver, driver["positions"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        body = bodies[joints[k]["child"]]
        copy_vector(body["old_velocity"], body["velocity"])
        copy_vector(body["old_omega"], body["omega"])


@kernel
def show_rates(joints, driver):
    """Set angle and rate of a mechanism's hinges and sliders from its positions and rates."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        if joints[k]["width"] == 1:
            joints[k]["angle"] = driver["positions"][joints[k]["place"]]
            joints[k]["rate"] = driver["rates"][joints[k]["coordinate"]]


@kernel
def note_touched(bodies, joints, drivers, pairs, count):
    """Note on which mechanisms and chains the contacts `pairs[:count]` act."""
    for d in range(len(drivers)):
        drivers[d]["touches"] = 0
        for i in range(drivers[d]["chain_count"]):
            joints[drivers[d]["chains"][i, 0]]["touched"] = 0
    for k in range(count):
        for b in (pairs[k]["body_a"], pairs[k]["body_b"]):
            if bodies[b]["driver"] >= 0:
                driver, hinge = drivers[bodies[b]["driver"]], bodies[b]["hinge"]
                driver["touches"] = 1
                while driver["chain_count"] > 0 and hinge >= 0:
                    if joints[hinge]["chain"] >= 0:
                        joints[driver["chains"][joints[hinge]["chain"], 0]]["touched"] = 1
                    hinge = joints[hinge]["inner"]


@kernel
def is_pressed(joints, driver):
    """Whether contacts or limits act on a mechanism."""
    return driver["touches"] == 1 or has_limits(joints, driver)


@kernel
def weigh_for_impact(bodies, joints, driver, h):
    """Let the joints of a pressed mechanism that are too fast for a time h answer impacts as they do forces
    over h."""
    driver["held"], driver["held_time"] = 0, h
    if is_pressed(joints, driver) and has_springs(joints, driver):
        hold_joints(joints, driver, h)
        if driver["held"] == 1:
            weigh_answers(bodies, joints, driver)


@kernel
def yield_to_impact(bodies, joints, driver):
    """Let the held joints answer no more that have changed their rates since the start of an impact by more
    than their largest forces do over the time of `weigh_for_impact`; returns whether any does."""
    found = False
    if driver["held"] == 1:
        for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
            for c in range(joints[k]["coordinate"], joints[k]["coordinate"] + joints[k]["width"]):
                change = abs(driver["rates"][c] - driver["start_rates"][c])
                if joints[k]["answer"] * change > driver["held_time"] * joints[k]["largest_force"]:
                    joints[k]["answer"], found = 0.0, True
    if found:
        weigh_answers(bodies, joints, driver)
    return found


@kernel
def slow_joints(bodies, joints, driver):
    """Slow the held joints by their answers to their own rates: an impact then takes no energy from what
    holds them."""
    if driver["held"] == 0:
        return
    x = driver["hinge_response"]
    for i in range(driver["hinge_count"]):
        x[i] = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        for c in range(joints[k]["coordinate"], joints[k]["coordinate"] + joints[k]["width"]):
            x[c] = -joints[k]["answer"] * driver["rates"][c]
    answer_impulses(driver, x)
    take_gains(bodies, joints, driver)


@kernel
def answered(joints, driver, one, two):
    """Product of two vectors of rates with the answers of held joints [J]."""
    total = 0.0
    if driver["held"] == 1:
        for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
            for c in range(joints[k]["coordinate"], joints[k]["coordinate"] + joints[k]["width"]):
                total += joints[k]["answer"] * one[c] * two[c]
    return total


@kernel
def _find_end(bodies, joints, driver, h):
    """Set `end_*` of a substep of length h under the known forces."""
    driver["at_middle"], driver["end_time"] = 0, h
    for _ in range(HOLD_ROUNDS):
        _return(driver)
        driver["lost"] = 0 if flow(bodies, joints, driver, h) else 1
        driver["end_work"] = driver["work"]
        for i in range(driver["position_count"]):
            driver["end_positions"][i] = driver["positions"][i]
        for i in range(driver["hinge_count"]):
            driver["end_rates"][i] = driver["rates"][i] - driver["known_gains"][i]
        if driver["held"] == 0 or driver["lost"] == 1:
            break
        note_lacks(joints, driver, h)
        _pose_middle(bodies, joints, driver)
        if answer_lacks(bodies, joints, driver, h) <= driver["step_error"]:
            break


@kernel
def note_forces(driver, h):
    """Store the generalised forces whose impulses over a substep of length h cause a mechanism's `gains`."""
    s, count, gains, force = driver["hinge_factor"], driver["hinge_count"], driver["gains"], driver["force"]
    for i in range(count):
        force[i] = 0.0
        for j in range(i, count):
            force[i] += s[j, i] * gains[j]
    for i in range(count):
        total = 0.0
        for j in range(i + 1):
            total += s[i, j] * force[j]
        driver["solved_force"][i] = total / h


@kernel
def follow_forces(bodies, joints, driver, h):
    """Let a mechanism move over its substep of length h under the forces that were solved.

    Returns:
        How far its bodies end from where its gains lead, without that of their law of positions: the root
        mean square, by mass, of h times the velocity between [m]. NEVER if that motion is lost.
    """
    count, before = driver["hinge_count"], driver["hinge_response"]
    known, pushed = True, False
    for i in range(count):
        known = known and driver["gains"][i] == driver["known_gains"][i]
        pushed = pushed or driver["gains"][i] != 0 or driver["path_gains"][i] != 0
    if driver["held"] == 1 and not pushed:
        _let_go(bodies, joints, driver, h)
    if driver["lost"] == 1:
        return NEVER
    if known:
        return 0.0
    if driver["held"] == 1:
        answer_gains(joints, driver, h)
    for i in range(count):
        before[i] = driver["end_rates"][i]
        driver["known_force"][i], driver["known_gains"][i] = driver["solved_force"][i], driver["gains"][i]
    if driver["has_path"] == 1:
        _answer_known(driver, h, 1.0)
    _find_end(bodies, joints, driver, h)
    if driver["lost"] == 1:
        return NEVER
    weigh_mechanism(bodies, joints, driver)
    energy = mass = 0.0
    for i in range(count):
        y = 0.0
        for j in range(i, count):
            y += driver["hinge_factor"][j, i] * (driver["end_rates"][j] - before[j])
        energy += y * y
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        mass += bodies[joints[k]["child"]]["mass"]
    _pose_middle(bodies, joints, driver)
    if driver["has_path"] == 1:
        _follow_path(bodies, joints, driver, h)
    _show_end(bodies, joints, driver)
    add_velocities(bodies, joints, driver, driver["gains"])
    return h * sqrt(energy / mass)


@kernel
def _let_go(bodies, joints, driver, h):
    """Let a mechanism move over its substep of length h without held joints: no contact pushes it."""
    driver["holds"] = 0
    drop_holds(joints, driver)
    _find_end(bodies, joints, driver, h)
    _pose_middle(bodies, joints, driver)
    _show_end(bodies, joints, driver)


@kernel
def _pose_middle(bodies, joints, driver):
    """Pose a mechanism at the middle of its substep."""
    for i in range(driver["position_count"]):
        driver["positions"][i] = (driver["start_positions"][i] + driver["end_positions"][i]) / 2
    pose_mechanism(bodies, joints, driver)


@kernel
def _show_end(bodies, joints, driver):
    """Pose a mechanism at the start of its substep, with the velocities of `end_rates` at the poses of its
    columns."""
    _return(driver)
    show_rates(joints, driver)
    _set_velocities(bodies, joints, driver, driver["end_rates"])
    pose_bodies(bodies, joints, driver, driver["positions"])


@kernel
def _set_velocities(bodies, joints, driver, rates):
    """Set the velocities of a mechanism's bodies to those at some `rates`, at the poses of its columns."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        bodies[joints[k]["child"]]["velocity"][:] = bodies[joints[k]["child"]]["omega"][:] = 0.0
    add_velocities(bodies, joints, driver, rates)


@kernel
def coast_mechanism(bodies, joints, driver, h, lead):
    """Set a mechanism's velocities by its rates after a time h without impulses, and its response, at its
    poses in the middle of that time; its bodies are posed at the start of the substep. `lead` is 1 in the law
    of positions, and 0 of a substep without contacts and limits, which asks for no response."""
    count, holds = driver["hinge_count"], 1 if lead > 0 and is_pressed(joints, driver) else 0
    if driver["end_time"] != h or driver["holds"] != holds:
        for i in range(count):
            driver["known_force"][i] = driver["known_gains"][i] = 0.0
        driver["holds"] = holds
        if holds == 1 and has_springs(joints, driver):
            _return(driver)
            pose_mechanism(bodies, joints, driver)
            weigh_mechanism(bodies, joints, driver)
            hold_joints(joints, driver, h)
        else:
            drop_holds(joints, driver)
        _find_end(bodies, joints, driver, h)
    if lead == 1 or (lead > 0 and driver["at_middle"] == 0):
        _pose_middle(bodies, joints, driver)
        weigh_mechanism(bodies, joints, driver)
        if holds == 1:
            answer_forces(bodies, joints, driver, h, lead)
        # of the law of positions it is another
        driver["at_middle"] = 0 if lead == 1 else 1
        _answer_known(driver, h, lead)
    for i in range(count):
        driver["gains"][i] = 0.0
        if lead < 1:
            driver["path_gains"][i] = 0.0
    driver["has_path"] = 1 if lead == 1 else 0
    if lead == 1:
        _set_leads(bodies, joints, driver, h)
    _show_end(bodies, joints, driver)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["width"] == 1:
            way = driver["end_positions"][joint["place"]] - joint["angle"]
            joint["old_rate"], joint["rate"] = joint["rate"], driver["end_rates"][joint["coordinate"]]
            lead_rate = 2 * way / h - driver["known_path"][joint["coordinate"]] - joint["rate"]
            joint["lead_rate"] = lead_rate if lead == 1 else 0.0
    driver["lasting"] = 1
    ask_limits(joints, driver, lead, h)


@kernel
def _answer_known(driver, h, lead):
    """Set the changes of rates by `known_force` as a law takes them: by its response to other forces."""
    x, known = driver["force"], driver["known_path"] if lead == 1 else driver["known_gains"]
    for i in range(driver["hinge_count"]):
        x[i] = h * driver["known_force"][i]
    answer_impulses(driver, x)
    for i in range(driver["hinge_count"]):
        if lead < 1:
            driver["end_rates"][i] += known[i] - x[i]
        known[i] = x[i]


@kernel
def _set_leads(bodies, joints, driver, h):
    """Set `lead_*` of a mechanism's bodies: at the poses of its columns, twice the mean of the rates over a
    substep of length h without impulses, less those at its end."""
    x = driver["force"]
    _find_twice_mean(bodies, joints, driver, h, x)
    for i in range(driver["hinge_count"]):
        x[i] -= driver["end_rates"][i]
    _set_velocities(bodies, joints, driver, x)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        body = bodies[joints[k]["child"]]
        copy_vector(body["velocity"], body["lead_velocity"])
        copy_vector(body["omega"], body["lead_omega"])


@kernel
def _follow_path(bodies, joints, driver, h):
    """Set `path_*` of a mechanism's bodies to the motion under the known forces and the rest of those of the
    law of positions, over a substep of length h."""
    x = driver["force"]
    _find_twice_mean(bodies, joints, driver, h, x)
    for i in range(driver["hinge_count"]):
        x[i] += driver["path_gains"][i]
    _set_velocities(bodies, joints, driver, x)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        body = bodies[joints[k]["child"]]
        for i in range(3):
            body["path_velocity"][i] = body["velocity"][i] - body["old_velocity"][i]
            body["path_omega"][i] = body["omega"][i] - body["old_omega"][i]


@kernel
def _find_twice_mean(bodies, joints, driver, h, out_rates):
    """Twice the mean of the rates over a substep of length h, without impulses that are not known."""
    find_way(bodies, joints, driver, driver["start_positions"], driver["end_positions"], out_rates)
    for i in range(driver["hinge_count"]):
        out_rates[i] = 2 * out_rates[i] / h - driver["known_path"][i]


@kernel
def keep_mechanism_in_limits(joints, driver, h):
    """Make rows of the limits that a mechanism's joints leave in its substep of length h; returns whether any
    is new."""
    gains, known = driver["gains"], driver["known_gains"]
    if driver["has_path"] == 1:
        gains, known = driver["path_gains"], driver["known_path"]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        if joint["width"] == 1:
            end = driver["end_positions"][joint["place"]]
            c = joint["coordinate"]
            joint["angle"] = end + h / 2 * (gains[c] - known[c])
    found = find_limits(joints, driver)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        if joints[k]["width"] == 1:
            joints[k]["angle"] = driver["start_positions"][joints[k]["place"]]
    return found


@kernel
def exchange_gains(driver):
    """Exchange the changes of rates of the law of velocities with those of the law of positions."""
    for i in range(driver["hinge_count"]):
        driver["gains"][i], driver["path_gains"][i] = driver["path_gains"][i], driver["gains"][i]


@kernel
def note_mechanism_paths(bodies, joints, driver):
    """Turn the velocities `path_*` of the law of positions of a mechanism's bodies into those whose mean with
    the velocities at the substep's start covers their way."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        body = bodies[joints[k]["child"]]
        for i in range(3):
            body["path_velocity"][i] += body["lead_velocity"][i] - body["old_velocity"][i]
            body["path_omega"][i] += body["lead_omega"][i] - body["old_omega"][i]


@kernel
def take_gains(bodies, joints, driver):
    """Change a mechanism's velocities by the change of rates in `hinge_response`: at one instant, or over the
    substep."""
    x = driver["hinge_response"]
    for i in range(driver["hinge_count"]):
        if driver["lasting"] == 1:
            driver["gains"][i] += x[i]
        else:
            driver["rates"][i] += x[i]
    add_velocities(bodies, joints, driver, x)
    if driver["lasting"] == 0:
        show_rates(joints, driver)


@kernel
def has_motor(joints, driver):
    """Whether a joint of a mechanism has a motor, which may add energy."""
    end = driver["first_joint"] + driver["joint_count"] + driver["loop_count"]
    for k in range(driver["first_joint"], end):
        if joints[k]["target_rate"] != 0:
            return True
    return False


@kernel
def spring_energy(joints, driver):
    """Energy in the springs of the joints of a mechanism's tree [J], whose force is at most the largest one
    of the joint."""
    total = 0.0
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        stiffness, most = joints[k]["stiffness"], joints[k]["largest_force"]
        if joints[k]["width"] == 1 and stiffness > 0:
            x = abs(driver["positions"][joints[k]["place"]] - joints[k]["target"])
            bent = min(x, most / stiffness)
            total += stiffness * bent * bent / 2 + most * (x - bent)
    return total


@kernel
def take_velocities(bodies, joints, driver):
    """Set a mechanism's rates from the velocities of its bodies, and these from the rates."""
    find_start_rates(bodies, joints, driver)
    move_mechanism(bodies, joints, driver)
    show_rates(joints, driver)


@kernel
def note_rates(driver, out_rates):
    """Copy a mechanism's rates."""
    for i in range(driver["hinge_count"]):
        out_rates[i] = driver["rates"][i]


@kernel
def set_rates(bodies, joints, driver, one, two, share):
    """Set a mechanism's rates to those a share of the way from `one` to `two`, and its velocities."""
    for i in range(driver["hinge_count"]):
        driver["rates"][i] = one[i] + share * (two[i] - one[i])
    move_mechanism(bodies, joints, driver)
    show_rates(joints, driver)


@kernel
def stop_mechanism(driver):
    """Keep a mechanism's rates, and set them to zero."""
    driver["end_time"] = -1.0
    for i in range(driver["hinge_count"]):
        driver["end_rates"][i], driver["rates"][i] = driver["rates"][i], 0.0


@kernel
def shift_mechanism(bodies, joints, driver, allowed):
    """Move a mechanism for a second at its rates, if allowed, and give it the rates that it kept."""
    driver["at_middle"] = 0
    for i in range(driver["hinge_count"]):
        driver["force"][i], driver["rates"][i] = driver["rates"][i], driver["end_rates"][i]
    if allowed:
        add_rates(bodies, joints, driver, driver["force"], 1.0)
        pose_mechanism(bodies, joints, driver)
        if driver["constrained"] == 1:
            weigh_mechanism(bodies, joints, driver)
            close_loops(bodies, joints, driver)
    move_mechanism(bodies, joints, driver)
    show_rates(joints, driver)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        refresh_inertia(bodies[joints[k]["child"]])


@kernel
def _reach(bodies, joints, driver, s, h):
    """Pose a mechanism at the fraction s of its substep of length h, and set its rates there."""
    driver["at_middle"] = 0
    known, gains, any_gain = driver["known_gains"], driver["gains"], False
    path, known_path, x = gains, known, driver["hinge_response"]
    if driver["has_path"] == 1:
        path, known_path = driver["path_gains"], driver["known_path"]
    if s == 1 and driver["end_time"] == h:
        driver["work"] = driver["end_work"]
        for i in range(driver["position_count"]):
            driver["positions"][i] = driver["end_positions"][i]
        for i in range(driver["hinge_count"]):
            driver["rates"][i] = driver["end_rates"][i] + gains[i]
        pose_mechanism(bodies, joints, driver)
    else:
        _return(driver)
        flow(bodies, joints, driver, s * h)
        for i in range(driver["hinge_count"]):
            driver["rates"][i] += s * (gains[i] - known[i])
    for i in range(driver["hinge_count"]):
        x[i] = path[i] - known_path[i]
        any_gain = any_gain or x[i] != 0 or gains[i] != known[i]
    if any_gain:
        add_rates(bodies, joints, driver, x, s * s * h / 2)
        pose_mechanism(bodies, joints, driver)
        if driver["constrained"] == 1:
            weigh_mechanism(bodies, joints, driver)
            close_loops(bodies, joints, driver)


@kernel
def set_body_ways(bodies, joints, driver, until, h):
    """Set the motion of a mechanism's bodies over a substep of length h: parabolas that start at their
    velocities and lead through their poses at its fraction `until`; `end_*` are their velocities there."""
    _reach(bodies, joints, driver, until, h)
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    for k in range(first, end):
        body = bodies[joints[k]["child"]]
        set_way(body, driver["scratch"][0], until, h)
        copy_vector(body["velocity"], body["end_velocity"])
        copy_vector(body["omega"], body["end_omega"])
    move_mechanism(bodies, joints, driver)
    for k in range(first, end):
        body = bodies[joints[k]["child"]]
        for i in range(3):
            v, w = body["end_velocity"], body["end_omega"]
            body["velocity"][i], v[i] = v[i], body["velocity"][i]
            body["omega"][i], w[i] = w[i], body["omega"][i]


@kernel
def body_way_error(bodies, joints, driver, body, s, h):
    """`way_error` of a mechanism's body."""
    _reach(bodies, joints, driver, s, h)
    return distance_to_way(body, driver["scratch"][0], s)


@kernel
def end_mechanism(bodies, joints, driver, s, h):
    """End a mechanism's substep of length h at its fraction s."""
    _reach(bodies, joints, driver, s, h)
    move_mechanism(bodies, joints, driver)
    show_rates(joints, driver)
    driver["limited"] = 1 if has_limits(joints, driver) else 0
    drop_limits(joints, driver)
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        body = bodies[joints[k]["child"]]
        body["led"] = 0
        refresh_inertia(body)


@kernel
def set_way(body, turned, until, h):
    """Set a body's motion over a substep of length h: a parabola that starts at its velocities and leads
    through its present pose at the fraction `until`; `turned` is scratch."""
    rotation_between(body["old_orientation"], body["orientation"], turned)
    for i in range(3):
        way, arc = body["center"][i] - body["old_center"][i], turned[i]
        body["travel"][i], body["turn"][i] = h * body["old_velocity"][i], h * body["old_omega"][i]
        body["travel_bend"][i] = (way / until - body["travel"][i]) / until
        body["turn_bend"][i] = (arc / until - body["turn"][i]) / until
    body["moves"], body["spin_steps"], body["spin_keeps"] = 1, 0, KEEPS_NOTHING


@kernel
def distance_to_way(body, turned, s):
    """Distance between a body's present pose and that of its motion at the fraction s [m]."""
    rotation_between(body["old_orientation"], body["orientation"], turned)
    moved = arc = 0.0
    for i in range(3):
        way = s * (body["travel"][i] + s * body["travel_bend"][i])
        moved += (body["center"][i] - body["old_center"][i] - way) ** 2
        arc += (turned[i] - s * (body["turn"][i] + s * body["turn_bend"][i])) ** 2
    return sqrt(moved) + sqrt(arc) * body["reach"]

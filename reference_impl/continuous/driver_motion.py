"""Drivers as bodies of the simulated loop: Eq. 6 with contact forces in it.

    m x'' = -K (x - x_goal) - R (x' - x_goal') + f

The goal is the tracker, which moves linearly within a frame; in the direction in which overlap removal moved
the driver, it is the pose that removal found. The equation is linear: over a substep of length h with a
constant force its solution is the free motion plus f times the response of `coupling_response`, at any h. The
rotation obeys the same equation, critically damped at sqrt(K / m), about the centre of mass. So do the modes
of chains (`hinge_motion`).

The contact solver asks a law of velocities at the end of a substep. A coupling that is much faster than h
moves by f / K within it, but has no velocity at its end. Rows with a driver therefore ask the law of

    q = (1 - lead) u(h) + 2 lead (mean of u)          (lead in [0, 1])

For a simulated body q is its velocity after the impulse plus lead times that before it: it keeps its mass. A
driver's inverse mass is (1 - lead) H / h + 2 lead G / h^2, with G and H its displacement and velocity per
force; its lead grows with the share of H that the coupling takes away. At rest u = 0 and q = 0 say the same,
so static forces are exact. A second solve with lead = 1, the law of positions, gives the displacements: what
touches stays in touch, while its impulses change no velocity (stabilisation by a second multiplier: Gear,
Leimkuhler & Gupta 1985).
"""

from math import sqrt

from touchstone.reference_impl.continuous.coupling_response import decay, decay_turn, unit_response
from touchstone.reference_impl.continuous.hinge_motion import (
    advance_hinges,
    ask_limits,
    begin_hinges,
    clear_twists,
    drop_limits,
    exchange_limits,
    exchange_rates,
    find_limits,
    return_hinges,
    set_lead_rates,
    set_shares,
)
from touchstone.reference_impl.continuous.mechanism_motion import (
    begin_mechanism,
    body_way_error,
    coast_mechanism,
    distance_to_way,
    end_mechanism,
    exchange_gains,
    keep_mechanism_in_limits,
    note_mechanism_paths,
    return_mechanism,
    set_body_ways,
    set_way,
)
from touchstone.reference_impl.continuous.prescribed_path import follow_path
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    copy_quaternion,
    copy_vector,
    invert_symmetric,
    plus,
    rotation_between,
    times,
    turn,
    vector_of,
)
from touchstone.reference_impl.kinematics.skeleton import link_of, move_links, pose_links

STIFF_LEAD = 0.25
"""Lead of the law of velocities for a coupling that is much faster than the substep [1]. Where a surface
moves under it with a speed v, its force is wrong by about K h v over the lead; relative speed falls to that
share in a substep."""


@kernel
def return_to_start(bodies, joints, driver):
    """Return a driver to the pose and velocities at the start of its substep."""
    if driver["mechanism"] == 1:
        return_mechanism(bodies, joints, driver)
        return
    _return_pose(joints, driver)
    return_hinges(joints, driver)
    copy_vector(driver["old_velocity"], driver["velocity"])
    copy_vector(driver["old_omega"], driver["omega"])
    driver["clock"] = driver["old_clock"]
    pose_links(bodies, joints, driver)
    move_links(bodies, joints, driver)


@kernel
def _return_pose(joints, driver):
    """Return a driver's root and hinges to the start of its substep; does not pose the links."""
    copy_vector(driver["old_position"], driver["position"])
    copy_quaternion(driver["old_orientation"], driver["orientation"])
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["angle"] = joints[k]["old_angle"]


@kernel
def begin_driver(joints, driver):
    """Store the pose and velocities of a driver at the start of a substep."""
    if driver["mechanism"] == 1:
        begin_mechanism(driver)
        return
    copy_vector(driver["position"], driver["old_position"])
    copy_quaternion(driver["orientation"], driver["old_orientation"])
    copy_vector(driver["velocity"], driver["old_velocity"])
    copy_vector(driver["omega"], driver["old_omega"])
    driver["old_clock"] = driver["clock"]
    begin_hinges(joints, driver)


@kernel
def coast(bodies, joints, driver, h, lead, dt):
    """Set a driver's velocities after a time h without contact forces, its mobility over h, and its links'
    `lead_*`, q - u(h); its pose stays at the start of the substep. `lead` is 1 in the law of positions, and
    the least one in that of velocities."""
    if driver["mechanism"] == 1:
        coast_mechanism(bodies, joints, driver, h, lead)
        return
    if lead < 1:
        lead = driver["lead"] = max(lead, _stiff_lead(driver, h))
        driver["shift_push"][:] = driver["shift_twist"][:] = 0.0
    driver["push"][:] = driver["twist"][:] = 0.0
    clear_twists(joints, driver, lead < 1)
    _advance(joints, driver, h, h, dt, 0.0)
    v, w, turned = driver["velocity"], driver["omega"], driver["scratch"][0]
    rotation_between(driver["old_orientation"], driver["orientation"], turned)
    x, y, z, p, q, r = v[0], v[1], v[2], w[0], w[1], w[2]
    for i in range(3):
        v[i] = lead * (2 * (driver["position"][i] - driver["old_position"][i]) / h - v[i])
        w[i] = lead * (2 * turned[i] / h - w[i])
    set_lead_rates(joints, driver, lead, h)
    _return_pose(joints, driver)
    exchange_rates(joints, driver)
    move_links(bodies, joints, driver)
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        for i in range(3):
            share = 2 / h if lead == 1 else 0.0
            link["lead_velocity"][i] = link["velocity"][i] + share * link["curve"][i]
            link["lead_omega"][i] = link["omega"][i] + share * link["curve_turn"][i]
    exchange_rates(joints, driver)
    v[0], v[1], v[2], w[0], w[1], w[2] = x, y, z, p, q, r
    move_links(bodies, joints, driver)
    driver["lasting"] = 1
    if driver["prescribed"] == 1:
        return
    mass, stiffness = driver["mass"], driver["stiffness"] / driver["mass"]
    moved, speed = unit_response(stiffness, _damping(driver, h), h)
    turned_by, spin = unit_response(stiffness, 2 * sqrt(stiffness), h)
    driver["inverse_mass"] = ((1 - lead) * speed / h + 2 * lead * moved / (h * h)) / mass
    driver["turn_share"] = (1 - lead) * spin / h + 2 * lead * turned_by / (h * h)
    invert_symmetric(driver["inertia"], driver["inverse_inertia"])
    for i in range(3):
        for j in range(3):
            driver["inverse_inertia"][i, j] *= driver["turn_share"]
    if driver["hinge_count"] > 0:
        set_shares(joints, driver, lead, h)
        ask_limits(joints, driver, lead, h)


@kernel
def _stiff_lead(driver, h):
    """Lead of a driver over a substep of length h [1]: STIFF_LEAD of the share of its velocity per force that
    its coupling, or the servo of its hinges, takes away."""
    if driver["prescribed"] == 1:
        return 0.0
    _, speed = unit_response(driver["stiffness"] / driver["mass"], _damping(driver, h), h)
    if driver["hinge_count"] > 0:
        w = driver["hinge_frequency"]
        _, spin = unit_response(w * w, 2 * w, h)
        speed = min(speed, spin)
    return STIFF_LEAD * min(1 - speed / h, 1.0)


@kernel
def weigh_for_impacts(driver):
    """Give a driver the mass and inertia that an impulse at one instant meets."""
    driver["lasting"] = 0
    if driver["prescribed"] == 1 or driver["mechanism"] == 1:
        return
    driver["inverse_mass"] = 1 / driver["mass"]
    invert_symmetric(driver["inertia"], driver["inverse_inertia"])


@kernel
def accept_pushes(bodies, joints, driver, h, dt):
    """Set a driver's velocities at the end of a substep from the impulses that the solver gave it; its pose
    stays at the start."""
    if driver["mechanism"] == 1:
        return
    _advance(joints, driver, h, h, dt, 1.0)
    _return_pose(joints, driver)
    move_links(bodies, joints, driver)


@kernel
def keep_in_limits(joints, driver, h, dt):
    """Make rows of the limits that a driver's hinges leave in its substep of length h; returns whether any is
    new. The pose stays at the start."""
    if driver["mechanism"] == 1:
        return keep_mechanism_in_limits(joints, driver, h)
    _advance(joints, driver, h, h, dt, 1.0)
    found = find_limits(joints, driver)
    _return_pose(joints, driver)
    return found


@kernel
def predict_turn(bodies, driver, h, dt):
    """Set the `path_omega` of a prescribed body before a substep of length h is solved."""
    root = bodies[driver["root"]]
    follow_path(driver, driver["clock"] + h, dt)
    rotation_between(driver["old_orientation"], driver["orientation"], root["path_omega"])
    for i in range(3):
        root["path_omega"][i] = 2 / h * root["path_omega"][i] - root["omega"][i]
    copy_vector(driver["old_position"], driver["position"])
    copy_quaternion(driver["old_orientation"], driver["orientation"])
    copy_vector(driver["old_velocity"], driver["velocity"])
    copy_vector(driver["old_omega"], driver["omega"])


@kernel
def note_curves(bodies, joints, driver, h, dt):
    """Store how far the ways and turns of links over a substep of length h curve (`curve`, `curve_turn`), at
    the impulses of the law of velocities. Links turn about hinges; rows know the velocities of the start."""
    if driver["mechanism"] == 1:
        return
    exchange_pushes(joints, driver)
    _advance(joints, driver, h, h, dt, 1.0)
    exchange_pushes(joints, driver)
    pose_links(bodies, joints, driver)
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        for i in range(3):
            link["curve"][i] = link["center"][i] - link["old_center"][i]
        # the root, the last one, turns as its driver
        if k < driver["joint_count"]:
            rotation_between(link["old_orientation"], link["orientation"], link["curve_turn"])
    _cover_way(joints, driver, 1.0, h)
    pose_links(bodies, joints, driver)
    move_links(bodies, joints, driver)
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        for i in range(3):
            link["curve"][i] -= h * link["velocity"][i]
            if k < driver["joint_count"]:
                link["curve_turn"][i] -= h * link["omega"][i]


@kernel
def note_paths(bodies, joints, driver, h, dt):
    """Store in its links' `path_*` the velocities whose mean with those at the substep's start covers their
    way; the pose stays at the start, and `accept_pushes` restores the velocities."""
    if driver["mechanism"] == 1:
        note_mechanism_paths(bodies, joints, driver)
        return
    _advance(joints, driver, h, h, dt, 1.0)
    _cover_way(joints, driver, 2.0, h)
    move_links(bodies, joints, driver)
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(joints, driver, k)]
        for i in range(3):
            link["path_velocity"][i] = link["velocity"][i] + 2 / h * link["curve"][i]
            link["path_omega"][i] = link["omega"][i] + 2 / h * link["curve_turn"][i]
        link["led"] = driver["leads"]


@kernel
def _cover_way(joints, driver, twice, h):
    """Return a driver from the end of its substep of length h to the start, with the mean velocities of its
    way, or twice those less the velocities at the start."""
    turned = driver["scratch"][0]
    rotation_between(driver["old_orientation"], driver["orientation"], turned)
    for i in range(3):
        way = driver["position"][i] - driver["old_position"][i]
        driver["velocity"][i] = twice * way / h - (twice - 1) * driver["old_velocity"][i]
        driver["omega"][i] = twice * turned[i] / h - (twice - 1) * driver["old_omega"][i]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        way = joints[k]["angle"] - joints[k]["old_angle"]
        joints[k]["rate"] = twice * way / h - (twice - 1) * joints[k]["old_rate"]
    _return_pose(joints, driver)


@kernel
def exchange_pushes(joints, driver):
    """Exchange the impulses of the law of velocities with those of the law of positions."""
    exchange_limits(joints, driver)
    if driver["mechanism"] == 1:
        exchange_gains(driver)
        return
    for i in range(3):
        driver["push"][i], driver["shift_push"][i] = driver["shift_push"][i], driver["push"][i]
        driver["twist"][i], driver["shift_twist"][i] = driver["shift_twist"][i], driver["twist"][i]
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["twist"], joints[k]["shift_twist"] = joints[k]["shift_twist"], joints[k]["twist"]


@kernel
def repeat_pushes(joints, driver):
    """Replace the impulses of the law of velocities by those of the law of positions, before the exchange."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["shift_twist"] = joints[k]["twist"]
        joints[k]["shift_limit_impulse"] = joints[k]["limit_impulse"]
    for i in range(3):
        driver["shift_push"][i], driver["shift_twist"][i] = driver["push"][i], driver["twist"][i]
    for i in range(driver["hinge_count"]):
        driver["path_gains"][i] = driver["gains"][i]


@kernel
def set_link_ways(bodies, joints, driver, until, h, dt):
    """Set the motion of a driver's links over a substep of length h: parabolas that start at their velocities
    and lead through their poses at its fraction `until`."""
    if driver["mechanism"] == 1:
        set_body_ways(bodies, joints, driver, until, h)
        return
    _advance(joints, driver, until * h, h, dt, 1.0)
    pose_links(bodies, joints, driver)
    for k in range(driver["joint_count"] + 1):
        set_way(bodies[link_of(joints, driver, k)], driver["scratch"][0], until, h)


@kernel
def way_error(bodies, joints, driver, link, s, h, dt):
    """Distance at the fraction s of a substep of length h between the motion of a driver's link and its
    exact pose, in which it leaves all links [m]."""
    if driver["mechanism"] == 1:
        return body_way_error(bodies, joints, driver, link, s, h)
    _advance(joints, driver, s * h, h, dt, 1.0)
    pose_links(bodies, joints, driver)
    return distance_to_way(link, driver["scratch"][0], s)


@kernel
def end_driver(bodies, joints, driver, s, h, dt):
    """End a driver's substep of length h at its fraction s, at its exact pose there."""
    if driver["mechanism"] == 1:
        end_mechanism(bodies, joints, driver, s, h)
        return
    _advance(joints, driver, s * h, h, dt, 1.0)
    driver["clock"] += s * h
    drop_limits(joints, driver)
    for k in range(driver["joint_count"] + 1):
        bodies[link_of(joints, driver, k)]["led"] = 0
    pose_links(bodies, joints, driver)
    move_links(bodies, joints, driver)


@kernel
def _damping(driver, h):
    """Damping per mass of a driver over a substep of length h [1/s].

    A coupling that swings faster than the substep may answer a force with a speed against it. In contact it
    is damped critically there: what is at rest does not change.
    """
    stiffness, damping = driver["stiffness"] / driver["mass"], driver["damping"] / driver["mass"]
    if driver["pressed"] == 0 or stiffness * h * h <= 1:
        return damping
    return max(damping, 2 * sqrt(stiffness))


@kernel
def _advance(joints, driver, t, h, dt, share):
    """Set a driver's pose and velocities a time t after the start of its substep of length h: free motion,
    and a share of the response to its forces, even over the substep; does not pose the links."""
    advance_hinges(joints, driver, t, h, dt, share)
    if driver["prescribed"] == 1:
        follow_path(driver, driver["clock"] + t, dt)
        return
    mass = driver["mass"]
    stiffness, damping = driver["stiffness"] / mass, _damping(driver, h)
    moved, speed = unit_response(stiffness, damping, t)
    turned_by, spin = unit_response(stiffness, 2 * sqrt(stiffness), t)
    moved, speed, turned_by, spin = share * moved, share * speed, share * turned_by, share * spin
    turned, error = driver["scratch"][0], driver["scratch"][1]
    rotation_between(driver["goal_start_orientation"], driver["goal_end_orientation"], turned)
    part = driver["clock"] / dt
    x, y, z = part * turned[0], part * turned[1], part * turned[2]
    turn(driver["goal_start_orientation"], x, y, z, driver["orientation"])
    rotation_between(driver["orientation"], driver["old_orientation"], error)
    for i in range(3):
        start, pace = driver["goal_start"][i], (driver["goal_end"][i] - driver["goal_start"][i]) / dt
        goal = start + pace * driver["clock"]
        x, v = driver["old_position"][i] - goal, driver["old_velocity"][i] - pace
        x, v = decay(x, v, stiffness, damping, t)
        driver["position"][i] = goal + pace * t + x
        driver["velocity"][i] = pace + v
    w = driver["omega"]
    w[0], w[1], w[2] = decay_turn(error, driver["old_omega"], times(1 / dt, turned), stiffness, t)
    part = (driver["clock"] + t) / dt
    x, y, z = part * turned[0], part * turned[1], part * turned[2]
    turn(driver["goal_start_orientation"], x, y, z, driver["orientation"])
    turn(driver["orientation"], error[0], error[1], error[2], driver["orientation"])
    p, w = driver["shift_twist"], driver["twist"]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        arm_j, arm_k = (
            driver["old_position"][j] - driver["center"][j],
            driver["old_position"][k] - driver["center"][k],
        )
        driver["position"][i] += moved / (mass * h) * driver["shift_push"][i]
        driver["position"][i] += turned_by / h * (p[j] * arm_k - p[k] * arm_j)
        driver["velocity"][i] += speed / (mass * h) * driver["push"][i]
        driver["velocity"][i] += spin / h * (w[j] * arm_k - w[k] * arm_j)
        driver["omega"][i] += spin / h * w[i]
    if p[0] != 0 or p[1] != 0 or p[2] != 0:
        # rotation vectors since the start add up, as the solver's velocities do: one after the other, a large
        # return and a response that holds it would turn about a third axis
        rotation_between(driver["old_orientation"], driver["orientation"], turned)
        x, y, z = plus(vector_of(turned), turned_by / h, p)
        turn(driver["old_orientation"], x, y, z, driver["orientation"])

"""Integration of the velocities and poses of simulated bodies over a substep."""

from math import sqrt

from touchstone.reference_impl.continuous.driver_motion import (
    begin_driver,
    coast,
    end_driver,
    return_to_start,
    set_link_ways,
)
from touchstone.reference_impl.continuous.free_rotation import (
    free_omega,
    is_isotropic,
    refresh_inertia,
    rotate_freely,
)
from touchstone.reference_impl.continuous.swept_motion import (
    flight_motion,
    flight_way,
    largest_angle,
    pose_along,
    set_path,
)
from touchstone.reference_impl.core.conventions import KEEPS_MOMENTUM, KEEPS_NOTHING, KEEPS_OMEGA, SIMULATED
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import (
    conjugate_by,
    copy_quaternion,
    copy_vector,
    invert_symmetric,
    matrix_of,
    rotate,
)
from touchstone.reference_impl.kinematics.skeleton import move_links
from touchstone.reference_impl.solver.islands import loops


@kernel
def begin_substep(bodies, joints, drivers):
    """Store the pose and velocities of each simulated body, of links in the loop, and of drivers."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED or loops(bodies, drivers, b):
            copy_vector(body["center"], body["old_center"])
            copy_quaternion(body["orientation"], body["old_orientation"])
            copy_vector(body["velocity"], body["old_velocity"])
            copy_vector(body["omega"], body["old_omega"])
        if body["kind"] == SIMULATED and body["driver"] >= 0:
            conjugate_by(body["rotation"], body["inertia"], body["scratch"])
            rotate(body["scratch"], body["omega"], body["momentum"])
    for d in range(len(drivers)):
        begin_driver(joints, drivers[d])


@kernel
def apply_forces(bodies, joints, drivers, lead, h, state, only_led):
    """Compute velocities and world inertias after a time h of gravity and free rotation, and velocities of
    drivers after a time h of their couplings' forces.

    Args:
        lead: of the law that rows with a driver will ask (`driver_motion`).
        only_led: 1: to drivers, and to bodies that are `led`.
    """
    gravity = state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED and body["driver"] < 0 and body["led"] >= only_led:
            for i in range(3):
                body["velocity"][i] += gravity[i] * h
            rotate_freely(body, h)
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1:
            coast(bodies, joints, drivers[d], h, lead, state["dt"])


@kernel
def none_turns(bodies):
    """Whether free flight keeps the orientations of all simulated bodies to the bit: none spins or hangs on a
    joint, and none is changed by the normalisation that follows a turn."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            w, q = bodies[b]["omega"], bodies[b]["orientation"]
            if w[0] != 0 or w[1] != 0 or w[2] != 0 or bodies[b]["driver"] >= 0:
                return False
            size = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
            for i in range(4):
                if q[i] / size != q[i]:
                    return False
    return True


@kernel
def fly_straight(bodies, gravity, h):
    """Integrate simulated bodies over a time h without contacts or rotation: velocities, then poses."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED:
            continue
        copy_vector(body["velocity"], body["old_velocity"])
        for i in range(3):
            body["velocity"][i] += gravity[i] * h
        flight_way(body, h)
        rotate(body["rotation"], body["center_of_mass"], body["position"])
        for i in range(3):
            body["center"][i] += body["travel"][i] + body["travel_bend"][i]
            body["position"][i] = body["center"][i] - body["position"][i]


@kernel
def begin_again(bodies, joints, drivers, only_led):
    """Undo the effects of forces, contact impulses and motion since `begin_substep`; with `only_led` 1 on
    drivers, and on bodies that are `led`."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED and body["driver"] < 0 and body["led"] >= only_led:
            copy_vector(body["old_velocity"], body["velocity"])
            copy_vector(body["old_omega"], body["omega"])
            copy_quaternion(body["old_orientation"], body["orientation"])
            matrix_of(body["orientation"], body["rotation"])
            refresh_inertia(body)
            rotate(body["rotation"], body["center_of_mass"], body["position"])
            for i in range(3):
                body["center"][i] = body["old_center"][i]
                body["position"][i] = body["center"][i] - body["position"][i]
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1:
            return_to_start(bodies, joints, drivers[d])
            continue
        copy_vector(drivers[d]["old_velocity"], drivers[d]["velocity"])
        copy_vector(drivers[d]["old_omega"], drivers[d]["omega"])
        move_links(bodies, joints, drivers[d])


@inlined_kernel
def set_ways(bodies, joints, drivers, pairs, held, h, dt):
    """Compute the motion of simulated bodies over a substep of length h from their old and new velocities,
    and that of drivers from their coupling and the impulses on them.

    Bodies on which a contact of `pairs[:held]` exerts an impulse do not rotate freely.
    """
    for k in range(held):
        p = pairs[k]["resting_impulse"]
        if p[0] != 0 or p[1] != 0 or p[2] != 0:
            a, b = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]]
            a["spin_steps"] = b["spin_steps"] = 0
            a["spin_keeps"] = b["spin_keeps"] = KEEPS_NOTHING
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED and bodies[b]["driver"] < 0:
            flight_motion(bodies[b], h)
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1:
            set_link_ways(bodies, joints, drivers[d], 1.0, h, dt)


@kernel
def set_paths(bodies):
    """Bound the path length of each moving body; returns whether a path exceeds its body's width. That of a
    driver's link counts if a simulated body may be in its way."""
    fast = False
    for b in range(len(bodies)):
        body = bodies[b]
        body["path"] = 0.0
        if body["moves"] == 1:
            set_path(body, largest_angle(body))
            fast = fast or (body["kind"] == SIMULATED and body["path"] > body["width"])
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED and body["moves"] == 1 and body["path"] > body["width"]:
            fast = fast or _may_meet(bodies, body)
    return fast


@kernel
def _may_meet(bodies, link):
    """Whether a simulated body may be in the way of a link: their paths' balls overlap."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            apart, span = 0.0, link["path"] + body["path"]
            span += link["reach"] + body["reach"] + link["width"] + body["width"]
            for i in range(3):
                apart += (link["old_center"][i] - body["old_center"][i]) ** 2
            if apart <= span * span:
                return True
    return False


@kernel
def pose_at(bodies, s):
    """Set the poses of moving bodies at fraction s of the substep."""
    for b in range(len(bodies)):
        pose_along(bodies[b], s)


@kernel
def end_substep(bodies, joints, drivers, s, h, dt):
    """End a substep at fraction s: keep the poses, and update velocities and world inertias to that fraction.

    Contact impulses change the drivers' velocities by that fraction too.
    """
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED or body["driver"] >= 0:
            continue
        body["led"] = 0
        _blend(body["old_velocity"], s, body["velocity"])
        if body["spin_keeps"] == KEEPS_MOMENTUM:
            free_omega(body, body["omega"])
        elif body["spin_keeps"] == KEEPS_OMEGA:
            refresh_inertia(body)
        else:
            _turn_on(body, s)
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1:
            end_driver(bodies, joints, drivers[d], s, h, dt)
        elif s < 1 and drivers[d]["inverse_mass"] > 0:
            # in this form a velocity that no impulse changed stays the same to the bit
            for i in range(3):
                v, w = drivers[d]["old_velocity"][i], drivers[d]["old_omega"][i]
                drivers[d]["velocity"][i] = v + s * (drivers[d]["velocity"][i] - v)
                drivers[d]["omega"][i] = w + s * (drivers[d]["omega"][i] - w)
            move_links(bodies, joints, drivers[d])


@kernel
def _turn_on(body, s):
    """Compute omega and world inertia of a body with contact torques at fraction s of its substep.

    Its angular momentum changes linearly; for anisotropic inertia, omega follows from the momentum.
    """
    inertia, momentum, end = body["inertia"], body["momentum"], body["turn"]
    if is_isotropic(inertia):
        _blend(body["old_omega"], s, body["omega"])
        refresh_inertia(body)
        return
    invert_symmetric(body["inverse_inertia"], body["scratch"])
    rotate(body["scratch"], body["omega"], end)
    for i in range(3):
        end[i] = (1 - s) * momentum[i] + s * end[i]
    refresh_inertia(body)
    rotate(body["inverse_inertia"], end, body["omega"])


@kernel
def _blend(old, s, out_new):
    """Interpolate a velocity at fraction s of a substep, in place of its final value."""
    for i in range(3):
        out_new[i] = (1 - s) * old[i] + s * out_new[i]

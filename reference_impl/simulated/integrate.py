"""Velocities and poses of simulated bodies over a substep."""

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
from touchstone.reference_impl.core.conventions import SIMULATED
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import (
    copy_quaternion,
    copy_vector,
    invert_symmetric,
    matrix_of,
    rotate,
)
from touchstone.reference_impl.driven.skeleton import move_links


@kernel
def begin_substep(bodies, drivers):
    """Remember where each simulated body starts and how it and each driver move."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            copy_vector(body["center"], body["old_center"])
            copy_quaternion(body["orientation"], body["old_orientation"])
            copy_vector(body["velocity"], body["old_velocity"])
            copy_vector(body["omega"], body["old_omega"])
    for d in range(len(drivers)):
        copy_vector(drivers[d]["velocity"], drivers[d]["old_velocity"])
        copy_vector(drivers[d]["omega"], drivers[d]["old_omega"])


@kernel
def apply_forces(bodies, gravity, h, flight):
    """Velocities after a time h of gravity and free rotation, and the inertia as it is turned then."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            for i in range(3):
                body["velocity"][i] += gravity[i] * h
            rotate_freely(body, h, flight)


@kernel
def fly_straight(bodies, gravity, h, flight):
    """A time h of simulated bodies that meet nothing and do not turn: velocities, then poses."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED:
            continue
        copy_vector(body["velocity"], body["old_velocity"])
        for i in range(3):
            body["velocity"][i] += gravity[i] * h
        flight_way(body, h, flight)
        rotate(body["rotation"], body["center_of_mass"], body["position"])
        for i in range(3):
            body["center"][i] += body["travel"][i] + body["travel_bend"][i]
            body["position"][i] = body["center"][i] - body["position"][i]


@kernel
def begin_again(bodies, joints, drivers):
    """Take back what forces, held contacts and motion did since `begin_substep`."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
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
        copy_vector(drivers[d]["old_velocity"], drivers[d]["velocity"])
        copy_vector(drivers[d]["old_omega"], drivers[d]["omega"])
        move_links(bodies, joints, drivers[d])


@inlined_kernel
def set_ways(bodies, pairs, held, h, flight):
    """How simulated bodies move over a substep of length h, from their old velocities to their new ones.

    What the contacts `pairs[:held]` push on does not rotate freely.
    """
    for k in range(held):
        p = pairs[k]["resting_impulse"]
        if p[0] != 0 or p[1] != 0 or p[2] != 0:
            bodies[pairs[k]["body_a"]]["spin_steps"] = bodies[pairs[k]["body_b"]]["spin_steps"] = 0
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            flight_motion(bodies[b], h, flight)


@kernel
def set_paths(bodies):
    """Bounds on how far simulated bodies go on their ways; returns whether one is fast: it goes farther than
    it is thick."""
    fast = False
    for b in range(len(bodies)):
        body = bodies[b]
        body["path"] = 0.0
        if body["kind"] == SIMULATED:
            set_path(body, largest_angle(body))
            fast = fast or body["path"] > body["width"]
    return fast


@kernel
def pose_at(bodies, s):
    """Pose simulated bodies at fraction s of their ways."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            pose_along(bodies[b], s)


@kernel
def end_substep(bodies, joints, drivers, s):
    """Keep the poses at fraction s with the velocities there, and refresh the world inertias.

    Held contacts pushed the drivers for that fraction too.
    """
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED:
            continue
        _blend(body["old_velocity"], s, body["velocity"])
        if body["spin_steps"] != 0:
            free_omega(body, body["omega"])
        else:
            _turn_on(body, s)
    for d in range(len(drivers)):
        if s < 1 and drivers[d]["inverse_mass"] > 0:
            _blend(drivers[d]["old_velocity"], s, drivers[d]["velocity"])
            _blend(drivers[d]["old_omega"], s, drivers[d]["omega"])
            move_links(bodies, joints, drivers[d])


@kernel
def _turn_on(body, s):
    """Omega and world inertia of a body that contacts turned, at fraction s of its substep.

    Its angular momentum grows evenly; where its inertia differs between axes, omega follows from that.
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
    """Velocity at fraction s of a substep, in place of that at its end."""
    for i in range(3):
        out_new[i] = (1 - s) * old[i] + s * out_new[i]

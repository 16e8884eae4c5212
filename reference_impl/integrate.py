"""Motion of simulated bodies between contacts: forces, and poses at any fraction of a substep."""

from reference_impl.conventions import FLIGHT_EULER, SIMULATED
from reference_impl.kernel import kernel
from reference_impl.rotation import (
    conjugate_by,
    copy_quaternion,
    copy_vector,
    invert_symmetric,
    matrix_of,
    rotate,
    turn,
)
from reference_impl.skeleton import move_links


@kernel
def refresh_inertia(body):
    """World inverse inertia of a simulated body from its orientation."""
    conjugate_by(body["rotation"], body["inertia"], body["scratch"])
    invert_symmetric(body["scratch"], body["inverse_inertia"])


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
def apply_forces(bodies, gravity, h):
    """Velocities after a time h of gravity and free spin."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            for i in range(3):
                body["velocity"][i] += gravity[i] * h
            _free_spin(body, h)


@kernel
def _free_spin(body, h):
    """Angular velocity after torque-free rotation: angular momentum is kept, midpoint rule in orientation."""
    inertia, omega = body["inertia"], body["omega"]
    if (
        inertia[0, 0] == inertia[1, 1] == inertia[2, 2]
        and inertia[0, 1] == inertia[0, 2] == inertia[1, 2] == 0
    ):
        return
    momentum, rate = body["momentum"], body["spin"]
    conjugate_by(body["rotation"], inertia, body["scratch"])
    rotate(body["scratch"], omega, momentum)
    copy_vector(omega, rate)
    for step in range(2):
        half = h if step else h / 2
        turn(body["old_orientation"], rate[0] * half, rate[1] * half, rate[2] * half, body["orientation"])
        matrix_of(body["orientation"], body["rotation"])
        refresh_inertia(body)
        rotate(body["inverse_inertia"], momentum, rate)
    copy_vector(rate, omega)


@kernel
def pose_at(bodies, h, s, flight):
    """Pose simulated bodies at fraction s of a substep of length h, under the constant acceleration that
    leads from their old velocities to their new ones (FLIGHT_EULER: with the new velocities)."""
    t = s * h
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] != SIMULATED:
            continue
        old = 0.0 if flight == FLIGHT_EULER else t * (1 - s / 2)
        new = t - old
        v0, v1, w0, w1 = body["old_velocity"], body["velocity"], body["old_omega"], body["omega"]
        for i in range(3):
            body["center"][i] = body["old_center"][i] + old * v0[i] + new * v1[i]
        x, y, z = old * w0[0] + new * w1[0], old * w0[1] + new * w1[1], old * w0[2] + new * w1[2]
        turn(body["old_orientation"], x, y, z, body["orientation"])
        _place_at_center(body)


@kernel
def _place_at_center(body):
    """Rotation matrix and origin from orientation and centre of mass."""
    matrix_of(body["orientation"], body["rotation"])
    rotate(body["rotation"], body["center_of_mass"], body["position"])
    for i in range(3):
        body["position"][i] = body["center"][i] - body["position"][i]


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
        _blend(body["old_omega"], s, body["omega"])
        refresh_inertia(body)
    for d in range(len(drivers)):
        if s < 1:
            _blend(drivers[d]["old_velocity"], s, drivers[d]["velocity"])
            _blend(drivers[d]["old_omega"], s, drivers[d]["omega"])
            move_links(bodies, joints, drivers[d])


@kernel
def _blend(old, s, out_new):
    """Velocity at fraction s of a substep, in place of that at its end."""
    for i in range(3):
        out_new[i] = (1 - s) * old[i] + s * out_new[i]

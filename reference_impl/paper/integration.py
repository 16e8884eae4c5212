"""Motion of simulated objects "according to other laws of physics", and driven objects' inertia.

The paper leaves open the integration: semi-implicit Euler. Gravity acts first, then an object moves at
constant velocity v until the next collision. Rotation keeps the angular momentum L = I omega: by the
midpoint rule, an object turns at the omega that L has in the orientation in the middle of its motion.
"""

from touchstone.reference_impl.core.conventions import SIMULATED
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import (
    conjugate_by,
    copy_quaternion,
    copy_vector,
    invert_symmetric,
    matrix_of,
    turn,
)
from touchstone.reference_impl.paper.vectors import add, scaled, store, sub, times, vector


@kernel
def accelerate(bodies, gravity, h):
    """v += g h, for simulated objects."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            store(add(vector(bodies[b]["velocity"]), scaled(h, vector(gravity))), bodies[b]["velocity"])


@kernel
def begin_motion(bodies, h):
    """Begin a motion of a time h [s]: store the poses of simulated objects, and set their spin in it."""
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            copy_vector(body["center"], body["old_center"])
            copy_quaternion(body["orientation"], body["old_orientation"])
            conjugate_by(body["rotation"], body["inertia"], body["scratch"])
            store(times(body["scratch"], vector(body["omega"])), body["momentum"])
            move(body, h / 2)
            _spin_by_momentum(body)


@kernel
def end_motion(bodies):
    """Spin of simulated objects in the orientations that they have reached."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            _spin_by_momentum(bodies[b])


@kernel
def _spin_by_momentum(body):
    """omega = I^-1 L in the present orientation."""
    refresh_inverse_inertia(body)
    store(times(body["inverse_inertia"], vector(body["momentum"])), body["omega"])


@kernel
def move_all(bodies, t):
    """Pose simulated objects a time t [s] after `begin_motion`."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            move(bodies[b], t)


@kernel
def move(body, t):
    """Pose one object a time t [s] after `begin_motion`, if it is simulated."""
    if body["kind"] != SIMULATED:
        return
    w = scaled(t, vector(body["omega"]))
    turn(body["old_orientation"], w[0], w[1], w[2], body["orientation"])
    matrix_of(body["orientation"], body["rotation"])
    center = add(vector(body["old_center"]), scaled(t, vector(body["velocity"])))
    store(center, body["center"])
    store(sub(center, times(body["rotation"], vector(body["center_of_mass"]))), body["position"])


@kernel
def refresh_inverse_inertia(body):
    """I^-1 in world axes, for the present orientation."""
    conjugate_by(body["rotation"], body["inertia"], body["scratch"])
    invert_symmetric(body["scratch"], body["inverse_inertia"])

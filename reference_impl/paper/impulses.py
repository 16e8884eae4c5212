"""Collision response by impulses, one collision at a time from a priority queue (section "Impulses").

The paper leaves open what an impulse on a link of a driven object moves: the whole object, by the mass m of
Eq. 6, which has no rotation. The change goes to the coupling velocity, so that the object has "just enough
freedom to prevent infinite loops"; its pose follows in the next frame.
"""

from touchstone.reference_impl.core.counters import COUNT_IMPULSES, COUNT_LOST
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.kinematics.skeleton import link_of
from touchstone.reference_impl.paper.friction import friction_impulse
from touchstone.reference_impl.paper.vectors import add, cross, dot, scaled, store, sub, times, vector

APPROACH_LEAST = 1e-5
"""Approach speed up to which a contact is no collision [m/s]: objects sink by 2e-7 m in a frame at it."""
IMPULSES_AT_ONCE = 200
"""Most impulses at one time; what still approaches then is counted as given up."""


@kernel
def resolve_collisions(world, end, time, bounce):
    """Apply impulses until no pair of `pairs[:end]`, which touch, approaches.

    "Collisions are treated by application of impulses sequentially in a priority queue." The paper leaves
    open their order: the fastest approach first, its speed computed after every impulse; equal ones in the
    order of the pairs.

    Args:
        time: since the start of the frame [s].
        bounce: 1.0 for the coefficients of restitution of the pairs, 0.0 for none.
    Returns:
        Whether fewer than IMPULSES_AT_ONCE sufficed.
    """
    bodies, pairs = world.bodies, world.pairs
    for _ in range(IMPULSES_AT_ONCE):
        first, fastest = -1, APPROACH_LEAST
        for k in range(end):
            speed = -normal_velocity(bodies, pairs[k])
            if speed > fastest:
                first, fastest = k, speed
        if first < 0:
            return True
        collide(world, pairs[first], time, bounce * pairs[first]["restitution"])
    return False


@kernel
def contact_point(pair):
    """The paper leaves open the point of a contact: the middle of both pieces' deepest points."""
    return scaled(0.5, add(vector(pair["point_a"]), vector(pair["point_b"])))


@kernel
def velocity_at(body, point):
    """Velocity of a body's surface at a world point: v + omega x r."""
    r = sub(point, vector(body["center"]))
    return add(vector(body["velocity"]), cross(vector(body["omega"]), r))


@kernel
def relative_velocity(bodies, pair):
    """v_ab: velocity of B relative to A at the contact, before or after a collision."""
    point = contact_point(pair)
    return sub(velocity_at(bodies[pair["body_b"]], point), velocity_at(bodies[pair["body_a"]], point))


@kernel
def normal_velocity(bodies, pair):
    """Eq. 7: v_n = n . v_ab; negative where the objects collide."""
    return dot(vector(pair["normal"]), relative_velocity(bodies, pair))


@kernel
def impulse_magnitude(v_n, e, inverse_masses, a, b):
    """Eqs. 8 and 9: v_n+ = -e v_n- asks for j = -(1 + e) v_n- / (1/m_a + 1/m_b + A + B).

    Args:
        v_n: relative normal velocity before the collision [m/s].
        e: coefficient of restitution.
        inverse_masses: 1/m_a + 1/m_b [1/kg].
        a, b: A and B of `rotational_term` [1/kg].
    """
    return -(1 + e) * v_n / (inverse_masses + a + b)


@kernel
def rotational_term(n, inverse_inertia, r):
    """A of Eq. 9: n . ((I^-1 (r x n)) x r) [1/kg]; B has the same form."""
    return dot(n, cross(times(inverse_inertia, cross(r, n)), r))


@kernel
def mobility(body, drivers, n, point):
    """1/m and the rotational term of Eq. 9 of one body [1/kg]: 0 if it is fixed; no rotation if driven."""
    if body["driver"] >= 0:
        return 1 / drivers[body["driver"]]["mass"], 0.0
    if body["inverse_mass"] == 0:
        return 0.0, 0.0
    r = sub(point, vector(body["center"]))
    return body["inverse_mass"], rotational_term(n, body["inverse_inertia"], r)


@kernel
def collide(world, pair, time, e):
    """Apply the impulse of one collision with restitution e and its friction, and log it."""
    bodies, state = world.bodies, world.state
    body_a, body_b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    n, point, v_ab = vector(pair["normal"]), contact_point(pair), relative_velocity(bodies, pair)
    v_n = dot(n, v_ab)
    mass_a, a = mobility(body_a, world.drivers, n, point)
    mass_b, b = mobility(body_b, world.drivers, n, point)
    j = impulse_magnitude(v_n, e, mass_a + mass_b, a, b)
    p = add(scaled(j, n), friction_impulse(v_ab, n, j, pair["friction"]))
    row = log_collision(world, pair, point, p, time)
    apply_impulse(world, pair["body_b"], point, p)
    apply_impulse(world, pair["body_a"], point, scaled(-1.0, p))
    if row >= 0:
        store(velocity_at(body_a, point), world.contacts[row]["velocity_a_after"])
        store(velocity_at(body_b, point), world.contacts[row]["velocity_b_after"])
    state["counters"][COUNT_IMPULSES] += 1


@kernel
def apply_impulse(world, b, point, p):
    """v += p / m, omega += I^-1 (r x p), for body b or for the whole driven object that it is a link of."""
    bodies, body = world.bodies, world.bodies[b]
    if body["driver"] < 0:
        if body["inverse_mass"] > 0:
            turned = times(body["inverse_inertia"], cross(sub(point, vector(body["center"])), p))
            store(add(vector(body["velocity"]), scaled(body["inverse_mass"], p)), body["velocity"])
            store(add(vector(body["omega"]), turned), body["omega"])
        return
    driver = world.drivers[body["driver"]]
    dv = scaled(1 / driver["mass"], p)
    store(add(vector(driver["velocity"]), dv), driver["velocity"])
    for k in range(driver["joint_count"] + 1):
        link = bodies[link_of(world.joints, driver, k)]
        store(add(vector(link["velocity"]), dv), link["velocity"])


@kernel
def log_collision(world, pair, point, p, time):
    """Add a row with a collision's impulse and the velocities before it; returns its index, or -1 (counted)
    if the log is full."""
    state, row = world.state, world.state["contact_count"]
    if row == len(world.contacts):
        state["counters"][COUNT_LOST] += 1
        return -1
    contact = world.contacts[row]
    contact["time"], contact["distance"] = time, pair["distance"]
    contact["body_a"], contact["body_b"] = pair["body_a"], pair["body_b"]
    store(point, contact["position"])
    store(vector(pair["normal"]), contact["normal"])
    store(p, contact["impulse"])
    store(velocity_at(world.bodies[pair["body_a"]], point), contact["velocity_a_before"])
    store(velocity_at(world.bodies[pair["body_b"]], point), contact["velocity_b_before"])
    state["contact_count"] = row + 1
    return row

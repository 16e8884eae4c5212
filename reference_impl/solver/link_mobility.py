"""Effective mass of a chain's link in contact with a simulated body (ours).

The paper gives an avatar's link the inverse mass 0 in Eq. 9. Such a link transfers any impulse: it crushes a
box against a wall. Here a link has the mass that its chain and its servo give it. An impulse along n at the
contact point turns hinge k of the chain by g_k / I, with g_k the velocity of the point along n per rate of
the hinge, and I the inertia of the whole chain about its first hinge. With one I for all hinges a contact
bends a limb as the posture QP does, and a hand is not held by the small inertia of its wrist alone. The servo
of frequency w, integrated implicitly over a frame h, adds its damping and stiffness to the inertia, which
multiplies I by (1 + w h)^2. The whole driver of mass m gives way in series:

    1 / m_link = 1 / m + sum_k g_k^2 / (I (1 + w h)^2)

Links outside chains have the driver's mass.
"""

from touchstone.reference_impl.core.conventions import LINK_GYRATION
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector, rotate
from touchstone.reference_impl.kinematics.skeleton import link_of


@kernel
def weigh_links(bodies, joints, drivers, pairs, count, h):
    """Give each link of a driver with chains in `pairs[:count]` its effective mass, once per frame of h [s].

    A link that was in contact in the last frame does not bounce. The servo of a link that lost its contact
    within the frame rests until the next one.
    """
    for k in range(count):
        for side in range(2):
            body = bodies[pairs[k]["body_a"] if side == 0 else pairs[k]["body_b"]]
            if body["driver"] < 0 or drivers[body["driver"]]["chain_count"] == 0:
                continue
            driver = drivers[body["driver"]]
            if body["was_in_contact"] == 1:
                pairs[k]["restitution"] = 0.0
            if body["link_inverse_mass"] == 0:
                _weigh_link(bodies, joints, driver, body, pairs[k], side, h)
            body["touches"] = 1
    for d in range(len(drivers)):
        if drivers[d]["in_contact"] == 1:
            _rest_servos(bodies, joints, drivers[d])


@kernel
def _rest_servos(bodies, joints, driver):
    """Stop the servo forces of a driver's links outside the contacts that marked them with `touches`."""
    for k in range(driver["joint_count"] + 1):
        body = bodies[link_of(joints, driver, k)]
        if body["touches"] == 0:
            body["drive_acceleration"][:] = 0.0
            body["drive_turning"][:] = 0.0
        body["touches"] = 0


@kernel
def _weigh_link(bodies, joints, driver, body, pair, side, h):
    """Set the effective mass of a link at a pair's point, and an inertia that lets it turn little. A link
    that does not push wants its velocity."""
    driver["in_contact"] = 1
    if body["pushes"] == 0:
        body["drive_acceleration"][:] = body["drive_turning"][:] = 0.0
        copy_vector(body["velocity"], body["wanted_velocity"])
        copy_vector(body["omega"], body["wanted_omega"])
    n, p, c = pair["normal"], pair["point_a"] if side == 0 else pair["point_b"], body["center"]
    total = 1 / driver["mass"]
    if body["chain"] >= 0:
        implicit = chain_inertia(bodies, joints, driver, body["chain"])
        implicit *= (1 + driver["hinge_frequency"] * h) ** 2
        body["chain_inertia"] = implicit
        for k in range(driver["chains"][body["chain"], 0], body["hinge"] + 1):
            g = moved_along(n, p, joints[k]["world_axis"], bodies[joints[k]["child"]]["position"])
            total += g * g / implicit
    # the mobility along n at the point, not at the centre, is `total`
    x, y, z = p[0] - c[0], p[1] - c[1], p[2] - c[2]
    lever = (y * n[2] - z * n[1]) ** 2 + (z * n[0] - x * n[2]) ** 2 + (x * n[1] - y * n[0]) ** 2
    square = LINK_GYRATION * LINK_GYRATION
    body["link_inverse_mass"] = total / (1 + lever / square)
    body["inverse_inertia"][:] = 0.0
    for i in range(3):
        body["inverse_inertia"][i, i] = body["link_inverse_mass"] / square


@kernel
def moved_along(n, point, axis, origin):
    """Velocity of a point along n per rate of a hinge at `origin` [m]."""
    x, y, z = point[0] - origin[0], point[1] - origin[1], point[2] - origin[2]
    along = n[0] * (axis[1] * z - axis[2] * y) + n[1] * (axis[2] * x - axis[0] * z)
    return along + n[2] * (axis[0] * y - axis[1] * x)


@kernel
def chain_inertia(bodies, joints, driver, chain):
    """Half the trace of a chain's inertia about its first hinge [kg m^2]; stores its hinges' world axes."""
    first, last = driver["chains"][chain, 0], driver["chains"][chain, 1]
    o = bodies[joints[first]["child"]]["position"]
    total = 0.0
    for k in range(first, last + 1):
        joint = joints[k]
        rotate(bodies[joint["parent"]]["rotation"], joint["axis"], joint["world_axis"])
        link = bodies[joint["child"]]
        c, inertia = link["center"], link["inertia"]
        total += link["mass"] * ((c[0] - o[0]) ** 2 + (c[1] - o[1]) ** 2 + (c[2] - o[2]) ** 2)
        total += (inertia[0, 0] + inertia[1, 1] + inertia[2, 2]) / 2
    return total

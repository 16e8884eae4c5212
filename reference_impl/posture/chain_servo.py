"""Servo of chains in contact with simulated bodies: how limbs push and give way (ours).

Overlap removal stops a chain at a simulated body as at a wall. The motion that it withholds becomes a
velocity: in contacts with simulated bodies a link moves as it would if only fixed and driven bodies stopped
it. The chain stays behind its tracker by the withheld turns x, a hinge's `offset`. They obey the servo
x'' = -w^2 x - 2 w x' + tau / I with tau the torque of contact, integrated implicitly; I is that of
`link_mobility`, and w the frequency of the servo in the dynamics engines. Without contact x is 0: the chain
follows its tracker exactly.

The velocity of a pushing link changes evenly over the frame, from that of the last frame to the one that the
servo wants. So its servo acts as a force on a body at rest in its hands. Only the first touch bounces.
"""

from math import sqrt

from touchstone.reference_impl.core.conventions import LINK_GYRATION, OVERLAP_TOLERANCE, PUSH_PAIRS, SIMULATED
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.kinematics.skeleton import link_of
from touchstone.reference_impl.posture.posture_qp import solve_posture_qp
from touchstone.reference_impl.solver.link_mobility import moved_along

OFFSET_SETTLED = 1e-9
"""Deviation of a hinge from its tracker, and its change in a frame, that count as none [rad]: 1e-9 m."""


@kernel
def follow_offset(joint, frequency, h):
    """Advance a hinge's offset by one frame of its servo, implicitly; returns whether there is an offset."""
    x, rate = joint["offset"], joint["offset_rate"]
    if x == 0 and rate == 0:
        return False
    rate = (rate - h * frequency * frequency * x) / (1 + frequency * h) ** 2
    x += h * rate
    if abs(x) < OFFSET_SETTLED and abs(h * rate) < OFFSET_SETTLED:
        x = rate = 0.0
    joint["offset"], joint["offset_rate"] = x, rate
    return True


@kernel
def note_pushing_links(bodies, pairs, end, driver, d):
    """Mark the links of driver d that touch a simulated body in `pairs[:end]`, before overlap removal or at
    the final pose: removal may leave a gap just over TOUCH_DISTANCE. List their pairs of pieces, once."""
    for k in range(end):
        a, b = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]]
        link = a if a["driver"] == d else b
        if link["driver"] != d or (b if a["driver"] == d else a)["kind"] != SIMULATED:
            continue
        link["pushes"] = driver["pushes"] = 1
        count, known = driver["push_count"], driver["push_count"] == PUSH_PAIRS
        for r in range(count):
            one, two = driver["push_pairs"][r, 0], driver["push_pairs"][r, 1]
            known = known or (one == pairs[k]["piece_a"] and two == pairs[k]["piece_b"])
        if not known:
            driver["push_pairs"][count, 0] = pairs[k]["piece_a"]
            driver["push_pairs"][count, 1] = pairs[k]["piece_b"]
            driver["push_count"] = count + 1


@kernel
def set_pushing_velocities(bodies, joints, driver, state):
    """Set the velocities of pushing links and their servos' accelerations over the frame."""
    h = state["dt"]
    _withhold_turns(bodies, joints, driver, state)
    _find_blocked(driver, h)
    for k in range(driver["joint_count"] + 1):
        body = bodies[link_of(joints, driver, k)]
        if body["pushes"] == 0:
            continue
        v, w = body["velocity"], body["omega"]
        if driver["is_blocked"] == 1:
            for i in range(3):
                v[i] += driver["withheld_velocity"][i]
        if body["chain"] >= 0:
            for j in range(driver["chains"][body["chain"], 0], body["hinge"] + 1):
                _add_turn(body, bodies[joints[j]["child"]]["position"], joints[j], joints[j]["pass_turn"] / h)
        for i in range(3):
            body["wanted_velocity"][i], body["wanted_omega"][i] = v[i], w[i]
            body["drive_acceleration"][i] = (v[i] - body["old_velocity"][i]) / h
            body["drive_turning"][i] = (w[i] - body["old_omega"][i]) / h
        copy_vector(body["old_velocity"], v)
        copy_vector(body["old_omega"], w)


@kernel
def _find_blocked(driver, h):
    """Find whether overlap removal translated the trunk. Its withheld velocity is then the coupling velocity,
    but no faster than its tracker, less the motion that was left. The coupling velocity loses what it has
    along the translation beyond that motion, and gains nothing."""
    v, way, withheld = driver["velocity"], driver["shown_position"], driver["withheld_velocity"]
    speed = pace = square = into = left = 0.0
    for i in range(3):
        shift = driver["coupled_position"][i] - driver["position"][i]
        square += shift * shift
        into += shift * v[i]
        left += shift * (driver["position"][i] - way[i]) / h
        speed += v[i] * v[i]
        pace += ((driver["target_position"][i] - driver["old_target_position"][i]) / h) ** 2
    if square <= OVERLAP_TOLERANCE**2:
        return
    driver["is_blocked"] = 1
    share = sqrt(pace / speed) if speed > pace else 1.0
    lost = max(into - max(left, 0.0), 0.0) / square
    for i in range(3):
        withheld[i] = share * v[i] - (driver["position"][i] - way[i]) / h
        v[i] -= lost * (driver["coupled_position"][i] - driver["position"][i])


@kernel
def _withhold_turns(bodies, joints, driver, state):
    """Compute the turns `pass_turn` that simulated bodies withheld from pushing chains in this frame, and
    subtract them from the hinges' offsets."""
    first, end = driver["first_joint"], driver["first_joint"] + driver["joint_count"]
    for k in range(first, end):
        joints[k]["pass_turn"], joints[k]["pushes"] = 0.0, 0
    for k in range(first, end):
        chain = joints[k]["chain"]
        if bodies[joints[k]["child"]]["pushes"] == 1 and chain >= 0:
            for j in range(driver["chains"][chain, 0], driver["chains"][chain, 1] + 1):
                joints[j]["pass_turn"], joints[j]["pushes"] = joints[j]["goal_angle"] - joints[j]["angle"], 1
    solve_posture_qp(bodies, joints, driver, False, False, state)
    for k in range(first, end):
        joint = joints[k]
        if joint["pushes"] == 0:
            joint["pass_turn"] = 0.0
            continue
        so_far = joint["angle"] - joint["shown_angle"]
        least, most = min(-driver["stride"] - so_far, 0.0), max(driver["stride"] - so_far, 0.0)
        least, most = max(least, joint["lower"] - joint["angle"]), min(most, joint["upper"] - joint["angle"])
        joint["pass_turn"] = min(max(joint["pass_turn"], least), most)
        joint["offset"] -= joint["pass_turn"]


@kernel
def _add_turn(body, origin, joint, rate):
    """Add the velocity of a link that a hinge at `origin` turns at `rate` [rad/s] about its world axis."""
    a, c, v, w = joint["world_axis"], body["center"], body["velocity"], body["omega"]
    x, y, z = c[0] - origin[0], c[1] - origin[1], c[2] - origin[2]
    v[0] += rate * (a[1] * z - a[2] * y)
    v[1] += rate * (a[2] * x - a[0] * z)
    v[2] += rate * (a[0] * y - a[1] * x)
    for i in range(3):
        w[i] += rate * a[i]


@kernel
def recoil(bodies, joints, driver):
    """Pass the impulses that links of a driver with chains received in a frame to its hinges and its coupling
    velocity: mass times the difference between a link's velocity and that which its servo would give it.
    A blocked trunk has its velocity from its pose."""
    for k in range(driver["joint_count"] + 1):
        body = bodies[link_of(joints, driver, k)]
        if body["link_inverse_mass"] == 0:
            continue
        mass = 1 / body["link_inverse_mass"]
        p, torque, c = driver["link_impulse"], driver["link_torque"], body["center"]
        for i in range(3):
            p[i] = mass * (body["velocity"][i] - body["wanted_velocity"][i])
            torque[i] = mass * LINK_GYRATION * LINK_GYRATION * (body["omega"][i] - body["wanted_omega"][i])
            if driver["is_blocked"] == 0:
                driver["velocity"][i] += p[i] / driver["mass"]
        if body["chain"] < 0:
            continue
        for j in range(driver["chains"][body["chain"], 0], body["hinge"] + 1):
            a, o = joints[j]["world_axis"], bodies[joints[j]["child"]]["position"]
            push = moved_along(p, c, a, o) + a[0] * torque[0] + a[1] * torque[1] + a[2] * torque[2]
            joints[j]["offset_rate"] += push / body["chain_inertia"]


@kernel
def advance_links(bodies, h):
    """Add the way that links in contact have covered in the last h [s], by their mean velocity."""
    for b in range(len(bodies)):
        if bodies[b]["link_inverse_mass"] > 0:
            for i in range(3):
                bodies[b]["advance"][i] += h * (bodies[b]["old_velocity"][i] + bodies[b]["velocity"][i]) / 2

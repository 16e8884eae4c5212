"""Energy guard of a substep: resting contacts add no energy to an island.

Contacts do no positive work for the velocities that the solver uses (`contact_solver`). Energy can still
rise over a substep: contact points and normals rotate with their bodies, the substep may end at an event
before a separating contact has returned, and separation lifts overlapping bodies (`separation`). The guard
measures this rise body by body and removes it from the island's motion. An island that touches a fixed body
can lose all of its motion. A free island keeps its momenta: it loses only motion relative to one rigid body
(`island_motion`). From the rise of an island on a moving surface the guard subtracts the surface's work. An
island on prescribed bodies of one velocity and a constant acceleration is judged in their frame. The guard
does not change islands that touch another driver.

Of an island with curved contacts of round bodies it knows more: normal forces do no work there, and the rest
is the work of friction along the mean sliding. It changes the motion until the energy changes by that, up
or down.
"""

from math import sqrt

from touchstone.reference_impl.contact.island_motion import is_free, keep_spin, rigid_energy, rigid_velocity
from touchstone.reference_impl.contact.separation import kinetic_energy
from touchstone.reference_impl.continuous.contact_kinematics import is_moving, is_round
from touchstone.reference_impl.continuous.mechanism_motion import has_motor, spring_energy, take_velocities
from touchstone.reference_impl.core.conventions import (
    ENERGY_ROUNDING,
    GAP_LEFT,
    GUARD_SLOWED,
    GUARD_SUMMED,
    GUARD_UNVISITED,
    JOINT_FREE,
    SIMULATED,
)
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import dot
from touchstone.reference_impl.solver.islands import (
    is_head,
    is_joined,
    island_of,
    join_islands,
    leads,
    mover_of,
)

MOST_RETURN = 0.01
"""Most relative increase of the velocities of an island that lost energy to the error of a substep [1]."""
SAME_VELOCITY = 1e-9
"""Difference of the velocities of the bodies that carry an island that is rounding of their paths [m/s]."""
UNPAID_ROUNDING = 1e-12
"""Energy rise of an island that the guard cannot remove, over its energies, that is rounding [1]."""


@inlined_kernel
def note_energy(bodies, joints, drivers, state):
    """Store the energy of each simulated body before a substep. The springs of a mechanism belong to its
    first body."""
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED:
            bodies[b]["guard"]["before"] = kinetic_energy(bodies[b]) + _height_energy(bodies[b], state)
    for d in range(state["driven_count"], len(drivers)):
        bodies[drivers[d]["root"]]["guard"]["before"] += spring_energy(joints, drivers[d])


@kernel
def _height_energy(body, state):
    """Potential energy of a body [J]."""
    g, c = state["gravity"], body["center"]
    return -body["mass"] * (g[0] * c[0] + g[1] * c[1] + g[2] * c[2])


@inlined_kernel
def guard_energy(world, count, parted, first, whole, h):
    """Remove from each island of the rows `pairs[:count]` the energy that it gained since `note_energy`, a
    time h ago [s].

    Args:
        count: number of contact rows and, if separation moved bodies, of the pairs that touch afterwards.
        parted: separation may have lifted bodies; islands then include separating contacts.
        first: first row of `contacts` of this substep.
        whole: the substep took its whole length.
    """
    bodies, joints, drivers = world.bodies, world.joints, world.drivers
    pairs, state = world.pairs, world.state
    if parted:
        join_islands(bodies, drivers, pairs, count, True)
    free = False
    # all bodies: of an attempt before this one, separation may have joined others
    for b in range(len(bodies)):
        bodies[b]["guard"]["state"] = GUARD_UNVISITED
    for k in range(count):
        _reset(bodies, drivers, pairs[k])
    for k in range(count):
        if pairs[k]["island"] >= 0:
            _sum_up(bodies, joints, drivers, pairs[k], state)
    for d in range(state["driven_count"], len(drivers)):
        guard = bodies[drivers[d]["root"]]["guard"]
        guard["alone"] = 0
        if guard["state"] == GUARD_UNVISITED and drivers[d]["limited"] == 1:
            _reset_sums(guard)
            guard["alone"] = 1
            _sum_mechanism(bodies, joints, drivers[d], guard, state)
            free = free or is_free(guard)
    if state["driven_loop"] == 1:
        for k in range(count):
            if is_head(bodies, pairs, k):
                _judge_in_frame(bodies[pairs[k]["island"]]["guard"], h, state)
    if state["moving_surfaces"] == 1:
        for k in range(first, state["contact_count"]):
            _subtract_surface_work(bodies, world.contacts[k])
    if whole and not parted and state["curved"] == 1:
        for k in range(count):
            if pairs[k]["island"] >= 0:
                island = bodies[pairs[k]["island"]]["guard"]
                island["work"] += pairs[k]["work"]
                one, two = world.pieces[pairs[k]["piece_a"]], world.pieces[pairs[k]["piece_b"]]
                if pairs[k]["curved"] == 1 and (is_round(one) or is_round(two)):
                    island["curved"] = 1
    for k in range(count):
        free = free or (pairs[k]["island"] >= 0 and is_free(bodies[pairs[k]["island"]]["guard"]))
    if free:
        keep_spin(bodies)
    for k in range(count):
        if pairs[k]["island"] >= 0:
            island = bodies[pairs[k]["island"]]["guard"]
            excess, rounding = _excess(island), ENERGY_ROUNDING * island["scale"]
            lacks = island["curved"] == 1 and island["limited"] == 0 and excess < -rounding
            if island["driven"] == 0 and (excess > rounding or lacks):
                _slow_down(bodies, joints, drivers, pairs[k], island, state)
    for d in range(state["driven_count"], len(drivers)):
        root = bodies[drivers[d]["root"]]
        if root["guard"]["alone"] == 1 and root["guard"]["driven"] == 0:
            if root["guard"]["rise"] > ENERGY_ROUNDING * root["guard"]["scale"]:
                _slow_all(bodies, joints, drivers, drivers[d]["root"], root["guard"], state)
        if root["guard"]["state"] != GUARD_UNVISITED:
            take_velocities(bodies, joints, drivers[d])


@kernel
def body_count(bodies, drivers, b):
    """Number of bodies of body b's mechanism, or 1."""
    return drivers[bodies[b]["driver"]]["joint_count"] if is_joined(bodies, drivers, b) else 1


@kernel
def body_beside(bodies, joints, drivers, b, k):
    """Body k of body b's mechanism, or b."""
    if not is_joined(bodies, drivers, b):
        return b
    return joints[drivers[bodies[b]["driver"]]["first_joint"] + k]["child"]


@kernel
def _excess(island):
    """Energy that an island gained beyond the work of its contacts; of one without round contacts, beyond
    0 [J]."""
    return island["rise"] - (min(0.0, island["work"]) if island["curved"] == 1 else 0.0)


@kernel
def _reset(bodies, drivers, pair):
    """Reset the sums of a row's movers."""
    for side in range(2):
        m = mover_of(bodies, drivers, pair["body_a"] if side == 0 else pair["body_b"])
        if m >= 0:
            _reset_sums(bodies[m]["guard"])


@kernel
def _reset_sums(guard):
    """Reset the sums of an island."""
    guard["grounded"] = guard["driven"] = guard["counted"] = guard["curved"] = guard["limited"] = 0
    guard["work"] = guard["rise"] = guard["motion"] = guard["scale"] = guard["mass"] = 0.0
    for i in range(3):
        guard["momentum"][i] = guard["old_momentum"][i] = guard["moment"][i] = guard["turning"][i] = 0.0
        guard["carrier"][i] = guard["old_carrier"][i] = guard["carrier_way"][i] = 0.0


@inlined_kernel
def _sum_up(bodies, joints, drivers, pair, state):
    """Add each body of a row, or of its mechanism, to the sums of its island, once per body."""
    island = bodies[pair["island"]]["guard"]
    for side in range(2):
        b = pair["body_a"] if side == 0 else pair["body_b"]
        if is_joined(bodies, drivers, b):
            _sum_mechanism(bodies, joints, drivers[bodies[b]["driver"]], island, state)
        elif mover_of(bodies, drivers, b) < 0 or bodies[b]["driver"] >= 0:
            _ground(island, bodies[b], leads(bodies, drivers, b))
        else:
            _add_body(island, bodies[b], state)


@kernel
def _sum_mechanism(bodies, joints, driver, island, state):
    """Add the bodies and springs of a mechanism to the sums of an island, unless they are in them."""
    if bodies[driver["root"]]["guard"]["state"] == GUARD_UNVISITED:
        island["rise"] += spring_energy(joints, driver)
        if has_motor(joints, driver):
            island["rise"] -= max(0.0, driver["work"])
        island["work"] += min(0.0, driver["work"])
        _hold(island, joints, driver)
        for k in range(driver["joint_count"]):
            _add_body(island, bodies[joints[driver["first_joint"] + k]["child"]], state)


@kernel
def _add_body(island, body, state):
    """Add a body to the sums of its island, unless it is in them."""
    if body["guard"]["state"] == GUARD_UNVISITED:
        body["guard"]["state"] = GUARD_SUMMED
        motion = kinetic_energy(body)
        island["rise"] += motion + _height_energy(body, state) - body["guard"]["before"]
        island["motion"] += motion
        island["scale"] += motion + abs(body["guard"]["before"])
        island["mass"] += body["mass"]
        for i in range(3):
            island["momentum"][i] += body["mass"] * body["velocity"][i]
            island["old_momentum"][i] += body["mass"] * body["old_velocity"][i]
            island["moment"][i] += body["mass"] * (body["center"][i] - body["old_center"][i])


@kernel
def _hold(island, joints, driver):
    """Note whether joints hold a mechanism at the world, and whether limits may take energy from it."""
    if driver["limited"] == 1:
        island["limited"] = 1
    for k in range(
        driver["first_joint"], driver["first_joint"] + driver["joint_count"] + driver["loop_count"]
    ):
        if joints[k]["parent"] < 0 and joints[k]["type"] != JOINT_FREE:
            for i in range(3):
                if island["grounded"] == 1 and abs(island["carrier"][i]) > SAME_VELOCITY:
                    island["driven"] = 1
            island["grounded"] = 1


@kernel
def _ground(island, body, leads):
    """Note that an island touches a body that it does not move, or a driver's link; it is `driven` if that
    `leads`, or moves otherwise than the one before."""
    for i in range(3):
        v = u = way = 0.0
        if is_moving(body):
            v, u, way = (
                body["velocity"][i],
                body["old_velocity"][i],
                body["center"][i] - body["old_center"][i],
            )
        if leads or (island["grounded"] == 1 and abs(v - island["carrier"][i]) > SAME_VELOCITY):
            island["driven"] = 1
        island["carrier"][i], island["old_carrier"][i], island["carrier_way"][i] = v, u, way
    island["grounded"] = 1


@kernel
def _judge_in_frame(island, h, state):
    """Turn an island's rise into that in the frame of its carrier, which moves from the velocity u to v in a
    time h: with the momentum p and moment m x of its bodies, and the gravity g - (v - u) / h."""
    v, u, g, m = island["carrier"], island["old_carrier"], state["gravity"], island["mass"]
    for i in range(3):
        pull, x = (v[i] - u[i]) / h, island["moment"][i]
        island["rise"] += u[i] * island["old_momentum"][i] - v[i] * island["momentum"][i]
        island["rise"] += m * (v[i] - u[i]) * (v[i] + u[i]) / 2
        island["rise"] += pull * x + (g[i] - pull) * m * island["carrier_way"][i]


@kernel
def _subtract_surface_work(bodies, row):
    """Subtract the work of the moving surface of a body that is not simulated, relative to that body, from
    its island's rise."""
    if bodies[row["body_a"]]["kind"] != SIMULATED:
        m, sign, before, after = row["body_b"], 0.5, row["velocity_a_before"], row["velocity_a_after"]
    elif bodies[row["body_b"]]["kind"] != SIMULATED:
        m, sign, before, after = row["body_a"], -0.5, row["velocity_b_before"], row["velocity_b_after"]
    else:
        return
    if bodies[m]["kind"] == SIMULATED:
        island = bodies[island_of(bodies, m)]["guard"]
        for i in range(3):
            surface = before[i] + after[i] - island["old_carrier"][i] - island["carrier"][i]
            island["rise"] -= sign * row["impulse"][i] * surface


@kernel
def _slow_down(bodies, joints, drivers, pair, island, state):
    """Scale the motion of a row's bodies, once per body, so that the island loses the energy that it gained
    in excess, or gains what it lost.

    The island loses less if its motion holds less energy; the rest counts as `unpaid_energy`.
    """
    for side in range(2):
        _slow_all(bodies, joints, drivers, pair["body_b"] if side else pair["body_a"], island, state)


@kernel
def _slow_all(bodies, joints, drivers, b, island, state):
    """`_slow_down` of body b, or of all bodies of its mechanism."""
    excess, loose = _excess(island), island["motion"] - rigid_energy(island)
    scale = sqrt(max(0.0, 1 - excess / loose)) if loose > 0 else 0.0
    scale = min(scale, 1 + MOST_RETURN)
    for k in range(body_count(bodies, drivers, b)):
        body = bodies[body_beside(bodies, joints, drivers, b, k)]
        if body["kind"] != SIMULATED or body["guard"]["state"] != GUARD_SUMMED:
            continue
        body["guard"]["state"] = GUARD_SLOWED
        v, w = body["velocity"], body["omega"]
        x, y, z = rigid_velocity(island, body["center"])
        p, q, r = island["turning"][0], island["turning"][1], island["turning"][2]
        v[0], v[1], v[2] = x + scale * (v[0] - x), y + scale * (v[1] - y), z + scale * (v[2] - z)
        w[0], w[1], w[2] = p + scale * (w[0] - p), q + scale * (w[1] - q), r + scale * (w[2] - r)
    if island["counted"] == 0 and excess > 0:
        island["counted"] = 1
        state["guarded_energy"] += excess
        rounding = UNPAID_ROUNDING * island["scale"]
        if state["mechanisms"] == 1:
            # the law of positions lifts what has sunk by the error of a gap, in a substep of any length
            g = state["gravity"]
            rounding += GAP_LEFT / 10 * island["mass"] * sqrt(dot(g, g))
        if excess - loose > rounding:
            state["unpaid_energy"] += excess - loose

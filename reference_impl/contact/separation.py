"""Separation of simulated bodies that sank into other bodies during resting contact."""

from math import sqrt

from touchstone.reference_impl.broad_phase.detection import (
    detect,
    is_free,
    is_marked,
    mark_pairs,
    place_listed,
)
from touchstone.reference_impl.continuous.driver_motion import weigh_for_impacts
from touchstone.reference_impl.continuous.free_rotation import is_isotropic, refresh_inertia
from touchstone.reference_impl.continuous.hinge_motion import exchange_rates
from touchstone.reference_impl.continuous.mechanism_motion import shift_mechanism, stop_mechanism
from touchstone.reference_impl.core.conventions import (
    DRIVEN,
    NO_FLOOR,
    NO_MOTION,
    OVERLAP_TOLERANCE,
    REMOVAL_ROUNDS,
    SIMULATED,
    SINKING_SHARE,
)
from touchstone.reference_impl.core.counters import CAP_SEPARATION_SWEEPS, COUNT_GAVE_UP, COUNT_ROUNDS
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import matrix_of, turn
from touchstone.reference_impl.geometry.contact_manifold import expand_manifolds
from touchstone.reference_impl.kinematics.skeleton import move_links, place, pose_links
from touchstone.reference_impl.solver.contact_solver import begin_row, solve_contacts
from touchstone.reference_impl.solver.hinge_response import weigh_hinges
from touchstone.reference_impl.solver.islands import is_joined
from touchstone.reference_impl.solver.mobility import place_contact

SEPARATION_DEPTH = 0.75 * OVERLAP_TOLERANCE
"""Depth that separation leaves [m]: a short lift adds little energy."""
UNPAID_DEPTH = 0.99975 * OVERLAP_TOLERANCE
"""Depth that it leaves in a substep repeated because no motion paid for the lift [m]."""
SEPARATION_SWEEPS = 100
"""Sweeps over the pairs of simulated bodies in one round of separation; a heap takes tens."""
PLAIN_SWEEPS = 20
OVER_RELAXATION = 1.8
"""Factor by which separation moves two simulated bodies further than their depth after PLAIN_SWEEPS [1]."""
LEVERAGE = 8.0
"""Most translation of a body over the deepest overlap when separation moves jammed bodies together [1]."""


@kernel
def separate_simulated(world, first):
    """Move simulated bodies out of the overlap into which they sank during resting contact.

    Sweeps translate them. Where they stall, every other round solves for all pairs together, and turns bodies
    too.

    Args:
        first: first row of `pairs` that may be overwritten.
    Returns:
        Index after the last pair, from `first`, that touched in any round or touches afterwards: impulses or
        this motion connect their bodies; `first` if no body moved. Overlap that remains is counted.
    """
    bodies, pieces, vertices = world.bodies, world.pieces, world.vertices
    pairs, state = world.pairs, world.state
    left = UNPAID_DEPTH if state["unpaid_energy"] > 0 else SEPARATION_DEPTH
    converged, together, end = True, False, first
    for rounds in range(REMOVAL_ROUNDS):
        end, deepest = detect(world, SIMULATED, first)
        if is_free(deepest):
            return end if rounds > 0 else first
        state["counters"][COUNT_ROUNDS] += 1
        # sweeps stall where bodies are jammed
        together = (not converged and not together) or _sinks_joined(world, first, end, left)
        if together:
            _move_together(world, first, end, left, LEVERAGE * deepest)
        else:
            _turn_apart(world, first, end, left)
            converged = _push_apart(world, first, end, left, not converged)
            if not converged:
                state["counters"][CAP_SEPARATION_SWEEPS] += 1
        first = _keep(bodies, pieces, pairs, first, end)
    place_listed(bodies, pieces, vertices, SIMULATED, state)
    state["counters"][COUNT_GAVE_UP] += 1
    return first


@kernel
def _sinks_joined(world, first, end, left):
    """Whether a body of a mechanism overlaps by more than `left`: its joints move it, not a translation."""
    bodies, drivers = world.bodies, world.drivers
    for k in range(first, end):
        a, b = world.pairs[k]["body_a"], world.pairs[k]["body_b"]
        if world.pairs[k]["depth"] > left and (
            is_joined(bodies, drivers, a) or is_joined(bodies, drivers, b)
        ):
            return True
    return False


@kernel
def _keep(bodies, pieces, pairs, first, end):
    """Move the pairs of `pairs[first:end]` that are not among those before to their end; returns the index
    after the last."""
    mark_pairs(bodies, pieces, pairs, first)
    for k in range(first, end):
        if not is_marked(bodies, pieces, pairs, pairs[k]):
            if k != first:
                pairs[first] = pairs[k]
            first += 1
    return first


@kernel
def _push_apart(world, first, end, left, evenly):
    """Translate simulated bodies and drivers in the loop by Gauss-Seidel until no depth along the detected
    normals exceeds `left`.

    Against a body that does not move, the other moves the whole depth; two that move divide it by inverse
    mass.

    After PLAIN_SWEEPS, two simulated bodies move further than their depth (successive over-relaxation, Young
    1954): in a heap, plain sweeps converge by 0.1 % each.

    Args:
        evenly: two simulated bodies move half the depth each. By inverse mass, a light body between the
            ground and a heavy one needs a number of sweeps proportional to their mass ratio.
    Returns:
        Whether SEPARATION_SWEEPS sufficed.
    """
    bodies, joints, drivers, pairs = world.bodies, world.joints, world.drivers, world.pairs
    for b in range(len(bodies)):
        bodies[b]["scratch"][0, :] = 0.0
    converged = False
    for sweep in range(SEPARATION_SWEEPS):
        deepest = 0.0
        for k in range(first, end):
            if _is_own(bodies, pairs[k]):
                continue
            a, b, n = bodies[pairs[k]["body_a"]], bodies[pairs[k]["body_b"]], pairs[k]["normal"]
            p, u = _motion_of(bodies, drivers, a)
            q, v = _motion_of(bodies, drivers, b)
            depth = pairs[k]["depth"] - left
            depth -= n[0] * (q[0] - p[0]) + n[1] * (q[1] - p[1]) + n[2] * (q[2] - p[2])
            if depth <= 0:
                continue
            deepest = max(deepest, depth)
            if u + v == 0:
                continue
            share = v / (u + v)
            if 0 < share < 1:
                if evenly:
                    share = 0.5
                if sweep >= PLAIN_SWEEPS:
                    depth *= OVER_RELAXATION
            for i in range(3):
                p[i] -= (1 - share) * depth * n[i]
                q[i] += share * depth * n[i]
        converged = deepest <= (OVERLAP_TOLERANCE - left) / 2
        if converged:
            break
    for b in range(len(bodies)):
        if bodies[b]["kind"] == SIMULATED and bodies[b]["driver"] < 0:
            for i in range(3):
                bodies[b]["position"][i] += bodies[b]["scratch"][0, i]
            place(bodies[b])
    for d in range(len(drivers)):
        if drivers[d]["loops"] == 1 and drivers[d]["mechanism"] == 0:
            for i in range(3):
                drivers[d]["position"][i] += bodies[drivers[d]["root"]]["scratch"][0, i]
            pose_links(bodies, joints, drivers[d])
    return converged


@kernel
def _motion_of(bodies, drivers, body):
    """Translation of a body by separation, and its inverse mass: those of its driver if that moves too; 0
    of a body that joints hold."""
    if body["driver"] >= 0 and drivers[body["driver"]]["mechanism"] == 1:
        return body["scratch"][0], 0.0
    if body["driver"] >= 0 and drivers[body["driver"]]["loops"] == 1:
        driver = drivers[body["driver"]]
        return bodies[driver["root"]]["scratch"][0], driver["inverse_mass"]
    return body["scratch"][0], body["inverse_mass"]


@kernel
def _is_own(bodies, pair):
    """Whether a pair is of two links of one driver."""
    a, b = bodies[pair["body_a"]], bodies[pair["body_b"]]
    return a["driver"] == b["driver"] >= 0 and a["kind"] == DRIVEN


@kernel
def _turn_apart(world, first, end, left):
    """Move the links of drivers by the least motion of their hinges after which no two links of one driver
    overlap by more than `left` along the detected normals. As in `_move_together`, the velocities that the
    solver finds at rest are the motion."""
    bodies, joints, drivers, state = world.bodies, world.joints, world.drivers, world.state
    rows, count, found = world.pairs[first:], end - first, False
    for k in range(count):
        found = found or (_is_own(bodies, rows[k]) and rows[k]["depth"] > left)
    if not found:
        return
    for d in range(state["driven_count"]):
        if drivers[d]["loops"] == 1:
            _exchange_velocities(bodies, joints, drivers[d], True)
    for k in range(count):
        pair = rows[k]
        place_contact(pair, 0.5)
        pair["friction"] = pair["static"] = pair["rolling"] = pair["torsion"] = 0.0
        pair["surface_a"][:] = pair["surface_b"][:] = NO_MOTION
        begin_row(bodies, pair, pair["depth"] - left if _is_own(bodies, pair) else NO_FLOOR)
    state["separates"] = 1
    solve_contacts(bodies, joints, drivers, rows, count, 0.0, state)
    state["separates"] = 0
    for d in range(state["driven_count"]):
        driver = drivers[d]
        if driver["loops"] == 1:
            v, w = driver["velocity"], driver["omega"]
            turn(driver["orientation"], w[0], w[1], w[2], driver["orientation"])
            for i in range(3):
                driver["position"][i] += v[i]
            for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
                joints[k]["angle"] += joints[k]["rate"]
                joints[k]["offset"] += joints[k]["rate"]
                joints[k]["offset_rate"] -= joints[k]["rate"]
            pose_links(bodies, joints, driver)
            _exchange_velocities(bodies, joints, driver, False)


@kernel
def _exchange_velocities(bodies, joints, driver, stops):
    """Exchange the velocities of a driver with those kept, which are zero at first if it `stops`."""
    kept = driver["scratch"]
    if stops:
        kept[:] = 0.0
        for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
            joints[k]["lead_rate"] = 0.0
    for i in range(3):
        driver["velocity"][i], kept[1, i] = kept[1, i], driver["velocity"][i]
        driver["omega"][i], kept[2, i] = kept[2, i], driver["omega"][i]
    exchange_rates(joints, driver)
    move_links(bodies, joints, driver)


@kernel
def _move_together(world, first, end, left, most):
    """Translate and turn simulated bodies by the least motion after which no depth along the detected normals
    exceeds `left`, at any manifold point; not at all where the solver finds no such motion, or one that
    translates a body by more than `most` [m], or moves it by more than SINKING_SHARE of its width.

    Bodies at rest that separate at their depth per second, without friction, move by that much in a second:
    the contact solver finds these velocities. All bodies have the same mass: otherwise a light body turns by
    degrees before a heavy one yields by a micrometre, and touches others.
    """
    bodies, state, rows = world.bodies, world.state, world.pairs[first:]
    for k in range(len(bodies)):
        body = bodies[k]
        v, w, kept = body["velocity"], body["omega"], body["scratch"]
        for i in range(3):
            kept[0, i], kept[1, i] = v[i], w[i]
            v[i] = w[i] = 0.0
        if is_joined(bodies, world.drivers, k):
            continue
        # hide the drivers (-2 - d, undone by the same): the solver would move their links
        body["driver"] = -2 - body["driver"]
        if body["kind"] == SIMULATED:
            body["inverse_mass"] = 1.0
            for i in range(3):
                for j in range(3):
                    body["inverse_inertia"][i, j] *= body["mass"]
    for d in range(state["driven_count"], len(world.drivers)):
        stop_mechanism(world.drivers[d])
        weigh_hinges(bodies, world.joints, world.drivers[d])
        weigh_for_impacts(world.drivers[d])
    # of two parallel faces, a motion that separates the deepest points alone may sink others as deep
    count = expand_manifolds(bodies, world.pieces, world.vertices, rows, end - first, True, state)
    for k in range(count):
        pair = rows[k]
        place_contact(pair, 0.5)
        pair["friction"] = pair["static"] = pair["rolling"] = pair["torsion"] = 0.0
        pair["surface_a"][:] = pair["surface_b"][:] = NO_MOTION
        begin_row(bodies, pair, -pair["distance"] - left)
    state["separates"] = 1
    solve_contacts(bodies, world.joints, world.drivers, rows, count, 0.0, state)
    state["separates"] = 0
    near = True
    for k in range(len(bodies)):
        if bodies[k]["kind"] == SIMULATED:
            v = bodies[k]["velocity"]
            near = near and v[0] * v[0] + v[1] * v[1] + v[2] * v[2] <= most * most
            near = near and _way(bodies[k]) <= SINKING_SHARE * bodies[k]["width"]
    for d in range(state["driven_count"], len(world.drivers)):
        shift_mechanism(bodies, world.joints, world.drivers[d], near)
    for k in range(len(bodies)):
        if not is_joined(bodies, world.drivers, k):
            bodies[k]["driver"] = -2 - bodies[k]["driver"]
            _end_motion(bodies[k], near)


@kernel
def _way(body):
    """Bound on the way of a body's cores in a second at its velocities [m]."""
    v, w = body["velocity"], body["omega"]
    turned = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]) + turned * body["reach"]


@kernel
def _end_motion(body, allowed):
    """Move a simulated body for a second at its velocities, if allowed, and give it its mass; give any body
    the velocities in its `scratch`."""
    v, w, m, c = body["velocity"], body["omega"], body["rotation"], body["center_of_mass"]
    if allowed and body["kind"] == SIMULATED and _way(body) > 0:
        turn(body["orientation"], w[0], w[1], w[2], body["orientation"])
        matrix_of(body["orientation"], m)
        for i in range(3):
            arm = m[i, 0] * c[0] + m[i, 1] * c[1] + m[i, 2] * c[2]
            body["position"][i] = body["center"][i] + v[i] - arm
        place(body)
    for i in range(3):
        v[i], w[i] = body["scratch"][0, i], body["scratch"][1, i]
    if body["kind"] == SIMULATED:
        body["inverse_mass"] = 1 / body["mass"]
        refresh_inertia(body)


@kernel
def kinetic_energy(body):
    """Kinetic energy of a simulated body [J]."""
    v, w, rotation, inertia = body["velocity"], body["omega"], body["rotation"], body["inertia"]
    total = body["mass"] * (v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if is_isotropic(inertia):
        return (total + inertia[0, 0] * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2])) / 2
    for i in range(3):
        for j in range(3):
            along_i = rotation[0, i] * w[0] + rotation[1, i] * w[1] + rotation[2, i] * w[2]
            along_j = rotation[0, j] * w[0] + rotation[1, j] * w[1] + rotation[2, j] * w[2]
            total += inertia[i, j] * along_i * along_j
    return total / 2

"""Islands: groups of movers connected by contacts; the solver treats each island separately.

A mover is the unit that an impulse on a body moves: a simulated body, or all links of a driver as one rigid
body. The hinges of a driver's chains are further movers of the solver, in blocks of six (`link_rows`).
"""

from math import sqrt

from touchstone.reference_impl.continuous.hinge_motion import LIMIT_ROUNDING, limit_gap
from touchstone.reference_impl.continuous.mechanism_dynamics import factorise, solve_lower, solve_upper
from touchstone.reference_impl.continuous.mechanism_motion import take_gains
from touchstone.reference_impl.core.conventions import HINGE_BLOCKS, NO_FLOOR, SIMULATED
from touchstone.reference_impl.core.counters import COUNT_LOST
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import copy_vector, dot
from touchstone.reference_impl.core.solver_dtypes import (
    LINK_CAPACITY,
    MOMENT_CAPACITY,
    MOVER_CAPACITY,
    ROW_CAPACITY,
)
from touchstone.reference_impl.kinematics.skeleton import move_links
from touchstone.reference_impl.solver.contact_rows import oppose_mean_slip, prepare_row
from touchstone.reference_impl.solver.hinge_response import (
    find_rates,
    set_limit_response,
    set_response,
    turn_at_once,
)
from touchstone.reference_impl.solver.link_rows import add_link_mobility
from touchstone.reference_impl.solver.mobility import (
    carry_turn,
    contact_mobility,
    meeting_velocity,
    point_velocity,
    relative_turn,
)
from touchstone.reference_impl.solver.moment_rows import turn_mobility

LOCKED = 1e-9
"""Mobility along a direction in which joints hold a body, over that in all directions [1]: it keeps a row's
own solution finite, and vanishes from that of all rows."""
LEAST_FREEDOM = 1e-6
"""Squared sine of the angle between a normal and such a direction below which joints hold a contact along its
normal [1]."""


@kernel
def mover_of(bodies, drivers, b):
    """Row of `bodies` of body b's mover: that body or its driver's root; -1 if impulses do not move it."""
    body = bodies[b]
    if body["driver"] >= 0:
        driver = drivers[body["driver"]]
        return driver["root"] if driver["inverse_mass"] > 0 else -1
    return b if body["inverse_mass"] > 0 else -1


@kernel
def join_islands(bodies, drivers, pairs, count, flying):
    """Link the rows `pairs[:count]` of each island by `next_row`, from the row for which `is_head` holds.

    Rows without a mover are in no island.

    Args:
        flying: include rows whose floor is NO_FLOOR.
    """
    for k in range(count):
        pair = pairs[k]
        pair["island"] = -1
        for side in range(2):
            m = mover_of(bodies, drivers, pair["body_a"] if side == 0 else pair["body_b"])
            if m >= 0:
                bodies[m]["island"], bodies[m]["first_row"] = m, -1
    for b in range(len(bodies)):
        if is_joined(bodies, drivers, b):
            bodies[b]["island"] = drivers[bodies[b]["driver"]]["root"]
    for k in range(count):
        pair = pairs[k]
        if pair["floor"] == NO_FLOOR and not flying:
            continue
        a, b = mover_of(bodies, drivers, pair["body_a"]), mover_of(bodies, drivers, pair["body_b"])
        pair["island"] = b if a < 0 else a
        if a >= 0 and b >= 0:
            bodies[island_of(bodies, a)]["island"] = island_of(bodies, b)
    # prepend in reverse, so that rows keep their order
    for k in range(count - 1, -1, -1):
        pair = pairs[k]
        if pair["island"] >= 0:
            pair["island"] = island_of(bodies, pair["island"])
            root = bodies[pair["island"]]
            pair["next_row"], root["first_row"] = root["first_row"], k


@kernel
def is_head(bodies, pairs, k):
    """Whether row k is the first of an island."""
    return pairs[k]["island"] >= 0 and bodies[pairs[k]["island"]]["first_row"] == k


@kernel
def island_of(bodies, m):
    """Root mover of the island of mover m (union-find with path halving)."""
    while bodies[m]["island"] != m:
        bodies[m]["island"] = bodies[bodies[m]["island"]]["island"]
        m = bodies[m]["island"]
    return m


@inlined_kernel
def load_island(bodies, joints, drivers, pairs, head, h, state):
    """Copy the rows and movers of an island to the solver; no `resting_impulse` has been applied yet."""
    solver = state["solver"]
    rows = solver["rows"]
    k = head
    while k >= 0:
        for side in range(2):
            m = mover_of(bodies, drivers, pairs[k]["body_a"] if side == 0 else pairs[k]["body_b"])
            if m >= 0:
                bodies[m]["mover"] = -1
        k = pairs[k]["next_row"]
    for d in range(len(drivers)):
        drivers[d]["hinge_mover"] = -1
    solver["row_count"] = solver["mover_count"] = solver["link_count"] = solver["led"] = 0
    solver["joined"] = solver["moment_count"] = 0
    solver["slack"] = 2 * state["slack"] / h if h > 0 else 0.0
    k = head
    while k >= 0:
        pair, own = pairs[k], k
        k = pair["next_row"]
        n = solver["row_count"]
        full = n == ROW_CAPACITY or solver["link_count"] + 2 > LINK_CAPACITY
        if full or solver["mover_count"] + 2 * (1 + HINGE_BLOCKS) > MOVER_CAPACITY:
            state["counters"][COUNT_LOST] += 1
            continue
        row = rows[n]
        solver["row_count"] = n + 1
        row["pair"], pair["solver_row"] = own, n
        row["friction"], row["floor"], row["asked"] = pair["friction"], pair["floor"], pair["floor"]
        row["a"] = _load_mover(bodies, drivers, pair["body_a"], pair["lever_a"], solver, row["r_a"])
        row["b"] = _load_mover(bodies, drivers, pair["body_b"], pair["lever_b"], solver, row["r_b"])
        row["link_a"] = _load_link(bodies, joints, drivers, pair["body_a"], solver)
        row["link_b"] = _load_link(bodies, joints, drivers, pair["body_b"], solver)
        copy_vector(pair["normal"], row["normal"])
        copy_vector(pair["resting_impulse"], row["impulse"])
        u = row["free"]
        u[0], u[1], u[2] = meeting_velocity(bodies, pair)
        for i in range(3):
            row["before"][i] = pair["before_b"][i] - pair["before_a"][i]
            u[i] += pair["bias"][i]
        # a prescribed body needs no lead for its mobility
        lead = _lead_on(bodies, drivers, pair["body_a"], state)
        lead = max(lead, _lead_on(bodies, drivers, pair["body_b"], state))
        held = bodies[pair["body_a"]]["led"] == 1 or bodies[pair["body_b"]]["led"] == 1
        solver["led"] = 1 if lead > 0 or held else solver["led"]
        opposes_mean = pair["slides"] == 1 and state["lead"] < 1
        bias_share = 1.0
        if lead > 0 or (held and state["lead"] == 1):
            _add_lead(bodies, drivers, pair, max(lead, state["lead"]), u)
            bias_share -= max(lead, state["lead"])
        contact_mobility(bodies, drivers, pair, row["mobility"])
        if row["link_a"] >= 0 or row["link_b"] >= 0:
            _add_links(solver, row)
        if is_joined(bodies, drivers, pair["body_a"]) or is_joined(bodies, drivers, pair["body_b"]):
            w = row["mobility"]
            trace = w[0, 0] + w[1, 1] + w[2, 2]
            if not trace > 0:
                # nothing moves it
                solver["row_count"] = n
                continue
            for i in range(3):
                w[i, i] += LOCKED * trace
            _drop_locked(solver, row, pair["bias"], bias_share, LOCKED * trace, u)
            if opposes_mean:
                # along such directions its slip before is that at the end
                turned, along = row["rate"], dot(pair["normal"], row["before"])
                for i in range(3):
                    turned[i] = row["before"][i] - along * pair["normal"][i] - u[i]
                _drop_locked(solver, row, turned, 1.0, LOCKED * trace, row["before"])
            solver["joined"] = 1
        if opposes_mean:
            oppose_mean_slip(row)
        prepare_row(row)
        if has_moment(pair):
            # the lead of the velocities above
            lead = max(lead, state["lead"]) if lead > 0 or (held and state["lead"] == 1) else 0.0
            _load_moment(bodies, drivers, pair, lead, state)
    for d in range(len(drivers)):
        if drivers[d]["hinge_mover"] >= 0:
            _load_limits(joints, drivers[d], solver)


@kernel
def _drop_locked(solver, row, change, share, least, out_velocity):
    """Take from a velocity of a row its share of a change along directions in which joints hold its point: it
    comes of how these turn within the substep, and no impulse changes it. The speed along the normal stays,
    unless joints hold that too. `least` is the mobility in such directions."""
    if row["friction"] == 0:
        return
    s, x, y, n = solver["kernel"], row["swept"], row["direction"], row["normal"]
    for i in range(3):
        x[i], y[i] = share * least * change[i], least * n[i]
        for j in range(3):
            s[i, j] = row["mobility"][i, j]
    factorise(s, 3)
    # the parts of change and normal along such directions
    for part in (x, y):
        solve_lower(s, 3, part)
        solve_upper(s, 3, part)
    freely = 1 - dot(n, y)
    along = dot(n, x) / freely if freely > LEAST_FREEDOM else 0.0
    for i in range(3):
        out_velocity[i] += along * (n[i] - y[i]) - x[i]


@inlined_kernel
def has_moment(pair):
    """Whether a pair has rolling or torsional friction."""
    return pair["rolling"] + pair["torsion"] > 0


@kernel
def _load_moment(bodies, drivers, pair, lead, state):
    """Add the rolling and torsional friction of the row loaded last."""
    solver = state["solver"]
    if solver["moment_count"] == MOMENT_CAPACITY:
        state["counters"][COUNT_LOST] += 1
        return
    moment, row, u = (
        solver["moments"][solver["moment_count"]],
        solver["rows"][pair["solver_row"]],
        pair["moment"],
    )
    moment["row"], moment["arm"] = pair["solver_row"], 1.0
    solver["moment_count"] += 1
    w = moment["mobility"]
    turn_mobility(solver, moment)
    trace = w[0, 0] + w[1, 1] + w[2, 2]
    if not trace > 0:
        # nothing turns it
        solver["moment_count"] -= 1
        return
    linear = row["mobility"]
    arm = sqrt((linear[0, 0] + linear[1, 1] + linear[2, 2]) / trace)
    moment["mass"] = 3 / (arm * arm * trace)
    moment["arm"] = pair["arm"] = arm
    moment["rolling"], moment["torsion"] = pair["rolling"] / arm, pair["torsion"] / arm
    relative_turn(bodies, pair, moment["free"])
    if lead > 0:
        _add_turn_lead(bodies, drivers, pair, lead, moment["free"])
    before, free = carry_turn(pair, pair["turn_before"], 1.0), carry_turn(pair, moment["free"], -1.0)
    for i in range(3):
        moment["impulse"][i] = u[i] / arm
        moment["free"][i], moment["before"][i] = arm * free[i], arm * before[i]
        for j in range(3):
            w[i, j] *= arm * arm
        if solver["joined"] == 1:
            w[i, i] += LOCKED * arm * arm * trace


@kernel
def _add_turn_lead(bodies, drivers, pair, lead, out_omega):
    """`_add_lead` of the angular velocity of B relative to A."""
    for side in range(2):
        b, sign = (pair["body_b"], 1.0) if side else (pair["body_a"], -1.0)
        joined = lead == 1 and is_joined(bodies, drivers, b)
        if not joined and bodies[b]["kind"] != SIMULATED and not loops(bodies, drivers, b):
            continue
        for i in range(3):
            if joined or bodies[b]["kind"] != SIMULATED:
                out_omega[i] += sign * bodies[b]["lead_omega"][i]
            else:
                out_omega[i] += sign * lead * bodies[b]["old_omega"][i]


@kernel
def _load_limits(joints, driver, solver):
    """Add the limits of a driver's hinges to the rows of its island: along x, without friction. At one
    instant only those that hinges have reached act."""
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joint = joints[k]
        full = solver["row_count"] == ROW_CAPACITY or solver["link_count"] == LINK_CAPACITY
        lasting = driver["lasting"] == 1
        if full or joint["limited"] == 0 or not (lasting or limit_gap(joint) <= LIMIT_ROUNDING):
            continue
        row, link = solver["rows"][solver["row_count"]], solver["links"][solver["link_count"]]
        row["pair"], row["a"], row["b"], row["link_a"], row["link_b"] = (
            -2 - k,
            -1,
            -1,
            -1,
            solver["link_count"],
        )
        solver["row_count"] += 1
        solver["link_count"] += 1
        link["mover"] = driver["hinge_mover"]
        set_limit_response(joints, driver, k, joint["limited"], link)
        row["friction"] = 0.0
        row["r_a"][:] = row["r_b"][:] = row["normal"][:] = row["impulse"][:] = 0.0
        row["free"][:] = row["before"][:] = 0.0
        row["normal"][0] = 1.0
        row["before"][0] = joint["limited"] * (joint["old_rate"] if lasting else joint["rate"])
        row["free"][0] = joint["limit_free"] if lasting else joint["limited"] * joint["rate"]
        row["floor"] = row["asked"] = joint["limit_floor"] if lasting else 0.0
        row["impulse"][0] = joint["limit_impulse"] if lasting else 0.0
        row["mobility"][:] = 0.0
        add_link_mobility(solver, row, row["mobility"])
        prepare_row(row)


@kernel
def _add_links(solver, row):
    """Add the hinges of its links to a row. Links of one driver move apart by their hinges alone."""
    if row["a"] == row["b"]:
        row["a"] = row["b"] = -1
        row["mobility"][:] = 0.0
    add_link_mobility(solver, row, row["mobility"])


@kernel
def _load_mover(bodies, drivers, b, point, solver, out_r):
    """Index of body b's mover in the solver; `out_r` leads from its centre of mass to the contact point. A
    mechanism has blocks of its rates alone."""
    m = mover_of(bodies, drivers, b)
    if m < 0:
        out_r[:] = 0.0
        return -1
    if is_joined(bodies, drivers, b):
        for i in range(3):
            out_r[i] = point[i] - bodies[b]["center"][i]
        return -1
    index = bodies[m]["mover"]
    if index < 0:
        index = solver["mover_count"]
        solver["mover_count"] = index + 1
        bodies[m]["mover"] = index
        mover = solver["movers"][index]
        mover["body"], mover["block"] = m, 0
        if bodies[m]["driver"] >= 0:
            driver = drivers[bodies[m]["driver"]]
            mover["inverse_mass"] = driver["inverse_mass"]
            _copy_mass(driver["inverse_inertia"], driver["center"], mover)
        else:
            mover["inverse_mass"] = bodies[m]["inverse_mass"]
            _copy_mass(bodies[m]["inverse_inertia"], bodies[m]["center"], mover)
    center = solver["movers"][index]["center"]
    for i in range(3):
        out_r[i] = point[i] - center[i]
    return index


@kernel
def _load_link(bodies, joints, drivers, b, solver):
    """Index of body b in the solver if hinges of chains, or joints, move it, or -1."""
    body = bodies[b]
    if body["driver"] < 0 or body["hinge"] < 0 or drivers[body["driver"]]["loops"] == 0:
        return -1
    driver, joint, links = drivers[body["driver"]], joints[body["hinge"]], solver["links"]
    if driver["hinge_mover"] < 0:
        _load_hinges(joints, driver, solver)
    if joint["link"] < 0:
        joint["link"] = solver["link_count"]
        solver["link_count"] += 1
        links[joint["link"]]["mover"] = driver["hinge_mover"]
        set_response(joints, driver, body["hinge"], links[joint["link"]])
    return joint["link"]


@kernel
def _load_hinges(joints, driver, solver):
    """Add the hinges of a driver's chains to the movers, in blocks of six coordinates."""
    driver["hinge_mover"], driver["is_solved"] = solver["mover_count"], 1
    for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
        joints[k]["link"] = -1
    for block in range((driver["hinge_count"] + 5) // 6):
        mover = solver["movers"][solver["mover_count"]]
        solver["mover_count"] += 1
        mover["body"], mover["block"], mover["inverse_mass"] = driver["root"], block + 1, 1.0
        mover["inverse_inertia"][:, :] = mover["center"][:] = 0.0
        for i in range(3):
            mover["inverse_inertia"][i, i] = 1.0


@kernel
def load_limits(joints, drivers, d, solver):
    """Load the limits of driver d's hinges alone: an island without contacts."""
    for k in range(len(drivers)):
        drivers[k]["hinge_mover"] = -1
    solver["row_count"] = solver["mover_count"] = solver["link_count"] = solver["moment_count"] = 0
    solver["led"], solver["joined"] = 1, 0
    _load_hinges(joints, drivers[d], solver)
    _load_limits(joints, drivers[d], solver)


@kernel
def _copy_mass(inverse_inertia, center, mover):
    for i in range(3):
        mover["center"][i] = center[i]
        for j in range(3):
            mover["inverse_inertia"][i, j] = inverse_inertia[i, j]


@kernel
def loops(bodies, drivers, b):
    """Whether body b is a link of a driver that moves in the simulated loop."""
    return bodies[b]["driver"] >= 0 and drivers[bodies[b]["driver"]]["loops"] == 1


@kernel
def is_joined(bodies, drivers, b):
    """Whether body b is one of a mechanism."""
    return bodies[b]["driver"] >= 0 and drivers[bodies[b]["driver"]]["mechanism"] == 1


@kernel
def leads(bodies, drivers, b):
    """Whether contacts on body b follow its driver's path by the law of positions."""
    return loops(bodies, drivers, b) and drivers[bodies[b]["driver"]]["leads"] == 1


@kernel
def _lead_on(bodies, drivers, b, state):
    """Lead that body b asks of its rows [1]: 1 in the law of positions, that of its driver in the law of
    velocities; 0 in impacts, and for bodies whose contacts follow no driver. Prescribed ones ask none of
    velocities."""
    if state["lead"] == 0 or not leads(bodies, drivers, b):
        return 0.0
    driver = drivers[bodies[b]["driver"]]
    if state["lead"] == 1:
        return 1.0
    return driver["lead"] if driver["prescribed"] == 0 else 0.0


@kernel
def _add_lead(bodies, drivers, pair, lead, out_velocity):
    """Add to the velocity u of a row with a driver what turns it into q of `driver_motion`."""
    a, b = pair["body_a"], pair["body_b"]
    # `bias` is the change of u from the middle of the substep, at whose geometry all velocities are taken
    for i in range(3):
        out_velocity[i] -= lead * (pair["bias"][i] + pair["surface_a"][i] - pair["surface_b"][i])
    if lead == 1 and pair["followed"] == 1:
        for i in range(3):
            out_velocity[i] += pair["path_bias"][i]
    for side in range(2):
        body, sign = bodies[b if side else a], 1.0 if side else -1.0
        p = pair["lever_b"] if side else pair["lever_a"]
        if lead == 1 and is_joined(bodies, drivers, b if side else a):
            x, y, z = point_velocity(body["lead_velocity"], body["lead_omega"], body["center"], p)
        elif body["kind"] == SIMULATED:
            x, y, z = point_velocity(body["old_velocity"], body["old_omega"], body["center"], p)
            sign *= lead
        elif loops(bodies, drivers, b if side else a):
            x, y, z = point_velocity(body["lead_velocity"], body["lead_omega"], body["center"], p)
        else:
            continue
        out_velocity[0] += sign * x
        out_velocity[1] += sign * y
        out_velocity[2] += sign * z


@inlined_kernel
def store_island(bodies, joints, drivers, pairs, state):
    """Apply the solver's result: copy the rows' impulses to `pairs`, and change the movers' velocities."""
    solver = state["solver"]
    for n in range(solver["row_count"]):
        row = solver["rows"][n]
        if row["pair"] >= 0:
            copy_vector(row["impulse"], pairs[row["pair"]]["resting_impulse"])
        else:
            joint = joints[-2 - row["pair"]]
            # an impulse at one instant is no warm start of the force over a substep
            if drivers[bodies[joint["child"]]["driver"]]["lasting"] == 1:
                joint["limit_impulse"] = row["impulse"][0]
    for k in range(solver["moment_count"]):
        moment = solver["moments"][k]
        for i in range(3):
            own = solver["rows"][moment["row"]]["pair"]
            pairs[own]["moment"][i] = moment["arm"] * moment["impulse"][i]
    for m in range(solver["mover_count"]):
        mover = solver["movers"][m]
        dv, dw = mover["velocity"], mover["omega"]
        body = bodies[mover["body"]]
        if body["driver"] >= 0 and mover["block"] > 0:
            y = drivers[body["driver"]]["hinge_response"]
            for i in range(3):
                y[6 * (mover["block"] - 1) + i], y[6 * (mover["block"] - 1) + 3 + i] = dv[i], dw[i]
            continue
        if body["driver"] < 0:
            for i in range(3):
                body["velocity"][i] += dv[i]
                body["omega"][i] += dw[i]
            continue
        driver = drivers[body["driver"]]
        if driver["lasting"] == 1:
            for i in range(3):
                driver["push"][i] += dv[i] / driver["inverse_mass"]
                driver["twist"][i] += dw[i] / driver["turn_share"]
            continue
        # a driver's velocity is that of its root's origin
        v, w, c, o = driver["velocity"], driver["omega"], driver["center"], driver["position"]
        x, y, z = o[0] - c[0], o[1] - c[1], o[2] - c[2]
        v[0] += dv[0] + dw[1] * z - dw[2] * y
        v[1] += dv[1] + dw[2] * x - dw[0] * z
        v[2] += dv[2] + dw[0] * y - dw[1] * x
        for i in range(3):
            w[i] += dw[i]
        move_links(bodies, joints, driver)
    for d in range(len(drivers)):
        if drivers[d]["hinge_mover"] >= 0:
            _turn_hinges(bodies, joints, drivers[d])


@kernel
def _turn_hinges(bodies, joints, driver):
    """Change the rates of a driver's hinges by the coordinates in `hinge_response`, or note the change by an
    impulse at one instant of which they are the response over a substep."""
    if driver["mechanism"] == 0 and driver["lasting"] == 1:
        for k in range(driver["first_joint"], driver["first_joint"] + driver["joint_count"]):
            # what no contact touches has no response
            if joints[k]["coordinate"] >= 0 and joints[k]["share"] > 0:
                y = driver["hinge_response"][joints[k]["coordinate"]]
                joints[k]["twist"] += y / sqrt(joints[k]["share"])
        return
    find_rates(driver)
    if driver["mechanism"] == 1:
        take_gains(bodies, joints, driver)
        return
    turn_at_once(joints, driver)
    move_links(bodies, joints, driver)

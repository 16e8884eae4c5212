"""Impulses at contacts: impacts one at a time by a priority queue, held contacts by sweeps (section 5)."""

from math import sqrt

from reference_impl.contact import (
    apply_impulse,
    contact_mobility,
    contact_point,
    log_contact,
    surface_velocity,
)
from reference_impl.conventions import (
    APPROACH_MIN,
    COUNT_IMPULSES,
    FLIGHT_BALLISTIC,
    FRICTION_PAPER,
    HOLD_MEMORY,
    HOLD_RESIDUAL,
    HOLD_SWEEPS,
    IMPULSE_CAP,
    SLIP_MIN,
)
from reference_impl.kernel import kernel

ALL = -2
"""In place of a patch: every row, also those without one (-1)."""


@kernel
def resting_restitution(e, approach, v_rest):
    """Restitution that fades linearly from e at 2 v_rest to 0 at v_rest; speeds in m/s."""
    if v_rest <= 0:
        return e
    return e * min(1.0, max(0.0, approach / v_rest - 1))


@kernel
def contact_impulse(v, n, mobility, e, mu, friction, out_impulse):
    """Impulse on B of one impact (Eqs. 8-10).

    Args:
        v: velocity of B against A at the contact before the impulse [m/s]; approaching, n.v < 0.
        n: unit normal, A to B.
        mobility: velocity of B against A per impulse on B (3, 3) [1/kg].
        e, mu: restitution and friction of the pair.
        friction: FRICTION_PAPER (always mu j against the sliding, j from Eq. 9) or FRICTION_COULOMB (at most
            what stops the sliding; j such that Newton's law holds with friction acting).
        out_impulse: (3,) [N s].
    """
    v_n = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    tx, ty, tz = v[0] - v_n * n[0], v[1] - v_n * n[1], v[2] - v_n * n[2]
    slip = sqrt(tx * tx + ty * ty + tz * tz)
    if slip > SLIP_MIN:
        tx, ty, tz = tx / slip, ty / slip, tz / slip
    else:
        tx = ty = tz = 0.0
    target = -(1 + e) * v_n
    m = mobility
    if friction == FRICTION_PAPER:
        j = target / _along(m, n, n[0], n[1], n[2])
    else:
        # stick: the impulse that reverses v_n and stops the sliding
        x, y, z = -e * v_n * n[0] - v[0], -e * v_n * n[1] - v[1], -e * v_n * n[2] - v[2]
        x, y, z = _solve(m, x, y, z)
        j = x * n[0] + y * n[1] + z * n[2]
        px, py, pz = x - j * n[0], y - j * n[1], z - j * n[2]
        if px * px + py * py + pz * pz <= (mu * j) ** 2 and j > 0:
            out_impulse[0], out_impulse[1], out_impulse[2] = x, y, z
            return
        # slide: mu j against the sliding, and j takes what friction adds to v_n into account
        along = _along(m, n, n[0] - mu * tx, n[1] - mu * ty, n[2] - mu * tz)
        # jamming (Painleve): friction alone would drive the bodies together
        if along <= 0:
            along = _along(m, n, n[0], n[1], n[2])
        j = target / along
    out_impulse[0] = j * (n[0] - mu * tx)
    out_impulse[1] = j * (n[1] - mu * ty)
    out_impulse[2] = j * (n[2] - mu * tz)


@kernel
def _along(m, n, x, y, z):
    """n . M (x, y, z)"""
    return (
        n[0] * (m[0, 0] * x + m[0, 1] * y + m[0, 2] * z)
        + n[1] * (m[1, 0] * x + m[1, 1] * y + m[1, 2] * z)
        + n[2] * (m[2, 0] * x + m[2, 1] * y + m[2, 2] * z)
    )


@kernel
def _solve(m, x, y, z):
    """Solve M p = (x, y, z) for a (3, 3) matrix by cofactors."""
    a = m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1]
    b = m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2]
    c = m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0]
    d = m[0, 0] * a + m[0, 1] * b + m[0, 2] * c
    p = a * x + (m[0, 2] * m[2, 1] - m[0, 1] * m[2, 2]) * y + (m[0, 1] * m[1, 2] - m[0, 2] * m[1, 1]) * z
    q = b * x + (m[0, 0] * m[2, 2] - m[0, 2] * m[2, 0]) * y + (m[0, 2] * m[1, 0] - m[0, 0] * m[1, 2]) * z
    r = c * x + (m[0, 1] * m[2, 0] - m[0, 0] * m[2, 1]) * y + (m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]) * z
    return p / d, q / d, r / d


@kernel
def _relative_velocity(bodies, pair, state):
    """Velocities of both surfaces and of B against A at a pair's contact point, to `state`; returns n . v."""
    a, b, v, n = state["velocity_a"], state["velocity_b"], state["velocity"], pair["normal"]
    surface_velocity(bodies[pair["body_a"]], pair["point"], a)
    surface_velocity(bodies[pair["body_b"]], pair["point"], b)
    for i in range(3):
        v[i] = b[i] - a[i]
    return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]


@kernel
def _apply(bodies, joints, drivers, pair, point, p):
    """Equal and opposite impulses on both bodies of a pair."""
    apply_impulse(bodies, joints, drivers, pair["body_b"], point, p[0], p[1], p[2])
    apply_impulse(bodies, joints, drivers, pair["body_a"], point, -p[0], -p[1], -p[2])


@kernel
def resolve_impacts(bodies, joints, drivers, pairs, count, contacts, state, time):
    """Impacts of the touching pairs `pairs[:count]`: the fastest approach first, until none is left.

    Returns:
        Whether fewer than IMPULSE_CAP impulses sufficed.
    """
    v, p, mobility = state["velocity"], state["impulse"], state["mobility"]
    g = state["gravity"]
    v_rest = 2 * state["dt"] * sqrt(g[0] ** 2 + g[1] ** 2 + g[2] ** 2)
    for k in range(count):
        _set_key(bodies, pairs[k], state)
    for _ in range(IMPULSE_CAP):
        fastest = -1
        for k in range(count):
            if pairs[k]["key"] > (APPROACH_MIN if fastest < 0 else pairs[fastest]["key"]):
                fastest = k
        if fastest < 0:
            return True
        pair = pairs[fastest]
        point = pair["point"]
        v_n = _relative_velocity(bodies, pair, state)
        e = resting_restitution(pair["restitution"], -v_n, v_rest)
        if _begin_patch(bodies, pairs, count, pair["patch"], e):
            _settle(bodies, joints, drivers, pairs, count, pair["patch"], state)
            _log_held(bodies, pairs, count, pair["patch"], contacts, state, time)
            state["counters"][COUNT_IMPULSES] += 1
            _set_keys(bodies, pairs, count, pair, state)
            continue
        contact_mobility(bodies, drivers, pair, point, mobility)
        contact_impulse(v, pair["normal"], mobility, e, pair["friction"], state["friction"], p)
        _apply(bodies, joints, drivers, pair, point, p)
        state["counters"][COUNT_IMPULSES] += 1
        row = log_contact(contacts, state, pair, point, time)
        if row >= 0:
            contacts[row]["velocity_a_before"][:] = state["velocity_a"]
            contacts[row]["velocity_b_before"][:] = state["velocity_b"]
            _close_row(bodies, contacts[row], p)
        _set_keys(bodies, pairs, count, pair, state)
    return False


@kernel
def _set_keys(bodies, pairs, count, pair, state):
    """Approach speeds after an impulse on `pair`."""
    for k in range(count):
        if _share_body(bodies, pairs[k], pair):
            _set_key(bodies, pairs[k], state)


@kernel
def _begin_patch(bodies, pairs, count, patch, e):
    """Ready a patch of two points or more for its impact; returns whether it is one.

    All its points resolve as one, each by Newton's law against its own velocity before: n.v+ >= -e n.v-, with
    an impulse only where equality holds. (v+ + e v-) / (1 + e) is then the projection of v- on the velocities
    that do not approach: without friction the energy never rises.
    """
    points = 0
    for k in range(count if patch >= 0 else 0):
        if pairs[k]["patch"] == patch:
            points += 1
            _begin_row(bodies, pairs[k], e * pairs[k]["key"])
    return points > 1


@kernel
def _begin_row(bodies, pair, floor):
    pair["held"][:] = 0.0
    pair["floor"] = floor
    surface_velocity(bodies[pair["body_a"]], pair["point"], pair["before_a"])
    surface_velocity(bodies[pair["body_b"]], pair["point"], pair["before_b"])


@kernel
def _close_row(bodies, contact, p):
    contact["impulse"][:] = p
    surface_velocity(bodies[contact["body_a"]], contact["position"], contact["velocity_a_after"])
    surface_velocity(bodies[contact["body_b"]], contact["position"], contact["velocity_b_after"])


@kernel
def _set_key(bodies, pair, state):
    """Contact point and approach speed of a pair."""
    contact_point(pair, pair["point"])
    pair["key"] = -_relative_velocity(bodies, pair, state)


@kernel
def _share_body(bodies, pair, other):
    """Whether an impulse on `other` changes a velocity of `pair`."""
    for s in range(2):
        one = pair["body_a"] if s == 0 else pair["body_b"]
        for t in range(2):
            two = other["body_a"] if t == 0 else other["body_b"]
            if one == two or (bodies[one]["driver"] >= 0 and bodies[one]["driver"] == bodies[two]["driver"]):
                return True
    return False


@kernel
def begin_hold(bodies, pairs, count, state):
    """Before forces act: surface velocities of the touching pairs, and no impulse yet.

    A polyhedron's contact that separates may come back as fast as it left: its mean velocity over the substep
    is 0 then, and so is the work of its impulse. (Not under FLIGHT_EULER, which takes the last for the mean.)
    """
    for k in range(count):
        _set_key(bodies, pairs[k], state)
        keeps = pairs[k]["patch"] >= 0 and state["flight"] == FLIGHT_BALLISTIC
        _begin_row(bodies, pairs[k], min(0.0, pairs[k]["key"]) if keeps else 0.0)


@kernel
def hold_contacts(bodies, joints, drivers, pairs, count, contacts, state, time, h):
    """After forces acted: impulses that keep touching pairs from approaching, within the friction cone.

    Args:
        time, h: start of the substep in the frame, and its length [s].
    Returns:
        Whether the sweeps converged.
    """
    for k in range(count):
        if _recall(pairs[k], state, h):
            _apply(bodies, joints, drivers, pairs[k], pairs[k]["point"], pairs[k]["held"])
    converged = _settle(bodies, joints, drivers, pairs, count, ALL, state)
    _log_held(bodies, pairs, count, ALL, contacts, state, time)
    _remember(pairs, count, state, h)
    return converged


@kernel
def _recall(pair, state, h):
    """Start a point of a patch from the force that held the nearest one of its pair; whether any did."""
    nearest, least = -1, 0.0
    for m in range(state["held_count"] if pair["patch"] >= 0 else 0):
        if state["held_pieces"][m, 0] == pair["piece_a"] and state["held_pieces"][m, 1] == pair["piece_b"]:
            distance = 0.0
            for i in range(3):
                distance += (state["held_point"][m, i] - pair["point"][i]) ** 2
            if nearest < 0 or distance < least:
                nearest, least = m, distance
    if nearest >= 0:
        for i in range(3):
            pair["held"][i] = h * state["held_force"][nearest, i]
    return nearest >= 0


@kernel
def _remember(pairs, count, state, h):
    """Forces at the points of patches, for the next hold."""
    kept = 0
    for k in range(count):
        pair = pairs[k]
        if pair["patch"] >= 0 and kept < HOLD_MEMORY:
            state["held_pieces"][kept, 0], state["held_pieces"][kept, 1] = pair["piece_a"], pair["piece_b"]
            for i in range(3):
                state["held_point"][kept, i] = pair["point"][i]
                state["held_force"][kept, i] = pair["held"][i] / h
            kept += 1
    state["held_count"] = kept


@kernel
def _settle(bodies, joints, drivers, pairs, count, patch, state):
    """Impulses that keep the rows of a patch, or ALL, at their floor: projected Gauss-Seidel with accumulated
    impulses; exact after one sweep where a body has one contact. Returns whether the sweeps converged."""
    for _ in range(HOLD_SWEEPS):
        change = 0.0
        for k in range(count):
            if patch == ALL or pairs[k]["patch"] == patch:
                change = max(change, _hold(bodies, joints, drivers, pairs[k], state))
        if change <= HOLD_RESIDUAL:
            return True
    return False


@kernel
def _log_held(bodies, pairs, count, patch, contacts, state, time):
    for k in range(count):
        pair = pairs[k]
        p = pair["held"]
        if (p[0] == 0 and p[1] == 0 and p[2] == 0) or (patch != ALL and pair["patch"] != patch):
            continue
        row = log_contact(contacts, state, pair, pair["point"], time)
        if row >= 0:
            contacts[row]["velocity_a_before"][:] = pair["before_a"]
            contacts[row]["velocity_b_before"][:] = pair["before_b"]
            _close_row(bodies, contacts[row], p)


@kernel
def cut_holds(contacts, first, end, fraction):
    """Held contacts acted for a fraction of their substep: cut what rows `first` to `end` log of them."""
    for k in range(first, end):
        row = contacts[k]
        for i in range(3):
            row["impulse"][i] *= fraction
            a, b = row["velocity_a_before"][i], row["velocity_b_before"][i]
            row["velocity_a_after"][i] = a + fraction * (row["velocity_a_after"][i] - a)
            row["velocity_b_after"][i] = b + fraction * (row["velocity_b_after"][i] - b)


@kernel
def _hold(bodies, joints, drivers, pair, state):
    """One contact's share of a sweep; returns the change of its velocity [m/s]."""
    v, p, tangent, mobility = state["velocity"], state["impulse"], state["tangent"], state["mobility"]
    n, held, point = pair["normal"], pair["held"], pair["point"]
    v_n = _relative_velocity(bodies, pair, state)
    if v_n >= pair["floor"] and held[0] == 0 and held[1] == 0 and held[2] == 0:
        return 0.0
    contact_mobility(bodies, drivers, pair, point, mobility)
    normal_mobility = _along(mobility, n, n[0], n[1], n[2])
    # the mean mobility across the normal: exact for spheres, a relaxation for the rest
    across = (mobility[0, 0] + mobility[1, 1] + mobility[2, 2] - normal_mobility) / 2
    j_old = held[0] * n[0] + held[1] * n[1] + held[2] * n[2]
    j = max(0.0, j_old - (v_n - pair["floor"]) / normal_mobility)
    # what would stop the sliding, cut off at the cone (or always the whole cone, Eq. 10)
    sliding = 0.0
    for i in range(3):
        tangent[i] = held[i] - j_old * n[i] - (v[i] - v_n * n[i]) / across
        sliding += tangent[i] ** 2
    sliding = sqrt(sliding)
    limit = pair["friction"] * j
    scale = 1.0
    if sliding > limit or (state["friction"] == FRICTION_PAPER and sliding * across > SLIP_MIN):
        scale = limit / sliding if sliding > 0 else 0.0
    change = 0.0
    for i in range(3):
        new = j * n[i] + scale * tangent[i]
        p[i] = new - held[i]
        held[i] = new
        change += p[i] * p[i]
    _apply(bodies, joints, drivers, pair, point, p)
    return sqrt(change) * max(normal_mobility, across)

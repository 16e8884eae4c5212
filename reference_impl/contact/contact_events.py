"""Contact events within a substep: the return of a separating contact, the stop of a sliding one, the onset
of sliding of one that sticks, and the leaving of a curved surface.

The times of the first two follow from the velocities before and after the contact solve, while bodies still
have their initial poses; those of the others from forces that change evenly. No event occurs in a dense
substep.
"""

from math import acos, sqrt

from touchstone.reference_impl.continuous.contact_kinematics import is_round
from touchstone.reference_impl.core.conventions import EVENT_CAP, GRIPS, NEVER, NO_FLOOR, RELEASED
from touchstone.reference_impl.core.kernel import inlined_kernel, kernel
from touchstone.reference_impl.core.rotation import carried_along, cross, dot, plus, rotate, vector_of
from touchstone.reference_impl.solver.islands import has_moment
from touchstone.reference_impl.solver.mobility import carry_turn, final_velocity, relative_turn

SLIDE_MIN = 1e-4
"""Sliding speed from which the end of sliding is an event [m/s]: below it, the position error is some 1e-7 m.
On prescribed bodies, which start and stop it again and again, it is one from SLIP_MIN on."""
STOP_ERROR = 1e-11
"""Error in the position of a sliding contact below which its stop within a substep is no event [m]."""
SLIP_MIN = 1e-9
"""Sliding speed below which the direction of sliding is undefined [m/s]."""
SLIP_TURN, SLIP_TURN_SHARE = 0.2, 0.8
"""Turn of the direction of sliding within a substep that is too far [rad], and share of it that a shortened
substep allows [1]."""
SLIP_STRAIGHT = 1e-6
"""Turn below which friction need not oppose the mean of both directions [rad]: some roundings."""
ONSET_SOUGHT = 0.5
"""Share of a substep over which a contact that slides in it is solved again, to find its onset [1]."""
AT_ONCE = 0.0
"""Share of a substep after which a contact that jams stops [1]."""
CONE_CLOSE = 1e-6
"""Share of its square by which the friction of a contact that sticks is below its limit [1]."""


@inlined_kernel
def first_return(bodies, pairs, count, state):
    """Fraction of the substep at which the first separating contact returns to its initial gap, at most 1.

    Its speed falls linearly from v to v', so it returns after 2 v / (v - v') of the substep.
    """
    first = 1.0
    for k in range(count):
        pair = pairs[k]
        if pair["floor"] == NO_FLOOR:
            left, now = -pair["key"], final_velocity(bodies, pair, state)
            if now < -left:
                first = min(first, 2 * left / (left - now))
    return first


@inlined_kernel
def is_carried(state):
    """Whether prescribed bodies are in the simulated loop, and no driver on a coupling, whose force is even
    over a substep of any length: contacts on them slide by a known motion."""
    return state["led_loop"] == 1 and state["coupled_loop"] == 0


@kernel
def note_free_slip(bodies, pairs, count, state):
    """Store each row's speed along its initial sliding direction, after forces and before impulses."""
    for k in range(count):
        pair = pairs[k]
        final_velocity(bodies, pair, state)
        slip = _slip(pair)
        pair["free_slip"] = along_slip(pair, state["velocity"]) / slip if slip > SLIP_MIN else 0.0
        if has_moment(pair):
            w = pair["free_turn"]
            relative_turn(bodies, pair, w)
            w[0], w[1], w[2] = carry_turn(pair, w, -1.0)


@inlined_kernel
def first_stop(bodies, pairs, count, h, jams, state):
    """Fraction of the substep at which the first sliding contact stops or reverses; over 1 if the first stops
    later, by its present braking; AT_ONCE, if `jams`, of what no force lets slide on."""
    first = NEVER
    if state["dense_substep"] == 0:
        for k in range(count):
            if pairs[k]["manifold"] < 0 or pairs[k]["manifold"] == k:
                first = min(first, _stop(bodies, pairs, k, h, jams, state))
                if has_moment(pairs[k]):
                    first = min(first, _turn_stop(bodies, pairs, k, h, state))
    return first


@kernel
def _turn_stop(bodies, pairs, k, h, state):
    """`first_stop` of the rolling and the spin of one manifold, or of one row without a manifold."""
    pair, now, load, moment = pairs[k], state["velocity"], 0.0, state["impulse"]
    n, before = pair["normal"], carry_turn(pair, pair["turn_before"], 1.0)
    relative_turn(bodies, pair, now)
    now[0], now[1], now[2] = carry_turn(pair, now, -1.0)
    moment[:] = 0.0
    while k >= 0:
        load += max(0.0, dot(pairs[k]["normal"], pairs[k]["resting_impulse"]))
        for i in range(3):
            moment[i] += pairs[k]["moment"][i]
        k = pairs[k]["next_point"]
    spin, first = dot(n, before), NEVER
    for across in range(2):
        length = pair["rolling"] if across == 1 else pair["torsion"]
        x, y, z = n[0] * spin, n[1] * spin, n[2] * spin
        if across == 1:
            x, y, z = before[0] - x, before[1] - y, before[2] - z
        u = sqrt(x * x + y * y + z * z)
        if load * length == 0 or u * pair["arm"] <= SLIDE_MIN:
            continue
        axis = (x / u, y / u, z / u)
        end, p, f = dot(axis, now), -dot(axis, moment), dot(axis, pair["free_turn"])
        if end * pair["arm"] > SLIP_MIN:
            first = min(first, u / (u - end) if end < u else NEVER)
            continue
        # all of the moment would stop it earlier, also where friction or another contact turns it back
        stops, limit = p > 0 and end * pair["arm"] >= -SLIP_MIN, load * length
        if stops:
            time = u - f + (f - end) * limit / p
        else:
            time = u - end + (limit - p) * _mobility(bodies, pair, axis)
        share = min(1.0, u / time) if 0 < time < EVENT_CAP * u else 1.0
        first = min(first, share if u * pair["arm"] * h * (1 - share) > STOP_ERROR else 1.0)
    return first


@kernel
def _mobility(bodies, pair, axis):
    """Change of the relative rate of turning of a pair about an axis by a unit of angular impulse about it
    [1 / (kg m^2)]."""
    turned = 0.0
    for side in range(2):
        body = bodies[pair["body_b"] if side else pair["body_a"]]
        if body["inverse_mass"] > 0:
            rotate(body["inverse_inertia"], axis, body["scratch"][0])
            turned += dot(axis, body["scratch"][0])
    return turned


@inlined_kernel
def _stop(bodies, pairs, k, h, jams, state):
    """`first_stop` of one manifold as a whole, or of one row without a manifold.

    Along the initial sliding direction, the speed u becomes f without friction and u' with the friction p.
    Friction at the cone's limit L changes it by (u' - f) L / p, so sliding stops after
    u / (u - f + (f - u') L / p) of the substep. Friction that stops the sliding exactly at the end is less
    than L. If other contacts reverse the sliding, it points forward, p < 0: at the limit against the sliding,
    it would change u' by p - L over the mass of both bodies. A stop whose position is exact to STOP_ERROR
    within h is no event, nor that of a row that grips: its slip is the error of a prediction.
    """
    first, rows, fastest, last, turns = k, 0, 0.0, 0.0, False
    u = f = end = p = limit = 0.0
    v = state["velocity"]
    while k >= 0:
        pair = pairs[k]
        n, held, slip = pair["normal"], pair["resting_impulse"], _slip(pair)
        j = n[0] * held[0] + n[1] * held[1] + n[2] * held[2]
        grips = pair["static"] > 0 and pair["grip"] == GRIPS
        if j > 0 and slip > SLIP_MIN and not grips:
            v_n = final_velocity(bodies, pair, state)
            along = along_slip(pair, v) / slip
            rest = v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - v_n * v_n
            fastest, last = max(fastest, slip), max(last, rest)
            turns = turns or along < -SLIP_MIN
            u, f, end = u + slip, f + pair["free_slip"], end + along
            rows += 1
            jams = jams and _jams(bodies, pair)
            p, limit = p - along_slip(pair, held) / slip, limit + pair["friction"] * j
        k = pair["next_point"]
    # what rolls slides by the error of its prediction
    exact = is_carried(state) and pairs[first]["curved"] != 1
    if fastest <= (SLIP_MIN if exact else SLIDE_MIN) or limit == 0:
        return NEVER
    if not (turns or last <= SLIP_MIN * SLIP_MIN):
        return u / (u - end) if end < u else NEVER
    if jams:
        return AT_ONCE
    if p > 0:
        time = u - f + (f - end) * limit / p
    else:
        time = u - end + rows * (limit - p) * _inverse_mass(bodies, pairs[first])
    # elsewhere the contact solve handles a stop within the first 1 / EVENT_CAP of the substep
    if time <= 0 or (not exact and time >= EVENT_CAP * u):
        return 1.0
    share = min(1.0, u / time)
    return share if fastest * h * (1 - share) > STOP_ERROR else 1.0


@kernel
def _jams(bodies, pair):
    """Whether pressing two free bodies together, with friction against their sliding, does not part them: no
    finite force then lets them slide on (Painleve)."""
    n, slip, mu, apart = vector_of(pair["normal"]), _slip(pair), pair["friction"], 0.0
    pressing = plus(n, -mu / slip, before_across(pair))
    for side in range(2):
        body = bodies[pair["body_b"] if side else pair["body_a"]]
        if body["driver"] >= 0:
            return False
        if body["inverse_mass"] > 0:
            lever = vector_of(pair["lever_b"] if side else pair["lever_a"])
            arm, turn = plus(lever, -1.0, vector_of(body["center"])), body["scratch"][0]
            rotate(body["inverse_inertia"], cross(arm, pressing), turn)
            apart += body["inverse_mass"] * dot(n, pressing) + dot(turn, cross(arm, n))
    return apart <= 0


@kernel
def first_change(bodies, pieces, pairs, count, sought):
    """Fraction of the substep at which the first contact that obeys the law of positions leaves, its force
    at 0, or that of a round surface begins to slide, its friction at the limit; NEVER if none does. Where
    several contacts share a load, that of one tells neither.

    Args:
        sought: what slides at the end of the substep may have stuck at its start.
    """
    first = NEVER
    for k in range(count):
        one, two = pieces[pairs[k]["piece_a"]], pieces[pairs[k]["piece_b"]]
        turns = pairs[k]["curved"] == 1 and (is_round(one) or is_round(two))
        rests = is_led(bodies, pairs[k]) and pairs[k]["key"] > -SLIDE_MIN
        if not (turns or rests) or pairs[k]["floor"] == NO_FLOOR:
            continue
        if (pairs[k]["manifold"] >= 0 and pairs[k]["manifold"] != k) or _shares_load(pairs, count, k):
            continue
        # the sums over a manifold: friction at its points may be opposite, along the line through them
        load, path_load, p, q, row = 0.0, 0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), k
        while row >= 0:
            pair = pairs[row]
            n = pair["path_normal"] if pair["followed"] == 1 else pair["normal"]
            load += dot(pair["normal"], pair["resting_impulse"])
            path_load += dot(n, pair["spare"])
            p, q = plus(p, 1.0, pair["resting_impulse"]), plus(q, 1.0, pair["spare"])
            row = pair["next_point"]
        mu = pairs[k]["friction"]
        margin = mu * load - sqrt(max(0.0, dot(p, p) - load * load))
        path_margin = mu * path_load - sqrt(max(0.0, dot(q, q) - path_load * path_load))
        first = min(first, _zero(load, path_load), pairs[k]["leaves"])
        sticks = turns and pairs[k]["static"] == 0 and pairs[k]["friction"] > 0
        sticks = sticks and _slip(pairs[k]) <= SLIDE_MIN
        if sticks and path_margin > CONE_CLOSE * path_load:
            first = min(first, _zero(margin, path_margin))
        elif sticks and sought and path_load > 0:
            # it slides in both laws: over a shorter time it may stick at first
            first = min(first, ONSET_SOUGHT)
    return first


@kernel
def _shares_load(pairs, count, k):
    """Whether another contact than that of row k is in its island."""
    island, manifold = pairs[k]["island"], pairs[k]["manifold"]
    for other in range(count):
        apart = other != k and (manifold < 0 or pairs[other]["manifold"] != manifold)
        if apart and pairs[other]["island"] == island:
            return True
    return False


@inlined_kernel
def _zero(p, q):
    """Fraction of the substep at which a force F + G s falls to 0, NEVER if it does not; the law of
    velocities finds its mean p = F + G / 2, that of positions, which weighs by the time left,
    q = F + G / 3."""
    return (3 * q - 2 * p) / (6 * (q - p)) if q > 0 and 4 * p < 3 * q else NEVER


@kernel
def slip_turn_share(bodies, pairs, count, state):
    """Share of the substep in which no sliding turns too far in an island with a driver; NEVER if that is
    longer than the substep."""
    most = 0.0
    for k in range(count):
        if is_led(bodies, pairs[k]):
            most = max(most, slip_turn(bodies, pairs[k], state))
    return SLIP_TURN_SHARE * SLIP_TURN / most if most > SLIP_TURN else NEVER


@inlined_kernel
def is_led(bodies, pair):
    """Whether a pair obeys the law of positions."""
    return bodies[pair["body_a"]]["led"] == 1 or bodies[pair["body_b"]]["led"] == 1


@kernel
def slip_turn(bodies, pair, state):
    """Turn of the direction in which a row slides over the substep [rad]; 0 if it does not slide throughout,
    in a crowd, on bodies on a coupling, and under friction beyond mu on bodies that are not prescribed. What
    slides back has stopped within (`first_stop`)."""
    p, slip, v = pair["resting_impulse"], _slip(pair), state["velocity"]
    follows = is_carried(state) or (state["statics"] + state["moments"] + pair["bent"] == 0)
    if not follows or pair["crowded"] == 1 or slip <= SLIDE_MIN or (p[0] == 0 and p[1] == 0 and p[2] == 0):
        return 0.0
    v_n = final_velocity(bodies, pair, state)
    across, along = sqrt(max(0.0, dot(v, v) - v_n * v_n)), along_slip(pair, v) / slip
    return acos(min(1.0, along / across)) if along > 0 and across > SLIDE_MIN else 0.0


@kernel
def first_onset(pairs, count, h, state):
    """Fraction of the substep at which the first contact that stuck before leaves its friction cone; NEVER if
    none does by the present forces, ONSET_SOUGHT if one slides already.

    Contacts change their forces within a substep where prescribed bodies accelerate. With F the mean force
    over it and G that until t = `last_time`, both as seen from the normal, the force at its time s
    is F + (F - G) (2 s - h) / (h - t).
    """
    first = NEVER
    for k in range(count):
        pair = pairs[k]
        if (pair["manifold"] >= 0 and pair["manifold"] != k) or (pair["crowded"] > state["statics"]):
            continue
        now, last, row = state["velocity_a"], state["velocity_b"], k
        now[:] = last[:] = 0.0
        while row >= 0:
            force = carried_along(pairs[row]["last_normal"], pair["normal"], pairs[row]["last_force"])
            for i in range(3):
                now[i] += pairs[row]["resting_impulse"][i] / h
                last[i] += force[i]
            row = pairs[row]["next_point"]
        n, mu = pair["normal"], max(pair["friction"], pair["static"])
        if mu == 0 or _cone(n, mu, last, last) >= -CONE_CLOSE * (mu * dot(n, last)) ** 2:
            continue
        released = pair["static"] > 0 and pair["grip"] == RELEASED
        if released or _cone(n, mu, now, now) >= -CONE_CLOSE * (mu * dot(n, now)) ** 2:
            return ONSET_SOUGHT
        for i in range(3):
            rate = (now[i] - last[i]) / (h - state["last_time"])
            now[i], last[i] = now[i] - h * rate, 2 * h * rate
        start, slope, bend = _cone(n, mu, now, now), _cone(n, mu, now, last), _cone(n, mu, last, last)
        square = slope * slope - start * bend
        if start < 0 and square >= 0 and slope + sqrt(square) > 0:
            first = min(first, -start / (slope + sqrt(square)))
    return first


@kernel
def _cone(n, mu, f, g):
    """Product of two forces that is negative of one with itself where it is inside its friction cone."""
    along = dot(n, f) * dot(n, g)
    return dot(f, g) - (1 + mu * mu) * along


@kernel
def _inverse_mass(bodies, pair):
    """Change of the relative velocity of two bodies that do not turn, per impulse [1/kg]."""
    return bodies[pair["body_a"]]["inverse_mass"] + bodies[pair["body_b"]]["inverse_mass"]


@kernel
def _separation(pair):
    """Separation speed along the normal before the contact solve [m/s]."""
    n, a, b = pair["normal"], pair["before_a"], pair["before_b"]
    return n[0] * (b[0] - a[0]) + n[1] * (b[1] - a[1]) + n[2] * (b[2] - a[2])


@kernel
def before_across(pair):
    """Sliding velocity before the contact solve [m/s]."""
    n, a, b, v_n = pair["normal"], pair["before_a"], pair["before_b"], _separation(pair)
    return b[0] - a[0] - v_n * n[0], b[1] - a[1] - v_n * n[1], b[2] - a[2] - v_n * n[2]


@kernel
def _slip(pair):
    """Sliding speed before the contact solve [m/s]."""
    x, y, z = before_across(pair)
    return sqrt(x * x + y * y + z * z)


@kernel
def along_slip(pair, vector):
    """Dot product of a vector and the sliding velocity before the contact solve."""
    x, y, z = before_across(pair)
    return vector[0] * x + vector[1] * y + vector[2] * z

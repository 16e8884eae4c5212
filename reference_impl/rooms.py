"""Rooms: what a moving piece has to itself for some frames, so that it need not be looked at in them.

A room is a box. A driven piece' is its own box, widened by where it will get as it goes now; a simulated
piece' is round all of its flight, however it turns. A driven link whose rooms meet no other's, and no fixed
piece, can meet nothing while every piece keeps to its own: it is `clear`, and its pieces are neither placed
nor listed. Where all simulated bodies are, their contacts are left out, where all driven ones are, the
removal of overlap. Nothing is taken for granted: every detection asks whether all are in their rooms still;
if not, all is looked at again. (Boxes with a margin: Verlet 1967, Computer "experiments" on classical fluids;
Catto 2019, Dynamic bounding volume hierarchies.)
"""

from math import sqrt

from reference_impl.broad_phase import find_pairs
from reference_impl.conventions import (
    DETECTION_SWEEP,
    DRIVEN,
    ROOM_FLIGHTS,
    ROOM_FRAMES,
    ROOM_PAD,
    ROOM_SHARE,
    ROOM_SLACK,
    ROOM_WAITS,
    SIMULATED,
    SPHERE,
    TOUCH_DISTANCE,
)
from reference_impl.kernel import kernel
from reference_impl.rotation import copy_vector
from reference_impl.shapes import place_piece
from reference_impl.skeleton import are_adjacent


@kernel
def begin_rooms(state):
    """No rooms yet; none are sought where sweeps look at ways, or where pieces are many."""
    many = state["groups"][SIMULATED]["few"] == 0 or state["groups"][DRIVEN]["few"] == 0
    if state["detection"] == DETECTION_SWEEP or many:
        state["seek_rooms"] = 0
    state["rooms"] = state["flight_clear"] = state["drive_clear"] = state["room_wait"] = 0
    state["room_flight"] = ROOM_FLIGHTS[1]


@kernel
def in_rooms(bodies, pieces, state):
    """Whether clear links, as they are posed, and all other moving pieces, as placed, keep to their rooms.

    No point of a link went farther than its origin did and the most distant one turned.
    """
    for b in range(len(bodies)):
        body = bodies[b]
        if body["clear"] == 1:
            turned = 0.0
            for i in range(3):
                moved = body["position"][i] - body["room_position"][i]
                if moved < body["room_low"][i] or moved > body["room_high"][i]:
                    return False
                for j in range(3):
                    turned += (body["rotation"][i, j] - body["room_rotation"][i, j]) ** 2
            if not sqrt(turned) * body["room_reach"] <= body["room_margin"]:
                return False
    for k in range(state["groups"][SIMULATED]["first"], state["groups"][DRIVEN]["end"]):
        piece = pieces[pieces[k]["order"]]
        for i in range(3):
            if piece["low"][i] < piece["room_low"][i] or piece["high"][i] > piece["room_high"][i]:
                return False
    return True


@kernel
def leave_rooms(bodies, pieces, state):
    """Nothing is clear any more; new rooms are sought at the end of the frame."""
    state["rooms"] = state["flight_clear"] = state["drive_clear"] = state["room_wait"] = 0
    _list_all(bodies, pieces, state)


@kernel
def _list_all(bodies, pieces, state):
    """No link counts as clear."""
    for b in range(len(bodies)):
        bodies[b]["clear"] = 0
    _list_driven(bodies, pieces, state)


@kernel
def _list_driven(bodies, pieces, state):
    """List the driven pieces that are not clear; the others are kept behind them."""
    group = state["groups"][DRIVEN]
    end = group["first"]
    for k in range(group["first"], len(pieces)):
        p = pieces[k]["order"]
        if bodies[pieces[p]["body"]]["clear"] == 0:
            pieces[k]["order"], pieces[end]["order"] = pieces[end]["order"], p
            end += 1
    group["end"], group["strips"] = end, 1 if end > group["first"] else 0
    if group["first"] < len(pieces):
        pieces[group["first"]]["strip"]["end"] = end


@kernel
def flies_clear(bodies, pieces, drivers, state):
    """Whether no simulated body can meet anything in the frame that begins, for which drivers have moved."""
    if state["flight_clear"] == 0 or (len(drivers) > 0 and not in_rooms(bodies, pieces, state)):
        return False
    return _has_flight(bodies, state)


@kernel
def _has_flight(bodies, state):
    """Whether simulated bodies have room for one frame more."""
    h, g = state["dt"], state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            for i in range(3):
                # at the frame's end, by either law of flight
                early = body["center"][i] + body["velocity"][i] * h
                late = early + g[i] * h * h
                if min(early, late) < body["room_low"][i] or max(early, late) > body["room_high"][i]:
                    return False
    return True


@kernel
def seek_rooms(bodies, pieces, vertices, drivers, pairs, state):
    """At the end of a frame: give all moving pieces rooms where that may spare something."""
    state["room_wait"] -= 1
    if state["flight_clear"] == 1 and not _has_flight(bodies, state):
        state["flight_clear"] = state["room_wait"] = 0
    flight = state["skip_contact"] == 0 and state["last_rows"] == 0
    drive = state["skip_removal"] == 0 and len(drivers) > 0
    enough = (state["flight_clear"] == 1 or not flight) and (state["drive_clear"] == 1 or not drive)
    if enough or state["room_wait"] > 0:
        return
    moving = state["groups"][SIMULATED]["first"]
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        # others are placed where they are
        if body["kind"] == SIMULATED or body["clear"] == 1:
            place_piece(piece, body, vertices, TOUCH_DISTANCE)
    # links that are clear stay so as long as bodies keep to their flights
    shortest = ROOM_FRAMES if drive else ROOM_FLIGHTS[0]
    state["room_flight"] = max(state["room_flight"], shortest)
    _list_all(bodies, pieces, state)
    _measure_links(bodies, pieces, moving, state)
    while True:
        _measure_flights(bodies, state)
        _widen(bodies, pieces, moving)
        _swap(pieces, moving)
        if not flight:
            break
        end, lost = find_pairs(pieces, SIMULATED, 0, pairs, state)
        if end + lost == 0:
            state["room_flight"] = min(2 * state["room_flight"], ROOM_FLIGHTS[1])
            break
        if state["room_flight"] < 2 * shortest:
            flight = False
            break
        _swap(pieces, moving)
        state["room_flight"] //= 2
    if drive:
        end, lost = find_pairs(pieces, DRIVEN, 0, pairs, state)
        drive = _clear_links(bodies, pairs, end)
        # what is lost may meet anything
        if lost > 0:
            drive = False
            _list_all(bodies, pieces, state)
    _swap(pieces, moving)
    _list_driven(bodies, pieces, state)
    state["flight_clear"], state["drive_clear"] = 1 if flight else 0, 1 if drive else 0
    state["rooms"] = state["flight_clear"]
    for b in range(len(bodies)):
        state["rooms"] |= bodies[b]["clear"]
    state["room_wait"] = ROOM_WAITS[1] if len(drivers) > 0 else ROOM_WAITS[0]


@kernel
def _measure_flights(bodies, state):
    """Where the centres of simulated bodies are in the next `room_flight` frames."""
    h, g = state["room_flight"] * state["dt"], state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            for i in range(3):
                x, v = body["center"][i], body["velocity"][i]
                end = x + v * h + g[i] * h * (h + state["dt"]) / 2
                top = x - v * v / (2 * g[i]) if v * g[i] < 0 and abs(v) < abs(g[i]) * h else x
                body["room_low"][i] = min(x, min(end, top)) - ROOM_PAD
                body["room_high"][i] = max(x, max(end, top)) + ROOM_PAD


@kernel
def _measure_links(bodies, pieces, moving, state):
    """How far the origins of driven links may move, and what turning may move their points, in ROOM_FRAMES
    frames as they go now, and some more; all links count as clear."""
    h = ROOM_FRAMES * state["dt"]
    for b in range(len(bodies)):
        bodies[b]["room_reach"] = 0.0
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        if body["kind"] == DRIVEN:
            body["clear"] = 1
            body["room_reach"] = max(body["room_reach"], _reach(piece, body["position"]))
    for b in range(len(bodies)):
        body = bodies[b]
        if body["clear"] == 1:
            copy_vector(body["position"], body["room_position"])
            v, w, x, y = body["velocity"], body["omega"], body["center"], body["position"]
            spin = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
            speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            slack = ROOM_SLACK + ROOM_SHARE * h * speed
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                way = h * (v[i] - w[j] * (x[k] - y[k]) + w[k] * (x[j] - y[j]))
                body["room_low"][i], body["room_high"][i] = min(way, 0.0) - slack, max(way, 0.0) + slack
                for j in range(3):
                    body["room_rotation"][i, j] = body["rotation"][i, j]
            body["room_margin"] = h * body["room_reach"] * spin + ROOM_SLACK


@kernel
def _reach(piece, point):
    """Distance of a placed piece' farthest point from a point of its body [m], or a bound on it."""
    if piece["kind"] == SPHERE:
        low = high = piece["world_position"]
        more = piece["radius"] + TOUCH_DISTANCE
    else:
        low, high, more = piece["low"], piece["high"], 0.0
    square = 0.0
    for i in range(3):
        square += max(point[i] - low[i], high[i] - point[i]) ** 2
    return sqrt(square) + more


@kernel
def _widen(bodies, pieces, moving):
    """Rooms of all moving pieces, listed from `moving` on."""
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        if body["kind"] == DRIVEN:
            for i in range(3):
                piece["room_low"][i] = piece["low"][i] + body["room_low"][i] - body["room_margin"]
                piece["room_high"][i] = piece["high"][i] + body["room_high"][i] + body["room_margin"]
        else:
            reach = _reach(piece, body["center"])
            for i in range(3):
                piece["room_low"][i] = body["room_low"][i] - reach
                piece["room_high"][i] = body["room_high"][i] + reach


@kernel
def _swap(pieces, moving):
    """Put rooms in place of boxes, or back."""
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        for i in range(3):
            piece["low"][i], piece["room_low"][i] = piece["room_low"][i], piece["low"][i]
            piece["high"][i], piece["room_high"][i] = piece["room_high"][i], piece["high"][i]


@kernel
def _clear_links(bodies, pairs, end):
    """Whether all driven links are clear; those in `pairs[:end]`, adjacent ones apart, are not."""
    all_clear = True
    for k in range(end):
        a, b = pairs[k]["body_a"], pairs[k]["body_b"]
        if not are_adjacent(bodies, a, b):
            bodies[a]["clear"] = bodies[b]["clear"] = 0
            all_clear = False
    return all_clear

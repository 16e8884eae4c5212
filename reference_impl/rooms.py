"""Rooms: what a moving piece has to itself for some frames, so that it need not be looked at in them.

A room is a box. A driven piece' is its own box, widened by how far it will get; a simulated piece' is round
all of its flight, however it turns. A driven link whose rooms meet no other's, and no fixed piece, can meet
nothing while every piece keeps to its own: it is `clear`, and its pieces stay where they were placed last.
Where all simulated bodies are, their contacts are left out, where all driven ones are, the removal of
overlap. Nothing is taken for granted: every detection asks whether all are in their rooms still; if not, all
is looked at again. (Boxes with a margin: Verlet 1967, Computer "experiments" on classical fluids; Catto 2019,
Dynamic bounding volume hierarchies.)
"""

from math import sqrt

from reference_impl.broad_phase import find_pairs
from reference_impl.conventions import (
    DETECTION_SWEEP,
    DRIVEN,
    ROOM_FLIGHTS,
    ROOM_FRAMES,
    ROOM_PAD,
    ROOM_SLACK,
    ROOM_WAIT,
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
    state["room_flight"] = ROOM_FLIGHTS[0]


@kernel
def place_in_rooms(bodies, pieces, vertices, kind, state):
    """Place the pieces of `kind` that are not clear; whether all moving pieces are in their rooms."""
    group = state["groups"][kind]
    for k in range(group["first"], group["end"]):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        if body["clear"] == 0:
            place_piece(piece, body, vertices, TOUCH_DISTANCE)
    return in_rooms(bodies, pieces, state)


@kernel
def in_rooms(bodies, pieces, state):
    """Whether clear links, as they are posed, and all other moving pieces, as placed, keep to their rooms.

    No point of a link went farther than its origin did and its most distant point turned.
    """
    for b in range(len(bodies)):
        body = bodies[b]
        if body["clear"] == 1:
            shift, turn = 0.0, 0.0
            for i in range(3):
                shift += (body["position"][i] - body["room_position"][i]) ** 2
                for j in range(3):
                    turn += (body["rotation"][i, j] - body["room_rotation"][i, j]) ** 2
            if not sqrt(shift) + sqrt(turn) * body["room_reach"] <= body["room_margin"]:
                return False
    for k in range(state["groups"][SIMULATED]["first"], len(pieces)):
        piece = pieces[pieces[k]["order"]]
        if bodies[piece["body"]]["clear"] == 0:
            for i in range(3):
                if piece["low"][i] < piece["room_low"][i] or piece["high"][i] > piece["room_high"][i]:
                    return False
    return True


@kernel
def leave_rooms(bodies, state):
    """Nothing is clear any more; new rooms are sought at the end of the frame."""
    state["rooms"] = state["flight_clear"] = state["drive_clear"] = state["room_wait"] = 0
    for b in range(len(bodies)):
        bodies[b]["clear"] = 0


@kernel
def flies_clear(bodies, pieces, drivers, state):
    """Whether no simulated body can meet anything in the frame that begins, for which drivers have moved."""
    if state["flight_clear"] == 0 or (len(drivers) > 0 and not in_rooms(bodies, pieces, state)):
        return False
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
    flight = state["skip_contact"] == 0 and state["last_rows"] == 0
    drive = state["skip_removal"] == 0 and len(drivers) > 0
    state["room_wait"] -= 1
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
    _measure(bodies, pieces, moving, state)
    _widen(bodies, pieces, moving)
    _swap(pieces, moving)
    wait = ROOM_WAIT
    if flight:
        end, lost = find_pairs(pieces, SIMULATED, 0, pairs, state)
        flight = end + lost == 0
        if flight:
            state["room_flight"] = min(2 * state["room_flight"], ROOM_FLIGHTS[1])
        else:
            # half as far is tried at once
            wait = 1 if state["room_flight"] > shortest else ROOM_WAIT
            state["room_flight"] = max(state["room_flight"] // 2, shortest)
    if drive:
        end, lost = find_pairs(pieces, DRIVEN, 0, pairs, state)
        drive = _clear_links(bodies, pairs, end)
    _swap(pieces, moving)
    state["flight_clear"], state["drive_clear"] = 1 if flight else 0, 1 if drive else 0
    state["rooms"] = state["flight_clear"]
    for b in range(len(bodies)):
        state["rooms"] |= bodies[b]["clear"]
    state["room_wait"] = wait


@kernel
def _measure(bodies, pieces, moving, state):
    """Where the centres of simulated bodies fly, and from where, and how far from their origins, driven links
    are to be in their rooms; all links count as clear."""
    h, g = state["room_flight"] * state["dt"], state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        body["clear"], body["room_reach"] = 0, 0.0
        if body["kind"] == SIMULATED:
            for i in range(3):
                x, v = body["center"][i], body["velocity"][i]
                end = x + v * h + g[i] * h * (h + state["dt"]) / 2
                top = x - v * v / (2 * g[i]) if v * g[i] < 0 and abs(v) < abs(g[i]) * h else x
                body["room_low"][i] = min(x, min(end, top)) - ROOM_PAD
                body["room_high"][i] = max(x, max(end, top)) + ROOM_PAD
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        if body["kind"] == DRIVEN:
            body["clear"] = 1
            body["room_reach"] = max(body["room_reach"], _reach(piece, body["position"]))
    h = ROOM_FRAMES * state["dt"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["clear"] == 1:
            v, w, speed, spin = body["velocity"], body["omega"], 0.0, 0.0
            copy_vector(body["position"], body["room_position"])
            for i in range(3):
                speed, spin = speed + v[i] * v[i], spin + w[i] * w[i]
                for j in range(3):
                    body["room_rotation"][i, j] = body["rotation"][i, j]
            body["room_margin"] = h * (sqrt(speed) + body["room_reach"] * sqrt(spin)) + ROOM_SLACK


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
                piece["room_low"][i] = piece["low"][i] - body["room_margin"]
                piece["room_high"][i] = piece["high"][i] + body["room_margin"]
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

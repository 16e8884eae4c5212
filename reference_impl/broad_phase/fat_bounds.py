"""Fat AABBs: bodies whose fat AABBs overlap no others skip collision checks for several frames.

The fat AABB of a driven piece is its box enlarged by its predicted motion at the present velocity; that of a
simulated piece encloses its whole ballistic flight in any orientation. A driven link is isolated if the fat
AABBs of its pieces overlap neither another body's nor a fixed piece. It cannot collide while every piece
stays inside its fat AABB, so its pieces are neither placed nor listed. If all simulated bodies are isolated,
the step skips their contacts; if all driven bodies are, it skips overlap removal. Every detection checks that
all pieces are still inside their fat AABBs, and drops these if one is not. (Verlet 1967, Computer
"experiments" on classical fluids; Catto 2019, Dynamic bounding volume hierarchies.)
"""

from math import sqrt

from touchstone.reference_impl.broad_phase.sweep_and_prune import find_pairs
from touchstone.reference_impl.core.conventions import (
    DETECTION_SWEEP,
    DRIVEN,
    SIMULATED,
    SPHERE,
    TOUCH_DISTANCE,
)
from touchstone.reference_impl.core.kernel import kernel
from touchstone.reference_impl.core.rotation import copy_vector
from touchstone.reference_impl.geometry.shapes import place_piece
from touchstone.reference_impl.kinematics.skeleton import are_adjacent

FAT_BOUNDS_FRAMES = 10
"""Frames of motion at the present velocity that the fat bounds of driven links cover."""
FAT_BOUNDS_MARGIN, FAT_BOUNDS_SPEED_SHARE = 2e-3, 0.1
"""Margin of driven links' fat bounds in translation and rotation [m], and margin over the predicted motion
[1]: velocities change."""
FLIGHT_HORIZONS = (2, 16)
"""Least and most frames of flight in simulated bodies' fat bounds: halved after an overlap, else doubled."""
FAT_BOUNDS_WAITS = (3, 12)
"""Frames until fat bounds are computed again, without and with drivers."""
FLIGHT_BOUNDS_PAD = 1e-4
"""Margin of a simulated body's centre beyond its predicted flight [m]: far above rounding."""


@kernel
def reset_fat_bounds(state):
    """Clear the fat bounds, and disable them for swept detection and for scenes that use the spatial hash."""
    many = state["groups"][SIMULATED]["single_column"] == 0 or state["groups"][DRIVEN]["single_column"] == 0
    if state["detection"] == DETECTION_SWEEP or many:
        state["update_fat_bounds"] = 0
    state["has_fat_bounds"] = state["simulated_isolated"] = state["driven_isolated"] = state[
        "fat_bounds_wait"
    ] = 0
    state["flight_horizon"] = FLIGHT_HORIZONS[1]


@kernel
def inside_fat_bounds(bodies, pieces, state):
    """Whether all moving pieces are inside their fat bounds: isolated links by pose, others by box.

    A point of a link moves at most as far as the link's origin, plus what rotation adds at `fat_reach`.
    """
    for b in range(len(bodies)):
        body = bodies[b]
        if body["isolated"] == 1:
            turned = 0.0
            for i in range(3):
                moved = body["position"][i] - body["fat_position"][i]
                if moved < body["fat_low"][i] or moved > body["fat_high"][i]:
                    return False
                for j in range(3):
                    turned += (body["rotation"][i, j] - body["fat_rotation"][i, j]) ** 2
            if not sqrt(turned) * body["fat_reach"] <= body["fat_margin"]:
                return False
    for k in range(state["groups"][SIMULATED]["first"], state["groups"][DRIVEN]["end"]):
        piece = pieces[pieces[k]["order"]]
        for i in range(3):
            if piece["low"][i] < piece["fat_low"][i] or piece["high"][i] > piece["fat_high"][i]:
                return False
    return True


@kernel
def drop_fat_bounds(bodies, pieces, state):
    """Discard all fat bounds; `update_fat_bounds` computes new ones at the end of the frame."""
    state["has_fat_bounds"] = state["simulated_isolated"] = state["driven_isolated"] = state[
        "fat_bounds_wait"
    ] = 0
    _activate_all(bodies, pieces, state)


@kernel
def _activate_all(bodies, pieces, state):
    """Mark all links as not isolated, and list their pieces."""
    for b in range(len(bodies)):
        bodies[b]["isolated"] = 0
    _list_active_links(bodies, pieces, state)


@kernel
def _list_active_links(bodies, pieces, state):
    """List the driven pieces of links that are not isolated; the others stay behind the end of the list."""
    group = state["groups"][DRIVEN]
    end = group["first"]
    for k in range(group["first"], len(pieces)):
        p = pieces[k]["order"]
        if bodies[pieces[p]["body"]]["isolated"] == 0:
            pieces[k]["order"], pieces[end]["order"] = pieces[end]["order"], p
            end += 1
    group["end"], group["columns"] = end, 1 if end > group["first"] else 0
    if group["first"] < len(pieces):
        pieces[group["first"]]["column"]["end"] = end


@kernel
def is_isolated(bodies, pieces, drivers, state):
    """Whether no simulated body can collide in the frame that begins; drivers have already moved."""
    if state["simulated_isolated"] == 0 or (
        len(drivers) > 0 and not inside_fat_bounds(bodies, pieces, state)
    ):
        return False
    return _stays_inside_next_frame(bodies, state)


@kernel
def _stays_inside_next_frame(bodies, state):
    """Whether the centres of simulated bodies stay inside their fat bounds for one more frame."""
    h, g = state["dt"], state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            for i in range(3):
                # position at the frame's end, by either flight law
                early = body["center"][i] + body["velocity"][i] * h
                late = early + g[i] * h * h
                if min(early, late) < body["fat_low"][i] or max(early, late) > body["fat_high"][i]:
                    return False
    return True


@kernel
def update_fat_bounds(bodies, pieces, vertices, drivers, pairs, state):
    """At the end of a frame: compute new fat bounds of all moving pieces if that can skip a stage."""
    state["fat_bounds_wait"] -= 1
    if state["simulated_isolated"] == 1 and not _stays_inside_next_frame(bodies, state):
        state["simulated_isolated"] = state["fat_bounds_wait"] = 0
    flight = state["skip_contact"] == 0 and state["last_rows"] == 0
    drive = state["skip_removal"] == 0 and len(drivers) > 0
    enough = (state["simulated_isolated"] == 1 or not flight) and (state["driven_isolated"] == 1 or not drive)
    if enough or state["fat_bounds_wait"] > 0:
        return
    moving = state["groups"][SIMULATED]["first"]
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        # the other pieces are already placed
        if body["kind"] == SIMULATED or body["isolated"] == 1:
            place_piece(piece, body, vertices, TOUCH_DISTANCE)
    # the flight horizon must last as long as the bounds of driven links
    shortest = FAT_BOUNDS_FRAMES if drive else FLIGHT_HORIZONS[0]
    state["flight_horizon"] = max(state["flight_horizon"], shortest)
    _activate_all(bodies, pieces, state)
    _bound_links(bodies, pieces, moving, state)
    while True:
        _bound_flights(bodies, state)
        _widen(bodies, pieces, moving)
        _swap(pieces, moving)
        if not flight:
            break
        end, lost = find_pairs(pieces, SIMULATED, 0, pairs, state)
        if end + lost == 0:
            state["flight_horizon"] = min(2 * state["flight_horizon"], FLIGHT_HORIZONS[1])
            break
        if state["flight_horizon"] < 2 * shortest:
            flight = False
            break
        _swap(pieces, moving)
        state["flight_horizon"] //= 2
    if drive:
        end, lost = find_pairs(pieces, DRIVEN, 0, pairs, state)
        drive = _isolate_links(bodies, pairs, end)
        # a dropped pair may contain any link
        if lost > 0:
            drive = False
            _activate_all(bodies, pieces, state)
    _swap(pieces, moving)
    _list_active_links(bodies, pieces, state)
    state["simulated_isolated"], state["driven_isolated"] = 1 if flight else 0, 1 if drive else 0
    state["has_fat_bounds"] = state["simulated_isolated"]
    for b in range(len(bodies)):
        state["has_fat_bounds"] |= bodies[b]["isolated"]
    state["fat_bounds_wait"] = FAT_BOUNDS_WAITS[1] if len(drivers) > 0 else FAT_BOUNDS_WAITS[0]


@kernel
def _bound_flights(bodies, state):
    """Bound the centres of simulated bodies during the next `flight_horizon` frames of ballistic flight."""
    h, g = state["flight_horizon"] * state["dt"], state["gravity"]
    for b in range(len(bodies)):
        body = bodies[b]
        if body["kind"] == SIMULATED:
            for i in range(3):
                x, v = body["center"][i], body["velocity"][i]
                end = x + v * h + g[i] * h * (h + state["dt"]) / 2
                top = x - v * v / (2 * g[i]) if v * g[i] < 0 and abs(v) < abs(g[i]) * h else x
                body["fat_low"][i] = min(x, min(end, top)) - FLIGHT_BOUNDS_PAD
                body["fat_high"][i] = max(x, max(end, top)) + FLIGHT_BOUNDS_PAD


@kernel
def _bound_links(bodies, pieces, moving, state):
    """Bound the translation of driven links' origins, and the arc of their points, over FAT_BOUNDS_FRAMES at
    the present velocities plus a margin; mark all links as isolated."""
    h = FAT_BOUNDS_FRAMES * state["dt"]
    for b in range(len(bodies)):
        bodies[b]["fat_reach"] = 0.0
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        if body["kind"] == DRIVEN:
            body["isolated"] = 1
            body["fat_reach"] = max(body["fat_reach"], _reach(piece, body["position"]))
    for b in range(len(bodies)):
        body = bodies[b]
        if body["isolated"] == 1:
            copy_vector(body["position"], body["fat_position"])
            v, w, x, y = body["velocity"], body["omega"], body["center"], body["position"]
            spin = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])
            speed = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
            slack = FAT_BOUNDS_MARGIN + FAT_BOUNDS_SPEED_SHARE * h * speed
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                way = h * (v[i] - w[j] * (x[k] - y[k]) + w[k] * (x[j] - y[j]))
                body["fat_low"][i], body["fat_high"][i] = min(way, 0.0) - slack, max(way, 0.0) + slack
                for j in range(3):
                    body["fat_rotation"][i, j] = body["rotation"][i, j]
            body["fat_margin"] = h * body["fat_reach"] * spin + FAT_BOUNDS_MARGIN


@kernel
def _reach(piece, point):
    """Upper bound on the distance of a placed piece's farthest point from a point of its body [m]."""
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
    """Fat AABBs of all moving pieces: those listed from index `moving`."""
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        body = bodies[piece["body"]]
        if body["kind"] == DRIVEN:
            for i in range(3):
                piece["fat_low"][i] = piece["low"][i] + body["fat_low"][i] - body["fat_margin"]
                piece["fat_high"][i] = piece["high"][i] + body["fat_high"][i] + body["fat_margin"]
        else:
            reach = _reach(piece, body["center"])
            for i in range(3):
                piece["fat_low"][i] = body["fat_low"][i] - reach
                piece["fat_high"][i] = body["fat_high"][i] + reach


@kernel
def _swap(pieces, moving):
    """Swap the boxes and the fat AABBs of all moving pieces."""
    for k in range(moving, len(pieces)):
        piece = pieces[pieces[k]["order"]]
        for i in range(3):
            piece["low"][i], piece["fat_low"][i] = piece["fat_low"][i], piece["low"][i]
            piece["high"][i], piece["fat_high"][i] = piece["fat_high"][i], piece["high"][i]


@kernel
def _isolate_links(bodies, pairs, end):
    """Whether all driven links are isolated; clears the flag of the non-adjacent pairs in `pairs[:end]`."""
    all_clear = True
    for k in range(end):
        a, b = pairs[k]["body_a"], pairs[k]["body_b"]
        if not are_adjacent(bodies, a, b):
            bodies[a]["isolated"] = bodies[b]["isolated"] = 0
            all_clear = False
    return all_clear

"""Conservative bounds on the motion of a scenario's bodies, by kinematics and by energy.

Fixed pieces do not move. Links of a driven body stay within LARGEST_DEVIATION and their coupling's
overshoot of their tracker's path, unless another person comes near, or they start deep in fixed pieces;
links of a chain stay in a ball about the chain's root. A simulated body without contacts flies in closed
form. A body with contacts is bounded by energy: impacts and friction remove energy, and gravity adds speed
at most at rate g to each group of bodies that can exchange it. Four kinds of bodies are unbounded: those
that a driven or prescribed body or a moving surface can touch, driven bodies that these can push,
mechanisms with springs or motors, and those that are not balls and touch others with both restitution and
friction, because Eqs. 8 and 10 as printed add energy at every impact. A run checks the bounds:
`Plan.broken`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import AdapterError, Array
from touchstone.scenarios.avatar.kinematics import hinges, link_poses, matrix, piece_box
from touchstone.scenarios.avatar.surface_motion import surface_moves
from touchstone.scenarios.avatar.tracking import sample
from touchstone.scenarios.body_joints import mechanisms
from touchstone.scenarios.effects import centred_ball
from touchstone.scenarios.plan import Bounds, Plan, box_gap, least_gap, plan
from touchstone.scenarios.scenario import (
    HALF_SPACE_REACH,
    TRACKED,
    Box,
    Capsule,
    Cone,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Hull,
    Piece,
    RoundedBox,
    RoundedHull,
    Scenario,
    Sphere,
    Tracker,
)
from touchstone.scenarios.solids import core_vertices

Indices = NDArray[np.intp]

LARGEST_DEVIATION = 0.3
"""Maximum deviation of a driven link from its tracker's path [m], through obstacles or inertia."""
DEEPEST_START = 0.1
"""Maximum depth in fixed pieces at the start, by bounding boxes [m], at which LARGEST_DEVIATION holds for
a driven body. Of 1,200 random persons 12 deviated farther, and all of them started at 0.14 m or more."""
POSTURE = 0.1
"""Maximum by which the distance of two links of one driven body may fall below the tracked one [m]."""
SLACK = 0.05
"""Maximum deviation of a simulated body from its closed form or its energy bound [m], in addition to the
error g h T / 2 of a first-order integrator with a step of one displayed frame."""
ENERGY_GAIN_FACTOR = 2.0
"""Factor on the speed of balls for laws that gain energy (friction always mu j) [1]."""
TOUCH = 1e-6
"""Margin about fixed pieces [m]: bodies touch up to this distance."""
LARGEST_PIECE_COUNT = 3000
"""Piece count beyond which all pieces are assumed to meet, because the test would take seconds."""


@lru_cache(maxsize=16)
def planned(scenario: Scenario, effects: tuple[str, ...] | None = None) -> Plan:
    """Plan of a scenario from its bounds; `effects` as in `scenarios.effects.plan`."""
    return plan(scenario, bounds(scenario), effects)


def bounds(scenario: Scenario) -> Bounds:
    """Boxes that contain the bodies' origins, and lower bounds on distances between bodies and pieces."""
    world = _World(scenario)
    body = world.body
    n, p = len(scenario.bodies), len(body)
    reach = np.zeros(n)
    np.maximum.at(reach, body, [extent(piece) for b in scenario.bodies for piece in b.pieces])
    low, high = world.position.copy(), world.position.copy()
    if p > LARGEST_PIECE_COUNT:
        return Bounds(body, reach, low - np.inf, high + np.inf, np.zeros((n, p)))
    own = _follow(scenario, reach, low, high)
    _start(scenario, world, low, high)
    _meet(scenario, reach, low, high)
    _fly(scenario, world, low, high)
    gap = _settle(scenario, world, reach, low, high)
    gap = np.where(np.isfinite(own[:, body]), own[:, body], gap)
    return Bounds(body, reach, low, high, gap)


def extent(piece: Piece) -> float:
    """Distance of a piece's farthest point from its body's origin [m], or an upper bound."""
    match piece.shape:
        case Sphere(radius):
            size = radius
        case Box(half_extents):
            size = float(np.linalg.norm(half_extents))
        case Capsule(radius, half_length):
            size = radius + half_length
        case Cylinder(radius, half_length) | Cone(radius, half_length):
            size = float(np.hypot(radius, half_length))
        case Ellipsoid(half_axes):
            size = max(half_axes)
        case Hull(vertices):
            size = float(np.linalg.norm(vertices, axis=1).max())
        case RoundedBox() | RoundedHull():
            size = float(np.linalg.norm(core_vertices(piece.shape), axis=1).max()) + piece.shape.radius
        case HalfSpace():
            size = HALF_SPACE_REACH
    return float(np.linalg.norm(piece.position)) + size


def _follow(scenario: Scenario, reach: Array, low: Array, high: Array) -> Array:
    """Set boxes of driven links' origins from their trackers; returns lower bounds on the distances between
    links of one driven body (n, n) [m], infinite elsewhere."""
    own = np.full((len(reach), len(reach)), np.inf)
    times = np.linspace(0.0, scenario.duration, scenario.frame_count + 1)
    for tracker in scenario.trackers:
        links = list(scenario.links(tracker))
        motion = sample(tracker, times)
        anchor, arm, chained = _anchors(scenario, tracker)
        near, which = np.unique(anchor, return_inverse=True)
        place, rotation = link_poses(scenario, tracker, motion.position, motion.orientation, motion.angle)
        if chained.any() and "self_collision" not in scenario.effects:
            _refuse_crossing(scenario, dict(zip(links, zip(place, rotation))), times)
        way = place[near]
        around = reach[links] + arm
        between = np.array([np.sqrt(((way - one) ** 2).sum(axis=-1).min(axis=1)) for one in way])
        # Account for the motion between frames.
        stride = np.linalg.norm(np.diff(way, axis=1), axis=-1).max(initial=0.0)
        own[np.ix_(links, links)] = (
            between[np.ix_(which, which)] - around[:, None] - around - POSTURE - stride
        )
        passing = stride * scenario.frame_rate * _overshoot(scenario, tracker)
        spread = (LARGEST_DEVIATION + passing + stride + arm)[:, None]
        low[links], high[links] = way.min(axis=1)[which] - spread, way.max(axis=1)[which] + spread
    return np.maximum(own, 0.0)


def _overshoot(scenario: Scenario, tracker: Tracker) -> float:
    """Largest deviation of a free driver over the speed of its tracker at which it has none [s]: what an
    obstacle held, and lets go, passes its tracker (Eq. 6, underdamped or critically damped)."""
    if scenario.prescribes(tracker):
        return 0.0
    mass = sum(scenario.bodies[k].mass for k in scenario.links(tracker))
    rate = float(np.sqrt(tracker.stiffness / mass))
    damped = min(tracker.damping / (2 * mass * rate), 1.0 - 1e-9)
    return float(np.exp(-damped * np.arccos(damped) / np.sqrt(1 - damped**2))) / rate


def _start(scenario: Scenario, world: _World, low: Array, high: Array) -> None:
    """Set no bounds for driven bodies that start deep in fixed pieces: overlap removal pushes them out of one
    piece after the other."""
    fixed = [scenario.bodies[k].kind == "fixed" for k in world.body]
    fixed_low, fixed_high = world.low[fixed], world.high[fixed]
    for tracker in scenario.trackers:
        links = list(scenario.links(tracker))
        first = sample(tracker, np.zeros(1))
        place, rotation = link_poses(scenario, tracker, first.position, first.orientation, first.angle)
        depth = np.zeros(len(fixed_low))
        for link, position, turned in zip(links, place, rotation):
            for piece in scenario.bodies[link].pieces:
                least, most = piece_box(piece, position[0], turned[0])
                ways = np.hstack([most - fixed_low, fixed_high - least])
                depth = np.maximum(depth, ways.min(axis=1))
        if depth.sum() > DEEPEST_START:
            low[links], high[links] = -np.inf, np.inf


def _meet(scenario: Scenario, reach: Array, low: Array, high: Array) -> None:
    """Set no bounds for persons whose boxes meet: trackers through each other push them aside by any way."""
    groups = [list(scenario.links(tracker)) for tracker in scenario.trackers if scenario.chains]
    boxes = [
        ((low[links] - reach[links, None]).min(axis=0), (high[links] + reach[links, None]).max(axis=0))
        for links in groups
    ]
    for (one, box), (two, other) in combinations(zip(groups, boxes), 2):
        if (box[0] <= other[1]).all() and (other[0] <= box[1]).all():
            low[[*one, *two]], high[[*one, *two]] = -np.inf, np.inf


def _refuse_crossing(scenario: Scenario, shown: Mapping[int, tuple[Array, Array]], times: Array) -> None:
    """Refuse a tracker whose links pass through each other without declared self-collision.

    If the inscribed balls of two pieces overlap, only contact between the links could keep them apart.
    """
    balls = {
        k: [(place + rotation @ piece.position, _inner(piece)) for piece in scenario.bodies[k].pieces]
        for k, (place, rotation) in shown.items()
    }
    declared = scenario.reduced(effects=(*scenario.effects, "self_collision"))
    for a, b in declared.touching_pairs():
        if a not in balls or b not in balls:
            continue
        for one, width in balls[a]:
            for two, other in balls[b]:
                gap = np.linalg.norm(one - two, axis=1) - width - other
                if gap.min() < 0:
                    names = f"{scenario.bodies[a].name!r} and {scenario.bodies[b].name!r}"
                    raise AdapterError(
                        f"effects: the tracker puts {names} {-gap.min():.2g} m into each other at "
                        f"{times[int(gap.argmin())]:.2f} s; declare 'self_collision', or keep them apart"
                    )


def _inner(piece: Piece) -> float:
    """Radius of a ball about a piece's origin inside the piece [m], or a lower bound."""
    match piece.shape:
        case Sphere(radius) | Capsule(radius, _):
            return radius
        case Box(half_extents):
            return min(half_extents)
        case Cylinder(radius, half_length):
            return min(radius, half_length)
        case Ellipsoid(half_axes):
            return min(half_axes)
        case Cone(radius, half_length):
            return radius * half_length / float(np.hypot(radius, 2 * half_length))
        case RoundedBox(half_extents, radius):
            return min(half_extents) + radius
        case Hull(_) | RoundedHull(_, _) | HalfSpace():
            return 0.0


def _anchors(scenario: Scenario, tracker: Tracker) -> tuple[Indices, Array, NDArray[np.bool_]]:
    """Anchor link of each link, by index in `links`; maximum distance of the origins [m]; whether it is in a
    chain.

    A link posed by its tracker anchors itself; a link posed by inverse kinematics is anchored to its chain's
    root, at the distance of the stretched chain.
    """
    named = {name for chain in scenario.chains for name in chain.joints}
    count = 1 + len(tracker.joints)
    anchor, arm, chained = np.arange(count), np.zeros(count), np.zeros(count, bool)
    for joint, inner, link in hinges(scenario, tracker):
        if chained[inner]:
            anchor[link] = anchor[inner]
            arm[link] = arm[inner] + np.linalg.norm(joint.position)
        chained[link] = chained[inner] or joint.name in named
    return anchor, arm, chained


class _World:
    """Arrays of n bodies and p pieces from which the bounds are computed."""

    def __init__(self, scenario: Scenario) -> None:
        bodies = scenario.bodies
        self.body = np.array([k for k, body in enumerate(bodies) for _ in body.pieces], np.intp)
        self.position = np.array([body.position for body in bodies])
        self.rotation = matrix(np.array([body.orientation for body in bodies]))
        self.arm = np.array([body.center_of_mass for body in bodies])
        self.center = self.position + np.einsum("nij,nj->ni", self.rotation, self.arm)
        self.velocity = np.array([body.linear_velocity for body in bodies])
        self.omega = np.array([body.angular_velocity for body in bodies])
        self.mass = np.array([body.mass for body in bodies])
        self.inertia = np.array([body.inertia for body in bodies])
        # Boxes of fixed pieces.
        self.low, self.high = np.zeros((len(self.body), 3)), np.zeros((len(self.body), 3))
        pieces = [piece for body in bodies for piece in body.pieces]
        for row, (k, piece) in enumerate(zip(self.body, pieces)):
            if bodies[k].kind == "fixed":
                low, high = piece_box(piece, self.position[k], self.rotation[k])
                self.low[row], self.high[row] = low - TOUCH, high + TOUCH


def _fly(scenario: Scenario, world: _World, low: Array, high: Array) -> None:
    """Set boxes of simulated bodies' origins in free flight."""
    g, end = np.array(scenario.acting_gravity), scenario.duration
    slack = SLACK + float(np.linalg.norm(g)) * end / (2 * scenario.frame_rate)
    for k in np.flatnonzero([b.kind == "simulated" for b in scenario.bodies]):
        v = world.velocity[k]
        top = np.clip(np.divide(-v, g, out=np.zeros(3), where=g != 0), 0.0, end)
        way = np.array([np.zeros(3), v * top + g * top**2 / 2, v * end + g * end**2 / 2])
        around = np.linalg.norm(world.arm[k]) + slack
        low[k] = world.center[k] + way.min(axis=0) - around
        high[k] = world.center[k] + way.max(axis=0) + around


def _settle(scenario: Scenario, world: _World, reach: Array, low: Array, high: Array) -> Array:
    """Widen the boxes of simulated bodies that can meet others until no further pairs can meet; returns lower
    bounds on the distances between bodies and pieces (n, p) [m]."""
    kind = np.array([b.kind for b in scenario.bodies])
    drives = np.array([b.kind in TRACKED or surface_moves(b) for b in scenario.bodies])
    body = world.body
    may = np.zeros((len(kind), len(kind)), bool)
    pairs = np.array(list(scenario.touching_pairs()), dtype=np.intp).reshape(-1, 2)
    may[pairs[:, 0], pairs[:, 1]] = may[pairs[:, 1], pairs[:, 0]] = True
    loose = [scenario.links(tracker) for tracker in scenario.trackers if not scenario.prescribes(tracker)]
    group = np.arange(len(kind))
    state = np.zeros(len(kind), np.intp)  # of a group: 0 free flight, 1 bounded by energy, 2 unbounded
    _join(scenario, group, state)
    _spread(scenario, world, group, state, low, high)
    while True:
        gap = _gaps(world, kind, reach, low, high)
        meets = may & (least_gap(gap, body) <= 0)
        before = (group.copy(), state.copy(), np.isinf(low).sum())
        for k in np.flatnonzero(kind == "simulated"):
            others = np.flatnonzero(meets[k])
            if len(others):
                endless = drives[others].any() or _gains(scenario, int(k), others)
                state[group[k]] = max(state[group[k]], 2 if endless else 1)
                pushed = [link for links in loose if np.isin(others, links).any() for link in links]
                low[pushed], high[pushed] = -np.inf, np.inf
            for other in others[kind[others] == "simulated"]:
                one, two = group[k], group[other]
                group[group == two] = one
                state[one] = max(state[one], state[two])
        same = np.array_equal(before[0], group) and np.array_equal(before[1], state)
        if same and before[2] == np.isinf(low).sum():
            return gap
        _spread(scenario, world, group, state, low, high)


def _join(scenario: Scenario, group: Indices, state: NDArray[np.int_]) -> None:
    """Group the bodies of each mechanism: bounded by energy, or unbounded if springs, motors or a prescribed
    body move it."""
    index = {body.name: k for k, body in enumerate(scenario.bodies)}
    for joints in mechanisms(scenario):
        ends = [index[name] for joint in joints for name in (joint.parent, joint.child) if name]
        moved = [k for k in ends if scenario.bodies[k].kind == "simulated"]
        driven = any(scenario.bodies[k].kind == "prescribed" for k in ends)
        driven |= any(joint.stiffness or joint.damping * joint.target_rate for joint in joints)
        group[moved], state[moved] = moved[0], 2 if driven else 1


def _gains(scenario: Scenario, k: int, others: Indices) -> bool:
    """Whether the printed laws can add energy at a body's contacts.

    This needs restitution, friction and a normal force that turns the body: Newton's e with mu j makes a rod
    faster at every impact.
    """
    if centred_ball(scenario.bodies[k]):
        return False
    return any(min(scenario.pair_coefficients(*sorted((k, int(other))))) > 0 for other in others)


def _gaps(world: _World, kind: NDArray[np.str_], reach: Array, low: Array, high: Array) -> Array:
    """Distances between the boxes of all bodies and all pieces (n, p) [m]; 0 if they overlap."""
    body = world.body
    fixed = (kind == "fixed")[body, None]
    piece_low = np.where(fixed, world.low, low[body] - reach[body, None])
    piece_high = np.where(fixed, world.high, high[body] + reach[body, None])
    return box_gap(low - reach[:, None], high + reach[:, None], piece_low, piece_high)


def _spread(
    scenario: Scenario,
    world: _World,
    group: NDArray[np.intp],
    state: NDArray[np.int_],
    low: Array,
    high: Array,
) -> None:
    """Set boxes of simulated bodies by the energy of their group.

    Let V^2 = sum(m v^2 + w.I w) over a group of total mass M. Gravity adds at most g sqrt(M) t to V, and
    impacts only reduce it, so a body moves at most at V / sqrt(m).
    """
    g, end = float(np.linalg.norm(scenario.acting_gravity)), scenario.duration
    for one in np.unique(group[state[group] > 0]):
        members = np.flatnonzero(group == one)
        spins = []
        for k in members:
            omega = world.omega[k] @ world.rotation[k]
            spins.append(omega @ world.inertia[k] @ omega)
        mass, center = world.mass[members], world.center[members]
        total = np.sqrt(float((mass * (world.velocity[members] ** 2).sum(axis=1)).sum() + np.sum(spins)))
        path = ENERGY_GAIN_FACTOR * (total * end + g * np.sqrt(mass.sum()) * end**2 / 2)
        around = path / np.sqrt(mass) + np.linalg.norm(world.arm[members], axis=1) + SLACK
        if state[one] == 2:
            around[:] = np.inf
        low[group == one] = center - around[:, None]
        high[group == one] = center + around[:, None]

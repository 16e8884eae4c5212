"""A robot as simulated bodies that joints connect, under gravity: on a free root, on a fixed base, or on the
world."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.adapters.robots.checks.posture import posture
from touchstone.adapters.robots.driven import Parts, free_name
from touchstone.adapters.robots.link_body import body_of
from touchstone.adapters.robots.links import FREE, Link, TreeBuilder, combined, joints_of
from touchstone.adapters.robots.motors import Drive, forces, notes_of
from touchstone.adapters.robots.pieces import PieceMaker, geoms_of, masks_allow, may_touch, quaternion
from touchstone.adapters.robots.source import Source
from touchstone.scenarios.avatar.kinematics import piece_box
from touchstone.scenarios.body_joints import WORLD
from touchstone.scenarios.plural import plural
from touchstone.scenarios.scenario import Body, BodyJoint, vector

HOLD_FREQUENCY = 20.0
"""Frequency of the servos that hold the start posture [rad/s]: under gravity, a load whose centre is r away
turns by g / (r frequency^2), 2.8 degrees at r = 0.5 m."""
SOLE = 0.01
"""Height above its lowest point up to which a robot stands on its links [m]."""
DEPTH = 1e-4
"""Overlap of two links at the start that excludes their contact [m]: engines would throw them apart."""


@dataclass(frozen=True, slots=True)
class Simulated:
    """How a robot becomes simulated bodies: with servos that `hold` the start posture, on a `fixed_base`."""

    hold: bool = False
    fixed_base: bool = False


@dataclass(slots=True)
class _Tree:
    """Links of a tree with their poses at the start, the joints' coordinates there, and what stands still."""

    links: list[Link]
    places: list[Array]
    turns: list[Array]
    start: list[float]
    still: bool


def add_mechanism(
    source: Source,
    body: int,
    maker: PieceMaker,
    drives: dict[int, list[Drive]],
    way: Simulated,
    parts: Parts,
    notes: list[str],
) -> None:
    """Add what hangs on the world by one body as simulated bodies and the joints between them."""
    model = source.model
    kinds = [int(model.jnt_type[joint]) for joint in joints_of(model, body)]
    on_world = bool(kinds) and FREE not in kinds
    builder = TreeBuilder(model, notes, simulated=True)
    builder.add_root(body, WORLD if on_world else None)
    links = builder.links
    still = on_world or (len(links) > 1 and (way.fixed_base or (not kinds and _stands(source))))
    tree = _posed(links, still, parts.coupled)
    bodies: list[Body] = []
    for k, link in enumerate(links):
        if k == 0 and on_world:
            continue
        link.name = free_name(link.name, [one.name for one in (*parts.bodies, *bodies)])
        bodies.append(_body(tree, k, maker, notes))
    if still and not on_world and not bodies[0].pieces:
        bodies, links[0].name = bodies[1:], WORLD
    if len(links) == 1 and not bodies[0].pieces:
        notes.append(f"left out: body {bodies[0].name!r}, which has neither joints nor a shape that collides")
        return
    carried = _carried(tree, bodies) if way.hold else [None] * len(links)
    for k, link in enumerate(links[1:], start=1):
        link.joint = free_name(link.joint, [joint.name for joint in parts.body_joints])
        parts.start[link.source] = tree.start[k]
        parts.body_joints.append(_joint(model, tree, k, drives, carried[k]))
    for link in links:
        parts.geoms[link.name] = (body, [geom for one in link.members for geom in geoms_of(model, one.body)])
    parts.bodies += bodies
    parts.standing |= {one.name for one in bodies} if still else set()
    alone = [link.source for link in links[1:] if link.kind != "ball"]
    notes += notes_of(model, alone, drives, way.hold)
    balls = ", ".join(repr(link.joint) for link in links[1:] if link.kind == "ball")
    if way.hold and balls:
        notes.append(f"hold: ball joints {balls} have no servos")


def _stands(source: Source) -> bool:
    """Whether a root without joints stands still: of MJCF always, of URDF on a link called world."""
    return source.form == "mjcf" or any(
        one.tag == "link" and one.attributes.get("name") == "world" for one in source.root.children
    )


def _posed(links: list[Link], still: bool, starts: Mapping[int, float]) -> _Tree:
    """Poses of all links at the start: joints are as in `starts`, else at 0 or the limit next to it."""
    tree = _Tree(links, [links[0].place], [links[0].turn], [0.0], still)
    for link in links[1:]:
        place, turn = tree.places[link.parent], tree.turns[link.parent]
        q = starts.get(link.source, float(np.clip(0.0, *link.limits)))
        at = place + turn @ link.place
        if link.kind == "slider":
            at = at + turn @ link.axis * q
        own = Rotation.from_rotvec(link.axis * (q if link.kind == "hinge" else 0.0)).as_matrix()
        tree.places.append(at)
        tree.turns.append(turn @ own @ link.turn)
        tree.start.append(q)
    return tree


def _body(tree: _Tree, k: int, maker: PieceMaker, notes: list[str]) -> Body:
    """Simulated body of a link, or a fixed one of a root that stands still."""
    pose: dict[str, Any] = {
        "position": vector(tree.places[k]),
        "orientation": quaternion(Rotation.from_matrix(tree.turns[k])),
    }
    if k > 0 or not tree.still:
        return replace(body_of(tree.links[k], maker, notes, is_root=k == 0), kind="simulated", **pose)
    found = body_of(tree.links[k], maker, [], is_root=True)
    return Body(found.name, "fixed", "robot", found.pieces, **pose)


def _joint(
    model: Any, tree: _Tree, k: int, drives: dict[int, list[Drive]], carried: float | None
) -> BodyJoint:
    link = tree.links[k]
    parent, turn, q = tree.links[link.parent], tree.turns[link.parent], tree.start[k]
    fields: dict[str, Any] = {
        "name": link.joint, "type": link.kind, "parent": parent.name, "child": link.name,
        "anchor": vector(tree.places[k]),
    }  # fmt: skip
    if link.kind == "ball":
        damping = float(model.dof_damping[int(model.jnt_dofadr[link.source])].flat[0])
        return BodyJoint(**fields, damping=damping)
    axis = turn @ link.axis
    low, high = link.limits
    start = q + float(model.qpos0[model.jnt_qposadr[link.source]])
    fields |= forces(model, link.source, start, drives.get(link.source, []), carried, HOLD_FREQUENCY)
    along = vector(axis / np.linalg.norm(axis))
    return BodyJoint(**fields, axis=along, lower=low - q, upper=high - q)


def _carried(tree: _Tree, bodies: list[Body]) -> list[float]:
    """What the servo of each link's joint carries: the moment of inertia about its axis [kg m^2], or the mass
    [kg], of what lies beyond it as seen from the ground or the base."""
    links, count = tree.links, len(tree.links)
    named = {body.name: body for body in bodies}
    lows = [
        min((piece_box(piece, place, turn)[0][2] for piece in named[link.name].pieces), default=np.inf)
        if link.name in named
        else np.inf
        for link, place, turn in zip(links, tree.places, tree.turns)
    ]
    stands = [not tree.still and low <= min(lows) + SOLE for low in lows]
    masses = [link.mass.moved(place, turn) for link, place, turn in zip(links, tree.places, tree.turns)]
    found = [0.0]
    for k in range(1, count):
        below = {k}
        for other in range(k + 1, count):
            if links[other].parent in below:
                below.add(other)
        if any(stands[one] for one in below):
            below = set(range(count)) - below
        whole = combined([masses[one] for one in sorted(below)])
        axis = tree.turns[links[k].parent] @ links[k].axis
        is_slider = links[k].kind == "slider"
        found.append(whole.mass if is_slider else float(axis @ whole.about(tree.places[k]) @ axis))
    return found


def add_exclusions(maker: PieceMaker, parts: Parts, notes: list[str]) -> None:
    """Exclude the contacts of bodies that the model lets pass through each other, and of links of one robot
    that overlap at the start."""
    model = maker.model
    joined = {frozenset((joint.parent, joint.child)) for joint in parts.body_joints}
    shaped = [body for body in parts.bodies if body.pieces]
    depths, mixed = _overlaps(maker, parts, joined), 0
    apart: set[frozenset[str]] = set()
    for one, other in combinations(shaped, 2):
        pair = frozenset((one.name, other.name))
        if one.kind == other.kind == "fixed":
            continue
        (tree, first), (other_tree, second) = parts.geoms[one.name], parts.geoms[other.name]
        allowed = may_touch if tree == other_tree else masks_allow
        found = {allowed(model, a, b) for a in first for b in second}
        mixed += len(found) > 1 and pair not in joined
        if tuple(sorted(pair)) in depths or found == {False}:
            apart.add(pair)
    for tree in dict.fromkeys(tree for tree, _ in parts.geoms.values()):
        names = [body.name for body in shaped if body.kind != "fixed" and parts.geoms[body.name][0] == tree]
        pairs = set(map(frozenset, combinations(names, 2)))
        if len(names) > 2 and pairs <= apart | joined:
            parts.contact_exclusions.append(tuple(names))
            apart -= pairs
    order = {body.name: k for k, body in enumerate(parts.bodies)}
    pairs_left = [tuple(sorted(pair, key=order.__getitem__)) for pair in apart - joined]
    parts.contact_exclusions += sorted(pairs_left, key=lambda pair: [order[name] for name in pair])
    over = [f"{a!r} and {b!r} by {depth * 1e3:.2g} mm" for (a, b), depth in depths.items()]
    if over:
        more = f", and {len(over) - 5} more" if len(over) > 5 else ""
        notes.append(f"contacts: links that overlap at the start do not touch: {', '.join(over[:5])}{more}")
    if mixed:
        notes.append(f"contacts: all shapes of {plural(mixed, 'pair')} of bodies touch; in the model, some")


def _overlaps(maker: PieceMaker, parts: Parts, joined: set[frozenset[str]]) -> dict[tuple[str, str], float]:
    """Largest depth at the start [m] of the links of each robot that overlap and that no joint connects."""
    qpos = maker.model.qpos0.copy()
    for joint, q in parts.start.items():
        qpos[maker.model.jnt_qposadr[joint]] += q
    owner = {geom: name for name, (_, geoms) in parts.geoms.items() for geom in geoms}
    found: dict[tuple[str, str], float] = {}
    for contact in posture(maker.model, maker, "the start", qpos).data.contact:
        names = [owner.get(int(geom), "") for geom in contact.geom]
        if contact.dist < -DEPTH and all(names) and parts.geoms[names[0]][0] == parts.geoms[names[1]][0]:
            pair = (min(names), max(names))
            if names[0] != names[1] and frozenset(pair) not in joined:
                found[pair] = max(found.get(pair, 0.0), -float(contact.dist))
    return found

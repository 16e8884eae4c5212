"""Overlap, tunnelling and hovering, by the overlap oracle; and rest: speed, settling and drift of bodies."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, measured, worst
from touchstone.reports.metrics.posture import Mask, pressed
from touchstone.scenarios.scenario import UNMOVED, Body, Box, Piece
from touchstone.scenarios.truths.pair_names import PairName

REST_SPEED = 1e-2
"""Speed below which a body rests [m/s]."""
SUPPORT_REACH = 5e-3
"""Gap within which a body supports one at rest, or holds a pressed one [m]: five times the widest margin."""
FEWEST = 5
"""Least number of frames of a median [1]."""


def overlap_max(context: Context) -> Values:
    """Deepest convex-pair depth of any frame [m]."""
    return {"": float(overlap_depth(context).max())}


def overlap_p95(context: Context) -> Values:
    """95th percentile over the frames of the deepest convex-pair depth [m]."""
    return {"": float(np.percentile(overlap_depth(context), 95))}


def overlap_depth(context: Context) -> Array:
    """Deepest convex-pair depth per frame (f,) [m]."""
    if not context.distances.distance:
        raise NotMeasured("no two bodies may touch")
    return context.distances.overlap()


def overlap_time(context: Context) -> Values:
    """Sum over body pairs of the deepest depth, integrated over the run [m s]."""
    depths = [np.maximum(0.0, -d) for d in context.distances.near]
    return {"": float(np.sum(depths) * context.frame)}


def contact_gap(context: Context) -> Values:
    """Median signed distance of a body at rest, carried, pushed or pressed, to its support [m]; truth 0.

    Covers a simulated body that rests on a fixed body, or moves with a prescribed one; a simulated body that
    a driven one carries or pushes, by the nearest link that presses; and a driven body, by its nearest link,
    in the frames in which its tracker has a link inside a fixed or driven body. What is carried or pushed,
    and what joints may hold over its support, counts in the frames before and after which the engine reports
    normal impulses of the pair, however far apart they are.
    """
    found: dict[str, float | Value] = {**_resting_gaps(context), **_carried_gaps(context)}
    found |= _pressed_gaps(context)
    reason = "no body rests on a fixed or prescribed one, none is pressed, carried or pushed"
    return measured(found, reason)


def _carried_gaps(context: Context) -> dict[str, Value]:
    """Gaps between driven bodies and the simulated ones that they carry or push, by the name of the root."""
    nearest: dict[str, Array] = {}
    for pair in context.pair_rows:
        if {context.kind[body] for body in pair} == {"driven", "simulated"}:
            gap = np.where(_loaded(context, pair), context.distances.distance[pair], np.inf)
            name = context.owner_pair(*pair)
            nearest[name] = np.minimum(nearest.get(name, np.inf), gap)
    kept = {name: gap[np.isfinite(gap)] for name, gap in nearest.items()}
    return {
        name: Value(float(np.median(gap)), f"{np.percentile(np.abs(gap), 95):.2g} m in one of 20 frames")
        for name, gap in kept.items()
        if len(gap) >= FEWEST
    }


def _loaded(context: Context, pair: tuple[int, int]) -> Mask:
    """Frames (f,) before and after which the engine reports normal impulses of a pair."""
    steps = np.zeros(len(context.recording.time) + 1, dtype=bool)
    if pair in context.pair_rows:
        rows = context.pair_rows[pair]
        pressing = context.impulses[0][rows] > context.least_impulse[rows]
        steps[1 + context.contact_frame[rows[pressing]]] = True
    return steps[:-1] & steps[1:]


def _resting_gaps(context: Context) -> dict[str, float]:
    found: dict[str, float] = {}
    joined = {name for joint in context.scenario.body_joints for name in (joint.parent, joint.child)}
    rests = [
        (body, other, pair, distance)
        for pair, distance in context.distances.distance.items()
        for body, other in (pair, pair[::-1])
        if context.kind[body] == "simulated" and context.kind[other] in UNMOVED
    ]
    for body, other, pair, distance in sorted(rests, key=lambda one: one[0]):
        normal = context.distances.normal[pair]
        carried = context.material_velocity(other, context.mass_centers[:, body], normal)
        speed = np.linalg.norm(context.recording.linear_velocity[:, body] - carried, axis=1)
        resting = (speed < REST_SPEED) & (np.abs(distance) < SUPPORT_REACH)
        if context.scenario.bodies[body].name in joined:
            resting &= _loaded(context, pair)
        if resting.sum() >= FEWEST:
            found[context.pair_name(*pair)] = float(np.median(distance[resting]))
    return found


def _pressed_gaps(context: Context) -> dict[str, float]:
    """Gaps between each driven body and each body that it is pressed into; links have their root's name."""
    gaps: dict[PairName, list[tuple[Array, Mask]]] = {}
    for tracker in context.scenario.trackers:
        links = context.scenario.links(tracker)
        for other, deep in pressed(context, tracker).items():
            pairs = [(min(link, other), max(link, other)) for link in links if link != other]
            near = [context.distances.distance[p] for p in pairs if p in context.distances.distance]
            name = context.owner_pair(*sorted((links[0], other)))
            gaps.setdefault(name, []).append((np.min(near, axis=0), deep))
    found: dict[str, float] = {}
    for name, sides in gaps.items():
        nearest = np.min([np.where(deep, gap, np.inf) for gap, deep in sides], axis=0)
        held = np.abs(nearest) < SUPPORT_REACH
        if held.sum() >= FEWEST:
            found[name] = float(np.median(nearest[held]))
    return found


def overlap_tunnelled(context: Context) -> Values:
    """Number of times a body passed through a fixed or moving one and was apart on its other side [1]."""
    if not any(True for _ in context.scenario.touching_pairs()):
        raise NotMeasured("no two bodies may touch")
    found = passages(context)
    if not found:
        return {"": 0.0}
    first = found[0]
    names = [context.scenario.bodies[k].name for k in (first.a, first.b)]
    return {"": Value(float(len(found)), f"first {' through '.join(names)} at {first.time:.3f} s")}


LAST = 0.5
"""Length of the end of a run over which speeds are averaged [s]: a brief push does not end rest."""


def rest_speed(context: Context) -> Values:
    """Largest distance of a body from its place half a second before the end, over that time [m/s]."""
    _require(context)
    c, names = context.mass_centers, [body.name for body in context.scenario.bodies]
    before = c[-1 - round(LAST / context.frame)]
    away = np.linalg.norm(c[-1] - before, axis=1) / LAST
    return worst({names[k]: float(away[k]) for k in context.simulated})


def rest_lost(context: Context) -> Values:
    """Number of bodies that end outside the bounding box of the fixed ones [1]."""
    _require(context)
    corners = np.concatenate([_corners(body) for body in context.scenario.bodies if body.kind == "fixed"])
    end = context.mass_centers[-1, context.simulated]
    inside = (end > corners.min(axis=0)) & (end < corners.max(axis=0))
    return {"": float((~inside.all(axis=1)).sum())}


def rest_settled(context: Context) -> Values:
    """Largest distance of the centre of mass of a resting body from its closed form in the first half of the
    run [m]: what a soft contact gives; truth 0."""
    return worst({name: float(away.max()) for name, (away, _) in _resting(context).items()})


def rest_drift(context: Context) -> Values:
    """Largest distance of the centre of mass of a resting body, in the second half of the run, from its place
    half way [m]; truth 0."""
    return worst({name: float(moved.max()) for name, (_, moved) in _resting(context).items()})


def _resting(context: Context) -> dict[str, tuple[Array, Array]]:
    """Bodies at rest by the scene's truth: distances from it in the first half (f / 2,) [m], and from the
    place half way in the second (f / 2,) [m]."""
    found = {}
    for truth in context.scenario.truths:
        if truth.arcs and not any(any((*arc.velocity, *arc.acceleration)) for arc in truth.arcs):
            body = context.scenario.body_index(truth.body)
            places = context.mass_centers[:, body]
            away = np.linalg.norm(places - context.truths[body].position, axis=1)
            middle = len(places) // 2
            half = places[middle:]
            found[truth.body] = away[: middle + 1], np.linalg.norm(half - half[0], axis=1)
    return measured(found, "by the scene's truth no body rests all the time")


def _require(context: Context) -> None:
    if "settles" not in context.scenario.tags:
        raise NotMeasured("nothing has to come to rest")
    if len(context.recording.time) <= context.scenario.frame_count:
        raise NotMeasured("the end was not played")


def _corners(body: Body) -> Array:
    """World corners (8 n, 3) of a body's boxes [m]."""
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
    found = [np.zeros((0, 3))]
    for piece in body.pieces:
        if isinstance(piece.shape, Box):
            found.append(_posed(body, _posed(piece, signs * piece.shape.half_extents)))
    return np.concatenate(found)


def _posed(pose: Body | Piece, points: Array) -> Array:
    turned = Rotation.from_quat(np.array(pose.orientation), scalar_first=True)
    return np.asarray(turned.apply(points) + pose.position)

"""Metrics of bodies that come to rest: speed, place, bodies lost."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Context, NotMeasured, Values, worst
from touchstone.scenarios.scenario import Body, Box, Piece

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
    if not found:
        raise NotMeasured("by the scene's truth no body rests all the time")
    return found


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

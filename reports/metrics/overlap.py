"""Overlap, tunnelling and hovering, by the overlap oracle."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from adapters.engine import Array
from reports.metrics.evidence import Evidence, NotMeasured, Values
from scenarios.scenario import Box, Hull, Piece

REST_SPEED = 1e-2
"""Speed below which a body rests [m/s]."""
SUPPORT_REACH = 5e-3
"""Gap within which a fixed body counts as the support of one at rest [m]: five of the widest margins."""


def overlap_max(evidence: Evidence) -> Values:
    """Deepest convex-pair depth of any frame [m]."""
    return {"": float(overlap_depth(evidence).max())}


def overlap_p95(evidence: Evidence) -> Values:
    """95th percentile over the frames of the deepest convex-pair depth [m]."""
    return {"": float(np.percentile(overlap_depth(evidence), 95))}


def overlap_depth(evidence: Evidence) -> Array:
    """Deepest convex-pair depth per frame (f,) [m]."""
    if not evidence.distances.distance:
        raise NotMeasured("no two bodies may touch")
    return evidence.distances.overlap()


def overlap_time(evidence: Evidence) -> Values:
    """Sum over body pairs of the deepest depth, integrated over the run [m s]."""
    depths = [np.maximum(0.0, -d) for d in evidence.distances.distance.values()]
    return {"": float(np.sum(depths) * evidence.frame)}


def contact_gap(evidence: Evidence) -> Values:
    """Median signed distance of a body at rest to the fixed body under it [m]; truth 0."""
    found = {}
    for body in evidence.simulated:
        speed = np.linalg.norm(evidence.recording.linear_velocity[:, body], axis=1)
        for (a, b), distance in evidence.distances.distance.items():
            other = b if a == body else a
            if body not in (a, b) or evidence.kind[other] != "fixed":
                continue
            resting = (speed < REST_SPEED) & (np.abs(distance) < SUPPORT_REACH)
            if resting.sum() >= 5:
                found[evidence.pair_name(a, b)] = float(np.median(distance[resting]))
    if not found:
        raise NotMeasured("no body rests on a fixed one")
    return found


def overlap_tunnelled(evidence: Evidence) -> Values:
    """Number of passages of a simulated body's centre of mass through a fixed piece within one frame [1]."""
    passages = 0
    for body in evidence.simulated:
        path = evidence.mass_centers[:, body]
        for other, fixed in enumerate(evidence.scenario.bodies):
            if fixed.kind != "fixed":
                continue
            turned = Rotation.from_quat(np.array(fixed.orientation), scalar_first=True)
            local = turned.inv().apply(path - np.array(fixed.position))
            passages += sum(_passages(piece, local) for piece in evidence.scenario.bodies[other].pieces)
    return {"": float(passages)}


def _passages(piece: Piece, path: Array) -> int:
    """Segments of a path (f, 3) that enter and leave a piece, or end inside it after starting outside."""
    turned = Rotation.from_quat(np.array(piece.orientation), scalar_first=True)
    local = turned.inv().apply(path - np.array(piece.position))
    planes = _planes(piece)
    if planes is None:
        return 0
    heights = local @ planes[:, :3].T + planes[:, 3]
    start, end = heights[:-1], heights[1:]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = start / (start - end)
    enter = np.where((start > 0) & (end <= 0), crossing, -np.inf).max(axis=1)
    leave = np.where((start <= 0) & (end > 0), crossing, np.inf).min(axis=1)
    outside = ((start > 0) & (end > 0)).any(axis=1)
    return int((~outside & (enter > 0) & (enter < leave)).sum())


def _planes(piece: Piece) -> Array | None:
    """Outward planes (k, 4) of a box or a hull; None for round pieces: not looked at."""
    match piece.shape:
        case Box(half_extents):
            normals = np.vstack([np.eye(3), -np.eye(3)])
            return np.column_stack([normals, -np.tile(half_extents, 2)])
        case Hull(vertices):
            return np.asarray(ConvexHull(np.array(vertices)).equations)
        case _:
            return None

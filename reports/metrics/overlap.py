"""Overlap, tunnelling and hovering, by the overlap oracle."""

from __future__ import annotations

import numpy as np

from adapters.engine import Array
from reports.metrics.evidence import Evidence, NotMeasured, Value, Values
from reports.metrics.passages import passages

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
    """Number of times a body passed through another, fixed or moving, and was apart on its other side [1]."""
    if not any(True for _ in evidence.scenario.touching_pairs()):
        raise NotMeasured("no two bodies may touch")
    found = passages(evidence)
    if not found:
        return {"": 0.0}
    first = found[0]
    names = [evidence.scenario.bodies[k].name for k in (first.a, first.b)]
    return {"": Value(float(len(found)), f"first {' through '.join(names)} at {first.time:.3f} s")}

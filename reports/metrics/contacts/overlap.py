"""Overlap, tunnelling and hovering, by the overlap oracle."""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.contacts.passages import passages
from touchstone.reports.metrics.context import Evidence, NotMeasured, Value, Values
from touchstone.reports.metrics.tracked import Mask, pressed

REST_SPEED = 1e-2
"""Speed below which a body rests [m/s]."""
SUPPORT_REACH = 5e-3
"""Gap within which a body supports one at rest, or holds a pressed one [m]: five times the widest margin."""
FEWEST = 5
"""Least number of frames of a median [1]."""


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
    """Median signed distance of a body at rest, or pressed by its tracker, to its support [m]; truth 0.

    Covers a simulated body that rests on a fixed one; and a driven body, by its nearest link, in the frames
    in which its tracker has a link inside a fixed or driven body.
    """
    found = {**_resting_gaps(evidence), **_pressed_gaps(evidence)}
    if not found:
        raise NotMeasured("no body rests on a fixed one, and none is pressed")
    return found


def _resting_gaps(evidence: Evidence) -> dict[str, float]:
    found = {}
    for body in evidence.simulated:
        speed = np.linalg.norm(evidence.recording.linear_velocity[:, body], axis=1)
        for (a, b), distance in evidence.distances.distance.items():
            other = b if a == body else a
            if body not in (a, b) or evidence.kind[other] != "fixed":
                continue
            resting = (speed < REST_SPEED) & (np.abs(distance) < SUPPORT_REACH)
            if resting.sum() >= FEWEST:
                found[evidence.pair_name(a, b)] = float(np.median(distance[resting]))
    return found


def _pressed_gaps(evidence: Evidence) -> dict[str, float]:
    """Gaps between each driven body and each body that it is pressed into; links have their root's name."""
    gaps: dict[str, list[tuple[Array, Mask]]] = {}
    for tracker in evidence.scenario.trackers:
        links = evidence.scenario.links(tracker)
        for other, deep in pressed(evidence, tracker).items():
            pairs = [(min(link, other), max(link, other)) for link in links if link != other]
            near = [evidence.distances.distance[p] for p in pairs if p in evidence.distances.distance]
            name = evidence.owner_pair(*sorted((links[0], other)))
            gaps.setdefault(name, []).append((np.min(near, axis=0), deep))
    found = {}
    for name, sides in gaps.items():
        nearest = np.min([np.where(deep, gap, np.inf) for gap, deep in sides], axis=0)
        held = np.abs(nearest) < SUPPORT_REACH
        if held.sum() >= FEWEST:
            found[name] = float(np.median(nearest[held]))
    return found


def overlap_tunnelled(evidence: Evidence) -> Values:
    """Number of times a body passed through a fixed or moving one and was apart on its other side [1]."""
    if not any(True for _ in evidence.scenario.touching_pairs()):
        raise NotMeasured("no two bodies may touch")
    found = passages(evidence)
    if not found:
        return {"": 0.0}
    first = found[0]
    names = [evidence.scenario.bodies[k].name for k in (first.a, first.b)]
    return {"": Value(float(len(found)), f"first {' through '.join(names)} at {first.time:.3f} s")}

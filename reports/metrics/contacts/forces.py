"""Contact forces, friction and sliding of pairs.

Contact forces per pair of bodies: the normal impulses that an engine reports, over displayed frames.

A frame's force is the sum of its normal impulses over its duration, so that engines with different steps
compare. Links count as their driven body.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import product
from math import atan2, cos, sin

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import ROUNDING as STARTS
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, measured, worst
from touchstone.scenarios.scenario import Arc, Box, Sphere
from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.named_pairs import named_pairs
from touchstone.scenarios.truths.pair_names import PairName
from touchstone.scenarios.truths.published import Published, members


def contact_forces(context: Context) -> dict[str, Array]:
    """Normal force per pair that presses (s,) [N], in the displayed steps; in the order of the bodies."""
    pressing = np.maximum(context.impulses[0], 0.0)
    found: dict[str, Array] = {}
    for pair, mine in context.pair_rows.items():
        if pressing[mine].any():
            steps = context.contact_frame[mine]
            impulse = np.bincount(steps, pressing[mine], minlength=len(context.recording.time) - 1)
            name = context.owner_pair(*pair)
            found[name] = found.get(name, 0.0) + impulse / context.frame
    return found


def force_series(context: Context) -> dict[str, Array]:
    """`contact_forces` at the end of each step (f,) [N]; NaN at the start, before any step."""
    return {name: np.concatenate(([np.nan], force)) for name, force in contact_forces(context).items()}


def _of_pairs(context: Context, figure: Callable[[Array], float]) -> Values:
    found = {name: figure(force) for name, force in contact_forces(context).items()}
    return measured(found, "no contact presses")


def force_mean(context: Context) -> Values:
    """Mean normal force of a pair over the frames in which it presses [N]."""
    return _of_pairs(context, lambda force: float(force[force != 0].mean()))


def force_peak(context: Context) -> Values:
    """Largest normal force of a pair, as the mean over a displayed frame [N]."""
    return _of_pairs(context, lambda force: float(force.max()))


def force_impulse(context: Context) -> Values:
    """Integral of the normal force of a pair over the run [N s]."""
    return _of_pairs(context, lambda force: float(force.sum() * context.frame))


def force_error(context: Context) -> Values:
    """Normal force or impulse of a pair over its closed form, less 1 [1]; truth 0; the worst window."""
    if not context.scenario.forces:
        raise NotMeasured("the scene states no force")
    played = len(context.recording.time) - 1
    found: dict[str, Value] = {}
    for truth in context.scenario.forces:
        first, end = truth.frames(context.scenario.frame_rate)
        if end > played:
            raise NotMeasured("the end was not played")
        value = _mean_force(context, named_pairs(context.scenario, truth.body, truth.other), first, end)
        unit = "N"
        if truth.quantity == "impulse":
            value, unit = value * (end - first) * context.frame, "N s"
        error = value / truth.value - 1
        text = f"{value:.6g} of {truth.value:.6g} {unit} from {truth.start:g} to {truth.end:g} s"
        name = PairName(truth.body, truth.other)
        if name not in found or abs(error) > abs(found[name].value):
            found[name] = Value(error, text)
    return found


def force_between(context: Context, one: Published) -> float:
    """The published mean normal force as measured [N]."""
    names = [body.name for body in context.scenario.bodies]
    sides = members(one.body, names), members(one.other, names)
    pairs = {(min(pair), max(pair)) for pair in product(*sides)}
    window = ForceTruth(one.body, one.other, one.start, one.end, one.value)
    return _mean_force(context, pairs, *window.frames(context.scenario.frame_rate))


def _mean_force(context: Context, pairs: Iterable[tuple[int, int]], first: int, end: int) -> float:
    """Mean normal force of pairs over the steps from `first` to `end` - 1 [N]."""
    rows = _rows(context, pairs)
    rows = rows[(context.contact_frame[rows] >= first) & (context.contact_frame[rows] < end)]
    return float(np.maximum(context.impulses[0][rows], 0.0).sum() / ((end - first) * context.frame))


def _rows(context: Context, pairs: Iterable[tuple[int, int]]) -> NDArray[np.int64]:
    """Contact rows of pairs, in time order."""
    found = [context.pair_rows[pair] for pair in pairs if pair in context.pair_rows]
    return np.sort(np.concatenate(found)) if found else np.zeros(0, dtype=np.int64)


SLIDING_SPEED = 0.05
"""Slip above which a contact slides [m/s]."""

ROUNDING = 1e-15
"""Tangential share of an impulse that rounding of its normal may cause [1]: about five roundings."""


def friction_cone(context: Context) -> Values:
    """Largest max(0, sum |j_t| - mu sum j_n) / (mu sum j_n + j_0) of a pair in a native step [1]; truth 0.

    The sums are over the pair's points, whose shares of the load are not determined. In a step in which the
    pair does not press (sum j_n <= j_0) the divisor is the pair's median load, to avoid division by almost
    zero.
    """
    rows = context.recording.contacts
    if not len(rows):
        raise NotMeasured("the engine reports no contact")
    limit, tangential = _bounds(context)
    normal = np.maximum(context.impulses[0], 0.0)
    step = np.floor(rows["time"] / float(context.recording.facts["dt"]) + STARTS).astype(np.int64)
    found: dict[str, float] = {}
    for pair, mine in context.pair_rows.items():
        _, group = np.unique(step[mine], return_inverse=True)
        load, bound, friction = (np.bincount(group, x[mine]) for x in (normal, limit, tangential))
        least = context.least_impulse[mine][0]
        usual = float(np.median(bound[load > least])) if (load > least).any() else 0.0
        excess = np.maximum(0.0, friction - bound) / (np.where(load > least, bound, usual) + least)
        found[context.pair_name(*pair)] = float(excess.max())
    return worst(found)


def friction_cone_point(context: Context) -> Values:
    """Largest max(0, |j_t| - mu j_n) / (mu j_n + j_0) of any contact point [relative]; truth 0."""
    if not len(context.recording.contacts):
        raise NotMeasured("the engine reports no contact")
    limit, tangential = _bounds(context)
    excess = np.maximum(0.0, tangential - limit)
    return {"": float(np.max(excess / (limit + context.least_impulse)))}


def _bounds(context: Context) -> tuple[Array, Array]:
    """Per contact row mu j_n, with the static coefficient if there is one, and |j_t| less the tangential
    rounding of a frictionless impulse [N s]."""
    normal, tangential = context.impulses
    limit = context.most_friction * np.maximum(normal, 0.0)
    rounding = ROUNDING * np.linalg.norm(context.recording.contacts["impulse"], axis=1)
    return limit, np.asarray(np.maximum(0.0, np.linalg.norm(tangential, axis=1) - rounding))


def friction_deficit(context: Context) -> Values:
    """1 - |j_t| / (mu j_n) on sliding contacts, weighted by j_n, per pair [1]; truth 0."""
    normal, tangential = context.impulses
    found = {}
    for pair, chosen in _sliding(context).items():
        limit = (context.friction * normal)[chosen].sum()
        found[pair] = float(1 - np.linalg.norm(tangential[chosen], axis=1).sum() / limit)
    return found


def friction_direction(context: Context) -> Values:
    """Angle between j_t and the reversed sliding velocity, same contacts, weighted by j_n [rad]; truth 0."""
    normal, tangential = context.impulses
    found, slip = {}, context.slip("after")
    for pair, chosen in _sliding(context).items():
        across = np.linalg.norm(np.cross(tangential[chosen], -slip[chosen]), axis=1)
        along = np.einsum("ij,ij->i", tangential[chosen], -slip[chosen])
        found[pair] = float(np.average(np.arctan2(across, along), weights=normal[chosen]))
    return found


def _sliding(context: Context) -> dict[str, NDArray[np.int64]]:
    """Rows that press and slide before and after, of pairs with friction; links have their root's name. What
    slides back after has stopped in between, or rolls: its material passes the point of contact at rest."""
    normal, _ = context.impulses
    before, after = context.slip("before"), context.slip("after")
    sliding = np.minimum(np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)) > SLIDING_SPEED
    sliding &= np.einsum("ij,ij->i", before, after) > 0
    sliding &= (normal > context.least_impulse) & (context.friction > 0)
    pairs: dict[str, list[tuple[int, int]]] = {}
    for pair in context.pair_rows:
        pairs.setdefault(context.owner_pair(*pair), []).append(pair)
    found: dict[str, NDArray[np.int64]] = {}
    for name in sorted(pairs):
        rows = _rows(context, pairs[name])
        if sliding[rows].any():
            found[name] = rows[sliding[rows]]
    return measured(found, f"no contact slides faster than {SLIDING_SPEED} m/s")


SUPPORTED = 1e-4
"""Initial gap within which a body lies on a fixed one [m]."""
ALONG = 1e-9
"""Share of a motion along the support's normal up to which it is tangential [1]: rounding."""
STOPPED = 0.05
"""Speed below which a sliding body has stopped [m/s]; creep is slower."""
COASTS = 0.3
"""Least speed at release for which the coasting distance is measured [m/s]: 1.5 cm with mu = 0.3."""
TURNED = 0.1
"""Turn beyond which a box no longer slides as a point does [rad]: 1 % of the friction at its corners then
acts sideways."""
SLIDING = 0.1
"""Share of its first slip above which a ball surely slides [1]; the fit of slip over time ends there."""


def friction_stop(context: Context) -> Values:
    """Stopping distance of the centre of mass against the closed form [relative]; truth 0."""
    found = {}
    for name, body, arcs in _paths(context):
        if not _rests(arcs[-1]) or np.dot(arcs[0].velocity, arcs[0].acceleration) >= 0:
            continue
        way = np.array(arcs[-1].position) - np.array(arcs[0].position)
        c = context.mass_centers[:, body]
        found[name] = float((c[-1] - c[0]) @ way / (way @ way) - 1)
    return measured(found, "no body slides until it stops")


def friction_coast(context: Context) -> Values:
    """Distance that a box slides after a driven body releases it, over v^2 / (2 mu g), less 1 [1].

    Truth 0 for a box that slides flat on a level floor. v is its speed at the end of the last frame in which
    it is driven. Not measured for a box that is then slower than COASTS, that tilts or turns by more than
    TURNED afterwards, or that does not stop.
    """
    rows, driven = context.recording.contacts, np.array(context.kind) == "driven"
    by_hand = driven[rows["body_a"]] | driven[rows["body_b"]]
    velocity, centers = context.recording.linear_velocity, context.mass_centers
    found, reason = {}, "no box that a driven body pushed slides on by itself"
    for body in context.simulated:
        pieces = context.scenario.bodies[body].pieces
        if len(pieces) != 1 or not isinstance(pieces[0].shape, Box):
            continue
        mine = (rows["body_a"] == body) | (rows["body_b"] == body)
        if not (mine & by_hand).any():
            continue
        free = int(context.contact_frame[mine & by_hand].max()) + 1
        mu = np.unique(context.friction[mine & (context.contact_frame >= free)])
        speed = float(np.linalg.norm(velocity[free, body]))
        if len(mu) != 1 or speed <= COASTS or np.linalg.norm(velocity[-1, body]) >= STOPPED:
            continue
        turned = Rotation.from_quat(context.recording.orientation[free:, body], scalar_first=True)
        if (turned * turned[0].inv()).magnitude().max() > TURNED:
            reason = "the box turns or topples after it is let go"
            continue
        way = float(np.linalg.norm(centers[-1, body] - centers[free, body]))
        gravity = float(np.linalg.norm(context.gravity))
        found[context.scenario.bodies[body].name] = float(way * 2 * mu[0] * gravity / speed**2 - 1)
    return measured(found, reason)


def friction_lift(context: Context) -> Values:
    """Largest rise of the centre of mass of a body that should lie or slide flat [m]; truth 0."""
    found = {}
    for name, body, normal in _flat(context):
        c = context.mass_centers[:, body]
        found[name] = float(np.max((c - c[0]) @ normal))
    return worst(measured(found, "no body slides or lies flat on a fixed one"))


def friction_tilt(context: Context) -> Values:
    """Largest angle by which a body that should stay flat leaves the support's normal [rad]; truth 0."""
    found = {}
    for name, body, normal in _flat(context):
        turned = Rotation.from_quat(context.recording.orientation[:, body], scalar_first=True)
        up = (turned * turned[0].inv()).apply(normal)
        found[name] = float(np.max(np.arctan2(np.linalg.norm(np.cross(up, normal), axis=1), up @ normal)))
    return worst(measured(found, "no body slides or lies flat on a fixed one"))


def friction_creep(context: Context) -> Values:
    """Mean speed over the second half of the time since a body that should stick has stopped [m/s]; truth 0.

    A body that should slide first has stopped once its speed stays below STOPPED; `friction.stop` measures
    how far it slid until then. A body that should stick from the start counts at any speed.
    """
    found, slides = {}, []
    time = context.recording.time
    for name, body, arcs in _paths(context):
        if not _rests(arcs[-1]) or "impact" in context.scenario.tags:
            continue
        start, c = arcs[-1].start, context.mass_centers[:, body]
        if start > 0:
            fast = np.linalg.norm(np.diff(c, axis=0), axis=1) > STOPPED * context.frame
            start = max([start, *time[1:][fast]])
        first = int(np.searchsorted(time, (start + time[-1]) / 2))
        if first >= len(time) - 1:
            slides.append(name)
            continue
        found[name] = float(np.linalg.norm(c[-1] - c[first]) / (time[-1] - time[first]))
    reason = f"{', '.join(slides)} still slides at the end" if slides else "no body should stick"
    return worst(measured(found, reason))


def friction_heading(context: Context) -> Values:
    """Largest difference between paths that differ only in heading, over the path length [1]; truth 0."""
    if "headings" not in context.scenario.tags:
        raise NotMeasured("the scene has one heading")
    ways = []
    for _, body, arcs in _paths(context):
        turn = -atan2(arcs[0].velocity[1], arcs[0].velocity[0])
        back = np.array([[cos(turn), -sin(turn), 0.0], [sin(turn), cos(turn), 0.0], [0.0, 0.0, 1.0]])
        c = context.mass_centers[:, body]
        ways.append((c - c[0]) @ back.T)
    apart = np.linalg.norm(np.ptp(ways, axis=0), axis=1)
    return {"": float(apart.max() / np.linalg.norm(np.mean(ways, axis=0)[-1]))}


def rolling_time(context: Context) -> Values:
    """Time at which slip ends, by a linear fit of the slip, over the closed form, less 1 [relative]."""
    found = {}
    time = context.recording.time
    for name, body, arcs in _paths(context):
        shape = context.scenario.bodies[body].pieces[0].shape
        if len(arcs) != 2 or not isinstance(shape, Sphere) or not any(arcs[0].angular_acceleration):
            continue
        down = context.gravity / np.linalg.norm(context.gravity) * shape.radius
        v, w = context.recording.linear_velocity[:, body], context.recording.angular_velocity[:, body]
        slip = np.linalg.norm(v + np.cross(w, down), axis=1)
        ends = np.flatnonzero(slip <= SLIDING * slip[0])
        last = int(ends[0]) if len(ends) else len(slip)
        # With constant friction, slip is linear in time, so a fit of few frames is exact.
        slope, start = np.polyfit(time[:last], slip[:last], 1) if last > 1 else (0.0, slip[0])
        found[name] = float(-start / slope / arcs[1].start - 1) if slope < 0 else float("inf")
    return measured(found, "no ball slides until it rolls")


def _paths(context: Context) -> list[tuple[str, int, tuple[Arc, ...]]]:
    """Name, index and arcs of the bodies whose closed form consists of arcs."""
    truths = [truth for truth in context.scenario.truths if truth.law == "arcs"]
    return [(t.body, context.scenario.body_index(t.body), t.arcs) for t in truths]


def _rests(arc: Arc) -> bool:
    return not any((*arc.velocity, *arc.acceleration, *arc.angular_velocity, *arc.angular_acceleration))


def _flat(context: Context) -> list[tuple[str, int, Array]]:
    """Name, index and support normal of bodies that lie on a fixed box and should never turn or leave it."""
    found = []
    d = context.distances
    for name, body, arcs in _paths(context):
        for (a, b), gap in d.distance.items():
            other = b if a == body else a
            if body not in (a, b) or context.kind[other] != "fixed" or abs(gap[0]) > SUPPORTED:
                continue
            normal = _face(context, other, d.normal[a, b][0] * (1 if b == body else -1))
            motion = np.array([(arc.velocity, arc.acceleration) for arc in arcs]).reshape(-1, 3)
            turns = any(any((*arc.angular_velocity, *arc.angular_acceleration)) for arc in arcs)
            if not turns and np.all(np.abs(motion @ normal) <= ALONG * np.linalg.norm(motion, axis=1)):
                found.append((name, body, normal))
    return found


def _face(context: Context, body: int, near: Array) -> Array:
    """The axis of a box nearest to a direction; the oracle's normal of touching faces is good to 1e-3."""
    turned = Rotation.from_quat(context.recording.orientation[0, body], scalar_first=True)
    piece = Rotation.from_quat(context.scenario.bodies[body].pieces[0].orientation, scalar_first=True)
    axes = (turned * piece).as_matrix()
    k = int(np.argmax(np.abs(axes.T @ near)))
    return np.asarray(axes[:, k] * np.sign(axes[:, k] @ near))

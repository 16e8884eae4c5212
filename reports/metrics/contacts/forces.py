"""Contact forces and friction of pairs, from the impulses that an engine reports."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import ROUNDING as STARTS
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, worst
from touchstone.scenarios.truths.force_truth import ForceTruth
from touchstone.scenarios.truths.named_pairs import named_pairs


def contact_forces(context: Context) -> dict[str, Array]:
    """Normal force per pair that presses (s,) [N], in the displayed steps; in the order of the bodies."""
    met, which = context.met
    pressing = np.maximum(context.impulses[0], 0.0)
    found: dict[str, Array] = {}
    for k, pair in enumerate(met):
        mine = which == k
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
    if not found:
        raise NotMeasured("no contact presses")
    return found


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
        value = _mean_force(context, truth, first, end)
        unit = "N"
        if truth.quantity == "impulse":
            value, unit = value * (end - first) * context.frame, "N s"
        error = value / truth.value - 1
        text = f"{value:.6g} of {truth.value:.6g} {unit} from {truth.start:g} to {truth.end:g} s"
        name = f"{truth.body}-{truth.other}"
        if name not in found or abs(error) > abs(found[name].value):
            found[name] = Value(error, text)
    return found


def _mean_force(context: Context, truth: ForceTruth, first: int, end: int) -> float:
    """Mean normal force of a pair of names over the steps from `first` to `end` - 1 [N]."""
    wanted = named_pairs(context.scenario, truth.body, truth.other)
    met, which = context.met
    rows = np.isin(which, [k for k, pair in enumerate(met) if pair in wanted])
    rows &= (context.contact_frame >= first) & (context.contact_frame < end)
    return float(np.maximum(context.impulses[0][rows], 0.0).sum() / ((end - first) * context.frame))


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
    found = {}
    for pair in sorted(set(zip(rows["body_a"].tolist(), rows["body_b"].tolist()))):
        mine = (rows["body_a"] == pair[0]) & (rows["body_b"] == pair[1])
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
    """Per contact row mu j_n, and |j_t| less the tangential rounding of a frictionless impulse [N s]."""
    normal, tangential = context.impulses
    limit = context.friction * np.maximum(normal, 0.0)
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
    found = {}
    for pair, chosen in _sliding(context).items():
        against = -context.slip("after")[chosen]
        across = np.linalg.norm(np.cross(tangential[chosen], against), axis=1)
        along = np.einsum("ij,ij->i", tangential[chosen], against)
        found[pair] = float(np.average(np.arctan2(across, along), weights=normal[chosen]))
    return found


def _sliding(context: Context) -> dict[str, Array]:
    """Rows that press and slide before and after, of pairs with friction; links have their root's name."""
    normal, _ = context.impulses
    before = np.linalg.norm(context.slip("before"), axis=1)
    after = np.linalg.norm(context.slip("after"), axis=1)
    sliding = np.minimum(before, after) > SLIDING_SPEED
    sliding &= (normal > context.least_impulse) & (context.friction > 0)
    met, which = context.met
    names = np.array([context.owner_pair(a, b) for a, b in met], dtype=str)[which]
    found = {str(name): sliding & (names == name) for name in np.unique(names[sliding])}
    if not found:
        raise NotMeasured(f"no contact slides faster than {SLIDING_SPEED} m/s")
    return found

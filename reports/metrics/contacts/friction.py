"""Violations of Coulomb's law per contact, from reported impulses and audited velocities and normals."""

from __future__ import annotations

import numpy as np

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import ROUNDING as STARTS
from touchstone.reports.metrics.context import Context, NotMeasured, Values, worst

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

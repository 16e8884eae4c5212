"""Coulomb's law, contact by contact; impulses are the engine's word, velocities and normals are audited."""

from __future__ import annotations

import numpy as np

from adapters.engine import Array
from reports.metrics.evidence import Evidence, NotMeasured, Values

SLIDING_SPEED = 0.05
"""Slip above which a contact slides [m/s]."""

ROUNDING = 1e-15
"""Share of an impulse that rounding of its normal may turn across it [1]: some five roundings."""


def friction_cone(evidence: Evidence) -> Values:
    """Largest max(0, |j_t| - mu j_n) / (mu j_n + j_0) of any contact [relative]; truth 0."""
    if not len(evidence.recording.contacts):
        raise NotMeasured("no contact")
    normal, tangential = evidence.impulses
    limit = evidence.friction * np.maximum(normal, 0.0)
    # what is left across the normal of a frictionless impulse by rounding is no friction
    rounding = ROUNDING * np.linalg.norm(evidence.recording.contacts["impulse"], axis=1)
    excess = np.maximum(0.0, np.linalg.norm(tangential, axis=1) - limit - rounding)
    return {"": float(np.max(excess / (limit + evidence.least_impulse)))}


def friction_deficit(evidence: Evidence) -> Values:
    """1 - |j_t| / (mu j_n) on sliding contacts, weighted by j_n, per pair [1]; truth 0."""
    normal, tangential = evidence.impulses
    found = {}
    for pair, chosen in _sliding(evidence).items():
        limit = (evidence.friction * normal)[chosen].sum()
        found[pair] = float(1 - np.linalg.norm(tangential[chosen], axis=1).sum() / limit)
    return found


def friction_direction(evidence: Evidence) -> Values:
    """Angle between j_t and the reverse sliding velocity, same contacts, weighted by j_n [rad]; truth 0."""
    normal, tangential = evidence.impulses
    found = {}
    for pair, chosen in _sliding(evidence).items():
        against = -evidence.slip("after")[chosen]
        across = np.linalg.norm(np.cross(tangential[chosen], against), axis=1)
        along = np.einsum("ij,ij->i", tangential[chosen], against)
        found[pair] = float(np.average(np.arctan2(across, along), weights=normal[chosen]))
    return found


def _sliding(evidence: Evidence) -> dict[str, Array]:
    """Rows that press and slide before and after, with friction in the pair; links by their root's name."""
    rows = evidence.recording.contacts
    normal, _ = evidence.impulses
    before = np.linalg.norm(evidence.slip("before"), axis=1)
    after = np.linalg.norm(evidence.slip("after"), axis=1)
    sliding = np.minimum(before, after) > SLIDING_SPEED
    sliding &= (normal > evidence.least_impulse) & (evidence.friction > 0)
    names = np.array([evidence.owner_pair(int(a), int(b)) for a, b in zip(rows["body_a"], rows["body_b"])])
    found = {str(name): sliding & (names == name) for name in np.unique(names[sliding])}
    if not found:
        raise NotMeasured(f"no contact slides faster than {SLIDING_SPEED} m/s")
    return found

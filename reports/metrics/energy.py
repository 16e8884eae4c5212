"""Energy that comes from nowhere."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from adapters.engine import Array
from reports.metrics.evidence import Evidence, Value, Values

STORING = 1e-4
"""Overlap from which a soft contact may hold more than rounding of elastic energy [m]."""


def energy_injected(evidence: Evidence) -> Values:
    """Largest rise over any window of S = K + U - W, W the work the drive puts in [J].

    Passive contact can only lower S, but a soft one stores energy while it is compressed: frames in which a
    simulated body overlaps by more than STORING are no start of a window.

    Subject `all`: every body, W the work of the coupling springs and hinge servos; not measured where an
    engine poses its hinges itself. Subject `simulated`: simulated bodies alone, W the work of the impulses
    that driven bodies exert on them, J . (v- + v+) / 2 at the contact.
    """
    moving = [k for k, kind in enumerate(evidence.kind) if kind != "fixed"]
    work = evidence.recording.driver_work
    if np.isnan(work).any():
        whole: float | Value = Value(np.nan, "the drive is kinematic: its work is not known")
    else:
        whole = _largest_rise(evidence, _mechanical(evidence, moving) - work)
    simulated = _mechanical(evidence, evidence.simulated) - _work_of_driven_contacts(evidence)
    return {"all": whole, "simulated": _largest_rise(evidence, simulated)}


def _largest_rise(evidence: Evidence, s: Array) -> float:
    kind = evidence.kind
    stores = np.zeros(len(s), dtype=bool)
    for (a, b), distance in evidence.distances.distance.items():
        if "simulated" in (kind[a], kind[b]):
            stores |= distance < -STORING
    lowest = np.minimum.accumulate(np.where(stores, np.inf, s))
    return float(np.max(np.where(stores, 0.0, s - lowest)))


def _mechanical(evidence: Evidence, bodies: list[int]) -> Array:
    """Kinetic and potential energy per frame (f,) [J]; driven bodies feel no gravity."""
    r = evidence.recording
    energy = np.zeros(len(r.time))
    for k in bodies:
        body = evidence.scenario.bodies[k]
        turned = Rotation.from_quat(r.orientation[:, k], scalar_first=True)
        spin = turned.inv().apply(r.angular_velocity[:, k])
        energy += 0.5 * body.mass * np.einsum("fi,fi->f", r.linear_velocity[:, k], r.linear_velocity[:, k])
        energy += 0.5 * np.einsum("fi,ij,fj->f", spin, np.array(body.inertia), spin)
        if body.kind == "simulated":
            energy -= body.mass * evidence.mass_centers[:, k] @ evidence.gravity
    return energy


def _work_of_driven_contacts(evidence: Evidence) -> Array:
    """Work that driven bodies have done on simulated ones by the end of each frame (f,) [J]."""
    rows = evidence.recording.contacts
    kind = np.array(evidence.kind)
    work = np.zeros(len(rows))
    for side, other, sign in (("a", "b", -1.0), ("b", "a", 1.0)):
        chosen = (kind[rows[f"body_{side}"]] == "simulated") & (kind[rows[f"body_{other}"]] == "driven")
        mean = (rows[f"velocity_{side}_before"] + rows[f"velocity_{side}_after"]) / 2
        work += np.where(chosen, sign * np.einsum("ij,ij->i", rows["impulse"], mean), 0.0)
    by_frame = np.bincount(evidence.contact_frame + 1, weights=work, minlength=len(evidence.recording.time))
    return np.cumsum(by_frame)

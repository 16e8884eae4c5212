"""Audit of the impulses, and the restitution that was achieved."""

from __future__ import annotations

import numpy as np

from adapters.engine import Array
from reports.metrics.arcs import Bounce, bounces
from reports.metrics.evidence import Evidence, NotMeasured, Value, Values

AUDIT_LIMIT = 0.01
"""Impulse balance above which a recording's impulse metrics are rejected [relative]."""
UNTOUCHED = 1e-9
"""Change of velocity over |v| + g T, both at their largest, below which only rounding changed it [1]."""
BOUNCE_SPEED = 1.0
"""Approach speed from which a bounce is judged [m/s]: below, engines and method fade restitution out."""


def impulse_balance(evidence: Evidence) -> Values:
    """Sum over frames of |sum J - (m dv - m g h)| over the sum of |m dv - m g h|, per simulated body."""
    rows = evidence.recording.contacts
    frames = len(evidence.recording.time) - 1
    frame = evidence.contact_frame
    found = {}
    for body in evidence.simulated:
        felt = np.zeros((frames, 3))
        for side, sign in (("a", -1.0), ("b", 1.0)):
            mine = rows[f"body_{side}"] == body
            np.add.at(felt, frame[mine], sign * rows["impulse"][mine])
        change = evidence.mass[body] * np.diff(evidence.recording.linear_velocity[:, body], axis=0)
        change -= evidence.mass[body] * evidence.gravity * evidence.frame
        total = np.linalg.norm(change, axis=1).sum()
        if total > UNTOUCHED * evidence.mass[body] * _pace(evidence, body):
            residual = np.linalg.norm(felt - change, axis=1).sum()
            found[evidence.scenario.bodies[body].name] = float(residual / total)
    if not found:
        raise NotMeasured("no simulated body is touched")
    return found


def _pace(evidence: Evidence, body: int) -> float:
    """The speed that a body has, or that gravity gives in the run [m/s]."""
    r = evidence.recording
    fastest = np.linalg.norm(r.linear_velocity[:, body], axis=1).max()
    return float(fastest + np.linalg.norm(evidence.gravity) * r.time[-1])


def restitution_achieved(evidence: Evidence) -> Values:
    """-v_n+ / v_n- of central bounces on fixed bodies, from the free arcs before and after [1]."""
    return {
        name: Value(bounce.restitution, f"asked {asked:g}, approach {bounce.approach:.2f} m/s")
        for name, bounce, asked in _judged(evidence)
    }


def restitution_error(evidence: Evidence) -> Values:
    """Largest |achieved - asked| restitution of the same bounces [1]; truth 0."""
    return {"": max(abs(bounce.restitution - asked) for _, bounce, asked in _judged(evidence))}


def _judged(evidence: Evidence) -> list[tuple[str, Bounce, float]]:
    found = []
    for (a, b), distance in evidence.distances.distance.items():
        if {evidence.kind[a], evidence.kind[b]} != {"fixed", "simulated"} or not _followed(distance):
            continue
        fast = [bounce for bounce in bounces(evidence, (a, b)) if bounce.approach > BOUNCE_SPEED]
        asked = evidence.scenario.pair_coefficients(a, b)[0]
        found += [(f"{evidence.pair_name(a, b)} #{k + 1}", bounce, asked) for k, bounce in enumerate(fast)]
    if not found:
        raise NotMeasured(f"no bounce faster than {BOUNCE_SPEED} m/s")
    return found


def _followed(distance: Array) -> bool:
    """Whether the oracle computed the pair in every frame, not only where it is near."""
    return bool(np.isfinite(distance).all())

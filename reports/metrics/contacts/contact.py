"""Audit of impulses, achieved restitution, and impulses at a distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import Array
from touchstone.reports.metrics.context import Evidence, NotMeasured, Value, Values, worst
from touchstone.reports.metrics.motion.ballistic_arcs import OPEN_GAP, Bounce, Gap, bounces, gap_of
from touchstone.scenarios.scenario import ORIGIN, Body, Sphere

Mask = NDArray[np.bool_]

AUDIT_LIMIT = 0.01
"""Impulse balance above which the impulse metrics of a recording are rejected [relative]."""
DRIVEN_AUDIT_LIMIT = 0.1
"""The same limit for driven bodies [relative]. Short touches of a turning hand reach 0.07 in first-order
steps (`ball_snip`); half the impulse would be 0.5."""
UNDRIVEN = "the engine poses its driven bodies itself: no drive to balance"
UNTOUCHED = 1e-9
"""Change of velocity over |v| + g T, both at their largest, below which it is rounding [1]."""
BOUNCE_SPEED = 1.0
"""Least approach speed of a judged bounce [m/s]; below it, engines and method fade restitution out."""

TURNED = 1e-6
"""Sine of the angle by which a normal may turn during an impact along it [1]: rounding of the oracle."""
REFERENCE_SPEED = 1.4
"""Speed after a fall of 0.1 m, the scale of violations of the impact law [m/s]."""


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
    return worst(found) if "heap" in evidence.scenario.tags else found


def impulse_balance_driven(evidence: Evidence) -> Values:
    """Sum over frames of |sum J - (d sum m v - drive)| over the sum of |d sum m v - drive|, per driven body.

    The sums are over its links; the drive is the impulse on its root. Hinges and their servos act within the
    body, and driven bodies feel no gravity.
    """
    rows, r = evidence.recording.contacts, evidence.recording
    found = {}
    for k, tracker in enumerate(evidence.scenario.trackers):
        links = np.array(evidence.scenario.links(tracker))
        in_a, in_b = np.isin(rows["body_a"], links), np.isin(rows["body_b"], links)
        if not (in_a ^ in_b).any():
            continue
        felt = np.zeros((len(r.time) - 1, 3))
        for mine, sign in ((in_a & ~in_b, -1.0), (in_b & ~in_a, 1.0)):
            np.add.at(felt, evidence.contact_frame[mine], sign * rows["impulse"][mine])
        momentum = np.einsum("l,flk->fk", evidence.mass[links], r.linear_velocity[:, links])
        change = np.diff(momentum - r.driver_impulse[:, k], axis=0)
        if np.isnan(change).any():
            raise NotMeasured(UNDRIVEN)
        total = np.linalg.norm(change, axis=1).sum()
        found[tracker.root] = float(np.linalg.norm(felt - change, axis=1).sum() / total)
    if not found:
        raise NotMeasured("no driven body is touched")
    return found


def driven_pairs(evidence: Evidence) -> set[str]:
    """Pairs with a driven body, or of two of its links, that press; links have their root's name."""
    rows = evidence.recording.contacts
    driven = np.array([kind == "driven" for kind in evidence.kind])
    pressing = evidence.impulses[0] > 0
    mine = rows[(driven[rows["body_a"]] | driven[rows["body_b"]]) & pressing]
    met = set(zip(mine["body_a"].tolist(), mine["body_b"].tolist()))
    return {evidence.owner_pair(*pair) for pair in met}


def _pace(evidence: Evidence, body: int) -> float:
    """Largest speed of a body plus the speed that gravity gives it over the run [m/s]."""
    r = evidence.recording
    fastest = np.linalg.norm(r.linear_velocity[:, body], axis=1).max()
    return float(fastest + np.linalg.norm(evidence.gravity) * r.time[-1])


def restitution_achieved(evidence: Evidence) -> Values:
    """-v_n+ / v_n- of central impacts, from the free arcs before and after [1]."""
    return {
        name: Value(bounce.restitution, f"asked {asked:g}, approach {bounce.approach:.2f} m/s")
        for name, bounce, asked in _judged(evidence)
    }


def restitution_error(evidence: Evidence) -> Values:
    """Largest |achieved - requested| restitution of the same impacts [1]; truth 0."""
    return {"": max(abs(bounce.restitution - asked) for _, bounce, asked in _judged(evidence))}


def _judged(evidence: Evidence) -> list[tuple[str, Bounce, float]]:
    found = []
    for (a, b), distance in evidence.distances.distance.items():
        if not (_followed(distance) and _central(evidence, a, b)):
            continue
        fast = [bounce for bounce in bounces(evidence, (a, b)) if bounce.approach > BOUNCE_SPEED]
        asked = evidence.scenario.pair_coefficients(a, b)[0]
        found += [(f"{evidence.pair_name(a, b)} #{k + 1}", bounce, asked) for k, bounce in enumerate(fast)]
    if not found:
        raise NotMeasured(f"no bounce faster than {BOUNCE_SPEED} m/s")
    return found


def _central(evidence: Evidence, a: int, b: int) -> bool:
    """Whether impacts pass through the centres of the moving bodies, along a fixed direction."""
    moving = [evidence.scenario.bodies[k] for k in (a, b) if evidence.kind[k] != "fixed"]
    normal = evidence.distances.normal[a, b]
    turned = np.linalg.norm(np.cross(normal, normal[0]), axis=1).max()
    return all(map(_is_ball, moving)) and bool(turned <= TURNED)


def _is_ball(body: Body) -> bool:
    single = body.kind == "simulated" and len(body.pieces) == 1 and isinstance(body.pieces[0].shape, Sphere)
    return single and body.pieces[0].position == body.center_of_mass == ORIGIN


def _followed(distance: Array) -> bool:
    """Whether the oracle computed the pair in every frame, not only where it is near."""
    return bool(np.isfinite(distance).all())


def complementarity(evidence: Evidence) -> Values:
    """Sum of j_n |v_n+ - e max(0, -v_n-)| over the sum of j_n times 1.4 m/s [1]; truth 0."""
    rows = evidence.recording.contacts
    normal, _ = evidence.impulses
    pressing = np.maximum(normal, 0.0)
    if not pressing.any():
        raise NotMeasured("no contact presses")
    before, after = (
        np.einsum("ij,ij->i", rows[f"velocity_b_{m}"] - rows[f"velocity_a_{m}"], rows["normal"])
        for m in ("before", "after")
    )
    breach = np.abs(after - evidence.restitution * np.maximum(0.0, -before))
    return {"": float(pressing @ breach / (REFERENCE_SPEED * pressing.sum()))}


def at_distance(evidence: Evidence) -> Values:
    """Mean of the pair's gap by the oracle at each contact, weighted by its impulse [m]; truth 0.

    The position of a body that is hit at a distance follows from its free arc, forward to the first contact
    of its frame or backward to the last; a first-order path differs from that arc by g dt h / 2, 0.34 mm for
    steps of 1/240 s. Contacts of driven bodies are excluded: each engine moves those in its own way within a
    frame.
    """
    rows = evidence.recording.contacts
    normal, _ = evidence.impulses
    driven = np.array(evidence.kind) == "driven"
    pressing = np.where(driven[rows["body_a"]] | driven[rows["body_b"]], 0.0, np.maximum(normal, 0.0))
    if not pressing.any():
        raise NotMeasured("no contact presses")
    first, last = _ends(evidence)
    gaps = np.zeros(len(rows))
    for a, b in sorted(set(zip(rows["body_a"].tolist(), rows["body_b"].tolist()))):
        mine = (rows["body_a"] == a) & (rows["body_b"] == b)
        g = gap_of(evidence, [(a, b)])
        gaps[mine] = _gap_at(
            evidence, g, rows["time"][mine], evidence.contact_frame[mine], first[mine], last[mine]
        )
    return {"": float(pressing @ np.maximum(0.0, gaps) / pressing.sum())}


def _ends(evidence: Evidence) -> tuple[Mask, Mask]:
    """Per contact row, whether it is the first and whether the last of its frame for both bodies."""
    rows, frame = evidence.recording.contacts, evidence.contact_frame
    frames, bodies = len(evidence.recording.time), len(evidence.scenario.bodies)
    moving = np.array(evidence.kind) != "fixed"
    first, last = np.full((frames, bodies), np.inf), np.full((frames, bodies), -np.inf)
    for side in ("body_a", "body_b"):
        np.minimum.at(first, (frame, rows[side]), rows["time"])
        np.maximum.at(last, (frame, rows[side]), rows["time"])
    is_first, is_last = np.ones(len(rows), dtype=bool), np.ones(len(rows), dtype=bool)
    for side in ("body_a", "body_b"):
        is_first &= (rows["time"] <= first[frame, rows[side]]) | ~moving[rows[side]]
        is_last &= (rows["time"] >= last[frame, rows[side]]) | ~moving[rows[side]]
    return is_first, is_last


def _gap_at(evidence: Evidence, g: Gap, time: Array, frame: Array, first: Mask, last: Mask) -> Array:
    """Gap at times within frames: the smaller of the free arc's, where one leads to the contact, and the
    linear interpolation between two touching frames (hops fit between them); zero between two contacts of a
    frame."""
    since = time - evidence.recording.time[frame]
    before, after = (
        g.gap[k] + g.rate[k] * t + g.pull[k] * t * t / 2
        for k, t in ((frame, since), (frame + 1, since - evidence.frame))
    )
    line = g.gap[frame] + (g.gap[frame + 1] - g.gap[frame]) * since / evidence.frame
    touching = np.maximum(g.gap[frame], g.gap[frame + 1]) < OPEN_GAP
    arc = np.select([first, last], [before, after], np.where(touching, np.inf, 0.0))
    return np.where(touching, np.minimum(line, np.maximum(0.0, arc)), arc)

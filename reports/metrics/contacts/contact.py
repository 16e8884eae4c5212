"""Audit of impulses, achieved restitution, and impulses at a distance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from touchstone.adapters.contract import FRICTION_IMPULSES, NOT_REPORTED, Array
from touchstone.reports.metrics.context import Context, NotMeasured, Value, Values, measured, worst
from touchstone.reports.metrics.motion.events import OPEN_GAP, Bounce, Gap, bounces, gap_of
from touchstone.scenarios.body_joints import WORLD, mechanisms
from touchstone.scenarios.scenario import ORIGIN, TRACKED, Body, Sphere

Mask = NDArray[np.bool_]

AUDIT_LIMIT = 0.01
"""Impulse balance above which the impulse metrics of a recording are rejected [relative]."""
DRIVEN_AUDIT_LIMIT = 0.1
"""The same limit for driven bodies [relative]. Short touches of a turning hand reach 0.07 in first-order
steps (`ball_snip`); half the impulse would be 0.5."""
UNDRIVEN = "the engine poses its driven bodies, or reports no drive: nothing to balance"
LACKING = "the engine reports no impulses of friction"
UNTOUCHED = 1e-9
"""Change of velocity over |v| + g T, both at their largest, below which it is rounding in double precision
[1]."""
JOINED = 1e-6
"""The same for joined bodies, whose common momentum joints change by the errors of their steps [1]."""
BOUNCE_SPEED = 1.0
"""Least approach speed of a judged bounce [m/s]; below it, engines and method fade restitution out."""

TURNED = 1e-6
"""Sine of the angle by which a normal may turn during an impact along it [1]: rounding of the oracle."""
REFERENCE_SPEED = 1.4
"""Speed after a fall of 0.1 m, the scale of violations of the impact law [m/s]."""


def impulse_balance(context: Context) -> Values:
    """Sum over frames of |sum J - (m dv - m g h)| over the sum of |m dv - m g h|, per simulated body.

    Bodies that joints connect share the value of their sums; not measured where joints connect them with
    what contact does not move, since forces of joints are not reported.
    """
    if lacks_friction(context):
        raise NotMeasured(LACKING)
    rows, count = context.recording.contacts, len(context.kind)
    frames = len(context.recording.time) - 1
    sums = np.zeros((3, frames * count))
    for side, sign in (("a", -1.0), ("b", 1.0)):
        cell = context.contact_frame * count + rows[f"body_{side}"]
        sums += [sign * np.bincount(cell, part, minlength=frames * count) for part in rows["impulse"].T]
    impulse = sums.T.reshape(frames, count, 3)
    found: dict[str, float] = {}
    for bodies in _free_groups(context):
        felt = impulse[:, bodies].sum(axis=1)
        masses = context.mass[bodies]
        gained = np.diff(context.recording.linear_velocity[:, bodies], axis=0)
        change = np.einsum("b,fbi->fi", masses, gained - context.gravity * context.frame)
        total = np.linalg.norm(change, axis=1).sum()
        least = JOINED if len(bodies) > 1 else 0.0
        rounding = (max(least, _rounding(context, k)) * context.mass[k] * _pace(context, k) for k in bodies)
        if total > sum(rounding):
            residual = np.linalg.norm(felt - change, axis=1).sum()
            found |= {context.scenario.bodies[k].name: float(residual / total) for k in bodies}
    found = measured(found, "no simulated body is touched")
    return worst(found) if "heap" in context.scenario.tags else found


def _free_groups(context: Context) -> list[list[int]]:
    """Simulated bodies alone, or with all that joints connect them with; without those of joints with a body
    that contact does not move."""
    index = {body.name: k for k, body in enumerate(context.scenario.bodies)}
    groups: list[list[int]] = []
    joined: set[str] = set()
    for joints in mechanisms(context.scenario):
        names = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child))
        joined |= names.keys()
        if all(name != WORLD and context.kind[index[name]] == "simulated" for name in names):
            groups.append([index[name] for name in names])
    return [[k] for k in context.simulated if context.scenario.bodies[k].name not in joined] + groups


def lacks_friction(context: Context) -> bool:
    """Whether contacts have friction whose impulses the engine does not report."""
    reported = context.recording.facts.get("settings", {}).get(FRICTION_IMPULSES)
    return reported == NOT_REPORTED and bool(context.friction.any())


def impulse_balance_driven(context: Context) -> Values:
    """Sum over frames of |sum J - (d sum m v - drive)| over the sum of |d sum m v - drive|, per driven body.

    The sums are over its links; the drive is the impulse on its root. Hinges and their servos act within the
    body, and driven bodies feel no gravity.
    """
    if lacks_friction(context):
        raise NotMeasured(LACKING)
    rows, r = context.recording.contacts, context.recording
    found = {}
    for k, tracker in enumerate(context.scenario.trackers):
        if context.scenario.prescribes(tracker):
            continue
        links = np.array(context.scenario.links(tracker))
        in_a, in_b = np.isin(rows["body_a"], links), np.isin(rows["body_b"], links)
        if not (in_a ^ in_b).any():
            continue
        felt = np.zeros((len(r.time) - 1, 3))
        for mine, sign in ((in_a & ~in_b, -1.0), (in_b & ~in_a, 1.0)):
            np.add.at(felt, context.contact_frame[mine], sign * rows["impulse"][mine])
        momentum = np.einsum("l,flk->fk", context.mass[links], r.linear_velocity[:, links])
        change = np.diff(momentum - r.driver_impulse[:, k], axis=0)
        if np.isnan(change).any():
            raise NotMeasured(UNDRIVEN)
        total = np.linalg.norm(change, axis=1).sum()
        found[tracker.root] = float(np.linalg.norm(felt - change, axis=1).sum() / total)
    return measured(found, "no driven body is touched")


def driven_pairs(context: Context) -> dict[str, tuple[str, str]]:
    """Subjects and names of pairs with a driven body, or of two of its links, that press; links have their
    root's name."""
    rows = context.recording.contacts
    driven = np.array([kind == "driven" for kind in context.kind])
    pressing = context.impulses[0] > 0
    mine = rows[(driven[rows["body_a"]] | driven[rows["body_b"]]) & pressing]
    met = set(zip(mine["body_a"].tolist(), mine["body_b"].tolist()))
    return {context.owner_pair(a, b): (context.owner(a), context.owner(b)) for a, b in sorted(met)}


def _rounding(context: Context, body: int) -> float:
    """Change of velocity over `_pace` below which it is rounding [1]: of every native step where velocities
    have the digits of single precision, in which engines of single precision add up gravity."""
    velocity = context.recording.linear_velocity[:, body]
    if not np.array_equal(velocity, velocity.astype(np.float32)):
        return UNTOUCHED
    steps = context.recording.time[-1] / float(context.recording.facts["dt"])
    return float(steps * np.finfo(np.float32).eps)


def _pace(context: Context, body: int) -> float:
    """Largest speed of a body plus the speed that gravity gives it over the run [m/s]."""
    r = context.recording
    fastest = np.linalg.norm(r.linear_velocity[:, body], axis=1).max()
    return float(fastest + np.linalg.norm(context.gravity) * r.time[-1])


def restitution_achieved(context: Context) -> Values:
    """-v_n+ / v_n- of central impacts, from the free arcs before and after [1]."""
    return {
        name: Value(bounce.restitution, f"asked {asked:g}, approach {bounce.approach:.2f} m/s")
        for name, bounce, asked in _judged(context)
    }


def restitution_error(context: Context) -> Values:
    """Largest |achieved - requested| restitution of the same impacts [1]; truth 0."""
    return {"": max(abs(bounce.restitution - asked) for _, bounce, asked in _judged(context))}


def _judged(context: Context) -> list[tuple[str, Bounce, float]]:
    """Fast bounces of balls, by name, and the restitution asked for; none within a frame of another bounce of
    the same ball, for the arcs of both are then unknown."""
    found = {
        (a, b): bounces(context, (a, b))
        for (a, b), distance in context.distances.distance.items()
        if np.isfinite(distance).all() and _central(context, a, b)  # near or not, the oracle computed it
    }
    judged: list[tuple[str, Bounce, float]] = []
    for pair, all_bounces in found.items():
        fast = [bounce for bounce in all_bounces if bounce.approach > BOUNCE_SPEED]
        asked = context.scenario.pair_coefficients(*pair)[0]
        for k, bounce in enumerate(fast):
            if not _disturbed(context, pair, bounce, found):
                judged.append((context.pair_name(*pair, k + 1), bounce, asked))
    return measured(judged, f"no bounce faster than {BOUNCE_SPEED} m/s")


def _disturbed(
    context: Context, pair: tuple[int, int], bounce: Bounce, found: dict[tuple[int, int], list[Bounce]]
) -> bool:
    """Whether a moving body of a pair bounces off a third within a frame of a bounce."""
    moving = {k for k in pair if context.kind[k] != "fixed"}
    return any(
        other != pair and moving & set(other) and abs(one.time - bounce.time) < context.frame
        for other, its in found.items()
        for one in its
    )


def _central(context: Context, a: int, b: int) -> bool:
    """Whether impacts pass through the centres of the moving bodies, along a fixed direction."""
    moving = [context.scenario.bodies[k] for k in (a, b) if context.kind[k] != "fixed"]
    normal = context.distances.normal[a, b]
    turned = np.linalg.norm(np.cross(normal, normal[0]), axis=1).max()
    return all(map(_is_ball, moving)) and bool(turned <= TURNED)


def _is_ball(body: Body) -> bool:
    single = body.kind == "simulated" and len(body.pieces) == 1 and isinstance(body.pieces[0].shape, Sphere)
    return single and body.pieces[0].position == body.center_of_mass == ORIGIN


def complementarity(context: Context) -> Values:
    """Sum of j_n |v_n+ - e max(0, -v_n-)| over the sum of j_n times 1.4 m/s [1]; truth 0."""
    rows = context.recording.contacts
    normal, _ = context.impulses
    pressing = np.maximum(normal, 0.0)
    if not pressing.any():
        raise NotMeasured("no contact presses")
    before, after = (
        np.einsum("ij,ij->i", rows[f"velocity_b_{m}"] - rows[f"velocity_a_{m}"], rows["normal"])
        for m in ("before", "after")
    )
    breach = np.abs(after - context.restitution * np.maximum(0.0, -before))
    return {"": float(pressing @ breach / (REFERENCE_SPEED * pressing.sum()))}


def at_distance(context: Context) -> Values:
    """Mean of the pair's gap by the oracle at each contact, weighted by its impulse [m]; truth 0.

    The position of a body that is hit at a distance follows from its free arc, forward to the first contact
    of its frame or backward to the last; a first-order path differs from that arc by g dt h / 2, 0.34 mm for
    steps of 1/240 s. Contacts of driven and prescribed bodies are excluded: each engine moves those in its
    own way within a frame.
    """
    rows = context.recording.contacts
    normal, _ = context.impulses
    driven = np.isin(context.kind, TRACKED)
    pressing = np.where(driven[rows["body_a"]] | driven[rows["body_b"]], 0.0, np.maximum(normal, 0.0))
    if not pressing.any():
        raise NotMeasured("no contact presses")
    first, last = _ends(context)
    gaps = np.zeros(len(rows))
    for pair, mine in context.pair_rows.items():
        g = gap_of(context, [pair])
        when = rows["time"][mine], context.contact_frame[mine]
        gaps[mine] = _gap_at(context, g, *when, first[mine], last[mine])
    return {"": float(pressing @ np.maximum(0.0, gaps) / pressing.sum())}


def _ends(context: Context) -> tuple[Mask, Mask]:
    """Per contact row, whether it is the first and whether the last of its frame for both bodies."""
    rows, frame = context.recording.contacts, context.contact_frame
    frames, bodies = len(context.recording.time), len(context.scenario.bodies)
    moving = np.array(context.kind) != "fixed"
    first, last = np.full((frames, bodies), np.inf), np.full((frames, bodies), -np.inf)
    for side in ("body_a", "body_b"):
        np.minimum.at(first, (frame, rows[side]), rows["time"])
        np.maximum.at(last, (frame, rows[side]), rows["time"])
    is_first, is_last = np.ones(len(rows), dtype=bool), np.ones(len(rows), dtype=bool)
    for side in ("body_a", "body_b"):
        is_first &= (rows["time"] <= first[frame, rows[side]]) | ~moving[rows[side]]
        is_last &= (rows["time"] >= last[frame, rows[side]]) | ~moving[rows[side]]
    return is_first, is_last


def _gap_at(
    context: Context, g: Gap, time: Array, frame: NDArray[np.int64], first: Mask, last: Mask
) -> Array:
    """Gap at times within frames: the smaller of the free arc's, where one leads to the contact, and the
    linear interpolation between two touching frames (hops fit between them); zero between two contacts of a
    frame."""
    since = time - context.recording.time[frame]
    before, after = (
        g.gap[k] + g.rate[k] * t + g.pull[k] * t * t / 2
        for k, t in ((frame, since), (frame + 1, since - context.frame))
    )
    line = g.gap[frame] + (g.gap[frame + 1] - g.gap[frame]) * since / context.frame
    touching = np.maximum(g.gap[frame], g.gap[frame + 1]) < OPEN_GAP
    arc = np.select([first, last], [before, after], np.where(touching, np.inf, 0.0))
    return np.where(touching, np.minimum(line, np.maximum(0.0, arc)), arc)

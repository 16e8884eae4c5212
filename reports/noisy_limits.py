"""Verdicts of runs with noisy trackers: physical laws keep their limits; limits that follow from the ideal
tracker do not apply. And of runs with explicit torques: what only these cause is the harness' failing."""

from __future__ import annotations

from dataclasses import replace
from math import nan

from touchstone.reports import limits
from touchstone.reports.known_failures.cause import NOISY
from touchstone.reports.results import CONSTRUCTION, HARNESS, UNAPPLIED, Row

OF_THE_TRACKER = (
    *("events.", "truth.", "contact.gap", "joint.speed", "posture."),
    "contact.impulse_balance.driven",
)
"""Prefixes of metrics whose limits follow from a scene's ideal tracker. The audit of driven bodies is of
first order in their jerks; it still rejects impulses."""
TORQUE = ", drive=torque"
BY_TORQUES = "explicit torques of our servo, held over a step, cause it: --drive native does not show it"
NOT_IDEAL = "its limit follows from the ideal tracker"


def judged(row: Row, tags: tuple[str, ...]) -> Row:
    """The row with its limit and verdict, for any tracker.

    With noisy trackers a documented failing excuses a row without a bound, and may be gone.
    """
    if TORQUE in row.profile:
        return _of_torque(row, tags)
    if NOISY not in row.profile:
        return limits.judged(row, tags)
    if row.verdict not in ("", "pass", "fail"):
        return row
    ideal = replace(row, profile=row.profile.replace(NOISY, ""))
    limit = limits.limit_of(ideal, tags)
    if _of_the_tracker(row) and (limit is not None or row.verdict):
        return replace(row, low=nan, high=nan, limit=nan, verdict="", basis=UNAPPLIED, reason=NOT_IDEAL)
    if limit is None:
        return row
    reason, verdict = limit.reason, "pass" if abs(row.value) <= limit.largest else "fail"
    known = limits.known_of(row, tags) or limits.known_of(ideal, tags)
    if verdict == "fail" and known is not None:
        verdict, reason = "known", f"{known.reason} (no bound with a noisy tracker)"
    basis = CONSTRUCTION if limit.by_construction else row.basis
    remark = f"{row.reason}; {reason}" if row.reason and row.reason != reason else reason
    again = known.reproduce if known is not None and verdict == "known" else row.reproduce
    return replace(row, limit=limit.largest, verdict=verdict, basis=basis, reason=remark, reproduce=again)


def _of_torque(row: Row, tags: tuple[str, ...]) -> Row:
    """The verdict under explicit torques: a row that fails, and is no documented failing under the engine's
    own servos, has failed by our torques."""
    found = judged(replace(row, profile=row.profile.replace(TORQUE, "")), tags)
    gone = found.verdict == "fail" and abs(found.value) <= found.limit
    fails = found.verdict == "fail" or (found.metric, found.verdict) == ("run", "error")
    if not fails or gone:
        return replace(found, profile=row.profile, verdict="pass" if gone else found.verdict)
    known = limits.known_of(replace(row, profile=row.profile.replace(TORQUE, "")), tags)
    if known is not None:
        return replace(found, profile=row.profile, verdict="known", reason=f"{known.reason} (no bound)")
    said = f"{found.reason}; {BY_TORQUES}".removeprefix("; ")
    return replace(found, profile=row.profile, verdict="known", basis=HARNESS, reason=said)


def _of_the_tracker(row: Row) -> bool:
    """Whether a metric's limit follows from a tracker. Engines may gain a share of the tracked kinetic
    energy; the reference may gain none."""
    return row.metric.startswith(OF_THE_TRACKER) or (
        row.metric == "energy.injected" and row.engine != "reference"
    )

"""Limits as data: what a metric may be, where, and why. Known failings are listed here too, and strict."""

from __future__ import annotations

from dataclasses import dataclass, replace

from reports.results import Row


@dataclass(frozen=True, slots=True)
class Limit:
    """Largest allowed value [SI unit of the metric] of a metric for an engine ("" = every one) on a scenario
    or tag ("" = every one) under a profile ("" = every one). The most specific row wins; among equals the
    last."""

    metric: str
    largest: float
    reason: str
    engine: str = ""
    scenario: str = ""
    profile: str = ""


@dataclass(frozen=True, slots=True)
class Known:
    """A documented failing of an engine. Strict: where the limit is met after all, the row fails."""

    metric: str
    engine: str
    reason: str
    scenario: str = ""
    profile: str = ""
    subject: str = ""


LIMITS: tuple[Limit, ...] = (
    Limit("overlap.max", 1e-6, "method section 3: removal ends at 1e-6 m", engine="reference"),
)
KNOWN: tuple[Known, ...] = ()


def judged(row: Row, tags: tuple[str, ...]) -> Row:
    """The row with its limit and verdict; rows that were skipped, failed or judged already stay as they are."""
    if row.verdict:
        return row
    candidates = [limit for limit in LIMITS if limit.metric == row.metric and _covers(limit, row, tags)]
    if not candidates:
        return row
    limit = max(candidates, key=lambda c: bool(c.engine) + bool(c.scenario) + bool(c.profile))
    met = row.value <= limit.largest
    known = next((k for k in KNOWN if k.metric == row.metric and _covers(k, row, tags)), None)
    if known is None:
        verdict, reason = ("pass" if met else "fail"), limit.reason
    elif met:
        verdict, reason = "fail", f"a known failing is gone: take it out of limits.py ({known.reason})"
    else:
        verdict, reason = "known", known.reason
    remark = f"{row.reason}; {reason}" if row.reason else reason
    return replace(row, limit=limit.largest, verdict=verdict, reason=remark)


def _covers(entry: Limit | Known, row: Row, tags: tuple[str, ...]) -> bool:
    subject = getattr(entry, "subject", "")
    return (
        entry.engine in ("", row.engine)
        and entry.scenario in ("", row.scenario, *tags)
        and entry.profile in ("", row.profile)
        and subject in ("", row.subject)
    )

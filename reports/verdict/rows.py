"""Rows of all metrics of a recording, with the audits' rejections and the scene's expectations; and the
warning of a run whose solver left contacts or time unresolved."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from math import inf, isfinite, isnan, nan

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.reports.metrics import DRIVEN_METRICS, IMPULSE_METRICS, METRICS, PAIR_METRICS
from touchstone.reports.metrics.contacts.contact import (
    AUDIT_LIMIT,
    DRIVEN_AUDIT_LIMIT,
    LACKING,
    driven_pairs,
    lacks_friction,
)
from touchstone.reports.metrics.context import Context, JudgeMissing, NotMeasured, Value
from touchstone.reports.metrics.motion.events import subjects
from touchstone.reports.metrics.solver import RESIDUAL, worst_place
from touchstone.reports.results import UNAUDITED, UNJUDGED, Row
from touchstone.reports.verdict.judge import judged, judged_in
from touchstone.reports.verdict.limits import Limit
from touchstone.scenarios.scenario import Expectation, Scenario
from touchstone.scenarios.truths.pair_names import PairName

NEEDED = ("overlap.max", "contact.impulse_balance", "contact.impulse_balance.driven")
"""Metrics that the judgement of others needs."""


def excused(row: Row, recording: Recording, scenario: Scenario, limits: Sequence[Limit] = ()) -> Row:
    """The row, judged; its verdict is `known` where it breaks a limit because a needed effect was disabled on
    request."""
    found = judged_in(row, scenario, limits)
    if found.verdict != "fail":
        return row
    states: dict[str, str] = recording.facts.get("effects", {})
    removed = [effect for effect, state in states.items() if state.startswith("forced off")]
    if not removed:
        return row
    reason = f"played without {', '.join(removed)}, as asked for; limit: {found.reason}"
    return replace(found, verdict="known", reason=reason)


def measured(base: Row, scenario: Scenario, recording: Recording, only: Sequence[str] = ()) -> list[Row]:
    """One row per metric and subject of a recording: all metrics, or the named ones and those that they
    need."""
    return measured_of(base, Context(recording, scenario), only)


@np.errstate(all="ignore")  # what overflows is infinite or NaN in its row, and warns nobody
def measured_of(
    base: Row, context: Context, only: Sequence[str] = (), needed: Sequence[str] = NEEDED
) -> list[Row]:
    """`measured`, from a shared context; `needed` are the metrics that judge the named ones."""
    scenario = context.scenario
    rows: list[Row] = []
    asked = {name.removesuffix(".spread") for name in only} | set(needed if only else METRICS)
    for metric in METRICS.values():
        if metric.name not in asked:
            continue
        row = replace(base, metric=metric.name, unit=metric.unit)
        if {"heap", "collective"} & set(scenario.tags) and metric.name in PAIR_METRICS:
            rows.append(replace(row, verdict="skipped", reason="a heap has hundreds of pairs at a time"))
            continue
        try:
            values = metric.measure(context)
        except NotMeasured as reason:
            verdict = UNJUDGED if isinstance(reason, JudgeMissing) else "skipped"
            rows.append(replace(row, verdict=verdict, reason=str(reason)))
            continue
        except Exception as error:  # one metric that fails must not take the run with it
            rows.append(replace(row, verdict="error", reason=f"{type(error).__name__}: {error}"))
            continue
        for subject, value in values.items():
            number, remark = (value.value, value.reason) if isinstance(value, Value) else (value, "")
            verdict = "skipped" if isnan(number) and remark else ""
            pair = (subject.body_a, subject.body_b) if isinstance(subject, PairName) else ("", "")
            named = replace(row, subject=str(subject), body_a=pair[0], body_b=pair[1])
            rows.append(replace(named, value=number, reason=remark, verdict=verdict))
    return _audited(_expected(rows, scenario), context)


def _expected(rows: list[Row], scenario: Scenario) -> list[Row]:
    """Add the verdicts on events by the scene's expectations."""
    windows: dict[tuple[str, str], Expectation] = {
        (f"events.{event}", subject): e for (event, subject), e in subjects(scenario).items()
    }
    found = []
    for row in rows:
        window = windows.get((row.metric, row.subject))
        if window is not None:
            low, high = window.earliest, window.latest
            verdict = "pass" if low <= row.value <= high else "fail"
            reason = f"the scene expects {low:g} to {high:g} s"
            row = replace(row, low=low, high=high, limit=high, verdict=verdict, reason=reason)
        found.append(row)
    return found


def _audited(rows: list[Row], context: Context) -> list[Row]:
    """Reject impulse metrics where the impulses do not balance the motion, where the balance is unknown, or
    where the engine reports a part of them. Mark metrics that use impulses on driven bodies which no audit
    covers."""
    if lacks_friction(context):
        return _without_impulses(rows, LACKING)
    rows = _rejected(rows, "contact.impulse_balance", AUDIT_LIMIT)
    rows = _rejected(rows, "contact.impulse_balance.driven", DRIVEN_AUDIT_LIMIT)
    audited = {r.subject for r in rows if r.metric == "contact.impulse_balance.driven" and r.subject}
    # Impulses between links of one body cancel in the sum over its links.
    doubtful = {
        pair: (one, two)
        for pair, (one, two) in driven_pairs(context).items()
        if one == two or not {one, two} & audited
    }
    if not doubtful:
        return rows
    marked = {"", *doubtful, *chain.from_iterable(doubtful.values())}
    remark = f"rests on impulses that nothing balances: {', '.join(sorted(doubtful))}"
    return [
        replace(row, basis=UNAUDITED, reason=f"{row.reason}; {remark}".removeprefix("; "))
        if row.metric in DRIVEN_METRICS and row.subject in marked and isfinite(row.value)
        else row
        for row in rows
    ]


def _rejected(rows: list[Row], audit: str, limit: float) -> list[Row]:
    audits = [row.value for row in rows if row.metric == audit and row.verdict != "skipped"]
    worst = max((inf if isnan(value) else value for value in audits), default=0.0)
    if not worst > limit:
        return rows
    return _without_impulses(rows, f"the engine's impulses miss the motion by {worst:.2g}")


def _without_impulses(rows: list[Row], reason: str) -> list[Row]:
    return [
        replace(row, value=nan, verdict="skipped", reason=reason) if row.metric in IMPULSE_METRICS else row
        for row in rows
    ]


KINDS = {
    "solver.residual": ((RESIDUAL,), "contact solve left {} m/s in {}"),
    "solver.dropped_time": (("dropped_time",), "{} s were not simulated, most of it in {}"),
    "solver.parted_energy": (("parted_energy",), "parting overlap added {} J, most of it in {}"),
}
"""Metric -> its counters, and the warning's texts of its size and its worst place."""


def warning(base: Row, context: Context) -> str | None:
    """One line with engine, profile, scene, frame and pair of everything that a run left unresolved beyond
    its limit, known failings and scenes without limits included; None if there is nothing, or if the engine
    does not report it.

    Args:
        base: a row of the run, for its engine, profile, scene and step.
        context: context of the run, whole or up to its failure.
    """
    parts = []
    for metric, (counters, words) in KINDS.items():
        try:
            found = METRICS[metric].measure(context)[""]
        except NotMeasured:
            return None
        value = found.value if isinstance(found, Value) else found
        row = judged(replace(base, metric=metric, value=value), context.scenario.tags)
        if row.verdict in ("fail", "known"):
            parts.append(words.format(f"{value:.3g}", worst_place(context, *counters)))
    return f"warning: {base.engine} {base.profile} {base.scenario}: {'; '.join(parts)}" if parts else None

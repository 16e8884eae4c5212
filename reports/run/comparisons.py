"""Rows that compare engines: time ratios and the spread of events."""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, isnan

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.reports.bootstrap import time_ratio
from touchstone.reports.metrics.context import ROUNDING
from touchstone.reports.own_limits import is_foreign
from touchstone.reports.results import UNJUDGED, Row
from touchstone.reports.run.request import EQUAL_PROFILE, MACHINE_PROFILE, REFERENCE, STUDY
from touchstone.scenarios.scenario import Scenario

RATIO_LIMIT, PROBE_RATIO_LIMIT, EQUAL_RATIO_LIMIT = 0.5, 1.0, 1.0
"""Largest ratios of the reference's time to the fastest engine's: at the engine's recommended step; in
probes, whose frames hold almost no work and take an engine a few microseconds; at equal steps, in scenes with
many contacts."""
MANY_CONTACTS = 10
"""Contacts in the reference's median frame above which RATIO_LIMIT applies to a probe too."""
DEEPER, NO_DEEPER, UNCOMPARED = "deeper", "no-deeper", "uncompared"
"""Reason codes of a ratio of times: the reference overlaps more than the other, no more, or nobody knows."""
SAME_DEPTH = 1e-8
"""Overlap below which two values are equal [m]: the oracle's tolerance."""


def ratios_of(scenario: Scenario, played: dict[tuple[str, str], Recording], rows: list[Row]) -> list[Row]:
    """`ratio.time` of the reference to every engine. The ratio to the fastest engine gets a verdict at its
    own step, and at equal steps where `ratio_limits` has a limit."""
    found = []
    overlap = {(r.engine, r.profile): r for r in rows if r.metric == "overlap.max"}
    ours = {profile: r for (engine, profile), r in played.items() if engine == REFERENCE}
    others = {column: r for column, r in played.items() if column[0] != REFERENCE}
    for profile, mine in ours.items():
        ratios = {column: time_ratio(mine.time_frame, theirs.time_frame) for column, theirs in others.items()}
        # Per class of steps, over the frames that both engines played.
        largest_last = sorted(ratios, key=lambda column: ratios[column].value)
        fastest = {column[1]: column for column in largest_last}
        limited = profile == "balanced" and not is_foreign(scenario)
        limits = ratio_limits(scenario, mine) if limited else {}
        for column, ratio in ratios.items():
            code, said = _compared(overlap.get((REFERENCE, profile)), overlap.get(column))
            row = Row(
                STUDY,
                scenario.name,
                REFERENCE,
                profile,
                1 / scenario.frame_rate,
                "ratio.time",
                ratio.value,
                "1",
                f"{column[0]} {column[1]}",
                low=ratio.low,
                high=ratio.high,
                reason=said,
                reason_code=code,
            )
            if column == fastest[column[1]] and column[1] in limits:
                largest = limits[column[1]]
                verdict = "pass" if ratio.value <= largest and code != DEEPER else "fail"
                if code == UNCOMPARED and verdict == "pass":
                    verdict = UNJUDGED
                row = replace(row, limit=largest, verdict=verdict, reason=f"against the fastest; {said}")
            found.append(row)
    return found


def _compared(ours: Row | None, theirs: Row | None) -> tuple[str, str]:
    """Code and text of the comparison of both overlaps. Where no two bodies may touch there is nothing to
    compare; UNCOMPARED where an expected number is missing."""
    for row in (ours, theirs):
        if row is None:
            return UNCOMPARED, "overlap not measured"
        if not isfinite(row.value):
            return NO_DEEPER if row.verdict == "skipped" else UNCOMPARED, f"no overlap: {row.reason}"
    deeper = ours.value > max(theirs.value, SAME_DEPTH)  # type: ignore[union-attr]
    return (DEEPER, "overlap larger") if deeper else (NO_DEEPER, "overlap no larger")


def ratio_limits(scenario: Scenario, ours: Recording) -> dict[str, float]:
    """Largest allowed ratio of the reference's time to the fastest engine's, per profile of the engines."""
    frames = np.floor(ours.contacts["time"] * scenario.frame_rate + ROUNDING).astype(int)
    held = np.bincount(frames, minlength=len(ours.time_frame))
    if np.median(held) > MANY_CONTACTS:
        return {MACHINE_PROFILE: RATIO_LIMIT, EQUAL_PROFILE: EQUAL_RATIO_LIMIT}
    return {MACHINE_PROFILE: PROBE_RATIO_LIMIT if "probe" in scenario.tags else RATIO_LIMIT}


def spreads_of(scenario: Scenario, rows: list[Row]) -> list[Row]:
    """Spread of every event over the reference and the engines in profile `recommended`; names the
    outlier."""
    found = []
    events = sorted({(r.metric, r.subject, r.unit) for r in rows if r.metric.startswith("events.")})
    for metric, subject, unit in events:
        values = {
            r.engine: r.value
            for r in rows
            if (r.metric, r.subject) == (metric, subject) and r.profile in (MACHINE_PROFILE, "balanced")
        }
        if len(values) < 2 or any(isnan(value) for value in values.values()):
            continue
        middle = float(np.median(list(values.values())))
        outlier = max(values, key=lambda engine: abs(values[engine] - middle))
        spread = max(values.values()) - min(values.values())
        found.append(
            Row(
                STUDY,
                scenario.name,
                "all",
                MACHINE_PROFILE,
                float("nan"),
                f"{metric}.spread",
                spread,
                unit,
                subject,
                reason=f"outlier {outlier}: {values[outlier]:.4g}, median {middle:.4g}",
            )
        )
    return found

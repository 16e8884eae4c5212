"""Rows that compare engines: time ratios and the spread of events."""

from __future__ import annotations

from math import isnan

import numpy as np

from touchstone.adapters.recording import Recording
from touchstone.reports.results import Row
from touchstone.reports.run.ratios import ratio_rows, timed
from touchstone.reports.run.request import MACHINE_PROFILE, STUDY
from touchstone.scenarios.scenario import Scenario


def ratios_of(scenario: Scenario, played: dict[tuple[str, str], Recording], rows: list[Row]) -> list[Row]:
    """Ratios of the reference's time to every engine's, from this one run."""
    overlap = {(r.engine, r.profile): r for r in rows if r.metric == "overlap.max"}
    columns = [
        timed(engine, label, recording, [recording.time_frame], overlap.get((engine, label)))
        for (engine, label), recording in played.items()
    ]
    return ratio_rows(STUDY, scenario, columns, one_run=True)


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

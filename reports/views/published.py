"""The table of published values: what others published, and what the reference and each engine give."""

from __future__ import annotations

from collections.abc import Iterable
from math import isfinite

import pandas as pd

from touchstone.reports.results import rows_of
from touchstone.reports.runner.request import EVERY_ENGINE
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import MARKS
from touchstone.scenarios.scenario import Scenario

METRIC = "published.error"
TITLE = "Against published values"
NOTE = "± published tolerance; each engine in its first profile; numbers in brackets: sources"


def published_part(frame: pd.DataFrame, scenarios: Iterable[Scenario]) -> Part:
    """One line per published value of the scenes, and the sources; no row where none was measured."""
    rows = [row for row in rows_of(frame) if row.metric in (METRIC, "run") and row.engine != EVERY_ENGINE]
    if not any(row.metric == METRIC and row.subject for row in rows):
        return Part()
    own: dict[str, str] = {}
    for row in rows:
        own.setdefault(row.engine, row.profile)
    found = {
        (row.scenario, row.engine, row.metric, row.subject): row
        for row in rows
        if row.profile == own[row.engine]
    }
    sources: dict[str, int] = {}
    lines = []
    for scenario in scenarios:
        for one in scenario.published:
            cells = []
            for engine in own:
                measured = found.get((scenario.name, engine, METRIC, one.name))
                if measured is None or not isfinite(measured.value):
                    run = measured or found.get((scenario.name, engine, "run", ""))
                    cells.append(run.verdict if run and run.verdict else "-")
                else:
                    value = one.value + measured.value * one.tolerance
                    text = " ".join((digits(value, one.tolerance), one.outcome(value))).strip()
                    cells.append(text + MARKS.get(measured.verdict, ""))
            number = sources.setdefault(one.source, len(sources) + 1)
            known = (digits(one.value, one.tolerance), f"{one.tolerance:.2g}")
            lines.append([scenario.name, f"{one.name} [{number}]", one.unit, *known, *cells])
    heads = ["scene", "value", "unit", "published", "±", *own]
    texts = [f"[{number}] {source}" for source, number in sources.items()]
    return Part(TITLE, heads, lines, [NOTE, *texts], words=3, tight=True)


def digits(value: float, tolerance: float) -> str:
    """A value to three digits, or to a tenth of its tolerance."""
    if abs(value) < tolerance / 1e3:
        return "0"
    return f"{value:.{max(3, len(f'{abs(value) / tolerance:.0f}') + 1)}g}"

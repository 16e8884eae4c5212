"""Studies of a night on its page: hard cases as a table of outcomes, other studies as counts and remarks."""

from __future__ import annotations

from html import escape

import pandas as pd

from touchstone.reports.page.html import plain_table
from touchstone.reports.results import Row, rows_of
from touchstone.reports.verdict.outcomes import CLASSES, SURVIVED
from touchstone.reports.views.tables import exact_number

HARD = "stability"
REMARKS = ("fail", "error", "known", "unjudged")
"""Verdicts of rows that are listed."""
MOST = 60
"""Rows of a study that are listed."""


def studies_part(frame: pd.DataFrame) -> str:
    """All studies of the long table `frame`, as HTML."""
    parts = []
    for study in dict.fromkeys(frame.study):
        rows = rows_of(frame[frame.study == study])
        title, body = ("hard cases", _hard(rows)) if study == HARD else (str(study), _counts(rows))
        parts.append(f"<h3>{escape(title)}</h3>{body}")
    return "".join(parts)


def _hard(rows: list[Row]) -> str:
    columns = list(dict.fromkeys((row.engine, row.profile) for row in rows))
    found = {(row.scenario, row.engine, row.profile): row for row in rows}
    survived = sum(row.reason.partition(":")[0] in SURVIVED for row in rows)
    lines = []
    for scene in dict.fromkeys(row.scenario for row in rows):
        cells = [found.get((scene, *column)) for column in columns]
        lines.append([scene, *(_class(cell) for cell in cells)])
    seen = {_class(row) for row in rows}
    words = "; ".join(f"{name}: {text}" for name, text in CLASSES.items() if name in seen)
    return (
        f"<p>{survived} of {len(rows)} hard cases survived. <code>touchstone run SCENE --engine NAME</code> "
        f"plays one.</p>{plain_table(('case', *(' '.join(one) for one in columns)), lines, len(columns) + 1)}"
        f"<p>{escape(words)}</p>"
    )


def _class(row: Row | None) -> str:
    return "-" if row is None else row.reason.partition(":")[0]


def _counts(rows: list[Row]) -> str:
    judged = [row for row in rows if row.verdict]
    remarks = [row for row in judged if row.verdict in REMARKS]
    counts = pd.Series([row.verdict for row in judged]).value_counts()
    text = ", ".join(f"{count} {verdict}" for verdict, count in counts.items())
    lines = [
        [row.verdict, row.scenario, f"{row.engine} {row.profile}", f"{row.metric} {row.subject}".strip(),
         exact_number(row.value), row.reason]
        for row in remarks[:MOST]
    ]  # fmt: skip
    heads = ("verdict", "scene", "engine", "figure", "value", "reason")
    listed = plain_table(heads, lines, 6) if lines else ""
    rest = f"<p>{len(remarks) - MOST} more.</p>" if len(remarks) > MOST else ""
    return f"<p>{len(rows)} figures; {text or 'none is judged'}.</p>{listed}{rest}"

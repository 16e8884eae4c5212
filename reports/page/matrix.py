"""The matrix of scenes and engines (`views/matrix.py`) as HTML, with the details of its cells."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from math import isfinite

from markupsafe import Markup

from touchstone.reports.metrics import METRICS, label
from touchstone.reports.page.html import PARTS, Change, Inline, Linked
from touchstone.reports.results import Row
from touchstone.reports.runner.request import reproduce, script_command
from touchstone.reports.views.matrix import (
    LIMITS,
    TOPICS,
    Entry,
    Found,
    by_cause,
    cause_of,
    missed_line,
    shown,
    worst_of,
)
from touchstone.reports.views.tables import MARKS, Column, quantity
from touchstone.scenarios.plural import plural


def title(entry: Entry) -> str:
    """What a hover over a cell says: the figure and its subject, then every limit that is missed."""
    lines = [missed_line(row) for row in entry.missed]
    if entry.row.metric in (LIMITS, "run"):
        return "\n".join([f"limits met: {entry.text}", *lines] if entry.row.metric == LIMITS else lines)
    value, unit = quantity(entry.row.metric, entry.row.value, entry.row.unit)
    of = f" (worst of {entry.subjects})" if entry.subjects > 1 else ""
    head = f"{label(entry.row.metric)} {entry.row.subject}".strip()
    return "\n".join([f"{head}{of}: {value} {unit}".strip(), *lines])


def facts(entry: Entry) -> dict[str, object]:
    """Details of a cell for its dialog."""
    row = entry.row
    head = {"scene": row.scenario, "engine": row.engine, "profile": row.profile}
    missed = [("limit missed", f"{missed_line(one)}: {one.reason}") for one in entry.missed]
    if row.metric == LIMITS:
        again = reproduce(replace(row, metric="run"))
        script = script_command(row) if any(one.verdict == "known" for one in entry.missed) else ""
        scripts = [("as a script of the engine", script)] if script else []
        return {**head, "facts": [("limits met", entry.text), *scripts, *missed], "command": again}
    unit = quantity(row.metric, row.value, row.unit)[1]
    facts = [("metric", f"{row.metric} {row.subject}".strip()), ("value", f"{shown(row)} {unit}".strip())]
    if row.metric in METRICS:
        facts.append(("definition", METRICS[row.metric].formula))
    if isfinite(row.value):
        facts.append(("value [SI]", f"{row.value!r} {row.unit}"))
    facts += [("difference from the reference", f"{entry.apart}")]
    if isfinite(row.limit):
        facts.append(("limit [SI]", f"{row.limit:g} {row.unit}"))
    facts += [("verdict", row.verdict)] if row.verdict else []
    facts += [("reason", row.reason)] if row.reason else []
    if any(one.verdict == "known" for one in entry.missed) and (script := script_command(row)):
        facts.append(("as a script of the engine", script))
    others = [fact for one, fact in zip(entry.missed, missed) if one is not row]
    again = reproduce(entry.missed[0] if entry.missed else row)
    return {**head, "facts": [*facts, *others], "command": again}


HEADS = ((LIMITS, "met"), *((topic.name, topic.unit) for topic in TOPICS))
WORST_HEADS = ((LIMITS, ""), *HEADS[1:-1], ("time", "over the fastest"))
"""Topics with their units."""


def table(found: Found, columns: Sequence[Column]) -> tuple[Markup, dict[str, dict[str, object]]]:
    """The matrix as HTML, and the details of its cells by their id."""
    cells = (
        mine[topic, column]
        for mine in found.values()
        for topic, _ in HEADS
        for column in columns
        if (topic, column) in mine
    )
    return PARTS.matrix(found, columns, HEADS, title), {entry.id: facts(entry) for entry in cells}


def worst_part(found: Found, columns: Sequence[Column]) -> Markup:
    """A row for each column with its worst scene in each topic; "" where the matrix has one row or column."""
    several = len(found) > 1 and len(columns) > 1
    return Markup(PARTS.worst(worst_of(found, columns), columns, WORST_HEADS, title) if several else "")


SHOWN = 8
"""Rows of a table that are shown at once; those beyond are folded away."""
MOST = 200
"""Rows of a table at most: an engine that is missing loses thousands of figures."""
PLACES = 6
"""Scenes that a line names beside the worst."""
BROKEN = ("fail", "error")


def changes_part(changes: Sequence[Change], scenes: Collection[str]) -> Markup:
    """A table of each kind of change, the gravest first; only that of the first kind is open."""
    kinds = list(dict.fromkeys(change.kind for change in changes))
    parts = []
    for number, kind in enumerate(kinds):
        mine = [change for change in changes if change.kind == kind]
        rows: list[list[Inline]] = []
        for one in mine[:MOST]:
            figure = metric_part(one.metric, one.subject)
            rows.append([scene_part(one.scene, scenes), one.engine, figure, one.moved, one.text])
        heads = ("scene", "engine", "figure", "before → after", "")
        more = [f"{len(mine) - MOST} more are stored."] if len(mine) > MOST else []
        words = f"{len(mine)} {kind}" if kind == "gone" else plural(len(mine), kind)
        body = PARTS.long_table(heads, rows, SHOWN, len(heads)) + PARTS.paragraphs(more)
        parts.append(PARTS.fold(words, body, f"changes-{kind}", not number, level=3))
    return Markup('<div class="changes">{}</div>').format(Markup("").join(parts)) if parts else Markup("")


def scene_part(scene: str, scenes: Collection[str]) -> Linked:
    """Name of a scene; a link where the page has its figures."""
    return Linked(scene, scene=scene if scene in scenes else "")


def metric_part(metric: str, subject: str = "") -> Linked:
    """A metric by its name for readers; a hover says its name and definition."""
    known = METRICS.get(metric)
    return Linked(f"{label(metric)} {subject}".strip(), f"{metric}: {known.formula}" if known else metric)


def broken_part(rows: Iterable[Row], scenes: Collection[str]) -> Markup:
    """Broken limits and failed runs, open; "" where there are none."""
    broken = [row for row in rows if row.verdict in BROKEN]
    failed = sum(row.verdict == "error" for row in broken)
    words = [(len(broken) - failed, "broken limit"), (failed, "failed run")]
    title = " and ".join(plural(count, word) for count, word in words if count)
    return Markup(PARTS.fold(title, causes_table(broken, scenes), "broken", True) if broken else "")


def known_part(rows: Iterable[Row], scenes: Collection[str]) -> Markup:
    """Known failings, folded away; "" where there are none."""
    known = [row for row in rows if row.verdict == "known"]
    title = plural(len(known), "known failing")
    return Markup(PARTS.fold(title, causes_table(known, scenes), "failings") if known else "")


def causes_table(rows: Iterable[Row], scenes: Collection[str]) -> Markup:
    """Rows that miss a limit: one line per metric, engine and cause, with its worst place, the others, and a
    command."""
    lines = [_line(found, scenes) for found in by_cause(rows)]
    heads = ("", "engine", "figure", "worst in", "value", "limit", "also in", "why", "measure it again")
    return Markup(PARTS.long_table(heads, lines, SHOWN, len(heads)))


def _line(found: Sequence[Row], scenes: Collection[str]) -> list[Inline]:
    worst = found[0]
    others = list(dict.fromkeys(row.scenario for row in found if row.scenario != worst.scenario))
    also: list[str | Linked] = []
    for scene in others[:PLACES]:
        also += [", "] if also else []
        also.append(scene_part(scene, scenes))
    also += [f" and {len(others) - PLACES} more"] if len(others) > PLACES else []
    value, limit = valued(worst)
    return [
        MARKS[worst.verdict].strip(),
        f"{worst.engine} {worst.profile}",
        metric_part(worst.metric, worst.subject),
        scene_part(worst.scenario, scenes),
        value,
        limit,
        also,
        cause_of(worst),
        reproduce(worst),
    ]


def valued(row: Row) -> tuple[str, str]:
    """Value and limit of a row with their unit; a run has neither."""
    if row.metric == "run":
        return row.verdict, ""
    value, unit = quantity(row.metric, row.value, row.unit)
    if row.value != row.value:
        value, unit = "never" if row.verdict == "fail" else "-", ""
    limit = quantity(row.metric, row.limit, row.unit) if row.limit == row.limit else ("", "")
    return _joined(value, unit), _joined(*limit)


def _joined(value: str, unit: str) -> str:
    """Value and unit that no line break parts."""
    return f"{value}\N{NO-BREAK SPACE}{unit}" if unit else value

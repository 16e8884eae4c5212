"""What a page says first: what changed since earlier nights, and the limits that are broken."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from html import escape

from touchstone.reports.metrics import METRICS, label
from touchstone.reports.page.html import Cell, Change, Linked, fold, long_table
from touchstone.reports.results import Row
from touchstone.reports.run.reproduce import reproduce
from touchstone.reports.views.matrix import by_cause, cause_of, plural
from touchstone.reports.views.tables import MARKS, quantity

SHOWN = 8
"""Rows of a table that are shown at once; those beyond are folded away."""
MOST = 200
"""Rows of a table at most: an engine that is missing loses thousands of figures."""
PLACES = 6
"""Scenes that a line names beside the worst."""
BROKEN = ("fail", "error")


def changes_part(changes: Sequence[Change], scenes: Collection[str]) -> str:
    """A table of each kind of change, the gravest first; only that of the first kind is open."""
    kinds = list(dict.fromkeys(change.kind for change in changes))
    parts = []
    for number, kind in enumerate(kinds):
        mine = [change for change in changes if change.kind == kind]
        rows: list[list[Cell]] = [
            [
                scene_part(change.scene, scenes),
                change.engine,
                metric_part(change.metric, change.subject),
                change.moved,
                change.text,
            ]
            for change in mine[:MOST]
        ]
        heads = ("scene", "engine", "figure", "before → after", "")
        more = f"<p>{len(mine) - MOST} more are stored.</p>" if len(mine) > MOST else ""
        words = f"{len(mine)} {kind}" if kind == "gone" else plural(len(mine), kind)
        body = long_table(heads, rows, SHOWN, len(heads)) + more
        parts.append(fold(words, body, f"changes-{kind}", not number, level=3))
    return f'<div class="changes">{"".join(parts)}</div>' if parts else ""


def scene_part(scene: str, scenes: Collection[str]) -> Linked:
    """Name of a scene; a link where the page has its figures."""
    return Linked(scene, scene=scene if scene in scenes else "")


def metric_part(metric: str, subject: str = "") -> Linked:
    """A metric by its name for readers; a hover says its name and definition."""
    known = METRICS.get(metric)
    return Linked(f"{label(metric)} {subject}".strip(), f"{metric}: {known.formula}" if known else metric)


def broken_part(rows: Iterable[Row], scenes: Collection[str]) -> str:
    """Broken limits and failed runs, open; "" where there are none."""
    broken = [row for row in rows if row.verdict in BROKEN]
    failed = sum(row.verdict == "error" for row in broken)
    words = [(len(broken) - failed, "broken limit"), (failed, "failed run")]
    title = " and ".join(plural(count, word) for count, word in words if count)
    return fold(title, causes_table(broken, scenes), "broken", True) if broken else ""


def known_part(rows: Iterable[Row], scenes: Collection[str]) -> str:
    """Known failings, folded away; "" where there are none."""
    known = [row for row in rows if row.verdict == "known"]
    title = plural(len(known), "known failing")
    return fold(title, causes_table(known, scenes), "failings") if known else ""


def causes_table(rows: Iterable[Row], scenes: Collection[str]) -> str:
    """Rows that miss a limit: one line per metric, engine and cause, with its worst place, the others, and a
    command."""
    lines = [_line(found, scenes) for found in by_cause(rows)]
    heads = ("", "engine", "figure", "worst in", "value", "limit", "also in", "why", "measure it again")
    return long_table(heads, lines, SHOWN, len(heads))


def _line(found: Sequence[Row], scenes: Collection[str]) -> list[Cell]:
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


def remarks(rows: Iterable[Row]) -> str:
    """Why runs of a scene did not take place or ended early."""
    lines = [f"{row.verdict}: {row.engine} {row.profile}: {row.reason}" for row in rows]
    return "".join(f"<p class=remark>{escape(line)}</p>" for line in lines)

"""The matrix of scenes and engines: four topics, values and differences from the reference."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from math import isfinite, isnan, log2, log10

from touchstone.reports.metrics import METRICS
from touchstone.reports.page.content import Column
from touchstone.reports.results import Row
from touchstone.reports.run.reproduce import reproduce
from touchstone.reports.run.request import REFERENCE
from touchstone.reports.views.tables import MARKS, exact_number, number, unit_of


@dataclass(frozen=True, slots=True)
class Topic:
    """A group of columns: the metrics that may fill it, the first that a scene has; the shade grows from none
    at `low` to full at `high` [the metric's unit]."""

    name: str
    metrics: tuple[str, ...]
    low: float = 1e-6
    high: float = 1e-1


TOPICS = (
    Topic("overlap", ("overlap.max",), 1e-6, 1e-2),
    Topic("energy", ("energy.injected", "energy.gain"), 1e-6, 1.0),
    Topic("friction", ("friction.deficit", "friction.cone", "friction.stop", "rolling.time"), 1e-4, 1.0),
    Topic("time", ("time.frame.median",)),
)
SHADES = 5
"""Shades of a cell, 0 to SHADES."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A cell: its row, texts and shade; `id` is its deep link."""

    row: Row
    text: str
    apart: str
    shade: int

    @property
    def id(self) -> str:
        """Key of the cell in links."""
        return "/".join(
            (self.row.scenario, self.row.engine, self.row.profile, self.row.metric, self.row.subject)
        )


def entries(rows: Sequence[Row], columns: Sequence[Column]) -> dict[tuple[str, Column], Entry]:
    """Cells of one scene by topic and column."""
    found = {}
    for topic in TOPICS:
        chosen = _chosen(topic, rows, columns)
        values = [row.value for row in chosen.values() if isfinite(row.value)]
        ours = next((row for column, row in chosen.items() if column[0] == REFERENCE), None)
        for column, row in chosen.items():
            shade = _shade(topic, row.value, min(values, default=0.0))
            found[topic.name, column] = Entry(row, shown(row), _apart(row, ours), shade)
    return found


def _chosen(topic: Topic, rows: Sequence[Row], columns: Sequence[Column]) -> dict[Column, Row]:
    """The row of each column: of the topic's first metric with a value, the subject with the largest one."""
    for metric in topic.metrics:
        mine = [row for row in rows if row.metric == metric and (row.engine, row.profile) in columns]
        largest: dict[str, float] = {}
        for row in mine:
            if isfinite(row.value):
                largest[row.subject] = max(largest.get(row.subject, 0.0), abs(row.value))
        if largest:
            # Energy of all bodies is not measured where an engine poses its hinges: prefer what all have.
            counts = {s: sum(row.subject == s and isfinite(row.value) for row in mine) for s in largest}
            subject = max(largest, key=lambda name: (counts[name], largest[name]))
            return {(row.engine, row.profile): row for row in mine if row.subject == subject}
    runs = [row for row in rows if row.metric == "run" and (row.engine, row.profile) in columns]
    return {(row.engine, row.profile): row for row in runs}


def _shade(topic: Topic, value: float, least: float) -> int:
    size = abs(value)
    if not isfinite(size):
        return 0
    if topic.name == "time":
        return min(SHADES, int(log2(size / least))) if least > 0 else 0
    if size <= topic.low:
        return 0
    return min(SHADES, 1 + int((SHADES - 1) * log10(size / topic.low) / log10(topic.high / topic.low)))


def shown(row: Row) -> str:
    """A row's value in the unit of tables, with the mark of its verdict."""
    if row.metric == "run":
        return row.verdict
    if isnan(row.value):
        return "never" + MARKS["fail"] if row.verdict == "fail" else "-"
    scale = METRICS[row.metric].shown if row.metric in METRICS else None
    return exact_or_zero(row.value * (scale[1] if scale else 1.0)) + MARKS.get(row.verdict, "")


def exact_or_zero(value: float) -> str:
    """A number of three digits; what is below 1e-9 of the unit is 0."""
    return "0" if abs(value) < 1e-9 else exact_number(value)


def _apart(row: Row, ours: Row | None) -> str:
    """Difference from the reference: a ratio for times."""
    if ours is None or not isfinite(row.value) or not isfinite(ours.value) or row.metric != ours.metric:
        return "-"
    if row is ours:
        return "="
    if row.metric.startswith("time."):
        return f"{number(row.value / ours.value)}×" if ours.value > 0 else "-"  # noqa: RUF001
    scale = METRICS[row.metric].shown
    off = (row.value - ours.value) * (scale[1] if scale else 1.0)
    return ("+" if off > 0 else "") + exact_or_zero(off)


def facts(entry: Entry) -> dict[str, object]:
    """Details of a cell for its dialog."""
    row = entry.row
    unit = unit_of(row.metric) if row.metric in METRICS else ""
    facts = [("metric", f"{row.metric} {row.subject}".strip()), ("value", f"{entry.text} {unit}".strip())]
    if row.metric in METRICS:
        facts.append(("definition", METRICS[row.metric].formula))
    if isfinite(row.value):
        facts.append(("value [SI]", f"{row.value!r} {row.unit}"))
    facts += [("difference from the reference", f"{entry.apart}")]
    if isfinite(row.limit):
        facts.append(("limit [SI]", f"{row.limit:g} {row.unit}"))
    facts += [("verdict", row.verdict)] if row.verdict else []
    facts += [("reason", row.reason)] if row.reason else []
    head = {"scene": row.scenario, "engine": row.engine, "profile": row.profile}
    return {**head, "facts": facts, "command": reproduce(row)}


def table(
    scenes: dict[str, list[Row]], columns: Sequence[Column]
) -> tuple[str, dict[str, dict[str, object]]]:
    """The matrix as HTML, and the details of its cells by their id."""
    cells: dict[str, dict[str, object]] = {}
    body = []
    for scene, rows in scenes.items():
        found = entries(rows, columns)
        line = []
        for topic in TOPICS:
            for number_of, column in enumerate(columns):
                edge = " first" if not number_of else ""
                entry = found.get((topic.name, column))
                if entry is None:
                    line.append(f'<td class="none{edge}">-</td>')
                    continue
                cells[entry.id] = facts(entry)
                line.append(_cell(entry, edge, topic.name))
        link = f'<a href="#scene-{escape(scene, quote=True)}">{escape(scene)}</a>'
        body.append(f'<tr><th scope="row">{link}</th>{"".join(line)}</tr>')
    return f'<table class="matrix">{_head(columns)}<tbody>{"".join(body)}</tbody></table>', cells


def _cell(entry: Entry, edge: str, topic: str) -> str:
    verdict = entry.row.verdict or "plain"
    said = f"{entry.row.scenario}, {entry.row.engine}, {topic}: {entry.text}"
    return (
        f'<td class="shade{entry.shade} {escape(verdict)}{edge}">'
        f'<button type="button" data-cell="{escape(entry.id)}" aria-label="{escape(said)}">'
        f'<span class="value">{escape(entry.text)}</span><span class="apart">{escape(entry.apart)}</span>'
        "</button></td>"
    )


def _head(columns: Iterable[Column]) -> str:
    names = [f'<th scope="col" title="{escape(p)}">{escape(e)}</th>' for e, p in columns]
    units = {"overlap": "mm", "energy": "mJ or 1", "friction": "share", "time": "µs"}
    groups = "".join(
        f'<th scope="colgroup" colspan="{len(names)}">{topic.name} <small>{units[topic.name]}</small></th>'
        for topic in TOPICS
    )
    first = [
        name.replace("<th ", '<th class="first" ', 1) if k == 0 else name for k, name in enumerate(names)
    ]
    return f"<thead><tr><td></td>{groups}</tr><tr><td></td>{''.join(first) * len(TOPICS)}</tr></thead>"

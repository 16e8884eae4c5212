"""The matrix of scenes and engines (`views/matrix.py`) as HTML, with the details of its cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from html import escape
from math import isfinite

from touchstone.reports.metrics import METRICS, label
from touchstone.reports.page.html import Change, Inline, Linked, fold, long_table
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


def table(found: Found, columns: Sequence[Column]) -> tuple[str, dict[str, dict[str, object]]]:
    """The matrix as HTML, and the details of its cells by their id."""
    cells: dict[str, dict[str, object]] = {}
    body = []
    for scene, mine in found.items():
        line = []
        for topic in (LIMITS, *(topic.name for topic in TOPICS)):
            for number_of, column in enumerate(columns):
                edge = " first" if not number_of else ""
                entry = mine.get((topic, column))
                if entry is None:
                    line.append(f'<td class="none{edge}">-</td>')
                    continue
                cells[entry.id] = facts(entry)
                line.append(_cell(entry, edge, topic))
        link = f'<a href="#scene-{escape(scene, quote=True)}">{escape(scene)}</a>'
        body.append(f'<tr><th scope="row">{link}</th>{"".join(line)}</tr>')
    return f'<table class="matrix">{_head(columns)}<tbody>{"".join(body)}</tbody></table>', cells


def worst_part(found: Found, columns: Sequence[Column]) -> str:
    """A row for each column with its worst scene in each topic; "" where the matrix has one row or column."""
    if len(found) < 2 or len(columns) < 2:
        return ""
    worst, body = worst_of(found, columns), []
    for column in columns:
        line = []
        for topic in (LIMITS, *(topic.name for topic in TOPICS)):
            entry = worst.get((topic, column))
            if entry is None:
                line.append('<td class="none">-</td>')
                continue
            if topic == LIMITS:
                mark = f" <b>{escape(entry.mark)}</b>" if entry.mark else ""
                value = f'<span class="value">{escape(entry.text)}</span>'
                line.append(f'<td class="{escape(entry.verdict)} counted">{value}{mark}</td>')
                continue
            seen = entry.text != "-" or entry.mark
            scene = Linked(entry.row.scenario, scene=entry.row.scenario).html if seen else ""
            line.append(_cell(entry, "", topic, scene))
        body.append(
            f'<tr data-engine="{escape(column[0])}"><th scope="row">{_name(column)}</th>{"".join(line)}</tr>'
        )
    heads = [
        ("limits met", ""),
        *((topic.name, topic.unit) for topic in TOPICS[:-1]),
        ("time", "over the fastest"),
    ]
    names = "".join(f'<th scope="col">{name} <small>{unit}</small></th>' for name, unit in heads)
    head = f"<thead><tr><td></td>{names}</tr></thead>"
    table = f'<table class="matrix worst">{head}<tbody>{"".join(body)}</tbody></table>'
    return f'<section><h2>The worst of each engine</h2><div class="wide">{table}</div></section>'


def _name(column: Column) -> str:
    engine, profile = column
    return f"{escape(engine)} <small>{escape(profile)}</small>"


def _cell(entry: Entry, edge: str, topic: str, scene: str = "") -> str:
    verdict = entry.verdict or "plain"
    said = f"{entry.row.scenario}, {entry.row.engine}, {topic}: {entry.text} {entry.mark}".strip()
    mark = f" <b>{escape(entry.mark)}</b>" if entry.mark else ""
    apart = entry.text if topic == LIMITS else entry.apart
    return (
        f'<td class="{topic} shade{entry.shade} {escape(verdict)}{edge}">'
        f'<button type="button" data-cell="{escape(entry.id)}" aria-label="{escape(said)}" '
        f'title="{escape(title(entry))}">'
        f'<span class="value">{escape(entry.text)}</span><span class="apart">{escape(apart)}</span>{mark}'
        f"</button>{scene}</td>"
    )


def _head(columns: Sequence[Column]) -> str:
    counts = Counter(engine for engine, _ in columns)
    shown = [_name(column) if counts[column[0]] > 1 else escape(column[0]) for column in columns]
    titles = [escape(profile) for _, profile in columns]
    names = [f'<th scope="col" title="{p}"><span>{name}</span></th>' for name, p in zip(shown, titles)]
    heads = [(LIMITS, "met"), *((topic.name, topic.unit) for topic in TOPICS)]
    groups = "".join(
        f'<th scope="colgroup" colspan="{len(names)}">{name} <small>{unit}</small></th>'
        for name, unit in heads
    )
    first = [
        name.replace("<th ", '<th class="first" ', 1) if k == 0 else name for k, name in enumerate(names)
    ]
    return f"<thead><tr><td></td>{groups}</tr><tr><td></td>{''.join(first) * len(heads)}</tr></thead>"


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
        rows: list[list[Inline]] = []
        for one in mine[:MOST]:
            figure = metric_part(one.metric, one.subject)
            rows.append([scene_part(one.scene, scenes), one.engine, figure, one.moved, one.text])
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


def remarks(rows: Iterable[Row]) -> str:
    """Why runs of a scene did not take place or ended early."""
    lines = [f"{row.verdict}: {row.engine} {row.profile}: {row.reason}" for row in rows]
    return "".join(f"<p class=remark>{escape(line)}</p>" for line in lines)

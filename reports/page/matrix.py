"""The matrix of scenes and engines (`views/matrix.py`) as HTML, with the details of its cells."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from html import escape
from math import isfinite

from touchstone.reports.metrics import METRICS, label
from touchstone.reports.results import Row
from touchstone.reports.run.reproduce import reproduce, script_command
from touchstone.reports.views.matrix import LIMITS, TOPICS, Entry, entries, missed_line, shown
from touchstone.reports.views.tables import Column, quantity


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


def table(
    scenes: dict[str, list[Row]], columns: Sequence[Column]
) -> tuple[str, dict[str, dict[str, object]]]:
    """The matrix as HTML, and the details of its cells by their id."""
    cells: dict[str, dict[str, object]] = {}
    body = []
    for scene, rows in scenes.items():
        found = entries(rows, columns)
        line = []
        for topic in (LIMITS, *(topic.name for topic in TOPICS)):
            for number_of, column in enumerate(columns):
                edge = " first" if not number_of else ""
                entry = found.get((topic, column))
                if entry is None:
                    line.append(f'<td class="none{edge}">-</td>')
                    continue
                cells[entry.id] = facts(entry)
                line.append(_cell(entry, edge, topic))
        link = f'<a href="#scene-{escape(scene, quote=True)}">{escape(scene)}</a>'
        body.append(f'<tr><th scope="row">{link}</th>{"".join(line)}</tr>')
    return f'<table class="matrix">{_head(columns)}<tbody>{"".join(body)}</tbody></table>', cells


def _cell(entry: Entry, edge: str, topic: str) -> str:
    verdict = entry.verdict or "plain"
    said = f"{entry.row.scenario}, {entry.row.engine}, {topic}: {entry.text} {entry.mark}".strip()
    mark = f" <b>{escape(entry.mark)}</b>" if entry.mark else ""
    apart = entry.text if topic == LIMITS else entry.apart
    return (
        f'<td class="{topic} shade{entry.shade} {escape(verdict)}{edge}">'
        f'<button type="button" data-cell="{escape(entry.id)}" aria-label="{escape(said)}" '
        f'title="{escape(title(entry))}">'
        f'<span class="value">{escape(entry.text)}</span><span class="apart">{escape(apart)}</span>{mark}'
        "</button></td>"
    )


def _head(columns: Iterable[Column]) -> str:
    names = [f'<th scope="col" title="{escape(p)}">{escape(e)}</th>' for e, p in columns]
    heads = [(LIMITS, "met"), *((topic.name, topic.unit) for topic in TOPICS)]
    groups = "".join(
        f'<th scope="colgroup" colspan="{len(names)}">{name} <small>{unit}</small></th>'
        for name, unit in heads
    )
    first = [
        name.replace("<th ", '<th class="first" ', 1) if k == 0 else name for k, name in enumerate(names)
    ]
    return f"<thead><tr><td></td>{groups}</tr><tr><td></td>{''.join(first) * len(heads)}</tr></thead>"

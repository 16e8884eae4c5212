"""The matrix of scenes and engines: limits met, and four topics as values and differences from the reference.

A cell shows the worst subject of its column, and the gravest mark of all limits of its topic, whichever
metric they limit. Its colour begins where a value matters (`colour_start`), not where it can be measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape
from math import inf, isfinite, isnan, log

from touchstone.reports.metrics import METRICS
from touchstone.reports.metrics.labels import label
from touchstone.reports.page.content import Column
from touchstone.reports.results import Row
from touchstone.reports.run.reproduce import reproduce, script_command
from touchstone.reports.run.request import REFERENCE
from touchstone.reports.verdict.counts import WORST_LAST, Count, counted
from touchstone.reports.views.tables import MARKS, exact_number, number, quantity


@dataclass(frozen=True, slots=True)
class Topic:
    """A group of columns.

    Attributes:
        metrics: metrics whose value fills a cell: the first that a scene has.
        starts: beginnings of the names of all metrics whose limits mark the cell.
        unit: unit of the column's head.
    """

    name: str
    metrics: tuple[str, ...]
    starts: tuple[str, ...]
    unit: str


LIMITS = "limits"
TOPICS = (
    Topic("overlap", ("overlap.max",), ("overlap.",), "mm"),
    Topic("energy", ("energy.injected", "energy.gain"), ("energy.",), "mJ or 1"),
    Topic(
        "friction",
        ("friction.deficit", "friction.cone", "friction.stop", "rolling.time"),
        ("friction.", "rolling."),
        "share",
    ),
    Topic("time", ("time.frame.median",), ("time.", "ratio.time"), "µs"),
)
MATTERS = {"overlap.max": 1e-3, "energy.injected": 1e-2, "energy.gain": 0.05}
"""Value from which a reader cares [the metric's unit]: a millimetre of a ball of 5 cm is not seen; a
hundredth of a joule is about 1 % of the motion of a pushed body."""
SHARE = 0.05
"""The same of friction [1]: 5 % of mu."""
SHADES, FACTOR, TIMES = 5, 3.0, 2.0
"""Shades of a cell, 0 to SHADES; a shade per FACTOR beyond `colour_start`, and per TIMES beyond the fastest
time."""
SCALE = (
    "Colour begins at the limit, and not below 1 mm, 10 mJ and a share of 5 %; each shade is 3 times "
    "the one before. Times, in grey: each shade is twice the fastest engine's."
)
SMALLEST = 0.01
"""Least value that a cell shows [shown unit]: smaller ones are in its hover."""
MISSED = ("fail", "error", "unjudged", "known")
"""Verdicts that mark a cell, the gravest first."""


@dataclass(frozen=True, slots=True)
class Entry:
    """A cell: its row, texts and shade, and rows of its topic that miss a limit; `id` is its deep link."""

    row: Row
    text: str
    apart: str = "-"
    shade: int = 0
    missed: tuple[Row, ...] = ()
    subjects: int = 1

    @property
    def id(self) -> str:
        """Key of the cell in links."""
        return "/".join(
            (self.row.scenario, self.row.engine, self.row.profile, self.row.metric, self.row.subject)
        )

    @property
    def verdict(self) -> str:
        """The gravest verdict of the topic."""
        return self.missed[0].verdict if self.missed else self.row.verdict

    @property
    def mark(self) -> str:
        """Mark of the verdict, as in the legend."""
        return MARKS.get(self.verdict, "").strip()


def entries(rows: Sequence[Row], columns: Sequence[Column]) -> dict[tuple[str, Column], Entry]:
    """Cells of one scene by topic and column."""
    mine = {column: [row for row in rows if (row.engine, row.profile) == column] for column in columns}
    found = _limit_entries(rows, mine)
    ours = next((column for column in columns if column[0] == REFERENCE), None)
    for topic in TOPICS:
        metric = next(
            (m for m in topic.metrics if any(r.metric == m and isfinite(r.value) for r in rows)), ""
        )
        values = {column: [r for r in some if r.metric == metric] for column, some in mine.items()}
        known = {column: [r for r in some if isfinite(r.value)] for column, some in values.items()}
        least = min((abs(r.value) for some in known.values() for r in some), default=0.0)
        for column, some in mine.items():
            missed = gravest(r for r in some if r.metric.startswith(topic.starts))
            runs = [r for r in some if r.metric == "run"]
            shown_rows = known[column] or missed or values[column] or runs
            if not shown_rows:
                continue
            row = max(shown_rows, key=weight)
            base = known.get(ours, []) if ours else []
            found[topic.name, column] = Entry(
                row,
                short(row) if row.metric in (metric, "run") else "-",
                _apart(row, next((r for r in base if r.subject == row.subject), None)),
                _shade(row, least) if row.metric == metric else 0,
                tuple(missed or gravest(runs)),
                len(known[column]),
            )
    return found


def _limit_entries(
    rows: Sequence[Row], mine: Mapping[Column, Sequence[Row]]
) -> dict[tuple[str, Column], Entry]:
    """Cells of the limits met, of all topics; of a run that did not end, its verdict."""
    played = [row for some in mine.values() for row in some if row.verdict or "ratio." not in row.metric]
    counts: dict[Column, Count] = counted(played, list(mine))
    found = {}
    for column, some in mine.items():
        runs = [row for row in some if row.metric == "run"]
        if runs:
            found[LIMITS, column] = Entry(runs[0], runs[0].verdict, missed=tuple(gravest(runs)))
        elif column in counts and counts[column].limits:
            count = counts[column]
            base = replace(some[0], metric=LIMITS, subject="", verdict="pass", reason="", limit=inf)
            text = f"{count.verdicts['pass']}/{sum(count.verdicts[name] for name in WORST_LAST)}"
            found[LIMITS, column] = Entry(base, text, missed=tuple(gravest(some)))
    return found


def gravest(rows: Iterable[Row]) -> list[Row]:
    """The rows that miss a limit, the gravest first: by verdict, then by how far beyond the limit."""
    missed = [row for row in rows if row.verdict in MISSED]
    return sorted(missed, key=lambda row: (MISSED.index(row.verdict), -excess(row)))


def excess(row: Row) -> float:
    """A value over its limit [1]; infinite for what has no value or must be zero."""
    if isnan(row.value) or row.limit == 0 or row.metric == "run":
        return inf
    return abs(row.value) / row.limit if isfinite(row.limit) else abs(row.value)


def weight(row: Row) -> tuple[int, float]:
    """Orders the subjects of a metric: the worst has the gravest verdict, then the largest value."""
    grave = -MISSED.index(row.verdict) if row.verdict in MISSED else -len(MISSED)
    return grave, abs(row.value) if isfinite(row.value) else -1.0


def colour_start(row: Row) -> float:
    """Value beyond which a cell is coloured: the limit, and no less than what a reader cares about."""
    matters = MATTERS.get(row.metric, SHARE)
    return max(row.limit, matters) if isfinite(row.limit) else matters


def _shade(row: Row, least: float) -> int:
    size = abs(row.value)
    if not isfinite(size):
        return 0
    if row.metric.startswith("time."):
        return min(SHADES, int(log(size / least, TIMES) + 1e-9)) if least > 0 else 0
    start = colour_start(row)
    return min(SHADES, 1 + int(log(size / start, FACTOR))) if size > start else 0


def figure(row: Row) -> str:
    """A row's value in the unit of tables, without a mark."""
    if row.metric == "run":
        return row.verdict
    if isnan(row.value):
        return "never" if row.verdict == "fail" else "-"
    scale = METRICS[row.metric].shown if row.metric in METRICS else None
    return exact_or_zero(row.value * (scale[1] if scale else 1.0))


def short(row: Row) -> str:
    """A row's value as a cell shows it: what is below SMALLEST is no more than that."""
    text = figure(row)
    value = quantity(row.metric, row.value, row.unit)[0]
    if row.metric == "run" or text in ("-", "never", "0"):
        return text
    return f"<{SMALLEST:g}" if abs(float(value)) < SMALLEST else text


def shown(row: Row) -> str:
    """A row's value in the unit of tables, with the mark of its verdict."""
    return figure(row) if row.metric == "run" else figure(row) + MARKS.get(row.verdict, "")


def exact_or_zero(value: float) -> str:
    """A number of three digits; what is below 1e-9 of the unit is 0."""
    return "0" if abs(value) < 1e-9 else exact_number(value)


def _apart(row: Row, ours: Row | None) -> str:
    """Difference from the reference's value of the same subject: a ratio for times."""
    if ours is None or not isfinite(row.value) or row.metric != ours.metric:
        return "-"
    if row is ours:
        return "="
    if row.metric.startswith("time."):
        return f"{number(row.value / ours.value)}×" if ours.value > 0 else "-"  # noqa: RUF001
    scale = METRICS[row.metric].shown
    off = (row.value - ours.value) * (scale[1] if scale else 1.0)
    return ("+" if off > 0 else "") + exact_or_zero(off)


def missed_line(row: Row) -> str:
    """A row that misses a limit, in one line: mark, figure, subject, value and limit."""
    value, unit = quantity(row.metric, row.value, row.unit)
    name = f"{MARKS[row.verdict].strip()} {label(row.metric)} {row.subject}".strip()
    if row.metric == "run" or isnan(row.value):
        return f"{name}: {row.verdict}"
    limit = f", limit {quantity(row.metric, row.limit, row.unit)[0]}" if isfinite(row.limit) else ""
    return f"{name}: {value} {unit}".strip() + limit


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

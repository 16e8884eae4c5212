"""The matrix of scenes and engines: limits met, and four topics as values and differences from the reference.

A cell shows the worst subject of its column, and the gravest mark of all limits of its topic, whichever
metric they limit. Its colour begins where a value matters (`colour_start`), not where it can be measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan, log

import pandas as pd

from touchstone.reports.metrics import in_tables, label
from touchstone.reports.results import NOT_RUN, UNJUDGED, Row
from touchstone.reports.runner.request import REFERENCE
from touchstone.reports.verdict.judge import WORST_LAST, Count, counted
from touchstone.reports.views.tables import MARKS, Column, exact_number, number, quantity
from touchstone.scenarios.plural import plural


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


BAD, WARN, GOOD = "bad", "warn", "good"
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
    """A cell: its row, texts and shade, and rows of its topic that miss a limit; `id` is its deep link, `met`
    how many limits are met, and of how many."""

    row: Row
    text: str
    apart: str = "-"
    shade: int = 0
    missed: tuple[Row, ...] = ()
    subjects: int = 1
    met: tuple[int, int] = (0, 0)

    @property
    def id(self) -> str:
        """Key of the cell in links."""
        row = self.row
        return "/".join((row.scenario, row.engine, row.profile, row.metric, row.subject))

    @property
    def verdict(self) -> str:
        """The gravest verdict of the topic."""
        return self.missed[0].verdict if self.missed else self.row.verdict

    @property
    def mark(self) -> str:
        """Mark of the verdict, as in the legend."""
        return MARKS.get(self.verdict, "").strip()


Cells = dict[tuple[str, Column], Entry]
"""Cells of one scene by topic and column."""
Found = dict[str, Cells]


def entries(rows: Sequence[Row], columns: Sequence[Column]) -> Cells:
    """Cells of one scene."""
    mine = {column: [row for row in rows if (row.engine, row.profile) == column] for column in columns}
    found = _limit_entries(rows, mine)
    ours = next((column for column in columns if column[0] == REFERENCE), None)
    measured = {row.metric for row in rows if isfinite(row.value)}
    for topic in TOPICS:
        metric = next((one for one in topic.metrics if one in measured), "")
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


def _limit_entries(rows: Sequence[Row], mine: Mapping[Column, Sequence[Row]]) -> Cells:
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
            met = count.verdicts["pass"], sum(count.verdicts[name] for name in WORST_LAST)
            found[LIMITS, column] = Entry(base, "/".join(map(str, met)), missed=tuple(gravest(some)), met=met)
    return found


def worst_of(found: Found, columns: Sequence[Column]) -> Cells:
    """The worst cell of each topic and column in any scene, by the gravest verdict, then by the share of the
    value where its colour begins; a time is shown over the fastest one of its scene. Limits are counted."""
    worst: Cells = {}
    for column in columns:
        counts = [mine[LIMITS, column] for mine in found.values() if (LIMITS, column) in mine]
        if counts:
            met = sum(one.met[0] for one in counts), sum(one.met[1] for one in counts)
            missed = gravest(row for one in counts for row in one.missed)
            text = "/".join(map(str, met)) if met[1] else counts[0].text
            worst[LIMITS, column] = replace(counts[0], text=text, missed=tuple(missed), met=met)
        for topic in TOPICS:
            key = (topic.name, column)
            if cells := [_measured(mine, key) for mine in found.values() if key in mine]:
                worst[key] = max(cells, key=lambda one: one[0])[1]
    return worst


def _measured(mine: Cells, key: tuple[str, Column]) -> tuple[tuple[int, float], Entry]:
    """How bad a cell of a scene is, and the cell with the text of `worst_of`."""
    cell = mine[key]
    grave, size = weight(replace(cell.row, verdict=cell.verdict))
    if not cell.row.metric.startswith("time."):
        return (grave, size / colour_start(cell.row)), cell
    times = [one.row.value for (topic, _), one in mine.items() if topic == key[0] and one.row.value > 0]
    ratio = size / min(times) if times else size
    return (grave, ratio), replace(cell, text=f"{number(ratio)}×")  # noqa: RUF001


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
    return exact_or_zero(row.value * in_tables(row.metric)[1])


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
    off = (row.value - ours.value) * in_tables(row.metric)[1]
    return ("+" if off > 0 else "") + exact_or_zero(off)


def missed_line(row: Row) -> str:
    """A row that misses a limit, in one line: mark, figure, subject, value and limit."""
    value, unit = quantity(row.metric, row.value, row.unit)
    name = f"{MARKS[row.verdict].strip()} {label(row.metric)} {row.subject}".strip()
    if row.metric == "run" or isnan(row.value):
        return f"{name}: {row.verdict}"
    limit = f", limit {quantity(row.metric, row.limit, row.unit)[0]}" if isfinite(row.limit) else ""
    return f"{name}: {value} {unit}".strip() + limit


def by_cause(rows: Iterable[Row]) -> list[list[Row]]:
    """Rows that miss a limit, the gravest first, in groups of a verdict, column, metric and cause."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in gravest(rows):
        # The remark of a row comes before its cause.
        cause = cause_of(row).rpartition("; ")[2]
        groups.setdefault((row.verdict, row.engine, row.profile, row.metric, cause), []).append(row)
    return list(groups.values())


def cause_of(row: Row) -> str:
    """The reason of a row without a command."""
    return row.reason.rpartition(": touchstone ")[0] or row.reason


def verdict_of(frame: pd.DataFrame) -> tuple[str, str]:
    """Level and sentence of a run by itself."""
    verdicts = ("fail", "error", "known", UNJUDGED, "pass")
    fails, errors, known, unjudged, met = (int((frame.verdict == one).sum()) for one in verdicts)
    missing = sorted(set(frame.engine[(frame.metric == "run") & frame.verdict.isin(NOT_RUN[1:])]))
    rest = [plural(known, "known failing")] if known else []
    rest += [f"{unjudged} not judged"] if unjudged else []
    rest += [f"{', '.join(missing)} did not play"] if missing else []
    tail = f" ({', '.join(rest)})" if rest else ""
    if fails or errors:
        broken = frame[frame.verdict.isin(["fail", "error"])]
        who = ", ".join(f"{name} {count}" for name, count in broken.engine.value_counts().items())
        what = [f"{plural(fails, 'limit')} broken"] if fails else []
        what += [f"{plural(errors, 'run')} failed"] if errors else []
        return BAD, f"{' and '.join(what)}: {who}; {plural(met, 'limit')} met{tail}."
    if not met:
        return WARN, f"Nothing was judged{tail}."
    return (WARN if unjudged or missing else GOOD), f"All {met} limits met{tail}."

"""Overview of many scenes: limits that each engine meets per scene, and the figures that stand out."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import pandas as pd

from touchstone.reports.metrics import METRICS
from touchstone.reports.results import NOT_RUN, UNJUDGED, Row, rows_of
from touchstone.reports.verdict.counts import WORST_LAST, Count, counted
from touchstone.reports.views.tables import HIDDEN, MARKS, Cell, Column, cell_of, columns_of, number, unit_of

NOT_MET = ("known", "fail", "error")
"""Verdicts that stand out, the worst last."""
RATIO = "ratio.time"
SHOWN_AS_ZERO = 1e-12
"""Value below which a figure counts as 0 [1] and is shown as 0."""
BODY = re.compile(r"^of \S+; ")
"""The remark that names the worst body, which precedes a reason."""


@dataclass(frozen=True, slots=True)
class Section:
    """One scene: the outcome of its limits per column, and rows of (metric, unit, cells)."""

    scenario: str
    outcome: list[Cell]
    rows: list[tuple[str, str, list[Cell]]]


@dataclass(frozen=True, slots=True)
class Overview:
    """All scenes. `totals` holds the numbers that TOTALS names, per column; `remarks` are lines of text."""

    heads: list[tuple[str, str, str]]
    sections: list[Section]
    totals: list[tuple[str, list[int]]]
    remarks: list[str]


TOTALS = (
    *("limits", "met", "by construction", "known", "causes", "unjudged", "broken", "errors"),
    *("not applicable", "not run"),
)
"""Limits count per metric and scene; causes are those of the known failings; errors are failed runs."""


def overview(frame: pd.DataFrame, shown: Collection[Column] = ()) -> Overview:
    """The overview of a long table; `shown` (engine, profile) columns, or all."""
    rows = [
        row
        for row in rows_of(frame)
        if row.engine != "all" and (not row.metric.startswith("ratio.") or row.verdict)
    ]
    rows = [row for row in rows if not shown or (row.engine, row.profile) in shown]
    columns = columns_of(rows)
    scenes: dict[str, list[Row]] = {}
    for row in rows:
        scenes.setdefault(row.scenario, []).append(row)
    counts = {name: counted(part, list(columns)) for name, part in scenes.items()}
    totals = [(" ".join(c), _total(scenes.values(), counts.values(), c)) for c in columns]
    return Overview(
        [(*column, step) for column, step in columns.items()],
        [_section(name, part, list(columns), counts[name]) for name, part in scenes.items()],
        totals,
        _remarks(rows) + _not_applicable(counts.values()),
    )


def _section(name: str, rows: list[Row], columns: list[Column], counts: Mapping[Column, Count]) -> Section:
    found: dict[str, dict[Column, Row]] = {}
    for row in rows:
        best = found.setdefault(row.metric, {})
        column = (row.engine, row.profile)
        if column not in best or _weight(row) > _weight(best[column]):
            best[column] = row
    measured = [
        metric
        for metric in METRICS
        if metric not in HIDDEN and any(row.value == row.value for row in found.get(metric, {}).values())
    ]
    # Figures that stand out, and the first that is not 0: the distance from the truth, where there is one.
    figures = [metric for metric in measured if not metric.startswith("time.")]
    first = next((m for m in figures if any(abs(row.value) > SHOWN_AS_ZERO for row in found[m].values())), "")
    kept = [m for m in measured if m == first or any(row.verdict in NOT_MET for row in found[m].values())]
    lines = [
        (metric, unit_of(metric), [_cell(found[metric].get(column)) for column in columns]) for metric in kept
    ]
    return Section(name, [_outcome(rows, column, counts) for column in columns], lines)


def _weight(row: Row) -> tuple[int, float]:
    """The worst verdict first, then the largest value."""
    return (
        NOT_MET.index(row.verdict) if row.verdict in NOT_MET else -1,
        abs(row.value) if row.value == row.value else 0,
    )


def _cell(row: Row | None) -> Cell:
    return Cell("-") if row is None else cell_of(row)


def _outcome(rows: list[Row], column: Column, counts: Mapping[Column, Count]) -> Cell:
    """The limits met of those of the scene, or the reason why there are none."""
    run = [row for row in rows if (row.engine, row.profile) == column and row.metric == "run"]
    if run:
        return Cell(run[0].verdict, run[0].verdict)
    if column not in counts:
        return Cell("-")
    return Cell(counts[column].text, counts[column].worst)


def _total(
    scenes: Iterable[list[Row]], counts: Iterable[Mapping[Column, Count]], column: Column
) -> list[int]:
    mine = [count[column] for count in counts if column in count]
    rows = [row for scene in scenes for row in scene if (row.engine, row.profile) == column]
    causes = {_cause(row) for row in rows if row.verdict == "known"}
    verdicts = {verdict: sum(count.verdicts[verdict] for count in mine) for verdict in WORST_LAST}
    runs = [row.verdict for row in rows if row.metric == "run"]
    return [
        sum(count.limits for count in mine),
        verdicts["pass"],
        sum(count.by_construction for count in mine),
        verdicts["known"],
        len(causes),
        verdicts[UNJUDGED],
        verdicts["fail"],
        verdicts["error"] + runs.count("error"),
        sum(len(count.not_applicable) for count in mine),
        sum(verdict in NOT_RUN for verdict in runs),
    ]


def _cause(row: Row) -> str:
    """A reason without the worst body."""
    return BODY.sub("", row.reason)


def _not_applicable(counts: Iterable[Mapping[Column, Count]]) -> list[str]:
    """The reasons why limits do not apply, each once, with the metrics and counts."""
    found: dict[str, dict[str, int]] = {}
    for scene in counts:
        for count in scene.values():
            for metric, reason in count.not_applicable.items():
                metrics = found.setdefault(reason, {})
                metrics[metric] = metrics.get(metric, 0) + 1
    return [
        f"does not apply, {sum(metrics.values())} times: {reason}: {', '.join(metrics)}"
        for reason, metrics in sorted(found.items(), key=lambda item: -sum(item[1].values()))
    ]


def _remarks(rows: list[Row]) -> list[str]:
    """Broken limits, skipped runs and known failings: each reason once per engine, with its figures."""
    found: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if (
            row.verdict in NOT_MET
            or row.verdict == UNJUDGED
            or (row.verdict in NOT_RUN and row.metric == "run")
        ):
            reason = _cause(row)
            figure = row.scenario if row.metric == "run" else f"{row.scenario} {_figure(row)}"
            figure += f" (limit {row.limit:.2g})" if row.verdict == "fail" else ""
            found.setdefault((f"{row.verdict}: {row.engine} {row.profile}", reason), []).append(figure)
    order = (*reversed(NOT_MET), UNJUDGED, *NOT_RUN)
    lines = [f"{who}: {reason}: {', '.join(figures)}" for (who, reason), figures in found.items()]
    return sorted(lines, key=lambda line: order.index(line.partition(":")[0])) + _ratios(rows)


def _ratios(rows: list[Row]) -> list[str]:
    ratios = [row for row in rows if row.metric == RATIO and row.profile == "balanced"]
    if not ratios:
        return []
    least, most = (pick(ratios, key=lambda row: row.value) for pick in (min, max))
    return [
        f"ratio.time, one run: the reference takes {number(least.value)} ({least.scenario}) to "
        f"{number(most.value)} ({most.scenario}) of the fastest engine's mean frame with contact"
    ]


def _figure(row: Row) -> str:
    unit = "" if row.unit == "1" else f" {row.unit}"
    return f"{row.metric} {row.subject}".strip() + f" {number(row.value)}{unit}"


LEGEND = (
    f"n of m (k): limits met of all that the scene has, k do not apply;{MARKS['fail']} one is broken;"
    f"{MARKS['known']} the rest are known failings\n"
    "below: the first figure of the scene, and every one that misses a limit, of the worst body"
)

"""The tables of a run on a terminal."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table
from rich.text import Text

from touchstone.adapters.recording import Recording
from touchstone.reports.console.fitted import fitted
from touchstone.reports.metrics import METRICS
from touchstone.reports.results import NOT_RUN, UNJUDGED, Row, rows_of
from touchstone.reports.run.farthest_apart import TITLE as APART
from touchstone.reports.run.farthest_apart import apart_table, headlines
from touchstone.reports.run.reproduce import script_command
from touchstone.reports.verdict.judge import WORST_LAST, Count, counted
from touchstone.reports.views.frame_budget import HEADS, NOTE, budget_rows, budgets
from touchstone.reports.views.losses import HEADS as LOSS_HEADS
from touchstone.reports.views.losses import NOTE as LOSS_NOTE
from touchstone.reports.views.losses import TITLE, loss_rows, scene_lines, unmeasured_lines
from touchstone.reports.views.published import NOTE as PUBLISHED_NOTE
from touchstone.reports.views.published import TITLE as PUBLISHED
from touchstone.reports.views.published import published_table
from touchstone.reports.views.tables import (
    HIDDEN,
    LEGEND,
    MARKS,
    Cell,
    Column,
    Grid,
    cell_of,
    columns_of,
    grid,
    number,
    unit_of,
)
from touchstone.scenarios.scenario import Scenario

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
        (metric, unit_of(metric), [_overview_cell(found[metric].get(column)) for column in columns])
        for metric in kept
    ]
    return Section(name, [_outcome(rows, column, counts) for column in columns], lines)


def _weight(row: Row) -> tuple[int, float]:
    """The worst verdict first, then the largest value."""
    return (
        NOT_MET.index(row.verdict) if row.verdict in NOT_MET else -1,
        abs(row.value) if row.value == row.value else 0,
    )


def _overview_cell(row: Row | None) -> Cell:
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


OVERVIEW_LEGEND = (
    f"n of m (k): limits met of all that the scene has, k do not apply;{MARKS['fail']} one is broken;"
    f"{MARKS['known']} the rest are known failings\n"
    "below: the first figure of the scene, and every one that misses a limit, of the worst body"
)


STYLES = {
    "fail": "bold red",
    "known": "yellow",
    "error": "bold red",
    **dict.fromkeys((UNJUDGED, *NOT_RUN), "dim"),
    "pass": "",
}
SCENES_IN_FULL = 8
"""Largest number of scenes that are shown as whole tables; more are shown as an overview."""
Padding = tuple[int, int] | tuple[int, int, int, int]
NARROW = 112
"""Least width of plain output (files, pipes) in characters, which a table needs."""


class FittingConsole(Console):
    """A console that prints tables which are too wide in parts (`fitted`), and texts as they are: names are
    the user's."""

    def __init__(self, **options: Any) -> None:
        super().__init__(markup=False, emoji=False, **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print objects; tables fit the width."""
        parts = [part for one in objects for part in (fitted(one, self) if isinstance(one, Table) else [one])]
        super().print(*parts, **options)


def console(**options: bool) -> Console:
    """A console as wide as the terminal; where there is none, as COLUMNS says, or NARROW."""
    probe = FittingConsole(**options)
    if probe.is_terminal or os.environ.get("COLUMNS", "").isdigit():
        return probe
    return FittingConsole(width=NARROW, **options)


def table_of(title: str, heads: Sequence[str], left: int = 1, padding: Padding = (0, 1)) -> Table:
    """An empty table of plain lines whose first `left` columns hold words, the others numbers."""
    table = Table(title=title or None, title_justify="left", box=SIMPLE, padding=padding, pad_edge=False)
    for k, head in enumerate(heads):
        table.add_column(Text(head), justify="left" if k < left else "right", no_wrap=True)
    return table


def print_notes(notes: Iterable[str], out: Console) -> None:
    """Print the notes that explain a table."""
    for note in notes:
        out.print(note, style="dim", highlight=False)


def show(frame: pd.DataFrame, out: Console, shown: Collection[tuple[str, str]] = ()) -> None:
    """Print one table per scene with the `shown` columns, its ratios, and every verdict other than pass; an
    overview if there are more than SCENES_IN_FULL scenes."""
    if frame.scenario.nunique() > SCENES_IN_FULL:
        _show_overview(overview(frame, shown), out)
        show_apart(frame, out)
        show_losses(frame, out)
        return
    for scenario in dict.fromkeys(frame.scenario):
        show_scene(frame[frame.scenario == scenario], out, shown)
    show_losses(frame, out)


def show_scene(scene: pd.DataFrame, out: Console, shown: Collection[tuple[str, str]] = ()) -> None:
    """Print the table of the scene with the rows `scene`, its ratios, and every verdict other than pass."""
    name = scene.scenario.iloc[0]
    for line in headlines(rows_of(scene)):
        out.print(line, highlight=False, soft_wrap=True)
    out.print(_table(name, grid(scene, name, shown)))
    out.print(Text(LEGEND, style="dim"))
    out.print()
    show_apart(scene, out)
    ratios = ratio_rows(scene)
    if ratios:
        out.print(_ratio_table(ratios))
        print_notes([RATIO_NOTE], out)
    _print_lines(remark_lines(scene, shown), out)


def show_apart(frame: pd.DataFrame, out: Console) -> None:
    """Print how far columns are apart, of several bodies."""
    rows = apart_table(rows_of(frame))
    if len(rows) > 1:
        out.print(f"{APART}:")
        for scene, body, distance, text in rows:
            place = " ".join(filter(None, (scene * (frame.scenario.nunique() > 1), body)))
            out.print(f"  {place}, {distance}" + f": {text}" * bool(text), highlight=False, soft_wrap=True)
        out.print()


def show_losses(frame: pd.DataFrame, out: Console) -> None:
    """Print where an engine does better than the reference, if engines played."""
    rows = loss_rows(frame)
    if rows:
        table = table_of(TITLE, LOSS_HEADS, left=2)
        for row in rows:
            table.add_row(*row)
        out.print(table)
        print_notes([LOSS_NOTE, *unmeasured_lines(frame)], out)
        for line in scene_lines(frame):
            out.print(line, highlight=False, soft_wrap=True)
        out.print()


def show_published(frame: pd.DataFrame, scenarios: Iterable[Scenario], out: Console) -> None:
    """Print the published values of scenes that state some, and what was measured."""
    heads, rows, sources = published_table(frame, scenarios)
    if rows:
        table = table_of(PUBLISHED, heads, left=3, padding=(0, 0, 0, 1))
        for row in rows:
            table.add_row(*row)
        out.print(table)
        print_notes([PUBLISHED_NOTE, *sources], out)


def show_budget(recordings: Mapping[tuple[str, str, str], Recording], out: Console) -> None:
    """Print the cost of the reference's frames, if it played at least two scenes."""
    found = budgets(recordings)
    if 1 < len({budget.scene for budget in found}) <= SCENES_IN_FULL:
        table = table_of("frame budget", HEADS, padding=(0, 0))
        for row in budget_rows(found):
            table.add_row(*row)
        out.print(table)
        out.print(Text(NOTE, style="dim"))


def _print_lines(lines: list[str], out: Console) -> None:
    for line in lines:
        style = "red" if line.startswith(("fail", "error")) else ""
        out.print(line, highlight=False, style=style)


def _show_overview(seen: Overview, out: Console) -> None:
    table = Table(header_style="bold")
    table.add_column("scene", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for engine, profile, step in seen.heads:
        table.add_column(f"{engine}\n{profile}\n{step} s", justify="right", no_wrap=True)
    for section in seen.sections:
        table.add_section()
        table.add_row(Text(section.scenario, style="bold"), "", *[_text(cell) for cell in section.outcome])
        for metric, unit, cells in section.rows:
            shown = [_text(cell) for cell in cells]
            table.add_row(Text(f"  {metric}"), "" if unit == "1" else unit, *shown)
    out.print(table)
    out.print(Text(OVERVIEW_LEGEND, style="dim"))
    out.print()
    totals = table_of("", ("engine", *TOTALS))
    for name, counts in seen.totals:
        totals.add_row(name, *map(str, counts))
    out.print(totals)
    _print_lines(seen.remarks, out)


def _table(scenario: str, cells: Grid) -> Table:
    table = Table(title=scenario, title_justify="left", header_style="bold")
    table.add_column("metric", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for engine, profile, step in cells.heads:
        table.add_column(f"{engine}\n{profile}\n{step} s", justify="right", no_wrap=True)
    family = ""
    for metric, subject, unit, row in cells.rows:
        if family and metric.split(".")[0] != family:
            table.add_section()
        family = metric.split(".")[0]
        name = Text.assemble(metric, (f" {subject}" if subject else "", "dim"))
        table.add_row(name, "" if unit == "1" else unit, *[_text(cell) for cell in row])
    return table


def _text(cell: Cell) -> Text:
    return Text(
        cell.marked, style="bold" if cell.outlier and cell.verdict == "" else STYLES.get(cell.verdict, "")
    )


def _ratio_table(rows: list[list[str]]) -> Table:
    table = table_of(RATIO_TITLE, RATIO_HEADS, left=2)
    for row in rows:
        table.add_row(*row)
    return table


RATIO_TITLE = "ratio.time, one run: the reference's frame over an engine's"
RATIO_HEADS = ("reference", "over", "contact", "all", "median", "p99", "frames", "overlap", "limit")
RATIO_NOTE = (
    "contact: mean over the frames in which one of the two has a contact (frames), judged where it is clear; "
    "all, median, p99: over all frames. `touchstone bench frame` restarts the engines and judges all"
)


def ratio_rows(scene: pd.DataFrame) -> list[list[str]]:
    """`ratio.time` with its other statistics, one row per pair of columns, under RATIO_HEADS."""
    found = {
        (row.profile, row.subject, row.metric): row
        for row in rows_of(scene[scene.metric.str.startswith("ratio.")])
    }
    rows = []
    for (profile, subject, metric), row in found.items():
        if metric != "ratio.time":
            continue
        others = (found.get((profile, subject, f"{metric}.{name}")) for name in ("all", "median", "p99"))
        frames = found.get((profile, subject, "ratio.frames"))
        rows.append(
            [
                profile,
                subject,
                number(row.value),
                *("" if other is None else number(other.value) for other in others),
                f"{frames.value:.0f}" if frames and frames.value else "all",
                row.reason_code.replace("-", " "),
                f"{row.verdict} {row.limit:.2g}" if row.verdict else "",
            ]
        )
    return rows


def remark_lines(scene: pd.DataFrame, shown: Collection[tuple[str, str]] = ()) -> list[str]:
    """Broken limits, failed and skipped runs, known failings of the `shown` columns (or of all), with
    reasons."""
    lines = []
    for row in rows_of(scene[scene.verdict.isin(["fail", "error", "known"])]):
        if row.verdict == "known" and shown and (row.engine, row.profile) not in shown:
            continue
        name = f"{row.metric} {row.subject}".strip()
        unit = "" if row.unit == "1" else f" {row.unit}"
        value = (
            ""
            if row.metric == "run"
            else f" {name} {number(row.value)}{unit}, limit {number(row.limit)}{unit}:"
        )
        script = script_command(row) if row.verdict == "known" else ""
        again = ": " + " | ".join(filter(None, (row.reproduce, script))) if row.reproduce or script else ""
        lines.append(f"{row.verdict}: {row.engine} {row.profile}:{value} {row.reason}{again}")
    for row in rows_of(scene[scene.verdict.isin(NOT_RUN) & (scene.metric == "run")]):
        lines.append(f"{row.verdict}: {row.engine} {row.profile}: {row.reason}")
    for reason, part in scene[scene.verdict == UNJUDGED].groupby("reason", sort=False):
        lines.append(f"{UNJUDGED}: {', '.join(dict.fromkeys(part.metric))}: {reason}")
    return lines

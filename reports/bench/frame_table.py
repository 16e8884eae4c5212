"""The tables of `bench frame`."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.bench.tables import MICRO, limit_text, print_remarks, spread_text, value_text
from touchstone.reports.bootstrap import RATIO, STATISTICS
from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.decomposition import FACTORS
from touchstone.reports.run.request import REFERENCE, step_text
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import table_of

MILLI = 1e3
TIMES = ("engine", "step [s]", "contact [µs]", "all", "median", "p99", "overlap\n[mm]")
RATIOS = ("reference", "over", "contact", "all", "median", "p99", *("steps", "dynamics", "a step"))
JUDGED = ("scene", "reference", "over the fastest", "statistic", "ratio", "95 % interval", "limit")
NOTES = (
    "contact: mean over the frames with a contact; all, median, p99: over all frames; a frame's time is the",
    "median over restarts. ±: how far the 95 % interval over restarts and blocks of frames reaches",
    "steps x dynamics x a step = the ratio with contact: of numbers of steps, of link dynamics, of the rest",
)
WORDS = {"": "contact", ".all": "all", ".median": "median", ".p99": "p99"}


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print per scene the times of all columns and the reference's ratios, then every ratio with a limit."""
    for scenario in dict.fromkeys(frame.scenario):
        rows = rows_of(frame[frame.scenario == scenario])
        found = {(row.engine, row.profile, row.metric, row.subject): row for row in rows}
        out.print(_times(scenario, found))
        out.print(_ratios(scenario, found))
    _show_judged(frame, out)
    print_remarks(frame[frame.metric.str.startswith(("run", RATIO))], out, NOTES)


Rows = dict[tuple[str, str, str, str], Row]


def _times(scenario: str, rows: Rows):  # type: ignore[no-untyped-def]
    table = table_of(f"bench frame: {scenario}", TIMES, left=1)
    for engine, profile, metric, _ in rows:
        if metric != "time.frame":
            continue
        row = rows[engine, profile, metric, ""]
        first, *others = (rows[engine, profile, f"{metric}{suffix}", ""] for suffix in STATISTICS)
        overlap = value_text(rows.get((engine, profile, "overlap.max", "")), MILLI)
        times = [value_text(other, MICRO) for other in others]
        table.add_row(
            f"{engine} {profile}".replace(", drive=", " "),
            step_text(row.dt),
            spread_text(first, MICRO),
            *times,
            overlap,
        )
    return table


def _ratios(scenario: str, rows: Rows):  # type: ignore[no-untyped-def]
    table = table_of(f"{scenario}: the reference over an engine", RATIOS, left=2)
    for engine, profile, metric, subject in rows:
        if (engine, metric) != (REFERENCE, RATIO):
            continue
        first, *others = (rows[engine, profile, f"{metric}{suffix}", subject] for suffix in STATISTICS)
        factors = [value_text(rows.get((engine, profile, name, subject))) for name in FACTORS]
        table.add_row(
            profile, subject.replace(", drive=", " "), spread_text(first), *map(value_text, others), *factors
        )
    return table


def _show_judged(frame: pd.DataFrame, out: Console) -> None:
    """Print one row per ratio with a limit."""
    table = table_of("bench frame: the reference over the fastest engine", JUDGED, left=4)
    for row in rows_of(frame[frame.metric.str.startswith(RATIO) & (frame.verdict != "")]):
        statistic = WORDS[row.metric.removeprefix(RATIO)]
        between = f"{exact_number(row.low)} to {exact_number(row.high)}"
        over = row.subject.replace(", drive=", " ")
        cells = (row.scenario, row.profile, over, statistic, value_text(row), between)
        table.add_row(*cells, limit_text(row))
    out.print(table)

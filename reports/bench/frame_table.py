"""The tables of `bench frame`."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.bench.tables import (
    MICRO,
    interval_text,
    limit_text,
    print_remarks,
    spread_text,
    value_text,
)
from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.request import REFERENCE, step_text
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import table_of

MILLI = 1e3
JUDGED = ("scene", "over the fastest", "frame [µs]", "ratio", "95 % interval", "limit", "overlap")
DEEPER = " °"
NOTES = (
    "median frame, also over that of the other engines; ±: how far its 95 % interval reaches",
    "° overlaps deeper than the other: what it does faster, it may do less well",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one table per scene and class of steps: every engine over every other."""
    for scenario in dict.fromkeys(frame.scenario):
        rows = {
            (r.engine, r.profile, r.metric, r.subject): r for r in rows_of(frame[frame.scenario == scenario])
        }
        timed = [key[:2] for key in rows if key[2] == "time.frame"]
        for kind in dict.fromkeys(profile for engine, profile in timed if engine != REFERENCE):
            columns = [column for column in timed if column[0] == REFERENCE or column[1] == kind]
            heads = ("engine", "step [s]", "frame [µs]", "overlap [mm]", *(f"over {c[0]}" for c in columns))
            table = table_of(f"bench frame: {scenario}, {kind}", heads, left=2)
            for column in columns:
                table.add_row(*_cells(rows, column, columns))
            out.print(table)
        for key in timed:
            if reason := rows[*key, "time.frame", ""].reason:
                out.print(f"{' '.join(key)}: {reason}", highlight=False)
    _show_judged(frame, out)
    print_remarks(frame[frame.metric.isin(["run", "ratio.time"])], out, NOTES)


def _show_judged(frame: pd.DataFrame, out: Console) -> None:
    """Print one row per ratio with a limit: the reference over the fastest engine of a class of steps."""
    table = table_of("bench frame: the reference over the fastest engine", JUDGED, left=2)
    times = {(r.scenario, r.engine, r.profile): r.value for r in rows_of(frame[frame.metric == "time.frame"])}
    for row in rows_of(frame[(frame.metric == "ratio.time") & (frame.verdict != "")]):
        table.add_row(
            row.scenario,
            row.subject,
            exact_number(times[row.scenario, row.engine, row.profile] * MICRO),
            value_text(row),
            interval_text(row),
            limit_text(row),
            row.reason_code.replace("-", " "),
        )
    out.print(table)


def _cells(
    rows: dict[tuple[str, str, str, str], Row], mine: tuple[str, str], columns: list[tuple[str, str]]
) -> list[str]:
    time, overlap = rows[*mine, "time.frame", ""], rows.get((*mine, "overlap.max", ""))
    cells = [
        mine[0],
        step_text(time.dt),
        spread_text(time, MICRO),
        value_text(overlap, MILLI),
    ]
    for other in columns:
        ratio = rows.get((*mine, "ratio.time", " ".join(other)))
        theirs = rows.get((*other, "overlap.max", ""))
        deeper = overlap is not None and theirs is not None and overlap.value > theirs.value
        mark = DEEPER if ratio is not None and deeper else ""
        cells.append(spread_text(ratio) + mark)
    return cells

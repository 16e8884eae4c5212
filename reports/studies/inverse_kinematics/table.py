"""The table of the study `ik` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.results import rows_of
from touchstone.reports.studies.inverse_kinematics.study import SOLVERS, STARTS
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import print_notes, table_of

MICRO = 1e6
HEADS = (
    *("start", "solver", "missed\n[%]", "farthest\n[m]", "passes\nmedian", "p95", "max"),
    *("solve\n[µs]", "over pinocchio\n(95 % interval)"),
)
NOTES = (
    "missed: goals not reached to 1e-5 m; the loop gets no reach cones and 200 steps",
    "solve: the reference inside its compiled call, pinocchio's loop from Python",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one row per start and solver, the cost of a call, and every broken limit."""
    table = table_of("ik: random reachable goals of the left arm", HEADS, left=2, padding=(0, 0))
    for start in STARTS:
        for engine, profile in SOLVERS:
            part = frame[(frame.scenario == start) & (frame.engine == engine) & (frame.profile == profile)]
            table.add_row(start, f"{engine} {profile}", *_cells(part))
    out.print(table)
    for row in rows_of(frame[frame.metric == "time.crossing"]):
        cost = exact_number(row.value * MICRO)
        out.print(f"a call into {row.engine}: {cost} µs", style="dim", highlight=False)
    print_notes(NOTES, out)
    for row in rows_of(frame[frame.verdict.isin(["fail", "known", "error"])]):
        found, limit = exact_number(row.value), exact_number(row.limit)
        who = f"{row.verdict}: {row.engine} {row.profile}: {row.scenario} {row.metric}"
        out.print(f"{who} {found}, limit {limit}: {row.reason}", highlight=False, style="red")


def _cells(part: pd.DataFrame) -> list[str]:
    mine = {(row.metric, row.subject): row for row in rows_of(part)}
    ratio = mine.get(("ratio.time", "pinocchio"))
    return [
        exact_number(100 * mine["ik.missed", ""].value),
        exact_number(mine["ik.left", "max"].value),
        *(f"{mine['ik.passes', subject].value:.0f}" for subject in ("median", "p95", "max")),
        exact_number(mine["time.solve", ""].value * MICRO),
        f"{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})" if ratio is not None else "",
    ]

"""The table of checked robots on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.results import rows_of
from touchstone.reports.views.terminal import print_notes, table_of

HEADS = ("robot", "result", "deviation", "hinges", "mass [kg]", "notes")
RESULTS = {"skipped": "refused", "error": "error"}
NOTES = (
    "deviation: the largest of mass, centre, inertia (start and two random postures), axes and limits of "
    "hinges from the file, relative to the robot's mass, size or inertia; equal: at most 1e-9",
    "notes: lines of `touchstone import` about what a scene does not keep",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print a line per robot, what differs, and the reason of each that is refused."""
    table = table_of("robots, compared with their files", HEADS, left=2)
    counts: dict[str, int] = {}
    remarks = []
    for name, part in frame.groupby("scenario", sort=False):
        rows = {row.metric + row.subject: row for row in rows_of(part)}
        first = next(iter(rows.values()))
        result = RESULTS.get(first.verdict, "equal")
        cells = ["", "", "", ""]
        if result == "equal":
            off = {metric: row for metric, row in rows.items() if row.limit == row.limit}
            if any(row.verdict == "fail" for row in off.values()):
                result = "differs"
            hinges, mass, notes = (rows[f"robot{fact}"].value for fact in ("hinges", "mass", "notes"))
            largest = max(row.value for row in off.values())
            cells = [f"{largest:.0e}", f"{hinges:.0f}", f"{mass:.4g}", f"{notes:.0f}"]
            apart = [
                f"{m.removeprefix('robot.')} by {r.value:.1e}" for m, r in off.items() if r.verdict == "fail"
            ]
            remarks += [f"differs: {name}: {', '.join(apart)}"] if apart else []
        else:
            remarks.append(f"{result}: {name}: {first.reason}")
        counts[result] = counts.get(result, 0) + 1
        table.add_row(str(name), result, *cells)
    out.print(table)
    out.print(", ".join(f"{count} {result}" for result, count in counts.items()), highlight=False)
    print_notes(NOTES, out)
    for line in remarks:
        out.print(line, highlight=False, soft_wrap=True)

"""Terminal output of the study `calibration`."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.studies.calibration.findings import findings
from touchstone.reports.studies.calibration.table import NOTES, grids, remarks
from touchstone.reports.views.terminal import print_notes, table_of


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print all tables, their notes, and every finding, failure and broken limit."""
    for grid in grids(frame):
        heads = [head.replace(" ", "\n", 1) for head in grid.heads]
        table = table_of(grid.title, heads, padding=(0, 0))
        for row in grid.rows:
            table.add_row(*row)
        out.print(table)
    print_notes(NOTES, out)
    out.print()
    for line in findings(frame):
        out.print(line, highlight=False)
    for line in remarks(frame):
        style = "red" if line.startswith(("fail", "error")) else ""
        out.print(line, highlight=False, style=style)

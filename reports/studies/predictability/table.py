"""The table of the study `predictability` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console
from rich.text import Text

from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.predictability.definitions import CLOSED_FORM, DRAWS, METRIC, SIZES
from touchstone.reports.views.tables import number
from touchstone.reports.views.terminal import print_notes, table_of

NOTES = (
    f"final distance over perturbation: median of {DRAWS} random directions (least to largest)",
    "1: errors stay as they are; above: they grow; below: they are forgotten",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one block per scene, and every remark."""
    heads = ("engine", *(f"{size:g} m" for size in SIZES))
    table = table_of(
        "predictability: amplification of perturbations of the start", heads, padding=(0, 1, 0, 0)
    )
    measured = frame[frame.metric == METRIC]
    for scenario, scene in measured.groupby("scenario", sort=False):
        table.add_section()
        table.add_row(Text(str(scenario), "bold"))
        for engine, part in scene.groupby("engine", sort=False):
            style = "dim" if engine == CLOSED_FORM else ""
            table.add_row(str(engine), *map(_cell, rows_of(part)), style=style)
    out.print(table)
    print_notes(NOTES, out)
    for row in rows_of(frame[frame.metric == "run"]):
        out.print(f"{row.verdict}: {row.scenario}: {row.engine}: {row.reason}", highlight=False)


def _cell(row: Row) -> str:
    return f"{number(row.value)} ({number(row.low)} to {number(row.high)})"

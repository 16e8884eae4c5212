"""The table of the study `agreement` on a terminal: errors and their parts."""

from __future__ import annotations

import pandas as pd
from rich.console import Console
from rich.text import Text

from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.request import step_text
from touchstone.reports.studies.agreement.study import ROUNDING
from touchstone.reports.views.tables import number
from touchstone.reports.views.terminal import print_notes, table_of

HEADS = ("engine", "own step\n[s]", "error", "discreti-\nsation", "model", "")
NOTES = (
    "error: at the own step, largest over frames and bodies; positions over the longest way, turns in rad",
    "discretisation: what smaller steps change of it; model: by how much their limit misses the closed form",
    "what all play to rounding is left out   * farthest from its nearest neighbour",
    "! does not fall with the step   orders of convergence: touchstone study convergence",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one block per scene and quantity, and every remark."""
    title = "agreement: scenes with a closed form, each engine at its own step and down to 1/1920 s"
    table = table_of(title, HEADS, padding=(0, 1, 0, 0))
    for (scenario, quantity), part in frame[frame.metric == "agreement.model"].groupby(
        ["scenario", "subject"], sort=False
    ):
        block = frame[(frame.scenario == scenario) & (frame.subject == quantity)]
        if not (block[block.metric == "agreement.error"].value > ROUNDING).any():
            continue
        table.add_section()
        table.add_row(Text.assemble((str(scenario), "bold"), f" {quantity}"))
        outliers = rows_of(block[block.metric == "agreement.outlier"])
        lone = next((row.reason for row in outliers if row.value > ROUNDING), "")
        for model in rows_of(part[part.verdict != "skipped"]):
            table.add_row(*_cells(model, rows_of(block[block.engine == model.engine]), lone))
    out.print(table)
    print_notes(NOTES, out)
    for row in rows_of(frame[frame.metric == "run"]):
        out.print(f"{row.verdict}: {row.scenario}: {row.engine}: {row.reason}", highlight=False)


def _cells(model: Row, mine: list[Row], lone: str) -> list[str]:
    step = next(row for row in mine if row.metric == "agreement.discretisation")
    error = next(row for row in mine if row.metric == "agreement.error" and row.dt == step.dt)
    return [
        model.engine + ("*" if model.engine == lone else ""),
        step_text(step.dt),
        *map(_number, (error.value, step.value, model.value)),
        "!" if model.reason else "",
    ]


def _number(value: float) -> str:
    return "0" if value < ROUNDING else number(value)

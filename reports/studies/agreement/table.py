"""The table of the study `agreement` on a terminal: errors, their parts, and orders of convergence."""

from __future__ import annotations

from math import isnan

import pandas as pd
from rich.console import Console
from rich.text import Text

from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.request import step_text
from touchstone.reports.studies.agreement.study import ROUNDING
from touchstone.reports.views.tables import number
from touchstone.reports.views.terminal import print_notes, table_of

HEADS = ("engine", "own step\n[s]", "error", "discreti-\nsation", "model", "order\n(95 % interval)", "")
NOTES = (
    "error: at the own step, largest over frames and bodies; positions over the longest way, turns in rad",
    "discretisation: what smaller steps change of it; model: by how much their limit misses the closed form",
    "what all play to rounding is left out   * farthest from its nearest neighbour",
    "= rounding at every step   ! does not fall with the step",
    "unclear: the 95 % interval of the order is wider than 4",
)
UNCLEAR = 2.0
"""Half width of an order's interval above which no order is printed [1]."""


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one block per scene and quantity, and every remark."""
    title = "agreement: scenes with a closed form, each engine at its own step and down to 1/1920 s"
    table = table_of(title, HEADS, padding=(0, 1, 0, 0))
    for (scenario, quantity), part in frame[frame.metric == "agreement.order"].groupby(
        ["scenario", "subject"], sort=False
    ):
        block = frame[(frame.scenario == scenario) & (frame.subject == quantity)]
        if not (block[block.metric == "agreement.error"].value > ROUNDING).any():
            continue
        table.add_section()
        table.add_row(Text.assemble((str(scenario), "bold"), f" {quantity}"))
        outliers = rows_of(block[block.metric == "agreement.outlier"])
        lone = next((row.reason for row in outliers if row.value > ROUNDING), "")
        for order in rows_of(part):
            table.add_row(*_cells(order, block[block.engine == order.engine], lone))
    out.print(table)
    print_notes(NOTES, out)
    for row in rows_of(frame[frame.metric == "run"]):
        out.print(f"{row.verdict}: {row.scenario}: {row.engine}: {row.reason}", highlight=False)


def _cells(order: Row, mine: pd.DataFrame, lone: str) -> list[str]:
    values = {row.metric: row.value for row in rows_of(mine) if row.metric != "agreement.error"}
    error = next(row.value for row in rows_of(mine[mine.metric == "agreement.error"]) if row.dt == order.dt)
    exact = isnan(order.value)
    return [
        order.engine + ("*" if order.engine == lone else ""),
        step_text(order.dt),
        _number(error),
        _number(values["agreement.discretisation"]),
        _number(values["agreement.model"]),
        "=" if exact else _order(order),
        "!" if order.reason and not exact else "",
    ]


def _order(row: Row) -> str:
    if row.high - row.low > 2 * UNCLEAR:
        return "unclear"
    return f"{row.value:.2f} ({row.low:.2f} to {row.high:.2f})"


def _number(value: float) -> str:
    return "0" if value < ROUNDING else number(value)

"""The tables of the study `convergence`: order and floor per scene and engine, and per engine over all."""

from __future__ import annotations

import pandas as pd
from rich.console import Console
from rich.text import Text

from touchstone.adapters.registry import ENGINES
from touchstone.reports.results import Row, rows_of
from touchstone.reports.run.request import step_text
from touchstone.reports.studies.convergence.definitions import (
    BALANCED,
    FLOOR,
    NEARER,
    ORDER,
    STEPS,
    columns_of,
)
from touchstone.reports.studies.convergence.measure import ERROR
from touchstone.reports.studies.convergence.order import ABOVE, EXACT
from touchstone.reports.views.tables import number
from touchstone.reports.views.terminal import print_notes, table_of

HEADS = ("engine", "own step\n[s]", "error", "order\n(95 % interval)", "floor", "nearer than\nthe reference")
TOTALS = (
    *("engine", "scenes", "exact", "flat", "order: median\n(least to largest)", "median\nfloor"),
    *("largest\nfloor", "nearer in"),
)
NOTES = (
    "error: largest over bodies and frames at the own step, over the scene's size",
    f"order: over those of the steps {step_text(STEPS[0])} to {step_text(STEPS[-1])} s whose error exceeds "
    f"{ABOVE:g} floors; unclear: its interval is wider than 4",
    "= exact at every step   flat: no such step   few: one or two such steps",
    "floor: error at the finest step; < it still falls there",
    "! nearer to the truth than the reference (balanced) at so many of the steps, by which factor at most",
)
UNCLEAR = 2.0
"""Half width of an order's interval above which no order is printed [1]."""


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one block per scene, the totals per engine, and what did not end."""
    blocks = table_of("convergence: errors against truths at seven steps", HEADS, padding=(0, 1, 0, 0))
    for scenario, scene in frame[frame.metric != "run"].groupby("scenario", sort=False):
        blocks.add_section()
        blocks.add_row(Text(str(scenario), "bold"))
        for order in rows_of(scene[scene.metric == ORDER]):
            lost = _lost(scene, order.engine)
            blocks.add_row(*_cells(order, scene, lost), style="bold red" if len(lost) else "")
    out.print(blocks)
    totals = table_of("order and floor over all scenes", TOTALS, padding=(0, 1, 0, 0))
    for engine, profile in columns_of(ENGINES):
        mine = frame[(frame.engine == engine) & (frame.profile == profile)]
        if orders := rows_of(mine[mine.metric == ORDER]):
            lost = _lost(frame, engine)
            totals.add_row(f"{engine} {profile}", *_totals(orders, mine[mine.metric == FLOOR], lost))
    out.print(totals)
    print_notes(NOTES, out)
    for _, part in frame[frame.metric == "run"].groupby(["scenario", "engine", "reason"], sort=False):
        row, steps = rows_of(part)[0], " ".join(map(step_text, sorted(set(part.dt), reverse=True)))
        verdict = f"{row.verdict}: " if row.verdict else ""
        out.print(f"{verdict}{row.scenario}: {row.reason} ({row.engine} at {steps} s)", highlight=False)


def _lost(frame: pd.DataFrame, engine: str) -> pd.DataFrame:
    """Rows of the steps at which an engine is nearer to the truth than the reference's first profile."""
    return frame[(frame.metric == NEARER) & (frame.subject == engine) & (frame.profile == BALANCED)]


def _cells(order: Row, scene: pd.DataFrame, lost: pd.DataFrame) -> list[str]:
    mine = scene[(scene.engine == order.engine) & (scene.profile == order.profile)]
    own = mine[(mine.metric == ERROR) & (mine.dt == order.dt)].value
    floor = rows_of(mine[mine.metric == FLOOR])[0]
    return [
        f"{order.engine} {order.profile}",
        step_text(order.dt),
        _number(own.iloc[0]) if len(own) else "-",
        _order(order),
        ("< " if floor.reason else "") + _number(floor.value),
        f"! {len(lost)} of {len(STEPS)}, {number(lost.value.max())}" if len(lost) else "",
    ]


def _totals(orders: list[Row], floors: pd.DataFrame, lost: pd.DataFrame) -> list[str]:
    clear = pd.Series([row.value for row in orders if row.reason_code == "order" and not _wide(row)])
    return [
        str(len(orders)),
        *(str(sum(row.reason_code == kind for row in orders)) for kind in ("exact", "flat")),
        _range(clear.median(), clear.min(), clear.max()) if len(clear) else "-",
        _number(floors.value.median()),
        _number(floors.value.max()),
        str(lost.scenario.nunique() or ""),
    ]


def _order(row: Row) -> str:
    if row.reason_code != "order":
        return "=" if row.reason_code == "exact" else row.reason_code
    return "unclear" if _wide(row) else _range(row.value, row.low, row.high)


def _range(*values: float) -> str:
    """A value and its range; rounded to 0, it has no sign."""
    value, low, high = (round(x, 2) + 0.0 for x in values)
    return f"{value:.2f} ({low:.2f} to {high:.2f})"


def _wide(row: Row) -> bool:
    return row.high - row.low > 2 * UNCLEAR


def _number(value: float) -> str:
    return "0" if value <= EXACT else number(value)

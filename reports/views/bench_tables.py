"""Text of the cells of `bench` tables."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd
from rich.text import Text

from touchstone.reports.results import NOT_RUN, Row, rows_of
from touchstone.reports.views.render import Part
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import STYLES

MICRO = 1e6


def value_text(row: Row | None, factor: float = 1.0) -> str:
    """The value of a row; blank without a row, - without a value."""
    return "" if row is None else exact_number(row.value * factor)


def interval_text(row: Row | None, factor: float = 1.0) -> str:
    """The interval of a row."""
    if row is None or row.low != row.low:
        return ""
    return f"{exact_number(row.low * factor)} to {exact_number(row.high * factor)}"


def spread_text(row: Row | None, factor: float = 1.0) -> str:
    """The value of a row, and the distance of the farther end of its interval."""
    if row is None or row.low != row.low or row.value == 0:
        return value_text(row, factor)
    away = max(row.high - row.value, row.value - row.low) / abs(row.value)
    return f"{value_text(row, factor)} ±{100 * away:.0f} %"


def limit_text(row: Row | None) -> Text:
    """The verdict of a row and the limit behind it."""
    if row is None or row.limit != row.limit:
        return Text("")
    return Text(f"{row.verdict} {row.limit:g}", style=STYLES.get(row.verdict, ""))


def remarks(frame: pd.DataFrame, notes: Sequence[str]) -> Part:
    """Notes, then every row that broke a limit, failed or was skipped, with its reason."""
    lines = []
    for row in rows_of(frame[frame.verdict.isin(["fail", "error", "known", *NOT_RUN])]):
        name = " ".join(filter(None, (row.scenario, row.metric, row.subject))) if row.metric != "run" else ""
        value = (
            f" {exact_number(row.value)}, limit {exact_number(row.limit)}" if row.limit == row.limit else ""
        )
        lines.append(f"{row.verdict}: {row.engine}: {name}{value}: {row.reason}".replace(": :", ":"))
    return Part(notes=notes, lines=lines, wrap=True)

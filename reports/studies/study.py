"""What all studies share beside their tasks (`tasks.py`): the folder of results, texts of cells,
and failures as lines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from rich.text import Text

from touchstone.adapters.contract import MISSING
from touchstone.adapters.registry import installed, missing_reason
from touchstone.reports.results import NOT_RUN, Row, illustrate, rows_of, save, save_manifest, table
from touchstone.reports.runner.tasks import own_step
from touchstone.reports.views.render import Part, markdown
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import STYLES

Column = tuple[str, str]
"""Engine and profile."""
Picture = Callable[[pd.DataFrame, Path], object]


class RefusedError(ValueError):
    """What is asked for cannot be measured; the message says why, in one line."""


def missing_rows(study: str, columns: Iterable[Column], scenario: str = "all") -> list[Row]:
    """A row per column whose engine is not installed."""
    rows = [Row(study, scenario, *column, own_step(*column), "run", verdict=MISSING) for column in columns]
    return [replace(row, reason=missing_reason(row.engine)) for row in rows if not installed(row.engine)]


def with_interval(row: Row, interval: tuple[float, float, float], **fields: Any) -> Row:
    """The row with a value and the interval around it (value, low, high), and other fields."""
    value, low, high = interval
    return replace(row, value=value, low=low, high=high, **fields)


def kept(
    rows: Iterable[Row] | pd.DataFrame,
    folder: Path,
    facts: Mapping[str, object],
    pictures: Mapping[str, Picture] = {},
) -> pd.DataFrame:
    """Save rows, manifest and pictures by their names in the folder; returns the long table."""
    frame = rows if isinstance(rows, pd.DataFrame) else table(rows)
    save(frame, folder)
    save_manifest(folder, facts)
    for name, draw in pictures.items():
        illustrate(folder / name, partial(draw, frame))
    return frame


def failure_lines(frame: pd.DataFrame) -> list[str]:
    """Lines of rows that broke a limit or failed, and of runs that did not take place, with their reasons."""
    lines = []
    for row in rows_of(frame[frame.verdict.isin(["fail", "known", "error"]) | (frame.metric == "run")]):
        names = (row.engine, row.profile, row.scenario if row.scenario != "all" else "", row.subject)
        what = " ".join(filter(None, (*names, row.metric if row.metric != "run" else "")))
        if row.limit == row.limit:
            what += f" {exact_number(row.value)}, limit {exact_number(row.limit)}"
        lines.append(": ".join(filter(None, (row.verdict, what, row.reason))))
    return lines


def failures(frame: pd.DataFrame) -> Part:
    """`failure_lines` as a part of a report."""
    return Part(lines=failure_lines(frame))


def extremes(values: ArrayLike) -> tuple[float, float, float]:
    """Median of values, with the least and the largest."""
    found = np.asarray(values, dtype=float)
    return float(np.median(found)), float(found.min()), float(found.max())


def page_text(command: str, parts: Iterable[Part]) -> str:
    """A report as a page in Markdown."""
    return "\n".join([f"# touchstone {command}", *(line for part in parts for line in markdown(part))]) + "\n"


MICRO = 1e6


def value_text(row: Row | None, factor: float = 1.0) -> str:
    """The value of a row; blank without a row, - without a value."""
    return "" if row is None else exact_number(row.value * factor)


def interval_text(row: Row | None) -> str:
    """The interval of a row."""
    if row is None or row.low != row.low:
        return ""
    return f"{exact_number(row.low)} to {exact_number(row.high)}"


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
        value = ""
        if row.limit == row.limit:
            value = f" {exact_number(row.value)}, limit {exact_number(row.limit)}"
        lines.append(f"{row.verdict}: {row.engine}: {name}{value}: {row.reason}".replace(": :", ":"))
    return Part(notes=notes, lines=lines, wrap=True)

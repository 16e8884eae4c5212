"""The table of one scene: rows are metrics, columns are engines; the same cells for terminal and report."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from math import isnan

import numpy as np
import pandas as pd

from reports.metrics import METRICS
from reports.run import step_text

HIDDEN = ("work", "time.share")
"""Metrics that have a table of their own."""
OUTLIER_FACTOR = 3.0
"""A value is an outlier when it lies this many median deviations of the others from their median ..."""
OUTLIER_SHARE = 0.1
"""... and by more than this share of it."""
MARKS = {"fail": " ✗", "known": " †", "error": " ✗"}
LEGEND = "✗ limit broken   † known failing   * outlier of its row   - not measured"


@dataclass(frozen=True, slots=True)
class Cell:
    """A text, its verdict, and whether it is the outlier of its row."""

    text: str
    verdict: str = ""
    outlier: bool = False

    @property
    def marked(self) -> str:
        """The text with its marks, as in LEGEND."""
        return self.text + ("*" if self.outlier else "") + MARKS.get(self.verdict, "")


@dataclass(frozen=True, slots=True)
class Grid:
    """A table: heads of the columns (engine, profile, step), and rows of (metric, subject, unit, cells)."""

    heads: list[tuple[str, str, str]]
    rows: list[tuple[str, str, str, list[Cell]]]


def grid(frame: pd.DataFrame, scenario: str, shown: Collection[tuple[str, str]] = ()) -> Grid:
    """The grid of one scene from the long table; `shown` (engine, profile) columns, or all."""
    scene = frame[(frame.scenario == scenario) & (frame.engine != "all") & (frame.metric != "ratio.time")]
    columns = [c for c in dict.fromkeys(zip(scene.engine, scene.profile)) if not shown or c in shown]
    heads = []
    for engine, profile in columns:
        steps = scene[(scene.engine == engine) & (scene.profile == profile)].dt
        heads.append((engine, profile, step_text(float(steps.iloc[0]))))
    broken = scene[scene.metric == "run"]
    order = [name for name in METRICS if name not in HIDDEN]
    rows = []
    for metric in order:
        part = scene[scene.metric == metric]
        mine = np.array([column in columns for column in zip(part.engine, part.profile)], dtype=bool)
        named = part[mine & ~((part.verdict == "skipped") & (part.subject == ""))]
        for subject in dict.fromkeys(named.subject) or [""]:
            cells = [_cell(part, broken, metric, subject, column) for column in columns]
            rows.append((metric, subject, _unit(metric), _with_outlier(cells, part, subject, columns)))
    return Grid(heads, rows)


def _unit(metric: str) -> str:
    shown = METRICS[metric].shown
    return shown[0] if shown else METRICS[metric].unit


def _cell(
    part: pd.DataFrame, broken: pd.DataFrame, metric: str, subject: str, column: tuple[str, str]
) -> Cell:
    mine = part[(part.engine == column[0]) & (part.profile == column[1])]
    chosen = mine[mine.subject == subject]
    if chosen.empty:
        failed = broken[(broken.engine == column[0]) & (broken.profile == column[1])]
        if not failed.empty:
            return Cell(str(failed.verdict.iloc[0]), str(failed.verdict.iloc[0]))
        return Cell("-")
    row = chosen.iloc[0]
    if isnan(row.value):
        return Cell("never" if row.verdict == "fail" else "-", row.verdict)
    shown = METRICS[metric].shown
    return Cell(number(row.value * (shown[1] if shown else 1.0)), row.verdict)


def number(value: float) -> str:
    """Three significant digits; two and an exponent below 1e-3 and from 1e4; 0 for rounding."""
    if abs(value) < 1e-12:
        return "0"
    # rounding may carry into another digit: 9.999 is 10.0
    rounded = abs(float(f"{value:.2e}") if abs(value) < 1e3 else float(f"{value:.0f}"))
    if 1e-3 <= rounded < 1e4:
        digits = max(0, 2 - int(np.floor(np.log10(rounded))))
        return f"{value:.{digits}f}"
    return f"{value:.1e}"


def exact_number(value: float) -> str:
    """As `number`, where 1e-15 is no zero; - for none."""
    if isnan(value):
        return "-"
    return f"{value:.1e}" if 0 < abs(value) < 1e-3 else number(value)


def _with_outlier(
    cells: list[Cell], part: pd.DataFrame, subject: str, columns: list[tuple[str, str]]
) -> list[Cell]:
    """Mark the one value that stands apart from the others."""
    rows = part[part.subject == subject]
    values = np.full(len(columns), np.nan)
    for k, (engine, profile) in enumerate(columns):
        mine = rows[(rows.engine == engine) & (rows.profile == profile)].value
        if not mine.empty:
            values[k] = mine.iloc[0]
    if np.isfinite(values).sum() < 4:
        return cells
    middle = np.nanmedian(values)
    away = np.abs(values - middle)
    k = int(np.nanargmax(away))
    rest = np.delete(away, k)
    if away[k] > max(OUTLIER_FACTOR * float(np.nanmedian(rest)), OUTLIER_SHARE * abs(middle), 1e-12):
        cells = list(cells)
        cells[k] = Cell(cells[k].text, cells[k].verdict, outlier=True)
    return cells

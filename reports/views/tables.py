"""The table of one scene: rows are metrics, columns are engines. Terminal and report share its cells.

The bodies that are farthest apart between two columns, in words.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import isnan, nan

import numpy as np
import pandas as pd

from touchstone.reports.metrics import METRICS, PARITY, SPREAD, in_tables
from touchstone.reports.results import CONSTRUCTION, HARNESS, NOT_RUN, UNAUDITED, UNJUDGED, Row, rows_of
from touchstone.reports.runner.request import step_text

HIDDEN = ("work", "time.share", "state.hash")
"""Metrics that have a table of their own."""
OUTLIER_FACTOR = 3.0
"""Least distance of an outlier from the median, in median deviations of the other values [1]."""
OUTLIER_SHARE = 0.1
"""Least distance of an outlier from the median, as a share of the median [1]."""
MARKS = {"fail": " ✗", "known": " †", "error": " ✗", UNJUDGED: " ?"}
BASIS_MARKS = {CONSTRUCTION: " =", UNAUDITED: " ~", HARNESS: " h"}
LEGEND = (
    "✗ limit broken   † known failing   ? not judged   * outlier of its row   - not measured\n"
    "= met by construction   ~ rests on impulses that nothing balances   h caused by our drive"
)


@dataclass(frozen=True, slots=True)
class TableCell:
    """A text, its verdict, and whether it is the outlier of its row."""

    text: str
    verdict: str = ""
    outlier: bool = False
    basis: str = ""

    @property
    def marked(self) -> str:
        """The text with its marks, as in LEGEND."""
        missed = MARKS.get(self.verdict, "")
        basis = "" if missed and self.basis == CONSTRUCTION else BASIS_MARKS.get(self.basis, "")
        return self.text + ("*" if self.outlier else "") + basis + missed


@dataclass(frozen=True, slots=True)
class Grid:
    """A table: column headings (engine, profile, step), and rows of (metric, subject, unit, cells)."""

    heads: list[tuple[str, str, str]]
    rows: list[tuple[str, str, str, list[TableCell]]]


Column = tuple[str, str]
"""Engine and profile."""
Rows = dict[tuple[Column, str, str], Row]
"""Rows by column, metric and subject."""


def grid(frame: pd.DataFrame, scenario: str) -> Grid:
    """The grid of one scene from the long table. Metrics that apply to no column get no row."""
    scene = rows_of(frame[(frame.scenario == scenario) & (frame.engine != "all")])
    scene = [row for row in scene if not row.metric.startswith("ratio.")]
    found: Rows = {((row.engine, row.profile), row.metric, row.subject): row for row in scene}
    steps = columns_of(scene)
    subjects: dict[str, dict[str, None]] = {}
    for row in scene:
        if row.verdict not in NOT_RUN or row.subject:
            subjects.setdefault(row.metric, {})[row.subject] = None
    rows = []
    for metric in (name for name in (*METRICS, PARITY) if name not in HIDDEN):
        for subject in subjects.get(metric, {}):
            cells = [_cell(found, column, metric, subject) for column in steps]
            mine = [found.get((column, metric, subject)) for column in steps]
            values = [nan if row is None else row.value for row in mine]
            rows.append((metric, subject, unit_of(metric), _with_outlier(cells, values)))
    return Grid([(*column, step) for column, step in steps.items()], rows)


def columns_of(rows: Iterable[Row]) -> dict[Column, str]:
    """The columns in their order, each with its step."""
    steps: dict[Column, str] = {}
    for row in rows:
        steps.setdefault((row.engine, row.profile), step_text(row.dt))
    return steps


def first_columns(columns: Iterable[Column]) -> list[Column]:
    """The first column of each engine: its own profile."""
    found: dict[str, Column] = {}
    for column in columns:
        found.setdefault(column[0], column)
    return list(found.values())


def unit_of(metric: str) -> str:
    """The unit of tables; of what is no metric of one recording, "s" of PARITY and "1" of ratios of times."""
    return "s" if metric == PARITY else in_tables(metric)[0]


def _cell(found: Rows, column: Column, metric: str, subject: str) -> TableCell:
    row = found.get((column, metric, subject))
    if row is None:
        broken = found.get((column, "run", ""))
        return TableCell(broken.verdict, broken.verdict) if broken else TableCell("-")
    return cell_of(row)


def cell_of(row: Row) -> TableCell:
    """The value of a row in the unit of tables, with its verdict."""
    if isnan(row.value):
        return TableCell("never" if row.verdict == "fail" else "-", row.verdict)
    return TableCell(scaled_number(row.metric, row.value), row.verdict, basis=row.basis)


def quantity(metric: str, value: float, unit: str = "") -> tuple[str, str]:
    """A value and its unit as readers see them: in the metric's shown unit, else in `unit` [SI]."""
    name, scale = shown_unit(metric, unit)
    return exact_number(value * scale), name


def shown_unit(metric: str, unit: str = "") -> tuple[str, float]:
    """A unit as readers see it, and how many of it make one of the metric's: its shown unit, else `unit`."""
    name, scale = in_tables(metric)
    name = name if metric in METRICS else unit
    return {"1": "", "us": "µs"}.get(name, name), scale


def scaled_number(metric: str, value: float) -> str:
    """A value in the metric's unit of tables."""
    return number(value * in_tables(metric)[1])


def number(value: float) -> str:
    """Three significant digits; two and an exponent below 1e-3 and from 1e4; 0 for rounding."""
    if abs(value) < 1e-12:
        return "0"
    # Rounding may carry into another digit: 9.999 is 10.0.
    rounded = abs(float(f"{value:.2e}") if abs(value) < 1e3 else float(f"{value:.0f}"))
    if 1e-3 <= rounded < 1e4:
        digits = max(0, 2 - int(np.floor(np.log10(rounded))))
        return f"{value:.{digits}f}"
    return f"{value:.1e}"


def exact_number(value: float) -> str:
    """As `number`, but without rounding small values to zero; - for a missing value."""
    if isnan(value):
        return "-"
    return f"{value:.1e}" if 0 < abs(value) < 1e-3 else number(value)


def _with_outlier(cells: list[TableCell], values: Sequence[float]) -> list[TableCell]:
    """Mark the outlier among four values or more."""
    if np.isfinite(values).sum() < 4:
        return cells
    middle = np.nanmedian(values)
    away = np.abs(np.array(values) - middle)
    k = int(np.nanargmax(away))
    rest = np.delete(away, k)
    if away[k] > max(OUTLIER_FACTOR * float(np.nanmedian(rest)), OUTLIER_SHARE * abs(middle), 1e-12):
        cells = list(cells)
        cells[k] = replace(cells[k], outlier=True)
    return cells


APART = "farthest apart"
APART_HEADS = ("scene", "body", "distance", "")
BODIES_SHOWN = 8
"""Bodies of a table that are shown; those beyond are counted."""


def length_text(value: float) -> str:
    """A length in m, mm or um."""
    unit, size = next((one for one in (("m", 1.0), ("mm", 1e-3)) if value >= one[1]), ("um", 1e-6))
    return f"{value / size:.3g} {unit}"


def apart_table(rows: Sequence[Row]) -> list[list[str]]:
    """Lines under APART_HEADS of the bodies that are farthest apart, over all scenes."""
    rows = sorted((row for row in rows if row.metric == SPREAD), key=lambda row: -row.value)
    lines = [[row.scenario, row.subject, length_text(row.value), row.reason] for row in rows[:BODIES_SHOWN]]
    more = len(rows) - len(lines)
    return [*lines, ["", f"and {more} more", f"at most {lines[-1][2]}", ""]] if more else lines


def headlines(scene: Sequence[Row]) -> list[str]:
    """The farthest body of a scene in one line; nothing where nothing is compared."""
    apart = [row for row in scene if row.metric == SPREAD]
    if apart and all(row.value == 0 for row in apart):
        return [f"{APART}: no body, all paths are equal"]
    return [f"{APART}: {body}, {size}: {text}" for _, body, size, text in apart_table(scene)[:1]]

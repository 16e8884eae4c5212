"""The tables of given pairs on a terminal: each detector over all pairs, and each pair with who is off."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.adapters.detectors import FAILURES
from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.narrow_phase.given_pairs import (
    DISTANCE,
    ERROR,
    MISSED,
    NORMAL,
    TIME,
    TRUTH,
    WRONG_SIGN,
)
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import print_notes, table_of

OFF = 1e-6
"""Depth error above which a detector is named beside a pair [1]: single precision over size / 1000."""
HEADS = (
    *("detector", "depth error\nmedian", "max", "normal\nmax [rad]", "wrong\nsign", "missed", "failed"),
    *("unsupported", "query\n[µs]"),
)
NOTES = (
    "depth error: over max(depth, size / 1000); a missed contact counts as depth 0",
    f"beside a pair: detectors whose depth error exceeds {OFF:g}, the largest first, or that gave no answer",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one row per detector, one line per pair, and why detectors did not take part."""
    rows = rows_of(frame)
    truths = {row.scenario: row for row in rows if row.engine == TRUTH}
    mine: dict[str, list[Row]] = {}
    for row in rows:
        if row.engine != TRUTH and row.metric != "run":
            mine.setdefault(row.engine, []).append(row)
    table = table_of("narrow-phase: given pairs against the explicit Minkowski difference", HEADS)
    for name, found in mine.items():
        table.add_row(name, *_cells(found))
    out.print(table)
    for name, truth in truths.items():
        off = _off([row for row in rows if row.scenario == name and row.metric == ERROR])
        source = f" ({truth.reason})" if truth.reason else ""
        out.print(f"{name}{source}: {truth.value:.6g} m: {off}", highlight=False, soft_wrap=True)
    print_notes(NOTES, out)
    for row in rows:
        if row.metric == "run":
            out.print(f"{row.verdict}: {row.engine}: {row.reason}", highlight=False)


def _cells(found: list[Row]) -> list[str]:
    def values(metric: str) -> pd.Series:
        return pd.Series([row.value for row in found if row.metric == metric]).dropna()

    def counted(*starts: str) -> str:
        return str(sum(row.reason.startswith(starts) for row in found if row.metric == DISTANCE))

    errors, (unsupported, *failures) = values(ERROR), FAILURES
    return [
        exact_number(errors.median()),
        exact_number(errors.max()),
        exact_number(values(NORMAL).max()),
        counted(WRONG_SIGN),
        counted(MISSED),
        counted(*failures),
        counted(unsupported),
        exact_number(1e6 * values(TIME).median()),
    ]


def _off(errors: list[Row]) -> str:
    """Detectors that are off in one pair, with their errors or what they said."""
    wrong = [row for row in errors if row.value > OFF or (row.reason and row.value != row.value)]
    wrong.sort(key=lambda row: -row.value if row.value == row.value else float("inf"))
    texts = []
    for row in wrong:
        kind = row.reason.partition(":")[0]
        figure = exact_number(row.value) if row.value == row.value else ""
        texts.append(" ".join(filter(None, (row.engine, figure, kind))))
    return ", ".join(texts) or "all agree"

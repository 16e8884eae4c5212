"""The tables of the study `robustness` on a terminal."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.results import Row, rows_of
from touchstone.reports.studies.robustness.study import ALL, COUNTS, STUDY
from touchstone.reports.verdict.outcomes import RANDOM_CLASSES
from touchstone.reports.views.terminal import print_notes, table_of
from touchstone.scenarios.random_scenes import ALL_KINDS

FIGURES = {
    "rise p50": "rise.p50",
    "p99": "rise.p99",
    "max": "rise.max",
    "resid. p50": "residual.p50",
    "p99.5": "residual.p995",
    "max ": "residual.max",
    "solves": "solves.open",
    "overlap": "overlap.max",
    "dropped": "dropped_time.max",
    "frame": "slowest.max",
}
"""Headings of columns, and the metrics below them."""
NOTES = (
    "rise: of each run, the largest rise of energy in a frame over the energy at the start [1]",
    "residual: of each frame, what the contact solver left [m/s]; solves: share of contact solves that leave",
    "more than 1e-7 m/s [1]; overlap [m]; dropped: of each run, the time not simulated [s]; frame: the",
    "slowest [s]",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one table per column, then broken limits, then the worst runs with the commands that repeat
    them."""
    figures = frame[frame.metric != "run"]
    for (engine, profile), part in figures.groupby(["engine", "profile"], sort=False):
        seen = [
            outcome
            for outcome, metric in zip(RANDOM_CLASSES, COUNTS)
            if part[(part.metric == metric) & (part.scenario == ALL)].value.sum() > 0
        ]
        shown = {head: f"{STUDY}.{name}" for head, name in FIGURES.items()}
        shown = {head: metric for head, metric in shown.items() if (part.metric == metric).any()}
        table = table_of(
            f"robustness: {engine}, {profile}", ("kind", "runs", *seen, *shown), padding=(0, 1, 0, 0)
        )
        for kind in (*ALL_KINDS, ALL):
            rows = {row.metric: row for row in rows_of(part[part.scenario == kind])}
            if not rows:
                continue
            counts = {outcome: int(rows[metric].value) for outcome, metric in zip(RANDOM_CLASSES, COUNTS)}
            if kind == ALL:
                table.add_section()
            table.add_row(
                kind,
                str(sum(counts.values())),
                *(str(counts[outcome] or "") for outcome in seen),
                *(_cell(rows.get(metric)) for metric in shown.values()),
            )
        out.print(table)
    print_notes(NOTES, out)
    for row in rows_of(figures[figures.verdict == "fail"]):
        out.print(
            f"limit broken: {row.engine} {row.profile}: {row.metric} = {short(row.value)}, "
            f"limit {row.limit:g}: {row.reason}",
            highlight=False,
        )
    for row in rows_of(frame[frame.metric == "run"]):
        what = row.verdict or f"{row.subject} {short(row.value)} {row.scenario}"
        text = ": ".join(part for part in (what, row.reproduce, row.reason) if part)
        out.print(text, highlight=False, soft_wrap=True)


def _cell(row: Row | None) -> str:
    return "" if row is None else short(row.value)


def short(value: float) -> str:
    """A value as one digit and a power of ten."""
    return f"{value:.0e}".replace("e-0", "e-").replace("e+0", "e").replace("e+", "e") if value else "0"

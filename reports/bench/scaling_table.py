"""The table of `bench scaling`."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.reports.bench.tables import MICRO, interval_text, limit_text, print_remarks, value_text
from touchstone.reports.results import rows_of
from touchstone.reports.views.terminal import table_of

NOTES = ("exponent: of the power law that fits the medians by least squares, with its 95 % interval",)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one table per curve: times by size, and the exponent."""
    for scenario in dict.fromkeys(frame[frame.metric == "scaling.time"].scenario):
        part = frame[frame.scenario == scenario]
        sizes = list(dict.fromkeys(part[part.metric == "scaling.time"].subject))
        numbers, units = zip(*(size.split() for size in sizes))
        heads = (units[0], *numbers, "exponent", "95 % interval", "limit")
        table = table_of(f"bench scaling: {scenario}, median time [µs]", heads, left=1)
        for engine in dict.fromkeys(part[part.metric == "scaling.time"].engine):
            mine = {(row.metric, row.subject): row for row in rows_of(part[part.engine == engine])}
            power = mine.get(("scaling.exponent", ""))
            cells = [value_text(mine.get(("scaling.time", size)), MICRO) for size in sizes]
            table.add_row(engine, *cells, value_text(power), interval_text(power), limit_text(power))
        out.print(table)
    remarks = frame[(frame.metric == "scaling.time") & (frame.reason != "")]
    for (scenario, engine), part in remarks.groupby(["scenario", "engine"], sort=False):
        reasons = ", ".join(f"{row.subject} {row.reason}" for row in rows_of(part))
        out.print(f"{scenario}: {engine}: {reasons}", highlight=False)
    print_remarks(frame, out, NOTES)

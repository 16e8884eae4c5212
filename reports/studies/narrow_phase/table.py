"""The table of the study `narrow-phase` on a terminal, and the best detectors per family."""

from __future__ import annotations

from math import isnan

import pandas as pd
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table

from touchstone.reports.results import NOT_RUN, rows_of
from touchstone.reports.studies.narrow_phase import pair_table
from touchstone.reports.studies.narrow_phase.given_pairs import TRUTH
from touchstone.reports.studies.poses import FAMILIES
from touchstone.reports.views.tables import exact_number
from touchstone.reports.views.terminal import print_notes, table_of

MICRO = 1e6
ROUNDING, FINE = 1e-12, 1e-4
"""Depth errors that separate detectors [1]: a few thousand roundings over size / 1000, and an error too small
to matter in a simulation."""
HEADS = (
    *(
        "detector",
        "median",
        "depth error\np95",
        "max",
        "normal\nmax [rad]",
        "wrong\nsign",
        "missed",
        "failed",
    ),
    *("query\n[µs]", "net\n[µs]", "reference over it\n(95 % interval)"),
)
NOTES = (
    "depth error: over max(depth, size / 1000); a missed contact counts as depth 0",
    "failed: unsupported, threw, or says itself that it did not converge (then the answer counts)",
    "query: from Python, shapes and poses prepared; net: less the cheapest call, of two spheres",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one row per detector over all families, the best of each family, and every remark."""
    if (frame.engine == TRUTH).any():
        pair_table.show(frame, out)
        return
    whole = frame[frame.scenario == "all"]
    title = "narrow-phase: all families against the explicit Minkowski difference"
    table = table_of(title, HEADS, padding=(0, 0))
    for name in dict.fromkeys(whole.engine):
        table.add_row(name, *_cells(whole, name))
    out.print(table)
    print_notes(NOTES, out)
    out.print()
    out.print(_families(frame))
    for line in remarks(frame):
        out.print(line, highlight=False, style="red" if line.startswith(("fail", "error")) else "")


def _cells(whole: pd.DataFrame, name: str) -> list[str]:
    mine = {(row.metric, row.subject): row for row in rows_of(whole[whole.engine == name])}
    if ("run", "") in mine:
        return [mine["run", ""].verdict]
    ratio = next(iter(rows_of(whole[(whole.metric == "ratio.time") & (whole.subject == name)])), None)
    failed = sum(row.value for (metric, _), row in mine.items() if metric == "exception")
    return [
        *(exact_number(mine["depth.error." + kind, ""].value) for kind in ("median", "p95", "max")),
        exact_number(mine["normal.error", "max"].value),
        f"{mine['sign.wrong', ''].value:.0f}",
        f"{mine['contact.missed', ''].value:.0f}",
        f"{failed:.0f}",
        *(exact_number(mine[metric, ""].value * MICRO) for metric in ("time.query", "time.net")),
        f"{ratio.value:.2f} ({ratio.low:.2f} to {ratio.high:.2f})"
        if ratio is not None and not isnan(ratio.value)
        else "",
    ]


def _families(frame: pd.DataFrame) -> Table:
    """Per family the detectors that are exact to rounding, and the fastest among those exact to FINE."""
    table = Table(box=SIMPLE, padding=(0, 0), pad_edge=False)
    table.add_column("family", no_wrap=True)
    table.add_column(f"p95 of the depth error below {ROUNDING:.0e}")
    table.add_column(f"fastest net, p95 below {FINE:.0e} [µs]", no_wrap=True)
    for family in FAMILIES:
        part = frame[(frame.scenario == family) & frame.value.notna()]
        error = {row.engine: row.value for row in rows_of(part[part.metric == "depth.error.p95"])}
        right = [name for name in error if error[name] < ROUNDING]
        times = [row for row in rows_of(part[part.metric == "time.net"]) if error.get(row.engine, 1.0) < FINE]
        best = min(times, key=lambda row: row.value, default=None)
        fastest = "-" if best is None else f"{best.engine} {exact_number(best.value * MICRO)}"
        table.add_row(family, ", ".join(right) or "-", fastest)
    return table


def remarks(frame: pd.DataFrame) -> list[str]:
    """Broken limits, runs that are skipped as a whole and failures, with reasons."""
    lines = []
    for row in rows_of(frame[frame.verdict.isin(["fail", "known", "error"])]):
        value = "" if row.metric == "run" else f" {row.scenario} {row.metric} {exact_number(row.value)}"
        limit = "" if row.metric == "run" else f", limit {exact_number(row.limit)}"
        lines.append(f"{row.verdict}: {row.engine}:{value}{limit}: {row.reason}")
    for row in rows_of(frame[frame.verdict.isin(NOT_RUN) & (frame.metric == "run")]):
        lines.append(f"{row.verdict}: {row.engine}: {row.reason}")
    failed = frame[(frame.metric == "exception") & (frame.scenario == "all") & (frame.value > 0)]
    for row in rows_of(failed):
        lines.append(f"{row.subject}: {row.engine}, {row.value:.0f} pairs: {row.reason}")
    return lines

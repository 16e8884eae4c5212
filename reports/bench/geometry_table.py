"""The table of `bench geometry`."""

from __future__ import annotations

import pandas as pd
from rich.console import Console

from touchstone.adapters.detectors import REFERENCE
from touchstone.reports.bench.tables import MICRO, interval_text, limit_text, print_remarks, value_text
from touchstone.reports.results import Row, rows_of
from touchstone.reports.views.terminal import table_of

HEADS = ("family", "detector", "query", "net", "error", "over it", "95 % interval", "limit")
NOTES = (
    "query: median from Python [µs], shapes and poses prepared; net: less the cheapest call, of two spheres",
    "error: the largest of the depth over max(depth, size / 1000), against the explicit Minkowski difference",
    "over it: net time of the reference over the detector's, query by query",
)


def show(frame: pd.DataFrame, out: Console) -> None:
    """Print one row per family and detector for each of the reference's, and the reference's certificates."""
    rows = {(row.scenario, row.engine, row.metric, row.subject): row for row in rows_of(frame)}
    timed = frame[frame.metric == "time.net"]
    ratios = frame[frame.metric == "ratio.time"]
    for name in dict.fromkeys(ratios.engine):
        title = f"bench geometry: {name} over other detectors"
        table = table_of(title, HEADS, left=2)
        for family in dict.fromkeys(timed.scenario):
            table.add_section()
            detectors = [
                e for e in dict.fromkeys(timed.engine) if e == name or (family, name, "ratio.time", e) in rows
            ]
            for k, detector in enumerate(detectors):
                ratio = rows.get((family, name, "ratio.time", detector))
                table.add_row(
                    "" if k else family,
                    detector,
                    *_times(rows, family, detector),
                    value_text(ratio),
                    interval_text(ratio),
                    limit_text(ratio),
                )
        out.print(table)
    for family, name in dict.fromkeys((row[0], row[1]) for row in rows if row[2] == "certificate.open"):
        unsure, wrong = (
            rows[family, name, metric, ""] for metric in ("certificate.open", "certificate.false")
        )
        share, count = (
            f"{100 * unsure.value:.3g} % ({unsure.verdict})",
            f"{wrong.value:.0f} ({wrong.verdict})",
        )
        source = "from the frame before" if name != REFERENCE else ""
        line = f"{family}: {name}: {share} of the answers not proved {source}".rstrip()
        line += f"; {count} proved and wrong"
        out.print(line, highlight=False)
    print_remarks(frame, out, NOTES)


def _times(rows: dict[tuple[str, str, str, str], Row], family: str, detector: str) -> list[str]:
    query, net, error = (
        rows.get((family, detector, metric, "")) for metric in ("time.query", "time.net", "depth.error.max")
    )
    return [value_text(query, MICRO), value_text(net, MICRO), value_text(error)]
